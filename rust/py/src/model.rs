//! The model to step: names, parameters and tables that stay Python's.

use std::sync::Arc;

use numpy::{PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::{
    prelude::*,
    types::{PyBytes, PyString, PyTuple, PyType},
};
use stepwell_core::{
    error::Error,
    model::{
        around::force,
        spec::{Row, Signature, Spec, Table},
    },
    run::Model,
    step::{
        key::{StepKind, TapeKey},
        pace::Acceptance,
    },
    tape::{equations, real::Precision},
};

/// The name of quantities whose changes of sign are noticed.
const WATCHED: &str = "watched()";
/// The name of what a sampled controller computes.
const CONTROLLER: &str = "controller()";
/// The name of a step that is given as operations.
const STEP: &str = "step()";

/// A message as an argument error of the package.
pub(crate) fn argument_error(message: String) -> PyErr {
    error_of("ArgumentError", message)
}

/// A message as the package's own error of that name.
pub(crate) fn error_of(name: &str, message: String) -> PyErr {
    let class = Python::attach(|py| Ok(py.import("stepwell.errors")?.getattr(name)?.cast_into::<PyType>()?.unbind()));
    match class {
        Ok(class) => Python::attach(|py| PyErr::from_type(class.into_bound(py), message)),
        Err(error) => error,
    }
}

/// Of an array that another thread uses just now, whatever NumPy's words are.
pub(crate) fn in_use<E>(_: E) -> PyErr {
    error_of(
        "BusyError",
        "an array is being stepped by a world in another thread; give a copy of it, or let one thread at a time use it"
            .to_owned(),
    )
}

/// Borrows an array of a user.
pub(crate) fn readable<'py>(array: &Bound<'py, PyArray2<f64>>) -> PyResult<PyReadonlyArray2<'py, f64>> {
    array.try_readonly().map_err(in_use)
}

/// The core's words as a Python error; Python has checked nearly everything before.
pub(crate) fn core_error(error: Error) -> PyErr {
    let name = match error {
        Error::Memory { .. } => "TooLargeError",
        Error::TooLongForSeries { .. }
        | Error::TooLongToSolve { .. }
        | Error::TooLongToSplit { .. }
        | Error::TooLongForTimes { .. }
        | Error::MassMatrix { .. } => "UnsupportedError",
        _ => "ArgumentError",
    };
    error_of(name, error.to_string())
}

/// The precision of 32 bits, or of 64.
pub(crate) fn precision(single: bool) -> Precision {
    if single { Precision::Single } else { Precision::Double }
}

/// The rates of a user's own system.
#[pyclass(module = "stepwell._core", frozen)]
pub struct Equations(pub Arc<equations::Equations>);

#[pymethods]
impl Equations {
    /// Whether a rate of v depends on v.
    #[getter]
    fn reads_v(&self) -> bool {
        self.0.reads_v()
    }

    /// Whether anything depends on the time.
    #[getter]
    fn reads_time(&self) -> bool {
        self.0.reads_time()
    }

    /// Whether the rates are piecewise, with a choice by the state or the time.
    #[getter]
    fn chooses(&self) -> bool {
        self.0.chooses()
    }
}

/// The value of a name: a word, a whole number, a list of whole numbers (as bytes, four for each), rows of a parameter, samples
/// with their start and interval, or rates.
enum Value {
    Word(String),
    Whole(usize),
    List(Arc<[u32]>),
    Samples((f64, f64, Py<PyArray2<f64>>)),
    Rows(Py<PyArray2<f64>>),
    Equations(Arc<equations::Equations>),
}

// By the type that it has: a derived one would try each, and an exception for what it is not takes longer than all else in a
// short call.
impl<'py> FromPyObject<'_, 'py> for Value {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Value> {
        if let Ok(array) = given.cast::<PyArray2<f64>>() {
            Ok(Value::Rows(array.to_owned().unbind()))
        } else if given.is_instance_of::<PyString>() {
            given.extract().map(Value::Word)
        } else if let Ok(bytes) = given.cast::<PyBytes>() {
            let (numbers, _) = bytes.as_bytes().as_chunks::<4>();
            Ok(Value::List(numbers.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect()))
        } else if given.is_instance_of::<PyTuple>() {
            given.extract().map(Value::Samples)
        } else if let Ok(rates) = given.cast::<Equations>() {
            Ok(Value::Equations(Arc::clone(&rates.get().0)))
        } else {
            given.extract().map(Value::Whole)
        }
    }
}

