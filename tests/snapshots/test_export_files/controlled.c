// controlled: one step by False Euler.
//
// System:  NBody(masses=[1.0, 2.0], force='logarithmic', G=1.0, EnergyControl(gain=0.3, form='limited'))
// Method:  False Euler (false_euler), order 1, 1 rate evaluation per step
// Stable:  undamped oscillators for omega*dt < 2
// Source:  A. Cromer, Stable solutions using the Euler approximation, Am. J. Phys. 49 (1981) 455
// State:   v[4], number i, j of the block of shape (2, 2) at v[2*i + j]; y[4], number i, j of the block of shape (2, 2) at y[2*i + j]
// Time:    t0 + k*dt at step k, which the state counts
// Written by stepwell VERSION. The numbers are those of stepwell.integrate(..., dtype="float32"), to the last bit.
//
// Compile a program that includes it, such as the example, with: cc -O2 -ffp-contract=off example.c -lm
// controlled_defaults(&m) sets the parameters; change any of them and call controlled_prepare(&m).
// controlled_start(&m, &s, velocities, coordinates) makes the state at step 0, controlled_step(&m, &s, force) makes one step.
// controlled_work(&m, &s) is the energy that the control has given since the start.
//
// Example:
//
//     #include <stdio.h>
//     #include "controlled.c"
//
//     int main(void) {
//         controlled m;
//         controlled_state s;
//         const float v[4] = {1.0f, 0.0f, 0.0f, 1.0f};
//         const float y[4] = {1.0f, 0.0f, -0.5f, 0.0f};
//         const float force[4] = {0.0f, 0.0f, 0.0f, 0.0f};
//
//         controlled_defaults(&m);
//         controlled_start(&m, &s, v, y);
//         for (int k = 0; k < 1000; k++) controlled_step(&m, &s, force);
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
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16 && FLT_EVAL_METHOD != 32
#error "compile with -msse2 -mfpmath=sse: -mfpmath=387 and -mfpmath=both compute a float in other precision than its own"
#endif
typedef char controlled_needs_no_fsingle_precision_constant[sizeof 0.1 == sizeof(double) ? 1 : -1];

// No product is fused with a sum, whatever -ffp-contract says.
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

static inline uint32_t controlled_bits_of(float x) {
    uint32_t b;
    memcpy(&b, &x, sizeof b);
    return b;
}

static inline float controlled_number_of(uint32_t b) {
    float x;
    memcpy(&x, &b, sizeof x);
    return x;
}

static inline uint32_t controlled_and_bits(uint32_t a, uint32_t b) { return a & b; }

static inline uint32_t controlled_or_bits(uint32_t a, uint32_t b) { return a | b; }

static inline uint32_t controlled_add_bits(uint32_t a, uint32_t b) { return a + b; }

static inline uint32_t controlled_shift_down(uint32_t a, int n) { return a >> n; }

// The logarithm of x.
static float controlled_logarithm(float x) {
    const uint32_t a1 = controlled_add_bits(controlled_bits_of(x), UINT32_C(0x4afc00));
    const uint32_t a2 = controlled_or_bits(controlled_shift_down(a1, 23), UINT32_C(0x4b000000));
    const float a3 = controlled_number_of(a2) - 8388735.0f;
    const uint32_t a4 = controlled_add_bits(controlled_and_bits(a1, UINT32_C(0x7fffff)), UINT32_C(0x3f350400));
    const float a5 = controlled_number_of(a4) - 1.0f;
    const float a6 = a5 / (a5 + 2.0f);
    const float a7 = a6 * a6;
    const float a8 = 0.5f * a5 * a5;
    const float a9 = a6 * (a7 * (a7 * (a7 * (0.2427894f * a7 + 0.2849879f) + 0.40000972f) + 0.6666666f) + a8);
    return 0.69314575f * a3 - (a8 - (a9 + 1.4286068e-06f * a3) - a5);
}

// The description of a step.
typedef struct {
    float dt; // the step
    double t0; // the time of step 0
    float masses[2];
    float Gm[2];
    float softening;
    float control_gain; // control.gain
    float control_target; // control.target

    // Made of these by controlled_prepare.
    float c1;
    float c2;
    float c3;
    float c4;
    float c5;
    float c6;
    float c7;
    float c8;
    float c9;
} controlled;

// A state.
typedef struct {
    float v[4];
    float y[4];
    float tally; // what the control has added up
    int64_t step; // k; the time is t0 + k*dt
} controlled_state;

// What does not change from step to step. To be called after a change of a parameter.
void controlled_prepare(controlled *m) {
    m->c1 = m->dt * m->Gm[0];
    m->c2 = m->dt * m->Gm[1];
    m->c3 = m->softening * m->softening;
    m->c4 = 0.5f * m->dt;
    m->c5 = m->masses[0] * m->c4;
    m->c6 = m->masses[1] * m->c4;
    m->c7 = m->dt * m->control_target;
    m->c8 = 0.0f * m->masses[1];
    m->c9 = 2.0f * m->control_gain;
}

