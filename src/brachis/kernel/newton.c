/* Newton's method for postures that meet a target, with linear conditions on the joints that make them unique. */

#include <math.h>

#include "motion.h"

static const double TURN = 6.283185307179586;
/* A miss, m or rad, after which one more step meets the target to rounding: Newton's method squares it. */
static const double TOLERANCE = 1e-10;

/* Solve a linear system, (n, n) row by row with the right-hand side behind each row, by elimination with pivots. */
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
            double entry = system[column * width + i];
            system[column * width + i] = system[pivot * width + i];
            system[pivot * width + i] = entry;
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
        double right = system[row * width + n];
        for (long i = row + 1; i < n; i++) {
            right -= system[row * width + i] * answer[i];
        }
        answer[row] = right / system[row * width + row];
    }
}

/* What one lane's tool misses of its target, (m): position rows, then an angle or a rotation vector. */
static void find_error(const prescribed *task, const placement *tool, int lane, const double *target, double *error)
{
    const double position[3] = {tool->position.x[lane], tool->position.y[lane], tool->position.z[lane]};
    double R[3][3]; /* columns */
    for (int j = 0; j < 3; j++) {
        R[j][0] = tool->rotation[j].x[lane];
        R[j][1] = tool->rotation[j].y[lane];
        R[j][2] = tool->rotation[j].z[lane];
    }
    double *angles = error + task->rows;
    for (long i = 0; i < task->rows; i++) {
        error[i] = target[i] - position[task->axes[i]];
    }
    if (task->turns == 1) {
        const double *axis = R[task->tool_axis];
        double off = target[task->rows] - atan2(task->sign * axis[task->second], axis[task->first]);
        *angles = off - TURN * floor(off / TURN + 0.5);
    } else if (task->turns) {
        const double *R_target = target + task->rows;
        double relative[9]; /* R^T R_target */
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                relative[3 * i + j] = R[i][0] * R_target[j] + R[i][1] * R_target[3 + j] + R[i][2] * R_target[6 + j];
            }
        }
        logarithm(relative, angles);
        double shift[3] = {error[0], error[1], error[2]};
        double vector[3] = {angles[0], angles[1], angles[2]};
        for (int i = 0; i < 3; i++) {
            if (task->in_tool_axes) {
                error[i] = R[i][0] * shift[0] + R[i][1] * shift[1] + R[i][2] * shift[2];
            } else {
                angles[i] = R[0][i] * vector[0] + R[1][i] * vector[1] + R[2][i] * vector[2];
            }
        }
    }
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

/* The search in one lane, for the posture of one point. */
typedef struct {
    int number;
    long point;
    double *q;    /* (n) */
    double scale; /* of tolerance and steps */
    double longest_step;
    int is_open;
} lane_search;

/* Begin at the start of a point. Lanes beyond the last point are closed. */
static lane_search begin_lane(const posture_search *search, long k, int number, double *q, double *postures)
{
    long n = search->arm->joints;
    int exists = k + number < search->count;
    long point = exists ? k + number : search->count - 1;
    const double *start = search->starts + point * n;
    const double *levels = search->levels + point * search->conditions;
    int is_open = exists && all_finite(start, n) && all_finite(levels, search->conditions);
    for (long i = 0; i < n; i++) {
        q[i] = is_open ? start[i] : 0.0;
        if (exists) {
            postures[point * n + i] = NAN;
        }
    }
    double scale = search->beside ? 1.0 + largest_of(q, n) : 1.0;
    return (lane_search){number, point, q, scale, (search->beside ? 0.2 : 0.5) * scale, is_open};
}

/* The linear system of a step: task Jacobian and C, and behind each row what is missed. */
static void write_system(
    const posture_search *search, const placement *tool, const twist *columns, const lane_search *lane, double *system
)
{
    long n = search->arm->joints;
    long width = n + 1;
    const selection chosen = select_parts(search->task);
    double error[6] = {0};
    find_error(search->task, tool, lane->number, search->targets + lane->point * search->coordinates, error);
    for (long row = 0; row < chosen.count; row++) {
        for (long i = 0; i < n; i++) {
            system[row * width + i] = chosen_part(&columns[i], &chosen, row)[lane->number];
        }
        system[row * width + n] = error[row];
    }
    for (long j = 0; j < search->conditions; j++) {
        const double *C_j = search->rows + lane->point * search->rows_step + j * search->row_width;
        double *row = system + (chosen.count + j) * width;
        double gap = search->levels[lane->point * search->conditions + j];
        for (long i = 0; i < n; i++) {
            row[i] = C_j[i];
            gap -= C_j[i] * lane->q[i];
        }
        row[n] = gap;
    }
}

/* Take a step in one lane. The search there ends with a posture, or without one if the method does not converge. */
static void take_step(
    const posture_search *search, const placement *tool, const twist *columns, lane_search *lane, double *postures
)
{
    long n = search->arm->joints;
    double *q = lane->q;
    double system[n * (n + 1)], step[n], misses[n];
    write_system(search, tool, columns, lane, system);
    for (long i = 0; i < n; i++) {
        misses[i] = system[i * (n + 1) + n];
    }
    int is_met = largest_of(misses, n) < TOLERANCE * lane->scale;
    eliminate(n, system, step);
    double size = largest_of(step, n);
    double factor = size > lane->longest_step ? lane->longest_step / size : 1.0;
    for (long i = 0; i < n; i++) {
        q[i] += factor * step[i];
    }
    int converges = all_finite(q, n) && (!search->beside || size < lane->longest_step);
    lane->longest_step = search->beside ? 0.5 * size : lane->longest_step;
    lane->is_open = converges && !is_met;
    for (long i = 0; i < n && !lane->is_open; i++) {
        if (converges) {
            postures[lane->point * n + i] = q[i];
        }
        q[i] = 0.0;
    }
}

/* Find postures, (K, n); NaN where the method does not converge. They may be found where the starts are. The linear model says
little about postures farther away than 0.5 rad or m. `beside` takes fewer and shorter steps, and gives a posture up whose steps do
not halve; tolerance and largest step are then in proportion to its size where that is above 1. */
void brachis_newton(const posture_search *search, double *postures)
{
    long n = search->arm->joints;
    long steps = search->beside ? 8 : 15;
    for (long k = 0; k < search->count; k += LANES) {
        double q[LANES][n];
        lane_search lanes[LANES];
        int open = 0;
        for (int lane = 0; lane < LANES; lane++) {
            lanes[lane] = begin_lane(search, k, lane, q[lane], postures);
            open += lanes[lane].is_open;
        }
        for (long number = 0; number < steps && open; number++) {
            pack posture[n];
            twist columns[n];
            for (long i = 0; i < n; i++) {
                posture[i] = (pack){q[0][i], q[1][i], q[2][i], q[3][i]};
            }
            placement tool = place_tool(search->arm, posture, search->task->in_tool_axes != 0, columns);
            open = 0;
            for (int lane = 0; lane < LANES; lane++) {
                if (lanes[lane].is_open) {
                    take_step(search, &tool, columns, &lanes[lane], postures);
                }
                open += lanes[lane].is_open;
            }
        }
    }
}
