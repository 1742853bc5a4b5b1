"""Adaptive steps at equal errors: one orbit, and ten thousand, by stepwell, numba, SciPy and heyoka.

Each contestant goes over the same orbits with tolerances from coarse to fine. Compared is the time that it takes to be as exact
as asked, between the two tolerances that enclose that error, on logarithmic scales.

``orbits`` has the problems, ``contestants`` the programs, ``tables`` the measurement. ``solar`` is a long run at rounding level.
"""
