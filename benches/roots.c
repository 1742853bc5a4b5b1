/* Times one way to compute f = 1/r^3 from x = r^2, which SEQUENCE holds, over vectors of WIDTH numbers. Returned are cycles of the
   time-stamp counter a vector: of independent vectors, of one that waits for the last, and within a force between bodies in space. */

#include <immintrin.h>
#include <stdint.h>
#include <x86intrin.h>

typedef double v __attribute__((vector_size(8 * WIDTH)));
typedef uint64_t w __attribute__((vector_size(8 * WIDTH)));

#define NUMBERS 512
#define AT(p, i) (*(v *)((p) + (i)))
#define INLINE static inline __attribute__((always_inline))

#if WIDTH == 8
#define sqrt(x) ((v)_mm512_sqrt_pd((__m512d)(x)))
#else
#define sqrt(x) ((v)_mm256_sqrt_pd((__m256d)(x)))
#endif

/* a * b + c rounded once, in a sequence that asks for it; some of the three are numbers for all lanes, and x - 0 is x. */
#if WIDTH == 8
#define FMA(a, b, c) ((v)_mm512_fmadd_pd((__m512d)(a), (__m512d)(b), (__m512d)(c)))
#else
#define FMA(a, b, c) ((v)_mm256_fmadd_pd((__m256d)(a), (__m256d)(b), (__m256d)(c)))
#endif
#define fma(a, b, c) FMA((a) - (v){0}, (b) - (v){0}, (c) - (v){0})

/* M less half the bits of x: exclusive or takes them from all ones. */
INLINE v start(v x, uint64_t m)
{
    return (v)((((w)x >> 1) ^ 0x3FFFFFFFFFFFFFFFull) + (m - 0x3FFFFFFFFFFFFFFFull));
}

INLINE v cube(v x)
{
    v y, s, u, q, e, f;
    (void)y, (void)s, (void)u, (void)q, (void)e;
    SEQUENCE
    return f;
}

double alone(long n, const double *a, double *b)
{
    uint64_t t = __rdtsc();
    for (long r = 0; r < n; r++) {
        for (int i = 0; i < NUMBERS; i += 4 * WIDTH)
            for (int k = 0; k < 4; k++) AT(b, i + k * WIDTH) = cube(AT(a, i + k * WIDTH));
        __asm__ volatile("" ::"r"(b) : "memory");
    }
    return (double)(__rdtsc() - t) / n / (NUMBERS / WIDTH);
}

double waiting(long n, const double *a, double *b)
{
    v x = AT(a, 0);
    uint64_t t = __rdtsc();
    for (long r = 0; r < n; r++) x = cube(x) + 2.0;
    AT(b, 0) = x;
    return (double)(__rdtsc() - t) / n;
}

/* A body meets 128 partners: rows of their places and masses in a; what they collect in b. */
double force(long n, const double *a, double *b)
{
    enum { ROW = NUMBERS / 4 };
    uint64_t t = __rdtsc();
    for (long r = 0; r < n; r++) {
        v sum[3] = {{0}, {0}, {0}};
        for (int i = 0; i < ROW; i += WIDTH) {
            v d[3], r2 = (v){0} + 0.01;
            for (int c = 0; c < 3; c++) d[c] = AT(a, c * ROW + i) - a[c];
            r2 = ((d[0] * d[0] + d[1] * d[1]) + d[2] * d[2]) + r2;
            v f = cube(r2), to = f * AT(a, 3 * ROW + i), back = f * a[3];
            for (int c = 0; c < 3; c++) sum[c] += d[c] * to, AT(b, c * ROW + i) += d[c] * back;
        }
        AT(b, 3 * ROW) = sum[0] + sum[1] + sum[2];
        __asm__ volatile("" ::"r"(b) : "memory");
    }
    return (double)(__rdtsc() - t) / n / (ROW / WIDTH);
}

/* Cycles of the counter for one of the CPU: additions that wait for each other. */
double clock_ratio(long n)
{
    uint64_t t = __rdtsc(), x = 1;
    for (long r = 0; r < n; r++)
        __asm__ volatile("add $1,%0\nadd $1,%0\nadd $1,%0\nadd $1,%0\nadd $1,%0\nadd $1,%0\nadd $1,%0\nadd $1,%0" : "+r"(x));
    return (double)(__rdtsc() - t) / n / 8;
}
