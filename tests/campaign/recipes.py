"""Strange values as recipes: lists of words and numbers that a file can hold, and from which a value is made anew for each call.

A recipe is either whole (a number, an array of some type and layout, an object) or says what is changed in the right value.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st
from support.wrong_calls import CALLS, JUNK

#: A list whose first element says what it is.
Recipe = list[Any]

DTYPES = ("f8", "f4", "f2", "g", "i1", "i4", "i8", "u1", "u8", "?", "c16", "O", "U4", "S3", "M8[D]", "m8[s]", ">f8", ">i4", "V8")

#: Numbers at the edges of what a float, a square of it, or a whole number of so many bits can hold.
EDGES = (
    *(0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 3.0, 1e-3, 1e3, np.pi, 1e6, 1e15),
    *(np.nan, np.inf, -np.inf, 5e-324, -5e-324, 2.3e-308, 1.7e308, -1.7e308, 1.5e154, 1e-160, 1e100, -1e100, 1e300),
    *(2.0**31, 2.0**52, 2.0**53, 2.0**63, 2.0**64, -(2.0**63), 1.0 + 2.0**-52, 1.0 - 2.0**-53),
)

SHAPES = ((), (1,), (2,), (3,), (1, 1), (2, 3), (3, 2), (3, 1), (1, 3), (0,), (2, 0), (2, 3, 2), (7,), (4, 4), (1, 1, 1, 3))

WORDS = (
    *("", " ", "rk4", "RK 4", "verlet", "taylor", "direct", "matrix", "rust", "numpy", "energy", "limited", "printed"),
    *("first_order", "second_order", "scaling", "spring", "safe", "euler", "quaternion", "nan", "1e400", "\x00", "é", "\ud800"),
    *("../x", "/", "a\nb", "%s", "{0}", "__class__", "x" * 3000),
)


class Other(np.ndarray[Any, Any]):
    """An array of one's own class."""


def _misaligned(array: Any) -> Any:
    if array.dtype.kind == "O":
        return array
    return np.frombuffer(b"x" + array.tobytes(), array.dtype, offset=1).reshape(array.shape)


def _one_number_wide(array: Any) -> Any:
    return np.broadcast_to(array.reshape(-1)[:1].reshape(()), array.shape) if array.size else array


def _read_only(array: Any) -> Any:
    array = array.copy()
    array.flags.writeable = False
    return array


#: How an array lies in memory, and what else may hold its numbers.
LAYOUTS: dict[str, Callable[[Any], Any]] = {
    "plain": lambda array: array,
    "columns first": np.asfortranarray,
    "backwards": lambda array: array[..., ::-1].copy()[..., ::-1] if array.ndim else array,
    "every other": lambda array: np.repeat(array, 2, axis=-1)[..., ::2] if array.ndim else array,
    "misaligned": _misaligned,
    "read-only": _read_only,
    "one number wide": _one_number_wide,
    "of another class": lambda array: array.copy().view(Other),
    "masked": lambda array: np.ma.masked_array(array, mask=np.arange(array.size).reshape(array.shape) % 2),
    "seen as memory": lambda array: memoryview(np.ascontiguousarray(array)),
    "lists": lambda array: array.tolist(),
    "tuples": lambda array: tuple(array.tolist()) if array.ndim else array.tolist(),
    "scalar": lambda array: array.reshape(-1)[0] if array.size else array,
}

#: What is done to a right value.
CHANGES: dict[str, Callable[..., Any]] = {
    "as it is": lambda right: right,
    "of type": lambda right, dtype: np.asarray(right).astype(dtype),
    "laid out": lambda right, layout: LAYOUTS[layout](np.array(right)),
    "with a number": lambda right, at, text: _with(right, at, number(text)),
    "times": lambda right, text: right * number(text),
    "batch axis": lambda right, n: np.repeat(np.asarray(right)[..., np.newaxis], n, axis=-1),
    "first axis": lambda right, n: np.repeat(np.asarray(right)[np.newaxis], n, axis=0),
    "twice": lambda right: right | right if isinstance(right, dict) else right + right,
    "a part": lambda right: right[:-1],
    "turned": lambda right: np.asarray(right).T,
    "in a list": lambda right: [right],
    "in an array": lambda right: np.array(right, dtype=object),
    "and None": lambda right: [*right, None],
    "without it": lambda right: None,
    "a text of it": str,
    "in capitals": lambda right: right.upper(),
    "negative": lambda right: -right,
    "not": lambda right: not right,
}


def _with(right: Any, at: int, number: float) -> Any:
    array = np.array(right, dtype=float)
    array.reshape(-1)[at % max(array.size, 1)] = number
    return array


def number(text: str) -> float:
    """A float from its hexadecimal text."""
    return float.fromhex(text)


