/* What lattices compute for every step. */
#include <math.h>

/* Largest sizes, (E), of the numbers A step, with rows A, (K, c, n), of the posture where each step, (E, n), begins. */
void brachis_largest_products(
    long steps, long values, long n, const double *rows, const long *origin, const double *step, double *sizes
)
{
    for (long e = 0; e < steps; e++) {
        const double *A = rows + origin[e] * values * n;
        double largest = 0.0;
        for (long i = 0; i < values; i++) {
            double sum = 0.0;
            for (long j = 0; j < n; j++) {
                sum += A[i * n + j] * step[e * n + j];
            }
            double size = fabs(sum);
            largest = size > largest || isnan(size) ? size : largest;
        }
        sizes[e] = largest;
    }
}
