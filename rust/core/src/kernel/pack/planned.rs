//! Instruction selection for vectors of one member's numbers.

use std::collections::HashMap;

use super::packed::{MOST_LANES, Make, Packed};
use crate::{
    kernel::{
        instruction_set::InstructionSet,
        plan::{KernelPlan, Packing, Source, Step, masks},
    },
    tape::{Op, fast_hash::Places, split::Body},
};

impl<I: Copy> KernelPlan<I> {
    /// The plan for vectors of one member's numbers. None if the machine has no instructions for them.
    pub(crate) fn packed<M: InstructionSet<Instruction = I>>(body: &Body, packed: &Packed, machine: &M) -> Option<KernelPlan<I>> {
        if !M::PACKS {
            return None;
        }
        let mut plan = KernelPlan {
            sources: Vec::with_capacity(packed.vectors.len() + 1),
            steps: Vec::with_capacity(packed.vectors.len()),
            next: packed.state.iter().map(|state| Some(state.next)).collect(),
            old: packed.state.iter().map(|state| Some(state.old)).collect(),
            constants: Places::default(),
            per_step: body.per_step,
            packing: None,
        };
        let mut homes = Homes { count: packed.state.len(), ..Homes::default() };
        for (home, state) in packed.state.iter().enumerate() {
            homes.bring(home, state.numbers.iter().map(|s| Source::State(*s)));
            if state.is_first {
                let returned = state.numbers.iter().enumerate();
                homes.packing.returned.extend(returned.map(|(lane, s)| (MOST_LANES * home + lane, *s)));
            }
        }
        let masks = masks(body);
        for (id, vector) in packed.vectors.iter().enumerate() {
            homes.packing.widths.push(vector.width);
            let source = match &vector.make {
                Make::State(s) => Source::State(*s),
                Make::Now(Op::Held(i)) => Source::Held(*i),
                Make::Now(Op::PerStep(i)) => Source::PerStep(*i),
                Make::Now(_) => return None,
                Make::Fixed(leaves) => {
                    let leaves: Option<Vec<Source>> = leaves.iter().map(|leaf| plan.fixed(*leaf, body)).collect();
                    homes.one_more(leaves?)
                }
                Make::Op(_) | Make::Move(_) => Source::Made,
            };
            plan.sources.push(source);
            let is_mask = |of: usize| {
                // Of each lane the operand; what was moved there may have changed places, but not this one.
                vector.lanes.iter().all(|lane| masks[body.ops[*lane as usize].operands().0[of] as usize])
            };
            let step = match &vector.make {
                Make::Move(to) => Step::new(machine.moving(*to), id as u32, vector.of()),
                Make::Op(Op::Neg(_)) => match machine.negate() {
                    (instruction, None) => Step::new(instruction, id as u32, vector.of()),
                    (instruction, Some(bits)) => {
                        let constant = homes.known.get(&bits).copied();
                        let sign = constant.unwrap_or_else(|| packed.vectors.len() as u32 + homes.known.len() as u32);
                        homes.known.insert(bits, sign);
                        Step::new(instruction, id as u32, &[vector.of[0], sign])
                    }
                },
                Make::Op(Op::Select(..)) => Step::new(machine.select(is_mask(0)), id as u32, vector.of()),
                Make::Op(op) => Step::new(machine.instruction(*op), id as u32, vector.of()),
                Make::State(_) | Make::Fixed(_) | Make::Now(_) => continue,
            };
            plan.steps.push(step);
        }
        // Constants that operations brought with them: their values come last.
        let mut brought: Vec<(u32, u64)> = homes.known.iter().map(|(bits, value)| (*value, *bits)).collect();
        brought.sort_unstable();
        for (_, bits) in brought {
            let source = plan.constant(bits, body.uniforms);
            let home = homes.one_more(vec![source]);
            plan.sources.push(home);
            homes.packing.widths.push(MOST_LANES as u8);
        }
        // Uniforms stand behind the constants.
        let constants = plan.constants.list.len() as u32;
        for (source, _) in &mut homes.packing.brought {
            if let Source::Pool(i) = source {
                *i = if (*i as usize) < body.uniforms { *i + constants } else { *i - body.uniforms as u32 };
            }
        }
        plan.packing = Some(Packing { homes: homes.count, ..homes.packing });
        Some(plan)
    }

    /// Where a number that does not change is at first.
    fn fixed(&mut self, leaf: Op, body: &Body) -> Option<Source> {
        Some(match leaf {
            Op::State(s) => Source::State(s),
            Op::Row(i) => Source::Row(i),
            Op::Uniform(i) => Source::Pool(i),
            Op::Const(bits) => self.constant(bits, body.uniforms),
            _ => return None,
        })
    }
}

/// Places of the scratch that are taken.
#[derive(Default)]
struct Homes {
    packing: Packing,
    count: usize,
    /// Values of constants that operations bring with them, by their bits.
    known: HashMap<u64, u32>,
}

impl Homes {
    /// A further home, for what does not change.
    fn one_more(&mut self, leaves: Vec<Source>) -> Source {
        let home = self.count;
        self.count += 1;
        self.bring(home, leaves.into_iter());
        Source::Row(home as u32)
    }

    /// Fills a home; lanes that are not used have the number of the first.
    fn bring(&mut self, home: usize, mut numbers: impl ExactSizeIterator<Item = Source>) {
        let Some(first) = numbers.next() else { return };
        let rest = numbers.chain(std::iter::repeat(first));
        let lanes = std::iter::once(first).chain(rest).take(MOST_LANES).enumerate();
        self.packing.brought.extend(lanes.map(|(lane, from)| (from, MOST_LANES * home + lane)));
    }
}
