/* Placement of the tool, the columns of its Jacobian, and their derivatives. */

#include "chain.h"

/* Turn a vector into the axes of the tool, whose rotation has these columns. */
static inline vec into_tool(const vec *rotation, vec a)
{
    return (vec){dot(rotation[0], a), dot(rotation[1], a), dot(rotation[2], a)};
}

/* Positions, (K, 3), and rotations, (K, 3, 3), of the tool at K postures, (K, n), and the columns of its Jacobian,
(6, K, n): linear, then angular velocity at the tool's origin, along the tool's axes or the world's. */
void brachis_tool(
    const chain *arm, long count, const double *q, int in_tool_axes, double *positions, double *rotations,
    double *twists
)
{
    long n = arm->joints;
    long size = count * n;
    for (long k = 0; k < count; k += LANES) {
        vec axes[n], points[n];
        displacement placed = at_zero();
        for (long i = 0; i < n; i++) {
            move_joint(arm, i, gather(q, count, n, k, i), &placed, &axes[i], &points[i]);
        }
        vec tool = move_point(&placed, arm->tool_position);
        vec rotation[3];
        for (int j = 0; j < 3; j++) {
            const double *R = arm->tool_rotation;
            rotation[j] = turn(&placed, (double[3]){R[j], R[3 + j], R[6 + j]});
            scatter(rotation[j].x, rotations, count, 9, k, j);
            scatter(rotation[j].y, rotations, count, 9, k, 3 + j);
            scatter(rotation[j].z, rotations, count, 9, k, 6 + j);
        }
        scatter(tool.x, positions, count, 3, k, 0);
        scatter(tool.y, positions, count, 3, k, 1);
        scatter(tool.z, positions, count, 3, k, 2);
        for (long i = 0; i < n; i++) {
            vec linear = axes[i];
            vec angular = constant((double[3]){0.0, 0.0, 0.0});
            if (arm->turns[i] != 0.0) {
                linear = cross(axes[i], subtract(tool, points[i]));
                angular = axes[i];
            }
            if (in_tool_axes) {
                linear = into_tool(rotation, linear);
                angular = into_tool(rotation, angular);
            }
            pack parts[6] = {linear.x, linear.y, linear.z, angular.x, angular.y, angular.z};
            for (int row = 0; row < 6; row++) {
                scatter(parts[row], twists + row * size, count, n, k, i);
            }
        }
    }
}
