//! What to step: names, parameters and tables that stay Python's.

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::{prelude::*, types::PyType};
use stepwell_core::{
    error::Error,
    run::Model,
    spec::{Given, Row, Spec, Table},
    trace::{How, Scene},
};

/// A message as the package's own error.
pub fn argument_error(message: String) -> PyErr {
    let class = Python::attach(|py| Ok(py.import("stepwell.errors")?.getattr("ArgumentError")?.cast_into::<PyType>()?.unbind()));
    match class {
        Ok(class) => Python::attach(|py| PyErr::from_type(class.into_bound(py), message)),
        Err(error) => error,
    }
}

/// The core's words as a Python error; Python has checked nearly everything before.
pub fn core_error(error: Error) -> PyErr {
    argument_error(error.to_string())
}

/// What is given under a name: a word, a whole number, rows of a parameter, or samples with their start and interval.
#[derive(FromPyObject)]
enum Value {
    Word(String),
    Whole(usize),
    Samples((f64, f64, Py<PyArray2<f64>>)),
    Rows(Py<PyArray2<f64>>),
}

/// A system and what makes its steps.
#[pyclass(module = "stepwell._core", frozen)]
pub struct ModelSpec {
    pub given: Given,
    pub how: How,
    rows: Vec<Py<PyArray2<f64>>>,
    tables: Vec<(f64, f64, Py<PyArray2<f64>>)>,
    record: Vec<String>,
}

/// The parameters, borrowed for a run.
pub type Rows<'py> = Vec<PyReadonlyArray2<'py, f64>>;
/// The tables, borrowed for a run: start, interval, samples.
pub type Tables<'py> = Vec<(f64, f64, PyReadonlyArray2<'py, f64>)>;

/// The rows of an array, each of one number or one for each member.
pub fn by_row<'a>(array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Row<'a>>> {
    let width = array.as_array().ncols().max(1);
    Ok(array.as_slice()?.chunks_exact(width).map(Row).collect())
}

#[pymethods]
impl ModelSpec {
    /// `given` is a list of names and what is given under them; `matrix` is the nodes of the transition-matrix form and the number of rows
    /// in its v slot, if it is asked for.
    #[new]
    #[pyo3(signature = (system, method, given, *, matrix=None, record=Vec::new()))]
    fn new(
        py: Python<'_>,
        system: String,
        method: String,
        given: Vec<(String, Value)>,
        matrix: Option<(Vec<f64>, usize)>,
        record: Vec<String>,
    ) -> Self {
        let mut names = Given { system, ..Given::default() };
        let (mut rows, mut tables) = (Vec::new(), Vec::new());
        for (name, value) in given {
            match value {
                Value::Word(word) => names.words.push((name, word)),
                Value::Whole(whole) => names.wholes.push((name, whole)),
                Value::Rows(array) => {
                    let [count, members] = [0, 1].map(|axis| array.bind(py).readonly().as_array().shape()[axis]);
                    names.rows.push((name, vec![members == 1; count]));
                    rows.push(array);
                }
                Value::Samples((start, interval, array)) => {
                    let common = array.bind(py).readonly().as_array().ncols() == 1;
                    names.tables.push((name, common));
                    tables.push((start, interval, array));
                }
            }
        }
        let how = match matrix {
            None => How::Method { name: method, choice: 0 },
            Some((nodes, _)) => How::Matrix { nodes: nodes.into_iter().map(f64::to_bits).collect() },
        };
        ModelSpec { given: names, how, rows, tables, record }
    }
}

impl ModelSpec {
    /// Borrows the parameters.
    pub fn rows<'py>(&self, py: Python<'py>) -> PyResult<Rows<'py>> {
        self.rows.iter().map(|r| Ok(r.bind(py).try_readonly()?)).collect()
    }

    /// Borrows the tables.
    pub fn tables<'py>(&self, py: Python<'py>) -> PyResult<Tables<'py>> {
        self.tables.iter().map(|(start, interval, t)| Ok((*start, *interval, t.bind(py).try_readonly()?))).collect()
    }

    /// Steps of fixed length, by a method that is started in its `choice`-th way.
    pub fn started(&self, choice: usize) -> How {
        match &self.how {
            How::Method { name, .. } => How::Method { name: name.clone(), choice },
            other => other.clone(),
        }
    }

    /// Steps of chosen length.
    pub fn attempts(&self) -> How {
        match &self.how {
            How::Method { name, .. } => How::Attempts { name: name.clone() },
            other => other.clone(),
        }
    }

    /// What the core steps.
    pub fn model<'a>(&'a self, how: How, rows: &'a Rows<'_>, tables: &'a Tables<'_>) -> PyResult<Model<'a>> {
        let spec = Spec {
            given: self.given.clone(),
            rows: rows.iter().map(by_row).collect::<PyResult<Vec<_>>>()?.concat(),
            tables: tables
                .iter()
                .map(|(start, interval, t)| Ok(Table { samples: by_row(t)?, start: *start, interval: *interval }))
                .collect::<PyResult<_>>()?,
        };
        Ok(Model { spec, scene: Scene { given: self.given.clone(), how, record: self.record.clone() } })
    }
}
