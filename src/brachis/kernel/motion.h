/* What is computed at K points of a motion, from the curves to the entries of the Jacobian; Python holds the same structures. */

#ifndef BRACHIS_MOTION_H
#define BRACHIS_MOTION_H

#include "tool.h"

/* Motion along a path; see path_motion.py. m rows of the tool are prescribed, r conditions are linear in the joints, and
J_aug has the m rows of the task Jacobian, then those of the conditions. Curves are c = 1 + r. */
typedef struct {
    const chain *arm;
    const prescribed *asked;
    long count;                        /* K */
    long rows_step;                    /* from the rows of one point to those of the next, in doubles; 0 if all points share them */
    const double *q;                   /* (K, n) */
    const double *xi, *xi_ds, *xi_dds; /* (K, m): motion of the tool per unit of the path coordinate s */
    const double *rows;                /* (r, n): of the conditions, at every point */
    const double *ydot, *yddot;        /* (K, c) */
    const double *turning;             /* (2, K, r, n): first and second derivative of the rows by s; null where none */
    const double *drift;               /* (3, K, r): e, e' and e''; null likewise */

    /* Found by brachis_path_motion: columns of the tool's Jacobian, inverse and determinant of J_aug, dq/dy, qdot, qddot. */
    double *twists;       /* (6, K, n) */
    double *inverses;     /* (K, n, n) */
    double *determinants; /* (K) */
    double *gradients;    /* (K, n, c) */
    double *qdot, *qddot; /* (K, n) */

    /* Found by brachis_path_derivatives, (K, n, c), once. */
    double *qdot_y, *qddot_y, *qddot_ydot;
    long is_differentiated;
} path_motion;

/* Derivatives of the joint motion by the curves, (K, n, width) each; see kinematics/joint_map.py. That of the jerk counts only
where a value depends on it, and those of the torques by y, ydot and yddot, (3, K, n, width), where one depends on them. */
typedef struct {
    const double *gradient, *qdot_y, *qddot_y, *qddot_ydot, *qdddot_y;
    double *torque;
} motion_slopes;

void brachis_path_derivatives(path_motion *own);

void brachis_torque_slopes(
    const chain *arm, long count, long width, const double **states, const motion_slopes *motion
);

#endif
