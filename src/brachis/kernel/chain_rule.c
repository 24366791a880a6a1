/* From slopes by the joints to slopes by the curves, and from these to entries of a sparse Jacobian. */

/* Partial derivatives, (K, values, n), of values by the joints' positions, or rates, ...; null where they vanish. `step` is 0
where they are the same at all points, else values * n. */
typedef struct {
    const double *numbers;
    long step;
} partial;

/* Derivatives of the joint motion by the curves, (K, n, width) each; see kinematics/joint_map.py. The last one counts only
where a partial by the jerk is given. */
typedef struct {
    const double *gradient, *qdot_y, *qddot_y, *qddot_ydot, *qdddot_y;
} motion_slopes;

/* found += factor * partial (values, n) times slopes (n, width); most partials are of one joint each. */
static void add_product(
    const partial *by, long k, long values, long n, long width, double factor, const double *slopes, double *found
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

/* Slopes by y, ydot, yddot and, with 4 orders, ydddot of `values` values from those by q, qdot, qddot, qdddot, and by s,
(K, values). They go into the columns from `first` on of a table, (orders, K, columns, width). */
void brachis_chain_rule(
    long count, long values, long n, long width, const partial *by, const double *by_s, const motion_slopes *motion,
    long orders, long columns, long first, double *table
)
{
    for (long k = 0; k < count; k++) {
        double *found[4];
        for (long order = 0; order < orders; order++) {
            found[order] = table + ((order * count + k) * columns + first) * width;
            for (long i = 0; i < values * width; i++) {
                found[order][i] = 0.0;
            }
        }
        long at = k * n * width;
        for (long i = 0; i < values && by_s; i++) {
            found[0][i * width] = by_s[k * values + i];
        }
        if (by[0].numbers) {
            add_product(&by[0], k, values, n, width, 1.0, motion->gradient + at, found[0]);
        }
        if (by[1].numbers) {
            add_product(&by[1], k, values, n, width, 1.0, motion->qdot_y + at, found[0]);
            add_product(&by[1], k, values, n, width, 1.0, motion->gradient + at, found[1]);
        }
        if (by[2].numbers) {
            add_product(&by[2], k, values, n, width, 1.0, motion->qddot_y + at, found[0]);
            add_product(&by[2], k, values, n, width, 1.0, motion->qddot_ydot + at, found[1]);
            add_product(&by[2], k, values, n, width, 1.0, motion->gradient + at, found[2]);
        }
        if (by[3].numbers) {
            add_product(&by[3], k, values, n, width, 1.0, motion->qdddot_y + at, found[0]);
            add_product(&by[3], k, values, n, width, 3.0, motion->qddot_y + at, found[1]);
            add_product(&by[3], k, values, n, width, 3.0, motion->qdot_y + at, found[2]);
            add_product(&by[3], k, values, n, width, 1.0, motion->gradient + at, found[3]);
        }
    }
}

/* Entries, (z, columns), of the variables of one curve, each of which matters at one point: `basis`, (orders, z), is the
slope of the curve and its time derivatives there. */
void brachis_entries(
    long orders, long count, long columns, long width, const double *table, long curve, long entries,
    const long *points, const double *basis, double *found
)
{
    for (long z = 0; z < entries; z++) {
        double *own = found + z * columns;
        for (long i = 0; i < columns; i++) {
            own[i] = 0.0;
        }
        for (long order = 0; order < orders; order++) {
            const double *slopes = table + (order * count + points[z]) * columns * width + curve;
            double factor = basis[order * entries + z];
            for (long i = 0; i < columns; i++) {
                own[i] += factor * slopes[i * width];
            }
        }
    }
}
