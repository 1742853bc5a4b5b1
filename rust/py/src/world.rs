//! The real-time loop over the user's own arrays.

use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::{buffer::PyBuffer, prelude::*};
use stepwell_core::{
    isa::Level,
    run::{Machine, stage::Clock, world},
};

use crate::model::{ModelSpec, argument_error, core_error};

/// How the arrays are reached.
enum Arrays {
    /// A few numbers are copied in and out: that takes a third of the time of asking for leave to write.
    Few { buffers: (PyBuffer<f64>, PyBuffer<f64>), copies: (Vec<f64>, Vec<f64>) },
    /// Many are stepped where they are.
    Many { v: Py<PyArrayDyn<f64>>, y: Py<PyArrayDyn<f64>> },
}

/// Arrays of up to so many numbers are copied.
const FEW: usize = 256;

/// A prepared loop. It holds both arrays.
#[pyclass(module = "stepwell._core")]
pub struct World {
    world: world::World,
    arrays: Arrays,
    /// Steps between two looks at pending signals.
    patience: i64,
}

/// `n` steps; long ones let other threads run, and look for Ctrl-C.
fn advance(py: Python<'_>, world: &mut world::World, patience: i64, mut n: i64, v: &mut [f64], y: &mut [f64]) -> PyResult<()> {
    while n > patience {
        py.detach(|| world.step(patience, v, y));
        n -= patience;
        py.check_signals()?;
    }
    world.step(n, v, y);
    Ok(())
}

/// What is read of a plan: see `Plan` in `engine.py`.
#[derive(FromPyObject)]
struct WorldPlan {
    t0: f64,
    dt: f64,
    choice: usize,
    first: i64,
    members: usize,
}

#[pymethods]
impl World {
    #[new]
    fn new(py: Python<'_>, model: &ModelSpec, plan: WorldPlan, v: Py<PyArrayDyn<f64>>, y: Py<PyArrayDyn<f64>>) -> PyResult<Self> {
        let WorldPlan { t0, dt, choice, first, members } = plan;
        let (clock, machine) =
            (Clock { t0, h: dt }, Machine { level: Level::choose().map_err(|unknown| core_error(unknown.into()))?, threads: 1 });
        let rows = model.rows(py)?;
        let tables = model.tables(py)?;
        let model = model.model(model.started(choice), &rows, &tables)?;
        let world = world::World::new(&model, clock, machine, members, first).map_err(core_error)?;
        let sizes = world.sizes();
        let (v_size, y_size) =
            (v.bind(py).try_readwrite()?.as_slice_mut()?.len(), y.bind(py).try_readwrite()?.as_slice_mut()?.len());
        if (v_size, y_size) != sizes {
            return Err(argument_error("v and y must be of the system's shape".to_owned()));
        }
        let patience = ((1 << 22) / (sizes.0 + sizes.1).max(1) as i64).max(1);
        let arrays = if sizes.0.max(sizes.1) <= FEW {
            let buffers = (PyBuffer::get(v.bind(py))?, PyBuffer::get(y.bind(py))?);
            Arrays::Few { buffers, copies: (vec![0.0; sizes.0], vec![0.0; sizes.1]) }
        } else {
            Arrays::Many { v, y }
        };
        Ok(World { world, arrays, patience })
    }

    /// `n` steps, in place.
    #[pyo3(signature = (n = 1))]
    fn step(&mut self, py: Python<'_>, n: i64) -> PyResult<()> {
        if n < 0 {
            return Err(argument_error(format!("n must be a number of steps, zero or more; got {n}")));
        }
        let (world, patience) = (&mut self.world, self.patience);
        match &mut self.arrays {
            Arrays::Few { buffers, copies: (v, y) } => {
                buffers.0.copy_to_slice(py, v)?;
                buffers.1.copy_to_slice(py, y)?;
                let result = advance(py, world, patience, n, v, y);
                buffers.0.copy_from_slice(py, v)?;
                buffers.1.copy_from_slice(py, y)?;
                result
            }
            Arrays::Many { v, y } => {
                let (mut v, mut y) = (v.bind(py).try_readwrite()?, y.bind(py).try_readwrite()?);
                advance(py, world, patience, n, v.as_slice_mut()?, y.as_slice_mut()?)
            }
        }
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
