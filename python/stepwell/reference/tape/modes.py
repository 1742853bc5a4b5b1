"""Derivatives as further operations on the same tape: forwards along directions, backwards from one value, or whole Jacobians.

Derivatives are exact up to rounding: no difference quotients are used. Derivatives known to be zero are not on the tape, and the
tape merges equal operations. The same functions give derivatives of derivatives.

The derivative of a choice is that of the chosen value, even if that of the other one is not finite: forwards by the same choice,
backwards by choosing zero (``_Guard``) for the value that was not chosen. Likewise, where an exponential may overflow, a change
that is infinite makes nothing of a quotient or a function whose factor is zero: 1/(1 + exp x) is constant far from its middle.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from ..._core import Symbol, Tape
from .. import marks as marking
from ..marks import Marks
from .listing import Listing
from .operations import factors
from .rules import of_function


def directional(
    tape: Tape, roots: Sequence[Symbol], along: Iterable[tuple[Symbol, Symbol]], marks: Marks | None = None
) -> list[Symbol]:
    """The derivatives of values in one direction (forward mode; a Jacobian times a vector).

    Args:
        tape: the tape of the values; their derivatives are written to it.
        roots: the values.
        along: the direction: pairs of a symbol of the tape and the symbol of its change.
        marks: the marked functions, as ``reference.marks.recording`` collects them; those that are being recorded if None.

    Returns:
        A symbol for each value.

    Raises:
        UnsupportedError: if a value depends on what changes by an operation that has no derivative.

    Example:
        >>> tape = _core.Tape()
        >>> x, dx = tape.state(0), tape.state(1)
        >>> directional(tape, [x * x], [(x, dx)])  # x·dx + x·dx
    """
    pairs = list(along)
    with marking.recording(_of(marks)) as known:
        listing = Listing(tape, roots, known)
        rows = _forward(listing, {x.id: {0: change} for x, change in pairs})
    return [_or_zero(tape, rows[line].get(0)) for line in listing.roots]


def gradient(tape: Tape, root: Symbol, wrt: Sequence[Symbol], marks: Marks | None = None) -> list[Symbol]:
    """The derivatives of one value with respect to several (reverse mode): a few times the operations of the value.

    Args:
        tape: the tape of the value; its derivatives are written to it.
        root: the value.
        wrt: what it is differentiated with respect to: any symbols of the tape; each is then taken as a number of its own.
        marks: the marked functions, as ``reference.marks.recording`` collects them; those that are being recorded if None.

    Returns:
        A symbol for each of ``wrt``.

    Raises:
        UnsupportedError: if the value depends on one of ``wrt`` by an operation that has no derivative.
    """
    with marking.recording(_of(marks)) as known:
        listing = Listing(tape, [root], known)
        return _backward(listing, listing.roots[0], [each.id for each in wrt])


def jacobian(tape: Tape, roots: Sequence[Symbol], wrt: Sequence[Symbol], marks: Marks | None = None) -> list[list[Symbol]]:
    """The derivatives of several values with respect to several numbers: forwards or backwards, whichever takes fewer operations.

    That is decided by the number of pairs of a line and a number (or a line and a value) that depend on each other.

    Args:
        tape: the tape of the values; the derivatives are written to it.
        roots: the values.
        wrt: what they are differentiated with respect to: any symbols of the tape; each is then taken as a number of its own.
        marks: the marked functions, as ``reference.marks.recording`` collects them; those that are being recorded if None.

    Returns:
        A row for each value, a symbol for each of ``wrt`` in it.

    Raises:
        UnsupportedError: if a value depends on one of ``wrt`` by an operation that has no derivative.
    """
    with marking.recording(_of(marks)) as known:
        listing = Listing(tape, roots, known)
        numbers = [each.id for each in wrt]
        if _backwards_is_shorter(listing, numbers):
            return [_backward(listing, line, numbers) for line in listing.roots]
        one = tape.number(1.0)
        seeds: dict[int, dict[int, Symbol]] = {}
        for j, each in enumerate(numbers):
            seeds.setdefault(each, {})[j] = one
        rows = _forward(listing, seeds)
        return [[_or_zero(tape, rows[line].get(j)) for j in range(len(numbers))] for line in listing.roots]


def _of(marks: Marks | None) -> Marks | None:
    return marking.active() if marks is None else marks


def _or_zero(tape: Tape, value: Symbol | None) -> Symbol:
    return tape.number(0.0) if value is None else value


def _times(factor: Any, change: Any) -> Any:
    """A product, in which a factor may be 1 or −1."""
    if isinstance(factor, float) and abs(factor) == 1.0:
        return change if factor > 0.0 else -change
    return factor * change


def _factors(listing: Listing, line: int, wanted: list[bool]) -> tuple[Any, ...]:
    """The factors by which changes of the operands of a line are multiplied."""
    reads, mark = listing.reads(line)
    if mark is not None:
        return of_function(mark, listing.symbols[line], wanted)
    listing.check(line)
    return factors(listing.operations[line].name, list(reads), listing.symbols[line])


#: Functions that overflow, and the operands of others that saturate: which of them, of all operations that are no functions. All
#: those of functions may, but for these.
_OVERFLOWING, _SATURATING = {"exp", "exp2", "expm1", "sinh", "cosh", "power"}, {"divide": (1,), "multiply": (0, 1)}
_SATURATING |= dict.fromkeys(("log", "log2", "log10", "log1p", "cbrt"), ())


def _saturating(listing: Listing) -> list[Sequence[int]]:
    """The operands of each line with a change that counts only where its factor is not zero."""
    if not any(mark.name in _OVERFLOWING for mark in listing.marks.values()):
        return [()] * len(listing.operations)
    return [
        _SATURATING.get(mark.name, range(len(mark.arguments))) if mark else _SATURATING.get(operation.name, ())
        for mark, operation in zip(map(listing.marks.get, range(len(listing.operations))), listing.operations, strict=True)
    ]


def _makes_nothing(factor: Any, change: Any) -> Any:
    """True where one is zero and the other infinite; None if never. Elsewhere a product with zero has derivatives of its own."""
    if not (isinstance(factor, Symbol) and isinstance(change, Symbol)):
        return None
    product = _times(factor, change)
    return ~product.equals(product) & factor.equals(factor) & change.equals(change)


def _forward(listing: Listing, seeds: dict[int, dict[int, Symbol]]) -> list[dict[int, Symbol]]:
    """Of each line, its derivative in each direction in which it changes; ``seeds`` has those of some symbols by their number."""
    rows: list[dict[int, Symbol]] = []
    saturating = _saturating(listing)
    by_number: dict[int, dict[int, Symbol]] = {}
    for line, symbol in enumerate(listing.symbols):
        if (row := seeds.get(symbol.id)) is None:
            reads = listing.reads(line)[0] if listing.passed[line] else ()
            changes = [by_number.get(each.id, {}) if isinstance(each, Symbol) else {} for each in reads]
            row = {}
            if not any(changes):
                pass
            elif listing.is_choice(line):
                truth = reads[0]
                for k in changes[1] | changes[2]:
                    row[k] = truth.choose(changes[1].get(k, 0.0), changes[2].get(k, 0.0))
            else:
                factors = _factors(listing, line, list(map(bool, changes)))
                for i, (factor, change) in enumerate(zip(factors, changes, strict=True)):
                    if factor is not None:
                        for k, each in change.items():
                            term = _times(factor, each)
                            if i in saturating[line] and (nothing := _makes_nothing(factor, each)) is not None:
                                term = nothing.choose(0.0, term)
                            row[k] = row[k] + term if k in row else term
        rows.append(row)
        by_number[symbol.id] = row
    return rows


class _Guard:
    """Where the derivative of a value is needed: everywhere (``truth`` is None), or where a mask is true."""

    def __init__(self, truth: Any = None) -> None:
        self.truth = truth

    def also(self, truth: Any) -> _Guard:
        """Where this one holds and the mask is true."""
        return _Guard(truth if self.truth is None else self.truth & truth)

    def other(self, guard: _Guard) -> _Guard:
        """Where this or another holds."""
        return _Guard(None if self.truth is None or guard.truth is None else self.truth | guard.truth)

    def where_needed(self, value: Any) -> Any:
        """The value where it is needed, else 0."""
        return value if self.truth is None else self.truth.choose(value, 0.0)


def _backward(listing: Listing, root: int, numbers: list[int]) -> list[Symbol]:
    """The derivatives of one line with respect to the symbols of these numbers."""
    tape = listing.tape
    changing, saturating = _changing(listing, numbers), _saturating(listing)
    adjoints: dict[int, tuple[Any, _Guard]] = {root: (tape.number(1.0), _Guard())}

    def pass_on(to: Any, share: Any, guard: _Guard) -> None:
        line = listing.place[to.id]
        before = adjoints.get(line)
        adjoints[line] = (share, guard) if before is None else (before[0] + share, before[1].other(guard))

    for line in range(root, -1, -1):
        if line not in adjoints or not changing[line] or listing.symbols[line].id in numbers:
            continue
        share, guard = adjoints[line]
        reads = listing.reads(line)[0]
        wanted = [isinstance(each, Symbol) and changing[listing.place[each.id]] for each in reads]
        if listing.is_choice(line):
            truth, yes, no = reads
            if wanted[1]:
                pass_on(yes, truth.choose(share, 0.0), guard.also(truth))
            if wanted[2]:
                pass_on(no, truth.choose(0.0, share), guard.also(~truth))
            continue
        for i, (factor, each) in enumerate(zip(_factors(listing, line, wanted), reads, strict=True)):
            if wanted[i] and factor is not None:
                nothing = _makes_nothing(factor, share) if i in saturating[line] else None
                needed = guard if nothing is None else guard.also(~nothing)
                pass_on(each, needed.where_needed(_times(factor, share)), needed)
    places = [listing.place.get(each) for each in numbers]
    return [_or_zero(tape, adjoints[line][0] if line is not None and line in adjoints else None) for line in places]


def _changing(listing: Listing, numbers: list[int]) -> list[bool]:
    """Of each line, whether it depends on one of the symbols of these numbers; masks do not matter."""
    return [bool(each) for each in _depends(listing, dict.fromkeys(numbers, 1))]


def _depends(listing: Listing, bits: dict[int, int]) -> list[int]:
    """Of each line, the bits of the symbols that it changes with."""
    depends: list[int] = []
    for line, symbol in enumerate(listing.symbols):
        own = bits.get(symbol.id)
        if own is None:
            own = 0
            for each in listing.reads(line)[0][listing.is_choice(line) :] if listing.passed[line] else ():
                if isinstance(each, Symbol):
                    own |= depends[listing.place[each.id]]
        depends.append(own)
    return depends


def _backwards_is_shorter(listing: Listing, numbers: list[int]) -> bool:
    """True if the reverse mode takes fewer products than the forward mode."""
    bits: dict[int, int] = {}
    for j, each in enumerate(numbers):
        bits[each] = bits.get(each, 0) | (1 << j)
    depends = _depends(listing, bits)
    needed = [0] * len(listing.symbols)  # of each line, the bits of the values that need it
    for i, root in enumerate(listing.roots):
        needed[root] |= 1 << i
    forward = backward = 0
    for line in range(len(listing.symbols) - 1, -1, -1):
        if not depends[line] or listing.symbols[line].id in bits:
            continue
        for each in listing.reads(line)[0][listing.is_choice(line) :]:
            if isinstance(each, Symbol) and depends[place := listing.place[each.id]]:
                needed[place] |= needed[line]
                forward += depends[place].bit_count()
                backward += needed[line].bit_count()
    return backward < forward
