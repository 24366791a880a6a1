/* Linear equations of interpolating splines; see splines.py. */

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
