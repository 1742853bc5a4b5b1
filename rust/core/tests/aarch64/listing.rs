//! Kernels read back by a disassembler.

use std::{collections::BTreeSet, fs, path::Path, process::Command};

use crate::emulated::Case;
use stepwell_core::{
    kernel::writer::Shape,
    tape::{
        Op,
        real::{Precision, Real},
    },
};

const DISASSEMBLER: &str = "aarch64-linux-gnu-objdump";

/// The instructions that kernels may have. All others are not exact, or not the same on all machines.
#[rustfmt::skip]
const KNOWN: [&str; 43] = [
    "fadd", "fsub", "fmul", "fdiv", "fsqrt", "fneg", "frintm", "fmadd", "fmsub", "fnmsub", "fmla", "fmls", "fcmeq", "fcmgt", "fcmge",
    "and", "orr", "eor", "bsl", "bit", "bif", "add", "shl", "ushr", "mov", "dup", "movk", "sub", "subs", "b.ne", "b.eq", "b", "ret", "nop",
    "ldr", "str", "ldp", "stp", "mrs", "msr", "fmov", "movz", "movn",
];

/// The instructions of a kernel, as a disassembler names them, with their operands.
fn instructions(code: &[u8], file: &str) -> Vec<(String, String)> {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(file);
    fs::write(&file, code).unwrap();
    let out = Command::new(DISASSEMBLER).args(["-D", "-b", "binary", "-m", "aarch64"]).arg(&file).output().unwrap();
    let lines = String::from_utf8(out.stdout).unwrap();
    let named = |line: &str| {
        let mut fields = line.split('\t').skip(2);
        Some((fields.next()?.trim().to_owned(), fields.next().unwrap_or_default().to_owned()))
    };
    lines.lines().filter_map(named).collect()
}

/// The kind of the first operand: 4s of v31.4s, d of d31.
fn kind(operands: &str) -> &str {
    let first = operands.split([',', ' ']).next().unwrap_or_default();
    first.split_once('.').map_or(first.trim_end_matches(|c: char| c.is_ascii_digit()), |(_, kind)| kind)
}

fn read_back<T: Real>(file: &str) {
    if !crate::has(DISASSEMBLER) {
        return crate::skipped(&format!("there is no {DISASSEMBLER}"));
    }
    let known = BTreeSet::from(KNOWN);
    for seed in 0..40 {
        let Some(Case { body, assembled, .. }) = Case::<T>::all(seed).pop() else { continue };
        let shape: Shape = assembled.shape;
        let made = instructions(&assembled.code, file);
        assert_eq!(made.len(), assembled.code.len() / 4);
        let (one, vector) = if T::PRECISION == Precision::Double { ("d", "2d") } else { ("s", "4s") };
        for (name, operands) in &made {
            assert!(known.contains(name.as_str()), "seed {seed}: {name}");
            let general = |number: u32| {
                operands.split([',', ' ', '[', ']']).any(|each| each == format!("x{number}") || each == format!("w{number}"))
            };
            assert!(!general(18), "seed {seed}: {name} {operands}: x18 belongs to the system on macOS and on Windows");
            assert!(!(19..30).any(general), "seed {seed}: {name} {operands}: belongs to the caller");
            let is_right = match (&name[..1], name.as_str()) {
                ("f", _) => kind(operands) == if shape.width > 1 { vector } else { one },
                (_, "ldr" | "str") => [one, "q", "x"].contains(&kind(operands)),
                _ => true,
            };
            assert!(is_right, "seed {seed}: {name} {operands}");
        }
        let count = |kinds: &[&str]| made.iter().filter(|(name, _)| kinds.contains(&name.as_str())).count();
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

/// Nothing but arithmetic of these kinds, on numbers of their size, and exactly one instruction for each operation and vector.
#[test]
fn kernels_are_made_of_exact_instructions_one_for_each_operation() {
    read_back::<f64>("aarch64-code");
    read_back::<f32>("aarch64-code-single");
}
