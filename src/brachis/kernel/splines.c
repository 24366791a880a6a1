/* Interpolating splines, and their values; see splines.py. */

#include <math.h>

#define INLINED static inline __attribute__((always_inline))

/* Solve equations with a band matrix: row i of `matrix`, (count, 2 d + 1), holds columns i - d to i + d, and is used up.
`values`, (count, columns), become the solution. Rows are not exchanged: a matrix of B-splines, with no negative minor, does
not need it (de Boor and Pinkus, 1977). */
void brachis_solve_band(long count, long d, long columns, double *matrix, double *values)
{
    const long width = 2 * d + 1;
    for (long i = 0; i < count; i++) {
        const double *diagonal = &matrix[i * width + d];
        const long last = i + d < count ? i + d : count - 1;
        for (long k = i + 1; k <= last; k++) {
            double *below = &matrix[k * width + d - (k - i)];
            const double factor = below[0] / diagonal[0];
            for (long j = 1; j <= last - i; j++) {
                below[j] -= factor * diagonal[j];
            }
            for (long c = 0; c < columns; c++) {
                values[k * columns + c] -= factor * values[i * columns + c];
            }
        }
    }
    for (long i = count - 1; i >= 0; i--) {
        const double *diagonal = &matrix[i * width + d];
        const long last = i + d < count ? i + d : count - 1;
        for (long c = 0; c < columns; c++) {
            double sum = values[i * columns + c];
            for (long k = i + 1; k <= last; k++) {
                sum -= diagonal[k - i] * values[k * columns + c];
            }
            values[i * columns + c] = sum / diagonal[0];
        }
    }
}

/* Blossoms of a spline of degree d, by de Boor's recursion, (count, columns): of the polynomials whose spans begin at the knots
with the numbers `spans`, (count), at `arguments`, (d, count). `points`, (knots - d - 1, columns), are the control points. */
void brachis_blossoms(
    long count, long d, long columns, const double *knots, const double *points, const long *spans,
    const double *arguments, double *values
)
{
    double work[(d + 1) * columns + 1];
    for (long k = 0; k < count; k++) {
        const long first = spans[k] - d;
        for (long i = 0; i < (d + 1) * columns; i++) {
            work[i] = points[first * columns + i];
        }
        for (long level = 1; level <= d; level++) {
            const double x = arguments[(level - 1) * count + k];
            for (long i = 0; i <= d - level; i++) {
                const double left = knots[first + i + level];
                const double right = knots[first + i + d + 1];
                const double share = (x - left) / (right - left);
                double *point = &work[i * columns];
                for (long c = 0; c < columns; c++) {
                    point[c] = share * point[columns + c] + (1.0 - share) * point[c];
                }
            }
        }
        for (long c = 0; c < columns; c++) {
            values[k * columns + c] = work[c];
        }
    }
}

/* Number of the largest basis function, whose control point is the nearest one. */
INLINED long find_nearest(const double *functions, long count)
{
    long nearest = 0;
    for (long i = 1; i < count; i++) {
        nearest = functions[i] > functions[nearest] ? i : nearest;
    }
    return nearest;
}

/* Basis functions of splines and their derivatives, (orders, K, width), at K points: of the control points from the one with
number `first`, (K), on. */
typedef struct {
    long orders, count, width;
    const double *values;
    const long *first;
} basis;

/* Values of splines and their derivatives, (orders, K, curves). Control points are (curves, point_count). The sum is taken from the
nearest point, so that derivatives vanish without rounding where points are equal. */
void brachis_curves(const basis *basis, long curves, long point_count, const double *points, double *values)
{
    long orders = basis->orders;
    long count = basis->count;
    long width = basis->width;
    for (long k = 0; k < count; k++) {
        const long nearest = find_nearest(&basis->values[k * width], width);
        for (long j = 0; j < curves; j++) {
            const double *point = &points[j * point_count + basis->first[k]];
            const double origin = point[nearest];
            for (long o = 0; o < orders; o++) {
                const double *weight = &basis->values[(o * count + k) * width];
                double sum = 0.0;
                for (long w = 0; w < width; w++) {
                    sum += weight[w] * (point[w] - origin);
                }
                values[(o * count + k) * curves + j] = o == 0 ? sum + origin : sum;
            }
        }
    }
}

/* A spline of degree d with control points, (point_count, columns). */
typedef struct {
    long degree, point_count, columns;
    const double *knots, *points;
} spline;

