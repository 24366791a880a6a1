/* Derivatives of rotation matrices and of body twists along a path.

A function of one parameter is given by its derivatives from the value on. Divided by factorials they are the coefficients
of a power series, and products of functions are products of these. */

enum { MAX_ORDERS = 8 };

/* Power series of one number: its coefficients. */
typedef struct {
    double at[MAX_ORDERS];
} series;

static inline series read_series(const double *values, long orders, long stride)
{
    series coefficients = {{0.0}};
    double factorial = 1.0;
    for (long i = 0; i < orders; i++) {
        factorial *= i > 1 ? (double)i : 1.0;
        coefficients.at[i] = values[i * stride] / factorial;
    }
    return coefficients;
}

static inline void write_series(const series *coefficients, double *values, long orders, long stride)
{
    double factorial = 1.0;
    for (long i = 0; i < orders; i++) {
        factorial *= i > 1 ? (double)i : 1.0;
        values[i * stride] = coefficients->at[i] * factorial;
    }
}

/* sum += factor a b */
static inline void add_product(series *sum, double factor, const series *a, const series *b, long orders)
{
    for (long i = 0; i < orders; i++) {
        for (long j = 0; j <= i; j++) {
            sum->at[i] += factor * a->at[j] * b->at[i - j];
        }
    }
}

/* a / b in place of a */
static inline void divide(series *a, const series *b, long orders)
{
    for (long i = 0; i < orders; i++) {
        for (long j = 1; j <= i; j++) {
            a->at[i] -= b->at[j] * a->at[i - j];
        }
        a->at[i] /= b->at[0];
    }
}

/* Rotation matrices, (m, K, 3, 3), with their derivatives, of quaternions w, x, y, z of any length, (m, K, 4). */
void brachis_rotations(long orders, long count, const double *quaternions, double *rotations)
{
    for (long k = 0; k < count; k++) {
        series q[4], R[9] = {{{0.0}}}, squared = {{0.0}};
        for (int i = 0; i < 4; i++) {
            q[i] = read_series(quaternions + 4 * k + i, orders, 4 * count);
            add_product(&squared, 1.0, &q[i], &q[i], orders);
        }
        for (int i = 0; i < 3; i++) {
            int next = (i + 1) % 3;
            int last = (i + 2) % 3;
            for (int j = 0; j < 4; j++) {
                double sign = j == 0 || j == i + 1 ? 1.0 : -1.0;
                add_product(&R[4 * i], sign, &q[j], &q[j], orders);
            }
            series *above = &R[3 * i + next];
            series *below = &R[3 * next + i];
            add_product(above, 2.0, &q[1 + i], &q[1 + next], orders);
            *below = *above;
            add_product(above, -2.0, &q[0], &q[1 + last], orders);
            add_product(below, 2.0, &q[0], &q[1 + last], orders);
        }
        for (int i = 0; i < 9; i++) {
            divide(&R[i], &squared, orders);
            write_series(&R[i], rotations + 9 * k + i, orders, 9 * count);
        }
    }
}

/* Body twists, (m - 1, K, 6), with their derivatives, of poses, (m, K, 12): position, then the rotation matrix R row by row.
They are R' p' and the angular velocity of R' R', along the axes of the turning frame. */
void brachis_body_twists(long orders, long count, const double *poses, double *twists)
{
    long twist_orders = orders - 1;
    for (long k = 0; k < count; k++) {
        series R[9], rates[12];
        for (int i = 0; i < 12; i++) {
            const double *pose = poses + 12 * k + i;
            rates[i] = read_series(pose + 12 * count, twist_orders, 12 * count);
            if (i >= 3) {
                R[i - 3] = read_series(pose, twist_orders, 12 * count);
            }
        }
        for (int i = 0; i < 3; i++) {
            series linear = {{0.0}}, angular = {{0.0}};
            int next = (i + 1) % 3;
            int last = (i + 2) % 3;
            for (int row = 0; row < 3; row++) {
                add_product(&linear, 1.0, &R[3 * row + i], &rates[row], twist_orders);
                add_product(&angular, 0.5, &R[3 * row + last], &rates[3 + 3 * row + next], twist_orders);
                add_product(&angular, -0.5, &R[3 * row + next], &rates[3 + 3 * row + last], twist_orders);
            }
            write_series(&linear, twists + 6 * k + i, twist_orders, 6 * count);
            write_series(&angular, twists + 6 * k + 3 + i, twist_orders, 6 * count);
        }
    }
}
