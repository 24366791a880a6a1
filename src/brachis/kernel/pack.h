/* Numbers of several postures side by side, and vectors of them.

A pack holds one number of each of LANES postures. Compilers turn its arithmetic into vector instructions, or into plain
ones where the machine has none; the answers are the same to the last digit. */

#ifndef BRACHIS_PACK_H
#define BRACHIS_PACK_H

#include <math.h>

enum { LANES = 4 };
typedef double pack __attribute__((vector_size(8 * LANES)));

typedef struct {
    pack x, y, z;
} vec;

static inline pack all(double value)
{
    return (pack){value, value, value, value};
}

/* A function of one number for each lane. */
#define FOR_LANES(name, function) \
    static inline pack name(pack a) \
    { \
        return (pack){function(a[0]), function(a[1]), function(a[2]), function(a[3])}; \
    }
FOR_LANES(sines, sin)
FOR_LANES(cosines, cos)
FOR_LANES(tanhs, tanh)
FOR_LANES(roots, sqrt)

static inline vec constant(const double *a)
{
    return (vec){all(a[0]), all(a[1]), all(a[2])};
}

static inline vec add(vec a, vec b)
{
    return (vec){a.x + b.x, a.y + b.y, a.z + b.z};
}

static inline vec subtract(vec a, vec b)
{
    return (vec){a.x - b.x, a.y - b.y, a.z - b.z};
}

static inline vec scale(vec a, pack factor)
{
    return (vec){a.x * factor, a.y * factor, a.z * factor};
}

static inline pack dot(vec a, vec b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline vec cross(vec a, vec b)
{
    return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* One column of LANES rows of a table, (rows, columns), from `row` on; beyond its end the last row again. */
static inline pack gather(const double *table, long rows, long columns, long row, long column)
{
    pack values;
    for (int lane = 0; lane < LANES; lane++) {
        long nearest = row + lane < rows ? row + lane : rows - 1;
        values[lane] = table[nearest * columns + column];
    }
    return values;
}

/* Write a pack into one column of a table; lanes beyond its end are dropped. */
static inline void scatter(pack values, double *table, long rows, long columns, long row, long column)
{
    for (int lane = 0; lane < LANES && row + lane < rows; lane++) {
        table[(row + lane) * columns + column] = values[lane];
    }
}

/* A block of `count` numbers of LANES points of a table, (K, count). */
static inline void read_block(const double *table, long points, long count, long k, pack *block)
{
    for (long i = 0; i < count; i++) {
        block[i] = gather(table, points, count, k, i);
    }
}

static inline void write_block(const pack *block, double *table, long points, long count, long k)
{
    for (long i = 0; i < count; i++) {
        scatter(block[i], table, points, count, k, i);
    }
}

static inline pack inner_product(const pack *a, const pack *b, long count)
{
    pack sum = all(0.0);
    for (long i = 0; i < count; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

static inline int all_finite(const double *values, long count)
{
    for (long i = 0; i < count; i++) {
        if (!isfinite(values[i])) {
            return 0;
        }
    }
    return 1;
}

enum { SET, ADD, SUBTRACT };

/* c = A b, c += A b or c -= A b, for A (rows, inner) in rows of `width`, and b (inner, columns). */
static inline void multiply(
    const pack *A, long width, const pack *b, long rows, long inner, long columns, int how, pack *c
)
{
    for (long i = 0; i < rows; i++) {
        for (long j = 0; j < columns; j++) {
            pack sum = how == SET ? all(0.0) : c[i * columns + j];
            for (long l = 0; l < inner; l++) {
                pack term = A[i * width + l] * b[l * columns + j];
                sum = how == SUBTRACT ? sum - term : sum + term;
            }
            c[i * columns + j] = sum;
        }
    }
}

#endif
