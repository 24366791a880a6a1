/* Motion of all joints along a path, and its derivatives; the formulas stand in kinematics/path_map.py. */
#include <math.h>

#include "motion.h"

static inline void swap_lane(pack *a, pack *b, int lane)
{
    double number = (*a)[lane];
    (*a)[lane] = (*b)[lane];
    (*b)[lane] = number;
}

/* Invert matrices, (n, n), in place by elimination with pivots (Gauss, Jordan); returns their determinants, 0 or NaN where they
are singular. */
static pack invert(long n, pack *A)
{
    long swaps[n * LANES];
    pack determinants = all(1.0);
    for (long i = 0; i < n; i++) {
        for (int lane = 0; lane < LANES; lane++) {
            long pivot = i;
            double largest = fabs(A[i * n + i][lane]);
            for (long row = i + 1; row < n; row++) {
                double size = fabs(A[row * n + i][lane]);
                pivot = size > largest ? row : pivot;
                largest = size > largest ? size : largest;
            }
            swaps[i * LANES + lane] = pivot;
            if (pivot != i) {
                determinants[lane] = -determinants[lane];
                for (long j = 0; j < n; j++) {
                    swap_lane(&A[i * n + j], &A[pivot * n + j], lane);
                }
            }
        }
        determinants *= A[i * n + i];
        pack inverse = 1.0 / A[i * n + i];
        A[i * n + i] = all(1.0);
        for (long j = 0; j < n; j++) {
            A[i * n + j] *= inverse;
        }
        for (long row = 0; row < n; row++) {
            if (row == i) {
                continue;
            }
            pack factor = A[row * n + i];
            A[row * n + i] = all(0.0);
            for (long j = 0; j < n; j++) {
                A[row * n + j] -= factor * A[i * n + j];
            }
        }
    }
    for (long i = n - 1; i >= 0; i--) {
        for (int lane = 0; lane < LANES; lane++) {
            for (long row = 0; row < n && swaps[i * LANES + lane] != i; row++) {
                swap_lane(&A[row * n + i], &A[row * n + swaps[i * LANES + lane]], lane);
            }
        }
    }
    return determinants;
}

static void set_zero(pack *values, long count)
{
    for (long i = 0; i < count; i++) {
        values[i] = all(0.0);
    }
}

/* Rows and offsets of conditions, or derivatives of them, at LANES points of a table, (K, r, n + 1). */
static void read_rows(const double *table, long count, long r, long n, long k, pack *rows)
{
    for (long i = 0; i < r * n; i++) {
        rows[i] = gather(table, count, r * (n + 1), k, i + i / n);
    }
}

/* Sizes of a motion, and the parts of the tool's motion that are prescribed. */
typedef struct {
    long count, n, m, r, c;
    selection parts;
} sizes;

static inline sizes sizes_of(const path_motion *motion)
{
    long n = motion->arm->joints;
    const selection parts = select_parts(motion->task);
    long r = n - parts.count;
    return (sizes){motion->count, n, parts.count, r, 1 + r, parts};
}

/* e = C' q - p', e' = C'' q - p'', and so on */
static void write_drift(path_motion *motion, const sizes *of, long k, const pack *q)
{
    long r = of->r;
    long width = of->n + 1;
    for (long i = 0; i < 3 * r; i++) {
        const double *table = motion->row_derivatives + i / r * of->count * r * width;
        pack row[width];
        for (long j = 0; j < width; j++) {
            row[j] = gather(table, of->count, r * width, k, i % r * width + j);
        }
        pack drift = inner_product(row, q, of->n) - row[of->n];
        scatter(drift, motion->drift + i / r * of->count * r, of->count, r, k, i % r);
    }
}

/* Write the parts of a twist that are prescribed into column i of a matrix with n columns. */
static inline void write_parts(const twist *a, const selection *chosen, long n, long i, pack *matrix)
{
    for (long row = 0; row < chosen->count; row++) {
        matrix[row * n + i] = chosen_part(a, chosen, row);
    }
}

