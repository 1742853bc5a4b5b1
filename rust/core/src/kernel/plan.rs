//! Instruction selection: the instruction of each operation of a body, and the source of each leaf.
//!
//! An [`InstructionSet`] says which instructions there are.

use super::{instruction_set::InstructionSet, scaled::Scaled};
use crate::tape::{
    Counts, Id, Op,
    fast_hash::{FastHashMap, Places},
    split::Body,
};

/// Where a value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Source {
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
    pub(crate) fn is_shared(self) -> bool {
        matches!(self, Source::Pool(_) | Source::PerStep(_))
    }
}

/// An operation with its operands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<I> {
    pub instruction: I,
    pub id: Id,
    of: [Id; 4],
    n: u8,
}

impl<I> Step<I> {
    /// A step of at most four operands.
    pub(crate) fn new(instruction: I, id: Id, operands: &[Id]) -> Step<I> {
        let mut of = [0; 4];
        of[..operands.len()].copy_from_slice(operands);
        Step { instruction, id, of, n: operands.len() as u8 }
    }

    /// The values that it reads.
    pub(crate) fn of(&self) -> &[Id] {
        &self.of[..self.n as usize]
    }
}

/// A body as machine instructions.
#[derive(Debug)]
pub(crate) struct KernelPlan<I> {
    /// For each value where it comes from.
    pub sources: Vec<Source>,
    pub steps: Vec<Step<I>>,
    /// The value that replaces each number of the state; none if it stays.
    pub next: Vec<Option<Id>>,
    /// The value of each number of the state before the step, if it is read.
    pub old: Vec<Option<Id>>,
    /// The bits of the constants, the first numbers of the pool. The uniforms follow.
    pub constants: Places<u64>,
    pub per_step: usize,
    /// Where the numbers of one member are lanes of vectors: how.
    pub packing: Option<Packing>,
}

/// How the numbers of one member are kept where they are lanes of vectors of their own widths. What stays over all steps and what
/// the step replaces is in homes: the first places of the scratch, each as long as the longest vector. A source's number is then
/// that of its home.
#[derive(Debug, Default)]
pub(crate) struct Packing {
    /// For each value how many numbers it has.
    pub widths: Vec<u8>,
    /// How many homes there are, of the state first.
    pub homes: usize,
    /// Copies before the first step: each source, and the number of the homes that takes it.
    pub brought: Vec<(Source, usize)>,
    /// Copies after the last step: a number of the homes, and the number of the state that takes it.
    pub returned: Vec<(usize, u32)>,
}

impl<I: Copy> KernelPlan<I> {
    /// The plan of a body that [`is_sound`].
    pub(crate) fn new<M: InstructionSet<Instruction = I>>(body: &Body, machine: &M) -> KernelPlan<I> {
        let mut plan = KernelPlan {
            sources: Vec::with_capacity(body.ops.len() + 1),
            steps: Vec::with_capacity(body.ops.len()),
            next: Vec::new(),
            old: vec![None; body.next.len()],
            constants: Places::default(),
            per_step: body.per_step,
            packing: None,
        };
        plan.next = (0..body.next.len()).map(|s| (!body.keeps(s)).then_some(body.next[s])).collect();
        // A leaf that occurs twice is one value.
        let mut known: FastHashMap<Source, Id> = FastHashMap::default();
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
        let adds_doubles = has_more_products(body);
        let mut uses = uses(body);
        let scaled = machine.scale().map(|instruction| (instruction, Scaled::new(body, &mut uses)));
        let is_made = |id: usize| scaled.as_ref().is_none_or(|(_, scaled)| !scaled.replaced[id]);
        let joined = joined(body, machine, &uses, &is_made);
        for (id, op) in body.ops.iter().enumerate().filter(|(id, op)| !op.is_leaf() && joined[*id].is_none() && is_made(*id)) {
            if let Some((instruction, scaled)) = &scaled
                && let Some([x, n]) = scaled.of[id]
            {
                let of = [same[x as usize], same[n as usize]];
                plan.steps.push(Step::new(*instruction, id as Id, &of));
                continue;
            }
            let op = scaled.as_ref().and_then(|(_, scaled)| scaled.sums[id].as_ref()).unwrap_or(op);
            let ([a, b, c], n) = op.with(|operand| same[operand as usize]).operands();
            let (instruction, of, n) = match *op {
                Op::Neg(_) => match machine.negate() {
                    (instruction, None) => (instruction, [a, 0, 0, 0], 1),
                    (instruction, Some(bits)) => {
                        let source = plan.constant(bits, body.uniforms);
                        let constant = *known.entry(source).or_insert_with(|| {
                            plan.sources.push(source);
                            plan.sources.len() as Id - 1
                        });
                        (instruction, [a, constant, 0, 0], 2)
                    }
                },
                Op::Select(m, ..) => match joined[m as usize] {
                    Some(Joined::Extreme(instruction)) => (instruction, [b, c, 0, 0], 2),
                    Some(Joined::Pick(instruction)) => {
                        let [p, q, _] = body.ops[m as usize].with(|operand| same[operand as usize]).operands().0;
                        (instruction, [p, q, b, c], 4)
                    }
                    None => (machine.select(masks[m as usize]), [a, b, c, 0], 3),
                },
                Op::Mul(..) if adds_doubles && is_two(body, a) => (machine.instruction(Op::Add(b, b)), [b, b, 0, 0], 2),
                Op::Mul(..) if adds_doubles && is_two(body, b) => (machine.instruction(Op::Add(a, a)), [a, a, 0, 0], 2),
                other => (machine.instruction(other), [a, b, c, 0], n as u8),
            };
            plan.steps.push(Step { instruction, id: id as Id, of, n });
        }
        // Uniforms stand behind the constants.
        for source in &mut plan.sources {
            if let Source::Pool(i) = source {
                let uniforms = body.uniforms as u32;
                *i = if *i < uniforms { *i + plan.constants.list.len() as u32 } else { *i - uniforms };
            }
        }
        plan
    }

