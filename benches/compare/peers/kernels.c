/* The C peer, the strongest that is known: BLOCK members at once in flat arrays, which the compiler keeps in registers over all
   steps; h*omega premultiplied. Whether it contracts to FMA is up to the compiler's flags.

   in: rows of n numbers, v and y at the start, then the parameters in the order of the workload's data.

   With SINGLE numbers are floats, but for the time, which is rounded where it is read. R is a constant of their precision. */

#include <math.h>
#include <stdint.h>
#include <string.h>

#ifndef BLOCK
#define BLOCK 64
#endif

#ifdef SINGLE
typedef float real;
#define R(x) x##f
#else
typedef double real;
#define R(x) x
#endif

/* Copies the rows of the block's members; the places past the last member repeat it. */
#define LOAD(to, row, from) \
    for (long l = 0; l < BLOCK; l++) to[l] = in[row][from + l < n ? from + l : n - 1]
#define STORE(to, row, from) \
    for (long l = 0; l < BLOCK && from + l < n; l++) to[from + l] = row[l]

void free_false_euler(long n, long steps, double step, const real *const *in, real *v_out, real *y_out)
{
    const real h = (real)step;
    for (long b = 0; b < n; b += BLOCK) {
        real v[BLOCK], y[BLOCK], w[BLOCK];
        LOAD(v, 0, b);
        LOAD(y, 1, b);
        LOAD(w, 2, b);
        for (int l = 0; l < BLOCK; l++) w[l] *= h;
        for (long k = 0; k < steps; k++)
            for (int l = 0; l < BLOCK; l++) {
                v[l] -= w[l] * y[l];
                y[l] += w[l] * v[l];
            }
        STORE(v_out, v, b);
        STORE(y_out, y, b);
    }
}

#if defined(LIBM) && defined(SINGLE)
#define sine sinf
#elif defined(LIBM)
#define sine sin
#elif defined(SINGLE)
/* As below, with the shorter polynomial of stepwell's float32. */
static inline float sine(float x)
{
    const float magic = 12582912.0f; /* 1.5*2^23 */
    float shifted = x * 0.31830987f + magic, n = shifted - magic;
    float r = ((x - n * 3.1416015625f) - n * -8.909031748771667e-06f) - n * 1.215420125655342e-10f, z = r * r;
    float a = r + (r * z) * (-0.16666656732559204f + z * (0.008333008736371994f + z * (-0.00019806012278422713f + z * 2.5987430944951484e-06f)));
    uint32_t half_turns, bits;
    memcpy(&half_turns, &shifted, 4);
    memcpy(&bits, &a, 4);
    bits ^= half_turns << 31;
    memcpy(&a, &bits, 4);
    return a;
}
#else
/* Without a branch, so that a loop over members becomes vector instructions; the same formula as stepwell's trig.rs. */
static inline double sine(double x)
{
    const double magic = 6755399441055744.0; /* 1.5*2^52 */
    double shifted = x * 0.3183098861837907 + magic, n = shifted - magic;
    double r = (x - n * 3.1415926534682512) - n * 1.2154201013012384e-10, z = r * r, w = z * z;
    double odd = 0.008333333333333196 + w * (2.75573192107121e-6 + w * (1.6058937294753282e-10 + w * 2.7205082501769597e-15));
    double even = -0.00019841269841207676 + w * (-2.505210682744121e-8 + w * -7.64292781535996e-13);
    double a = r + (r * z) * (-0.16666666666666666 + z * (odd + z * even));
    uint64_t half_turns, bits;
    memcpy(&half_turns, &shifted, 8);
    memcpy(&bits, &a, 8);
    bits ^= half_turns << 63;
    memcpy(&a, &bits, 8);
    return a;
}
#endif