def build(recipe: Recipe, right: Any) -> Any:
    """The value that a recipe makes, where the right one would be this."""
    kind, *rest = recipe
    match kind:
        case "float":
            return number(rest[0])
        case "int":
            return int(rest[0], 16)
        case "word":
            return rest[0].encode("utf-8", "surrogatepass").decode("utf-8", "surrogatepass")
        case "junk":
            return JUNK[rest[0]]()
        case "right for":
            return CALLS[rest[0]][1][rest[1]]
        case "array":
            return array_of(*rest)
        case "list":
            return [build(each, right) for each in rest]
        case "tuple":
            return tuple(build(each, right) for each in rest)
        case "dict":
            return {_key(build(key, right)): build(each, right) for key, each in rest}
        case "changed":
            try:
                return CHANGES[rest[0]](right, *rest[1:])
            except Exception:  # it cannot be done to such a value
                return [right]
    raise ValueError(f"no recipe: {recipe}")


def _key(value: Any) -> Any:
    try:
        hash(value)
    except TypeError:
        return str(type(value))
    return value


def array_of(dtype: str, shape: list[int], numbers: list[str], layout: str) -> Any:
    """An array whose numbers repeat these."""
    values = np.resize(np.array([number(each) for each in numbers]), shape)
    with np.errstate(all="ignore"):
        try:
            array = values.astype(dtype)
        except (TypeError, ValueError):  # no dates of a float, no bytes of it
            array = np.zeros(shape, dtype)
    try:
        return LAYOUTS[layout](array)
    except (TypeError, ValueError):  # no memory of dates
        return array


def texts() -> st.SearchStrategy[str]:
    """Floats as hexadecimal texts, the edges among them."""
    return st.one_of(st.sampled_from(EDGES), st.floats(), st.floats(0.0, 4.0)).map(lambda x: float(x).hex())


def wholes() -> st.SearchStrategy[Recipe]:
    """Whole numbers, from those of one bit to those of many."""
    powers = st.integers(0, 70).flatmap(lambda bits: st.sampled_from([2**bits, 2**bits - 1, -(2**bits), 2**bits + 1]))
    return st.one_of(st.integers(-3, 20), powers).map(lambda n: ["int", hex(n)])


def arrays() -> st.SearchStrategy[Recipe]:
    """Arrays of every type, of odd shapes and layouts."""
    dtypes = st.one_of(st.just("f8"), st.sampled_from(DTYPES))
    numbers = st.lists(texts(), min_size=1, max_size=4)
    shapes = st.sampled_from(SHAPES).map(list)
    return st.tuples(dtypes, shapes, numbers, st.sampled_from(list(LAYOUTS))).map(lambda parts: ["array", *parts])


def changes() -> st.SearchStrategy[Recipe]:
    """What is done to a right value: most wrong values are nearly right ones."""
    plain = [
        name for name in CHANGES if name not in ("of type", "laid out", "with a number", "times", "batch axis", "first axis")
    ]
    return st.one_of(
        st.sampled_from(plain).map(lambda name: ["changed", name]),
        st.sampled_from(DTYPES).map(lambda dtype: ["changed", "of type", dtype]),
        st.sampled_from(list(LAYOUTS)).map(lambda layout: ["changed", "laid out", layout]),
        st.tuples(st.integers(0, 20), texts()).map(lambda parts: ["changed", "with a number", *parts]),
        texts().map(lambda text: ["changed", "times", text]),
        st.tuples(st.sampled_from(["batch axis", "first axis"]), st.integers(0, 4)).map(lambda parts: ["changed", *parts]),
    )


def others() -> st.SearchStrategy[Recipe]:
    """What is right for another argument, of this call or of another."""
    pairs = [(name, argument) for name, (_, arguments) in CALLS.items() for argument in arguments]
    return st.sampled_from(pairs).map(lambda pair: ["right for", *pair])


def recipes() -> st.SearchStrategy[Recipe]:
    """Recipes of every kind, half of them nearly right values."""
    words = st.one_of(st.sampled_from(WORDS), st.text(max_size=8)).map(lambda text: ["word", text])
    floats = texts().map(lambda text: ["float", text])
    junk = st.sampled_from([name for name in JUNK if name not in ("10**5000", "a long word")]).map(lambda name: ["junk", name])
    leaves = st.one_of(floats, wholes(), words, junk)
    several = st.tuples(st.sampled_from(["list", "tuple"]), st.lists(leaves, max_size=3)).map(lambda parts: [parts[0], *parts[1]])
    mapped = st.lists(st.tuples(words, leaves).map(list), max_size=2).map(lambda pairs: ["dict", *pairs])
    return st.one_of(changes(), changes(), arrays(), floats, wholes(), words, junk, several, mapped, others())


def shown(value: Any) -> str:
    """A value in a few words, for a report."""
    try:
        text = repr(value)
    except Exception as error:
        text = f"<{type(value).__name__} without a text: {error}>"
    return text if len(text) < 200 else text[:197] + "…"
