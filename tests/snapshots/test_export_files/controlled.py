# controlled: one step by False Euler.
#
# System:  NBody(masses=[1.0, 2.0], force='logarithmic', G=1.0, EnergyControl(gain=0.3, form='limited'))
# Method:  False Euler (false_euler), order 1, 1 rate evaluation per step
# Stable:  undamped oscillators for omega*dt < 2
# Source:  A. Cromer, Stable solutions using the Euler approximation, Am. J. Phys. 49 (1981) 455
# State:   v[4], number i, j of the block of shape (2, 2) at v[2*i + j]; y[4], number i, j of the block of shape (2, 2) at y[2*i + j]
# Time:    t0 + k*dt at step k, which the state counts
# Written by stepwell VERSION. The numbers are those of stepwell.integrate(..., dtype="float32"), to the last bit.
#
# Needs NumPy, which has numbers of float32.
# m = Controlled(dt=...) sets the parameters that are given; call m.prepare() after a change of one.
# s = m.start(velocities, coordinates) is the state at step 0, m.step(s, force) makes one step.
# m.work(s) is the energy that the control has given since the start.
#
# Example:
#
#     from controlled import Controlled
#
#     v = [1.0, 0.0, 0.0, 1.0]
#     y = [1.0, 0.0, -0.5, 0.0]
#     force = [0.0, 0.0, 0.0, 0.0]
#     m = Controlled()
#     s = m.start(v, y)
#     for _ in range(1000):
#         m.step(s, force)
#     print(s.y[0])

import numpy


float32 = numpy.float32


def single(x):
    """Numbers rounded to float32."""
    return [single(each) for each in x] if isinstance(x, (list, tuple)) else float32(x)


def bits_of(x):
    return int(x.view(numpy.uint32))


def number_of(b):
    return numpy.uint32(b).view(float32)


def and_bits(a, b):
    return a & b


def or_bits(a, b):
    return a | b


def add_bits(a, b):
    return (a + b) & 0xFFFFFFFF


def shift_down(a, n):
    return a >> n


def logarithm(x):
    """The logarithm of x."""
    a1 = add_bits(bits_of(x), 0x4afc00)
    a2 = number_of(or_bits(shift_down(a1, 23), 0x4b000000)) - float32(8388735.0)
    a3 = number_of(add_bits(and_bits(a1, 0x7fffff), 0x3f350400)) - float32(1.0)
    a4 = a3 / (a3 + float32(2.0))
    a5 = a4 * a4
    a6 = a5 * (float32(0.2427894026041031) * a5 + float32(0.2849878966808319))
    a7 = float32(0.5) * a3 * a3
    a8 = a4 * (a5 * (a5 * (a6 + float32(0.40000972151756287)) + float32(0.6666666269302368)) + a7)
    return float32(0.693145751953125) * a2 - (a7 - (a8 + float32(1.428606765330187e-06) * a2) - a3)


class ControlledState:
    """A state."""

    def __init__(self, v, y):
        self.step = 0  # k; the time is t0 + k*dt
        self.v = v
        self.y = y
        self.tally = float32(0.0)  # what the control has added up


