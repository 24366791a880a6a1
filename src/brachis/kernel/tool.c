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

/* Derivatives dV/dq, da/dq and da/dqdot, (3, 6, K, n), of the tool's velocity V and acceleration a, from the columns of its
Jacobian, and qdot and qddot, (K, n). */
void brachis_tool_derivatives(
    long count, long n, const double *twists, const double *qdot, const double *qddot, int in_tool_axes,
    double *derivatives
)
{
    for (long k = 0; k < count; k += LANES) {
        twist columns[n], V_q[n], a_q[n], a_qdot[n];
        pack rates[n], accelerations[n];
        for (long i = 0; i < n; i++) {
            columns[i] = read_twist(twists, count, n, k, i);
        }
        read_block(qdot, count, n, k, rates);
        read_block(qddot, count, n, k, accelerations);
        differentiate_tool(n, columns, rates, accelerations, in_tool_axes, V_q, a_q, a_qdot);
        for (long i = 0; i < n; i++) {
            write_twist(V_q[i], derivatives, count, n, k, i);
            write_twist(a_q[i], derivatives + 6 * count * n, count, n, k, i);
            write_twist(a_qdot[i], derivatives + 12 * count * n, count, n, k, i);
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
        pack posture[n], rates[n], accelerations[n];
        twist columns[n], V_q[n], a_q[n], a_qdot[n];
        twist V = {0};
        vec tangential = {0};
        read_block(q, count, n, k, posture);
        read_block(qdot, count, n, k, rates);
        read_block(qddot, count, n, k, accelerations);
        place_tool(arm, posture, 0, columns);
        for (long i = 0; i < n; i++) {
            V = add_twists(V, scale_twist(columns[i], rates[i]));
            tangential = add(tangential, scale(columns[i].v, accelerations[i]));
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
        differentiate_tool(n, columns, rates, accelerations, 0, V_q, a_q, a_qdot);
        for (long i = 0; i < n; i++) {
            vec slopes[3][3] = {
                {V_q[i].v, columns[i].v, {0}},
                {V_q[i].w, columns[i].w, {0}},
                {a_q[i].v, a_qdot[i].v, columns[i].v},
            };
            for (int by = 0; by < 3; by++) {
                scatter(dot(direction, slopes[quantity][by]), slopes_of_sizes + by * count * n, count, n, k, i);
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
