"""Your own equations: a function in NumPy style becomes a system.

| file | contents |
|---|---|
| ``definition.py`` | ``stepwell.system``, and the definition that it returns |
| ``trace.py`` | running the function, with symbols or with the numbers of a batch |
| ``values.py`` | its arguments: scalars, arrays, comparisons |
| ``arrays.py`` | NumPy's functions for these |
| ``namespace.py`` | the names ``np`` and ``math`` within the function |

The system itself is ``model/systems/own.py``, its rates in the reference are ``reference/systems/equations.py``.
"""

from .definition import Definition, system


def functions() -> list[str]:
    """The names of NumPy's functions that own equations may use; ``np.linalg.norm`` is ``norm`` here."""
    from .arrays import names

    return names()


__all__ = ["Definition", "functions", "system"]
