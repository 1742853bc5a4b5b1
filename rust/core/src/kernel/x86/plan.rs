//! Instruction selection: the instruction of each operation of a body, and the source of each leaf.
//!
//! **To add an operation**, give it a line in [`Plan::doing`]; if it is of a new kind, an arm in `write.rs` as well.

use std::collections::HashMap;

use super::encode::{self as x, Form};
use crate::tape::{Counts, Id, Op, split::Body};

/// Where a value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Source {
    /// An instruction.
    Made,
    /// A row of the state, which the step may replace.
    State(u32),
    /// A row of the state that stays as it is.
    Kept(u32),
    /// A row of the members.
    Row(u32),
    /// A number of the pool, the same for all lanes.
    Pool(u32),
    /// A number of the table of the steps, the same for all lanes.
    PerStep(u32),
    /// A row whose place is in the table of the steps.
    Held(u32),
}

impl Source {
    /// Whether it is the same in all lanes.
    pub fn is_shared(self) -> bool {
        matches!(self, Source::Pool(_) | Source::PerStep(_))
    }
}

/// An instruction, or a few that belong together.
#[derive(Clone, Copy, Debug)]
pub enum Doing {
    /// Of two values. Whether they may be exchanged.
    Two(Form, bool),
    /// Of one, with or without an immediate byte.
    One(Form, Option<u8>),
    /// A product and a sum, rounded once.
    Fused(x::Fused),
    /// Moves bits up or down.
    Shift(u8, u8),
    /// A mask of two values, by predicate.
    Compare(u8),
    /// By the bits of the first, of the second and the third. Whether the first is surely a mask: all bits of a number or none.
    Select(bool),
    /// The comparison of the first two by predicate chooses of the third and the fourth.
    Pick(u8),
    /// The same.
    Copy,
}

/// An operation with its operands.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub doing: Doing,
    pub id: Id,
    of: [Id; 4],
    n: u8,
}

impl Step {
    /// What it reads.
    pub fn of(&self) -> &[Id] {
        &self.of[..self.n as usize]
    }
}

/// A body as machine instructions.
#[derive(Debug)]
pub struct Plan {
    /// Of each value where it comes from.
    pub sources: Vec<Source>,
    pub steps: Vec<Step>,
    /// What replaces each number of the state; none if it stays.
    pub next: Vec<Option<Id>>,
    /// The value of each number of the state before the step, if it is read.
    pub old: Vec<Option<Id>>,
    /// The bits of the constants, the first numbers of the pool. The uniforms follow.
    pub constants: Vec<u64>,
    pub per_step: usize,
}

const LESS: u8 = 0x11;
const LESS_EQUAL: u8 = 0x12;
const EQUAL: u8 = 0;
/// Round down, without raising the inexact flag.
const FLOOR: u8 = 9;

/// The predicate that says the same of two values in the other order.
pub fn turned(predicate: u8) -> u8 {
    match predicate {
        LESS => 0x1E,
        LESS_EQUAL => 0x1D,
        other => other,
    }
}