    /// A constant of the pool; until it is known how many there are, they are numbered behind the uniforms.
    pub(crate) fn constant(&mut self, bits: u64, uniforms: usize) -> Source {
        Source::Pool(uniforms as u32 + self.constants.of(bits))
    }
}

fn is_two(body: &Body, id: Id) -> bool {
    body.ops[id as usize] == Op::Const(body.precision.bits_of(2.0))
}

/// Whether there are more products than sums. Some CPUs have units for sums beside those for products; 2·x is x + x in every bit.
fn has_more_products(body: &Body) -> bool {
    let mut counts = Counts::default();
    body.ops.iter().for_each(|op| counts.note(*op));
    counts.multiplications + counts.fused > counts.additions
}

/// Whether it is what a [`Body`] says it is, and of operations that are known here.
pub(crate) fn is_sound(body: &Body) -> bool {
    let is_known = |(id, op): (usize, &Op)| {
        let (operands, n) = op.operands();
        let is_in_range = match *op {
            Op::State(s) => (s as usize) < body.next.len(),
            Op::Row(i) => (i as usize) < body.rows,
            Op::Uniform(i) => (i as usize) < body.uniforms,
            Op::PerStep(i) | Op::Held(i) => (i as usize) < body.per_step,
            Op::ShiftUp(_, places) | Op::ShiftDown(_, places) => (places as usize) < 8 * body.precision.bytes(),
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

/// For each value whether all bits of a number are surely the same.
pub(crate) fn masks(body: &Body) -> Vec<bool> {
    let mut masks = Vec::with_capacity(body.ops.len());
    for op in &body.ops {
        let is = |id: Id| masks[id as usize];
        let mask = match *op {
            Op::Less(..) | Op::LessEqual(..) | Op::Equal(..) | Op::Const(0) => true,
            Op::Const(bits) => bits == body.precision.all_bits(),
            Op::And(a, b) | Op::Or(a, b) | Op::Xor(a, b) => is(a) && is(b),
            Op::Copy(a) => is(a),
            _ => false,
        };
        masks.push(mask);
    }
    masks
}

/// How often each value is used.
fn uses(body: &Body) -> Vec<u32> {
    let mut uses = vec![0; body.ops.len()];
    for op in &body.ops {
        let (operands, n) = op.operands();
        operands[..n].iter().for_each(|id| uses[*id as usize] += 1);
    }
    body.next.iter().for_each(|id| uses[*id as usize] += 1);
    uses
}

/// An instruction that does both a comparison and the choice by it.
#[derive(Clone, Copy, Debug)]
enum Joined<I> {
    /// It compares two numbers and chooses of two others.
    Pick(I),
    /// The lesser or the greater of the numbers that are chosen of.
    Extreme(I),
}

/// For each value that is a comparison and used by one choice only: the instruction that does both, if there is one.
fn joined<M: InstructionSet>(
    body: &Body,
    machine: &M,
    uses: &[u32],
    is_made: &impl Fn(usize) -> bool,
) -> Vec<Option<Joined<M::Instruction>>> {
    let mut chosen: Vec<Option<[Id; 2]>> = vec![None; body.ops.len()];
    for (_, op) in body.ops.iter().enumerate().filter(|(id, _)| is_made(*id)) {
        if let Op::Select(m, a, b) = *op {
            chosen[m as usize] = Some([a, b]);
        }
    }
    let join = |id: usize| {
        let of = chosen[id].filter(|_| uses[id] == 1)?;
        // Where p < q is false, of a NaN for example, the second is chosen. p <= q would choose the first of two zeros.
        let extreme = match body.ops[id] {
            Op::Less(p, q) if of == [p, q] => machine.min_or_max(false),
            Op::Less(p, q) if of == [q, p] => machine.min_or_max(true),
            Op::Less(..) | Op::LessEqual(..) | Op::Equal(..) => None,
            _ => return None,
        };
        extreme.map(Joined::Extreme).or_else(|| machine.pick(body.ops[id]).map(Joined::Pick))
    };
    (0..body.ops.len()).map(join).collect()
}