/* The knot, between those with the numbers `low` and `high`, at which the span of x begins; `span` is looked at first. */
static long find_span(const double *knots, long low, long high, long span, double x)
{
    if (x >= knots[span] && x < knots[span + 1]) {
        return span;
    }
    while (low < high) {
        const long middle = (low + high + 1) / 2;
        if (x >= knots[middle]) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    return low;
}

/* Sums of control points, (count, columns), with the basis functions or their derivatives as weights. They are taken from the
nearest point, so that derivatives vanish without rounding where points are equal. */
INLINED void sum_points(
    long count, long columns, const double *weights, const double *points, long nearest, int is_value, double *sums
)
{
    for (long c = 0; c < columns; c++) {
        const double origin = points[nearest * columns + c];
        double sum = 0.0;
        for (long i = 0; i < count; i++) {
            sum += weights[i] * (points[i * columns + c] - origin);
        }
        sums[c] = is_value ? sum + origin : sum;
    }
}

/* See `brachis_spline_orders`; d and the columns are those of the spline. Basis functions come from the recursion of Cox and de
Boor (The NURBS Book, A2.2), as in bspline.py, to the last digit. */
INLINED void find_orders(
    long orders, long d, long columns, long count, const spline *spline, const double *places, double rounding, double *values
)
{
    const long width = d + 1;
    const double *knots = spline->knots;
    double basis[width * width]; /* row p: the functions of degree p */
    double slopes[width], left[width], right[width];
    long span = d;
    for (long k = 0; k < count; k++) {
        double x = places[k];
        span = find_span(knots, d, spline->point_count - 1, span, x + rounding);
        const double begin = knots[span];
        const double length = knots[span + 1] - begin;
        x = fabs(x - begin) <= rounding ? begin : x;
        x = fabs(x - knots[span + 1]) <= rounding ? knots[span + 1] : x;
        left[0] = (x - begin) / length * length;
        right[0] = length - left[0];
        for (long i = 1; i < d; i++) {
            left[i] = left[i - 1] + (knots[span + 1 - i] - knots[span - i]);
            right[i] = right[i - 1] + (knots[span + 1 + i] - knots[span + i]);
        }
        basis[0] = 1.0;
        for (long p = 1; p <= d; p++) {
            const double *lower = &basis[(p - 1) * width];
            double *functions = &basis[p * width];
            double before = 0.0;
            for (long i = 0; i < p; i++) {
                const double share = lower[i] / (left[p - 1 - i] + right[i]);
                functions[i] = before + right[i] * share;
                before = left[p - 1 - i] * share;
            }
            functions[p] = before;
        }
        const long nearest = find_nearest(&basis[d * width], width);
        const double *points = &spline->points[(span - d) * columns];
        for (long o = 0; o < orders; o++) {
            for (long i = 0; i <= d; i++) {
                slopes[i] = i <= d - o ? basis[(d - o) * width + i] : 0.0;
            }
            for (long p = o <= d ? d - o + 1 : 1; p <= d; p++) {
                double before = 0.0;
                for (long i = 0; i < p; i++) {
                    const double share = p * slopes[i] / (left[p - 1 - i] + right[i]);
                    slopes[i] = before - share;
                    before = share;
                }
                slopes[p] = before;
            }
            sum_points(width, columns, slopes, points, nearest, o == 0, &values[(o * count + k) * columns]);
        }
    }
}

/* Values and derivatives, (orders, count, columns), of a spline at `places`, (count). A place that is within `rounding` of a knot
is at this knot. */
void brachis_spline_orders(
    long orders, long count, const spline *spline, const double *places, double rounding, double *values
)
{
    long d = spline->degree;
    long columns = spline->columns;
    /* Loops whose ends the compiler knows are several times as fast. */
    if (orders == 4 && d == 3 && columns == 1) {
        find_orders(4, 3, 1, count, spline, places, rounding, values);
    } else if (orders == 4 && d == 5 && columns == 1) {
        find_orders(4, 5, 1, count, spline, places, rounding, values);
    } else if (orders == 4 && d == 5) {
        find_orders(4, 5, columns, count, spline, places, rounding, values);
    } else {
        find_orders(orders, d, columns, count, spline, places, rounding, values);
    }
}

/* Values of polynomials in Bernstein form by de Casteljau's algorithm, (count, n): of those with the numbers `spans`, (count),
among `coefficients`, (width, span_count, n), at `places`, (count), from 0 to 1. */
void brachis_bernstein(
    long count, long width, long span_count, long n, const double *coefficients, const long *spans, const double *places,
    double *values
)
{
    double work[width * n + 1];
    for (long k = 0; k < count; k++) {
        const double u = places[k];
        for (long i = 0; i < width; i++) {
            for (long j = 0; j < n; j++) {
                work[i * n + j] = coefficients[(i * span_count + spans[k]) * n + j];
            }
        }
        for (long level = width - 1; level > 0; level--) {
            for (long i = 0; i < level * n; i++) {
                work[i] = (1.0 - u) * work[i] + u * work[i + n];
            }
        }
        for (long j = 0; j < n; j++) {
            values[k * n + j] = work[j];
        }
    }
}
