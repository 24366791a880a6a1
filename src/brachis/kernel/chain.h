/* A serial chain, described at its zero posture in the world frame, and where its joints and bodies are (product of
exponentials; R. M. Murray, Z. Li, S. S. Sastry, A Mathematical Introduction to Robotic Manipulation, 1994). */

#ifndef BRACHIS_CHAIN_H
#define BRACHIS_CHAIN_H

#include "pack.h"

/* Python holds the same structure; see chain.py. n is the number of joints. */
typedef struct {
    long joints;
    long carriers;               /* see dynamics.c */
    const double *turns;         /* (n): 1 for a revolute joint, 0 for a prismatic one */
    const double *axes;          /* (n, 3): unit vectors */
    const double *points;        /* (n, 3): on the axes, m */
    const double *tool_position; /* (3), m */
    const double *tool_rotation; /* (3, 3) */
    const double *masses;        /* (n): of the body behind each joint, kg */
    const double *centers;       /* (n, 3): of mass, m */
    const double *inertias;      /* (n, 6): xx, xy, xz, yy, yz, zz about the center of mass, kg m^2 */
    const double *gravity;       /* (3), m/s^2 */
    const double *friction;      /* (n, 4): rotor inertia, viscous and Coulomb term, and v_eps of tanh(qdot / v_eps) */
} chain;

/* Motion of a body, or the axis of a joint: angular part, and linear part at the world's origin. */
typedef struct {
    vec w, v;
} twist;

/* v x S, the Lie bracket */
static inline twist cross_twists(twist v, twist S)
{
    return (twist){cross(v.w, S.w), add(cross(v.w, S.v), cross(v.v, S.w))};
}

static inline twist add_twists(twist a, twist b)
{
    return (twist){add(a.w, b.w), add(a.v, b.v)};
}

static inline twist scale_twist(twist a, pack factor)
{
    return (twist){scale(a.w, factor), scale(a.v, factor)};
}

/* Displacement from the zero posture: columns of the rotation, and shift. */
typedef struct {
    vec x, y, z, shift;
} displacement;

static inline displacement at_zero(void)
{
    pack none = all(0.0);
    pack one = all(1.0);
    return (displacement){{one, none, none}, {none, one, none}, {none, none, one}, {none, none, none}};
}

static inline vec turn(const displacement *by, const double *a)
{
    return add(add(scale(by->x, all(a[0])), scale(by->y, all(a[1]))), scale(by->z, all(a[2])));
}

static inline vec move_point(const displacement *by, const double *a)
{
    return add(turn(by, a), by->shift);
}

/* Rodrigues' formula for one column of a rotation; `along` is the axis' component along it, and does not change. */
static inline vec turn_about(vec axis, vec column, double along, pack sine, pack cosine)
{
    vec turned = add(scale(column, cosine), scale(cross(axis, column), sine));
    return add(turned, scale(axis, all(along) * (1.0 - cosine)));
}

/* Move the chain behind joint i by its coordinate q. `axis` and `point` are set to where the joint's axis is. */
static inline void move_joint(const chain *arm, long i, pack q, displacement *placed, vec *axis, vec *point)
{
    const double *a = arm->axes + 3 * i;
    *axis = turn(placed, a);
    *point = move_point(placed, arm->points + 3 * i);
    if (arm->turns[i] == 0.0) {
        placed->shift = add(placed->shift, scale(*axis, q));
        return;
    }
    pack sine = sines(q);
    pack cosine = cosines(q);
    placed->x = turn_about(*axis, placed->x, a[0], sine, cosine);
    placed->y = turn_about(*axis, placed->y, a[1], sine, cosine);
    placed->z = turn_about(*axis, placed->z, a[2], sine, cosine);
    placed->shift = subtract(*point, turn(placed, arm->points + 3 * i));
}

#endif
