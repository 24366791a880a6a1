/* What is computed at K points of a motion, from the curves to the entries of the Jacobian; Python holds the same structures. */

#ifndef BRACHIS_MOTION_H
#define BRACHIS_MOTION_H

#include "tool.h"

/* A formula of one or two arguments, with `input_counts` numbers each; see formula.py. Numbers are the inputs, then the
constants, then what each step gives; `outputs` are indices of those that the formula returns. They come in rows of `row_length`: a
row with a number that is not finite becomes NaN throughout; 0 turns this off. */
typedef struct {
    int operation, first, second;
} step;

typedef struct {
    long input_counts[2];
    long constant_count;
    const double *constants;
    long step_count;
    const step *steps;
    long output_count;
    const int *outputs;
    long row_length;
} formula;

/* A branch of a closed form; see postures.py. m joints follow from the target and the r redundant ones. */
typedef struct {
    const formula *answers_of; /* of target and redundant joints; null where the answers are given */
    long alternatives;         /* A answers of a branch, of which continuity chooses one */
    const long *redundant;     /* (r) */
    const long *nonredundant;  /* (m) */
    const double *turns;       /* (n): 1 for a joint whose turns are counted */
    const double *ranged;      /* (n): 1 for one that has a finite range: its turns must be certain */
    const double *start;       /* (n): the first posture is in the turns nearest to this one */
} branch;

/* Motion along a path; see path_motion.py. m rows of the tool are prescribed, r conditions C(s) q - p(s) are linear in the
joints, and J_aug has the m rows of the task Jacobian, then C. Curves are c = 1 + r. */
typedef struct {
    const chain *arm;
    const prescribed *task;
    const branch *branch;              /* null in a chart, or where q is given */
    long count;                        /* K */
    long rows_step;                    /* from the rows of one point to those of the next, in doubles; 0 if all points share them */
    double side;                       /* sign that det J_aug must have; 0: either */
    const double *y, *ydot, *yddot;    /* (K, c) */
    const double *targets;             /* (K, coordinates) */
    const double *xi, *xi_ds, *xi_dds; /* (K, m): motion of the tool per unit of the path coordinate s */
    const double *rows;                /* (r, n + 1): C and p, at every point */
    const double *row_derivatives;     /* (3, K, r, n + 1): derivatives of C and p by s; null where they vanish */
    const double *reference;           /* (K, n + r + n r): of a chart, see postures.c; null without one */
    const double *t;                   /* (K): times, by which turns are counted; null: turns are the nearest ones */
    const double *near;                /* (K, n): postures known to be near, which decide about turns; null without them */

    /* Found by brachis_postures. */
    double *answers; /* (K, A, m); given where no formula finds them */
    double *levels;  /* (K, r) */
    double *q;       /* (K, n) */

    /* Found by brachis_path_motion: e = C' q - p' and two derivatives of it; columns of the tool's Jacobian, inverse and
    determinant of J_aug, dq/dy, qdot, qddot. */
    double *drift;        /* (3, K, r) */
    double *twists;       /* (6, K, n) */
    double *inverses;     /* (K, n, n) */
    double *determinants; /* (K) */
    double *gradients;    /* (K, n, c) */
    double *qdot, *qddot; /* (K, n) */

    /* Found by brachis_path_derivatives, (K, n, c). */
    double *qdot_y, *qddot_y, *qddot_ydot;
} path_motion;

/* Derivatives of the joint motion by the curves, (K, n, width) each; see kinematics/joint_map.py. That of the jerk counts only
where a value depends on it, and those of the torques by y, ydot and yddot, (3, K, n, width), where one depends on them. */
typedef struct {
    const double *gradient, *qdot_y, *qddot_y, *qddot_ydot, *qdddot_y;
    double *torque;
} motion_slopes;

/* Partial derivatives, (K, values, n), of values by the joints' positions, or rates, ...; null where they vanish. `step` is 0
where they are the same at all points, else values * n. */
typedef struct {
    double *numbers;
    long step;
} partial;

enum { TORQUE = 4, FORMULA };

/* A group of values. Either each value is (quantity of one joint - offset) * factor, with `quantity` 0 to 3 for q and its
derivatives and TORQUE for the torque. Or it is a number of a FORMULA of the posture times a factor; its slopes by q go to
`by[0]`. Or `quantity` is -1, and partial derivatives by q, qdot, qddot and qdddot, and by s, (K, values), are given; a null
pointer stands for zeros. */
typedef struct {
    long values;
    long quantity;
    const long *joints;              /* (values) */
    const double *offsets, *factors; /* (values) */
    const formula *values_of, *slopes_of;
    partial by[4];
    const double *by_s;
} value_group;

/* Postures that Newton's method looks for; see newton.c. They meet targets, and the linear conditions C q = levels. */
typedef struct {
    const chain *arm;
    const prescribed *task;
    long count, coordinates; /* K */
    const double *targets;   /* (K, coordinates) */
    const double *starts;    /* (K, n) */
    long conditions;         /* r */
    const double *rows;      /* C */
    long rows_step;          /* from the rows of one point to those of the next, in doubles; 0 if all points share them */
    long row_width;          /* from one row of C to the next */
    const double *levels;    /* (K, r) */
    long beside;             /* 1: the starts are near; see newton.c */
} posture_search;

/* What the functions of one file ask of another's. */
void brachis_torques(
    const chain *arm, long count, const double *q, const double *qdot, const double *qddot, double *torques
);
void brachis_torque_slopes(
    const chain *arm, long count, long width, const double **states, const motion_slopes *motion
);
void brachis_formula(
    const formula *formula, long count, const double *first, long first_step, const double *second, long second_step,
    double *results
);
void brachis_newton(const posture_search *search, double *postures);
void brachis_path_motion(path_motion *motion);

#endif
