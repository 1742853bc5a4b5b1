"""Systems of users' own equations."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from math import isfinite, prod
from typing import Any, Self

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Array, Shape
from ...base.immutable import DONE, FixedDict, changed, complete, frozen
from ...errors import ShapeError, TraceError, UnsupportedError
from ...reference.around import Bound
from ...reference.marks import Marks, recording
from ...reference.mass import Mass
from ...reference.systems.equations import Equations as Reference
from ...reference.traced import Tracer
from ..around import OwnFriction
from ..controls import WAYS, AnyControl, ConstraintControl, Control, EnergyControl, Projection
from ..equations.definition import Definition, fits
from ..equations.friction import Friction
from ..equations.recognised import Unknown, identity
from ..equations.series import derivatives_of_functions
from ..equations.trace import Equations
from ..inputs import Input, Sampled, Sinusoid
from ..parameters import CoreParameters, aligned, flat
from .base import TINY, System, shown

#: The name of the function among those of parameters; no parameter can have it.
RATES = "equations()"
#: Attributes that cache results of the others.
DERIVED = ("_core", "_single", "_with_functions", "_digest", "_bounds", "_met")
#: The most shapes of states that a system caches.
MOST_SHAPES = 256
#: A cache of the operations of traced functions, and its most entries.
_TRACED: dict[Any, Any] = {}
#: Operations with the derivatives of their functions, by those without, which are kept so that no others get their place.
_WITH_FUNCTIONS: dict[int, tuple[Any, Any]] = {}
MOST_TRACED = 256
#: Without a state, the shapes that are tried: a number, and vectors up to this length.
LONGEST_GUESS = 32
SHORTEST: tuple[Shape, ...] = ((), *((n,) for n in range(1, LONGEST_GUESS + 1)))


class OwnSystem(System):
    """A system of your own equations: calling a function that is decorated by ``stepwell.system`` returns one."""

    kernel = "equations"
    #: The operations, and their digest.
    _digest: tuple[Any, str] | None = None
    reference = Reference
    #: The control that keeps an invariant as a part of the rates, or None.
    push: Control | None = None
    definition: Definition
    parameters_given: dict[str, Any]
    equations: Equations | None
    #: The operations of the function, and those in float32; and the operations with the derivatives of functions, for series.
    _core: Any
    _single: dict[bool, Any]
    _with_functions: tuple[Any, Any] | None
    #: This system for blocks of these shapes, and for states of these shapes, which may have batch axes.
    _bounds: dict[tuple[Shape, Shape], OwnSystem]
    _met: dict[tuple[Shape | None, Shape | None], OwnSystem]

    def __init__(self, definition: Definition, parameters: dict[str, Any]) -> None:
        checked: dict[str, Any] = {}
        batches: dict[str, Shape] = {}
        for name, value in parameters.items():
            own = definition.own_axes[name]
            if type(value) is float and isfinite(value) and not own:  # the most frequent case
                number = np.array(value)
                number.flags.writeable = False
                checked[name] = number
                continue
            argument = f"{definition.name}: {name}"
            value, batches[argument] = _checked(argument, value, own)
            checked[name] = frozen(name, value) if isinstance(value, np.ndarray) else value
        # All at once, and read-only already: systems are made in loops, where assignments and checks would take most of the time.
        vars(self).update(
            definition=definition,
            parameters_given=FixedDict.of_fixed(checked),
            batch=checks.batch_shape(batches) if batches else (),
            second_order=definition.order == 2 and definition.blocks == 1,
            equations=None,
            _core=None,
            _single={},
            _with_functions=None,
            _bounds={},
            _met={},
        )
        if definition.stick_friction is not None:
            self.around = (OwnFriction(definition),)
        if type(self) is OwnSystem:  # others have more attributes to set
            vars(self)[DONE] = True

    @property
    def keeper(self) -> AnyControl | None:
        """The control, which is a part of the rates, or the projection, which is around them."""
        return self.push if self.push is not None else self.control

    @property
    def mass_matrix(self) -> Mass | None:  # type: ignore[override]  # of other systems it is always None
        """The mass matrix, if equations are algebraic."""
        equations = self._known().equations
        return None if equations is None else equations.mass_matrix

    @property
    def kind_name(self) -> str:
        """The name of the function."""
        return self.definition.name

    def repr_arguments(self) -> list[str]:
        """The parameters."""
        return shown(**self.parameters_given)

    def __repr__(self) -> str:
        controls = [repr(each) for each in (self.control, self.push) if each is not None]
        return f"{self.definition.name}({', '.join([*self._all_arguments(), *controls])})"

    def _contents(self) -> dict[str, Any]:
        return {name: value for name, value in super()._contents().items() if name not in DERIVED}

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_core": None, "_single": {}, "_with_functions": None, "_digest": None, "_bounds": {}, "_met": {}}

    def __deepcopy__(self, memo: Any) -> OwnSystem:
        own = {name: copy.deepcopy(vars(self)[name], memo) for name in ("parameters_given", "around") if name in vars(self)}
        return changed(self, **own, _bounds={}, _met={})

    def own_axes(self, name: str) -> int:
        """How many axes of its own a parameter has."""
        return self.definition.own_axes[name]

    def arguments(self) -> dict[str, Any]:
        """Its parameters."""
        return dict(self.parameters_given)

    def operations(self) -> dict[str, Any]:
        """Its operations, and the caches of them."""
        if self._core is None and self.equations is not None:
            self._trace()
        caches = {name: vars(self).get(name) for name in ("_core", "_with_functions", "_digest")}
        return caches | {"_single": self._single, "_bounds": {}, "_met": {}}

    def with_arguments(self, arguments: dict[str, Any]) -> OwnSystem:
        """This system with other numbers or inputs in place of some parameters."""
        known = self._retraced()
        fresh = known._fresh(arguments)
        for name in arguments:
            if known._kind_of(name, fresh[name]) != known._kind_of(name, known.parameters_given[name]):
                raise UnsupportedError(
                    f"{name}: expected a parameter of the kind and the axes of its own that the operations are for, got "
                    f"{checks.short(fresh[name])}; make another World that goes on from here, World(system, method, resume=world)"
                )
        batches = {name: _batch_of(value, known.own_axes(name)) for name, value in fresh.items()}
        batches |= {"control": () if known.keeper is None else known.keeper.batch}
        batches |= {part.kind: part.batch for part in known.around}
        own = {} if known._free is None else {"_free": known._free.with_arguments(arguments)}
        return changed(known, **known.operations(), parameters_given=fresh, batch=checks.batch_shape(batches), **own)

    def _fresh(self, arguments: dict[str, Any]) -> dict[str, Any]:
        """All parameters, with these in place of some, checked."""
        name, own = self.definition.name, self.definition.own_axes
        checked = {each: _checked(f"{name}: {each}", value, own[each])[0] for each, value in arguments.items()}
        return {each: checked.get(each, value) for each, value in self.parameters_given.items()}

    def direct(self) -> dict[str, tuple[str, float]]:
        """All parameters that are numbers."""
        return {name: (name, checks.ANY) for name, value in self.parameters_given.items() if isinstance(value, np.ndarray)}

    # ---- shapes

    def for_state_shapes(self, *states: Any) -> OwnSystem:
        """This system, traced for states v and y of these shapes; None for an unknown shape."""
        shapes = {name: checks.shape_of(name, state) for name, state in zip("vy", states, strict=False) if state is not None}
        if self.equations is not None and self._fits(shapes):
            return self
        key = shapes.get("v"), shapes.get("y")
        if (known := self._met.get(key)) is not None:
            return known
        if len(self._met) >= MOST_SHAPES:
            self._met.clear()
        structure = self.structure()
        by_shapes = {} if structure is None else structure[0].by_shapes
        if (alike := by_shapes.get((structure, key))) is not None:
            self._met[key] = alike._with_parameters(self.parameters_given)
            return self._met[key]
        refused: list[TraceError] = []
        for v_shape, y_shape in self._candidates(shapes):
            try:
                self._met[key] = self._bound(v_shape, y_shape)
            except TraceError as error:
                refused.append(error)
                continue
            if len(by_shapes) >= MOST_SHAPES:
                by_shapes.clear()
            by_shapes[structure, key] = self._met[key]._with_parameters({})  # without the numbers, which may be many
            return self._met[key]
        raise self._refusal(shapes, refused)

    def structure(self) -> Any:
        """A key of the functions, as long as they compute the same, and of the shapes of parameters, if these are numbers."""
        acted_on = self.around or self.push is not None or self.kept is not None or self._members is not None
        if acted_on or type(self) is not OwnSystem:  # others have more attributes than parameters
            return None
        known = self.definition.known()
        if known is None:
            return None
        shapes: list[Shape] = []
        for value in self.parameters_given.values():
            if type(value) is not np.ndarray:
                return None
            shapes.append(value.shape)
        return known, tuple(shapes), None if self.equations is None else (self.v_shape, self.y_shape)

    def numbers_of_step(self, batch: Shape, *, series: bool) -> list[Array]:
        """Its parameters."""
        return list(self.parameters_given.values())

    def with_numbers_of(self, other: System, v: Array, y: Array) -> OwnSystem:
        """Another system of the same structure, with the operations of this one."""
        assert isinstance(other, OwnSystem)
        return self._with_parameters(other.parameters_given)

    def _with_parameters(self, parameters: dict[str, Any]) -> OwnSystem:
        """This system with parameters that were checked, of the same shapes."""
        same: OwnSystem = object.__new__(type(self))
        vars(same).update(vars(self))
        vars(same).update(parameters_given=parameters, _bounds={}, _met={})
        return same

    def _refusal(self, shapes: dict[str, Shape], refused: list[TraceError]) -> Exception:
        """The error to raise if the function fails with every candidate shape; ``refused`` has the candidates' errors."""
        name = self.definition.name
        if not refused:
            states = ", ".join(f"{block} of shape {shape}" for block, shape in shapes.items())
            return ShapeError(f"{name}: expected a state of the declared shape {self.definition.shape[1]}, got {states}")
        # A function of arrays fails with a number, too, but that error would mislead.
        for error in refused:
            if not error.of_shape:
                return error
        if not (hint := self._batch_first(shapes)):  # that a number does not do says nothing where there is an array
            return next((error for error in refused if not str(error).endswith("got one number")), refused[0])
        hinted = ShapeError(f"{name}: {hint}")
        hinted.__cause__ = refused[-1]
        return hinted

    def _batch_first(self, shapes: dict[str, Shape]) -> str:
        """A hint if the function can be run with the last axes of the states as the block; empty if not."""
        if self.definition.blocks == 2 or not shapes:
            return ""
        name, shape = max(shapes.items(), key=lambda each: len(each[1]))
        for n in range(1, len(shape)):
            last = shape[-n:]
            try:
                self._bound((0,) if self.definition.order == 1 else last, last)
            except TraceError:
                continue
            return f"batch axes come last: expected {name} of shape {(*last, *shape[:-n])}, got {shape}"
        return ""

    def _fits(self, shapes: dict[str, Shape]) -> bool:
        """True if states of these shapes can begin with blocks of the known shapes."""
        mine = {"v": self.v_shape, "y": self.y_shape}
        return all(shape == () or shape[: len(mine[name])] == mine[name] for name, shape in shapes.items())

    def _candidates(self, shapes: dict[str, Shape]) -> Iterator[tuple[Shape, Shape]]:
        """The shapes of v and y to try the function with, the shortest first."""
        declared_v, declared_y = self.definition.shape
        v, y = shapes.get("v", ()), shapes.get("y", ())
        pairs: Iterable[tuple[Shape, Shape]]
        if self.definition.blocks == 2:
            pairs = ((v[:i], y[:j]) for j in range(len(y) + 1) for i in range(len(v) + 1))
        elif not (v or y):
            # The state is not known: a number, or the shortest vector.
            whole = declared_y is not None and None not in declared_y
            sizes: Sequence[Shape] = (tuple(n or 1 for n in declared_y),) if whole and declared_y is not None else SHORTEST
            pairs = (((0,) if self.definition.order == 1 else size, size) for size in sizes)
        elif self.definition.order == 1:
            pairs = (((0,), y[:n]) for n in range(len(y) + 1))
        else:
            longest = max(v, y, key=len)
            pairs = ((longest[:n], longest[:n]) for n in range(len(longest) + 1))
        for v_shape, y_shape in pairs:
            if fits(v_shape, declared_v) and fits(y_shape, declared_y):
                yield v_shape, y_shape

    def _bound(self, v_shape: Shape, y_shape: Shape) -> OwnSystem:
        """This system for blocks of these shapes, with its function traced."""
        if (known := self._bounds.get((v_shape, y_shape))) is not None:
            return known
        definition = self.definition
        shapes = {
            name: value.shape[: self.own_axes(name)] if isinstance(value, np.ndarray) else None
            for name, value in self.parameters_given.items()
        }
        equations = Equations(definition, v_shape, y_shape, shapes)
        equations.rubs = self.friction_on is not None
        bound = changed(self, v_shape=v_shape, y_shape=y_shape, equations=equations, _single={}, _bounds={}, _met={})
        bound._trace_once()
        self._bounds[v_shape, y_shape] = bound
        return bound

    def _trace_once(self) -> None:
        """Trace the function, unless the cache has the operations of an equal function with parameters of the same kinds."""
        key = self._key()
        if key is not None and (known := _TRACED.get(key)) is not None:
            operations, equations = known
            if equations == self.equations:  # of the same definition: what it has found of the rates holds for these, too
                complete(self, equations=equations)
            self._take(operations)
            return
        self._trace()
        if key is not None:
            if len(_TRACED) >= MOST_TRACED:
                _TRACED.clear()
            _TRACED[key] = self._core, self.equations

    def _key(self) -> Any:
        """A key of all that the operations depend on; None if a part of it may change unnoticed."""
        definition = self.definition
        try:
            parameters = tuple((name, self._kind_of(name, value)) for name, value in self.parameters_given.items())
            invariants = tuple((each.name, each.parameters, identity(each.function)) for each in definition.invariants.values())
            function = identity(definition.function)
            mass = None if definition.mass is None else definition.mass.matrix.tobytes()
            on = self.friction_on
            friction = None if on is None else (identity(on.function), *on[1:])
            key = definition.order, definition.blocks, definition.quick_sines, self.v_shape, self.y_shape, mass, friction
            return *key, function, parameters, invariants, definition.name
        except Unknown:
            return None

    def _kind_of(self, name: str, value: Any) -> Any:
        """A key of what the operations depend on in a parameter: its kind, not its numbers."""
        if isinstance(value, np.ndarray):
            return value.shape[: self.own_axes(name)]
        if isinstance(value, (Sinusoid, Sampled)):
            signal = value.signal()
            return type(signal).__name__, *getattr(signal, "parts", dict)()
        return identity(value)

    def _trace(self) -> None:
        """Trace the rates, and a control as a part of them."""
        self._take(self._rates())

    def _take(self, operations: Any) -> None:
        self._core = operations
        friction = None if self.friction_on is None else OwnFriction.velocity_term
        complete(self, velocity_term=friction or ("forces that do" if operations.reads_v else None))

    @property
    def friction_on(self) -> Friction | None:
        """The friction that sticks, as it was declared."""
        part = self.part("friction")
        return None if part is None else part.definition.stick_friction

    def _rates(self, marks: Marks | None = None, *, single: bool = False) -> Any:
        """The rates as operations; with ``marks`` also the derivatives of elementary functions in them.

        The function is run twice, to check that it always does the same. The rates of float32 lack the invariants that can be
        recorded, which are computed in float64.
        """
        equations, definition = self.equations, self.definition
        assert equations is not None
        plain = changed(self, around=())  # the core adds the parts around the equations
        tape = _core.Tape(single=single)
        traced = []
        for _ in range(1 if single else 2):
            tracer = Tracer(plain, tape)
            v, y, _more = tracer.state()
            with nullcontext() if marks is None else recording(marks):
                s = tracer.scaled(tape.step())
                dv, dy = s.rates(tape.time(), v, y)
                friction = self.friction_operations(tracer, s, v, y)
            traced.append((tracer.flat(dv), tracer.flat(dy), *friction))
        if [each.id for block in traced[0] for each in block] != [each.id for block in traced[-1] for each in block]:
            raise TraceError(
                f"{definition.name}: expected the same operations at every call, got others: a function of a step may not draw "
                f"random numbers or count its calls"
            )
        dv, dy, *friction = traced[0]
        quantities = [(name, *tracer.flat(s.record(name, v, y))) for name in self.quantities if not single]
        projected = None
        if equations.kept is not None and not equations.pushed:
            value = equations.invariants[equations.kept].value(v, y, s.parameters)
            along_v, along_y, square = s.gradient(v, y)
            projected = (*tracer.flat(value), tracer.flat(along_v), tracer.flat(along_y), *tracer.flat(square))
        own_dv, own_dy = dv if equations.v_shape != (0,) else [], None if equations.second_order else dy
        functions = [] if marks is None else derivatives_of_functions(tape, marks)
        rows = None if equations.mass_matrix is None else equations.mass_matrix.rows
        return tape.equations(own_dv, own_dy, quantities, projected, functions, rows, self._sticking(*friction))

    def friction_operations(self, tracer: Tracer, s: Any, v: Array, y: Array) -> list[list[Any]]:
        """The operations of friction: decelerations, and by how much velocities change with the one that it acts on."""
        if self.friction_on is None:
            return []
        assert self.equations is not None
        limit, along = self.equations.friction(tracer.tape.time(), v, y, s.parameters)
        return [tracer.flat(limit), [] if along is None else tracer.flat(along)]

    def _sticking(self, *friction: list[Any]) -> Any:
        """Friction as the core takes it, or None."""
        if (on := self.friction_on) is None:
            return None
        limit, along = friction
        if on.component is None:
            return limit, self.v_shape[-1] if on.of == "row" else 1, None
        return limit, 1, (int(np.ravel_multi_index(on.component, self.v_shape)), along)

    def _known(self) -> OwnSystem:
        return self if self.equations is not None else self.for_state_shapes()

    @property
    def groups(self) -> tuple[int, ...]:
        """One group for each component, row along the last axis, or block, by the definition's ``scale``."""
        if self.definition.scale == "block":
            return ()
        groups: list[int] = []
        for shape in (self.v_shape, self.y_shape):
            of_one = prod(shape[-1:]) if self.definition.scale == "row" else 1
            first = groups[-1] + 1 if groups else 0
            groups += [first + place // max(of_one, 1) for place in range(prod(shape))]
        return tuple(groups)

    # ---- for the core and the reference

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The function, and parameters by name."""
        parameters: dict[str, Any] = {RATES: self._known().equations}
        for name, value in self.parameters_given.items():
            if isinstance(value, (Sinusoid, Sampled)):
                parameters[name] = value.signal()
            elif isinstance(value, np.ndarray):
                own = self.own_axes(name)
                parameters[name] = aligned(value, own, batch) if own else value
            else:
                parameters[name] = value
        return parameters if self.push is None else parameters | self.push.own_parameters()

    def parameters(self, batch: Shape, *, series: bool = False, single: bool = False) -> CoreParameters:
        """The operations of the function and the parameters by name, as the core takes them; for ``series`` with derivatives."""
        bound = self._retraced()
        rates = bound._in_single(series) if single else bound._series_rates() if series else bound._core
        own = {name: value for name, value in bound.all_parameters(batch).items() if name != RATES and not callable(value)}
        return [(RATES, rates), *flat(own, batch)]

    def _in_single(self, series: bool) -> Any:
        """The operations of the function in float32; for ``series`` with derivatives."""
        if series not in self._single:
            self._single[series] = self._rates({} if series else None, single=True)
        return self._single[series]

    @property
    def chooses(self) -> bool:
        """True if the rates are made of pieces between which the state or the time chooses.

        The choice of a control to do nothing where the gradient is zero does not count: there is no gradient to go along.
        """
        if self.push is not None:
            return self.uncontrolled.chooses
        return bool(self._retraced()._series_rates().chooses)

    @property
    def reads_time(self) -> bool:
        """True if the function depends on the time."""
        return bool(self._retraced()._core.reads_time)

    @property
    def switches_by_time(self) -> bool:
        """True if comparisons and the like of the time choose between pieces of the function."""
        bound = self._retraced()
        assert bound.equations is not None
        return bound.reads_time and bound.equations.switching(bound._of_function())[0].by_time

    def _of_function(self) -> dict[str, Any]:
        """The parameters of the function itself, as numbers and inputs."""
        return {name: value for name, value in self.own_parameters(self.batch).items() if name in self.parameters_given}

    def switching_times(self, begin: float, end: float) -> Array:
        """The times at which comparisons of the function change, for the parameters of each member."""
        bound = self._retraced()
        assert bound.equations is not None
        if (known := bound.equations.constant_switching_times) is not None:
            return known
        return bound.equations.switching_times(bound._of_function(), begin, end)

    def _series_rates(self) -> Any:
        """The rates as operations, with the derivatives of the functions among them."""
        if self._with_functions is None or self._with_functions[0] is not self._core:
            if (known := _WITH_FUNCTIONS.get(id(self._core))) is None:
                if len(_WITH_FUNCTIONS) >= MOST_TRACED:
                    _WITH_FUNCTIONS.clear()
                known = _WITH_FUNCTIONS[id(self._core)] = self._core, self._rates({})
            self._with_functions = known
        return self._with_functions[1]

    @property
    def digest(self) -> str:
        """A hash of its operations. It is cached, because a long list of operations takes long to write out."""
        from .digest import digest  # only resumed runs need it

        bound = self._retraced()
        if bound._digest is None or bound._digest[0] is not bound._core:
            bound._digest = bound._core, digest(bound)
        return bound._digest[1]

    def of_members(self, batch: Shape, own: dict[str, Any], parts: list[Bound]) -> Self:
        """This system for some members of a batch, which have the operations of all."""
        some = super().of_members(batch, own, parts)
        complete(some, _core=self._core, _with_functions=self._with_functions)
        return some

    def _retraced(self) -> OwnSystem:
        """This system with its operations, which an unpickled copy lacks."""
        known = self._known()
        if known._core is None:
            known._trace()
        return known

    # ---- invariants

    @property
    def quantities(self) -> dict[str, Shape]:
        """The invariants, each one number. One with a parameter that changes with the time is not constant and is left out."""
        values, changing = self.parameters_given, () if self.controller is None else self.controller.sets
        constant = (
            name
            for name, each in self.definition.invariants.items()
            if all(isinstance(values[parameter], np.ndarray) and parameter not in changing for parameter in each.parameters)
        )
        return dict.fromkeys(constant, ())

    def energy(self, v: Array, y: Array) -> Array:
        """The invariant that is called ``energy``."""
        if "energy" not in self.definition.invariants:
            raise UnsupportedError(
                f"energy: {self!r} has no invariant of that name; declare one: @{self.definition.name}.invariant above "
                f"def energy({'v, y' if self.definition.has_v else 'y'}, *, …)"
            )
        energy = np.asarray(self.reference_at_step(1.0, np.shape(y)[len(self.y_shape) :]).record("energy", v, y))
        if "energy" not in self.quantities:  # since a controller sets what it reads
            raise UnsupportedError(
                f"energy: that of {self!r} reads a parameter that changes with the time; compute it from v and y"
            )
        return energy

    def controlled(self, control: Any, v: Array, y: Array, dt: float) -> OwnSystem:
        """This system under a control of an invariant; without a target of its own, the control keeps the value of this state."""
        name = self._invariant_of(control)
        with np.errstate(all="ignore"):
            start = np.asarray(self.reference_at_step(1.0, np.shape(y)[len(self.y_shape) :]).record(name, v, y))
        return self._keeping(name, control.aimed(start, start, dt))

    def under(self, control: Any, batch: Shape) -> OwnSystem:
        """This system under a control of an invariant, for unknown states of that batch shape."""
        return self._keeping(self._invariant_of(control), control.aimed(np.ones(batch), np.zeros(batch), TINY))

    def _invariant_of(self, control: Any) -> str:
        if isinstance(control, EnergyControl):
            raise UnsupportedError(
                f"control: EnergyControl pushes velocities by the kinetic energy, which {self!r} does not define; use "
                f"Control('energy', gain), which pushes along the gradient of an invariant"
            )
        if isinstance(control, ConstraintControl):
            self._controllable(control)
        name = control.invariant
        if isinstance(control, Projection) and control.way in WAYS:
            if control.way == "scaling":
                raise UnsupportedError(
                    f"control: Projection('scaling') scales velocities by the kinetic energy, which {self!r} does not define; "
                    f"use Projection('energy'), which goes along the gradient of an invariant"
                )
            name = "energy"
        return checks.known("control", name, self.definition.invariants)

    def _keeping(self, name: str, control: Any) -> OwnSystem:
        if self.mass_matrix is not None and isinstance(control, Control):
            raise UnsupportedError(
                f"control: {control!r} pushes rates along the gradient of an invariant, and the algebraic equations of {self!r} "
                f"give no rate; use Projection({name!r}), which moves the state after each step"
            )
        if self.has_stick_friction:
            raise UnsupportedError(
                f"control: {control!r} keeps an invariant of {self!r}, from which friction takes energy for good; leave one out"
            )
        known = self._known().uncontrolled  # a control replaces another
        assert isinstance(known, OwnSystem)
        assert known.equations is not None
        pushed = isinstance(control, Control)
        controlled = changed(
            known,
            _single={},
            _bounds={},
            _met={},
            _free=known,
            batch=checks.batch_shape({"system": known.batch, "control": control.batch}),
            equations=known.equations.keeping(name, limited=pushed and control.form == "limited", pushed=pushed),
        )
        complete(controlled, **({"push": control, "second_order": False} if pushed else {"around": known._around_with(control)}))
        controlled._trace()
        complete(controlled, velocity_term=controlled.velocity_term or "a control of an invariant")
        return controlled

    @property
    def has_time(self) -> bool:
        """True, because the function has the time as an argument, whether or not it uses it."""
        return True

    def given_inputs(self) -> dict[str, Input]:
        """The inputs among the parameters, by name."""
        return {name: value for name, value in self.parameters_given.items() if isinstance(value, (Sinusoid, Sampled))}


def _batch_of(value: Any, own: int) -> Shape:
    """The batch shape of a checked parameter with ``own`` axes of its own."""
    return value.shape[own:] if isinstance(value, np.ndarray) else getattr(value, "batch", ())


def _checked(argument: str, value: Any, own: int) -> tuple[Any, Shape]:
    """A parameter whose default has ``own`` axes: an input, a function of the time or numbers, and its batch shape."""
    is_input = isinstance(value, (Sinusoid, Sampled))
    if not is_input and not callable(value):
        numbers = checks.numbers(argument, value)
        if numbers.ndim < own:
            raise ShapeError(f"{argument}: expected {own} axes of its own, like its default, got shape {numbers.shape}")
        return numbers, numbers.shape[own:]
    if not is_input:
        checks.argument_order(argument, value, ("t",))
    if own:
        raise ShapeError(f"{argument}: expected an array with {own} axes of its own, like its default, got {value!r}")
    return value, getattr(value, "batch", ())
