# carried: one step by Verlet.
#
# System:  Oscillator(omega=1.0, x=Sampled(3 values, interval=0.4, start=0.0), form='canonical')
# Method:  Verlet (verlet), order 2, 1 rate evaluation per step
# Stable:  undamped oscillators for omega*dt < 2
# Source:  L. Verlet, Computer experiments on classical fluids, Phys. Rev. 159 (1967) 98
# State:   y_prev[1]; y[1]
# Time:    t0 + k*dt at step k, which the state counts
# Written by stepwell VERSION. The numbers are those of stepwell.integrate, to the last bit.
#
# Needs only the standard library.
# m = Carried(dt=...) sets the parameters that are given; call m.prepare() after a change of one.
# s = m.start(velocities, coordinates) is the state at step 0, m.step(s) makes one step.
# m.finish(s) finds the velocities; in the state y_prev stands in their place.
#
# Example:
#
#     from carried import Carried
#
#     v = [0.5]
#     y = [1.0]
#     m = Carried()
#     s = m.start(v, y)
#     for _ in range(1000):
#         m.step(s)
#     print(s.y[0])

import math


def quotient(a, b):
    """a / b, which is an infinity or no number where Python raises an error."""
    if b != 0.0:
        return a / b
    return math.nan if a == 0.0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)


def floor(x):
    """The next whole number below."""
    return float(math.floor(x)) if x != 0.0 and math.isfinite(x) else x


def sample(samples, start, interval, t):
    """The sample that holds at a time: the last that is not after it; before all the first."""
    i = floor((t - start) / interval * 1.0000000000000568)  # t may miss a sample's time by rounding
    return samples[int(min(i, len(samples) - 1.0)) if i > 0.0 else 0]


# The samples of x.
x_samples = [1.0, 2.0, 3.0]


# The samples of x.times.
x_times_samples = [0.0, 1.0, 2.0]


class CarriedState:
    """A state."""

    def __init__(self, y_prev, y):
        self.step = 0  # k; the time is t0 + k*dt
        self.y_prev = y_prev
        self.y = y


class Carried:
    """The description of a step, and the step."""

    def __init__(self, **given):
        self.dt = 0.01  # the step
        self.t0 = 0.0  # the time of step 0
        self.omega = 1.0
        self.x_start = 0.0  # x: the time of the first sample
        self.x_interval = 0.4  # x: the time to the next sample
        for name, value in given.items():
            if name not in vars(self):
                raise TypeError(f"there is no parameter {name}")
            setattr(self, name, value)
        self.prepare()

    def prepare(self):
        """What does not change from step to step. To be called after a change of a parameter."""
        self.phi = self.dt * self.omega
        self.c1 = 0.0 * self.phi
        self.c2 = self.dt if self.dt < 0.0 else 0.0
        self.c3 = self.dt - self.c2 - self.c2
        self.c4 = 0.5 * self.c3
        self.c5 = 0.5 * self.dt
        self.c6 = self.c5 if self.c5 < 0.0 else 0.0
        self.c7 = self.c5 - self.c6
        self.c8 = self.c7 - self.c6

    def start(self, velocities, coordinates):
        """The state at step 0, of velocities and coordinates."""
        if len(velocities) != 1:
            raise ValueError(f"velocities: expected 1 number, got {len(velocities)}")
        velocities = [float(each) for each in velocities]
        if len(coordinates) != 1:
            raise ValueError(f"coordinates: expected 1 number, got {len(coordinates)}")
        coordinates = [float(each) for each in coordinates]
        s = CarriedState([0.0] * 1, coordinates)

        t = self.t0 + s.step * self.dt

        # The state.
        v = velocities[0]
        y = coordinates[0]

        # What depends on the time alone.
        s1 = t - self.c6
        s2 = sample(x_samples, self.x_start, self.x_interval, t - self.c7)
        s3 = self.x_start + self.x_interval * sample(x_times_samples, self.x_start, self.x_interval, s1)
        s4 = quotient(s1 - s3, self.c8)
        s5 = s4 if 0.0 < s4 else 0.0
        s6 = (s5 if s5 < 1.0 else 1.0) * (sample(x_samples, self.x_start, self.x_interval, s1) - s2)
        s7 = self.phi * (s2 + s6)

        # What depends on the state.
        next_y_prev = y - self.phi * v + 0.5 * (self.phi * (-self.phi * y - self.c1 * v + s7))

        # The carry, in place of v.
        s.y_prev[0] = next_y_prev
        return s

    def step(self, s):
        """One step."""
        t = self.t0 + s.step * self.dt

        # The state.
        y_prev = s.y_prev[0]
        y = s.y[0]

        # What depends on the time alone.
        s1 = t + self.c4
        s2 = sample(x_samples, self.x_start, self.x_interval, t - self.c4)
        s3 = self.x_start + self.x_interval * sample(x_times_samples, self.x_start, self.x_interval, s1)
        s4 = quotient(s1 - s3, self.c3)
        s5 = s4 if 0.0 < s4 else 0.0
        s6 = (s5 if s5 < 1.0 else 1.0) * (sample(x_samples, self.x_start, self.x_interval, s1) - s2)
        s7 = self.phi * (s2 + s6)

        # What depends on the state.
        dv1 = -self.phi * y - self.c1 * y_prev + s7
        next_y = 2.0 * y - y_prev + self.phi * dv1
        next_y_prev = y

        # The state after the step.
        s.y_prev[0] = next_y_prev
        s.y[0] = next_y
        s.step += 1

    def finish(self, s):
        """The velocities at a state."""
        velocities = [0.0] * 1
        t = self.t0 + s.step * self.dt

        # The state.
        y_prev = s.y_prev[0]
        y = s.y[0]

        # What depends on the time alone.
        s1 = t - self.c6
        s2 = sample(x_samples, self.x_start, self.x_interval, t - self.c7)
        s3 = self.x_start + self.x_interval * sample(x_times_samples, self.x_start, self.x_interval, s1)
        s4 = quotient(s1 - s3, self.c8)
        s5 = s4 if 0.0 < s4 else 0.0
        s6 = (s5 if s5 < 1.0 else 1.0) * (sample(x_samples, self.x_start, self.x_interval, s1) - s2)
        s7 = self.phi * (s2 + s6)

        # What depends on the state.
        next_v = quotient(y - y_prev, self.phi) + 0.5 * (-self.phi * y - self.c1 * y_prev + s7)

        # The velocities.
        velocities[0] = next_v
        return velocities
