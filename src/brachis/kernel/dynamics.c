/* Joint torques of rigid bodies and their exact derivatives, in the world frame.

S. Singh, R. P. Russell, P. M. Wensing, Efficient analytical derivatives of rigid-body dynamics using spatial vector
algebra, IEEE Robotics and Automation Letters 7(2), 2022. With S_i the axis of joint i as a twist, v and a the motion of
the body before it, f, I and B force, inertia and Coriolis matrix of all bodies behind it:

    psi_i = v x S_i,    phi_i = a x S_i + v x psi_i
    dtau_i/dq_j    = S_i . (I_i phi_j + 2 B_i psi_j)                   for j <= i
    dtau_j/dq_i    = S_j . (I_i phi_i + 2 B_i psi_i + S_i x* f_i)      for j < i
    dtau_i/dqdot_j = S_i . (2 I_i psi_j + 2 B_i S_j)                   for j <= i, and S_j . (2 I_i psi_i + 2 B_i S_i) above
    M_ij           = S_i . I_i S_j

About the world's origin B needs no 6 x 6 matrix. For one body of inertia J, momentum l and first moment h, which moves
with (w, v), it is 2 B (a, b) = (E a, 2 a x l) with E a = tr(J) a x w + 2 w x (J a) + 2 h x (a x v): all else cancels by
Jacobi's identity. E and l are summed over the bodies.

Rotors and friction of each joint come on top: armature qddot + viscous qdot + coulomb tanh(qdot / speed). */

#include "motion.h"

/* Symmetric matrix. */
typedef struct {
    pack xx, xy, xz, yy, yz, zz;
} inertia;

/* Columns of a matrix. */
typedef struct {
    vec x, y, z;
} matrix;

/* A body, or several as one: mass, first moment, inertia, momentum, the matrix E, and torque and force upon it; all about
the world's origin. */
typedef struct {
    pack mass;
    vec moment;
    inertia J;
    vec momentum;
    matrix E;
    vec torque, force;
} bodies;

static inline vec times(const inertia *J, vec a)
{
    return (vec){
        J->xx * a.x + J->xy * a.y + J->xz * a.z,
        J->xy * a.x + J->yy * a.y + J->yz * a.z,
        J->xz * a.x + J->yz * a.y + J->zz * a.z,
    };
}

static inline vec apply(const matrix *E, vec a)
{
    return add(add(scale(E->x, a.x), scale(E->y, a.y)), scale(E->z, a.z));
}

/* Move the chain behind joint i by its coordinate q, and return the joint's axis. */
static inline twist move_axis(const chain *arm, long i, pack q, displacement *placed)
{
    vec axis, point;
    move_joint(arm, i, q, placed, &axis, &point);
    if (arm->turns[i] == 0.0) {
        return (twist){constant((double[3]){0.0, 0.0, 0.0}), axis};
    }
    return (twist){axis, cross(point, axis)};
}

/* S . (torque, force) */
static inline pack pair(twist S, vec torque, vec force)
{
    return dot(S.w, torque) + dot(S.v, force);
}

/* R J R' about the center of mass. */
static inline inertia turn_inertia(const displacement *by, const double *J)
{
    vec x = turn(by, (double[3]){J[0], J[1], J[2]});
    vec y = turn(by, (double[3]){J[1], J[3], J[4]});
    vec z = turn(by, (double[3]){J[2], J[4], J[5]});
    return (inertia){
        x.x * by->x.x + y.x * by->y.x + z.x * by->z.x,
        x.x * by->x.y + y.x * by->y.y + z.x * by->z.y,
        x.x * by->x.z + y.x * by->y.z + z.x * by->z.z,
        x.y * by->x.y + y.y * by->y.y + z.y * by->z.y,
        x.y * by->x.z + y.y * by->y.z + z.y * by->z.z,
        x.z * by->x.z + y.z * by->y.z + z.z * by->z.z,
    };
}