/* J_aug, (n, n), with these columns of the tool's Jacobian. */
static void read_augmented(const path_motion *motion, const sizes *of, long k, const twist *columns, pack *J_aug)
{
    long n = of->n;
    for (long i = 0; i < n; i++) {
        write_parts(&columns[i], &of->parts, n, i, J_aug);
    }
    pack *C = J_aug + of->m * n;
    for (long i = 0; i < of->r * n; i++) {
        long at = i + i / n;
        C[i] = motion->rows_step ? gather(motion->rows, of->count, motion->rows_step, k, at) : all(motion->rows[at]);
    }
}

/* G = J_aug^-1 [xi, 0; -e, 1] */
static void find_gradient(const path_motion *motion, const sizes *of, long k, const pack *inverse, pack *G)
{
    long n = of->n;
    pack right[n];
    read_block(motion->xi, of->count, of->m, k, right);
    for (long i = 0; i < of->r; i++) {
        right[of->m + i] = motion->row_derivatives ? -gather(motion->drift, of->count, of->r, k, i) : all(0.0);
    }
    for (long i = 0; i < n; i++) {
        G[i * of->c] = inner_product(inverse + i * n, right, n);
        for (long j = 0; j < of->r; j++) {
            G[i * of->c + 1 + j] = inverse[i * n + of->m + j];
        }
    }
}

/* (xi_ds sdot^2 - Jdot qdot; -2 C' qdot sdot - e' sdot^2) */
static void find_right(
    const path_motion *motion, const sizes *of, long k, const twist *columns, const pack *qdot, pack sdot, pack *right
)
{
    long n = of->n;
    twist bias = bias_of(n, columns, qdot, motion->task->in_tool_axes != 0);
    for (long row = 0; row < of->m; row++) {
        pack acceleration = gather(motion->xi_ds, of->count, of->m, k, row) * sdot * sdot;
        right[row] = acceleration - chosen_part(&bias, &of->parts, row);
    }
    if (!motion->row_derivatives) {
        set_zero(right + of->m, of->r);
        return;
    }
    pack C_s[of->r > 0 ? of->r * n : 1];
    read_rows(motion->row_derivatives, of->count, of->r, n, k, C_s);
    for (long i = 0; i < of->r; i++) {
        pack e_s = gather(motion->drift + of->count * of->r, of->count, of->r, k, i);
        right[of->m + i] = -sdot * (2.0 * inner_product(C_s + i * n, qdot, n) + e_s * sdot);
    }
}

/* The motion in postures q: qdot = G ydot, and qddot = G yddot + J_aug^-1 right. */
void brachis_path_motion(path_motion *motion)
{
    const sizes of = sizes_of(motion);
    long count = of.count;
    long n = of.n;
    long c = of.c;
    for (long k = 0; k < count; k += LANES) {
        twist columns[n];
        pack q[n], inverse[n * n], G[n * c], qdot[n], qddot[n], right[n], ydot[c], yddot[c];
        read_block(motion->q, count, n, k, q);
        read_block(motion->ydot, count, c, k, ydot);
        read_block(motion->yddot, count, c, k, yddot);
        place_tool(motion->arm, q, motion->task->in_tool_axes != 0, columns);
        for (long i = 0; i < n; i++) {
            write_twist(columns[i], motion->twists, count, n, k, i);
        }
        if (motion->row_derivatives) {
            write_drift(motion, &of, k, q);
        }
        read_augmented(motion, &of, k, columns, inverse);
        scatter(invert(n, inverse), motion->determinants, count, 1, k, 0);
        find_gradient(motion, &of, k, inverse, G);
        for (long i = 0; i < n; i++) {
            qdot[i] = inner_product(G + i * c, ydot, c);
        }
        find_right(motion, &of, k, columns, qdot, ydot[0], right);
        for (long i = 0; i < n; i++) {
            qddot[i] = inner_product(G + i * c, yddot, c) + inner_product(inverse + i * n, right, n);
        }
        write_block(inverse, motion->inverses, count, n * n, k);
        write_block(G, motion->gradients, count, n * c, k);
        write_block(qdot, motion->qdot, count, n, k);
        write_block(qddot, motion->qddot, count, n, k);
    }
}

