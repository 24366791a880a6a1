/* Interpolating splines, and their values; see splines.py. */

#include <math.h>

/* Solve equations with a band matrix: row i of `matrix`, (count, 2 d + 1), holds columns i - d to i + d, and is used up.
`values`, (count, columns), become the solution. Rows are not exchanged: a matrix of B-splines, with no negative minor, does
not need it (de Boor and Pinkus, 1977). */
void brachis_solve_band(long count, long d, long columns, double *matrix, double *values)
{
    const long width = 2 * d + 1;
    for (long i = 0; i < count; i++) {
        const double *own = &matrix[i * width + d];
        const long last = i + d < count ? i + d : count - 1;
        for (long k = i + 1; k <= last; k++) {
            double *below = &matrix[k * width + d - (k - i)];
            const double factor = below[0] / own[0];
            for (long j = 1; j <= last - i; j++) {
                below[j] -= factor * own[j];
            }
            for (long c = 0; c < columns; c++) {
                values[k * columns + c] -= factor * values[i * columns + c];
            }
        }
    }
    for (long i = count - 1; i >= 0; i--) {
        const double *own = &matrix[i * width + d];
        const long last = i + d < count ? i + d : count - 1;
        for (long c = 0; c < columns; c++) {
            double sum = values[i * columns + c];
            for (long k = i + 1; k <= last; k++) {
                sum -= own[k - i] * values[k * columns + c];
            }
            values[i * columns + c] = sum / own[0];
        }
    }
}

/* Blossoms of pieces of a spline of degree d, by de Boor's recursion, (count, columns): of the pieces that begin at the knots
with the numbers `pieces`, (count), at `arguments`, (d, count). `points`, (knots - d - 1, columns), are the control points. */
void brachis_blossoms(
    long count, long d, long columns, const double *knots, const double *points, const long *pieces,
    const double *arguments, double *found
)
{
    double work[(d + 1) * columns + 1];
    for (long k = 0; k < count; k++) {
        const long first = pieces[k] - d;
        for (long i = 0; i < (d + 1) * columns; i++) {
            work[i] = points[first * columns + i];
        }
        for (long level = 1; level <= d; level++) {
            const double x = arguments[(level - 1) * count + k];
            for (long i = 0; i <= d - level; i++) {
                const double left = knots[first + i + level];
                const double right = knots[first + i + d + 1];
                const double share = (x - left) / (right - left);
                double *own = &work[i * columns];
                for (long c = 0; c < columns; c++) {
                    own[c] = share * own[columns + c] + (1.0 - share) * own[c];
                }
            }
        }
        for (long c = 0; c < columns; c++) {
            found[k * columns + c] = work[c];
        }
    }
}

/* Values of splines and their derivatives, (orders, count, curves), by `width` basis functions of each place: `basis`, (orders,
count, width), of the control points from the one with number `first`, (count), on. `points` are (curves, many). The sum is
taken from the nearest point, so that derivatives vanish without rounding where points are equal. */
void brachis_curves(
    long orders, long count, long width, long curves, long many, const double *basis, const long *first, const double *points,
    double *found
)
{
    for (long k = 0; k < count; k++) {
        const double *value = &basis[k * width];
        long nearest = 0;
        for (long w = 1; w < width; w++) {
            nearest = value[w] > value[nearest] ? w : nearest;
        }
        for (long j = 0; j < curves; j++) {
            const double *own = &points[j * many + first[k]];
            const double beside = own[nearest];
            for (long o = 0; o < orders; o++) {
                const double *weight = &basis[(o * count + k) * width];
                double sum = 0.0;
                for (long w = 0; w < width; w++) {
                    sum += weight[w] * (own[w] - beside);
                }
                found[(o * count + k) * curves + j] = o == 0 ? sum + beside : sum;
            }
        }
    }
}

