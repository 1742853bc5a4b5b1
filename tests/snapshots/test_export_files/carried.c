// carried: one step by Verlet.
//
// System:  Oscillator(omega=1.0, x=Sampled(3 values, interval=0.4, start=0.0), form='canonical')
// Method:  Verlet (verlet), order 2, 1 rate evaluation per step
// Stable:  undamped oscillators for omega*dt < 2
// Source:  L. Verlet, Computer experiments on classical fluids, Phys. Rev. 159 (1967) 98
// State:   y_prev[1]; y[1]
// Time:    t0 + k*dt at step k, which the state counts
// Written by stepwell VERSION. The numbers are those of stepwell.integrate, to the last bit.
//
// Compile a program that includes it, such as the example, with: cc -O2 -ffp-contract=off example.c -lm
// carried_defaults(&m) sets the parameters; change any of them and call carried_prepare(&m).
// carried_start(&m, &s, velocities, coordinates) makes the state at step 0, carried_step(&m, &s) makes one step.
// carried_finish(&m, &s, velocities) finds the velocities; in the state y_prev stands in their place.
//
// Example:
//
//     #include <stdio.h>
//     #include "carried.c"
//
//     int main(void) {
//         carried m;
//         carried_state s;
//         const double v[1] = {0.5};
//         const double y[1] = {1.0};
//
//         carried_defaults(&m);
//         carried_start(&m, &s, v, y);
//         for (int k = 0; k < 1000; k++) carried_step(&m, &s);
//         printf("%.17g\n", s.y[0]);
//         return 0;
//     }

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

// Options that compute other numbers.
#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "compile without -ffast-math, -Ofast and /fp:fast: they compute other numbers"
#elif defined(__ASSOCIATIVE_MATH__)
#error "compile without -fassociative-math and -funsafe-math-optimizations: they compute other numbers"
#elif defined(__RECIPROCAL_MATH__)
#error "compile without -freciprocal-math: it computes other numbers"
#elif defined(__NO_SIGNED_ZEROS__)
#error "compile without -fno-signed-zeros: it computes other numbers"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "compile without -ffinite-math-only: it computes other numbers"
#endif
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 1 && FLT_EVAL_METHOD != 16 && FLT_EVAL_METHOD != 32 && FLT_EVAL_METHOD != 64
#error "compile with -msse2 -mfpmath=sse: -mfpmath=387 and -mfpmath=both compute a double in other precision than its own"
#endif
typedef char carried_needs_no_fsingle_precision_constant[sizeof 0.1 == sizeof(double) ? 1 : -1];

// No product is fused with a sum, whatever -ffp-contract says.
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

// The sample that holds at a time: the last that is not after it; before all the first.
static double carried_sample(const double *samples, int count, double start, double interval, double t) {
    double i = floor((t - start) / interval * 1.0000000000000568); // t may miss a sample's time by rounding
    if (!(i > 0.0)) i = 0.0;
    if (i > count - 1.0) i = count - 1.0;
    return samples[(int)i];
}

// The description of a step.
typedef struct {
    double dt; // the step
    double t0; // the time of step 0
    double omega;
    double x_start; // x: the time of the first sample
    double x_interval; // x: the time to the next sample

    // Made of these by carried_prepare.
    double phi;
    double c1;
    double c2;
    double c3;
    double c4;
    double c5;
    double c6;
    double c7;
    double c8;
} carried;

// A state.
typedef struct {
    double y_prev[1];
    double y[1];
    int64_t step; // k; the time is t0 + k*dt
} carried_state;

// The samples of x.
static const double carried_x_samples[3] = {1.0, 2.0, 3.0};

// The samples of x.times.
static const double carried_x_times_samples[3] = {0.0, 1.0, 2.0};

// What does not change from step to step. To be called after a change of a parameter.
void carried_prepare(carried *m) {
    m->phi = m->dt * m->omega;
    m->c1 = 0.0 * m->phi;
    m->c2 = m->dt < 0.0 ? m->dt : 0.0;
    m->c3 = m->dt - m->c2 - m->c2;
    m->c4 = 0.5 * m->c3;
    m->c5 = 0.5 * m->dt;
    m->c6 = m->c5 < 0.0 ? m->c5 : 0.0;
    m->c7 = m->c5 - m->c6;
    m->c8 = m->c7 - m->c6;
}

