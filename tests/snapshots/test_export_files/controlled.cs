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
// A part of a project of .NET, Unity or Godot; or compiled with a program such as the example: csc example.cs controlled.cs
// var m = new Controlled() sets the parameters; change any of them and call m.Prepare().
// var s = m.Start(velocities, coordinates) is the state at step 0, m.Step(s, force) makes one step.
// m.Work(s) is the energy that the control has given since the start.
//
// Example:
//
//     using System;
//     using System.Globalization;
//
//     static class Example {
//         static void Main() {
//             float[] v = {1.0f, 0.0f, 0.0f, 1.0f};
//             float[] y = {1.0f, 0.0f, -0.5f, 0.0f};
//             float[] force = {0.0f, 0.0f, 0.0f, 0.0f};
//             var m = new Controlled();
//             var s = m.Start(v, y);
//             for (int k = 0; k < 1000; k++) m.Step(s, force);
//             Console.WriteLine(s.y[0].ToString("R", CultureInfo.InvariantCulture));
//         }
//     }

using System;
using System.Runtime.InteropServices;

/// The description of a step, and the step.
public sealed class Controlled {
    public float dt = 0.01f; // the step
    public double t0 = 0.0; // the time of step 0
    public float[] masses = {1.0f, 2.0f};
    public float[] Gm = {1.0f, 2.0f};
    public float softening = 0.0f;
    public float control_gain = 0.3f; // control.gain
    public float control_target = 2.3109303f; // control.target

    // Made of these by Prepare.
    float c1;
    float c2;
    float c3;
    float c4;
    float c5;
    float c6;
    float c7;
    float c8;
    float c9;

    // With the parameters with which it was exported.
    public Controlled() {
        Prepare();
    }

    // What does not change from step to step. To be called after a change of a parameter.
    public void Prepare() {
        this.c1 = (float)(this.dt * this.Gm[0]);
        this.c2 = (float)(this.dt * this.Gm[1]);
        this.c3 = (float)(this.softening * this.softening);
        this.c4 = (float)(0.5f * this.dt);
        this.c5 = (float)(this.masses[0] * this.c4);
        this.c6 = (float)(this.masses[1] * this.c4);
        this.c7 = (float)(this.dt * this.control_target);
        this.c8 = (float)(0.0f * this.masses[1]);
        this.c9 = (float)(2.0f * this.control_gain);
    }

    // The state at step 0, of velocities and coordinates.
    public ControlledState Start(float[] velocities, float[] coordinates) {
        if (velocities.Length != 4)
            throw new ArgumentException("velocities: expected 4 numbers, got " + velocities.Length);
        if (coordinates.Length != 4)
            throw new ArgumentException("coordinates: expected 4 numbers, got " + coordinates.Length);
        var s = new ControlledState();
        s.v = (float[])velocities.Clone();
        s.y = (float[])coordinates.Clone();
        return s;
    }

