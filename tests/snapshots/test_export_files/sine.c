// sine: one step by Damped Euler.
//
// System:  Pendulum(omega=2.0, damping=0.1)
// Method:  Damped Euler (damped_euler), order 1, 1 rate evaluation per step
// Stable:  undamped oscillators for omega*dt < 2
// Source:  G. Hoffmann, Simple Integration Algorithms, 2002, §6
// State:   v[1]; y[1]
// Time:    t0 + k*dt at step k, which the state counts
// Written by stepwell VERSION. The numbers are those of stepwell.integrate, to the last bit.
//
// Compile a program that includes it, such as the example, with: cc -O2 -ffp-contract=off example.c -lm
// sine_defaults(&m) sets the parameters; change any of them and call sine_prepare(&m).
// sine_start(&m, &s, velocities, coordinates) makes the state at step 0, sine_step(&m, &s) makes one step.
//
// Example:
//
//     #include <stdio.h>
//     #include "sine.c"
//
//     int main(void) {
//         sine m;
//         sine_state s;
//         const double v[1] = {0.0};
//         const double y[1] = {1.0};
//
//         sine_defaults(&m);
//         sine_start(&m, &s, v, y);
//         for (int k = 0; k < 1000; k++) sine_step(&m, &s);
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
typedef char sine_needs_no_fsingle_precision_constant[sizeof 0.1 == sizeof(double) ? 1 : -1];

// No product is fused with a sum, whatever -ffp-contract says.
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

static inline uint64_t sine_bits_of(double x) {
    uint64_t b;
    memcpy(&b, &x, sizeof b);
    return b;
}

static inline double sine_number_of(uint64_t b) {
    double x;
    memcpy(&x, &b, sizeof x);
    return x;
}

// x, its sign turned if the last bit of y is set.
static inline double sine_turn_sign(double x, double y) {
    return sine_number_of(sine_bits_of(x) ^ sine_bits_of(y) << 63);
}

// The sine of x.
static double sine_sine(double x) {
    const double a1 = 0.3183098861837907 * x + 6755399441055744.0;
    const double a2 = a1 - 6755399441055744.0;
    const double a3 = x - 3.1415926534682512 * a2 - 1.2154201013012384e-10 * a2;
    const double a4 = a3 * a3;
    const double a5 = a4 * a4;
    const double a6 = a5 * (a5 * (2.7205082501769597e-15 * a5 + 1.6058937294753282e-10) + 2.75573192107121e-06);
    const double a7 = a4 * (a5 * (-7.64292781535996e-13 * a5 - 2.505210682744121e-08) - 0.00019841269841207676);
    const double a8 = a3 + a3 * a4 * (a4 * (a6 + 0.008333333333333196 + a7) - 0.16666666666666666);
    return sine_turn_sign(a8, a1);
}

// The description of a step.
typedef struct {
    double dt; // the step
    double t0; // the time of step 0
    double omega;
    double damping;

    // Made of these by sine_prepare.
    double c1;
    double phi;
    double c2;
} sine;

// A state.
typedef struct {
    double v[1];
    double y[1];
    int64_t step; // k; the time is t0 + k*dt
} sine_state;

// What does not change from step to step. To be called after a change of a parameter.
void sine_prepare(sine *m) {
    m->c1 = m->omega * m->omega * m->dt;
    m->phi = m->dt * m->omega;
    m->c2 = 2.0 * m->damping * m->phi;
}

// The parameters with which it was exported.
void sine_defaults(sine *m) {
    m->dt = 0.01;
    m->t0 = 1.5;
    m->omega = 2.0;
    m->damping = 0.1;
    sine_prepare(m);
}

// The state at step 0, of velocities and coordinates.
void sine_start(const sine *m, sine_state *s, const double velocities[1], const double coordinates[1]) {
    (void)m;
    s->step = 0;
    memcpy(s->v, velocities, sizeof s->v);
    memcpy(s->y, coordinates, sizeof s->y);
}

// One step.
void sine_step(const sine *m, sine_state *s) {
    // The state.
    const double v = s->v[0];
    const double y = s->y[0];

    // What depends on the state.
    const double next_y = y + m->dt * v;
    const double dv1 = -m->c1 * sine_sine(next_y) - m->c2 * v;
    const double next_v = v + dv1;

    // The state after the step.
    s->v[0] = next_v;
    s->y[0] = next_y;
    s->step += 1;
}

#if defined(__clang__)
#pragma STDC FP_CONTRACT DEFAULT
#elif defined(__GNUC__)
#pragma GCC pop_options
#endif
