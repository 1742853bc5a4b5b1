//! Kernels under an emulator.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::{
    inputs::{Inputs, same, shape},
    random::{self, Random},
};
use stepwell_core::{
    functions,
    isa::Level,
    kernel::{
        interpret::Interpreter,
        writer::{Assembled, Shape, assemble, choose},
    },
    tape::{
        Op, Tape,
        number::{Symbol, record},
        real::{Precision, Real},
        split::Body,
    },
};

const COMPILER: &str = "aarch64-linux-gnu-gcc";
const EMULATOR: &str = "qemu-aarch64";

/// With how many numbers of steps each kernel is run.
const STEPS: [usize; 3] = [1, 2, 7];

/// To nearest; and upwards, with subnormal numbers taken for zero and every NaN replaced by one.
const ROUNDING: [u64; 2] = [0, 1 << 22 | 1 << 24 | 1 << 25];

/// A kernel with inputs.
pub(crate) struct Case<T> {
    seed: u64,
    pub body: Body,
    pub assembled: Assembled,
    inputs: Inputs<T>,
}

impl<T: Real> Case<T> {
    pub(crate) fn all(seed: u64) -> Vec<Case<T>> {
        let random = &mut Random(seed.wrapping_mul(0xD134_2543_DE82_EF95) ^ 0xA64);
        let operations = random::length(seed, random);
        let states = if random.once_in(6) { 1 + random.below(30) } else { 1 + random.below(5) };
        let body = random::body(random, operations, states);
        Case::of(seed, random, if T::PRECISION == Precision::Single { random::in_single(body) } else { body })
    }

    /// A random body or another one, in a random shape.
    fn of(seed: u64, random: &mut Random, body: Body) -> Vec<Case<T>> {
        let shape = if random.once_in(4) {
            choose(&body, Level::Neon, random.one_of(&[1, 2, 3, 4, 9, 60, 1000])).unwrap()
        } else {
            let width = random.one_of(&[1, 16 / size_of::<T>()]);
            Shape { bytes: size_of::<T>(), ..shape(random, body.ops.len(), Level::Neon, width) }
        };
        let assembled = assemble(&body, shape).unwrap_or_else(|| panic!("seed {seed}: {shape:?} is not written"));
        let case = |steps| {
            let inputs = Inputs::new(random, &body, shape.lanes(), steps);
            Case { seed, body: body.clone(), assembled: assembled.clone(), inputs }
        };
        STEPS.map(case).into()
    }

    /// As the runner reads it.
    fn write(&self, to: &mut Vec<u8>) {
        let Case { inputs, assembled, .. } = self;
        let pool = assembled.pool(&inputs.uniforms);
        let mut code = assembled.code.clone();
        code.resize(code.len().next_multiple_of(8), 0);
        let sizes = [code.len(), inputs.state.len(), inputs.rows.len(), pool.len(), inputs.per_step.len(), inputs.held.len()];
        let rounding = ROUNDING[self.seed as usize % 2];
        let (scratch, steps, size) = (assembled.frame.scratch as u64, inputs.steps as u64, size_of::<T>() as u64);
        let head = sizes.map(|size| size as u64).into_iter().chain([scratch, steps, rounding, size]);
        let bytes = |numbers: &[T]| numbers.iter().flat_map(|x| x.pattern().to_le_bytes()[..size_of::<T>()].to_vec()).collect();
        to.extend(head.flat_map(u64::to_le_bytes));
        to.extend(code);
        let per_step = inputs.per_step.iter().copied().flat_map(u64::to_le_bytes).collect();
        let arrays: [Vec<u8>; 5] = [bytes(&inputs.state), bytes(&inputs.rows), bytes(&pool), per_step, bytes(&inputs.held)];
        to.extend(arrays.concat());
    }
}

/// The next `count` bytes as an integer; None if there are fewer.
fn next(bytes: &mut &[u8], count: usize) -> Option<u64> {
    let (of, rest) = bytes.split_at_checked(count)?;
    *bytes = rest;
    Some(of.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
}

/// The compiled runner; None where there is no compiler or no emulator, and it has been said.
pub(crate) fn runner(files: &str) -> Option<PathBuf> {
    for program in [COMPILER, EMULATOR] {
        if !crate::has(program) {
            crate::skipped(&format!("there is no {program}"));
            return None;
        }
    }
    let runner = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("aarch64-{files}-runner"));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/aarch64/runner.c");
    let compiled = Command::new(COMPILER).args(["-O1", "-Wall", "-Werror", "-static", "-o"]).args([&runner, &source]).output();
    let compiled = compiled.unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    Some(runner)
}

