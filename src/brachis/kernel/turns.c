/* Turns of angles by 2 pi along a motion, and which of several answers goes on with it. */

#include <math.h>

static const double TURN = 6.283185307179586476925;

/* Put angles at successive times, columns of a table (K, columns), into the turns nearest to the ones before. The first row
gets those nearest to `start`, (columns). Columns whose `turns` is 0 stay, and so do all if one number is not finite. */
void brachis_follow_turns(long count, long columns, const double *turns, const double *start, double *table)
{
    double sum = 0.0;
    for (long i = 0; i < count * columns; i++) {
        sum += 0.0 * table[i];
    }
    if (sum != 0.0) {
        return;
    }
    for (long j = 0; j < columns; j++) {
        double before = start[j];
        for (long k = 0; k < count && turns[j] != 0.0; k++) {
            double *own = &table[k * columns + j];
            *own += TURN * nearbyint((before - *own) / TURN);
            before = *own;
        }
    }
}

/* Put angles, columns of q, (K, n), into the turns to which their velocities and accelerations lead at times t, (K). The first
row gets those nearest to `start`, (n). The predicted step of an angle is that of the quintic through both ends,

    h (v0 + v1) / 2 - h^2 (a1 - a0) / 12.

Columns whose `turns` is 0 stay. Returns 0 if the predicted step of a joint with `ranged` differs from every possible step by
more than a quarter turn; q is then of no use. */
int brachis_set_turns(
    long count, long n, const double *turns, const double *ranged, const double *start, const double *t,
    const double *qdot, const double *qddot, double *q
)
{
    for (long j = 0; j < n; j++) {
        double before = 0.0;
        double counted = 0.0;
        for (long k = 0; k < count && turns[j] != 0.0; k++) {
            long at = k * n + j;
            double own = q[at];
            if (k == 0) {
                counted = nearbyint((start[j] - own) / TURN);
            } else {
                double h = t[k] - t[k - 1];
                double step = 0.5 * h * (qdot[at] + qdot[at - n]) - h * h / 12.0 * (qddot[at] - qddot[at - n]);
                double gap = (step - (own - before)) / TURN;
                double whole = nearbyint(gap);
                if (ranged[j] != 0.0 && !(fabs(gap - whole) <= 0.25)) {
                    return 0;
                }
                counted += whole;
            }
            before = own;
            q[at] = own + TURN * counted;
        }
    }
    return 1;
}

/* Take the nearest of several answers, (K, answers, columns), at each time: nearest to `near`, (K, columns), or, if `follows`
is not 0, to the answer before, at first to the first row of `near`. Columns whose `turns` is not 0 count modulo turns. If no
answer is finite, the first one is taken. */
void brachis_pick_nearest(
    long count, long answers, long columns, const double *turns, const double *near, int follows, const double *table,
    double *found
)
{
    const double *before = near;
    for (long k = 0; k < count; k++) {
        const double *of_one = table + k * answers * columns;
        long best = 0;
        double least = INFINITY;
        before = follows ? before : near + k * columns;
        for (long i = 0; i < answers; i++) {
            double square = 0.0;
            for (long j = 0; j < columns; j++) {
                double gap = of_one[i * columns + j] - before[j];
                gap -= turns[j] != 0.0 ? TURN * nearbyint(gap / TURN) : 0.0;
                square += gap * gap;
            }
            if (square < least) {
                least = square;
                best = i;
            }
        }
        for (long j = 0; j < columns; j++) {
            found[k * columns + j] = of_one[best * columns + j];
        }
        before = least < INFINITY ? found + k * columns : before;
    }
}