/* What derivatives at LANES points are made of: `changing` conditions, 0 or r, change along the path. V_q, A_q and A_v, (m, n),
are derivatives of the tool's velocity and acceleration; C', C'', e' and e'' those of the conditions. */
typedef struct {
    long n, m, c, changing;
    const pack *G, *qdot, *qddot, *xi_ds, *xi_dds, *V_q, *A_q, *A_v, *C_s, *C_ss, *e_s, *e_ss;
    pack sdot, sddot;
} terms;

/* (-V_q G + [xi_ds sdot, 0];  -C' G sdot - [C' qdot + e' sdot, 0]) */
static void find_right_qdot_y(const terms *of, pack *right)
{
    long n = of->n;
    long m = of->m;
    long c = of->c;
    set_zero(right, m * c);
    for (long row = 0; row < m; row++) {
        right[row * c] = of->xi_ds[row] * of->sdot;
    }
    multiply(of->V_q, n, of->G, m, n, c, SUBTRACT, right);
    for (long i = 0; i < of->changing; i++) {
        for (long j = 0; j < c; j++) {
            pack sum = all(0.0);
            for (long l = 0; l < n; l++) {
                sum += of->C_s[i * n + l] * of->G[l * c + j];
            }
            right[(m + i) * c + j] = -sum * of->sdot;
        }
        right[(m + i) * c] -= inner_product(of->C_s + i * n, of->qdot, n) + of->e_s[i] * of->sdot;
    }
}

/* (-A_v G + [2 xi_ds sdot, 0];  twice the rows above, which are in their place) */
static void find_right_qddot_ydot(const terms *of, pack *right)
{
    long m = of->m;
    long c = of->c;
    set_zero(right, m * c);
    for (long row = 0; row < m; row++) {
        right[row * c] = 2.0 * of->xi_ds[row] * of->sdot;
    }
    multiply(of->A_v, of->n, of->G, m, of->n, c, SUBTRACT, right);
    for (long i = m * c; i < (m + of->changing) * c; i++) {
        right[i] *= 2.0;
    }
}

/* (-A_q G - A_v dqdot/dy + [xi_dds sdot^2 + xi_ds sddot, 0];
    -2 C' sdot dqdot/dy - (C'' sdot^2 + C' sddot) G - [C' qddot + 2 C'' qdot sdot + e'' sdot^2 + e' sddot, 0]) */
static void find_right_qddot_y(const terms *of, const pack *qdot_y, pack *right)
{
    long n = of->n;
    long m = of->m;
    long c = of->c;
    pack sdot = of->sdot;
    pack sddot = of->sddot;
    set_zero(right, m * c);
    for (long row = 0; row < m; row++) {
        right[row * c] = of->xi_dds[row] * sdot * sdot + of->xi_ds[row] * sddot;
    }
    multiply(of->A_q, n, of->G, m, n, c, SUBTRACT, right);
    multiply(of->A_v, n, qdot_y, m, n, c, SUBTRACT, right);
    for (long i = 0; i < of->changing; i++) {
        const pack *C_s = of->C_s + i * n;
        const pack *C_ss = of->C_ss + i * n;
        pack C_t[n], C_tt[n];
        for (long l = 0; l < n; l++) {
            C_t[l] = 2.0 * sdot * C_s[l];
            C_tt[l] = C_ss[l] * sdot * sdot + C_s[l] * sddot;
        }
        for (long j = 0; j < c; j++) {
            pack sum = all(0.0);
            for (long l = 0; l < n; l++) {
                sum += C_t[l] * qdot_y[l * c + j] + C_tt[l] * of->G[l * c + j];
            }
            right[(m + i) * c + j] = -sum;
        }
        pack by_s = inner_product(C_s, of->qddot, n) + 2.0 * sdot * inner_product(C_ss, of->qdot, n);
        right[(m + i) * c] -= by_s + of->e_ss[i] * sdot * sdot + of->e_s[i] * sddot;
    }
}

