//! Tapes in Python: with symbols in place of numbers the reference's step is traced, to be compared with the core's.

use std::{
    slice,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1};
use pyo3::{
    exceptions::{PyIndexError, PyTypeError, PyValueError},
    prelude::*,
    pyclass::CompareOp,
    types::{PyDict, PyFloat, PyInt},
};
use stepwell_core::{
    events::evaluation,
    model::spec::Row,
    step::trace,
    tape::{
        self, Id, OPERATIONS, Op,
        equations::{self, Friction, Invariant, Marked, On},
        fuse::fuse,
        mass::Mass,
        print,
        real::Precision,
        reserved::BUDGET,
    },
};

use crate::{
    kinds_of,
    model::{Equations, ModelSpec, argument_error, core_error, precision},
    world::machine,
};

/// For each operation its name, how many operands it has, among which counts it is, and whether these may be exchanged.
#[pyfunction]
pub(crate) fn tape_operations() -> Vec<(&'static str, usize, &'static str, bool)> {
    OPERATIONS.to_vec()
}

type Shared = Arc<Mutex<tape::Tape>>;

/// A name, the places of operands, and what else it takes.
pub(crate) type Operation = (&'static str, Vec<usize>, u64);

/// An operation, whose operands have these places.
pub(crate) fn operation(op: Op, place: impl Fn(Id) -> usize) -> Operation {
    let (operands, n) = op.operands();
    (op.name(), operands[..n].iter().map(|operand| place(*operand)).collect(), op.extra())
}

fn lock(tape: &Shared) -> MutexGuard<'_, tape::Tape> {
    // Every operation leaves a tape whole.
    tape.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A list of operations, each once. Symbols write to it.
#[pyclass(module = "stepwell._core", frozen)]
pub struct Tape(Shared);

/// A value on a tape.
#[pyclass(module = "stepwell._core", frozen)]
#[derive(Clone)]
pub struct Symbol {
    tape: Shared,
    #[pyo3(get)]
    id: Id,
}

/// An invariant: its value, its derivatives by v and by y, and the square of their length.
type Kept<'py> = (PyRef<'py, Symbol>, Vec<PyRef<'py, Symbol>>, Vec<PyRef<'py, Symbol>>, PyRef<'py, Symbol>);

/// Friction that sticks: decelerations, the length of the vectors that each is for, or the number that it is for and by how much
/// others change with it.
type Sticking<'py> = (Vec<PyRef<'py, Symbol>>, usize, Option<(usize, Vec<PyRef<'py, Symbol>>)>);

/// A value that is a function of others: with each of these its derivative by it, its bounds, and whether it is made of pieces.
type Function<'py> = (PyRef<'py, Symbol>, Vec<(PyRef<'py, Symbol>, PyRef<'py, Symbol>)>, Option<[f64; 2]>, bool);

/// A symbol, or a number that becomes one.
enum Value<'py> {
    Symbol(PyRef<'py, Symbol>),
    Number(f64),
}

impl<'a, 'py> FromPyObject<'a, 'py> for Value<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(symbol) = object.cast::<Symbol>() {
            return Ok(Value::Symbol(symbol.to_owned().borrow()));
        }
        // Not whatever can become a number: an array has to take the operation to its own elements.
        if object.is_instance_of::<PyFloat>() || object.is_instance_of::<PyInt>() {
            return object.extract().map(Value::Number);
        }
        Err(PyTypeError::new_err("expected a symbol or a number"))
    }
}

/// A symbol, or the bits of a constant.
#[derive(FromPyObject)]
enum Bits<'py> {
    Symbol(PyRef<'py, Symbol>),
    Pattern(u64),
}

fn no_truth() -> PyErr {
    PyTypeError::new_err("a symbol has no truth value and is no number yet: choose between two values instead of branching")
}

impl Symbol {
    fn on(&self, op: impl FnOnce(Id) -> Op) -> Symbol {
        let id = lock(&self.tape).push(op(self.id));
        Symbol { tape: Arc::clone(&self.tape), id }
    }

    fn id_of(&self, other: &Value) -> PyResult<Id> {
        match other {
            Value::Symbol(other) if Arc::ptr_eq(&self.tape, &other.tape) => Ok(other.id),
            Value::Symbol(_) => Err(PyValueError::new_err("symbols of different tapes")),
            Value::Number(x) => Ok(lock(&self.tape).constant(*x)),
        }
    }

