//! What to step: names, parameters and tables that stay Python's.

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::{prelude::*, types::PyType};
use stepwell_core::{
    error::Error,
    group::{Row, Spec, Table},
    table::{self, Model},
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

/// A system and a method, or a linear map.
#[pyclass(module = "stepwell._core", frozen)]
pub struct ModelSpec {
    system: String,
    options: Vec<String>,
    sizes: Vec<usize>,
    rows: Vec<Py<PyArray2<f64>>>,
    tables: Vec<(f64, f64, Py<PyArray2<f64>>)>,
    method: String,
    matrix: Option<(Vec<f64>, usize)>,
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
    /// `matrix` is the nodes and the number of rows in the v slot, if the transition-matrix form is asked for.
    #[new]
    #[pyo3(signature = (system, options, sizes, rows, tables, method, matrix=None, record=Vec::new()))]
    #[allow(clippy::too_many_arguments, reason = "a flat boundary; the callers on both sides have structures")]
    fn new(
        system: String,
        options: Vec<String>,
        sizes: Vec<usize>,
        rows: Vec<Py<PyArray2<f64>>>,
        tables: Vec<(f64, f64, Py<PyArray2<f64>>)>,
        method: String,
        matrix: Option<(Vec<f64>, usize)>,
        record: Vec<String>,
    ) -> Self {
        ModelSpec { system, options, sizes, rows, tables, method, matrix, record }
    }
}

impl ModelSpec {
    /// Whether the v slot holds something else than v between steps.
    pub fn carries(&self) -> bool {
        self.matrix.is_none() && table::record(&self.method).is_some_and(|r| r.carry.is_some())
    }

    /// Borrows the parameters.
    pub fn rows<'py>(&self, py: Python<'py>) -> PyResult<Rows<'py>> {
        self.rows.iter().map(|r| Ok(r.bind(py).try_readonly()?)).collect()
    }

    /// Borrows the tables.
    pub fn tables<'py>(&self, py: Python<'py>) -> PyResult<Tables<'py>> {
        self.tables.iter().map(|(start, interval, t)| Ok((*start, *interval, t.bind(py).try_readonly()?))).collect()
    }

    /// What the core steps.
    pub fn model<'a>(&'a self, rows: &'a Rows<'_>, tables: &'a Tables<'_>) -> PyResult<Model<'a>> {
        let spec = Spec {
            system: &self.system,
            options: self.options.iter().map(String::as_str).collect(),
            sizes: self.sizes.clone(),
            rows: rows.iter().map(by_row).collect::<PyResult<Vec<_>>>()?.concat(),
            tables: tables
                .iter()
                .map(|(start, interval, t)| Ok(Table { samples: by_row(t)?, start: *start, interval: *interval }))
                .collect::<PyResult<_>>()?,
            record: self.record.iter().map(String::as_str).collect(),
        };
        Ok(match &self.matrix {
            None => Model::Direct { spec, method: &self.method },
            Some((nodes, v_rows)) => Model::Matrix { spec, nodes, v_rows: *v_rows },
        })
    }
}
