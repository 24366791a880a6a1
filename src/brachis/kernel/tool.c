/* Placement of the tool, the columns of its Jacobian, and their derivatives. */

#include "tool.h"

static inline twist read_twist(const double *table, long count, long n, long k, long i)
{
    pack parts[6];
    for (int row = 0; row < 6; row++) {
        parts[row] = gather(table + row * count * n, count, n, k, i);
    }
    return (twist){{parts[3], parts[4], parts[5]}, {parts[0], parts[1], parts[2]}};
}

static inline void write_twist(twist a, double *table, long count, long n, long k, long i)
{
    pack parts[6] = {a.v.x, a.v.y, a.v.z, a.w.x, a.w.y, a.w.z};
    for (int row = 0; row < 6; row++) {
        scatter(parts[row], table + row * count * n, count, n, k, i);
    }
}

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

/* How a motion changes as its axes turn with w. */
static inline twist turn_axes(vec w, twist a)
{
    return (twist){cross(w, a.w), cross(w, a.v)};
}

/* Derivatives, (6, K, n) each, of the tool's velocity V and acceleration a, from the columns J_i of its Jacobian and
rates, (K, n). Joints after joint i carry its axis relative to the tool: in the tool's axes dJ_i/dq_k = [J_i, J_k] for
i < k, else 0 (Murray, Li, Sastry 1994, chapter 3). With S_k and s_k the parts of V and a that come from the joints
before joint k,

    dV/dq_k = [S_k, J_k],    da/dq_k = [s_k, J_k] + [[S_k, J_k], V - S_k],    da/dqdot_k = 2 [S_k, J_k] + [J_k, V]

In the world's axes the tool's turn with each joint, and a point of it has the acceleration a_v + w x v. */
void brachis_tool_derivatives(
    long count, long n, const double *twists, const double *qdot, const double *qddot, int in_tool_axes,
    double *velocity_q, double *acceleration_q, double *acceleration_qdot
)
{
    for (long k = 0; k < count; k += LANES) {
        twist columns[n], before[n], parts[n], slopes[n];
        twist V = {0};
        twist a = {0};
        for (long i = 0; i < n; i++) {
            pack rate = gather(qdot, count, n, k, i);
            columns[i] = read_twist(twists, count, n, k, i);
            before[i] = V;
            parts[i] = a;
            slopes[i] = cross_twists(V, columns[i]);
            V = add_twists(V, scale_twist(columns[i], rate));
            a = add_twists(a, scale_twist(columns[i], gather(qddot, count, n, k, i)));
            a = add_twists(a, scale_twist(slopes[i], rate));
        }
        twist classical = {a.w, add(a.v, cross(V.w, V.v))};
        for (long i = 0; i < n; i++) {
            twist after = add_twists(V, scale_twist(before[i], all(-1.0)));
            twist by_q = add_twists(cross_twists(parts[i], columns[i]), cross_twists(slopes[i], after));
            twist by_qdot = add_twists(scale_twist(slopes[i], all(2.0)), cross_twists(columns[i], V));
            twist slope = slopes[i];
            if (!in_tool_axes) {
                vec w = columns[i].w;
                by_qdot.v = add(by_qdot.v, add(cross(w, V.v), cross(V.w, columns[i].v)));
                by_q.v = add(by_q.v, add(cross(slope.w, V.v), cross(V.w, slope.v)));
                by_q = add_twists(by_q, turn_axes(w, classical));
                slope = add_twists(slope, turn_axes(w, V));
            }
            write_twist(slope, velocity_q, count, n, k, i);
            write_twist(by_q, acceleration_q, count, n, k, i);
            write_twist(by_qdot, acceleration_qdot, count, n, k, i);
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
