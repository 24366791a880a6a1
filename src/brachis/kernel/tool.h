/* The tool of a chain: its placement, the columns of its Jacobian, and rotation vectors. */

#ifndef BRACHIS_TOOL_H
#define BRACHIS_TOOL_H

#include "chain.h"

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
    const double *found = table[largest];
    double sign = found[0] < 0.0 ? -1.0 : 1.0;
    double size = sqrt(found[1] * found[1] + found[2] * found[2] + found[3] * found[3]);
    double real = sign * found[0];
    /* The angle over the length of the quaternion's vector. */
    double factor = size > 1e-9 * real ? 2.0 * atan2(size, real) / size : 2.0 / real;
    for (int i = 0; i < 3; i++) {
        vector[i] = sign * factor * found[1 + i];
    }
}

#endif
