//! Kernels must not become slow: this is tested by their instructions and not by the clock. The loop of a kernel is read back and
//! compared with the operations of the step.
#![cfg(target_arch = "x86_64")]
#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod common;
#[path = "common/ring.rs"]
mod ring;

use std::sync::Arc;

use common::{Of, model, oscillators, spec};
use iced_x86::{Decoder, DecoderOptions, FlowControl, Instruction, InstructionInfoFactory, Mnemonic, OpAccess, OpKind, Register};
use stepwell_core::{
    error::Error,
    isa::Level,
    kernel::{
        pack::{self, Make},
        writer::{Shape, Written, choose, write, write_if_it_gains},
    },
    model::{
        spec::{Row, Table},
        steppers::RECORDS,
    },
    run::Model,
    step::{
        key::{StepKind, TapeKey},
        pace::Acceptance,
        tapes::Tapes,
    },
    tape::{Op, split::Body},
};

/// The work of one turn of the innermost loop, by numbers of instructions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Turn {
    /// Sums, products, quotients and roots, by whether they are of whole vectors of the shape.
    arithmetic: usize,
    narrower: usize,
    /// Reads and writes of the state.
    state_read: usize,
    state_written: usize,
    /// Reads and writes of what did not fit into registers.
    spilled: usize,
    /// All of them.
    all: usize,
}

fn is_arithmetic(mnemonic: Mnemonic) -> Option<bool> {
    use Mnemonic::*;
    match mnemonic {
        Vaddpd | Vsubpd | Vmulpd | Vdivpd | Vsqrtpd => Some(true),
        Vaddsd | Vsubsd | Vmulsd | Vdivsd | Vsqrtsd => Some(false),
        _ => None,
    }
}

/// The instructions between the target of the shortest backward branch and the branch.
fn innermost(code: &[u8]) -> Vec<Instruction> {
    let mut decoder = Decoder::with_ip(64, code, 0, DecoderOptions::NONE);
    let mut all: Vec<Instruction> = Vec::new();
    let mut shortest: Option<(usize, usize)> = None;
    while all.last().is_none_or(|i| i.flow_control() != FlowControl::Return) {
        let i = decoder.decode();
        if i.flow_control() == FlowControl::ConditionalBranch {
            let from = all.iter().position(|first| first.ip() == i.near_branch_target()).unwrap();
            if shortest.is_none_or(|(from, to)| to - from > all.len() - from) {
                shortest = Some((from, all.len() + 1));
            }
        }
        all.push(i);
    }
    let (from, to) = shortest.unwrap();
    all[from..to].to_vec()
}

fn turn(kernel: &Written) -> Turn {
    let mut turn = Turn::default();
    let mut factory = InstructionInfoFactory::new();
    let vector = match kernel.shape().width {
        8 => Register::is_zmm,
        4 => Register::is_ymm,
        _ => Register::is_xmm,
    };
    for i in innermost(kernel.code()) {
        turn.all += 1;
        match is_arithmetic(i.mnemonic()) {
            Some(packed) if packed == (kernel.shape().width > 1) && vector(i.op0_register()) => turn.arithmetic += 1,
            Some(_) => turn.narrower += 1,
            None => {}
        }
        if i.op_kinds().any(|kind| kind == OpKind::Memory) && i.mnemonic() != Mnemonic::Nop {
            let info = factory.info(&i);
            let writes = info.used_memory().iter().any(|m| matches!(m.access(), OpAccess::Write | OpAccess::ReadWrite));
            match (i.memory_base(), writes) {
                (Register::RDI, false) => turn.state_read += 1,
                (Register::RDI, true) => turn.state_written += 1,
                (Register::R9, _) => turn.spilled += 1,
                _ => {}
            }
        }
    }
    turn
}

/// How many sums, products, quotients and roots a body has.
fn arithmetic(body: &Body) -> usize {
    let is = |op: &&Op| matches!(op, Op::Add(..) | Op::Sub(..) | Op::Mul(..) | Op::Div(..) | Op::Sqrt(_));
    body.ops.iter().filter(is).count()
}

const ONE: Row = Row(&[0.7]);
const PER_MEMBER: Row = Row(&[0.5, 0.6, 0.7]);

fn sine(amplitude: Row<'static>) -> [(&'static str, Vec<Row<'static>>); 3] {
    [("a.amplitude", vec![amplitude]), ("a.omega", vec![ONE]), ("a.phase", vec![ONE])]
}

fn oscillator(method: &str) -> Model<'static> {
    oscillators(PER_MEMBER.0, method)
}

