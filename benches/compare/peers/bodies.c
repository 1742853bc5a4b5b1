/* The C peer for bodies under Newton's law, in several forms of which the fastest counts. BODIES, DIM and BLOCK are constants of the
   compiler. The arrays are those of the workload, members last: v and y of BODIES x DIM x n numbers, masses BODIES x n, softening n.

   Leapfrog begins and ends with half a kick: steps + 1 evaluations. Vectors are asked for by type: left to itself, the compiler finds
   them in some of these loops and not in others. */

#include <math.h>
#include <string.h>
#ifdef RSQRT
#include <immintrin.h>
#endif

#if BLOCK == 1
#define WIDTH 1
typedef double lanes, loose;
#define SET(x, l, value) (x) = (value)
#define GET(x, l) (x)
#else
#define WIDTH 8
typedef double lanes __attribute__((vector_size(64)));
typedef double loose __attribute__((vector_size(64), aligned(8), may_alias)); /* anywhere in an array */
#define SET(x, l, value) (x)[l] = (value)
#define GET(x, l) (x)[l]
#endif
#define Q (BLOCK / WIDTH)
#define UNROLL _Pragma("GCC unroll 8")
#define INLINE static inline __attribute__((always_inline))

/* w/r^3 from r^2. With RSQRT from an approximation to 14 bits and two corrections by Newton. */
INLINE lanes cube(lanes w, lanes r2)
{
#ifdef RSQRT
    __m512d x = (__m512d)r2, u = _mm512_rsqrt14_pd(x), half = _mm512_mul_pd(_mm512_set1_pd(-0.5), x);
    UNROLL for (int k = 0; k < 2; k++)
        u = _mm512_mul_pd(u, _mm512_fmadd_pd(half, _mm512_mul_pd(u, u), _mm512_set1_pd(1.5)));
    return w * (lanes)u * (lanes)_mm512_mul_pd(u, u);
#else
    lanes root;
    UNROLL for (int l = 0; l < WIDTH; l++) SET(root, l, sqrt(GET(r2, l)));
    return w / (r2 * root);
#endif
}

#ifdef FEW

/* ---- a few bodies */

#ifdef PACKED

/* Three bodies of one member: pair p is body p and the one after it, and the three pairs are one vector. */
#define GROUP 1
#define ROWS DIM
typedef double state __attribute__((vector_size(32)));
typedef long long place __attribute__((vector_size(32)));
#define AFTER(x) __builtin_shuffle(x, (place){1, 2, 0, 3})
#define BEFORE(x) __builtin_shuffle(x, (place){2, 0, 1, 3})

INLINE void kick(double w, state *v, const state *y, const state *m, state e2)
{
    state d[DIM], r2 = e2, root;
    UNROLL for (int c = 0; c < DIM; c++) {
        d[c] = AFTER(y[c]) - y[c];
        r2 += d[c] * d[c];
    }
    for (int l = 0; l < 4; l++) root[l] = sqrt(r2[l]);
    state f = w / (r2 * root), to = f * AFTER(*m), back = f * *m;
    UNROLL for (int c = 0; c < DIM; c++) v[c] += to * d[c] - BEFORE(back * d[c]);
}

INLINE void load(long n, long k, double h, const double *const *in, state *v, state *y, state *m, state *e2)
{
    for (int i = 0; i < 4; i++) {
        for (int c = 0; c < DIM; c++) {
            v[c][i] = i < 3 ? in[0][(i * DIM + c) * n + k] : 0;
            y[c][i] = i < 3 ? in[1][(i * DIM + c) * n + k] : 0;
        }
        (*m)[i] = i < 3 ? h * in[2][i * n + k] : 0;
        (*e2)[i] = i < 3 ? in[3][k] * in[3][k] : 1;
    }
}

INLINE void store(long n, long k, const state *x, double *out)
{
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < DIM; c++) out[(i * DIM + c) * n + k] = x[c][i];
}

#else

/* Members side by side, the pairs written out. */
#define GROUP BLOCK
#define ROWS (BODIES * DIM)
typedef struct { lanes q[Q]; } state;

