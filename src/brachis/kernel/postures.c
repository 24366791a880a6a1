/* Postures along a path, by a closed form or in a chart, in the right turns by 2 pi; and all that is computed there. */

#include <math.h>
#include <stddef.h>

#include "motion.h"

static const double TURN = 6.283185307179586476925;

/* Take that answer of the closed form for each posture that is nearest, modulo turns, to `near`, or to the posture before. If
none exists, the first is taken. */
static void take_answers(path_motion *own, long n, long m)
{
    const branch *by = own->by;
    long r = n - m;
    const double *before = by->start;
    for (long k = 0; k < own->count; k++) {
        const double *answers = own->answers + k * by->alternatives * m;
        double *q = own->q + k * n;
        long best = 0;
        double least = INFINITY;
        before = own->near ? own->near + k * n : before;
        for (long i = 0; i < by->alternatives; i++) {
            double square = 0.0;
            for (long j = 0; j < m; j++) {
                double gap = answers[i * m + j] - before[by->others[j]];
                gap -= by->turns[by->others[j]] != 0.0 ? TURN * nearbyint(gap / TURN) : 0.0;
                square += gap * gap;
            }
            if (square < least) {
                least = square;
                best = i;
            }
        }
        for (long j = 0; j < r; j++) {
            q[by->redundant[j]] = own->y[k * (1 + r) + 1 + j];
        }
        for (long j = 0; j < m; j++) {
            q[by->others[j]] = answers[best * m + j];
        }
        before = least < INFINITY ? q : before;
    }
}

/* Put angles into the turns nearest to `near`, or to the angles before, at first to the start. In the second case nothing is
done if one number is not finite. */
static void take_turns(path_motion *own, long n)
{
    const branch *by = own->by;
    if (!own->near && !all_finite(own->q, own->count * n)) {
        return;
    }
    for (long j = 0; j < n; j++) {
        double before = by->start[j];
        for (long k = 0; k < own->count && by->turns[j] != 0.0; k++) {
            double *angle = &own->q[k * n + j];
            before = own->near ? own->near[k * n + j] : before;
            *angle += TURN * nearbyint((before - *angle) / TURN);
            before = *angle;
        }
    }
}

/* Put angles into the turns to which their velocities and accelerations lead. The predicted step of an angle is that of the
quintic through both ends,

    h (v0 + v1) / 2 - h^2 (a1 - a0) / 12.

Returns 0 if the predicted step of a joint with a finite range differs from every possible step by more than a quarter turn. */
static int follow_rates(path_motion *own, long n)
{
    const branch *by = own->by;
    for (long j = 0; j < n; j++) {
        double before = 0.0;
        double counted = 0.0;
        for (long k = 0; k < own->count && by->turns[j] != 0.0; k++) {
            long at = k * n + j;
            double angle = own->q[at];
            if (k > 0) {
                double h = own->t[k] - own->t[k - 1];
                double rise = own->qddot[at] - own->qddot[at - n];
                double step = 0.5 * h * (own->qdot[at] + own->qdot[at - n]) - h * h / 12.0 * rise;
                double gap = (step - (angle - before)) / TURN;
                double whole = nearbyint(gap);
                if (by->ranged[j] != 0.0 && !(fabs(gap - whole) <= 0.25)) {
                    return 0;
                }
                counted += whole;
            }
            before = angle;
            own->q[at] = angle + TURN * counted;
        }
    }
    return 1;
}

/* Postures of a chart by Newton's method, from `near` or beside its reference: at each point posture, sigma and dq/dsigma, n + r +
n r numbers. Within 0.8 rad or m the reference's own self-motion says where a posture is. */
static void solve_chart(path_motion *own, long n, long r, long coordinates)
{
    for (long k = 0; k < own->count; k++) {
        const double *reference = own->reference + k * (n + r + n * r);
        const double *rows = own->rows + k * own->rows_step;
        const double *curves = own->y + k * (1 + r) + 1;
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
            own->q[k * n + i] = own->near ? own->near[k * n + i] : reference[i] + (largest < 0.8 ? aside[i] : 0.0);
        }
        for (long j = 0; j < r; j++) {
            own->levels[k * r + j] = curves[j] + rows[j * (n + 1) + n];
        }
    }
    brachis_newton(
        own->arm, own->asked, own->count, coordinates, own->targets, own->q, r, own->rows, own->rows_step, n + 1,
        own->levels, 0, own->q
    );
}

/* Find the postures q; nothing is done where they are given. */
void brachis_postures(path_motion *own)
{
    long n = own->arm->joints;
    long m = select_parts(own->asked).count;
    long r = n - m;
    long coordinates = own->asked->turns == 3 ? own->asked->rows + 9 : m;
    if (own->reference) {
        solve_chart(own, n, r, coordinates);
    }
    if (!own->by) {
        return;
    }
    if (own->by->answers_of) {
        const formula *answers_of = own->by->answers_of;
        brachis_formula(
            answers_of, own->count, own->targets, coordinates, own->y + 1, 1 + r, own->answers
        );
    }
    take_answers(own, n, m);
    take_turns(own, n);
}

enum { NO_FAULT, NO_POSTURE, SINGULAR, TURNS_TOO_FAR };

/* Find postures and motion. Returns what is at fault. */
int brachis_evaluate(path_motion *own)
{
    long n = own->arm->joints;
    brachis_postures(own);
    if (!all_finite(own->q, own->count * n)) {
        return NO_POSTURE;
    }
    brachis_path_motion(own);
    for (long k = 0; k < own->count; k++) {
        double determinant = own->determinants[k];
        double size = own->side == 0.0 ? fabs(determinant) : determinant * own->side;
        if (!(size > 0.0)) {
            return SINGULAR;
        }
    }
    if (own->by && own->t && !follow_rates(own, n)) {
        return TURNS_TOO_FAR;
    }
    return NO_FAULT;
}
