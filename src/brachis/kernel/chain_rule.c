/* From slopes by the joints to slopes by the curves, and from these to entries of a sparse Jacobian. */

/* Partial derivatives, (K, values, n), of values by the joints' positions, or rates, ...; null where they vanish. `step` is 0
where they are the same at all points, else values * n. */
typedef struct {
    const double *numbers;
    long step;
} partial;

/* A group of values: its partials by q, qdot, qddot and qdddot, and by s, (K, values), or null. */
typedef struct {
    partial by[4];
    const double *by_s;
    long values;
} group;

/* Derivatives of the joint motion by the curves, (K, n, width) each; see kinematics/joint_map.py. The last one counts only
where a partial by the jerk is given. */
typedef struct {
    const double *gradient, *qdot_y, *qddot_y, *qddot_ydot, *qdddot_y;
} motion_slopes;

/* Call a function with the width as a constant for widths of 2 to 5: the compiler unrolls the loops over the curves. */
#define WITH_WIDTH(function, ...) \
    switch (width) { \
    case 2: function(2, __VA_ARGS__); break; \
    case 3: function(3, __VA_ARGS__); break; \
    case 4: function(4, __VA_ARGS__); break; \
    case 5: function(5, __VA_ARGS__); break; \
    default: function(width, __VA_ARGS__); \
    }
#define UNROLLED static inline __attribute__((always_inline)) void

/* found += factor * partial (values, n) times slopes (n, width); most partials are of one joint each. */
UNROLLED add_product(
    long width, const partial *by, long k, long values, long n, double factor, const double *slopes, double *found
)
{
    const double *numbers = by->numbers + k * by->step;
    for (long i = 0; i < values; i++) {
        for (long j = 0; j < n; j++) {
            double own = factor * numbers[i * n + j];
            if (own == 0.0) {
                continue;
            }
            for (long l = 0; l < width; l++) {
                found[i * width + l] += own * slopes[j * width + l];
            }
        }
    }
}

UNROLLED chain_rule(
    long width, long count, long n, long groups, const group *of, const motion_slopes *motion, long orders, long columns,
    double *table
)
{
    for (long i = 0; i < orders * count * columns * width; i++) {
        table[i] = 0.0;
    }
    for (long k = 0; k < count; k++) {
        double *found[4];
        for (long order = 0; order < orders; order++) {
            found[order] = table + (order * count + k) * columns * width;
        }
        long at = k * n * width;
        for (const group *own = of; own < of + groups; own++) {
            const partial *by = own->by;
            long values = own->values;
            for (long i = 0; i < values && own->by_s; i++) {
                found[0][i * width] = own->by_s[k * values + i];
            }
            if (by[0].numbers) {
                add_product(width, &by[0], k, values, n, 1.0, motion->gradient + at, found[0]);
            }
            if (by[1].numbers) {
                add_product(width, &by[1], k, values, n, 1.0, motion->qdot_y + at, found[0]);
                add_product(width, &by[1], k, values, n, 1.0, motion->gradient + at, found[1]);
            }
            if (by[2].numbers) {
                add_product(width, &by[2], k, values, n, 1.0, motion->qddot_y + at, found[0]);
                add_product(width, &by[2], k, values, n, 1.0, motion->qddot_ydot + at, found[1]);
                add_product(width, &by[2], k, values, n, 1.0, motion->gradient + at, found[2]);
            }
            if (by[3].numbers) {
                add_product(width, &by[3], k, values, n, 1.0, motion->qdddot_y + at, found[0]);
                add_product(width, &by[3], k, values, n, 3.0, motion->qddot_y + at, found[1]);
                add_product(width, &by[3], k, values, n, 3.0, motion->qdot_y + at, found[2]);
                add_product(width, &by[3], k, values, n, 1.0, motion->gradient + at, found[3]);
            }
            for (long order = 0; order < orders; order++) {
                found[order] += values * width;
            }
        }
    }
}

/* Slopes of groups of values by y, ydot, yddot and, with 4 orders, ydddot: a table, (orders, K, columns, width). */
void brachis_chain_rule(
    long count, long n, long width, long groups, const group *of, const motion_slopes *motion, long orders, long columns,
    double *table
)
{
    WITH_WIDTH(chain_rule, count, n, groups, of, motion, orders, columns, table)
}

UNROLLED entries_of(
    long width, long orders, long count, long columns, const double *table, long broad, const double *shared,
    long entries, const long *points, const long *curves, const double *basis, double *found
)
{
    double *of_one = found + broad * count * columns;
    for (double *own = found; own < of_one + entries * columns; own++) {
        *own = 0.0;
    }
    for (long order = 0; order < orders; order++) {
        for (long row = 0; row < broad * count; row++) {
            const double *slopes = table + (order * count + row % count) * columns * width;
            const double *factors = shared + ((row / count * orders + order) * count + row % count) * width;
            for (long i = 0; i < columns; i++) {
                for (long j = 0; j < width; j++) {
                    found[row * columns + i] += slopes[i * width + j] * factors[j];
                }
            }
        }
        for (long z = 0; z < entries; z++) {
            const double *slopes = table + (order * count + points[z]) * columns * width + curves[z];
            double factor = basis[order * entries + z];
            for (long i = 0; i < columns; i++) {
                of_one[z * columns + i] += factor * slopes[i * width];
            }
        }
    }
}

/* Entries of a Jacobian, (broad K + z, columns). First those of variables that move all curves, at each of the K points:
`shared`, (broad, orders, K, width), are slopes of the curves and their time derivatives by them. Each of the others moves one
curve at one point, by `basis`, (orders, z). */
void brachis_entries(
    long orders, long count, long columns, long width, const double *table, long broad, const double *shared,
    long entries, const long *points, const long *curves, const double *basis, double *found
)
{
    WITH_WIDTH(entries_of, orders, count, columns, table, broad, shared, entries, points, curves, basis, found)
}
