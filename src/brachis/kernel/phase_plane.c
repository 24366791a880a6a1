/* Passes over the phase plane of a joint path: x = (dp/dt)^2 at P stations, and c rows between each two of them. */

#include <math.h>

static inline double smaller(double a, double b)
{
    return b < a ? b : a;
}

static inline double larger(double a, double b)
{
    return b > a ? b : a;
}

/* The least and the largest x, (P), at which no lower line `slope x + lower`, (P, c), is above an upper one. Slopes that
differ by less than `parallel` are equal; -1 is the largest x where such lines leave nothing between them. */
void brachis_bounds_of_pairs(
    long stations, long rows, const double *slope, const double *lower, const double *upper, double parallel,
    double *least, double *most
)
{
    for (long k = 0; k < stations; k++, slope += rows, lower += rows, upper += rows) {
        double floor = 0.0;
        double ceiling = INFINITY;
        int is_empty = 0;
        for (long i = 0; i < rows; i++) {
            for (long j = 0; j < rows; j++) {
                double tilt = slope[i] - slope[j];
                double clearance = upper[j] - lower[i];
                is_empty |= isnan(clearance) || isnan(tilt);
                if (tilt > parallel) {
                    ceiling = smaller(ceiling, clearance / tilt);
                } else if (tilt < -parallel) {
                    floor = larger(floor, clearance / tilt);
                } else {
                    is_empty |= clearance < 0.0;
                }
            }
        }
        least[k] = floor;
        most[k] = is_empty ? -1.0 : ceiling;
    }
}

/* Steps between P stations: the next x is `factor x + lower` to `factor x + upper` by each row, (P - 1, c). */
typedef struct {
    long stations, rows;
    const double *factor, *lower, *upper;
} steps;

/* Intervals of x, (P), from which the end can be reached with x = `last`, where x is `floor` to `ceiling`. Returns 0 if an
interval is empty. */
int brachis_go_backwards(
    const steps *steps, const double *floor, const double *ceiling, double last, double flat, double rounding, double *low,
    double *high
)
{
    long end = steps->stations - 1;
    long rows = steps->rows;
    low[end] = last;
    high[end] = last;
    for (long k = end - 1; k >= 0; k--) {
        double from = floor[k];
        double to = ceiling[k];
        const double *factor = steps->factor + k * rows;
        const double *lower = steps->lower + k * rows;
        const double *upper = steps->upper + k * rows;
        for (long i = 0; i < rows; i++) {
            /* Where the next x does not rise with this one a row is left out. */
            if (factor[i] > flat) {
                to = smaller(to, (high[k + 1] - lower[i]) / factor[i]);
                from = larger(from, (low[k + 1] - upper[i]) / factor[i]);
            }
        }
        if (!(from <= to * (1.0 + rounding)) || to < 0.0) {
            return 0;
        }
        low[k] = from;
        high[k] = larger(to, from);
    }
    return 1;
}

/* The largest x, (P), from the `first` one on, within the intervals. */
void brachis_go_forwards(
    long stations, long rows, const double *factor, const double *upper, const double *low, const double *high,
    double first, double *x
)
{
    x[0] = first;
    for (long k = 0; k + 1 < stations; k++) {
        double next = high[k + 1];
        for (long i = 0; i < rows; i++) {
            next = smaller(next, factor[k * rows + i] * x[k] + upper[k * rows + i]);
        }
        x[k + 1] = larger(next, low[k + 1]);
    }
}
