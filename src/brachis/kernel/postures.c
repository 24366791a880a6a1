/* Postures along a path, by a closed form or in a chart, in the right turns by 2 pi; and all that is computed there. */

#include <math.h>
#include <stddef.h>

#include "motion.h"

static const double TURN = 6.283185307179586476925;

/* Take that answer of the closed form for each posture that is nearest, modulo turns, to `near`, or to the posture before. If
none exists, the first is taken. */
static void take_answers(path_motion *motion, long n, long m)
{
    const branch *branch = motion->branch;
    long r = n - m;
    const double *before = branch->start;
    for (long k = 0; k < motion->count; k++) {
        const double *answers = motion->answers + k * branch->alternatives * m;
        double *q = motion->q + k * n;
        long best = 0;
        double least = INFINITY;
        before = motion->near ? motion->near + k * n : before;
        for (long i = 0; i < branch->alternatives; i++) {
            double square = 0.0;
            for (long j = 0; j < m; j++) {
                double gap = answers[i * m + j] - before[branch->nonredundant[j]];
                gap -= branch->turns[branch->nonredundant[j]] != 0.0 ? TURN * nearbyint(gap / TURN) : 0.0;
                square += gap * gap;
            }
            if (square < least) {
                least = square;
                best = i;
            }
        }
        for (long j = 0; j < r; j++) {
            q[branch->redundant[j]] = motion->y[k * (1 + r) + 1 + j];
        }
        for (long j = 0; j < m; j++) {
            q[branch->nonredundant[j]] = answers[best * m + j];
        }
        before = least < INFINITY ? q : before;
    }
}

/* Put angles into the turns nearest to `near`, or to the angles before, at first to the start. In the second case nothing is
done if one number is not finite. */
static void take_turns(path_motion *motion, long n)
{
    const branch *branch = motion->branch;
    if (!motion->near && !all_finite(motion->q, motion->count * n)) {
        return;
    }
    for (long j = 0; j < n; j++) {
        double before = branch->start[j];
        for (long k = 0; k < motion->count && branch->turns[j] != 0.0; k++) {
            double *angle = &motion->q[k * n + j];
            before = motion->near ? motion->near[k * n + j] : before;
            *angle += TURN * nearbyint((before - *angle) / TURN);
            before = *angle;
        }
    }
}

/* Put angles into the turns to which their velocities and accelerations lead. The predicted step of an angle is that of the
quintic through both ends,

    h (v0 + v1) / 2 - h^2 (a1 - a0) / 12.

Returns 0 if the predicted step of a joint with a finite range differs from every possible step by more than a quarter turn. */
static int follow_rates(path_motion *motion, long n)
{
    const branch *branch = motion->branch;
    for (long j = 0; j < n; j++) {
        double before = 0.0;
        double counted = 0.0;
        for (long k = 0; k < motion->count && branch->turns[j] != 0.0; k++) {
            long at = k * n + j;
            double angle = motion->q[at];
            if (k > 0) {
                double h = motion->t[k] - motion->t[k - 1];
                double rise = motion->qddot[at] - motion->qddot[at - n];
                double step = 0.5 * h * (motion->qdot[at] + motion->qdot[at - n]) - h * h / 12.0 * rise;
                double gap = (step - (angle - before)) / TURN;
                double turns = nearbyint(gap);
                if (branch->ranged[j] != 0.0 && !(fabs(gap - turns) <= 0.25)) {
                    return 0;
                }
                counted += turns;
            }
            before = angle;
            motion->q[at] = angle + TURN * counted;
        }
    }
    return 1;
}

/* Postures of a chart by Newton's method, from `near` or beside its reference: at each point posture, sigma and dq/dsigma, n + r +
n r numbers. Within 0.8 rad or m the reference's own self-motion says where a posture is. */
static void solve_chart(path_motion *motion, long n, long r, long coordinates)
{
    for (long k = 0; k < motion->count; k++) {
        const double *reference = motion->reference + k * (n + r + n * r);
        const double *rows = motion->rows + k * motion->rows_step;
        const double *curves = motion->y + k * (1 + r) + 1;
        double aside[n];
        double largest = 0.0;
        for (long i = 0; i < n; i++) {
            aside[i] = 0.0;
            for (long j = 0; j < r; j++) {
                aside[i] += reference[n + r + i * r + j] * (curves[j] - reference[n + j]);
            }
            largest = fabs(aside[i]) < largest ? largest : fabs(aside[i]);
        }
        for (long i = 0; i < n; i++) {
            motion->q[k * n + i] = motion->near ? motion->near[k * n + i] : reference[i] + (largest < 0.8 ? aside[i] : 0.0);
        }
        for (long j = 0; j < r; j++) {
            motion->levels[k * r + j] = curves[j] + rows[j * (n + 1) + n];
        }
    }
    const posture_search search = {
        motion->arm, motion->task, motion->count, coordinates, motion->targets, motion->q, r, motion->rows, motion->rows_step,
        n + 1, motion->levels, 0,
    };
    brachis_newton(&search, motion->q);
}

/* Find the postures q; nothing is done where they are given. */
void brachis_postures(path_motion *motion)
{
    long n = motion->arm->joints;
    long m = select_parts(motion->task).count;
    long r = n - m;
    long coordinates = motion->task->turns == 3 ? motion->task->rows + 9 : m;
    if (motion->reference) {
        solve_chart(motion, n, r, coordinates);
    }
    if (!motion->branch) {
        return;
    }
    if (motion->branch->answers_of) {
        const double *q_r = motion->y + 1;
        brachis_formula(
            motion->branch->answers_of, motion->count, motion->targets, coordinates, q_r, 1 + r, motion->answers
        );
    }
    take_answers(motion, n, m);
    take_turns(motion, n);
}

enum { NO_FAULT, NO_POSTURE, SINGULAR, TURNS_TOO_FAR };

/* Find postures and motion. Returns what is at fault. */
int brachis_evaluate(path_motion *motion)
{
    long n = motion->arm->joints;
    brachis_postures(motion);
    if (!all_finite(motion->q, motion->count * n)) {
        return NO_POSTURE;
    }
    brachis_path_motion(motion);
    for (long k = 0; k < motion->count; k++) {
        double determinant = motion->determinants[k];
        double size = motion->side == 0.0 ? fabs(determinant) : determinant * motion->side;
        if (!(size > 0.0)) {
            return SINGULAR;
        }
    }
    if (motion->branch && motion->t && !follow_rates(motion, n)) {
        return TURNS_TOO_FAR;
    }
    return NO_FAULT;
}