/// An oscillator, with samples of each member's own.
fn held(method: &str) -> Model<'static> {
    let tables = vec![("x", Table { samples: vec![PER_MEMBER; 5], start: 0.0, interval: 0.1 })];
    let (words, rows) = ([("form", "canonical")], [("omega", vec![PER_MEMBER])]);
    model(spec("oscillator", Of { words: &words, rows: &rows, tables, ..Of::default() }), method)
}

/// Damped ones, alone or under one drive, whose strength is their own.
fn pendulum(method: &str, driven: bool) -> Model<'static> {
    let mut rows = vec![("omega", vec![ONE]), ("damping", vec![ONE])];
    if driven {
        rows.extend(sine(PER_MEMBER));
    }
    model(spec("pendulum", Of { rows: &rows, ..Of::default() }), method)
}

fn three_bodies(method: &str) -> Model<'static> {
    let rows = [("masses", vec![PER_MEMBER; 3]), ("strength", vec![PER_MEMBER; 3]), ("softening", vec![ONE])];
    model(spec("nbody", Of { words: &[("force", "newton")], wholes: &[("dim", 3)], rows: &rows, ..Of::default() }), method)
}

/// As the figure-eight.
fn planar_bodies(method: &str) -> Model<'static> {
    let rows = [("masses", vec![ONE; 3]), ("strength", vec![ONE; 3]), ("softening", vec![ONE])];
    model(spec("nbody", Of { words: &[("force", "newton")], wholes: &[("dim", 2)], rows: &rows, ..Of::default() }), method)
}

fn chain(method: &str) -> Model<'static> {
    model(spec("chain", Of { rows: &[("stiffness", vec![ONE; 5]), ("mass", vec![PER_MEMBER; 4])], ..Of::default() }), method)
}

fn linear(method: &str) -> Model<'static> {
    let (words, wholes) = ([("kind", "acceleration")], [("n_v", 2)]);
    model(spec("linear", Of { words: &words, wholes: &wholes, rows: &[("rows", vec![ONE; 16])], ..Of::default() }), method)
}

fn restricted(method: &str) -> Model<'static> {
    model(spec("restricted_three_body", Of { rows: &[("mu", vec![ONE])], ..Of::default() }), method)
}

fn levels() -> impl Iterator<Item = Level> {
    [Level::Avx2, Level::Avx512].into_iter().filter(|level| level.here())
}

/// A single member, a vector of them, very many.
const MEMBERS: [usize; 3] = [1, 8, usize::MAX];
const UNLIMITED: usize = usize::MAX;

fn tapes(model: &Model) -> Arc<Tapes> {
    model.traced().unwrap().tapes().unwrap()
}

/// The kernel for a run of `members` members, the work of a turn of its loop, and how much arithmetic a step is.
fn written(model: &Model, level: Level, members: usize) -> (Shape, Turn, usize) {
    let tapes = tapes(model);
    let body = &tapes.step.split.body;
    let kernel = write(body, choose(body, level, members).unwrap()).unwrap();
    (kernel.shape(), turn(&kernel), arithmetic(body))
}

#[test]
fn no_kernel_computes_more_than_its_step_or_in_narrower_vectors() {
    let mut seen = 0;
    for method in RECORDS {
        let name = method.name;
        let mut models = vec![oscillator(name), held(name), pendulum(name, true), three_bodies(name), chain(name), linear(name)];
        models.push(restricted(name));
        if method.estimate.is_some() {
            // Adaptive steps.
            let attempts = |model: Model<'static>| {
                let how =
                    StepKind::Attempts { name: name.to_owned(), order: 0, acceptance: Acceptance::default(), backward: false };
                Model { key: TapeKey { how, ..model.key }, ..model }
            };
            models.extend([pendulum(name, true), restricted(name), three_bodies(name)].map(attempts));
        }
        for model in models {
            if matches!(model.traced(), Err(Error::VelocityDependent { .. })) {
                continue;
            }
            for (level, members) in levels().flat_map(|level| MEMBERS.map(|members| (level, members))) {
                let (shape, turn, arithmetic) = written(&model, level, members);
                let what = (turn.arithmetic, turn.narrower);
                assert_eq!(what, (shape.block_vectors * arithmetic, 0), "{:?}, {shape:?}: {turn:?}", model.key);
                seen += 1;
            }
        }
    }
    assert!(seen == 0 || seen > 200, "{seen}");
}