/// Runs all and compares with the interpreter; how many numbers are the same, or what is the first that is not. Tests that run at
/// the same time use files of their own.
pub(crate) fn compare<T: Real>(runner: &Path, cases: &[Case<T>], files: &str) -> Result<usize, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let [from, to] = ["cases", "states"].map(|kind| folder.join(format!("aarch64-{files}-{kind}")));
    let mut bytes = Vec::new();
    cases.iter().for_each(|case| case.write(&mut bytes));
    fs::write(&from, &bytes).unwrap();
    let ran = Command::new(EMULATOR).args([runner, &from, &to]).output().unwrap();
    let out = fs::read(&to).unwrap();
    let mut out = &out[..];
    let mut compared = 0;
    for Case { seed, body, assembled, inputs } in cases {
        let (shape, lanes, steps) = (assembled.shape, assembled.shape.lanes(), inputs.steps);
        let about = format!("seed {seed}, {shape:?}, {steps} steps");
        let want = inputs.run(&Interpreter::new(body, lanes, Level::Baseline), &mut Vec::new());
        for (at, want) in want.iter().enumerate() {
            let Some(got) = next(&mut out, size_of::<T>()).map(T::from_pattern) else {
                return Err(format!("{about}: {} {}", ran.status, String::from_utf8_lossy(&ran.stderr)));
            };
            if !same(*want, got) {
                return Err(format!("{about}: state {}, lane {} is {got:?}, not {want:?}", at / lanes, at % lanes));
            }
            compared += 1;
        }
        if next(&mut out, 8) != Some(0) {
            return Err(format!("{about}: registers that belong to the caller have changed"));
        }
    }
    if !ran.status.success() || !out.is_empty() {
        return Err(String::from_utf8_lossy(&ran.stderr).into_owned());
    }
    Ok(compared)
}

/// `STEPWELL_EMULATED` says how many kernels: few in the everyday tests, since an emulator takes its time.
fn compare_random<T: Real>(files: &str) {
    let Some(runner) = runner(files) else { return };
    let kernels = std::env::var("STEPWELL_EMULATED").ok().and_then(|n| n.parse().ok()).unwrap_or(50);
    let mut compared = 0;
    for first in (0..kernels).step_by(500) {
        let cases: Vec<Case<T>> = (first..kernels.min(first + 500)).flat_map(Case::all).collect();
        compared += compare(&runner, &cases, files).unwrap_or_else(|wrong| panic!("{wrong}"));
    }
    println!("{kernels} kernels, {compared} numbers compared");
    assert!(compared as u64 > 20 * kernels);
}

#[test]
fn random_bodies_have_the_bits_of_the_interpreter() {
    compare_random::<f64>("random");
}

#[test]
fn random_bodies_of_single_precision_have_the_bits_of_the_interpreter() {
    compare_random::<f32>("random-single");
}

/// Functions of the numbers of a row. Those of 32 bits have constants and shifts of their own.
fn compare_functions<T: Real>(files: &str) {
    const FUNCTIONS: [fn(Symbol) -> Symbol; 3] = [functions::sin, functions::cos, functions::log];
    let Some(runner) = runner(files) else { return };
    let case = |seed: u64| {
        let (tape, made) = record(Tape::new(T::PRECISION), || FUNCTIONS[seed as usize % 3](Symbol::new(Op::Row(0))));
        let body = Body { ops: tape.ops().to_vec(), next: vec![made.0], rows: 1, precision: T::PRECISION, ..Body::default() };
        Case::<T>::of(seed, &mut Random(seed), body)
    };
    let cases: Vec<Case<T>> = (0..60).flat_map(case).collect();
    let compared = compare(&runner, &cases, files).unwrap_or_else(|wrong| panic!("{wrong}"));
    println!("{compared} numbers compared");
    assert!(compared > 1000);
}

#[test]
fn functions_have_the_bits_of_the_interpreter() {
    compare_functions::<f64>("functions");
    compare_functions::<f32>("functions-single");
}
