//! Kernels under an emulator.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::{
    inputs::{Inputs, same, shape},
    random::{self, Random},
};
use stepwell_core::{
    isa::Level,
    kernel::{
        interpret::Interpreter,
        writer::{Assembled, Shape, assemble, choose},
    },
    tape::{Op, split::Body},
};

const COMPILER: &str = "aarch64-linux-gnu-gcc";
const EMULATOR: &str = "qemu-aarch64";
const DISASSEMBLER: &str = "aarch64-linux-gnu-objdump";

/// How many kernels are run with how many numbers of steps each, unless `STEPWELL_EMULATED` says how many.
const KERNELS: u64 = 1000;
const STEPS: [usize; 3] = [1, 2, 7];

/// To nearest; and upwards, with subnormal numbers taken for zero and every NaN replaced by one.
const ROUNDING: [u64; 2] = [0, 1 << 22 | 1 << 24 | 1 << 25];

/// A kernel with inputs.
struct Case {
    seed: u64,
    body: Body,
    assembled: Assembled,
    inputs: Inputs,
}

impl Case {
    fn all(seed: u64) -> Vec<Case> {
        let random = &mut Random(seed.wrapping_mul(0xD134_2543_DE82_EF95) ^ 0xA64);
        let operations = match random.below(8) {
            0 => 3 + random.below(6),
            7 => 200 + random.below(300),
            _ => 8 + random.below(80),
        };
        let states = if random.once_in(6) { 1 + random.below(30) } else { 1 + random.below(5) };
        let body = random::body(random, operations, states);
        let shape = if random.once_in(4) {
            choose(&body, Level::Neon, random.one_of(&[1, 2, 3, 4, 9, 60, 1000])).unwrap()
        } else {
            let width = 1 + random.below(2);
            shape(random, Level::Neon, width)
        };
        let assembled = assemble(&body, shape).unwrap_or_else(|| panic!("seed {seed}: {shape:?} is not written"));
        let case = |steps| {
            let inputs = Inputs::<f64>::new(random, &body, shape.lanes(), steps);
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
        let head =
            sizes.map(|size| size as u64).into_iter().chain([assembled.frame.scratch as u64, inputs.steps as u64, rounding, 0]);
        let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
        to.extend(head.flat_map(u64::to_le_bytes));
        to.extend(code);
        let numbers = [bits(&inputs.state), bits(&inputs.rows), bits(&pool), inputs.per_step.clone(), bits(&inputs.held)];
        to.extend(numbers.into_iter().flatten().flat_map(u64::to_le_bytes));
    }
}

/// The compiled runner; None where there is no compiler or no emulator, and it has been said.
fn runner(files: &str) -> Option<PathBuf> {
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

/// Runs all and compares with the interpreter; how many numbers are the same, or what is the first that is not. Tests that run at the same
/// time use files of their own.
fn compare(runner: &Path, cases: &[Case], files: &str) -> Result<usize, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let [from, to] = ["cases", "states"].map(|kind| folder.join(format!("aarch64-{files}-{kind}")));
    let mut bytes = Vec::new();
    cases.iter().for_each(|case| case.write(&mut bytes));
    fs::write(&from, &bytes).unwrap();
    let ran = Command::new(EMULATOR).args([runner, &from, &to]).output().unwrap();
    let out = fs::read(&to).unwrap();
    let mut numbers = out.as_chunks().0.iter().map(|bits| u64::from_le_bytes(*bits));
    let mut compared = 0;
    for Case { seed, body, assembled, inputs } in cases {
        let (shape, lanes, steps) = (assembled.shape, assembled.shape.lanes(), inputs.steps);
        let about = format!("seed {seed}, {shape:?}, {steps} steps");
        let want = inputs.run(&Interpreter::new(body, lanes, Level::Baseline), &mut Vec::new());
        for (at, want) in want.iter().enumerate() {
            let Some(got) = numbers.next().map(f64::from_bits) else {
                return Err(format!("{about}: {} {}", ran.status, String::from_utf8_lossy(&ran.stderr)));
            };
            if !same(*want, got) {
                return Err(format!("{about}: state {}, lane {} is {got:?}, not {want:?}", at / lanes, at % lanes));
            }
            compared += 1;
        }
        if numbers.next() != Some(0) {
            return Err(format!("{about}: registers that belong to the caller have changed"));
        }
    }
    if !ran.status.success() || numbers.next().is_some() {
        return Err(String::from_utf8_lossy(&ran.stderr).into_owned());
    }
    Ok(compared)
}

/// `STEPWELL_EMULATED` says how many kernels.
#[test]
fn random_bodies_have_the_bits_of_the_interpreter() {
    let Some(runner) = runner("random") else { return };
    let kernels = std::env::var("STEPWELL_EMULATED").ok().and_then(|n| n.parse().ok()).unwrap_or(KERNELS);
    let mut compared = 0;
    for first in (0..kernels).step_by(500) {
        let cases: Vec<Case> = (first..kernels.min(first + 500)).flat_map(Case::all).collect();
        compared += compare(&runner, &cases, "random").unwrap_or_else(|wrong| panic!("{wrong}"));
    }
    println!("{kernels} kernels, {compared} numbers compared");
    assert!(compared as u64 > 20 * kernels);
}

/// Mistakes: what is written, which bits of a word say so, and a wrong word for these bits.
const MISTAKES: [(&str, u32, u32, u32); 12] = [
    ("a sum for a difference", 0xFFE0_FC00, 0x4EE0_D400, 0x4E60_D400),
    ("less or equal for less", 0xFFE0_FC00, 0x6EE0_E400, 0x6E60_E400),
    ("less for less or equal", 0xFFE0_FC00, 0x6E60_E400, 0x6EE0_E400),
    ("a fused sum for a fused difference", 0xFFE0_FC00, 0x4EE0_CC00, 0x4E60_CC00),
    ("a fused difference with the wrong sign, of one number", 0xFFE0_8000, 0x1F60_8000, 0x1F40_8000),
    ("the other choice", 0xFFE0_FC00, 0x6E60_1C00, 0x6EE0_1C00),
    ("the other place", 0xFFE0_FC00, 0x6EA0_1C00, 0x6EE0_1C00),
    ("to the nearest whole number for downwards", 0xFFFF_FC00, 0x4E61_9800, 0x4E61_8800),
    ("the sign moved down with the bits", 0xFF80_FC00, 0x6F00_0400, 0x4F00_0400),
    ("one number in the first lane only", 0xFFFF_FC00, 0x4E08_0400, 0x5E08_0400),
    ("rounding as the caller does", u32::MAX, 0xD51B_441F, 0xD503_201F),
    ("a register of the caller not given back", u32::MAX, 0x6D41_2FEA, 0xD503_201F),
];

#[test]
fn every_mistake_is_noticed() {
    let Some(runner) = runner("mistakes") else { return };
    for (what, bits, right, wrong) in MISTAKES {
        assert_eq!(right & !bits, 0, "{what}");
        // Few kernels show some of them: a wrong number may be lost in a choice.
        let is_noticed = (0..300).step_by(60).any(|first| {
            let mut made = 0;
            let mut cases: Vec<Case> = (first..first + 60).flat_map(Case::all).collect();
            for word in cases.iter_mut().flat_map(|case| case.assembled.code.as_chunks_mut().0) {
                let old = u32::from_le_bytes(*word);
                if old & bits == right {
                    *word = (old ^ right ^ wrong).to_le_bytes();
                    made += 1;
                }
            }
            made > 0 && compare(&runner, &cases, "mistakes").is_err()
        });
        assert!(is_noticed, "{what}");
    }
}

/// What kernels are made of. What is not here is not exact, or not the same on all machines.
#[rustfmt::skip]
const KNOWN: [&str; 43] = [
    "fadd", "fsub", "fmul", "fdiv", "fsqrt", "fneg", "frintm", "fmadd", "fmsub", "fnmsub", "fmla", "fmls", "fcmeq", "fcmgt", "fcmge",
    "and", "orr", "eor", "bsl", "bit", "bif", "add", "shl", "ushr", "mov", "dup", "movk", "sub", "subs", "b.ne", "b.eq", "b", "ret", "nop",
    "ldr", "str", "ldp", "stp", "mrs", "msr", "fmov", "movz", "movn",
];

/// The instructions of a kernel, as a disassembler names them.
fn mnemonics(code: &[u8]) -> Vec<String> {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("aarch64-code");
    fs::write(&file, code).unwrap();
    let out = Command::new(DISASSEMBLER).args(["-D", "-b", "binary", "-m", "aarch64"]).arg(&file).output().unwrap();
    let lines = String::from_utf8(out.stdout).unwrap();
    let named = |line: &str| Some(line.split('\t').nth(2)?.trim().to_string());
    lines.lines().filter_map(named).collect()
}

/// Read back: nothing but arithmetic of these kinds, and exactly one instruction for each operation and vector.
#[test]
fn kernels_are_made_of_exact_instructions_one_for_each_operation() {
    if !crate::has(DISASSEMBLER) {
        return crate::skipped(&format!("there is no {DISASSEMBLER}"));
    }
    let known = BTreeSet::from(KNOWN);
    for seed in 0..40 {
        let Some(Case { body, assembled, .. }) = Case::all(seed).pop() else { continue };
        let shape: Shape = assembled.shape;
        let names = mnemonics(&assembled.code);
        assert_eq!(names.len(), assembled.code.len() / 4);
        for name in &names {
            assert!(known.contains(name.as_str()), "seed {seed}: {name}");
        }
        let count = |kinds: &[&str]| names.iter().filter(|name| kinds.contains(&name.as_str())).count();
        let want = |is: fn(&Op) -> bool| shape.block_vectors * body.ops.iter().filter(|op| is(op)).count();
        assert_eq!(count(&["fadd"]), want(|op| matches!(op, Op::Add(..))), "seed {seed}");
        assert_eq!(count(&["fsub"]), want(|op| matches!(op, Op::Sub(..))), "seed {seed}");
        assert_eq!(count(&["fmul"]), want(|op| matches!(op, Op::Mul(..))), "seed {seed}");
        assert_eq!(count(&["fdiv"]), want(|op| matches!(op, Op::Div(..))), "seed {seed}");
        assert_eq!(count(&["fsqrt"]), want(|op| matches!(op, Op::Sqrt(_))), "seed {seed}");
        let fused = want(|op| matches!(op, Op::MulAdd(..) | Op::MulSub(..) | Op::SubMul(..)));
        assert_eq!(count(&["fmadd", "fmsub", "fnmsub", "fmla", "fmls"]), fused, "seed {seed}");
        assert_eq!(count(&["b.ne"]), 1 + usize::from(shape.blocks > 1), "seed {seed}");
    }
}