/// One member whose operations are packed: as many instructions of arithmetic as the packing has vectors of it, and so few beside
/// them.
#[test]
fn packed_kernels_compute_what_their_vectors_do() {
    for (model, most) in [(three_bodies("leapfrog"), 0.5), (three_bodies("rk4"), 0.5), (planar_bodies("false_euler"), 0.6)] {
        for level in levels() {
            let tapes = tapes(&model);
            let body = &tapes.step.split.body;
            let kernel = write_if_it_gains(body, choose(body, level, 1).unwrap()).unwrap();
            let (verdict, packed) = pack::best(body).unwrap();
            let turn = turn(&kernel);
            let is = |op: &Op| matches!(op, Op::Add(..) | Op::Sub(..) | Op::Mul(..) | Op::Div(..) | Op::Sqrt(_));
            let vectors = packed.unwrap().vectors.iter().filter(|vector| matches!(&vector.make, Make::Op(op) if is(op))).count();
            assert_eq!(turn.arithmetic + turn.narrower, vectors, "{:?}, {level:?}", model.key);
            assert!((vectors as f64) < most * arithmetic(body) as f64, "{vectors} of {}", arithmetic(body));
            assert!(verdict.gains() && verdict.packed.unwrap() >= verdict.chain, "{verdict:?}");
            // Beside them: moves between lanes, the count of steps, and what 32 registers do not hold: with RK4 13 % of the
            // vectors.
            if level == Level::Avx512 {
                assert!(turn.all <= vectors + verdict.moves + turn.spilled + 4, "{turn:?}, {verdict:?}");
                assert!(100 * turn.spilled <= 16 * vectors, "{turn:?}");
            }
        }
    }
}

#[test]
fn a_step_that_is_a_chain_is_not_packed() {
    for model in [oscillator("rk4"), held("rk4"), pendulum("rk4", true), pendulum("standard_heun", true)] {
        for level in levels() {
            let tapes = tapes(&model);
            let body = &tapes.step.split.body;
            assert!(write_if_it_gains(body, choose(body, level, 1).unwrap()).is_none(), "{:?}", model.key);
            assert!(write_if_it_gains(body, choose(body, level, 8).unwrap()).is_none(), "{:?}", model.key);
        }
    }
}

#[test]
fn oscillators_by_false_euler_are_four_instructions_a_vector() {
    for level in levels() {
        for members in MEMBERS {
            let (shape, turn, arithmetic) = written(&oscillator("false_euler"), level, members);
            assert!(arithmetic == 4 && turn.arithmetic == 4 * shape.block_vectors && turn.spilled == 0, "{shape:?}: {turn:?}");
            // The state is in registers, if there are enough of them: 40 of its numbers are not in the 16 of AVX2.
            let in_memory = if level == Level::Avx2 && members == UNLIMITED { 2 * shape.block_vectors } else { 0 };
            assert!(turn.state_read <= in_memory && turn.state_written <= in_memory, "{shape:?}: {turn:?}");
            // Beside them only the count of steps, and what brings the factor.
            let beside = if in_memory > 0 { 5 * shape.block_vectors } else { 2 + shape.block_vectors };
            assert!(turn.all <= turn.arithmetic + beside, "{shape:?}: {turn:?}");
        }
    }
}

#[test]
fn few_members_spill_nothing_where_there_are_32_registers() {
    for members in [1, 8] {
        for model in
            [oscillator("rk4"), held("rk4"), pendulum("standard_heun", true), pendulum("rk4", true), chain("false_euler")]
        {
            if Level::Avx512.here() {
                let (shape, turn, _) = written(&model, Level::Avx512, members);
                let memory = (turn.state_read, turn.state_written, turn.spilled);
                assert_eq!(memory, (0, 0, 0), "{:?}, {shape:?}: {turn:?}", model.key);
            }
        }
    }
}

/// The overhead of a kernel of many members, in percent of its arithmetic: all instructions, and spills.
fn beside(model: &Model, level: Level) -> (usize, usize) {
    let (_, turn, _) = written(model, level, UNLIMITED);
    (100 * (turn.all - turn.arithmetic) / turn.arithmetic, 100 * turn.spilled / turn.arithmetic)
}

#[test]
fn arithmetic_is_most_of_what_many_members_do() {
    // At most so much beside, and spilled, with AVX2 and with AVX-512: a sixth more than is done, in brackets.
    for (name, model, most) in [
        ("oscillators by Heun", oscillator("standard_heun"), [(80, 9), (64, 2)]), // [(66, 6), (54, 0)]
        ("oscillators by RK4", oscillator("rk4"), [(48, 22), (26, 2)]),           // [(39, 17), (20, 0)]
        ("driven pendulums by Heun", pendulum("standard_heun", true), [(46, 34), (34, 20)]), // [(38, 27), (27, 16)]
        ("driven pendulums by RK4", pendulum("rk4", true), [(45, 40), (35, 26)]), // [(37, 32), (28, 21)]
        // Each of eight vectors fills the waits of others for roots and quotients, which is worth some spills.
        ("three bodies by leapfrog", three_bodies("leapfrog"), [(64, 32), (50, 9)]), // [(55, 27), (43, 8)]
    ] {
        for (level, most) in [Level::Avx2, Level::Avx512].into_iter().zip(most).filter(|(level, _)| level.here()) {
            let got = beside(&model, level);
            assert!(got.0 <= most.0 && got.1 <= most.1, "{name}, {level:?}: {got:?} percent, at most {most:?}");
        }
    }
}

