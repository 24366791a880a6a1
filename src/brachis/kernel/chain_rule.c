/* From slopes by the joints to slopes by the curves, and from these to entries of a sparse Jacobian. */

#include <stddef.h>

#include "motion.h"

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

/* table += factor * partial (values, n) times slopes (n, width); most partials are of one joint each. */
UNROLLED add_product(
    long width, const partial *by, long k, long values, long n, double factor, const double *slopes, double *table
)
{
    const double *numbers = by->numbers + k * by->step;
    for (long i = 0; i < values; i++) {
        for (long j = 0; j < n; j++) {
            double number = factor * numbers[i * n + j];
            if (number == 0.0) {
                continue;
            }
            for (long l = 0; l < width; l++) {
                table[i * width + l] += number * slopes[j * width + l];
            }
        }
    }
}

/* table += factor times the slopes of single joints, (values, width). */
UNROLLED add_rows(long width, const value_group *group, double factor, const double *slopes, double *table)
{
    for (long i = 0; i < group->values; i++) {
        for (long l = 0; l < width; l++) {
            table[i * width + l] += factor * group->factors[i] * slopes[group->joints[i] * width + l];
        }
    }
}

/* Sizes of a table of slopes, (orders, K, columns, width), of groups of values of n joints. */
typedef struct {
    long count, n, width, groups, orders, columns;
} table_sizes;

UNROLLED chain_rule(
    long width, const table_sizes *sizes, const value_group *groups, const motion_slopes *motion, double *table
)
{
    long count = sizes->count;
    long n = sizes->n;
    long columns = sizes->columns;
    for (long i = 0; i < sizes->orders * count * columns * width; i++) {
        table[i] = 0.0;
    }
    /* Slopes of q, its derivatives and the torque by y, ydot, ...; those of the jerk follow Leibniz' rule. */
    const double *torque = motion->torque;
    long block = torque ? count * n * width : 0;
    const double *slopes[5][4] = {
        {motion->gradient},
        {motion->qdot_y, motion->gradient},
        {motion->qddot_y, motion->qddot_ydot, motion->gradient},
        {motion->qdddot_y, motion->qddot_y, motion->qdot_y, motion->gradient},
        {torque, torque + block, torque + 2 * block},
    };
    for (long k = 0; k < count; k++) {
        long at = k * n * width;
        long column = 0;
        for (const value_group *group = groups; group < groups + sizes->groups; group++) {
            long values = group->values;
            for (long i = 0; i < values && group->by_s; i++) {
                table[(k * columns + column + i) * width] = group->by_s[k * values + i];
            }
            for (int quantity = 0; quantity <= TORQUE; quantity++) {
                const partial *by = quantity < TORQUE ? &group->by[quantity] : NULL;
                int is_quantity = group->quantity == quantity;
                if (!is_quantity && !(by && by->numbers)) {
                    continue;
                }
                for (int order = 0; order < 4 && slopes[quantity][order]; order++) {
                    double factor = quantity == 3 && (order == 1 || order == 2) ? 3.0 : 1.0;
                    double *rows = table + ((order * count + k) * columns + column) * width;
                    if (is_quantity) {
                        add_rows(width, group, factor, slopes[quantity][order] + at, rows);
                    } else {
                        add_product(width, by, k, values, n, factor, slopes[quantity][order] + at, rows);
                    }
                }
            }
            column += values;
        }
    }
}

/* Where variables move the curves and their time derivatives up to an order below `orders`. First those that move all curves,
at each of the K points: `shared`, (shared_count, orders, K, width), are slopes of the curves and their time derivatives by
them. Each of the others moves one curve at one point, by `basis`, (orders, z). */
typedef struct {
    long orders;
    long shared_count;
    const double *shared;
    long entries; /* z */
    const long *points, *curves;
    const double *basis;
} variables;

UNROLLED entries_of(
    long width, long count, long columns, const double *table, const variables *by, double *entries
)
{
    double *of_one = entries + by->shared_count * count * columns;
    for (double *entry = entries; entry < of_one + by->entries * columns; entry++) {
        *entry = 0.0;
    }
    for (long order = 0; order < by->orders; order++) {
        for (long row = 0; row < by->shared_count * count; row++) {
            const double *slopes = table + (order * count + row % count) * columns * width;
            const double *factors = by->shared + ((row / count * by->orders + order) * count + row % count) * width;
            for (long i = 0; i < columns; i++) {
                for (long j = 0; j < width; j++) {
                    entries[row * columns + i] += slopes[i * width + j] * factors[j];
                }
            }
        }
        for (long z = 0; z < by->entries; z++) {
            const double *slopes = table + (order * count + by->points[z]) * columns * width + by->curves[z];
            double factor = by->basis[order * by->entries + z];
            for (long i = 0; i < columns; i++) {
                of_one[z * columns + i] += factor * slopes[i * width];
            }
        }
    }
}

/* Entries of a Jacobian, (shared_count K + z, columns), from slopes by the curves. */
void brachis_entries(
    long count, long columns, long width, const double *table, const variables *by, double *entries
)
{
    WITH_WIDTH(entries_of, count, columns, table, by, entries)
}

/* Slopes of groups of values by y, ydot, yddot and, with 4 orders, ydddot: a table; and entries by variables, if they are asked
for. With an arm the slopes of its torques are found in `motion`; `states` are q, qdot and qddot. */
void brachis_differentiate(
    const table_sizes *sizes, const chain *arm, const double **states, const motion_slopes *motion,
    const value_group *groups, double *table, const variables *by, double *entries
)
{
    long count = sizes->count;
    long n = sizes->n;
    long width = sizes->width;
    for (const value_group *group = groups; group < groups + sizes->groups; group++) {
        double *slopes = group->by[0].numbers;
        if (group->quantity == FORMULA) {
            brachis_formula(group->slopes_of, count, states[0], n, NULL, 0, slopes);
        }
        for (long i = 0; i < count * group->values * n && group->quantity == FORMULA; i++) {
            slopes[i] *= group->factors[i / n % group->values];
        }
    }
    if (arm) {
        brachis_torque_slopes(arm, count, width, states, motion);
    }
    WITH_WIDTH(chain_rule, sizes, groups, motion, table)
    if (by) {
        brachis_entries(count, sizes->columns, width, table, by, entries);
    }
}

/* Values of the groups that are quantities of joints or formulas, each (K, values), one behind the other; `quantities` are q and
its three derivatives and the torque, (K, n). */
void brachis_values(
    long count, long n, const double **quantities, long group_count, const value_group *groups, double *values
)
{
    for (const value_group *group = groups; group < groups + group_count; group++) {
        if (group->quantity == FORMULA) {
            brachis_formula(group->values_of, count, quantities[0], n, NULL, 0, values);
        }
        for (long i = 0; i < count * group->values && group->quantity == FORMULA; i++) {
            values[i] *= group->factors[i % group->values];
        }
        for (long k = 0; k < count && group->quantity >= 0 && group->quantity <= TORQUE; k++) {
            const double *quantity = quantities[group->quantity] + k * n;
            for (long i = 0; i < group->values; i++) {
                values[k * group->values + i] = (quantity[group->joints[i]] - group->offsets[i]) * group->factors[i];
            }
        }
        values += count * group->values;
    }
}
