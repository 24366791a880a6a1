/* Formulas: straight sequences of steps, each of one or two numbers, at many points. See formula.py. */
#include <math.h>

enum { SIDE_BY_SIDE = 16 };
typedef struct {
    int operation, first, second;
} step;
enum { ADD, SUBTRACT, MULTIPLY, DIVIDE, NEGATE, SQRT, SIN, COS, ARCCOS, ARCTAN2, CEIL };

#define FOR_EACH(formula)                               \
    for (int lane = 0; lane < SIDE_BY_SIDE; lane++) {   \
        c[lane] = formula;                              \
    }                                                   \
    break

/* Evaluate at K points, (K, inputs). Numbers are the inputs, then the constants, then what each step gives; those that
are wanted are found, (K, outputs). `numbers` has room for all of them. They come in groups of
`together`: a group with a number that is not finite becomes NaN throughout; 0 turns this off. */
void brachis_formula(
    long inputs, long constants, const double *constant, long steps, const step *step_of, long count,
    const double *points, long outputs, const int *wanted, long together, double (*numbers)[SIDE_BY_SIDE],
    double *found
)
{
    for (long i = 0; i < constants; i++) {
        for (int lane = 0; lane < SIDE_BY_SIDE; lane++) {
            numbers[inputs + i][lane] = constant[i];
        }
    }
    for (long k = 0; k < count; k += SIDE_BY_SIDE) {
        for (int lane = 0; lane < SIDE_BY_SIDE; lane++) {
            long own = k + lane < count ? k + lane : count - 1;
            for (long i = 0; i < inputs; i++) {
                numbers[i][lane] = points[own * inputs + i];
            }
        }
        for (long i = 0; i < steps; i++) {
            const double *a = numbers[step_of[i].first];
            const double *b = numbers[step_of[i].second];
            double *c = numbers[inputs + constants + i];
            switch (step_of[i].operation) {
            case ADD: FOR_EACH(a[lane] + b[lane]);
            case SUBTRACT: FOR_EACH(a[lane] - b[lane]);
            case MULTIPLY: FOR_EACH(a[lane] * b[lane]);
            case DIVIDE: FOR_EACH(a[lane] / b[lane]);
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
                found[(k + lane) * outputs + i] = numbers[wanted[i]][lane];
            }
        }
    }
    for (long i = 0; together && i < count * outputs; i += together) {
        double sum = 0.0; /* of zeros, or NaN */
        for (long j = i; j < i + together; j++) {
            sum += 0.0 * found[j];
        }
        for (long j = i; j < i + together && sum != 0.0; j++) {
            found[j] = NAN;
        }
    }
}

/* Points that are computed side by side. */
long brachis_side_by_side(void)
{
    return SIDE_BY_SIDE;
}