/* Body i where the chain behind its joint is, without motion. */
static inline bodies place_body(const chain *arm, long i, const displacement *placed)
{
    pack mass = all(arm->masses[i]);
    vec c = move_point(placed, arm->centers + 3 * i);
    vec h = scale(c, mass);
    bodies own = {.mass = mass, .moment = h, .J = turn_inertia(placed, arm->inertias + 6 * i)};
    own.J.xx += h.y * c.y + h.z * c.z;
    own.J.yy += h.x * c.x + h.z * c.z;
    own.J.zz += h.x * c.x + h.y * c.y;
    own.J.xy -= h.x * c.y;
    own.J.xz -= h.x * c.z;
    own.J.yz -= h.y * c.z;
    return own;
}

/* Momentum, and torque and force, of a body that moves with v and accelerates with a. */
static inline void move_body(bodies *own, twist v, twist a)
{
    vec l = subtract(scale(v.v, own->mass), cross(own->moment, v.w));
    vec k = add(times(&own->J, v.w), cross(own->moment, v.v));
    vec force = subtract(scale(a.v, own->mass), cross(own->moment, a.w));
    vec torque = add(times(&own->J, a.w), cross(own->moment, a.v));
    own->momentum = l;
    own->force = add(force, cross(v.w, l));
    own->torque = add(torque, add(cross(v.w, k), cross(v.v, l)));
}

/* The matrix E of a body. */
static inline matrix coriolis(const bodies *own, twist v)
{
    const inertia *J = &own->J;
    vec w = v.w;
    vec h = own->moment;
    pack trace = J->xx + J->yy + J->zz;
    pack hv = 2.0 * dot(h, v.v);
    vec x = scale(cross(w, (vec){J->xx, J->xy, J->xz}), all(2.0));
    vec y = scale(cross(w, (vec){J->xy, J->yy, J->yz}), all(2.0));
    vec z = scale(cross(w, (vec){J->xz, J->yz, J->zz}), all(2.0));
    x = subtract(x, scale(v.v, 2.0 * h.x));
    y = subtract(y, scale(v.v, 2.0 * h.y));
    z = subtract(z, scale(v.v, 2.0 * h.z));
    x.x += hv;
    y.y += hv;
    z.z += hv;
    x.y -= trace * w.z;
    x.z += trace * w.y;
    y.x += trace * w.z;
    y.z -= trace * w.x;
    z.x -= trace * w.y;
    z.y += trace * w.x;
    return (matrix){x, y, z};
}

_Static_assert(sizeof(bodies) == 28 * sizeof(pack), "bodies are made of packs alone");

static inline void add_bodies(bodies *sum, const bodies *own)
{
    pack *numbers = (pack *)sum; /* all that a body is made of */
    for (unsigned long i = 0; i < sizeof(bodies) / sizeof(pack); i++) {
        numbers[i] += ((const pack *)own)[i];
    }
}

static inline twist gravity_upwards(const chain *arm)
{
    vec none = constant((double[3]){0.0, 0.0, 0.0});
    return (twist){none, subtract(none, constant(arm->gravity))};
}

/* Take the motion (v, a) past joint i with axis S, psi = v x S, rate and acceleration, to the body behind it. */
static inline void pass_joint(
    const chain *arm, long i, const displacement *placed, twist S, twist psi, pack rate, pack acceleration, twist *v,
    twist *a, bodies *own
)
{
    *v = add_twists(*v, scale_twist(S, rate));
    *a = add_twists(*a, scale_twist(psi, rate));
    *a = add_twists(*a, scale_twist(S, acceleration));
    *own = place_body(arm, i, placed);
    move_body(own, *v, *a);
}

/* Torque for rotor inertia and friction of joint i, and its slope by the joint's velocity. */
static inline pack resist(const chain *arm, long i, pack rate, pack acceleration, pack *slope)
{
    const double *own = arm->friction + 4 * i;
    pack torque = own[0] * acceleration + own[1] * rate;
    *slope = all(own[1]);
    if (own[2] != 0.0) {
        pack part = tanhs(rate / own[3]);
        torque += own[2] * part;
        *slope += own[2] / own[3] * (1.0 - part * part);
    }
    return torque;
}

