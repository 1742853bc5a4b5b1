//! Every kernel of the core: each method on each variant of each system, and the matrix form.
//!
//! Methods come from the catalogue by themselves; a new system, or a new option of one, is a line in [`variants`].

use stepwell_core::{
    error::Error,
    group::{Clock, Group, Row, Spec, Table, Width},
    isa::Level,
    table::{Model, RECORDS},
};

/// Steps at once: enough that what surrounds them does not count.
pub const STEPS: i64 = 256;

/// Small, so that no method leaves the finite range in [`STEPS`] steps.
const H: f64 = 1e-3;

/// A variant of a system, with the same parameters for every member, and a state to start from.
#[derive(Clone, Debug, Default)]
pub struct Variant {
    /// The system's name.
    pub system: &'static str,
    options: Vec<&'static str>,
    sizes: Vec<usize>,
    parameters: Vec<f64>,
    /// How many sampled inputs.
    tables: usize,
    v: Vec<f64>,
    y: Vec<f64>,
    /// For a linear map: its nodes.
    nodes: Vec<f64>,
}

/// A variant stepped by a method.
#[derive(Clone, Debug)]
pub struct Kernel {
    variant: Variant,
    /// The method's name; empty for a linear map, which has none.
    pub method: &'static str,
}

fn oscillator(options: &[&'static str]) -> Variant {
    Variant {
        system: "oscillator",
        options: options.to_vec(),
        parameters: vec![1.3, 0.1, 0.5, 1.1, 0.3, 0.4, 0.9, 0.7],
        tables: options.iter().filter(|o| o.ends_with("held")).count(),
        v: vec![0.0],
        y: vec![1.0],
        ..Variant::default()
    }
}

fn matrix(size: usize, options: &[&'static str], nodes: &[f64]) -> Variant {
    let sines = options.iter().filter(|o| **o == "sine").count();
    let map = (0..size * size).map(|i| if i % (size + 1) == 0 { 0.9 } else { 1e-3 });
    let pulses = (0..nodes.len() * options.len() * size).map(|_| 1e-3);
    Variant {
        system: "matrix",
        options: options.to_vec(),
        sizes: vec![size],
        parameters: map.chain(pulses).chain([0.5, 1.1, 0.3].repeat(sines)).collect(),
        tables: options.len() - sines,
        v: vec![0.5; size / 2],
        y: vec![1.0; size - size / 2],
        nodes: nodes.to_vec(),
    }
}

/// A chain of `n` masses as a linear system, with one input on each.
fn linear(n: usize, options: &[&'static str]) -> Variant {
    let inputs = options.iter().filter(|o| **o != "acceleration");
    let (m, sines) = (inputs.clone().count(), inputs.filter(|o| **o == "sine").count());
    let a = |i: usize, j: usize| match (i < n, j < n) {
        (true, false) => match (j - n).abs_diff(i) {
            0 => -2.0,
            1 => 1.0,
            _ => 0.0,
        },
        (false, true) if i - n == j => 1.0,
        _ => 0.0,
    };
    let entries = (0..4 * n * n).map(|place| a(place / (2 * n), place % (2 * n)));
    let forces = (0..2 * n * m).map(|place| if place / m < n { 0.1 } else { 0.0 });
    Variant {
        system: "linear",
        options: options.to_vec(),
        sizes: vec![n, n],
        parameters: entries.chain(forces).chain([0.5, 1.1, 0.3].repeat(sines)).collect(),
        tables: m - sines,
        v: vec![0.0; n],
        y: (0..n).map(|i| 1.0 / (i + 1) as f64).collect(),
        ..Variant::default()
    }
}

/// Bodies on a circle, at rest.
fn bodies(n: usize, dim: usize, options: &[&'static str]) -> Variant {
    let angle = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
    let place = |i: usize| [angle(i).cos(), angle(i).sin(), 0.1 * i as f64].into_iter().take(dim).collect::<Vec<_>>();
    let mut parameters = vec![1.0 / n as f64; 2 * n];
    parameters.push(0.01); // softening
    parameters.resize(2 * n + 1 + (options.len() - 1) * if options.last() == Some(&"control:limited") { 2 } else { 1 }, 0.0);
    Variant {
        system: "nbody",
        options: options.to_vec(),
        sizes: vec![n, dim],
        parameters,
        v: vec![0.1; n * dim],
        y: (0..n).flat_map(place).collect(),
        ..Variant::default()
    }
}

/// Every variant of every system.
pub fn variants() -> Vec<Variant> {
    let mut all = Vec::new();
    for form in ["canonical", "physical"] {
        let forces: [&[&'static str]; 8] = [
            &[],
            &["damped"],
            &["x:held"],
            &["a:sine"],
            &["damped", "a:sine"],
            &["x:held", "a:held"],
            &["x:held", "a:sine"],
            &["x:sine", "a:sine"],
        ];
        all.extend(forces.map(|force| oscillator(&[&[form], force].concat())));
    }
    all.push(bodies(3, 2, &["logarithmic"]));
    all.push(bodies(3, 3, &["newton"]));
    all.push(bodies(6, 3, &["newton"]));
    all.push(bodies(64, 3, &["newton"]));
    all.push(bodies(64, 3, &["newton", "control:limited"]));
    all.push(bodies(64, 3, &["newton", "project:scaling"]));
    all.extend([4, 32].map(|n| Variant {
        system: "chain",
        sizes: vec![n],
        parameters: vec![1.0; 2 * n + 1],
        v: vec![0.0; n],
        y: (0..n).map(|i| 1.0 / (i + 1) as f64).collect(),
        ..Variant::default()
    }));
    let drives: [&[&'static str]; 4] = [&[], &["damped"], &["damped", "held"], &["damped", "sine"]];
    all.extend(drives.map(|options| Variant {
        system: "pendulum",
        options: options.to_vec(),
        parameters: vec![1.3, 0.1, 0.5, 1.1, 0.3],
        tables: usize::from(options.contains(&"held")),
        v: vec![0.0],
        y: vec![1.0],
        ..Variant::default()
    }));
    all.push(Variant {
        system: "restricted_three_body",
        parameters: vec![0.1],
        v: vec![0.1, 0.9],
        y: vec![0.7, 0.3],
        ..Variant::default()
    });
    all.push(linear(1, &["acceleration"]));
    all.push(linear(1, &["sine"]));
    all.push(linear(2, &["held", "sine"]));
    all.push(linear(8, &[]));
    all.push(linear(32, &["acceleration"]));
    all.push(matrix(2, &[], &[0.0]));
    all.push(matrix(2, &["sine"], &[0.0, 1.0]));
    all.push(matrix(2, &["held"], &[0.0, 1.0]));
    all.push(matrix(16, &[], &[0.0]));
    all
}

/// Every variant by every method; some methods refuse some.
pub fn kernels() -> Vec<Kernel> {
    let methods = |variant: &Variant| match variant.system {
        "matrix" => vec![""],
        _ => RECORDS.iter().map(|record| record.name).collect(),
    };
    let of = |variant: Variant| methods(&variant).into_iter().map(move |method| Kernel { variant: variant.clone(), method });
    variants().into_iter().flat_map(of).collect()
}

impl Kernel {
    /// System, options and method.
    pub fn name(&self) -> String {
        let Variant { system, options, sizes, .. } = &self.variant;
        let sizes = sizes.iter().map(usize::to_string).collect::<Vec<_>>();
        let parts = [*system].into_iter().chain(options.iter().copied()).chain(sizes.iter().map(String::as_str));
        let name = parts.collect::<Vec<_>>().join(" ");
        if self.method.is_empty() { name } else { format!("{name}/{}", self.method) }
    }

    /// A group that is ready to step, or none if the method cannot do the system.
    pub fn group(&self, level: Level, width: Width) -> Result<Option<Box<dyn Group>>, Error> {
        let Variant { system, options, sizes, parameters, tables, v, nodes, .. } = &self.variant;
        let samples: Vec<f64> = (0..16).map(|i| f64::from(i % 5) - 2.0).collect();
        let table = Table { samples: samples.chunks(1).map(Row).collect(), start: 0.0, interval: 20.0 * H };
        let spec = Spec {
            system,
            options: options.clone(),
            sizes: sizes.clone(),
            rows: parameters.chunks(1).map(Row).collect(),
            tables: vec![table; *tables],
            record: Vec::new(),
        };
        let model = match self.method {
            "" => Model::Matrix { spec, nodes, v_rows: v.len() },
            method => Model::Direct { spec, method },
        };
        let clock = Clock { t0: 0.0, h: H, start: 0, level, threads: 1 };
        let mut group = match model.group(&clock, width) {
            Err(Error::VelocityDependent { .. }) => return Ok(None),
            made => made?,
        };
        group.prepare(model.spec(), 0, group.lanes());
        Ok(Some(group))
    }

    /// Steps the group [`STEPS`] times from the start, so that no run is longer than another and nothing decays to denormals.
    pub fn run(&self, group: &mut dyn Group) {
        let lanes = group.lanes();
        let (v, y) = group.slots_mut();
        for (slot, start) in [(v, &self.variant.v), (y, &self.variant.y)] {
            for (row, x) in slot.chunks_exact_mut(lanes).zip(start) {
                row.fill(*x);
            }
        }
        group.start(0);
        group.advance(0, STEPS);
    }
}

#[cfg(test)]
mod tests {
    use super::{Level, Width, kernels, variants};
    use stepwell_core::table::SYSTEMS;

    #[test]
    fn every_system_has_a_variant() {
        for system in SYSTEMS {
            assert!(variants().iter().any(|v| v.system == *system), "{system} is not timed");
        }
    }

    #[test]
    fn every_kernel_runs_and_stays_finite() -> Result<(), stepwell_core::error::Error> {
        for kernel in kernels() {
            for width in [Width::Wide, Width::Narrow] {
                let Some(mut group) = kernel.group(Level::Baseline, width)? else { continue };
                kernel.run(group.as_mut());
                let (v, y) = group.slots();
                assert!(v.iter().chain(y).all(|x| x.is_finite()), "{}", kernel.name());
            }
        }
        Ok(())
    }
}
