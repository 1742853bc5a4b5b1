//! Models: systems and methods over any kind of number, and the parts around a system.

pub mod around;
mod elimination;
pub(crate) mod implicit;
pub(crate) mod kepler;
pub mod method;
pub mod methods;
mod newton;
pub(crate) mod ordering;
mod pivoting;
pub mod program;
mod rosenbrock;
pub(crate) mod signal;
pub mod spec;
pub mod steppers;
pub mod system;
pub mod systems;
mod tableau;
pub(crate) mod window;