    fn with(&self, other: &Value, op: impl FnOnce(Id, Id) -> Op) -> PyResult<Symbol> {
        let other = self.id_of(other)?;
        Ok(self.on(|id| op(id, other)))
    }

    fn with_bits(&self, bits: Bits, op: impl FnOnce(Id, Id) -> Op) -> PyResult<Symbol> {
        match bits {
            Bits::Symbol(other) => self.with(&Value::Symbol(other), op),
            Bits::Pattern(bits) => {
                let bits = lock(&self.tape).bits_of(bits);
                Ok(self.on(|id| op(id, bits)))
            }
        }
    }
}

#[pymethods]
impl Symbol {
    fn __add__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, Op::Add)
    }
    fn __radd__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, |a, b| Op::Add(b, a))
    }
    fn __sub__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, Op::Sub)
    }
    fn __rsub__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, |a, b| Op::Sub(b, a))
    }
    fn __mul__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, Op::Mul)
    }
    fn __rmul__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, |a, b| Op::Mul(b, a))
    }
    fn __truediv__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, Op::Div)
    }
    fn __rtruediv__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, |a, b| Op::Div(b, a))
    }
    fn __neg__(&self) -> Symbol {
        self.on(Op::Neg)
    }
    fn __pos__(&self) -> Symbol {
        self.clone()
    }
    fn __invert__(&self) -> PyResult<Symbol> {
        self.with_bits(Bits::Pattern(u64::MAX), Op::Xor)
    }
    fn __and__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, Op::And)
    }
    fn __or__(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, Op::Or)
    }
    /// √x
    fn sqrt(&self) -> Symbol {
        self.on(Op::Sqrt)
    }
    /// x · y + z, rounded once.
    fn mul_add(&self, y: Value, z: Value) -> PyResult<Symbol> {
        let (y, z) = (self.id_of(&y)?, self.id_of(&z)?);
        Ok(self.on(|id| Op::MulAdd(id, y, z)))
    }
    /// z − x · y, rounded once.
    fn mul_sub_from(&self, y: Value, z: Value) -> PyResult<Symbol> {
        let (y, z) = (self.id_of(&y)?, self.id_of(&z)?);
        Ok(self.on(|id| Op::SubMul(id, y, z)))
    }
    /// The largest whole number not above x.
    fn floor(&self) -> Symbol {
        self.on(Op::Floor)
    }
    /// Comparisons are values. Equality has the method `equals`, since Python needs a truth from ==.
    fn __richcmp__(&self, other: Value, op: CompareOp) -> PyResult<Symbol> {
        match op {
            CompareOp::Lt => self.with(&other, Op::Less),
            CompareOp::Le => self.with(&other, Op::LessEqual),
            CompareOp::Gt => self.with(&other, |a, b| Op::Less(b, a)),
            CompareOp::Ge => self.with(&other, |a, b| Op::LessEqual(b, a)),
            CompareOp::Eq | CompareOp::Ne => Err(no_truth()),
        }
    }
    /// x = y
    fn equals(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, Op::Equal)
    }
    /// One of two values, as this comparison says.
    fn choose(&self, yes: Value, no: Value) -> PyResult<Symbol> {
        let (yes, no) = (self.id_of(&yes)?, self.id_of(&no)?);
        Ok(self.on(|id| Op::Select(id, yes, no)))
    }
    /// Bits of x and of a constant.
    fn and_bits(&self, bits: Bits) -> PyResult<Symbol> {
        self.with_bits(bits, Op::And)
    }
    /// Bits of x or of a constant.
    fn or_bits(&self, bits: Bits) -> PyResult<Symbol> {
        self.with_bits(bits, Op::Or)
    }
    /// Bits of one and not of both.
    fn xor_bits(&self, other: Value) -> PyResult<Symbol> {
        self.with(&other, Op::Xor)
    }
    /// The bits of x as a whole number, and a constant added.
    fn add_bits(&self, bits: Bits) -> PyResult<Symbol> {
        self.with_bits(bits, Op::AddBits)
    }
    /// A constant as a whole number, and the bits of x subtracted.
    fn sub_bits_from(&self, bits: Bits) -> PyResult<Symbol> {
        self.with_bits(bits, |x, whole| Op::SubBits(whole, x))
    }
    /// A number on the tape of this symbol.
    fn number(&self, x: f64) -> Symbol {
        let id = lock(&self.tape).constant(x);
        Symbol { tape: Arc::clone(&self.tape), id }
    }
    /// A constant on the tape of this symbol, by its bits.
    fn constant(&self, bits: u64) -> Symbol {
        Tape(Arc::clone(&self.tape)).constant(bits)
    }
    /// Whether numbers of its tape have 32 bits.
    #[getter]
    fn single(&self) -> bool {
        lock(&self.tape).precision() == Precision::Single
    }
    /// Bits moved up.
    fn shift_up(&self, places: u32) -> Symbol {
        self.on(|id| Op::ShiftUp(id, places & 63))
    }
    /// Bits moved down.
    fn shift_down(&self, places: u32) -> Symbol {
        self.on(|id| Op::ShiftDown(id, places & 63))
    }
    fn __bool__(&self) -> PyResult<bool> {
        Err(no_truth())
    }
    fn __float__(&self) -> PyResult<f64> {
        Err(no_truth())
    }
    fn __repr__(&self) -> String {
        let tape = lock(&self.tape);
        print::line(self.id, tape.op(self.id), tape.precision())
    }
}

