/* Interpolating splines, and their values; see splines.py. */

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
