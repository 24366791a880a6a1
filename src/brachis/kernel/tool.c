/* Placement of the tool, the columns of its Jacobian, and their derivatives. */

#include "tool.h"

/* Positions, (K, 3), and rotations, (K, 3, 3), of the tool at K postures, (K, n), and the columns of its Jacobian,
(6, K, n): linear, then angular velocity at the tool's origin, along the tool's axes or the world's. */
void brachis_tool(
    const chain *arm, long count, const double *q, int in_tool_axes, double *positions, double *rotations,
    double *twists
)
{
    long n = arm->joints;
    for (long k = 0; k < count; k += LANES) {
        pack posture[n];
        twist columns[n];
        read_block(q, count, n, k, posture);
        placement tool = place_tool(arm, posture, in_tool_axes, columns);
        const vec *R = tool.rotation;
        const pack rows[9] = {R[0].x, R[1].x, R[2].x, R[0].y, R[1].y, R[2].y, R[0].z, R[1].z, R[2].z};
        const pack position[3] = {tool.position.x, tool.position.y, tool.position.z};
        write_block(rows, rotations, count, 9, k);
        write_block(position, positions, count, 3, k);
        for (long i = 0; i < n; i++) {
            write_twist(columns[i], twists, count, n, k, i);
        }
    }
}

/* Derivatives, (6, K, n) each, of the tool's velocity and acceleration, from the columns of its Jacobian and rates,
(K, n). */
void brachis_tool_derivatives(
    long count, long n, const double *twists, const double *qdot, const double *qddot, int in_tool_axes,
    double *velocity_q, double *acceleration_q, double *acceleration_qdot
)
{
    for (long k = 0; k < count; k += LANES) {
        twist columns[n], by_q[n], by_qdot[n], slopes[n];
        pack rates[n], more[n];
        for (long i = 0; i < n; i++) {
            columns[i] = read_twist(twists, count, n, k, i);
        }
        read_block(qdot, count, n, k, rates);
        read_block(qddot, count, n, k, more);
        differentiate_tool(n, columns, rates, more, in_tool_axes, slopes, by_q, by_qdot);
        for (long i = 0; i < n; i++) {
            write_twist(slopes[i], velocity_q, count, n, k, i);
            write_twist(by_q[i], acceleration_q, count, n, k, i);
            write_twist(by_qdot[i], acceleration_qdot, count, n, k, i);
        }
    }
}

/* Sizes, (K), of the tool's velocity (`quantity` 0), angular velocity (1) or acceleration (2) at its origin, and their slopes
by q, qdot and qddot, (3, K, n), if they are asked for: those of a vector of length zero are zero. */
void brachis_tool_sizes(
    const chain *arm, long count, int quantity, const double *q, const double *qdot, const double *qddot,
    double *slopes_of_sizes, double *sizes
)
{
    long n = arm->joints;
    for (long k = 0; k < count; k += LANES) {
        pack posture[n], rates[n], more[n];
        twist columns[n], by_q[n], by_qdot[n], slopes[n];
        twist V = {0};
        vec tangential = {0};
        read_block(q, count, n, k, posture);
        read_block(qdot, count, n, k, rates);
        read_block(qddot, count, n, k, more);
        place_tool(arm, posture, 0, columns);
        for (long i = 0; i < n; i++) {
            V = add_twists(V, scale_twist(columns[i], rates[i]));
            tangential = add(tangential, scale(columns[i].v, more[i]));
        }
        vec motions[3] = {V.v, V.w, add(tangential, bias_of(n, columns, rates, 0).v)};
        vec direction = motions[quantity];
        pack size = roots(dot(direction, direction));
        pack inverse;
        for (int lane = 0; lane < LANES; lane++) {
            inverse[lane] = size[lane] > 0.0 ? 1.0 / size[lane] : 0.0;
        }
        scatter(size, sizes, count, 1, k, 0);
        if (!slopes_of_sizes) {
            continue;
        }
        direction = scale(direction, inverse);
        differentiate_tool(n, columns, rates, more, 0, slopes, by_q, by_qdot);
        for (long i = 0; i < n; i++) {
            vec found[3][3] = {
                {slopes[i].v, columns[i].v, {0}},
                {slopes[i].w, columns[i].w, {0}},
                {by_q[i].v, by_qdot[i].v, columns[i].v},
            };
            const vec *own = found[quantity];
            for (int by = 0; by < 3; by++) {
                scatter(dot(direction, own[by]), slopes_of_sizes + by * count * n, count, n, k, i);
            }
        }
    }
}

/* Rotation vectors, (K, 3), of rotation matrices, (K, 3, 3). */
void brachis_logarithms(long count, const double *rotations, double *vectors)
{
    for (long k = 0; k < count; k++) {
        logarithm(rotations + 9 * k, vectors + 3 * k);
    }
}
