/* The C peer, the strongest that is known: BLOCK members at once in flat arrays, which the compiler keeps in registers over all
   steps; h*omega premultiplied. Whether it contracts to FMA is up to the compiler's flags.

   in: rows of n numbers, v and y at the start, then the parameters in the order of the workload's data. */

#include <math.h>
#include <stdint.h>
#include <string.h>

#ifndef BLOCK
#define BLOCK 64
#endif

/* Copies the rows of the block's members; the places past the last member repeat it. */
#define LOAD(to, row, from) \
    for (long l = 0; l < BLOCK; l++) to[l] = in[row][from + l < n ? from + l : n - 1]
#define STORE(to, row, from) \
    for (long l = 0; l < BLOCK && from + l < n; l++) to[from + l] = row[l]

void free_false_euler(long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    for (long b = 0; b < n; b += BLOCK) {
        double v[BLOCK], y[BLOCK], w[BLOCK];
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

#ifdef LIBM
#define sine sin
#else
/* Without a branch, so that a loop over members becomes vector instructions; the same formula as stepwell's trig.rs. */
static inline double sine(double x)
{
    const double magic = 6755399441055744.0; /* 1.5*2^52 */
    double shifted = x * 0.636619772367581343 + magic;
    double n = shifted - magic;
    uint64_t quadrant, bits;
    memcpy(&quadrant, &shifted, 8);
    double r = ((x - n * 1.5707963267341256) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21;
    double z = r * r;
    double s = r + (r * z) * (-1.66666666666666324348e-1 + z * (8.33333333332248946124e-3 + z * (-1.98412698298579493134e-4
               + z * (2.75573137070700676789e-6 + z * (-2.50507602534068634195e-8 + z * 1.58969099521155010221e-10)))));
    double c = (1.0 - 0.5 * z) + (z * z) * (4.16666666666666019037e-2 + z * (-1.38888888888741095749e-3
               + z * (2.48015872894767294178e-5 + z * (-2.75573143513906633035e-7 + z * (2.08757232129817482790e-9
               + z * -1.13596475577881948265e-11)))));
    double a = quadrant & 1 ? c : s;
    memcpy(&bits, &a, 8);
    bits ^= (quadrant & 2) << 62;
    memcpy(&a, &bits, 8);
    return a;
}
#endif

void forced_standard_heun(long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    for (long b = 0; b < n; b += BLOCK) {
        double v[BLOCK], y[BLOCK], w[BLOCK], drag[BLOCK], force[BLOCK], frequency[BLOCK], phase[BLOCK];
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
            drag[l] *= 2.0 * w[l];
        }
        for (long k = 0; k < steps; k++) {
            double t = k * h, later = t + h;
            for (int l = 0; l < BLOCK; l++) {
                double dv1 = force[l] * sine(frequency[l] * t + phase[l]) - w[l] * y[l] - drag[l] * v[l];
                double dy1 = w[l] * v[l];
                double v1 = v[l] + dv1, y1 = y[l] + dy1;
                double dv2 = force[l] * sine(frequency[l] * later + phase[l]) - w[l] * y1 - drag[l] * v1;
                double dy2 = w[l] * v1;
                v[l] += 0.5 * (dv1 + dv2);
                y[l] += 0.5 * (dy1 + dy2);
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
#define DAMPING 0.25
#define FREQUENCY (2.0 / 3.0)

void pendulums_standard_heun(long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    const double drag = 2.0 * DAMPING * h;
    for (long b = 0; b < n; b += BLOCK) {
        double v[BLOCK], y[BLOCK], force[BLOCK];
        LOAD(v, 0, b);
        LOAD(y, 1, b);
        LOAD(force, 2, b);
        for (int l = 0; l < BLOCK; l++) force[l] *= h;
        for (long k = 0; k < steps; k++) {
            double t = k * h, now = sine(FREQUENCY * t), later = sine(FREQUENCY * (t + h));
            SIMD for (int l = 0; l < BLOCK; l++) {
                double dv1 = force[l] * now - h * sine(y[l]) - drag * v[l];
                double dy1 = h * v[l];
                double v1 = v[l] + dv1, y1 = y[l] + dy1;
                double dv2 = force[l] * later - h * sine(y1) - drag * v1;
                double dy2 = h * v1;
                v[l] += 0.5 * (dv1 + dv2);
                y[l] += 0.5 * (dy1 + dy2);
            }
        }
        STORE(v_out, v, b);
        STORE(y_out, y, b);
    }
}

void pendulums_rk4(long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    const double drag = 2.0 * DAMPING * h;
    for (long b = 0; b < n; b += BLOCK) {
        double v[BLOCK], y[BLOCK], force[BLOCK];
        LOAD(v, 0, b);
        LOAD(y, 1, b);
        LOAD(force, 2, b);
        for (int l = 0; l < BLOCK; l++) force[l] *= h;
        for (long k = 0; k < steps; k++) {
            double t = k * h, now = sine(FREQUENCY * t), half = sine(FREQUENCY * (t + 0.5 * h)), later = sine(FREQUENCY * (t + h));
            SIMD for (int l = 0; l < BLOCK; l++) {
                double dv1 = force[l] * now - h * sine(y[l]) - drag * v[l], dy1 = h * v[l];
                double v2 = v[l] + 0.5 * dv1, y2 = y[l] + 0.5 * dy1;
                double dv2 = force[l] * half - h * sine(y2) - drag * v2, dy2 = h * v2;
                double v3 = v[l] + 0.5 * dv2, y3 = y[l] + 0.5 * dy2;
                double dv3 = force[l] * half - h * sine(y3) - drag * v3, dy3 = h * v3;
                double v4 = v[l] + dv3, y4 = y[l] + dy3;
                double dv4 = force[l] * later - h * sine(y4) - drag * v4, dy4 = h * v4;
                v[l] += (dv1 + 2.0 * (dv2 + dv3) + dv4) * (1.0 / 6.0);
                y[l] += (dy1 + 2.0 * (dy2 + dy3) + dy4) * (1.0 / 6.0);
            }
        }
        STORE(v_out, v, b);
        STORE(y_out, y, b);
    }
}