/// Values of a tape for many members at once.
#[pyclass(module = "stepwell._core", frozen)]
pub struct Evaluation(pub(crate) Values);

/// Values of 64 bits, or of 32.
#[derive(Clone)]
pub(crate) enum Values {
    Double(evaluation::Evaluation),
    Single(evaluation::Evaluation<f32>),
}

impl Evaluation {
    /// Values of 64 bits.
    pub(crate) fn double(&self) -> PyResult<&evaluation::Evaluation> {
        match &self.0 {
            Values::Double(values) => Ok(values),
            Values::Single(_) => Err(argument_error("expected values of 64 bits".to_owned())),
        }
    }
}

/// A number for all members, or one for each.
#[derive(FromPyObject)]
enum Numbers<'py> {
    Common(f64),
    Own(PyReadonlyArray1<'py, f64>),
}

impl Numbers<'_> {
    fn slice(&self) -> PyResult<&[f64]> {
        match self {
            Numbers::Common(number) => Ok(slice::from_ref(number)),
            Numbers::Own(numbers) => Ok(numbers.as_slice()?),
        }
    }
}

#[pymethods]
impl Evaluation {
    /// A row for each value, from rows of the state and of the parameters.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        members: usize,
        state: Vec<Numbers<'_>>,
        parameters: Vec<Numbers<'_>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let of = self.double()?;
        if of.has_samples() {
            return Err(argument_error(
                "expected values that depend on no samples, which are looked up for events alone".to_owned(),
            ));
        }
        let state = state.iter().map(|each| Ok(Row(each.slice()?))).collect::<PyResult<Vec<Row>>>()?;
        let parameters = parameters.iter().map(|each| Ok(Row(each.slice()?))).collect::<PyResult<Vec<Row>>>()?;
        for row in state.iter().chain(&parameters) {
            if row.0.len() != 1 && row.0.len() != members {
                return Err(argument_error(format!("expected one number or {members}, got {}", row.0.len())));
            }
        }
        let values = PyArray2::zeros(py, [of.values(), members], false);
        let level = machine()?.level;
        if members > 0 {
            let mut out = values.readwrite();
            of.run(level, (&state, &parameters), members, out.as_slice_mut()?);
        }
        Ok(values)
    }
}

#[pymethods]
impl Tape {
    /// A tape for numbers of 64 bits, or of 32.
    #[new]
    #[pyo3(signature = (*, single=false))]
    fn new(single: bool) -> Tape {
        Tape(Shared::new(Mutex::new(tape::Tape::new(precision(single)))))
    }

    /// A number of the state at the start of the step.
    fn state(&self, i: u32) -> Symbol {
        self.leaf(Op::State(i))
    }

    /// A row of parameters.
    fn param(&self, i: u32) -> Symbol {
        self.leaf(Op::Param(i))
    }

    /// The most attempts of a member with adaptive steps.
    fn budget(&self) -> Symbol {
        self.leaf(Op::Param(BUDGET))
    }

    /// The step h.
    fn step(&self) -> Symbol {
        self.leaf(Op::Step)
    }

    /// The time at the start of the step.
    fn time(&self) -> Symbol {
        self.leaf(Op::Time)
    }

    /// A number.
    fn number(&self, x: f64) -> Symbol {
        let id = lock(&self.0).constant(x);
        Symbol { tape: Arc::clone(&self.0), id }
    }

