"""Objects that are compared by value, although ``==`` of arrays is an array, and objects that cannot be changed."""

from __future__ import annotations

import copy
import dataclasses
from abc import ABCMeta
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ..errors import DTypeError, FixedError
from .reprs import one_line

Kind = TypeVar("Kind")
Object = TypeVar("Object")

#: The attribute that an object has once it is made and cannot be changed any more.
DONE = "_done"

#: Before an array of more bytes than this is copied, it is checked that the copy fits in memory.
LARGE = 1 << 24


class ValueEquality:
    """Equal to another object of its class if all attributes are equal, arrays number by number; NaN equals NaN.

    A class without a repr of its own has one of one line; that of a dataclass would print all of its arrays.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        """Set the repr before ``dataclass`` would."""
        super().__init_subclass__(**options)
        if cls.__repr__ is object.__repr__:
            cls.__repr__ = one_line  # type: ignore[method-assign]

    def _contents(self) -> dict[str, Any]:
        """The compared values by name: the fields of a dataclass, without values that it cached, or else all attributes."""
        if dataclasses.is_dataclass(self):
            return {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.compare}
        return {name: value for name, value in vars(self).items() if name != DONE}

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return same(self._contents(), other._contents())

    def __hash__(self) -> int:
        # Arrays cannot be hashed; strings and whole numbers distinguish most objects.
        return hash((type(self), *(each for each in self._contents().values() if isinstance(each, (str, int)))))


def by_value(kind: type[Kind]) -> type[Kind]:
    """Give a named tuple equality by value; its own ``==`` and ``!=`` would take the truth value of arrays."""

    def equal(self: Any, other: Any) -> bool:
        return bool(type(other) is kind) and same(tuple(self), tuple(other))

    def unequal(self: Any, other: Any) -> bool:
        return not equal(self, other)

    def digest(self: Any) -> int:
        return hash((kind, *(each for each in self if isinstance(each, (str, int)))))

    methods = {"__eq__": equal, "__ne__": unequal, "__hash__": digest}
    for name, method in methods.items():
        setattr(kind, name, method)
    if kind.__repr__.__module__ == "collections":  # that of any named tuple, which prints all of its arrays
        kind.__repr__ = one_line  # type: ignore[method-assign]
    return kind


def same(a: Any, b: Any) -> bool:
    """True if two values are equal: arrays by shape, dtype and numbers, containers element by element."""
    if a is b:
        return True
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        if type(a) is not type(b) or a.dtype != b.dtype or a.shape != b.shape:
            return False
        return bool(((a == b) | ((a != a) & (b != b))).all())
    if isinstance(a, float) and isinstance(b, float):
        return a == b or (a != a and b != b)
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)) and type(a) is type(b):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b)


def takes(kind: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
    """Raise if a class cannot be called with these arguments; the message shows its signature."""
    import inspect

    signature = inspect.signature(kind)
    try:
        signature.bind(*args, **kwargs)
    except TypeError as error:
        bare = [each.replace(annotation=inspect.Parameter.empty) for each in signature.parameters.values()]
        raise DTypeError(f"{kind.__name__}: {error}; expected {kind.__name__}{inspect.Signature(bare)}") from None


class ImmutableMeta(ABCMeta):
    """Makes objects that cannot be changed once ``__init__`` is over."""

    if not TYPE_CHECKING:  # a type checker takes the arguments from ``__init__``

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:
            """A new object, whose arrays are read-only and its own."""
            try:
                instance = super().__call__(*args, **kwargs)
            except TypeError:
                takes(cls, args, kwargs)
                raise
            attributes = vars(instance)
            if DONE not in attributes:  # whose ``__init__`` leaves that to be done
                read_only(attributes)
                attributes[DONE] = True
            return instance

        # ``ABCMeta``'s takes four times as long, because it looks for registered classes; there are none.
        __instancecheck__ = type.__instancecheck__

    @property
    def __signature__(cls) -> Any:
        """The signature of ``__init__``, for ``help`` and ``inspect``."""
        import inspect  # slow to import

        init: Any = cls.__init__  # type: ignore[misc]
        if init is object.__init__:
            return inspect.Signature()
        whole = inspect.signature(init)
        return whole.replace(parameters=list(whole.parameters.values())[1:])


class Immutable(metaclass=ImmutableMeta):
    """An object that cannot be changed, since objects made from it would not see the change.

    Attributes cannot be assigned, except those that begin with ``_``. Its arrays are read-only copies of the arguments, so the
    caller may write into the originals. ``changed`` makes another object.
    """

    def __setattr__(self, name: str, value: object) -> None:
        attributes = self.__dict__
        if DONE in attributes:  # most attributes are set before, in ``__init__``
            self._refuse(name, "assigned")
        attributes[name] = value  # ``object.__setattr__`` does the same here and takes longer than all else

    def __delattr__(self, name: str) -> None:
        self._refuse(name, "deleted")
        object.__delattr__(self, name)

    def _refuse(self, name: str, what: str) -> None:
        if not name.startswith("_") and DONE in vars(self):
            kind = getattr(self, "kind_name", type(self).__name__)
            raise FixedError(f"{name}: the {name} of {kind} cannot be {what}; {self._instead}")

    @property
    def _instead(self) -> str:
        return f"make another {type(self).__name__}, with what is to change"

    def __setstate__(self, state: dict[str, Any]) -> None:
        """After a copy or a pickle, whose arrays may be new."""
        aligned(state)
        vars(self).update(state)
        read_only(vars(self))


#: The ``__getstate__`` of classes that define none of their own; it does not exist before Python 3.11.
_STATE = getattr(object, "__getstate__", None)


def changed(one: Object, **changes: Any) -> Object:
    """A copy of an object that cannot be changed, with other attributes."""
    kind: Any = type(one)
    other: Any
    if issubclass(kind, Immutable):
        other = object.__new__(kind)  # as ``copy.copy`` makes it, which takes ten times as long
        vars(other).update(vars(one) if getattr(kind, "__getstate__", None) is _STATE else one.__getstate__())
    else:
        other = copy.copy(one)
    complete(other, **changes)
    result: Object = other
    return result


def complete(one: Any, **attributes: Any) -> None:
    """Set attributes of an object that was just made and cannot be changed otherwise."""
    read_only(attributes)
    vars(one).update(attributes)


def aligned(attributes: dict[str, Any]) -> None:
    """Copy arrays that are not aligned in memory, as those of a message from another process may be (pickle protocol 5)."""
    for name, value in attributes.items():
        if isinstance(value, np.ndarray) and not value.flags.aligned:
            attributes[name] = value.copy()


def read_only(attributes: dict[str, Any]) -> None:
    """Replace arrays by ones that no other code can write to, and dictionaries by ones that cannot be changed."""
    for name, value in attributes.items():
        if isinstance(value, np.ndarray):
            attributes[name] = frozen(name, value)
        elif type(value) is dict and not name.startswith("_"):
            attributes[name] = FixedDict(value)


def frozen(name: str, array: Any) -> Any:
    """An array that no other code can write to: itself if it is read-only and owns its numbers, or else a read-only copy.

    A read-only view does not suffice, because its base may still be written to.
    """
    if not array.flags.writeable:
        if array.base is None:
            return array
        owner = array
        while isinstance(owner.base, np.ndarray):
            owner = owner.base
        if not owner.flags.writeable and (owner.base is None or type(owner.base) is bytes):
            return array
    if array.nbytes > LARGE and 0 not in array.strides:
        from .checks import fits  # which needs this module

        fits(f"{name}: copies", array.nbytes / 8, (), "an array that is read-only and owns its memory is not copied")
    if not array.size or 0 not in array.strides:
        copied = array.copy()
        copied.flags.writeable = False
        return copied
    # A broadcast array is copied once, and broadcast again.
    once = array[tuple(slice(None) if stride else slice(1) for stride in array.strides)].copy()
    once.flags.writeable = False
    return np.broadcast_to(once, array.shape)


class FixedDict(dict[str, Any]):
    """A dictionary that cannot be changed, and whose arrays are read-only."""

    def __init__(self, items: dict[str, Any]) -> None:
        super().__init__(items)
        for name, value in items.items():
            if isinstance(value, np.ndarray):
                dict.__setitem__(self, name, frozen(name, value if value.flags.aligned else value.copy()))
            elif type(value) is dict and not name.startswith("_"):
                dict.__setitem__(self, name, FixedDict(value))

    @classmethod
    def of_fixed(cls, items: dict[str, Any]) -> FixedDict:
        """One of items that are read-only already."""
        fixed = cls.__new__(cls)
        dict.update(fixed, items)
        return fixed

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise FixedError("parameters: those of a system cannot be assigned; make another system, with what is to change")

    __setitem__ = __delitem__ = __ior__ = update = pop = popitem = clear = setdefault = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return FixedDict, (dict(self),)
