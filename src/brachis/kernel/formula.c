/* Formulas: straight sequences of steps, each of one or two numbers, at many points. See formula.py. */
#include <math.h>
#include <stdlib.h>

#include "motion.h"

enum { SIDE_BY_SIDE = 16 };
enum { PLUS, MINUS, TIMES, OVER, NEGATE, SQRT, SIN, COS, ARCCOS, ARCTAN2, CEIL };

typedef double numbers[SIDE_BY_SIDE];

#define FOR_EACH(formula)                               \
    for (int lane = 0; lane < SIDE_BY_SIDE; lane++) {   \
        c[lane] = formula;                              \
    }                                                   \
    break

/* Take a step: c = a + b, or another operation of the numbers a and b of each point. */
static inline void take_step(int operation, const double *a, const double *b, double *c)
{
    switch (operation) {
    case PLUS: FOR_EACH(a[lane] + b[lane]);
    case MINUS: FOR_EACH(a[lane] - b[lane]);
    case TIMES: FOR_EACH(a[lane] * b[lane]);
    case OVER: FOR_EACH(a[lane] / b[lane]);
    case NEGATE: FOR_EACH(-a[lane]);
    case SQRT: FOR_EACH(sqrt(a[lane]));
    case SIN: FOR_EACH(sin(a[lane]));
    case COS: FOR_EACH(cos(a[lane]));
    case ARCCOS: FOR_EACH(acos(a[lane]));
    case ARCTAN2: FOR_EACH(atan2(a[lane], b[lane]));
    case CEIL: FOR_EACH(ceil(a[lane]));
    }
}

static void set_constants(const formula *formula, numbers *constants)
{
    for (long i = 0; i < formula->constant_count; i++) {
        for (int lane = 0; lane < SIDE_BY_SIDE; lane++) {
            constants[i][lane] = formula->constants[i];
        }
    }
}

/* Make rows of results NaN that are not complete. */
static void discard_incomplete(const formula *formula, long count, double *results)
{
    long length = formula->row_length;
    for (long i = 0; length && i < count * formula->output_count; i += length) {
        int complete = all_finite(results + i, length);
        for (long j = i; j < i + length && !complete; j++) {
            results[j] = NAN;
        }
    }
}

/* Evaluate at K points: the arguments of successive ones are `first_step` and `second_step` apart. Results are (K, outputs), NaN
without memory. */
void brachis_formula(
    const formula *formula, long count, const double *first, long first_step, const double *second, long second_step,
    double *results
)
{
    long first_count = formula->input_counts[0];
    long inputs = first_count + formula->input_counts[1];
    long outputs = formula->output_count;
    long begin = inputs + formula->constant_count;
    numbers *table = malloc((begin + formula->step_count) * sizeof *table);
    for (long i = 0; !table && i < count * outputs; i++) {
        results[i] = NAN;
    }
    if (!table) {
        return;
    }
    set_constants(formula, table + inputs);
    for (long k = 0; k < count; k += SIDE_BY_SIDE) {
        for (int lane = 0; lane < SIDE_BY_SIDE; lane++) {
            long point = k + lane < count ? k + lane : count - 1;
            for (long i = 0; i < inputs; i++) {
                long at = i - first_count;
                table[i][lane] = at < 0 ? first[point * first_step + i] : second[point * second_step + at];
            }
        }
        for (long i = 0; i < formula->step_count; i++) {
            const step *step = &formula->steps[i];
            take_step(step->operation, table[step->first], table[step->second], table[begin + i]);
        }
        for (int lane = 0; lane < SIDE_BY_SIDE && k + lane < count; lane++) {
            for (long i = 0; i < outputs; i++) {
                results[(k + lane) * outputs + i] = table[formula->outputs[i]][lane];
            }
        }
    }
    free(table);
    discard_incomplete(formula, count, results);
}