    /// A constant, by its bits; a tape of 32 bits takes the lower half.
    fn constant(&self, bits: u64) -> Symbol {
        self.leaf(Op::Const(bits))
    }

    /// Whether its numbers have 32 bits.
    #[getter]
    fn single(&self) -> bool {
        lock(&self.0).precision() == Precision::Single
    }

    /// A sampled input at a time.
    fn sample(&self, table: u32, t: Value) -> PyResult<Symbol> {
        let t = self.leaf(Op::Time).id_of(&t)?;
        Ok(self.leaf(Op::Sample(table, t)))
    }

    /// The value that the operation of that number makes.
    fn value(&self, id: Id) -> PyResult<Symbol> {
        let there = (id as usize) < lock(&self.0).ops().len();
        if !there {
            return Err(PyIndexError::new_err("there is no such operation on the tape"));
        }
        Ok(Symbol { tape: Arc::clone(&self.0), id })
    }

    /// Traces what the core makes of a model: the next state of a "step", an "attempt" with its pace, its "extension", the pace
    /// to "begin" with, or a "record".
    fn trace(&self, model: &ModelSpec, what: &str) -> PyResult<Vec<Symbol>> {
        let before = std::mem::take(&mut *lock(&self.0));
        let how = if matches!(what, "attempt" | "judged" | "extension" | "begin") { model.attempts() } else { model.how.clone() };
        let traced = trace::trace(before.clone(), &model.signature, &how, what);
        let (tape, next) = traced.inspect_err(|_| *lock(&self.0) = before).map_err(core_error)?;
        *lock(&self.0) = tape;
        Ok(next.into_iter().map(|id| Symbol { tape: Arc::clone(&self.0), id }).collect())
    }

    /// The operations that a value is made of, as text.
    fn listing(&self, of: &Symbol) -> PyResult<String> {
        let tape = lock(&self.0);
        if of.id as usize >= tape.ops().len() {
            return Err(PyIndexError::new_err("a symbol of another tape"));
        }
        let needed = tape.needed([of.id]);
        let lines = tape.ops().iter().enumerate().filter(|(id, _)| needed[*id]);
        Ok(lines.map(|(id, op)| print::line(id as Id, *op, tape.precision()) + "\n").collect())
    }

    /// The operations that these values are made of, and nothing else, in order: the name of each, the places of its operands,
    /// and what else it is given; behind them the places of the values.
    fn operations(&self, of: Vec<PyRef<'_, Symbol>>) -> PyResult<(Vec<Operation>, Vec<usize>)> {
        let (tape, roots) = self.with(&of)?;
        let needed = tape.needed(roots.iter().copied());
        let mut place = vec![0; needed.len()];
        let mut operations = Vec::new();
        for (id, op) in tape.ops().iter().enumerate().filter(|(id, _)| needed[*id]) {
            place[id] = operations.len();
            operations.push(operation(*op, |operand| place[operand as usize]));
        }
        Ok((operations, roots.into_iter().map(|root| place[root as usize]).collect()))
    }

