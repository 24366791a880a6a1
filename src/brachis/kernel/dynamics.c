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

Rotors and friction of each joint come on top: armature qddot + viscous qdot + coulomb tanh(qdot / speed).

The first joints of a chain may be carriers of the workpiece: a chain of their own from the world, last joint first. The
other joints begin at the world again. All steps below go through the joints in this order, from the world outwards. */

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

/* Momentum, or force, of a body: angular part about the world's origin, and linear part. */
typedef struct {
    vec torque, force;
} wrench;

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

/* The joint of a step. */
static inline long joint_at(const chain *arm, long step)
{
    return step < arm->carriers ? arm->carriers - 1 - step : step;
}

/* The first step of the chain to which a step belongs. */
static inline long first_step(const chain *arm, long step)
{
    return step < arm->carriers ? 0 : arm->carriers;
}

/* Whether a step is the last one of its chain. */
static inline int is_last(const chain *arm, long step)
{
    return step == arm->joints - 1 || step == arm->carriers - 1;
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

/* S . f */
static inline pack pair(twist S, wrench f)
{
    return dot(S.w, f.torque) + dot(S.v, f.force);
}

/* I a */
static inline wrench apply_inertia(const bodies *body, twist a)
{
    vec h = body->moment;
    return (wrench){
        add(times(&body->J, a.w), cross(h, a.v)),
        subtract(scale(a.v, body->mass), cross(h, a.w)),
    };
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
    bodies body = {.mass = mass, .moment = h, .J = turn_inertia(placed, arm->inertias + 6 * i)};
    body.J.xx += h.y * c.y + h.z * c.z;
    body.J.yy += h.x * c.x + h.z * c.z;
    body.J.zz += h.x * c.x + h.y * c.y;
    body.J.xy -= h.x * c.y;
    body.J.xz -= h.x * c.z;
    body.J.yz -= h.y * c.z;
    return body;
}

/* Momentum, and torque and force, of a body that moves with v and accelerates with a. */
static inline void move_body(bodies *body, twist v, twist a)
{
    wrench momentum = apply_inertia(body, v);
    wrench rate = apply_inertia(body, a);
    vec l = momentum.force;
    body->momentum = l;
    body->force = add(rate.force, cross(v.w, l));
    body->torque = add(rate.torque, add(cross(v.w, momentum.torque), cross(v.v, l)));
}

/* The matrix E of a body. */
static inline matrix coriolis(const bodies *body, twist v)
{
    const inertia *J = &body->J;
    vec w = v.w;
    vec h = body->moment;
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

static inline void add_bodies(bodies *sum, const bodies *body)
{
    pack *numbers = (pack *)sum; /* all that a body is made of */
    for (unsigned long i = 0; i < sizeof(bodies) / sizeof(pack); i++) {
        numbers[i] += ((const pack *)body)[i];
    }
}

/* Placement and motion of the world, which accelerates against gravity. */
static inline void start_at_world(const chain *arm, displacement *placed, twist *v, twist *a)
{
    vec none = constant((double[3]){0.0, 0.0, 0.0});
    *placed = at_zero();
    *v = (twist){none, none};
    *a = (twist){none, subtract(none, constant(arm->gravity))};
}

/* Take the motion (v, a) past a joint with axis S and psi = v x S. */
static inline void pass_joint(twist S, twist psi, pack qdot, pack qddot, twist *v, twist *a)
{
    *v = add_twists(*v, scale_twist(S, qdot));
    *a = add_twists(*a, scale_twist(psi, qdot));
    *a = add_twists(*a, scale_twist(S, qddot));
}

/* Torque for rotor inertia and friction of joint i, and its slope by the joint's velocity. */
static inline pack resist(const chain *arm, long i, pack qdot, pack qddot, pack *slope)
{
    const double *friction = arm->friction + 4 * i;
    double viscous = friction[1];
    double coulomb = friction[2];
    pack torque = friction[0] * qddot + viscous * qdot;
    *slope = all(viscous);
    if (coulomb != 0.0) {
        pack share = tanhs(qdot / friction[3]);
        torque += coulomb * share;
        *slope += coulomb / friction[3] * (1.0 - share * share);
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
        twist S[n];
        bodies body[n];
        pack resistance[n];
        displacement placed;
        twist v, a;
        for (long step = 0; step < n; step++) {
            long i = joint_at(arm, step);
            if (step == first_step(arm, step)) {
                start_at_world(arm, &placed, &v, &a);
            }
            pack rate = gather(qdot, count, n, k, i);
            pack acceleration = gather(qddot, count, n, k, i);
            pack slope;
            resistance[i] = resist(arm, i, rate, acceleration, &slope);
            S[i] = move_axis(arm, i, gather(q, count, n, k, i), &placed);
            twist psi = cross_twists(v, S[i]);
            pass_joint(S[i], psi, rate, acceleration, &v, &a);
            body[i] = place_body(arm, i, &placed);
            move_body(&body[i], v, a);
        }
        wrench f = {0};
        for (long step = n - 1; step >= 0; step--) {
            long i = joint_at(arm, step);
            if (is_last(arm, step)) {
                f = (wrench){0};
            }
            f.torque = add(f.torque, body[i].torque);
            f.force = add(f.force, body[i].force);
            scatter(pair(S[i], f) + resistance[i], torques, count, n, k, i);
        }
    }
}

/* Of the joints of LANES states, (n): axes S, psi and phi, the bodies behind each as one, and slopes of its friction. */
typedef struct {
    twist *S, *psi, *phi;
    bodies *behind;
    pack *friction_qdot;
} joint_terms;

/* Derivatives of the torques of LANES states by q, qdot and qddot, (n, n) each: row joint torque, column joint. */
typedef struct {
    pack *tau_q, *tau_qdot, *M;
} torque_partials;

/* From the base to the tool: motion of every joint and body by itself. */
static void find_joint_terms(const chain *arm, long count, long k, const double **states, const joint_terms *of)
{
    long n = arm->joints;
    displacement placed;
    twist v, a;
    for (long step = 0; step < n; step++) {
        long i = joint_at(arm, step);
        if (step == first_step(arm, step)) {
            start_at_world(arm, &placed, &v, &a);
        }
        pack qdot = gather(states[1], count, n, k, i);
        pack qddot = gather(states[2], count, n, k, i);
        resist(arm, i, qdot, qddot, &of->friction_qdot[i]);
        twist S = move_axis(arm, i, gather(states[0], count, n, k, i), &placed);
        twist psi = cross_twists(v, S);
        of->S[i] = S;
        of->psi[i] = psi;
        of->phi[i] = add_twists(cross_twists(a, S), cross_twists(v, psi));
        pass_joint(S, psi, qdot, qddot, &v, &a);
        of->behind[i] = place_body(arm, i, &placed);
        move_body(&of->behind[i], v, a);
        of->behind[i].E = coriolis(&of->behind[i], v);
    }
}

/* Row of a joint up to the diagonal: what it feels of the joints before it. Joints of the other chain have no share. */
static void write_row(const chain *arm, long step, const joint_terms *of, const torque_partials *by)
{
    long n = arm->joints;
    long i = joint_at(arm, step);
    long first = first_step(arm, step);
    const bodies *body = &of->behind[i];
    twist S = of->S[i];
    wrench I_S = apply_inertia(body, S);
    vec B_S = {dot(body->E.x, S.w), dot(body->E.y, S.w), dot(body->E.z, S.w)}; /* angular part of 2 B' S */
    B_S = add(B_S, cross(scale(body->momentum, all(2.0)), S.v));
    for (long before = 0; before < first; before++) {
        long at = i * n + joint_at(arm, before);
        by->tau_q[at] = by->tau_qdot[at] = by->M[at] = all(0.0);
        at = joint_at(arm, before) * n + i;
        by->tau_q[at] = by->tau_qdot[at] = by->M[at] = all(0.0);
    }
    for (long before = first; before <= step; before++) {
        long j = joint_at(arm, before);
        long at = i * n + j;
        by->tau_q[at] = pair(of->phi[j], I_S) + dot(B_S, of->psi[j].w);
        by->tau_qdot[at] = 2.0 * pair(of->psi[j], I_S) + dot(B_S, of->S[j].w);
        by->M[at] = pair(of->S[j], I_S);
        if (j == i) {
            by->tau_qdot[at] += of->friction_qdot[i];
            by->M[at] += arm->friction[4 * i];
        }
        by->M[j * n + i] = by->M[at];
    }
}

/* Column of a joint above the diagonal: what the joints before it feel of it. */
static void write_column(const chain *arm, long step, const joint_terms *of, const torque_partials *by)
{
    long n = arm->joints;
    long i = joint_at(arm, step);
    const bodies *body = &of->behind[i];
    twist S = of->S[i];
    twist psi = of->psi[i];
    vec l = scale(body->momentum, all(2.0));
    wrench f_q = apply_inertia(body, of->phi[i]); /* I phi + 2 B psi + S x* f */
    f_q.torque = add(f_q.torque, apply(&body->E, psi.w));
    f_q.torque = add(f_q.torque, add(cross(S.w, body->torque), cross(S.v, body->force)));
    f_q.force = add(f_q.force, add(cross(psi.w, l), cross(S.w, body->force)));
    wrench I_psi = apply_inertia(body, psi);
    wrench f_qdot = { /* 2 I psi + 2 B S */
        add(scale(I_psi.torque, all(2.0)), apply(&body->E, S.w)),
        add(scale(I_psi.force, all(2.0)), cross(S.w, l)),
    };
    for (long before = first_step(arm, step); before < step; before++) {
        long j = joint_at(arm, before);
        by->tau_q[j * n + i] = pair(of->S[j], f_q);
        by->tau_qdot[j * n + i] = pair(of->S[j], f_qdot);
    }
}

static void differentiate(const chain *arm, long count, long k, const double **states, const torque_partials *by)
{
    long n = arm->joints;
    twist S[n], psi[n], phi[n];
    bodies behind[n];
    pack friction_qdot[n];
    const joint_terms of = {S, psi, phi, behind, friction_qdot};
    find_joint_terms(arm, count, k, states, &of);
    for (long step = n - 1; step >= 0; step--) {
        if (!is_last(arm, step)) {
            add_bodies(&behind[joint_at(arm, step)], &behind[joint_at(arm, step + 1)]);
        }
        write_row(arm, step, &of, by);
        write_column(arm, step, &of, by);
    }
}

/* Derivatives of the torques by q, qdot and qddot, (K, n, n) each. */
void brachis_torque_derivatives(
    const chain *arm, long count, const double *q, const double *qdot, const double *qddot, double *tau_q,
    double *tau_qdot, double *M
)
{
    long size = arm->joints * arm->joints;
    const double *states[3] = {q, qdot, qddot};
    for (long k = 0; k < count; k += LANES) {
        pack numbers[3 * size];
        const torque_partials by = {numbers, numbers + size, numbers + 2 * size};
        differentiate(arm, count, k, states, &by);
        write_block(by.tau_q, tau_q, count, size, k);
        write_block(by.tau_qdot, tau_qdot, count, size, k);
        write_block(by.M, M, count, size, k);
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
        pack tau_q[n * n], tau_qdot[n * n], M[n * n];
        pack G[size], qdot_y[size], qddot_y[size], qddot_ydot[size], slopes[size];
        const torque_partials by = {tau_q, tau_qdot, M};
        differentiate(arm, count, k, states, &by);
        read_block(motion->gradient, count, size, k, G);
        read_block(motion->qdot_y, count, size, k, qdot_y);
        read_block(motion->qddot_y, count, size, k, qddot_y);
        read_block(motion->qddot_ydot, count, size, k, qddot_ydot);
        multiply(tau_q, n, G, n, n, width, SET, slopes);
        multiply(tau_qdot, n, qdot_y, n, n, width, ADD, slopes);
        multiply(M, n, qddot_y, n, n, width, ADD, slopes);
        write_block(slopes, motion->torque, count, size, k);
        multiply(tau_qdot, n, G, n, n, width, SET, slopes);
        multiply(M, n, qddot_ydot, n, n, width, ADD, slopes);
        write_block(slopes, motion->torque + count * size, count, size, k);
        multiply(M, n, G, n, n, width, SET, slopes);
        write_block(slopes, motion->torque + 2 * count * size, count, size, k);
    }
}

/* Mass matrices with rotors, (K, n, n), of K postures, (K, n). */
void brachis_mass_matrices(const chain *arm, long count, const double *q, double *matrices)
{
    long n = arm->joints;
    for (long k = 0; k < count; k += LANES) {
        twist S[n];
        bodies behind[n];
        displacement placed = at_zero();
        for (long step = 0; step < n; step++) {
            long i = joint_at(arm, step);
            if (step == arm->carriers) {
                placed = at_zero();
            }
            S[i] = move_axis(arm, i, gather(q, count, n, k, i), &placed);
            behind[i] = place_body(arm, i, &placed);
        }
        for (long step = n - 1; step >= 0; step--) {
            long i = joint_at(arm, step);
            if (!is_last(arm, step)) {
                add_bodies(&behind[i], &behind[joint_at(arm, step + 1)]);
            }
            wrench I_S = apply_inertia(&behind[i], S[i]);
            for (long before = 0; before <= step; before++) {
                long j = joint_at(arm, before);
                pack M_ij = before < first_step(arm, step) ? all(0.0) : pair(S[j], I_S);
                M_ij += j == i ? arm->friction[4 * i] : 0.0;
                scatter(M_ij, matrices, count, n * n, k, i * n + j);
                scatter(M_ij, matrices, count, n * n, k, j * n + i);
            }
        }
    }
}