void forced_standard_heun(long n, long steps, double step, const real *const *in, real *v_out, real *y_out)
{
    const real h = (real)step;
    for (long b = 0; b < n; b += BLOCK) {
        real v[BLOCK], y[BLOCK], w[BLOCK], drag[BLOCK], force[BLOCK], frequency[BLOCK], phase[BLOCK];
        LOAD(v, 0, b);
        LOAD(y, 1, b);
        LOAD(w, 2, b);
        LOAD(drag, 3, b);
        LOAD(force, 4, b);
        LOAD(frequency, 5, b);
        LOAD(phase, 6, b);
        for (int l = 0; l < BLOCK; l++) {
            force[l] *= h / w[l];
            w[l] *= h;
            drag[l] *= R(2.0) * w[l];
        }
        for (long k = 0; k < steps; k++) {
            real t = (real)(k * (double)h), later = (real)(k * (double)h + h);
            for (int l = 0; l < BLOCK; l++) {
                real dv1 = force[l] * sine(frequency[l] * t + phase[l]) - w[l] * y[l] - drag[l] * v[l];
                real dy1 = w[l] * v[l];
                real v1 = v[l] + dv1, y1 = y[l] + dy1;
                real dv2 = force[l] * sine(frequency[l] * later + phase[l]) - w[l] * y1 - drag[l] * v1;
                real dy2 = w[l] * v1;
                v[l] += R(0.5) * (dv1 + dv2);
                y[l] += R(0.5) * (dy1 + dy2);
            }
        }
        STORE(v_out, v, b);
        STORE(y_out, y, b);
    }
}

/* Damped pendulums under one drive: its sine is the same for all members, so it is computed once in a step. SIMD lets the compiler
   take its library's vector sine for the other. */
#ifdef LIBM
#define SIMD _Pragma("omp simd")
#else
#define SIMD
#endif
#define DAMPING R(0.25)
#define FREQUENCY (R(2.0) / R(3.0))

void pendulums_standard_heun(long n, long steps, double step, const real *const *in, real *v_out, real *y_out)
{
    const real h = (real)step, drag = R(2.0) * DAMPING * h;
    for (long b = 0; b < n; b += BLOCK) {
        real v[BLOCK], y[BLOCK], force[BLOCK];
        LOAD(v, 0, b);
        LOAD(y, 1, b);
        LOAD(force, 2, b);
        for (int l = 0; l < BLOCK; l++) force[l] *= h;
        for (long k = 0; k < steps; k++) {
            double t = k * (double)h;
            real now = sine(FREQUENCY * (real)t), later = sine(FREQUENCY * (real)(t + h));
            SIMD for (int l = 0; l < BLOCK; l++) {
                real dv1 = force[l] * now - h * sine(y[l]) - drag * v[l];
                real dy1 = h * v[l];
                real v1 = v[l] + dv1, y1 = y[l] + dy1;
                real dv2 = force[l] * later - h * sine(y1) - drag * v1;
                real dy2 = h * v1;
                v[l] += R(0.5) * (dv1 + dv2);
                y[l] += R(0.5) * (dy1 + dy2);
            }
        }
        STORE(v_out, v, b);
        STORE(y_out, y, b);
    }
}

void pendulums_rk4(long n, long steps, double step, const real *const *in, real *v_out, real *y_out)
{
    const real h = (real)step, drag = R(2.0) * DAMPING * h;
    for (long b = 0; b < n; b += BLOCK) {
        real v[BLOCK], y[BLOCK], force[BLOCK];
        LOAD(v, 0, b);
        LOAD(y, 1, b);
        LOAD(force, 2, b);
        for (int l = 0; l < BLOCK; l++) force[l] *= h;
        for (long k = 0; k < steps; k++) {
            double t = k * (double)h;
            real now = sine(FREQUENCY * (real)t), half = sine(FREQUENCY * (real)(t + 0.5 * h));
            real later = sine(FREQUENCY * (real)(t + h));
            SIMD for (int l = 0; l < BLOCK; l++) {
                real dv1 = force[l] * now - h * sine(y[l]) - drag * v[l], dy1 = h * v[l];
                real v2 = v[l] + R(0.5) * dv1, y2 = y[l] + R(0.5) * dy1;
                real dv2 = force[l] * half - h * sine(y2) - drag * v2, dy2 = h * v2;
                real v3 = v[l] + R(0.5) * dv2, y3 = y[l] + R(0.5) * dy2;
                real dv3 = force[l] * half - h * sine(y3) - drag * v3, dy3 = h * v3;
                real v4 = v[l] + dv3, y4 = y[l] + dy3;
                real dv4 = force[l] * later - h * sine(y4) - drag * v4, dy4 = h * v4;
                v[l] += (dv1 + R(2.0) * (dv2 + dv3) + dv4) * (R(1.0) / R(6.0));
                y[l] += (dy1 + R(2.0) * (dy2 + dy3) + dy4) * (R(1.0) / R(6.0));
            }
        }
        STORE(v_out, v, b);
        STORE(y_out, y, b);
    }
}
