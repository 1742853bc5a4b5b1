/* What the machine can do at most: integer additions that wait for each other, one a cycle, and vector operations that do not wait. */

#ifdef __AVX512F__
#define WIDTH 64
#elif defined(__AVX__)
#define WIDTH 32
#else
#define WIDTH 16
#endif

typedef double vector __attribute__((vector_size(WIDTH)));

int width(void) { return WIDTH / 8; }

void cycles(long n) {
    long x = 0;
    for (long i = 0; i < n; i += 32) {
#define ADD __asm__ volatile("add %0, %0, %1" : "+r"(x) : "r"(i));
#if defined(__x86_64__)
#undef ADD
#define ADD __asm__ volatile("add %1, %0" : "+r"(x) : "r"(i));
#endif
        ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD
        ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD ADD
    }
}

#define KEEP(v) __asm__ volatile("" : "+v"(v));
#if defined(__aarch64__)
#undef KEEP
#define KEEP(v) __asm__ volatile("" : "+w"(v));
#endif
#define TWELVE(F) F(a) F(b) F(c) F(d) F(e) F(f) F(g) F(h) F(i) F(j) F(k) F(l)

/* Twelve independent vectors, each of which waits only for itself. */
#define LOOP(NAME, OPERATION)                                                                                      \
    void NAME(long n) {                                                                                            \
        vector one = {0}, a, b, c, d, e, f, g, h, i, j, k, l;                                                      \
        one += 1.0000001;                                                                                          \
        KEEP(one)                                                                                                  \
        a = b = c = d = e = f = g = h = i = j = k = l = one;                                                       \
        for (long turn = 0; turn < n; turn += 12) {                                                                \
            TWELVE(OPERATION)                                                                                      \
        }                                                                                                          \
        TWELVE(KEEP)                                                                                               \
    }

#define SUM(v) v = v + one; KEEP(v)
#define PRODUCT(v) v = v * one; KEEP(v)
#define QUOTIENT(v) v = one / v; KEEP(v)
LOOP(sums, SUM)
LOOP(products, PRODUCT)
LOOP(quotients, QUOTIENT)

/* Square roots; one lane after another if the compiler cannot do better. */
#if defined(__AVX512F__)
#include <immintrin.h>
#define ROOT(v) v = (vector)_mm512_sqrt_pd((__m512d)v); KEEP(v)
#elif defined(__AVX__)
#include <immintrin.h>
#define ROOT(v) v = (vector)_mm256_sqrt_pd((__m256d)v); KEEP(v)
#else
#define ROOT(v) v[0] = __builtin_sqrt(v[0]); v[1] = __builtin_sqrt(v[1]); KEEP(v)
#endif
LOOP(roots, ROOT)