    // One step.
    public void Step(ControlledState s, float[] force) {
        // The state.
        float v_0_0 = s.v[0];
        float v_0_1 = s.v[1];
        float v_1_0 = s.v[2];
        float v_1_1 = s.v[3];
        float y_0_0 = s.y[0];
        float y_0_1 = s.y[1];
        float y_1_0 = s.y[2];
        float y_1_1 = s.y[3];
        float tally = s.tally;

        // The force.
        float force_0_0 = force[0];
        float force_0_1 = force[1];
        float force_1_0 = force[2];
        float force_1_1 = force[3];

        // What depends on the state.
        float a1 = (float)(y_1_0 - y_0_0);
        float a2 = (float)(y_1_1 - y_0_1);
        float a3 = (float)((float)((float)(a1 * a1) + (float)(a2 * a2)) + this.c3);
        float a4 = (float)(1.0f / a3);
        float a5 = (float)(this.c2 * a4);
        float a6 = (float)(this.c1 * a4);
        float a7 = (float)(this.c2 * (float)((float)(0.5f * _logarithm(a3)) + (float)(a4 * (float)(a3 - a3))));
        float a8 = (float)(this.c5 * (float)((float)(v_0_0 * v_0_0) + (float)(v_0_1 * v_0_1)));
        float a9 = (float)(a8 + (float)(this.c6 * (float)((float)(v_1_0 * v_1_0) + (float)(v_1_1 * v_1_1))));
        float a10 = (float)(a9 + (float)((float)(this.masses[0] * (float)(a7 + 0.0f)) + this.c8));
        float a11 = (float)((float)(this.c9 * (float)(a10 - this.c7)) / (float)((float)(this.c9 * a9) + 1.0f));
        float a12 = (float)(1.0f - a11);
        float a13 = a12 < 0.25f ? 0.25f : a12;
        float a14 = (float)(1.0f - (float)(Math.Sqrt(4.0f < a13 ? 4.0f : a13)));
        float next_tally = (float)(tally - (float)(a9 * (float)(a14 * (float)(2.0f - a14))));
        float a15 = (float)((float)((float)(a1 * a5) + 0.0f) - (float)(v_0_0 * a14));
        float dv1_0_0 = (float)((float)(this.dt * force_0_0) + a15);
        float a16 = (float)((float)((float)(a2 * a5) + 0.0f) - (float)(v_0_1 * a14));
        float dv1_0_1 = (float)((float)(this.dt * force_0_1) + a16);
        float dv1_1_0 = (float)((float)(this.dt * force_1_0) + (float)(-(float)(a1 * a6) - (float)(v_1_0 * a14)));
        float dv1_1_1 = (float)((float)(this.dt * force_1_1) + (float)(-(float)(a2 * a6) - (float)(v_1_1 * a14)));
        float next_v_0_0 = (float)(v_0_0 + dv1_0_0);
        float next_v_0_1 = (float)(v_0_1 + dv1_0_1);
        float next_v_1_0 = (float)(v_1_0 + dv1_1_0);
        float next_v_1_1 = (float)(v_1_1 + dv1_1_1);
        float dy1_0_0 = (float)(this.dt * next_v_0_0);
        float dy1_0_1 = (float)(this.dt * next_v_0_1);
        float dy1_1_0 = (float)(this.dt * next_v_1_0);
        float dy1_1_1 = (float)(this.dt * next_v_1_1);
        float next_y_0_0 = (float)(y_0_0 + dy1_0_0);
        float next_y_0_1 = (float)(y_0_1 + dy1_0_1);
        float next_y_1_0 = (float)(y_1_0 + dy1_1_0);
        float next_y_1_1 = (float)(y_1_1 + dy1_1_1);

        // The state after the step.
        s.v[0] = next_v_0_0;
        s.v[1] = next_v_0_1;
        s.v[2] = next_v_1_0;
        s.v[3] = next_v_1_1;
        s.y[0] = next_y_0_0;
        s.y[1] = next_y_0_1;
        s.y[2] = next_y_1_0;
        s.y[3] = next_y_1_1;
        s.tally = next_tally;
        s.step += 1;
    }

    // The energy that the control has given since the start.
    public double Work(ControlledState s) {
        return s.tally / (1.0 * (double)this.dt);
    }

    [StructLayout(LayoutKind.Explicit)]
    struct _Bits {
        [FieldOffset(0)] public float number;
        [FieldOffset(0)] public uint whole;
    }

    static uint _bits_of(float x) { return new _Bits { number = x }.whole; }

    static float _number_of(uint b) { return new _Bits { whole = b }.number; }

    static uint _and_bits(uint a, uint b) { return a & b; }

    static uint _or_bits(uint a, uint b) { return a | b; }

    static uint _add_bits(uint a, uint b) { return unchecked(a + b); }

    static uint _shift_down(uint a, int n) { return a >> n; }

    // The logarithm of x.
    static float _logarithm(float x) {
        uint a1 = _add_bits(_bits_of(x), 0x4afc00U);
        float a2 = (float)(_number_of(_or_bits(_shift_down(a1, 23), 0x4b000000U)) - 8388735.0f);
        float a3 = (float)(_number_of(_add_bits(_and_bits(a1, 0x7fffffU), 0x3f350400U)) - 1.0f);
        float a4 = (float)(a3 / (float)(a3 + 2.0f));
        float a5 = (float)(a4 * a4);
        float a6 = (float)((float)(a5 * (float)((float)(0.2427894f * a5) + 0.2849879f)) + 0.40000972f);
        float a7 = (float)(a3 * (float)(0.5f * a3));
        float a8 = (float)(a4 * (float)((float)(a5 * (float)((float)(a5 * a6) + 0.6666666f)) + a7));
        float a9 = (float)((float)(a7 - (float)(a8 + (float)(1.4286068e-06f * a2))) - a3);
        return (float)((float)(0.69314575f * a2) - a9);
    }
}

/// A state.
public sealed class ControlledState {
    public float[] v;
    public float[] y;
    public float tally; // what the control has added up
    public long step; // k; the time is t0 + k*dt
}