impl Plan {
    /// None if it is not a valid body: everything here and in the writer relies on its form.
    pub fn new(body: &Body, evex: bool) -> Option<Plan> {
        if !is_sound(body) {
            return None;
        }
        let mut plan = Plan {
            sources: Vec::with_capacity(body.ops.len() + 1),
            steps: Vec::with_capacity(body.ops.len()),
            next: Vec::new(),
            old: vec![None; body.next.len()],
            constants: Vec::new(),
            per_step: body.per_step,
        };
        plan.next = (0..body.next.len()).map(|s| (!body.keeps(s)).then_some(body.next[s])).collect();
        // A leaf that occurs twice is one value.
        let mut known: HashMap<Source, Id> = HashMap::new();
        let mut same: Vec<Id> = Vec::with_capacity(body.ops.len());
        for (id, op) in body.ops.iter().enumerate() {
            let source = match *op {
                Op::State(s) if body.keeps(s as usize) => Source::Kept(s),
                Op::State(s) => Source::State(s),
                Op::Row(i) => Source::Row(i),
                Op::Uniform(i) => Source::Pool(i),
                Op::PerStep(i) => Source::PerStep(i),
                Op::Held(i) => Source::Held(i),
                Op::Const(bits) => plan.constant(bits, body.uniforms),
                _ => Source::Made,
            };
            let id = id as Id;
            plan.sources.push(source);
            same.push(if source == Source::Made { id } else { *known.entry(source).or_insert(id) });
            if let Source::State(s) = source {
                plan.old[s as usize] = Some(same[id as usize]);
            }
        }
        let masks = masks(body);
        let fused = if evex { fused(body) } else { vec![false; body.ops.len()] };
        let adds_doubles = has_more_products(body);
        let mut sign: Option<Id> = None;
        for (id, op) in body.ops.iter().enumerate().filter(|(id, op)| !op.is_leaf() && !fused[*id]) {
            let ([a, b, c], n) = op.with(|operand| same[operand as usize]).operands();
            let (doing, of, n) = match *op {
                Op::Neg(_) => {
                    let sign = *sign.get_or_insert_with(|| {
                        let source = plan.constant(1 << 63, body.uniforms);
                        *known.entry(source).or_insert_with(|| {
                            plan.sources.push(source);
                            plan.sources.len() as Id - 1
                        })
                    });
                    (Doing::Two(x::XOR, true), [a, sign, 0, 0], 2)
                }
                Op::Select(m, ..) if fused[m as usize] => {
                    let comparison = body.ops[m as usize].with(|operand| same[operand as usize]);
                    let [p, q, _] = comparison.operands().0;
                    (Doing::Pick(predicate(comparison)), [p, q, b, c], 4)
                }
                Op::Select(m, ..) => (Doing::Select(masks[m as usize]), [a, b, c, 0], 3),
                Op::Mul(..) if adds_doubles && is_two(body, a) => (Doing::Two(x::ADD, true), [b, b, 0, 0], 2),
                Op::Mul(..) if adds_doubles && is_two(body, b) => (Doing::Two(x::ADD, true), [a, a, 0, 0], 2),
                other => (Plan::doing(other), [a, b, c, 0], n as u8),
            };
            plan.steps.push(Step { doing, id: id as Id, of, n });
        }
        // Uniforms stand behind the constants.
        for source in &mut plan.sources {
            if let Source::Pool(i) = source {
                let uniforms = body.uniforms as u32;
                *i = if *i < uniforms { *i + plan.constants.len() as u32 } else { *i - uniforms };
            }
        }
        Some(plan)
    }

    /// The instruction of an operation. Those that depend on their neighbours are not here.
    fn doing(op: Op) -> Doing {
        match op {
            Op::Add(..) => Doing::Two(x::ADD, true),
            Op::Sub(..) => Doing::Two(x::SUB, false),
            Op::Mul(..) => Doing::Two(x::MUL, true),
            Op::Div(..) => Doing::Two(x::DIV, false),
            Op::MulAdd(..) => Doing::Fused(x::MUL_ADD),
            Op::MulSub(..) => Doing::Fused(x::MUL_SUB),
            Op::SubMul(..) => Doing::Fused(x::SUB_MUL),
            Op::And(..) => Doing::Two(x::AND, true),
            Op::Or(..) => Doing::Two(x::OR, true),
            Op::Xor(..) => Doing::Two(x::XOR, true),
            Op::AddBits(..) => Doing::Two(x::ADD_BITS, true),
            Op::Sqrt(_) => Doing::One(x::SQRT, None),
            Op::Floor(_) => Doing::One(x::ROUND, Some(FLOOR)),
            Op::ShiftUp(_, n) => Doing::Shift(x::UP, n as u8),
            Op::ShiftDown(_, n) => Doing::Shift(x::DOWN, n as u8),
            Op::Less(..) | Op::LessEqual(..) | Op::Equal(..) => Doing::Compare(predicate(op)),
            // Operations that depend on their neighbours, and leaves, get a default here.
            Op::Copy(_) | Op::Neg(_) | Op::Select(..) => Doing::Copy,
            Op::State(_) | Op::Param(_) | Op::Step | Op::Time | Op::Const(_) | Op::Sample(..) => Doing::Copy,
            Op::Row(_) | Op::Uniform(_) | Op::PerStep(_) | Op::Held(_) | Op::Gather(_) => Doing::Copy,
        }
    }

