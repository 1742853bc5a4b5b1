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
// A part of a project of .NET, Unity or Godot; or compiled with a program such as the example: csc example.cs carried.cs
// var m = new Carried() sets the parameters; change any of them and call m.Prepare().
// var s = m.Start(velocities, coordinates) is the state at step 0, m.Step(s) makes one step.
// m.Finish(s) finds the velocities; in the state y_prev stands in their place.
//
// Example:
//
//     using System;
//     using System.Globalization;
//
//     static class Example {
//         static void Main() {
//             double[] v = {0.5};
//             double[] y = {1.0};
//             var m = new Carried();
//             var s = m.Start(v, y);
//             for (int k = 0; k < 1000; k++) m.Step(s);
//             Console.WriteLine(s.y[0].ToString("R", CultureInfo.InvariantCulture));
//         }
//     }

using System;

/// The description of a step, and the step.
public sealed class Carried {
    public double dt = 0.01; // the step
    public double t0 = 0.0; // the time of step 0
    public double omega = 1.0;
    public double x_start = 0.0; // x: the time of the first sample
    public double x_interval = 0.4; // x: the time to the next sample

    // Made of these by Prepare.
    double phi;
    double c1;
    double c2;
    double c3;
    double c4;
    double c5;
    double c6;
    double c7;
    double c8;

    // With the parameters with which it was exported.
    public Carried() {
        Prepare();
    }

    // What does not change from step to step. To be called after a change of a parameter.
    public void Prepare() {
        this.phi = this.dt * this.omega;
        this.c1 = 0.0 * this.phi;
        this.c2 = this.dt < 0.0 ? this.dt : 0.0;
        this.c3 = this.dt - this.c2 - this.c2;
        this.c4 = 0.5 * this.c3;
        this.c5 = 0.5 * this.dt;
        this.c6 = this.c5 < 0.0 ? this.c5 : 0.0;
        this.c7 = this.c5 - this.c6;
        this.c8 = this.c7 - this.c6;
    }

    // The state at step 0, of velocities and coordinates.
    public CarriedState Start(double[] velocities, double[] coordinates) {
        if (velocities.Length != 1)
            throw new ArgumentException("velocities: expected 1 number, got " + velocities.Length);
        if (coordinates.Length != 1)
            throw new ArgumentException("coordinates: expected 1 number, got " + coordinates.Length);
        var s = new CarriedState();
        s.y_prev = new double[1];
        s.y = (double[])coordinates.Clone();

        double t = this.t0 + s.step * this.dt;

        // The state.
        double v = velocities[0];
        double y = coordinates[0];

        // What depends on the time alone.
        double s1 = t - this.c6;
        double s2 = _sample(_x_samples, this.x_start, this.x_interval, t - this.c7);
        double s3 = this.x_start + this.x_interval * _sample(_x_times_samples, this.x_start, this.x_interval, s1);
        double s4 = (s1 - s3) / this.c8;
        double s5 = 0.0 < s4 ? s4 : 0.0;
        double s6 = s2 + (s5 < 1.0 ? s5 : 1.0) * (_sample(_x_samples, this.x_start, this.x_interval, s1) - s2);
        double s7 = this.phi * s6;

        // What depends on the state.
        double next_y_prev = y - this.phi * v + 0.5 * (this.phi * (-this.phi * y - this.c1 * v + s7));

        // The carry, in place of v.
        s.y_prev[0] = next_y_prev;
        return s;
    }

    // One step.
    public void Step(CarriedState s) {
        double t = this.t0 + s.step * this.dt;

        // The state.
        double y_prev = s.y_prev[0];
        double y = s.y[0];

        // What depends on the time alone.
        double s1 = t + this.c4;
        double s2 = _sample(_x_samples, this.x_start, this.x_interval, t - this.c4);
        double s3 = this.x_start + this.x_interval * _sample(_x_times_samples, this.x_start, this.x_interval, s1);
        double s4 = (s1 - s3) / this.c3;
        double s5 = 0.0 < s4 ? s4 : 0.0;
        double s6 = s2 + (s5 < 1.0 ? s5 : 1.0) * (_sample(_x_samples, this.x_start, this.x_interval, s1) - s2);
        double s7 = this.phi * s6;

        // What depends on the state.
        double dv1 = -this.phi * y - this.c1 * y_prev + s7;
        double next_y = 2.0 * y - y_prev + this.phi * dv1;
        double next_y_prev = y;

        // The state after the step.
        s.y_prev[0] = next_y_prev;
        s.y[0] = next_y;
        s.step += 1;
    }

    // The velocities at a state.
    public double[] Finish(CarriedState s) {
        double[] velocities = new double[1];
        double t = this.t0 + s.step * this.dt;

        // The state.
        double y_prev = s.y_prev[0];
        double y = s.y[0];

        // What depends on the time alone.
        double s1 = t - this.c6;
        double s2 = _sample(_x_samples, this.x_start, this.x_interval, t - this.c7);
        double s3 = this.x_start + this.x_interval * _sample(_x_times_samples, this.x_start, this.x_interval, s1);
        double s4 = (s1 - s3) / this.c8;
        double s5 = 0.0 < s4 ? s4 : 0.0;
        double s6 = s2 + (s5 < 1.0 ? s5 : 1.0) * (_sample(_x_samples, this.x_start, this.x_interval, s1) - s2);
        double s7 = this.phi * s6;

        // What depends on the state.
        double next_v = (y - y_prev) / this.phi + 0.5 * (-this.phi * y - this.c1 * y_prev + s7);

        // The velocities.
        velocities[0] = next_v;
        return velocities;
    }

    // The samples of x.
    static readonly double[] _x_samples = {1.0, 2.0, 3.0};

    // The samples of x.times.
    static readonly double[] _x_times_samples = {0.0, 1.0, 2.0};

    // The sample that holds at a time: the last that is not after it; before all the first.
    static double _sample(double[] samples, double start, double interval, double t) {
        double i = Math.Floor((t - start) / interval * 1.0000000000000568); // t may miss a sample's time by rounding
        return samples[i > 0.0 ? (int)Math.Min(i, samples.Length - 1.0) : 0];
    }
}

/// A state.
public sealed class CarriedState {
    public double[] y_prev;
    public double[] y;
    public long step; // k; the time is t0 + k*dt
}