/// A system and what makes its steps.
#[pyclass(module = "stepwell._core", frozen)]
pub struct ModelSpec {
    pub signature: Arc<Signature>,
    pub how: StepKind,
    rows: Vec<Py<PyArray2<f64>>>,
    tables: Vec<(f64, f64, Py<PyArray2<f64>>)>,
    record: Vec<String>,
    fused: bool,
    order: u32,
    pub precision: Precision,
    acceptance: Acceptance,
    backward: bool,
}

/// The parameters, borrowed for a run.
pub(crate) type Rows<'py> = Vec<PyReadonlyArray2<'py, f64>>;
/// Other parameters in place of these, borrowed for a run, each with how many numbers its rows have.
pub(crate) type Others<'py> = Vec<(usize, PyReadonlyArrayDyn<'py, f64>)>;
/// The tables, borrowed for a run: start, interval, samples.
pub(crate) type Tables<'py> = Vec<(f64, f64, PyReadonlyArray2<'py, f64>)>;

/// The tables as the core takes them.
pub(crate) fn tables<'a>(of: &'a Tables<'_>) -> PyResult<Vec<Table<'a>>> {
    of.iter().map(|(start, interval, t)| Ok(Table { samples: by_row(t)?, start: *start, interval: *interval })).collect()
}

/// The rows of an array, each of one number or one for each member.
pub(crate) fn by_row<'a>(array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Row<'a>>> {
    let mut rows = Vec::new();
    add_rows(array, &mut rows)?;
    Ok(rows)
}

fn add_rows<'a>(array: &'a PyReadonlyArray2<'_, f64>, rows: &mut Vec<Row<'a>>) -> PyResult<()> {
    let width = array.as_array().ncols().max(1);
    let numbers = array.as_slice()?;
    let (count, bytes) = (numbers.len() / width, size_of_val(numbers));
    rows.try_reserve(count).map_err(|_| core_error(Error::Memory { bytes }))?;
    rows.extend(numbers.chunks_exact(width).map(Row));
    Ok(())
}

#[pymethods]
impl ModelSpec {
    /// `given` is a list of names and their values; `matrix` is the nodes of the transition-matrix form and the
    /// number of rows in its v slot, if it is asked for; `order` is that of a series with adaptive steps; `single` is whether
    /// steps are computed with numbers of 32 bits; `acceptance` is that of `reference/acceptance.py`, and `backward` whether
    /// adaptive steps go back in time.
    #[new]
    #[pyo3(signature = (system, method, given, *, matrix=None, record=Vec::new(), fused=false, order=0, single=false, acceptance=None, backward=false))]
    #[allow(clippy::too_many_arguments, reason = "in Python they have names")]
    fn new(
        py: Python<'_>,
        system: String,
        method: String,
        given: Vec<(String, Value)>,
        matrix: Option<(Vec<f64>, usize)>,
        record: Vec<String>,
        fused: bool,
        order: u32,
        single: bool,
        acceptance: Option<(Vec<i64>, bool, Vec<u32>, bool)>,
        backward: bool,
    ) -> Self {
        let mut names = Signature { system, ..Signature::default() };
        let (mut rows, mut tables, mut step) = (Vec::new(), Vec::new(), None);
        for (name, value) in given {
            match value {
                Value::Word(word) => names.words.push((name, word)),
                Value::Whole(whole) => names.wholes.push((name, whole)),
                Value::List(list) => names.lists.push((name, list)),
                Value::Rows(array) => {
                    let [count, members] = [0, 1].map(|axis| array.bind(py).shape()[axis]);
                    // A force changes between steps, so it is never computed with beforehand for all members at once.
                    names.rows.push((name.clone(), vec![members == 1 && name != force::NAME; count]));
                    rows.push(array);
                }
                Value::Equations(quantities) if name == WATCHED => names.watched = Some(quantities),
                Value::Equations(next) if name == STEP => step = Some(next),
                Value::Equations(controller) if name == CONTROLLER => names.controller = Some(controller),
                Value::Equations(rates) => names.equations = Some(rates),
                Value::Samples((start, interval, array)) => {
                    let common = array.bind(py).shape()[1] == 1;
                    names.tables.push((name, common));
                    tables.push((start, interval, array));
                }
            }
        }
        let how = match (matrix, step) {
            (None, Some(step)) => StepKind::Step(step),
            (None, None) => StepKind::Method { name: method, choice: 0 },
            (Some((nodes, _)), _) => StepKind::Matrix { nodes: nodes.into_iter().map(f64::to_bits).collect(), fused },
        };
        let acceptance = acceptance.map_or_else(Acceptance::default, |(groups, own, positive, compensated)| Acceptance {
            groups: groups.into_iter().map(|group| u32::try_from(group).ok()).collect(),
            own,
            positive,
            compensated,
        });
        ModelSpec {
            signature: Arc::new(names),
            how,
            rows,
            tables,
            record,
            fused,
            order,
            precision: precision(single),
            acceptance,
            backward,
        }
    }