/* V_q, A_q and A_v of LANES points, (m, n) each. */
static void differentiate_task(
    const path_motion *motion, const sizes *of, long k, const pack *qdot, const pack *qddot, pack *V_q, pack *A_q, pack *A_v
)
{
    long n = of->n;
    twist columns[n], slopes[n], by_q[n], by_qdot[n];
    for (long i = 0; i < n; i++) {
        columns[i] = read_twist(motion->twists, of->count, n, k, i);
    }
    differentiate_tool(n, columns, qdot, qddot, motion->task->in_tool_axes != 0, slopes, by_q, by_qdot);
    for (long i = 0; i < n; i++) {
        write_parts(&slopes[i], &of->parts, n, i, V_q);
        write_parts(&by_q[i], &of->parts, n, i, A_q);
        write_parts(&by_qdot[i], &of->parts, n, i, A_v);
    }
}

/* Derivatives of qdot by y, and of qddot by y and by ydot, of what `brachis_path_motion` found. */
void brachis_path_derivatives(path_motion *motion)
{
    const sizes of = sizes_of(motion);
    long count = of.count;
    long n = of.n;
    long m = of.m;
    long r = of.r;
    long c = of.c;
    long changing = motion->row_derivatives ? r : 0;
    for (long k = 0; k < count; k += LANES) {
        pack inverse[n * n], G[n * c], qdot[n], qddot[n], right[n * c], V_q[n * n], A_q[n * n], A_v[n * n];
        pack xi_ds[n], xi_dds[n], C_s[n * n], C_ss[n * n], e_s[n], e_ss[n];
        pack qdot_y[n * c], qddot_ydot[n * c], qddot_y[n * c];
        read_block(motion->inverses, count, n * n, k, inverse);
        read_block(motion->gradients, count, n * c, k, G);
        read_block(motion->qdot, count, n, k, qdot);
        read_block(motion->qddot, count, n, k, qddot);
        read_block(motion->xi_ds, count, m, k, xi_ds);
        read_block(motion->xi_dds, count, m, k, xi_dds);
        differentiate_task(motion, &of, k, qdot, qddot, V_q, A_q, A_v);
        if (changing) {
            read_rows(motion->row_derivatives, count, r, n, k, C_s);
            read_rows(motion->row_derivatives + count * r * (n + 1), count, r, n, k, C_ss);
            read_block(motion->drift + count * r, count, r, k, e_s);
            read_block(motion->drift + 2 * count * r, count, r, k, e_ss);
        }
        pack sdot = gather(motion->ydot, count, c, k, 0);
        pack sddot = gather(motion->yddot, count, c, k, 0);
        const terms at = {n, m, c, changing, G, qdot, qddot, xi_ds, xi_dds, V_q, A_q, A_v, C_s, C_ss, e_s, e_ss, sdot, sddot};
        long rows = m + changing;
        find_right_qdot_y(&at, right);
        multiply(inverse, n, right, n, rows, c, SET, qdot_y);
        find_right_qddot_ydot(&at, right);
        multiply(inverse, n, right, n, rows, c, SET, qddot_ydot);
        find_right_qddot_y(&at, qdot_y, right);
        multiply(inverse, n, right, n, rows, c, SET, qddot_y);
        write_block(qdot_y, motion->qdot_y, count, n * c, k);
        write_block(qddot_ydot, motion->qddot_ydot, count, n * c, k);
        write_block(qddot_y, motion->qddot_y, count, n * c, k);
    }
}

/* M = A A^T, (n, n) */
static void multiply_by_transpose(long n, const pack *A, pack *M)
{
    for (long i = 0; i < n; i++) {
        for (long j = 0; j <= i; j++) {
            M[i * n + j] = inner_product(A + i * n, A + j * n, n);
            M[j * n + i] = M[i * n + j];
        }
    }
}

