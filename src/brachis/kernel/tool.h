/* The tool of a chain: its placement, the columns of its Jacobian, and rotation vectors. */

#ifndef BRACHIS_TOOL_H
#define BRACHIS_TOOL_H

#include "chain.h"

/* What of the tool is prescribed: `rows` of its position along the world's axes, and behind them `turns` = 0, 1 or 3 rows of
rotation. One is an angle about an axis of the world: that of an axis of the tool in the plane of two axes of the world, of which
the second counts with a sign. All six may be in the axes of the tool, for a pose. */
typedef struct {
    long in_tool_axes, rows, axes[3], turns;
    long tool_axis, first, second;
    double sign;
} prescribed;

/* A part of a motion: linear along three axes, then angular about them. */
static inline pack part_of(const twist *a, long part)
{
    const pack parts[6] = {a->v.x, a->v.y, a->v.z, a->w.x, a->w.y, a->w.z};
    return parts[part];
}

/* Parts of the tool's motion that are prescribed. */
typedef struct {
    long count, parts[6];
} selection;

static inline selection select_parts(const prescribed *task)
{
    selection chosen = {task->rows + task->turns, {0}};
    for (long i = 0; i < chosen.count; i++) {
        long turn = task->turns == 1 ? 6 - task->first - task->second : 3 + i - task->rows;
        chosen.parts[i] = i < task->rows ? task->axes[i] : turn;
    }
    return chosen;
}

static inline pack chosen_part(const twist *a, const selection *chosen, long row)
{
    return part_of(a, chosen->parts[row]);
}

/* Placement: position, and columns of the rotation. */
typedef struct {
    vec position;
    vec rotation[3];
} placement;

/* Turn a vector into the axes of the tool, whose rotation has these columns. */
static inline vec into_tool(const vec *rotation, vec a)
{
    return (vec){dot(rotation[0], a), dot(rotation[1], a), dot(rotation[2], a)};
}

/* Place the tool where joints are at q, (n), and find the columns, (n), of its Jacobian: motions of its origin, along its
own axes or the world's. */
static inline placement place_tool(const chain *arm, const pack *q, int in_tool_axes, twist *columns)
{
    long n = arm->joints;
    vec axes[n], points[n];
    displacement placed = at_zero();
    for (long i = 0; i < n; i++) {
        move_joint(arm, i, q[i], &placed, &axes[i], &points[i]);
    }
    const double *R = arm->tool_rotation;
    placement tool = {.position = move_point(&placed, arm->tool_position)};
    for (int j = 0; j < 3; j++) {
        tool.rotation[j] = turn(&placed, (double[3]){R[j], R[3 + j], R[6 + j]});
    }
    for (long i = 0; i < n; i++) {
        vec linear = axes[i];
        vec angular = constant((double[3]){0.0, 0.0, 0.0});
        if (arm->turns[i] != 0.0) {
            linear = cross(axes[i], subtract(tool.position, points[i]));
            angular = axes[i];
        }
        if (in_tool_axes) {
            linear = into_tool(tool.rotation, linear);
            angular = into_tool(tool.rotation, angular);
        }
        columns[i] = (twist){angular, linear};
    }
    return tool;
}

