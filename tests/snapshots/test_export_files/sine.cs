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
// A part of a project of .NET, Unity or Godot; or compiled with a program such as the example: csc example.cs sine.cs
// var m = new Sine() sets the parameters; change any of them and call m.Prepare().
// var s = m.Start(velocities, coordinates) is the state at step 0, m.Step(s) makes one step.
//
// Example:
//
//     using System;
//     using System.Globalization;
//
//     static class Example {
//         static void Main() {
//             double[] v = {0.0};
//             double[] y = {1.0};
//             var m = new Sine();
//             var s = m.Start(v, y);
//             for (int k = 0; k < 1000; k++) m.Step(s);
//             Console.WriteLine(s.y[0].ToString("R", CultureInfo.InvariantCulture));
//         }
//     }

using System;

/// The description of a step, and the step.
public sealed class Sine {
    public double dt = 0.01; // the step
    public double t0 = 1.5; // the time of step 0
    public double omega = 2.0;
    public double damping = 0.1;

    // Made of these by Prepare.
    double c1;
    double phi;
    double c2;

    // With the parameters with which it was exported.
    public Sine() {
        Prepare();
    }

    // What does not change from step to step. To be called after a change of a parameter.
    public void Prepare() {
        this.c1 = this.omega * this.omega * this.dt;
        this.phi = this.dt * this.omega;
        this.c2 = 2.0 * this.damping * this.phi;
    }

    // The state at step 0, of velocities and coordinates.
    public SineState Start(double[] velocities, double[] coordinates) {
        if (velocities.Length != 1)
            throw new ArgumentException("velocities: expected 1 number, got " + velocities.Length);
        if (coordinates.Length != 1)
            throw new ArgumentException("coordinates: expected 1 number, got " + coordinates.Length);
        var s = new SineState();
        s.v = (double[])velocities.Clone();
        s.y = (double[])coordinates.Clone();
        return s;
    }

    // One step.
    public void Step(SineState s) {
        // The state.
        double v = s.v[0];
        double y = s.y[0];

        // What depends on the state.
        double next_y = y + this.dt * v;
        double dv1 = -this.c1 * _sine(next_y) - this.c2 * v;
        double next_v = v + dv1;

        // The state after the step.
        s.v[0] = next_v;
        s.y[0] = next_y;
        s.step += 1;
    }

    static ulong _bits_of(double x) { return unchecked((ulong)BitConverter.DoubleToInt64Bits(x)); }

    static double _number_of(ulong b) { return BitConverter.Int64BitsToDouble(unchecked((long)b)); }

    // x, its sign turned if the last bit of y is set.
    static double _turn_sign(double x, double y) { return _number_of(_bits_of(x) ^ _bits_of(y) << 63); }

    // The sine of x.
    static double _sine(double x) {
        double a1 = 0.3183098861837907 * x + 6755399441055744.0;
        double a2 = a1 - 6755399441055744.0;
        double a3 = x - 3.1415926534682512 * a2 - 1.2154201013012384e-10 * a2;
        double a4 = a3 * a3;
        double a5 = a4 * a4;
        double a6 = a5 * (a5 * (2.7205082501769597e-15 * a5 + 1.6058937294753282e-10) + 2.75573192107121e-06);
        double a7 = a4 * (a5 * (-7.64292781535996e-13 * a5 - 2.505210682744121e-08) - 0.00019841269841207676);
        return _turn_sign(a3 + a3 * a4 * (a4 * (a6 + 0.008333333333333196 + a7) - 0.16666666666666666), a1);
    }
}

/// A state.
public sealed class SineState {
    public double[] v;
    public double[] y;
    public long step; // k; the time is t0 + k*dt
}