/* Torques, (K, n), of K states, (K, n). */
void brachis_torques(
    const chain *arm, long count, const double *q, const double *qdot, const double *qddot, double *torques
)
{
    long n = arm->joints;
    for (long k = 0; k < count; k += LANES) {
        twist axes[n];
        bodies moved[n];
        pack resisted[n];
        displacement placed = at_zero();
        twist v = {0};
        twist a = gravity_upwards(arm);
        for (long i = 0; i < n; i++) {
            pack rate = gather(qdot, count, n, k, i);
            pack acceleration = gather(qddot, count, n, k, i);
            pack slope;
            resisted[i] = resist(arm, i, rate, acceleration, &slope);
            axes[i] = move_axis(arm, i, gather(q, count, n, k, i), &placed);
            twist psi = cross_twists(v, axes[i]);
            pass_joint(arm, i, &placed, axes[i], psi, rate, acceleration, &v, &a, &moved[i]);
        }
        vec torque = {0};
        vec force = {0};
        for (long i = n - 1; i >= 0; i--) {
            torque = add(torque, moved[i].torque);
            force = add(force, moved[i].force);
            scatter(pair(axes[i], torque, force) + resisted[i], torques, count, n, k, i);
        }
    }
}

/* Derivatives of the torques of LANES states by q, qdot and qddot, (n, n) each: row joint torque, column joint. */
static void differentiate(
    const chain *arm, long count, long k, const double **states, pack *by_q, pack *by_qdot, pack *by_qddot
)
{
    long n = arm->joints;
    twist axes[n], psi[n], phi[n];
    bodies moved[n];
    pack slopes[n];
    displacement placed = at_zero();
    twist v = {0};
    twist a = gravity_upwards(arm);
    for (long i = 0; i < n; i++) {
        pack rate = gather(states[1], count, n, k, i);
        pack acceleration = gather(states[2], count, n, k, i);
        resist(arm, i, rate, acceleration, &slopes[i]);
        axes[i] = move_axis(arm, i, gather(states[0], count, n, k, i), &placed);
        psi[i] = cross_twists(v, axes[i]);
        phi[i] = add_twists(cross_twists(a, axes[i]), cross_twists(v, psi[i]));
        pass_joint(arm, i, &placed, axes[i], psi[i], rate, acceleration, &v, &a, &moved[i]);
        moved[i].E = coriolis(&moved[i], v);
    }
    for (long i = n - 1; i >= 0; i--) {
        if (i < n - 1) {
            add_bodies(&moved[i], &moved[i + 1]);
        }
        bodies *own = &moved[i];
        twist S = axes[i];
        vec h = own->moment;
        vec l = scale(own->momentum, all(2.0));
        /* Rows: joints before this one, and itself. */
        vec turning = add(times(&own->J, S.w), cross(h, S.v));
        vec pushing = subtract(scale(S.v, own->mass), cross(h, S.w));
        vec bent = {dot(own->E.x, S.w), dot(own->E.y, S.w), dot(own->E.z, S.w)};
        bent = add(bent, cross(l, S.v));
        for (long j = 0; j <= i; j++) {
            long place = i * n + j;
            by_q[place] = pair(phi[j], turning, pushing) + dot(bent, psi[j].w);
            by_qdot[place] = 2.0 * pair(psi[j], turning, pushing) + dot(bent, axes[j].w);
            by_qddot[place] = pair(axes[j], turning, pushing);
            if (j == i) {
                by_qdot[place] += slopes[i];
                by_qddot[place] += arm->friction[4 * i];
            }
            by_qddot[j * n + i] = by_qddot[place];
        }
        /* Columns: what this joint does to those before it. */
        vec torque = add(times(&own->J, phi[i].w), cross(h, phi[i].v));
        torque = add(torque, apply(&own->E, psi[i].w));
        torque = add(torque, add(cross(S.w, own->torque), cross(S.v, own->force)));
        vec force = subtract(scale(phi[i].v, own->mass), cross(h, phi[i].w));
        force = add(force, add(cross(psi[i].w, l), cross(S.w, own->force)));
        vec rate_torque = scale(add(times(&own->J, psi[i].w), cross(h, psi[i].v)), all(2.0));
        rate_torque = add(rate_torque, apply(&own->E, S.w));
        vec rate_force = scale(subtract(scale(psi[i].v, own->mass), cross(h, psi[i].w)), all(2.0));
        rate_force = add(rate_force, cross(S.w, l));
        for (long j = 0; j < i; j++) {
            by_q[j * n + i] = pair(axes[j], torque, force);
            by_qdot[j * n + i] = pair(axes[j], rate_torque, rate_force);
        }
    }
}

