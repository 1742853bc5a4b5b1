//! The real-time loop over the user's own arrays.

use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use stepwell_core::{group::Clock, isa::Level, world};

use crate::model::{ModelSpec, argument_error, core_error};

/// A prepared loop. It holds both arrays.
#[pyclass(module = "stepwell._core")]
pub struct World {
    world: world::World,
    v: Py<PyArrayDyn<f64>>,
    y: Py<PyArrayDyn<f64>>,
    /// Steps between two looks at pending signals.
    patience: i64,
}

#[pymethods]
impl World {
    #[new]
    #[pyo3(signature = (model, *, t0, dt, start, first, members, v, y))]
    #[allow(clippy::too_many_arguments, reason = "a flat boundary")]
    fn new(
        py: Python<'_>,
        model: &ModelSpec,
        t0: f64,
        dt: f64,
        start: usize,
        first: i64,
        members: usize,
        v: Py<PyArrayDyn<f64>>,
        y: Py<PyArrayDyn<f64>>,
    ) -> PyResult<Self> {
        let clock = Clock { t0, h: dt, start, level: Level::choose().map_err(core_error)? };
        let rows = model.rows(py)?;
        let tables = model.tables(py)?;
        let world =
            world::World::new(&model.model(&rows, &tables)?, clock, members, model.carries(), first).map_err(core_error)?;
        let sizes = world.sizes();
        let (v_size, y_size) =
            (v.bind(py).try_readwrite()?.as_slice_mut()?.len(), y.bind(py).try_readwrite()?.as_slice_mut()?.len());
        if (v_size, y_size) != sizes {
            return Err(argument_error("v and y must be of the system's shape".to_owned()));
        }
        let patience = ((1 << 22) / (sizes.0 + sizes.1).max(1) as i64).max(1);
        Ok(World { world, v, y, patience })
    }

    /// `n` steps, in place.
    #[pyo3(signature = (n = 1))]
    fn step(&mut self, py: Python<'_>, n: i64) -> PyResult<()> {
        if n < 0 {
            return Err(argument_error(format!("n must be a number of steps, zero or more; got {n}")));
        }
        let (mut v, mut y) = (self.v.bind(py).try_readwrite()?, self.y.bind(py).try_readwrite()?);
        let (v, y) = (v.as_slice_mut()?, y.as_slice_mut()?);
        let mut left = n;
        while left > self.patience {
            // Long enough to let other threads run, and to look for Ctrl-C.
            py.detach(|| self.world.step(self.patience, v, y));
            left -= self.patience;
            py.check_signals()?;
        }
        self.world.step(left, v, y);
        Ok(())
    }

    /// The time at which the world stands.
    #[getter]
    fn t(&self) -> f64 {
        self.world.time()
    }

    /// The number of the step at which the world stands.
    #[getter]
    fn step_number(&self) -> i64 {
        self.world.step_number()
    }
}