INLINE void kick(double w, state *v, const state *y, const state *m, state e2)
{
    UNROLL for (int q = 0; q < Q; q++)
        UNROLL for (int i = 0; i < BODIES; i++)
            UNROLL for (int j = i + 1; j < BODIES; j++) {
                lanes d[DIM], r2 = e2.q[q];
                UNROLL for (int c = 0; c < DIM; c++) {
                    d[c] = y[j * DIM + c].q[q] - y[i * DIM + c].q[q];
                    r2 += d[c] * d[c];
                }
                lanes f = cube((lanes){0} + w, r2), to = f * m[j].q[q], back = f * m[i].q[q];
                UNROLL for (int c = 0; c < DIM; c++) {
                    v[i * DIM + c].q[q] += to * d[c];
                    v[j * DIM + c].q[q] -= back * d[c];
                }
            }
}

INLINE void load(long n, long b, double h, const double *const *in, state *v, state *y, state *m, state *e2)
{
    for (int l = 0; l < BLOCK; l++) {
        long k = b + l < n ? b + l : n - 1; /* the places past the last member repeat it */
        for (int r = 0; r < ROWS; r++) {
            SET(v[r].q[l / WIDTH], l % WIDTH, in[0][r * n + k]);
            SET(y[r].q[l / WIDTH], l % WIDTH, in[1][r * n + k]);
        }
        for (int i = 0; i < BODIES; i++) SET(m[i].q[l / WIDTH], l % WIDTH, h * in[2][i * n + k]);
        SET(e2->q[l / WIDTH], l % WIDTH, in[3][k] * in[3][k]);
    }
}

INLINE void store(long n, long b, const state *x, double *out)
{
    for (int l = 0; l < BLOCK && b + l < n; l++)
        for (int r = 0; r < ROWS; r++) out[r * n + b + l] = GET(x[r].q[l / WIDTH], l % WIDTH);
}

#endif

INLINE void drift(double h, const state *v, state *y)
{
    UNROLL for (int r = 0; r < ROWS; r++)
#ifdef PACKED
        y[r] += h * v[r];
#else
        UNROLL for (int q = 0; q < Q; q++) y[r].q[q] += h * v[r].q[q];
#endif
}

INLINE void run(int leapfrog, long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    for (long b = 0; b < n; b += GROUP) {
        state v[ROWS] = {}, y[ROWS] = {}, m[BODIES] = {}, e2 = {};
        load(n, b, h, in, v, y, m, &e2);
        if (leapfrog) kick(0.5, v, y, m, e2);
        for (long k = 0; k < steps; k++) {
            if (!leapfrog) kick(1.0, v, y, m, e2);
            drift(h, v, y);
            if (leapfrog) kick(k == steps - 1 ? 0.5 : 1.0, v, y, m, e2);
        }
        store(n, b, v, v_out);
        store(n, b, y, y_out);
    }
}

void bodies_false_euler(long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    run(0, n, steps, h, in, v_out, y_out);
}

void bodies_leapfrog(long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    run(1, n, steps, h, in, v_out, y_out);
}

#else

/* ---- one large system: rows of one axis each, on THREADS threads. Places past the last body have no mass, and are far away. */

#ifndef THREADS
#define THREADS 1
#endif
#define SIZE ((BODIES + BLOCK - 1) / BLOCK * BLOCK)

static double v[DIM][SIZE], y[DIM][SIZE + BLOCK], m[SIZE + BLOCK];

#ifdef ALL

/* All directed pairs, BLOCK bodies at once; nothing is stored in the loop. A body does not pull itself, as its distance is 0. */
static void kick(double w, double e2)
{
#pragma omp parallel for schedule(static) num_threads(THREADS)
    for (int i = 0; i < SIZE; i += BLOCK) {
        lanes a[DIM][Q], own[DIM][Q];
        UNROLL for (int c = 0; c < DIM; c++)
            UNROLL for (int q = 0; q < Q; q++) a[c][q] = (lanes){0}, own[c][q] = *(loose *)&y[c][i + WIDTH * q];
        for (int j = 0; j < BODIES; j++)
            UNROLL for (int q = 0; q < Q; q++) {
                lanes d[DIM], r2 = (lanes){0} + e2;
                UNROLL for (int c = 0; c < DIM; c++) {
                    d[c] = y[c][j] - own[c][q];
                    r2 += d[c] * d[c];
                }
                lanes f = cube((lanes){0} + m[j], r2);
                UNROLL for (int c = 0; c < DIM; c++) a[c][q] += f * d[c];
            }
        UNROLL for (int c = 0; c < DIM; c++)
            UNROLL for (int q = 0; q < Q; q++) *(loose *)&v[c][i + WIDTH * q] += w * a[c][q];
    }
}

