"""Own equations: what ``stepwell.system`` makes of a function, beside programs that compile equations, too.

``equations`` has the equations, ``blocked`` the steps that numba compiles, ``tolerance`` what is done for those that choose their
own steps, ``first_call`` how long tracing and compiling take.
"""