// The parameters with which it was exported.
void carried_defaults(carried *m) {
    m->dt = 0.01;
    m->t0 = 0.0;
    m->omega = 1.0;
    m->x_start = 0.0;
    m->x_interval = 0.4;
    carried_prepare(m);
}

// The state at step 0, of velocities and coordinates.
void carried_start(const carried *m, carried_state *s, const double velocities[1], const double coordinates[1]) {
    s->step = 0;
    memcpy(s->y, coordinates, sizeof s->y);

    const double t = m->t0 + (double)s->step * m->dt;

    // The state.
    const double v = velocities[0];
    const double y = coordinates[0];

    // What depends on the time alone.
    const double s1 = t - m->c6;
    const double s2 = carried_sample(carried_x_samples, 3, m->x_start, m->x_interval, t - m->c7);
    const double s3 = m->x_start + m->x_interval * carried_sample(carried_x_times_samples, 3, m->x_start, m->x_interval, s1);
    const double s4 = (s1 - s3) / m->c8;
    const double s5 = 0.0 < s4 ? s4 : 0.0;
    const double s6 = carried_sample(carried_x_samples, 3, m->x_start, m->x_interval, s1) - s2;
    const double s7 = m->phi * (s2 + (s5 < 1.0 ? s5 : 1.0) * s6);

    // What depends on the state.
    const double next_y_prev = y - m->phi * v + 0.5 * (m->phi * (-m->phi * y - m->c1 * v + s7));

    // The carry, in place of v.
    s->y_prev[0] = next_y_prev;
}

// One step.
void carried_step(const carried *m, carried_state *s) {
    const double t = m->t0 + (double)s->step * m->dt;

    // The state.
    const double y_prev = s->y_prev[0];
    const double y = s->y[0];

    // What depends on the time alone.
    const double s1 = t + m->c4;
    const double s2 = carried_sample(carried_x_samples, 3, m->x_start, m->x_interval, t - m->c4);
    const double s3 = m->x_start + m->x_interval * carried_sample(carried_x_times_samples, 3, m->x_start, m->x_interval, s1);
    const double s4 = (s1 - s3) / m->c3;
    const double s5 = 0.0 < s4 ? s4 : 0.0;
    const double s6 = carried_sample(carried_x_samples, 3, m->x_start, m->x_interval, s1) - s2;
    const double s7 = m->phi * (s2 + (s5 < 1.0 ? s5 : 1.0) * s6);

    // What depends on the state.
    const double dv1 = -m->phi * y - m->c1 * y_prev + s7;
    const double next_y = 2.0 * y - y_prev + m->phi * dv1;
    const double next_y_prev = y;

    // The state after the step.
    s->y_prev[0] = next_y_prev;
    s->y[0] = next_y;
    s->step += 1;
}

// The velocities at a state.
void carried_finish(const carried *m, const carried_state *s, double velocities[1]) {
    const double t = m->t0 + (double)s->step * m->dt;

    // The state.
    const double y_prev = s->y_prev[0];
    const double y = s->y[0];

    // What depends on the time alone.
    const double s1 = t - m->c6;
    const double s2 = carried_sample(carried_x_samples, 3, m->x_start, m->x_interval, t - m->c7);
    const double s3 = m->x_start + m->x_interval * carried_sample(carried_x_times_samples, 3, m->x_start, m->x_interval, s1);
    const double s4 = (s1 - s3) / m->c8;
    const double s5 = 0.0 < s4 ? s4 : 0.0;
    const double s6 = carried_sample(carried_x_samples, 3, m->x_start, m->x_interval, s1) - s2;
    const double s7 = m->phi * (s2 + (s5 < 1.0 ? s5 : 1.0) * s6);

    // What depends on the state.
    const double next_v = (y - y_prev) / m->phi + 0.5 * (-m->phi * y - m->c1 * y_prev + s7);

    // The velocities.
    velocities[0] = next_v;
}

#if defined(__clang__)
#pragma STDC FP_CONTRACT DEFAULT
#elif defined(__GNUC__)
#pragma GCC pop_options
#endif