#else

/* Each pair once, body i with those after it, in the vectors of the compiler or in blocks. Every thread has sums of its own. */
static double part[THREADS][DIM][SIZE + BLOCK];

INLINE void meet(int i, double e2, double (*restrict a)[SIZE + BLOCK])
{
#ifdef PLAIN
    double s[DIM] = {0};
    for (int j = i + 1; j < BODIES; j++) {
        double d[DIM], r2 = e2;
        UNROLL for (int c = 0; c < DIM; c++) {
            d[c] = y[c][j] - y[c][i];
            r2 += d[c] * d[c];
        }
        double f = 1.0 / (r2 * sqrt(r2)), to = f * m[j], back = f * m[i];
        UNROLL for (int c = 0; c < DIM; c++) {
            s[c] += to * d[c];
            a[c][j] -= back * d[c];
        }
    }
    UNROLL for (int c = 0; c < DIM; c++) a[c][i] += s[c];
#else
    lanes s[DIM][Q];
    UNROLL for (int c = 0; c < DIM; c++)
        UNROLL for (int q = 0; q < Q; q++) s[c][q] = (lanes){0};
    for (int j = i + 1; j < BODIES; j += BLOCK)
        UNROLL for (int q = 0; q < Q; q++) {
            int k = j + WIDTH * q;
            lanes d[DIM], r2 = (lanes){0} + e2;
            UNROLL for (int c = 0; c < DIM; c++) {
                d[c] = *(loose *)&y[c][k] - y[c][i];
                r2 += d[c] * d[c];
            }
            lanes f = cube((lanes){0} + 1.0, r2), to = f * *(loose *)&m[k], back = f * m[i];
            UNROLL for (int c = 0; c < DIM; c++) {
                s[c][q] += to * d[c];
                *(loose *)&a[c][k] -= back * d[c];
            }
        }
    UNROLL for (int c = 0; c < DIM; c++)
        for (int l = 0; l < BLOCK; l++) a[c][i] += GET(s[c][l / WIDTH], l % WIDTH);
#endif
}

static void kick(double w, double e2)
{
#pragma omp parallel num_threads(THREADS)
    {
#pragma omp for schedule(static)
        for (int t = 0; t < THREADS; t++) {
            memset(part[t], 0, sizeof part[t]);
            for (int i = t; i < BODIES; i += THREADS) meet(i, e2, part[t]);
        }
#pragma omp for schedule(static)
        for (int i = 0; i < SIZE; i++)
            for (int c = 0; c < DIM; c++) {
                double a = 0;
                for (int t = 0; t < THREADS; t++) a += part[t][c][i];
                v[c][i] += w * a;
            }
    }
}

#endif

void cluster_leapfrog(long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    (void)n; /* one member */
    for (int i = 0; i < SIZE + BLOCK; i++) {
        m[i] = i < BODIES ? h * in[2][i] : 0;
        for (int c = 0; c < DIM; c++) y[c][i] = i < BODIES ? in[1][i * DIM + c] : 1e10;
    }
    for (int i = 0; i < BODIES; i++)
        for (int c = 0; c < DIM; c++) v[c][i] = in[0][i * DIM + c];
    double e2 = in[3][0] * in[3][0];
    kick(0.5, e2);
    for (long k = 0; k < steps; k++) {
        for (int c = 0; c < DIM; c++)
            for (int i = 0; i < BODIES; i++) y[c][i] += h * v[c][i];
        kick(k == steps - 1 ? 0.5 : 1.0, e2);
    }
    for (int i = 0; i < BODIES; i++)
        for (int c = 0; c < DIM; c++) v_out[i * DIM + c] = v[c][i], y_out[i * DIM + c] = y[c][i];
}

void shared_cluster_leapfrog(long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    cluster_leapfrog(n, steps, h, in, v_out, y_out);
}

#endif
