/* Motion of all joints along a path, and its derivatives; the formulas stand in kinematics/path_map.py. */
#include <math.h>

#include "motion.h"

static inline void swap_lane(pack *a, pack *b, int lane)
{
    double kept = (*a)[lane];
    (*a)[lane] = (*b)[lane];
    (*b)[lane] = kept;
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
            for (long row = i + 1; row < n; row++) {
                pivot = fabs(A[row * n + i][lane]) > fabs(A[pivot * n + i][lane]) ? row : pivot;
            }
            swaps[i * LANES + lane] = pivot;
            determinants[lane] *= pivot == i ? 1.0 : -1.0;
            for (long j = 0; j < n && pivot != i; j++) {
                swap_lane(&A[i * n + j], &A[pivot * n + j], lane);
            }
        }
        determinants *= A[i * n + i];
        pack inverse = 1.0 / A[i * n + i];
        A[i * n + i] = all(1.0);
        for (long j = 0; j < n; j++) {
            A[i * n + j] *= inverse;
        }
        for (long row = 0; row < n; row++) {
            pack factor = A[row * n + i];
            for (long j = 0; j < n && row != i; j++) {
                A[row * n + j] = (j == i ? all(0.0) : A[row * n + j]) - factor * A[i * n + j];
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

/* The motion in postures q. */
void brachis_path_motion(path_motion *own)
{
    const chain *arm = own->arm;
    const prescribed *asked = own->asked;
    long count = own->count;
    long n = arm->joints;
    const selection chosen = select_parts(asked);
    long m = chosen.count;
    long r = n - m;
    long c = 1 + r;
    for (long k = 0; k < count; k += LANES) {
        twist columns[n];
        pack posture[n], inverse[n * n], G[n * c], rate[n], more[n], right[n], ydot[c], yddot[c];
        read_block(own->q, count, n, k, posture);
        read_block(own->ydot, count, c, k, ydot);
        read_block(own->yddot, count, c, k, yddot);
        place_tool(arm, posture, asked->in_tool_axes != 0, columns);
        for (long i = 0; i < r * n; i++) {
            long at = i + i / n;
            inverse[m * n + i] = own->rows_step ? gather(own->rows, count, own->rows_step, k, at) : all(own->rows[at]);
        }
        /* e = C' q - p', e' = C'' q - p'', and so on */
        for (long i = 0; i < 3 * r && own->turning; i++) {
            const double *table = own->turning + i / r * count * r * (n + 1);
            pack row[n + 1];
            for (long j = 0; j <= n; j++) {
                row[j] = gather(table, count, r * (n + 1), k, i % r * (n + 1) + j);
            }
            pack drift = inner_product(row, posture, n) - row[n];
            scatter(drift, own->drift + i / r * count * r, count, r, k, i % r);
        }
        for (long i = 0; i < n; i++) {
            write_twist(columns[i], own->twists, count, n, k, i);
            for (long row = 0; row < m; row++) {
                inverse[row * n + i] = chosen_part(&columns[i], &chosen, row);
            }
        }
        scatter(invert(n, inverse), own->determinants, count, 1, k, 0);
        write_block(inverse, own->inverses, count, n * n, k);

        /* G = J_aug^-1 [xi, 0; -e, 1] */
        read_block(own->xi, count, m, k, right);
        for (long i = 0; i < r; i++) {
            right[m + i] = own->turning ? -gather(own->drift, count, r, k, i) : all(0.0);
        }
        for (long i = 0; i < n; i++) {
            G[i * c] = inner_product(inverse + i * n, right, n);
            for (long j = 0; j < r; j++) {
                G[i * c + 1 + j] = inverse[i * n + m + j];
            }
            rate[i] = inner_product(G + i * c, ydot, c);
        }

        /* qddot = G yddot + J_aug^-1 (xi_ds sdot^2 - Jdot qdot; -2 C' qdot sdot - e' sdot^2) */
        twist bias = bias_of(n, columns, rate, asked->in_tool_axes != 0);
        pack sdot = ydot[0];
        for (long row = 0; row < m; row++) {
            pack wanted = gather(own->xi_ds, count, m, k, row) * sdot * sdot;
            right[row] = wanted - chosen_part(&bias, &chosen, row);
        }
        pack C_s[r > 0 ? r * n : 1];
        if (own->turning) {
            read_rows(own->turning, count, r, n, k, C_s);
        }
        for (long i = 0; i < r; i++) {
            right[m + i] = all(0.0);
            if (own->turning) {
                pack drift = gather(own->drift + count * r, count, r, k, i);
                right[m + i] = -sdot * (2.0 * inner_product(C_s + i * n, rate, n) + drift * sdot);
            }
        }
        for (long i = 0; i < n; i++) {
            more[i] = inner_product(G + i * c, yddot, c) + inner_product(inverse + i * n, right, n);
        }
        write_block(G, own->gradients, count, n * c, k);
        write_block(rate, own->qdot, count, n, k);
        write_block(more, own->qddot, count, n, k);
    }
}

/* Derivatives of qdot by y, and of qddot by y and by ydot, of what `brachis_path_motion` found. */
void brachis_path_derivatives(path_motion *own)
{
    const prescribed *asked = own->asked;
    long count = own->count;
    long n = own->arm->joints;
    const selection chosen = select_parts(asked);
    long m = chosen.count;
    long r = n - m;
    long c = 1 + r;
    for (long k = 0; k < count; k += LANES) {
        twist columns[n], slopes[n], by_q[n], by_qdot[n];
        pack inverse[n * n], G[n * c], rate[n], more[n], right[n * c], V[n * n], A_q[n * n], A_v[n * n];
        pack first[n * c], second[n * c], third[n * c];
        read_block(own->inverses, count, n * n, k, inverse);
        read_block(own->gradients, count, n * c, k, G);
        read_block(own->qdot, count, n, k, rate);
        read_block(own->qddot, count, n, k, more);
        pack sdot = gather(own->ydot, count, c, k, 0);
        pack sddot = gather(own->yddot, count, c, k, 0);
        for (long i = 0; i < n; i++) {
            columns[i] = read_twist(own->twists, count, n, k, i);
        }
        differentiate_tool(n, columns, rate, more, asked->in_tool_axes != 0, slopes, by_q, by_qdot);
        for (long row = 0; row < m; row++) {
            for (long i = 0; i < n; i++) {
                V[row * n + i] = chosen_part(&slopes[i], &chosen, row);
                A_q[row * n + i] = chosen_part(&by_q[i], &chosen, row);
                A_v[row * n + i] = chosen_part(&by_qdot[i], &chosen, row);
            }
        }
        /* Derivatives of the conditions: C' and C'' in the rows below m. */
        pack *C_s = V + m * n;
        pack *C_ss = A_q + m * n;
        pack e_s[r > 0 ? r : 1], e_ss[r > 0 ? r : 1];
        if (own->turning) {
            read_rows(own->turning, count, r, n, k, C_s);
            read_rows(own->turning + count * r * (n + 1), count, r, n, k, C_ss);
            read_block(own->drift + count * r, count, r, k, e_s);
            read_block(own->drift + 2 * count * r, count, r, k, e_ss);
        }
        long rows = own->turning ? n : m;

        /* (-V_q G + [xi_ds sdot, 0];  -C' G sdot - [C' qdot + e' sdot, 0]) */
        set_zero(right, m * c);
        for (long row = 0; row < m; row++) {
            right[row * c] = gather(own->xi_ds, count, m, k, row) * sdot;
        }
        multiply(V, n, G, m, n, c, SUBTRACT, right);
        for (long i = 0; i < rows - m; i++) {
            for (long j = 0; j < c; j++) {
                pack sum = all(0.0);
                for (long l = 0; l < n; l++) {
                    sum += C_s[i * n + l] * G[l * c + j];
                }
                right[(m + i) * c + j] = -sum * sdot;
            }
            right[(m + i) * c] -= inner_product(C_s + i * n, rate, n) + e_s[i] * sdot;
        }
        multiply(inverse, n, right, n, rows, c, SET, first);

        /* (-A_v G + [2 xi_ds sdot, 0];  twice the rows above) */
        set_zero(right, m * c);
        for (long row = 0; row < m; row++) {
            right[row * c] = 2.0 * gather(own->xi_ds, count, m, k, row) * sdot;
        }
        multiply(A_v, n, G, m, n, c, SUBTRACT, right);
        for (long i = m * c; i < rows * c; i++) {
            right[i] *= 2.0;
        }
        multiply(inverse, n, right, n, rows, c, SET, second);

        /* (-A_q G - A_v dqdot/dy + [xi_dds sdot^2 + xi_ds sddot, 0];
            -2 C' sdot dqdot/dy - (C'' sdot^2 + C' sddot) G - [C' qddot + 2 C'' qdot sdot + e'' sdot^2 + e' sddot, 0]) */
        set_zero(right, m * c);
        for (long row = 0; row < m; row++) {
            pack bend = gather(own->xi_dds, count, m, k, row);
            right[row * c] = bend * sdot * sdot + gather(own->xi_ds, count, m, k, row) * sddot;
        }
        multiply(A_q, n, G, m, n, c, SUBTRACT, right);
        multiply(A_v, n, first, m, n, c, SUBTRACT, right);
        for (long i = 0; i < rows - m; i++) {
            for (long j = 0; j < c; j++) {
                pack sum = all(0.0);
                for (long l = 0; l < n; l++) {
                    pack turned = C_ss[i * n + l] * sdot * sdot + C_s[i * n + l] * sddot;
                    sum += 2.0 * sdot * C_s[i * n + l] * first[l * c + j] + turned * G[l * c + j];
                }
                right[(m + i) * c + j] = -sum;
            }
            pack turned = inner_product(C_s + i * n, more, n) + 2.0 * sdot * inner_product(C_ss + i * n, rate, n);
            right[(m + i) * c] -= turned + e_ss[i] * sdot * sdot + e_s[i] * sddot;
        }
        multiply(inverse, n, right, n, rows, c, SET, third);
        write_block(first, own->qdot_y, count, n * c, k);
        write_block(second, own->qddot_ydot, count, n * c, k);
        write_block(third, own->qddot_y, count, n * c, k);
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
    const path_motion *own, const double *values, const double *vectors, double *by_q, double *by_s
)
{
    const prescribed *asked = own->asked;
    long count = own->count;
    long n = own->arm->joints;
    const selection chosen = select_parts(asked);
    long m = chosen.count;
    for (long k = 0; k < count; k += LANES) {
        twist columns[n], slopes[n], unused_q[n], unused_qdot[n];
        pack inverse[n * n], v[n], still[n], u[n], found[n], turned[n * n];
        read_block(own->inverses, count, n * n, k, inverse);
        read_block(vectors, count, n, k, v);
        pack value = gather(values, count, 1, k, 0);
        for (long i = 0; i < n; i++) {
            columns[i] = read_twist(own->twists, count, n, k, i);
        }
        set_zero(still, n);
        set_zero(u, n);
        set_zero(found, n);
        for (long i = 0; i < n; i++) {
            for (long j = 0; j < n; j++) {
                u[j] += value * inverse[i * n + j] * v[i];
            }
        }
        differentiate_tool(n, columns, v, still, asked->in_tool_axes != 0, slopes, unused_q, unused_qdot);
        for (long row = 0; row < m; row++) {
            for (long i = 0; i < n; i++) {
                found[i] += u[row] * chosen_part(&slopes[i], &chosen, row);
            }
        }
        write_block(found, by_q, count, n, k);
        pack along_path = all(0.0);
        if (own->turning) {
            read_rows(own->turning, count, n - m, n, k, turned);
            for (long i = m; i < n; i++) {
                along_path += u[i] * inner_product(turned + (i - m) * n, v, n);
            }
        }
        scatter(along_path, by_s, count, 1, k, 0);
    }
}
