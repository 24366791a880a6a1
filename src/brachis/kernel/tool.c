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
        for (long i = 0; i < n; i++) {
            posture[i] = gather(q, count, n, k, i);
        }
        placement tool = place_tool(arm, posture, in_tool_axes, columns);
        for (int j = 0; j < 3; j++) {
            scatter(tool.rotation[j].x, rotations, count, 9, k, j);
            scatter(tool.rotation[j].y, rotations, count, 9, k, 3 + j);
            scatter(tool.rotation[j].z, rotations, count, 9, k, 6 + j);
        }
        scatter(tool.position.x, positions, count, 3, k, 0);
        scatter(tool.position.y, positions, count, 3, k, 1);
        scatter(tool.position.z, positions, count, 3, k, 2);
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
            rates[i] = gather(qdot, count, n, k, i);
            more[i] = gather(qddot, count, n, k, i);
        }
        differentiate_tool(n, columns, rates, more, in_tool_axes, slopes, by_q, by_qdot);
        for (long i = 0; i < n; i++) {
            write_twist(slopes[i], velocity_q, count, n, k, i);
            write_twist(by_q[i], acceleration_q, count, n, k, i);
            write_twist(by_qdot[i], acceleration_qdot, count, n, k, i);
        }
    }
}

/* Sizes, (K), of the tool's velocity (`quantity` 0), angular velocity (1) or acceleration (2) at its origin, and their slopes
by q, qdot and qddot, (K, n) each, if they are asked for: those of a vector of length zero are zero. */
void brachis_tool_sizes(
    const chain *arm, long count, int quantity, const double *q, const double *qdot, const double *qddot,
    double *sizes, double *slopes_q, double *slopes_qdot, double *slopes_qddot
)
{
    long n = arm->joints;
    for (long k = 0; k < count; k += LANES) {
        pack posture[n], rates[n], more[n];
        twist columns[n], by_q[n], by_qdot[n], slopes[n];
        twist V = {0};
        vec tangential = {0};
        for (long i = 0; i < n; i++) {
            posture[i] = gather(q, count, n, k, i);
            rates[i] = gather(qdot, count, n, k, i);
            more[i] = gather(qddot, count, n, k, i);
        }
        place_tool(arm, posture, 0, columns);
        for (long i = 0; i < n; i++) {
            V = add_twists(V, scale_twist(columns[i], rates[i]));
            tangential = add(tangential, scale(columns[i].v, more[i]));
        }
        vec motions[3] = {V.v, V.w, add(tangential, bias_of(n, columns, rates, 0).v)};
        vec direction = motions[quantity];
        pack size = dot(direction, direction);
        pack inverse;
        for (int lane = 0; lane < LANES; lane++) {
            size[lane] = sqrt(size[lane]);
            inverse[lane] = size[lane] > 0.0 ? 1.0 / size[lane] : 0.0;
        }
        scatter(size, sizes, count, 1, k, 0);
        if (!slopes_q) {
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
            scatter(dot(direction, own[0]), slopes_q, count, n, k, i);
            scatter(dot(direction, own[1]), slopes_qdot, count, n, k, i);
            scatter(dot(direction, own[2]), slopes_qddot, count, n, k, i);
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
