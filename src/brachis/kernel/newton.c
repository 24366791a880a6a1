/* Newton's method for postures that meet a target, with linear conditions on the joints that make them unique. */

#include <math.h>

#include "motion.h"

static const double TURN = 6.283185307179586;
/* A miss, m or rad, after which one more step meets the target to rounding: Newton's method squares it. */
static const double TOLERANCE = 1e-10;

/* Solve a linear system, (n, n) row by row with `right` behind each row, by elimination with pivots. */
static void eliminate(long n, double *system, double *answer)
{
    long width = n + 1;
    for (long column = 0; column < n; column++) {
        long pivot = column;
        for (long row = column + 1; row < n; row++) {
            if (fabs(system[row * width + column]) > fabs(system[pivot * width + column])) {
                pivot = row;
            }
        }
        for (long i = column; i < width && pivot != column; i++) {
            double kept = system[column * width + i];
            system[column * width + i] = system[pivot * width + i];
            system[pivot * width + i] = kept;
        }
        double inverse = 1.0 / system[column * width + column];
        for (long row = column + 1; row < n; row++) {
            double factor = system[row * width + column] * inverse;
            for (long i = column + 1; i < width; i++) {
                system[row * width + i] -= factor * system[column * width + i];
            }
        }
    }
    for (long row = n - 1; row >= 0; row--) {
        double left = system[row * width + n];
        for (long i = row + 1; i < n; i++) {
            left -= system[row * width + i] * answer[i];
        }
        answer[row] = left / system[row * width + row];
    }
}

/* First rows of the system of one lane: task Jacobian with what is missed. Returns how many they are. */
static long write_task(
    const prescribed *asked, const placement *tool, const twist *columns, long n, int lane, const double *target,
    double *system
)
{
    const double position[3] = {tool->position.x[lane], tool->position.y[lane], tool->position.z[lane]};
    double R[3][3]; /* columns */
    for (int j = 0; j < 3; j++) {
        R[j][0] = tool->rotation[j].x[lane];
        R[j][1] = tool->rotation[j].y[lane];
        R[j][2] = tool->rotation[j].z[lane];
    }
    double miss[6] = {0};
    const selection chosen = select_parts(asked);
    long count = chosen.count;
    double *turned = miss + asked->rows;
    for (long i = 0; i < asked->rows; i++) {
        miss[i] = target[i] - position[asked->axes[i]];
    }
    if (asked->turns == 1) {
        const double *axis = R[asked->tool_axis];
        double off = target[count - 1] - atan2(asked->sign * axis[asked->second], axis[asked->first]);
        *turned = off - TURN * floor(off / TURN + 0.5);
    } else if (asked->turns) {
        const double *wanted = target + asked->rows;
        double to[9];
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                to[3 * i + j] = R[i][0] * wanted[j] + R[i][1] * wanted[3 + j] + R[i][2] * wanted[6 + j];
            }
        }
        logarithm(to, turned);
        double shift[3] = {miss[0], miss[1], miss[2]};
        double vector[3] = {turned[0], turned[1], turned[2]};
        for (int i = 0; i < 3; i++) {
            if (asked->in_tool_axes) {
                miss[i] = R[i][0] * shift[0] + R[i][1] * shift[1] + R[i][2] * shift[2];
            } else {
                turned[i] = R[0][i] * vector[0] + R[1][i] * vector[1] + R[2][i] * vector[2];
            }
        }
    }
    for (long row = 0; row < count; row++) {
        double *own = system + row * (n + 1);
        for (long i = 0; i < n; i++) {
            own[i] = chosen_part(&columns[i], &chosen, row)[lane];
        }
        own[n] = miss[row];
    }
    return count;
}

static double largest_of(const double *values, long count)
{
    double largest = 0.0;
    for (long i = 0; i < count; i++) {
        if (isnan(values[i])) {
            return values[i];
        }
        largest = fmax(largest, fabs(values[i]));
    }
    return largest;
}

/* Find postures, (K, n), that meet targets, (K, c), and C q = levels, from `starts`, (K, n); NaN where the method does not
converge. They may be found where `starts` are. From one row of C to the next it is `row_width`, from the rows of one point to
those of the next `rows_step`, 0 if all points share them. The linear model says little about postures farther away than 0.5 rad
or m. `beside` takes fewer and shorter steps, and gives a posture up whose steps do not halve; tolerance and largest step are then
in proportion to its size where that is above 1. */
void brachis_newton(
    const chain *arm, const prescribed *asked, long count, long coordinates, const double *targets,
    const double *starts, long conditions, const double *rows, long rows_step, long row_width, const double *levels,
    int beside, double *found
)
{
    long n = arm->joints;
    long steps = beside ? 8 : 15;
    double largest_step = beside ? 0.2 : 0.5;
    for (long k = 0; k < count; k += LANES) {
        double q[LANES][n];
        double scales[LANES], longest[LANES];
        int open[LANES];
        int left = 0;
        for (int lane = 0; lane < LANES; lane++) {
            long own = k + lane < count ? k + lane : count - 1;
            const double *level = levels + own * conditions;
            open[lane] = k + lane < count && all_finite(starts + own * n, n) && all_finite(level, conditions);
            left += open[lane];
            for (long i = 0; i < n; i++) {
                q[lane][i] = open[lane] ? starts[own * n + i] : 0.0;
                if (k + lane < count) {
                    found[own * n + i] = NAN;
                }
            }
            scales[lane] = beside ? 1.0 + largest_of(q[lane], n) : 1.0;
            longest[lane] = largest_step * scales[lane];
        }
        for (long number = 0; number < steps && left; number++) {
            pack posture[n];
            twist columns[n];
            for (long i = 0; i < n; i++) {
                posture[i] = (pack){q[0][i], q[1][i], q[2][i], q[3][i]};
            }
            placement tool = place_tool(arm, posture, asked->in_tool_axes != 0, columns);
            for (int lane = 0; lane < LANES; lane++) {
                if (!open[lane]) {
                    continue;
                }
                long own = k + lane;
                double system[n * (n + 1)];
                double step[n], misses[n];
                long width = n + 1;
                long m = write_task(asked, &tool, columns, n, lane, targets + own * coordinates, system);
                for (long j = 0; j < conditions; j++) {
                    const double *row = rows + own * rows_step + j * row_width;
                    double aside = levels[own * conditions + j];
                    for (long i = 0; i < n; i++) {
                        system[(m + j) * width + i] = row[i];
                        aside -= row[i] * q[lane][i];
                    }
                    system[(m + j) * width + n] = aside;
                }
                for (long i = 0; i < n; i++) {
                    misses[i] = system[i * width + n];
                }
                int met = largest_of(misses, n) < TOLERANCE * scales[lane];
                eliminate(n, system, step);
                double size = largest_of(step, n);
                double factor = size > longest[lane] ? longest[lane] / size : 1.0;
                for (long i = 0; i < n; i++) {
                    q[lane][i] += factor * step[i];
                }
                int good = all_finite(q[lane], n) && (!beside || size < longest[lane]);
                longest[lane] = beside ? 0.5 * size : longest[lane];
                for (long i = 0; i < n && met && good; i++) {
                    found[own * n + i] = q[lane][i];
                }
                if (met || !good) {
                    open[lane] = 0;
                    left--;
                    for (long i = 0; i < n; i++) {
                        q[lane][i] = 0.0;
                    }
                }
            }
        }
    }
}
