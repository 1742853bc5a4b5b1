"""Your own equations: a function in NumPy style becomes a system.

| file | what it is |
|---|---|
| ``definition.py`` | ``stepwell.system``, and what it makes of a function |
| ``trace.py`` | runs the function, with symbols or with the numbers of a batch |
| ``values.py`` | what it is run with: scalars, arrays, comparisons |
| ``arrays.py`` | what NumPy's functions mean to these |
| ``namespace.py`` | what the names ``np`` and ``math`` mean within the function |

The system itself is ``systems/own.py``, its rates in the reference are ``reference/systems/equations.py``.
"""

from .definition import Definition, system


def functions() -> list[str]:
    """The names of NumPy's functions that own equations may use; ``np.linalg.norm`` is ``norm`` here."""
    from .arrays import names

    return names()


__all__ = ["Definition", "functions", "system"]