/* Rotation vector of a rotation matrix: by the quaternion, whose largest part is found first (S. W. Shepperd, Journal of
Guidance and Control 1(3), 1978). */
static inline void logarithm(const double *R, double *vector)
{
    double trace = R[0] + R[4] + R[8];
    double parts[4] = {trace, R[0], R[4], R[8]};
    int largest = 0;
    for (int i = 1; i < 4; i++) {
        largest = parts[i] > parts[largest] ? i : largest;
    }
    /* Four times the product of the largest part with every part. */
    double x = R[7] - R[5];
    double y = R[2] - R[6];
    double z = R[3] - R[1];
    double table[4][4] = {
        {1.0 + trace, x, y, z},
        {x, 1.0 + 2.0 * R[0] - trace, R[1] + R[3], R[2] + R[6]},
        {y, R[1] + R[3], 1.0 + 2.0 * R[4] - trace, R[5] + R[7]},
        {z, R[2] + R[6], R[5] + R[7], 1.0 + 2.0 * R[8] - trace},
    };
    const double *quaternion = table[largest];
    double sign = quaternion[0] < 0.0 ? -1.0 : 1.0;
    double size =
        sqrt(quaternion[1] * quaternion[1] + quaternion[2] * quaternion[2] + quaternion[3] * quaternion[3]);
    double real = sign * quaternion[0];
    /* The angle over the length of the quaternion's vector. */
    double factor = size > 1e-9 * real ? 2.0 * atan2(size, real) / size : 2.0 / real;
    for (int i = 0; i < 3; i++) {
        vector[i] = sign * factor * quaternion[1 + i];
    }
}

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

/* How a motion changes as its axes turn with w. */
static inline twist turn_axes(vec w, twist a)
{
    return (twist){cross(w, a.w), cross(w, a.v)};
}

/* The tool's acceleration Jdot qdot, from the columns of its Jacobian. */
static inline twist bias_of(long n, const twist *columns, const pack *qdot, int in_tool_axes)
{
    twist V = {0};
    twist a = {0};
    for (long i = 0; i < n; i++) {
        a = add_twists(a, scale_twist(cross_twists(V, columns[i]), qdot[i]));
        V = add_twists(V, scale_twist(columns[i], qdot[i]));
    }
    if (!in_tool_axes) {
        a.v = add(a.v, cross(V.w, V.v));
    }
    return a;
}

/* Derivatives of the tool's velocity V and acceleration a, from the columns J_i of its Jacobian, qdot and qddot. Joints after
joint i carry its axis relative to the tool: in the tool's axes dJ_i/dq_k = [J_i, J_k] for i < k, else 0 (Murray, Li, Sastry 1994,
chapter 3). With S_k and s_k the parts of V and a that come from the joints before joint k,
    dV/dq_k = [S_k, J_k],    da/dq_k = [s_k, J_k] + [[S_k, J_k], V - S_k],    da/dqdot_k = 2 [S_k, J_k] + [J_k, V]
In the world's axes the tool's turn with each joint, and a point of it has the acceleration a_v + w x v. */
static inline void differentiate_tool(
    long n, const twist *columns, const pack *qdot, const pack *qddot, int in_tool_axes, twist *V_q, twist *a_q,
    twist *a_qdot
)
{
    twist S[n], s[n];
    twist V = {0};
    twist a = {0};
    for (long i = 0; i < n; i++) {
        S[i] = V;
        s[i] = a;
        V_q[i] = cross_twists(V, columns[i]);
        V = add_twists(V, scale_twist(columns[i], qdot[i]));
        a = add_twists(a, scale_twist(columns[i], qddot[i]));
        a = add_twists(a, scale_twist(V_q[i], qdot[i]));
    }
    twist classical = {a.w, add(a.v, cross(V.w, V.v))};
    for (long i = 0; i < n; i++) {
        twist after = add_twists(V, scale_twist(S[i], all(-1.0)));
        twist slope = V_q[i];
        twist by_q = add_twists(cross_twists(s[i], columns[i]), cross_twists(slope, after));
        twist by_qdot = add_twists(scale_twist(slope, all(2.0)), cross_twists(columns[i], V));
        if (!in_tool_axes) {
            vec w = columns[i].w;
            by_qdot.v = add(by_qdot.v, add(cross(w, V.v), cross(V.w, columns[i].v)));
            by_q.v = add(by_q.v, add(cross(slope.w, V.v), cross(V.w, slope.v)));
            by_q = add_twists(by_q, turn_axes(w, classical));
            slope = add_twists(slope, turn_axes(w, V));
        }
        V_q[i] = slope;
        a_q[i] = by_q;
        a_qdot[i] = by_qdot;
    }
}

#endif
