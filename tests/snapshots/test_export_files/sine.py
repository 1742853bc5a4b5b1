# sine: one step by Damped Euler.
#
# System:  Pendulum(omega=2.0, damping=0.1)
# Method:  Damped Euler (damped_euler), order 1, 1 rate evaluation per step
# Stable:  undamped oscillators for omega*dt < 2
# Source:  G. Hoffmann, Simple Integration Algorithms, 2002, §6
# State:   v[1]; y[1]
# Time:    t0 + k*dt at step k, which the state counts
# Written by stepwell VERSION. The numbers are those of stepwell.integrate, to the last bit.
#
# Needs only the standard library.
# m = Sine(dt=...) sets the parameters that are given; call m.prepare() after a change of one.
# s = m.start(velocities, coordinates) is the state at step 0, m.step(s) makes one step.
#
# Example:
#
#     from sine import Sine
#
#     v = [0.0]
#     y = [1.0]
#     m = Sine()
#     s = m.start(v, y)
#     for _ in range(1000):
#         m.step(s)
#     print(s.y[0])

import struct


def bits_of(x):
    return struct.unpack("<Q", struct.pack("<d", x))[0]


def turn_sign(x, y):
    """x, its sign turned if the last bit of y is set."""
    return -x if bits_of(y) & 1 else x


def sine(x):
    """The sine of x."""
    a1 = 0.3183098861837907 * x + 6755399441055744.0
    a2 = a1 - 6755399441055744.0
    a3 = x - 3.1415926534682512 * a2 - 1.2154201013012384e-10 * a2
    a4 = a3 * a3
    a5 = a4 * a4
    a6 = a5 * (a5 * (2.7205082501769597e-15 * a5 + 1.6058937294753282e-10) + 2.75573192107121e-06)
    a7 = a4 * (a5 * (-7.64292781535996e-13 * a5 - 2.505210682744121e-08) - 0.00019841269841207676)
    return turn_sign(a3 + a3 * a4 * (a4 * (a6 + 0.008333333333333196 + a7) - 0.16666666666666666), a1)


class SineState:
    """A state."""

    def __init__(self, v, y):
        self.step = 0  # k; the time is t0 + k*dt
        self.v = v
        self.y = y


class Sine:
    """The description of a step, and the step."""

    def __init__(self, **given):
        self.dt = 0.01  # the step
        self.t0 = 1.5  # the time of step 0
        self.omega = 2.0
        self.damping = 0.1
        for name, value in given.items():
            if name not in vars(self):
                raise TypeError(f"there is no parameter {name}")
            setattr(self, name, value)
        self.prepare()

    def prepare(self):
        """What does not change from step to step. To be called after a change of a parameter."""
        self.c1 = self.omega * self.omega * self.dt
        self.phi = self.dt * self.omega
        self.c2 = 2.0 * self.damping * self.phi

    def start(self, velocities, coordinates):
        """The state at step 0, of velocities and coordinates."""
        if len(velocities) != 1:
            raise ValueError(f"velocities: expected 1 number, got {len(velocities)}")
        velocities = [float(each) for each in velocities]
        if len(coordinates) != 1:
            raise ValueError(f"coordinates: expected 1 number, got {len(coordinates)}")
        coordinates = [float(each) for each in coordinates]
        s = SineState(velocities, coordinates)
        return s

    def step(self, s):
        """One step."""
        # The state.
        v = s.v[0]
        y = s.y[0]

        # What depends on the state.
        next_y = y + self.dt * v
        dv1 = -self.c1 * sine(next_y) - self.c2 * v
        next_v = v + dv1

        # The state after the step.
        s.v[0] = next_v
        s.y[0] = next_y
        s.step += 1