#[test]
fn roots_of_some_vectors_are_found_beside_sums_of_others() {
    for level in levels() {
        let tapes = tapes(&three_bodies("leapfrog"));
        let body = &tapes.step.split.body;
        let kernel = write(body, choose(body, level, UNLIMITED).unwrap()).unwrap();
        assert_eq!((kernel.shape().block_vectors, kernel.shape().interleaved), (8, 1), "{level:?}");
        let is_slow = |i: &Instruction| matches!(i.mnemonic(), Mnemonic::Vsqrtpd | Mnemonic::Vdivpd);
        let turn: Vec<_> = innermost(kernel.code()).into_iter().filter(|i| is_arithmetic(i.mnemonic()).is_some()).collect();
        let places: Vec<_> = (0..turn.len()).filter(|at| is_slow(&turn[*at])).collect();
        assert_eq!(places.len(), 8 * 6, "a root and a quotient for each pair");
        // Side by side, all vectors have what is before the first root outside, and what is after the last quotient: that is more
        // than half.
        let outside = turn.len() - (places[places.len() - 1] - places[0]);
        assert!(4 * outside < turn.len(), "{level:?}: {outside} of {} operations leave the unit idle", turn.len());
    }
}

#[test]
fn a_state_that_streams_is_written_once_a_step() {
    if Level::Avx512.here() {
        for model in [oscillator("standard_heun"), pendulum("rk4", true), three_bodies("leapfrog")] {
            let (shape, turn, _) = written(&model, Level::Avx512, UNLIMITED);
            let traced = model.traced().unwrap();
            let numbers = shape.block_vectors * (traced.shape.v + traced.shape.y);
            // Where the state is resident as far as there are registers, some of it is not written at all.
            let is_once = turn.state_written == numbers || shape.resident && turn.state_written < numbers;
            assert!(is_once, "{:?}, {shape:?}: {turn:?}", model.key);
        }
    }
}

#[test]
fn what_all_members_have_in_common_is_in_no_loop() {
    // Of the drive remain, at each of the times at which it is asked for, its sine times the member's strength, and the sum. Its
    // coefficients are the step's, not the member's.
    for (method, nodes) in [("false_euler", 1), ("standard_heun", 2), ("rk4", 3)] {
        let of = |driven: bool| arithmetic(&tapes(&pendulum(method, driven)).step.split.body);
        let (free, driven) = (of(false), of(true));
        let evaluations = stepwell_core::model::methods::method(method).unwrap().program().evaluations();
        assert!(driven - free <= nodes + evaluations, "{method}: {driven} against {free}");
    }
}

/// A longer step takes no longer for an operation, but for the caches. A mass on the ring is eight operations. Number by number
/// and in vectors of one member's numbers, and over many members: at most this many instructions and spills for ten operations,
/// and a tenth more than in a shorter step.
#[test]
fn a_longer_step_has_no_more_instructions_for_an_operation() {
    for level in levels() {
        for (members, packs, most) in [(1, false, [15, 1]), (1, true, [9, 5]), (UNLIMITED, false, [15, 1])] {
            let mut before = [f64::INFINITY; 2];
            for n in [100, 300, 1000, 3000, 10_000] {
                let body = ring::ring(n);
                let shape = choose(&body, level, members).unwrap();
                let kernel = if packs { write_if_it_gains(&body, shape) } else { write(&body, shape) }.unwrap();
                let (turn, work) = (turn(&kernel), (body.work() * shape.block_vectors) as f64);
                let each = [turn.all, turn.spilled].map(|count| 10.0 * count as f64 / work);
                let about = format!("{level:?}, {members} members, packed: {packs}, {n} masses: {each:?} for ten operations");
                for ((now, before), most) in each.iter().zip(before).zip(most) {
                    assert!(*now <= f64::from(most) && *now <= 1.1 * before + 0.3, "{about}, at most {most}, before {before}");
                }
                before = each;
            }
        }
    }
}

#[test]
fn kernels_are_a_few_kilobytes() {
    // An instruction is about six bytes; code past a first cache, 32 KiB, is read again in every step.
    for model in [oscillator("dop853"), pendulum("rk4", true), pendulum("dop853", true), chain("dop853"), three_bodies("rk4")] {
        for level in levels() {
            let tapes = tapes(&model);
            let body = &tapes.step.split.body;
            let code = write(body, choose(body, level, UNLIMITED).unwrap()).unwrap().code().len();
            assert!(code < 32 << 10, "{:?}, {level:?}: {code}", model.key);
        }
    }
}