// The parameters with which it was exported.
void controlled_defaults(controlled *m) {
    static const float masses[2] = {1.0f, 2.0f};
    static const float Gm[2] = {1.0f, 2.0f};

    m->dt = 0.01f;
    m->t0 = 0.0;
    memcpy(m->masses, masses, sizeof m->masses);
    memcpy(m->Gm, Gm, sizeof m->Gm);
    m->softening = 0.0f;
    m->control_gain = 0.3f;
    m->control_target = 2.3109303f;
    controlled_prepare(m);
}

// The state at step 0, of velocities and coordinates.
void controlled_start(const controlled *m, controlled_state *s, const float velocities[4], const float coordinates[4]) {
    (void)m;
    s->step = 0;
    s->tally = 0.0f;
    memcpy(s->v, velocities, sizeof s->v);
    memcpy(s->y, coordinates, sizeof s->y);
}

// One step.
void controlled_step(const controlled *m, controlled_state *s, const float force[4]) {
    // The state.
    const float v_0_0 = s->v[0];
    const float v_0_1 = s->v[1];
    const float v_1_0 = s->v[2];
    const float v_1_1 = s->v[3];
    const float y_0_0 = s->y[0];
    const float y_0_1 = s->y[1];
    const float y_1_0 = s->y[2];
    const float y_1_1 = s->y[3];
    const float tally = s->tally;

    // The force.
    const float force_0_0 = force[0];
    const float force_0_1 = force[1];
    const float force_1_0 = force[2];
    const float force_1_1 = force[3];

    // What depends on the state.
    const float a1 = y_1_0 - y_0_0;
    const float a2 = y_1_1 - y_0_1;
    const float a3 = a1 * a1 + a2 * a2 + m->c3;
    const float a4 = 1.0f / a3;
    const float a5 = m->c2 * a4;
    const float a6 = m->c1 * a4;
    const float a7 = m->c5 * (v_0_0 * v_0_0 + v_0_1 * v_0_1) + m->c6 * (v_1_0 * v_1_0 + v_1_1 * v_1_1);
    const float a8 = m->masses[0] * (0.0f + m->c2 * (0.5f * controlled_logarithm(a3) + a4 * (a3 - a3))) + m->c8;
    const float a9 = 1.0f - m->c9 * (a7 + a8 - m->c7) / (1.0f + m->c9 * a7);
    const float a10 = a9 < 0.25f ? 0.25f : a9;
    const float a11 = 1.0f - sqrtf(4.0f < a10 ? 4.0f : a10);
    const float next_tally = tally - a11 * (2.0f - a11) * a7;
    const float dv1_0_0 = a1 * a5 + 0.0f - v_0_0 * a11 + m->dt * force_0_0;
    const float dv1_0_1 = a2 * a5 + 0.0f - v_0_1 * a11 + m->dt * force_0_1;
    const float dv1_1_0 = -a1 * a6 - v_1_0 * a11 + m->dt * force_1_0;
    const float dv1_1_1 = -a2 * a6 - v_1_1 * a11 + m->dt * force_1_1;
    const float next_v_0_0 = v_0_0 + dv1_0_0;
    const float next_v_0_1 = v_0_1 + dv1_0_1;
    const float next_v_1_0 = v_1_0 + dv1_1_0;
    const float next_v_1_1 = v_1_1 + dv1_1_1;
    const float dy1_0_0 = m->dt * next_v_0_0;
    const float dy1_0_1 = m->dt * next_v_0_1;
    const float dy1_1_0 = m->dt * next_v_1_0;
    const float dy1_1_1 = m->dt * next_v_1_1;
    const float next_y_0_0 = y_0_0 + dy1_0_0;
    const float next_y_0_1 = y_0_1 + dy1_0_1;
    const float next_y_1_0 = y_1_0 + dy1_1_0;
    const float next_y_1_1 = y_1_1 + dy1_1_1;

    // The state after the step.
    s->v[0] = next_v_0_0;
    s->v[1] = next_v_0_1;
    s->v[2] = next_v_1_0;
    s->v[3] = next_v_1_1;
    s->y[0] = next_y_0_0;
    s->y[1] = next_y_0_1;
    s->y[2] = next_y_1_0;
    s->y[3] = next_y_1_1;
    s->tally = next_tally;
    s->step += 1;
}

// The energy that the control has given since the start.
double controlled_work(const controlled *m, const controlled_state *s) {
    return (double)s->tally / (1.0 * (double)m->dt);
}

#if defined(__clang__)
#pragma STDC FP_CONTRACT DEFAULT
#elif defined(__GNUC__)
#pragma GCC pop_options
#endif