    /// The arrays of parameters, in order, whose rows are the parameters of a tape.
    #[getter(rows)]
    fn arrays(&self, py: Python<'_>) -> Vec<Py<PyArray2<f64>>> {
        self.rows.iter().map(|array| array.clone_ref(py)).collect()
    }

    /// The sampled inputs, in order: start, interval, and a row for each sample.
    #[getter(tables)]
    fn samples(&self, py: Python<'_>) -> Vec<(f64, f64, Py<PyArray2<f64>>)> {
        self.tables.iter().map(|(start, interval, array)| (*start, *interval, array.clone_ref(py))).collect()
    }
}

impl ModelSpec {
    /// Borrows the parameters.
    pub fn rows<'py>(&self, py: Python<'py>) -> PyResult<Rows<'py>> {
        self.rows.iter().map(|r| readable(r.bind(py))).collect()
    }

    /// Borrows other parameters; none if they are not as many numbers, one after the other in memory.
    pub fn others<'py>(&self, py: Python<'py>, arrays: &[Bound<'py, PyArrayDyn<f64>>]) -> PyResult<Option<Others<'py>>> {
        if arrays.len() != self.rows.len() {
            return Ok(None);
        }
        let mut others = Vec::with_capacity(arrays.len());
        for (array, own) in arrays.iter().zip(&self.rows) {
            let own = own.bind(py);
            if array.len() != own.len() || !array.is_c_contiguous() {
                return Ok(None);
            }
            others.push((own.shape()[1].max(1), array.try_readonly().map_err(in_use)?));
        }
        Ok(Some(others))
    }

    /// The system with other parameters.
    pub fn with<'a>(&self, others: &'a Others<'_>, tables: &'a Tables<'_>) -> PyResult<Spec<'a>> {
        let mut rows = Vec::new();
        for (width, numbers) in others {
            rows.extend(numbers.as_slice()?.chunks_exact(*width).map(Row));
        }
        Ok(Spec { signature: self.signature.clone(), rows, tables: self::tables(tables)? })
    }

    /// Borrows the tables.
    pub fn tables<'py>(&self, py: Python<'py>) -> PyResult<Tables<'py>> {
        self.tables.iter().map(|(start, interval, t)| Ok((*start, *interval, readable(t.bind(py))?))).collect()
    }

    /// Steps of fixed length, by a method that is started in its `choice`-th way.
    pub fn started(&self, choice: usize) -> StepKind {
        match &self.how {
            StepKind::Method { name, .. } => StepKind::Method { name: name.clone(), choice },
            other => other.clone(),
        }
    }

    /// Adaptive steps.
    pub fn attempts(&self) -> StepKind {
        match &self.how {
            StepKind::Method { name, .. } => StepKind::Attempts {
                name: name.clone(),
                order: self.order,
                acceptance: self.acceptance.clone(),
                backward: self.backward,
            },
            other => other.clone(),
        }
    }

    /// The system.
    pub fn spec<'a>(&self, rows: &'a Rows<'_>, tables: &'a Tables<'_>) -> PyResult<Spec<'a>> {
        let mut all = Vec::new();
        rows.iter().try_for_each(|array| add_rows(array, &mut all))?;
        Ok(Spec { signature: self.signature.clone(), rows: all, tables: self::tables(tables)? })
    }

    /// The model that the core steps.
    pub fn model<'a>(&'a self, how: StepKind, rows: &'a Rows<'_>, tables: &'a Tables<'_>) -> PyResult<Model<'a>> {
        Ok(self.of(how, self.spec(rows, tables)?))
    }

    /// The model that the core steps, of a system with parameters.
    pub fn of<'a>(&self, how: StepKind, spec: Spec<'a>) -> Model<'a> {
        let Self { signature, record, fused, precision, .. } = self;
        // The matrix form says itself which products are fused, whatever they are made of.
        let fused = *fused && !matches!(how, StepKind::Matrix { .. });
        Model { spec, key: TapeKey { signature: signature.clone(), how, record: record.clone(), fused, precision: *precision } }
    }
}