    /// A constant of the pool; until it is known how many there are, they are numbered behind the uniforms.
    fn constant(&mut self, bits: u64, uniforms: usize) -> Source {
        let at = self.constants.iter().position(|known| *known == bits).unwrap_or_else(|| {
            self.constants.push(bits);
            self.constants.len() - 1
        });
        Source::Pool((uniforms + at) as u32)
    }
}

fn is_two(body: &Body, id: Id) -> bool {
    body.ops[id as usize] == Op::Const(2f64.to_bits())
}

/// Whether there are more products than sums. Some CPUs have units for sums beside those for products; 2·x is x + x in every bit.
fn has_more_products(body: &Body) -> bool {
    let mut counts = Counts::default();
    body.ops.iter().for_each(|op| counts.note(*op));
    counts.multiplications + counts.fused > counts.additions
}

fn predicate(comparison: Op) -> u8 {
    match comparison {
        Op::Less(..) => LESS,
        Op::LessEqual(..) => LESS_EQUAL,
        _ => EQUAL,
    }
}

/// Whether it is what a [`Body`] says it is, and of operations that are known here.
fn is_sound(body: &Body) -> bool {
    let is_known = |(id, op): (usize, &Op)| {
        let (operands, n) = op.operands();
        let is_in_range = match *op {
            Op::State(s) => (s as usize) < body.next.len(),
            Op::Row(i) => (i as usize) < body.rows,
            Op::Uniform(i) => (i as usize) < body.uniforms,
            Op::PerStep(i) | Op::Held(i) => (i as usize) < body.per_step,
            Op::ShiftUp(_, places) | Op::ShiftDown(_, places) => places < 64,
            Op::Param(_) | Op::Step | Op::Time | Op::Sample(..) | Op::Gather(_) => false,
            _ => true,
        };
        is_in_range && operands[..n].iter().all(|operand| (*operand as usize) < id)
    };
    let mut taken = vec![false; body.ops.len()];
    body.ops.iter().enumerate().all(is_known)
        && body.next.iter().enumerate().all(|(s, id)| match body.ops.get(*id as usize) {
            Some(Op::State(t)) => s == *t as usize,
            Some(op) => !op.is_leaf() && !std::mem::replace(&mut taken[*id as usize], true),
            None => false,
        })
}

/// Of each value whether all bits of a number are surely the same.
fn masks(body: &Body) -> Vec<bool> {
    let mut masks = Vec::with_capacity(body.ops.len());
    for op in &body.ops {
        let is = |id: Id| masks[id as usize];
        let mask = match *op {
            Op::Less(..) | Op::LessEqual(..) | Op::Equal(..) | Op::Const(0 | u64::MAX) => true,
            Op::And(a, b) | Op::Or(a, b) | Op::Xor(a, b) => is(a) && is(b),
            Op::Copy(a) => is(a),
            _ => false,
        };
        masks.push(mask);
    }
    masks
}

/// For each value whether it is a comparison that is used by one choice only. Both are then computed together, with a mask register.
fn fused(body: &Body) -> Vec<bool> {
    let mut uses = vec![0u32; body.ops.len()];
    let mut chooses = vec![false; body.ops.len()];
    for op in &body.ops {
        let (operands, n) = op.operands();
        operands[..n].iter().for_each(|id| uses[*id as usize] += 1);
        if let Op::Select(m, ..) = *op {
            chooses[m as usize] = true;
        }
    }
    body.next.iter().for_each(|id| uses[*id as usize] += 1);
    let is_comparison = |op: &Op| matches!(op, Op::Less(..) | Op::LessEqual(..) | Op::Equal(..));
    (0..body.ops.len()).map(|id| chooses[id] && uses[id] == 1 && is_comparison(&body.ops[id])).collect()
}