/* The knot, between those with the numbers `low` and `high`, at which the piece of x begins; `piece` is looked at first. */
static long find_piece(const double *knots, long low, long high, long piece, double x)
{
    if (x >= knots[piece] && x < knots[piece + 1]) {
        return piece;
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

/* Values and derivatives, (orders, count, columns), at `places`, (count), of a spline of degree d with control points `points`,
(many, columns). Basis functions come from the recursion of Cox and de Boor (The NURBS Book, A2.2), as in bspline.py, to the last
digit. Their sum is taken from the nearest point, so that derivatives vanish without rounding where points are equal. A place
that is within `rounding` of a knot is at this knot. */
static inline __attribute__((always_inline)) void find_orders(
    long orders, long count, long d, long columns, long many, const double *knots, const double *points, const double *places,
    double rounding, double *found
)
{
    const long width = d + 1;
    double basis[width * width]; /* row p: the functions of degree p */
    double slopes[width];
    double left[width];
    double right[width];
    long piece = d;
    for (long k = 0; k < count; k++) {
        double x = places[k];
        piece = find_piece(knots, d, many - 1, piece, x + rounding);
        const double begin = knots[piece];
        const double length = knots[piece + 1] - begin;
        x = fabs(x - begin) <= rounding ? begin : x;
        x = fabs(x - knots[piece + 1]) <= rounding ? knots[piece + 1] : x;
        left[0] = (x - begin) / length * length;
        right[0] = length - left[0];
        for (long i = 1; i < d; i++) {
            left[i] = left[i - 1] + (knots[piece + 1 - i] - knots[piece - i]);
            right[i] = right[i - 1] + (knots[piece + 1 + i] - knots[piece + i]);
        }
        basis[0] = 1.0;
        for (long p = 1; p <= d; p++) {
            const double *lower = &basis[(p - 1) * width];
            double *own = &basis[p * width];
            double before = 0.0;
            for (long i = 0; i < p; i++) {
                const double share = lower[i] / (left[p - 1 - i] + right[i]);
                own[i] = before + right[i] * share;
                before = left[p - 1 - i] * share;
            }
            own[p] = before;
        }
        const double *value = &basis[d * width];
        long nearest = 0;
        for (long i = 1; i <= d; i++) {
            nearest = value[i] > value[nearest] ? i : nearest;
        }
        const double *first = &points[(piece - d) * columns];
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
            double *own = &found[(o * count + k) * columns];
            for (long c = 0; c < columns; c++) {
                const double beside = first[nearest * columns + c];
                double sum = 0.0;
                for (long i = 0; i <= d; i++) {
                    sum += slopes[i] * (first[i * columns + c] - beside);
                }
                own[c] = o == 0 ? sum + beside : sum;
            }
        }
    }
}

void brachis_spline_orders(
    long orders, long count, long d, long columns, long many, const double *knots, const double *points, const double *places,
    double rounding, double *found
)
{
    /* Loops whose ends the compiler knows are several times as fast. */
    if (orders == 4 && d == 3 && columns == 1) {
        find_orders(4, count, 3, 1, many, knots, points, places, rounding, found);
    } else if (orders == 4 && d == 5 && columns == 1) {
        find_orders(4, count, 5, 1, many, knots, points, places, rounding, found);
    } else if (orders == 4 && d == 5) {
        find_orders(4, count, 5, columns, many, knots, points, places, rounding, found);
    } else {
        find_orders(orders, count, d, columns, many, knots, points, places, rounding, found);
    }
}

/* Values of polynomials in Bernstein form by de Casteljau's algorithm, (count, n): of those with the numbers `pieces`, (count),
among `coefficients`, (width, many, n), at `places`, (count), from 0 to 1. */
void brachis_bernstein(
    long count, long width, long many, long n, const double *coefficients, const long *pieces, const double *places,
    double *found
)
{
    double work[width * n + 1];
    for (long k = 0; k < count; k++) {
        const double u = places[k];
        for (long i = 0; i < width; i++) {
            for (long j = 0; j < n; j++) {
                work[i * n + j] = coefficients[(i * many + pieces[k]) * n + j];
            }
        }
        for (long level = width - 1; level > 0; level--) {
            for (long i = 0; i < level * n; i++) {
                work[i] = (1.0 - u) * work[i] + u * work[i + n];
            }
        }
        for (long j = 0; j < n; j++) {
            found[k * n + j] = work[j];
        }
    }
}