/* Derivatives of the torques by q, qdot and qddot, (K, n, n) each. */
void brachis_torque_derivatives(
    const chain *arm, long count, const double *q, const double *qdot, const double *qddot, double *by_q,
    double *by_qdot, double *by_qddot
)
{
    long size = arm->joints * arm->joints;
    const double *states[3] = {q, qdot, qddot};
    for (long k = 0; k < count; k += LANES) {
        pack parts[3 * size];
        differentiate(arm, count, k, states, parts, parts + size, parts + 2 * size);
        write_block(parts, by_q, count, size, k);
        write_block(parts + size, by_qdot, count, size, k);
        write_block(parts + 2 * size, by_qddot, count, size, k);
    }
}

/* Slopes of the torques by y, ydot and yddot, in `motion`; `states` are q, qdot and qddot. */
void brachis_torque_slopes(
    const chain *arm, long count, long width, const double **states, const motion_slopes *motion
)
{
    long n = arm->joints;
    long size = n * width;
    for (long k = 0; k < count; k += LANES) {
        pack by_q[n * n], by_qdot[n * n], by_qddot[n * n];
        pack G[size], rates[size], accelerations[size], found[size];
        differentiate(arm, count, k, states, by_q, by_qdot, by_qddot);
        read_block(motion->gradient, count, size, k, G);
        read_block(motion->qdot_y, count, size, k, rates);
        read_block(motion->qddot_y, count, size, k, accelerations);
        multiply(by_q, n, G, n, n, width, SET, found);
        multiply(by_qdot, n, rates, n, n, width, ADD, found);
        multiply(by_qddot, n, accelerations, n, n, width, ADD, found);
        write_block(found, motion->torque, count, size, k);
        read_block(motion->qddot_ydot, count, size, k, accelerations);
        multiply(by_qdot, n, G, n, n, width, SET, found);
        multiply(by_qddot, n, accelerations, n, n, width, ADD, found);
        write_block(found, motion->torque + count * size, count, size, k);
        multiply(by_qddot, n, G, n, n, width, SET, found);
        write_block(found, motion->torque + 2 * count * size, count, size, k);
    }
}

/* Mass matrices with rotors, (K, n, n), of K postures, (K, n). */
void brachis_mass_matrices(const chain *arm, long count, const double *q, double *matrices)
{
    long n = arm->joints;
    for (long k = 0; k < count; k += LANES) {
        twist axes[n];
        bodies placed_bodies[n];
        displacement placed = at_zero();
        for (long i = 0; i < n; i++) {
            axes[i] = move_axis(arm, i, gather(q, count, n, k, i), &placed);
            placed_bodies[i] = place_body(arm, i, &placed);
        }
        for (long i = n - 1; i >= 0; i--) {
            bodies *own = &placed_bodies[i];
            if (i < n - 1) {
                add_bodies(own, own + 1);
            }
            twist S = axes[i];
            vec turning = add(times(&own->J, S.w), cross(own->moment, S.v));
            vec pushing = subtract(scale(S.v, own->mass), cross(own->moment, S.w));
            for (long j = 0; j <= i; j++) {
                pack part = pair(axes[j], turning, pushing);
                part += j == i ? arm->friction[4 * i] : 0.0;
                scatter(part, matrices, count, n * n, k, i * n + j);
                scatter(part, matrices, count, n * n, k, j * n + i);
            }
        }
    }
}