    /// The rates of a user's own system: of v, and of y unless they are v itself; quantities of a state by name; and of the
    /// invariant that a projection keeps its value, its derivatives by v and by y, and the square of their length. `functions`
    /// are values with, for each that they depend on, the derivative by it; and, of one branch of several, its bounds. `mass` is
    /// the mass matrix: of each row the columns and entries that are not zero. `friction` that sticks has its decelerations, the
    /// length of the vectors that it acts on, and, if it acts on one number, its place and by how much others change with it.
    #[pyo3(signature = (dv, dy=None, quantities=Vec::new(), kept=None, functions=Vec::new(), mass=None, friction=None))]
    #[allow(clippy::too_many_arguments, reason = "in Python they have names")]
    fn equations(
        &self,
        dv: Vec<PyRef<'_, Symbol>>,
        dy: Option<Vec<PyRef<'_, Symbol>>>,
        quantities: Vec<(String, PyRef<'_, Symbol>)>,
        kept: Option<Kept<'_>>,
        functions: Vec<Function<'_>>,
        mass: Option<Vec<Vec<(u32, f64)>>>,
        friction: Option<Sticking<'_>>,
    ) -> PyResult<Equations> {
        let tape = lock(&self.0);
        let known = |symbol: &PyRef<'_, Symbol>| -> PyResult<Id> {
            let fits = Arc::ptr_eq(&self.0, &symbol.tape) && (symbol.id as usize) < tape.ops().len();
            if fits { Ok(symbol.id) } else { Err(PyIndexError::new_err("a symbol of another tape")) }
        };
        let all = |symbols: &[PyRef<'_, Symbol>]| symbols.iter().map(known).collect::<PyResult<Vec<Id>>>();
        let dv = all(&dv)?;
        let dy = dy.map(|dy| all(&dy)).transpose()?;
        let quantities =
            quantities.into_iter().map(|(name, symbol)| Ok((name, known(&symbol)?))).collect::<PyResult<Vec<_>>>()?;
        let kept = kept.map(|(value, along_v, along_y, square)| -> PyResult<Invariant> {
            Ok(Invariant { value: known(&value)?, along_v: all(&along_v)?, along_y: all(&along_y)?, square: known(&square)? })
        });
        let made = equations::Equations::new(tape.ops().to_vec(), dv, dy, quantities, kept.transpose()?);
        let functions = functions.into_iter().map(|(value, by, bounds, pieces)| {
            let by = by.iter().map(|(of, factor)| Ok((known(of)?, known(factor)?))).collect::<PyResult<Vec<_>>>()?;
            Ok(Marked { value: known(&value)?, by, bounds: bounds.map(|bounds| bounds.map(f64::to_bits)), pieces })
        });
        let made = made.with_functions(functions.collect::<PyResult<Vec<_>>>()?);
        let friction = friction.map(|(limit, length, one)| -> PyResult<Friction> {
            let on = match one {
                None => On::Vectors(length),
                Some((at, along)) => On::One(at, all(&along)?),
            };
            Ok(Friction { limit: all(&limit)?, on })
        });
        let made = made.with_mass(mass.map(|rows| Mass::new(&rows))).with_friction(friction.transpose()?);
        Ok(Equations(Arc::new(made.without_the_rest())))
    }

    /// A tape with fused multiply-adds in what these values need, and the values on it.
    fn fused(&self, of: Vec<PyRef<'_, Symbol>>) -> PyResult<(Tape, Vec<Symbol>)> {
        let (tape, roots) = self.with(&of)?;
        let (fused, roots) = fuse(&tape, &roots);
        let fused = Shared::new(Mutex::new(fused));
        let symbols = roots.into_iter().map(|id| Symbol { tape: Arc::clone(&fused), id }).collect();
        Ok((Tape(fused), symbols))
    }

    /// An evaluation of these values for many members at once, from `states` numbers of a state and from parameters; None if they
    /// depend on a step or a time. Where they depend on samples, events alone take them.
    fn evaluation(&self, of: Vec<PyRef<'_, Symbol>>, states: usize) -> PyResult<Option<Evaluation>> {
        let (tape, roots) = self.with(&of)?;
        let of = match tape.precision() {
            Precision::Double => evaluation::Evaluation::new(&tape, &roots, states).map(|of| of.map(Values::Double)),
            Precision::Single => evaluation::Evaluation::new(&tape, &roots, states).map(|of| of.map(Values::Single)),
        };
        Ok(of.map_err(core_error)?.map(Evaluation))
    }

    /// How often each kind of operation was asked for in a step, if these values are its next state.
    fn written<'py>(&self, py: Python<'py>, of: Vec<PyRef<'_, Symbol>>) -> PyResult<Bound<'py, PyDict>> {
        let (tape, roots) = self.with(&of)?;
        let counts = tape.written(roots);
        drop(tape);
        kinds_of(py, &counts)
    }

    fn __len__(&self) -> usize {
        lock(&self.0).ops().len()
    }
}

impl Tape {
    /// The tape, and the values of symbols on it.
    fn with(&self, of: &[PyRef<'_, Symbol>]) -> PyResult<(MutexGuard<'_, tape::Tape>, Vec<Id>)> {
        let tape = lock(&self.0);
        let roots: Vec<Id> = of.iter().map(|symbol| symbol.id).collect();
        if roots.iter().any(|id| *id as usize >= tape.ops().len()) {
            return Err(PyIndexError::new_err("a symbol of another tape"));
        }
        Ok((tape, roots))
    }

    fn leaf(&self, op: Op) -> Symbol {
        let id = lock(&self.0).push(op);
        Symbol { tape: Arc::clone(&self.0), id }
    }
}
