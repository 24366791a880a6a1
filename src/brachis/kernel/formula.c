/* Formulas: straight sequences of steps, each of one or two numbers, at many points. See formula.py. */
#include <math.h>
#include <stdlib.h>

#include "motion.h"

enum { SIDE_BY_SIDE = 16 };
enum { PLUS, MINUS, TIMES, OVER, NEGATE, SQRT, SIN, COS, ARCCOS, ARCTAN2, CEIL };

#define FOR_EACH(formula)                               \
    for (int lane = 0; lane < SIDE_BY_SIDE; lane++) {   \
        c[lane] = formula;                              \
    }                                                   \
    break

/* Evaluate at K points: the arguments of successive ones are `first_step` and `second_step` apart. Found
are (K, outputs), NaN without memory. */
void brachis_formula(
    const formula *own, long count, const double *first, long first_step, const double *second, long second_step,
    double *found
)
{
    long inputs = own->counts[0] + own->counts[1];
    long outputs = own->outputs;
    const step *step_of = own->step_of;
    double (*numbers)[SIDE_BY_SIDE] = malloc((inputs + own->constants + own->steps) * sizeof *numbers);
    for (long i = 0; !numbers && i < count * outputs; i++) {
        found[i] = NAN;
    }
    if (!numbers) {
        return;
    }
    for (long i = 0; i < own->constants; i++) {
        for (int lane = 0; lane < SIDE_BY_SIDE; lane++) {
            numbers[inputs + i][lane] = own->constant[i];
        }
    }
    for (long k = 0; k < count; k += SIDE_BY_SIDE) {
        for (int lane = 0; lane < SIDE_BY_SIDE; lane++) {
            long at = k + lane < count ? k + lane : count - 1;
            for (long i = 0; i < inputs; i++) {
                long other = i - own->counts[0];
                numbers[i][lane] = other < 0 ? first[at * first_step + i] : second[at * second_step + other];
            }
        }
        for (long i = 0; i < own->steps; i++) {
            const double *a = numbers[step_of[i].first];
            const double *b = numbers[step_of[i].second];
            double *c = numbers[inputs + own->constants + i];
            switch (step_of[i].operation) {
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
        for (int lane = 0; lane < SIDE_BY_SIDE && k + lane < count; lane++) {
            for (long i = 0; i < outputs; i++) {
                found[(k + lane) * outputs + i] = numbers[own->wanted[i]][lane];
            }
        }
    }
    free(numbers);
    long together = own->together;
    for (long i = 0; together && i < count * outputs; i += together) {
        int complete = all_finite(found + i, together);
        for (long j = i; j < i + together && !complete; j++) {
            found[j] = NAN;
        }
    }
}
