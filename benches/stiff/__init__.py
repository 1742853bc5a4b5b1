"""Stiff systems: time against achieved error by stepwell, LSODA, Radau, CVODE, diffrax and pydiffsol, in batches and alone.

``problems`` has the equations and their truth, ``contestants`` the programs, ``measuring`` the tolerances that are compared and
the times, ``page`` the tables and the picture.
"""