/* Least singular values, (K), of matrices with these inverses B, (K, n, n), and their right singular vectors v, (K, n): v is
the eigenvector of M = B B^T with the largest eigenvalue, 1 / value^2. Ten squarings give M^1024, which is v v^T up to a factor.
Where the two least values differ by less than 1 %, v is a mixture of both, and the value too large by less than 1e-5 of it. */
void brachis_least_singular(long count, long n, const double *inverses, double *values, double *vectors)
{
    for (long k = 0; k < count; k += LANES) {
        pack B[n * n], M[n * n], power[n * n], squared[n * n], v[n], image[n];
        read_block(inverses, count, n * n, k, B);
        multiply_by_transpose(n, B, M);
        for (long i = 0; i < n * n; i++) {
            power[i] = M[i];
        }
        for (int number = 0; number < 10; number++) {
            pack trace = all(0.0);
            for (long i = 0; i < n; i++) {
                trace += power[i * (n + 1)];
            }
            for (long i = 0; i < n * n; i++) {
                squared[i] = power[i] / trace;
            }
            multiply_by_transpose(n, squared, power);
        }
        for (int lane = 0; lane < LANES; lane++) {
            long largest = 0;
            for (long i = 1; i < n; i++) {
                largest = power[i * (n + 1)][lane] > power[largest * (n + 1)][lane] ? i : largest;
            }
            for (long i = 0; i < n; i++) {
                v[i][lane] = power[i * n + largest][lane];
            }
        }
        pack size = roots(inner_product(v, v, n));
        for (long i = 0; i < n; i++) {
            v[i] /= size;
        }
        for (long i = 0; i < n; i++) {
            image[i] = inner_product(M + i * n, v, n);
        }
        scatter(1.0 / roots(inner_product(v, image, n)), values, count, 1, k, 0);
        write_block(v, vectors, count, n, k);
    }
}

/* Slopes of the least singular values by the joints, (K, n), and by s, (K), where the matrices are J_aug of what
`brachis_path_motion` found: with the left singular vector u = value J_aug^-T v, a value changes by u^T dJ_aug v. */
void brachis_singular_slopes(
    const path_motion *motion, const double *values, const double *vectors, double *by_q, double *by_s
)
{
    const sizes of = sizes_of(motion);
    long count = of.count;
    long n = of.n;
    long m = of.m;
    for (long k = 0; k < count; k += LANES) {
        twist columns[n], slopes[n], unused_q[n], unused_qdot[n];
        pack inverse[n * n], v[n], still[n], u[n], slopes_q[n], C_s[n * n];
        read_block(motion->inverses, count, n * n, k, inverse);
        read_block(vectors, count, n, k, v);
        pack value = gather(values, count, 1, k, 0);
        for (long i = 0; i < n; i++) {
            columns[i] = read_twist(motion->twists, count, n, k, i);
        }
        set_zero(still, n);
        set_zero(u, n);
        set_zero(slopes_q, n);
        for (long i = 0; i < n; i++) {
            for (long j = 0; j < n; j++) {
                u[j] += value * inverse[i * n + j] * v[i];
            }
        }
        differentiate_tool(n, columns, v, still, motion->task->in_tool_axes != 0, slopes, unused_q, unused_qdot);
        for (long row = 0; row < m; row++) {
            for (long i = 0; i < n; i++) {
                slopes_q[i] += u[row] * chosen_part(&slopes[i], &of.parts, row);
            }
        }
        write_block(slopes_q, by_q, count, n, k);
        pack slope_s = all(0.0);
        if (motion->row_derivatives) {
            read_rows(motion->row_derivatives, count, of.r, n, k, C_s);
            for (long i = m; i < n; i++) {
                slope_s += u[i] * inner_product(C_s + (i - m) * n, v, n);
            }
        }
        scatter(slope_s, by_s, count, 1, k, 0);
    }
}
