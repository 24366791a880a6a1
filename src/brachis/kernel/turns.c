/* Turns of angles by 2 pi along a motion. */

#include <math.h>

static const double TURN = 6.283185307179586476925;

/* Put angles at successive times, columns of a table (K, columns), into the turns nearest to the ones before; the first
ones into those nearest to `start`, (columns). Other columns, where `turns` is 0, stay, and so do all if one number is not
finite. */
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

/* Put angles, columns of q, (K, n), into the turns that their own velocities and accelerations lead to at times t, (K);
the first ones into those nearest to `start`, (n). The step of an angle is that of the quintic through both ends,

    h (v0 + v1) / 2 - h^2 (a1 - a0) / 12.

Columns are left alone where `turns` is 0. Returns 0 where a number of turns cannot be told: it is more than a quarter of a
turn beside this, at an angle whose `ranged` is not 0. */
int brachis_count_turns(
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