class Controlled:
    """The description of a step, and the step."""

    def __init__(self, **given):
        self.dt = float32(0.009999999776482582)  # the step
        self.t0 = 0.0  # the time of step 0
        self.masses = [float32(1.0), float32(2.0)]
        self.Gm = [float32(1.0), float32(2.0)]
        self.softening = float32(0.0)
        self.control_gain = float32(0.30000001192092896)  # control.gain
        self.control_target = float32(2.3109302520751953)  # control.target
        for name, value in given.items():
            if name not in vars(self):
                raise TypeError(f"there is no parameter {name}")
            setattr(self, name, value)
        self.prepare()

    @numpy.errstate(all="ignore")
    def prepare(self):
        """What does not change from step to step. To be called after a change of a parameter."""
        self.dt = single(self.dt)
        self.masses = single(self.masses)
        self.Gm = single(self.Gm)
        self.softening = single(self.softening)
        self.control_gain = single(self.control_gain)
        self.control_target = single(self.control_target)
        self.c1 = self.dt * self.Gm[0]
        self.c2 = self.dt * self.Gm[1]
        self.c3 = self.softening * self.softening
        self.c4 = float32(0.5) * self.dt
        self.c5 = self.masses[0] * self.c4
        self.c6 = self.masses[1] * self.c4
        self.c7 = self.dt * self.control_target
        self.c8 = float32(0.0) * self.masses[1]
        self.c9 = float32(2.0) * self.control_gain

    @numpy.errstate(all="ignore")
    def start(self, velocities, coordinates):
        """The state at step 0, of velocities and coordinates."""
        if len(velocities) != 4:
            raise ValueError(f"velocities: expected 4 numbers, got {len(velocities)}")
        velocities = [float32(each) for each in velocities]
        if len(coordinates) != 4:
            raise ValueError(f"coordinates: expected 4 numbers, got {len(coordinates)}")
        coordinates = [float32(each) for each in coordinates]
        s = ControlledState(velocities, coordinates)
        return s

    @numpy.errstate(all="ignore")
    def step(self, s, force):
        """One step."""
        # The state.
        v_0_0 = s.v[0]
        v_0_1 = s.v[1]
        v_1_0 = s.v[2]
        v_1_1 = s.v[3]
        y_0_0 = s.y[0]
        y_0_1 = s.y[1]
        y_1_0 = s.y[2]
        y_1_1 = s.y[3]
        tally = s.tally

        # The force.
        force_0_0 = float32(force[0])
        force_0_1 = float32(force[1])
        force_1_0 = float32(force[2])
        force_1_1 = float32(force[3])

        # What depends on the state.
        a1 = y_1_0 - y_0_0
        a2 = y_1_1 - y_0_1
        a3 = a1 * a1 + a2 * a2 + self.c3
        a4 = float32(1.0) / a3
        a5 = self.c2 * a4
        a6 = self.c1 * a4
        a7 = self.c5 * (v_0_0 * v_0_0 + v_0_1 * v_0_1) + self.c6 * (v_1_0 * v_1_0 + v_1_1 * v_1_1)
        a8 = self.masses[0] * (float32(0.0) + self.c2 * (float32(0.5) * logarithm(a3) + a4 * (a3 - a3)))
        a9 = float32(1.0) - self.c9 * (a7 + (a8 + self.c8) - self.c7) / (float32(1.0) + self.c9 * a7)
        a10 = float32(0.25) if a9 < float32(0.25) else a9
        a11 = float32(1.0) - numpy.sqrt(float32(4.0) if float32(4.0) < a10 else a10)
        next_tally = tally - a11 * (float32(2.0) - a11) * a7
        dv1_0_0 = a1 * a5 + float32(0.0) - v_0_0 * a11 + self.dt * force_0_0
        dv1_0_1 = a2 * a5 + float32(0.0) - v_0_1 * a11 + self.dt * force_0_1
        dv1_1_0 = -a1 * a6 - v_1_0 * a11 + self.dt * force_1_0
        dv1_1_1 = -a2 * a6 - v_1_1 * a11 + self.dt * force_1_1
        next_v_0_0 = v_0_0 + dv1_0_0
        next_v_0_1 = v_0_1 + dv1_0_1
        next_v_1_0 = v_1_0 + dv1_1_0
        next_v_1_1 = v_1_1 + dv1_1_1
        dy1_0_0 = self.dt * next_v_0_0
        dy1_0_1 = self.dt * next_v_0_1
        dy1_1_0 = self.dt * next_v_1_0
        dy1_1_1 = self.dt * next_v_1_1
        next_y_0_0 = y_0_0 + dy1_0_0
        next_y_0_1 = y_0_1 + dy1_0_1
        next_y_1_0 = y_1_0 + dy1_1_0
        next_y_1_1 = y_1_1 + dy1_1_1

        # The state after the step.
        s.v[0] = next_v_0_0
        s.v[1] = next_v_0_1
        s.v[2] = next_v_1_0
        s.v[3] = next_v_1_1
        s.y[0] = next_y_0_0
        s.y[1] = next_y_0_1
        s.y[2] = next_y_1_0
        s.y[3] = next_y_1_1
        s.tally = next_tally
        s.step += 1

    def work(self, s):
        """The energy that the control has given since the start."""
        return float(s.tally) / (1 * float(self.dt))
