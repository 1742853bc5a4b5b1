//! The whole function: what is kept in registers, and the loops over steps and blocks around one step.

use super::{
    machine::{Base, Counter, Place},
    plan::{KernelPlan, Source},
    registers::{Registers, Uses},
    schedule::Order,
    shape::Shape,
    write::{MakeOperation, Value, Where, Writer},
};

/// The code of a plan in a shape, its operations in this order, and how many vectors of scratch it needs. None if it cannot be
/// done with the registers there are.
pub(crate) fn function<M: MakeOperation>(
    plan: &KernelPlan<M::Instruction>,
    code: M,
    shape: Shape,
    order: &Order,
) -> Option<(Vec<u8>, usize)> {
    let mut writer = Writer::new(plan, code, shape, order);
    let pinned = writer.share_out();
    writer.code.enter();
    if shape.resident {
        writer.steps_inside(&pinned)?;
    } else {
        writer.blocks_inside(&pinned)?;
    }
    writer.code.leave();
    Some((writer.code.take_bytes(), writer.slots as usize))
}

/// The register through which numbers are copied before the first step and after the last: no value is in any then.
const FREE_BETWEEN_STEPS: u8 = 0;

/// Values that stay in a register for the whole of the inner loop.
#[derive(Debug, Default)]
struct Pinned {
    /// The old values of numbers of the state: number, vector, register.
    state: Vec<(u32, usize, u8)>,
    /// Leaves that do not change.
    leaves: Vec<(Value, u8)>,
}

/// How many values are live at once, and when each is needed last.
struct Pressure {
    most: u32,
    /// For each value how often it is read.
    reads: Vec<u32>,
}

impl<'a, M: MakeOperation> Writer<'a, M> {
    fn new(plan: &'a KernelPlan<M::Instruction>, code: M, shape: Shape, order: &Order) -> Writer<'a, M> {
        let values = plan.sources.len() * shape.block_vectors;
        let mut replaces = vec![None; plan.sources.len()];
        for (s, id) in plan.next.iter().enumerate() {
            if let Some(id) = id {
                replaces[*id as usize] = Some(s as u32);
            }
        }
        let leaf = |source: &Source| if *source == Source::Made { Where::Nowhere } else { Where::Leaf };
        Writer {
            plan,
            shape,
            width: shape.width,
            order: order.iter().map(|(i, vector)| (&plan.steps[*i], *vector)).collect(),
            code,
            registers: Registers::new(shape.registers() as u8, values),
            uses: Uses::new(values),
            memory: plan.sources.iter().flat_map(|source| std::iter::repeat_n(leaf(source), shape.block_vectors)).collect(),
            replaces,
            homes: vec![None; plan.next.len() * shape.block_vectors],
            waits: vec![false; plan.next.len() * shape.block_vectors],
            now: 0,
            free_slots: Vec::new(),
            slots: 0,
        }
    }

    /// The time of the operation at an index of the order. One later its result goes to its home.
    fn time(place: usize) -> u32 {
        2 * place as u32 + 2
    }

    /// Finds when each value is needed, and how many are live at once if every number of the state has a register.
    fn look_ahead(&mut self) -> Pressure {
        let (plan, block_vectors) = (self.plan, self.shape.block_vectors);
        let values = plan.sources.len() * block_vectors;
        let mut made = vec![0u32; values];
        for (place, (step, vector)) in self.order.iter().enumerate() {
            made[self.value(step.id, *vector) as usize] = Self::time(place);
        }
        let mut last = vec![0u32; values];
        let mut reads = vec![0u32; values];
        for place in (0..self.order.len()).rev() {
            let ((step, vector), now) = (self.order[place], Self::time(place));
            for id in step.of() {
                let value = self.value(*id, vector);
                reads[value as usize] += 1;
                if !self.uses.add_earlier_use(value, now) {
                    continue;
                }
                last[value as usize] = now;
                // When the old number of the state has been read for the last time, the next one is moved to its home.
                if let Source::State(s) = plan.sources[*id as usize]
                    && let Some(next) = plan.next[s as usize].map(|next| self.value(next, vector))
                    && made[next as usize] < now
                    && self.uses.add_earlier_use(next, now + 1)
                {
                    last[next as usize] = now;
                }
            }
        }
        let (mut under_way, mut most) = (0u32, 0);
        for (place, (step, vector)) in self.order.iter().enumerate() {
            let now = Self::time(place);
            let value = self.value(step.id, *vector) as usize;
            for id in step.of() {
                let read = self.value(*id, *vector) as usize;
                if last[read] == now && plan.sources[*id as usize] == Source::Made {
                    under_way = under_way.saturating_sub(1);
                    last[read] = 0;
                }
            }
            let goes_home = self.replaces[step.id as usize]
                .is_some_and(|s| plan.old[s as usize].is_none_or(|old| last[self.value(old, *vector) as usize] <= now));
            if goes_home {
                last[value] = 0;
            } else {
                under_way += 1;
                most = most.max(under_way);
            }
        }
        Pressure { most, reads }
    }

    /// Assigns registers to values that are used through the whole loop, as far as the live values leave any.
    fn share_out(&mut self) -> Pinned {
        let Pressure { most, reads } = self.look_ahead();
        let (plan, block_vectors, resident) = (self.plan, self.shape.block_vectors, self.shape.resident);
        let mut pinned = Pinned::default();
        // One more than the live values: an operand may have to be loaded. At least five: no instruction needs more.
        let needed = (most + 1).max(5);
        if resident {
            for s in (0..plan.next.len()).filter(|s| plan.next[*s].is_some()) {
                for vector in 0..block_vectors {
                    if self.registers.free() > needed
                        && let Some(register) = self.registers.keep_one()
                    {
                        self.homes[s * block_vectors + vector] = Some(register);
                        pinned.state.push((s as u32, vector, register));
                    }
                }
            }
        }
        let stays = |value: Value| match plan.sources[value as usize / block_vectors] {
            Source::Pool(_) => true,
            Source::Row(_) | Source::Kept(_) => resident,
            Source::PerStep(_) => !resident,
            Source::Made | Source::State(_) | Source::Held(_) => false,
        };
        let mut leaves: Vec<Value> =
            (0..reads.len() as Value).filter(|value| reads[*value as usize] > 0 && stays(*value)).collect();
        leaves.sort_by_key(|value| std::cmp::Reverse(reads[*value as usize]));
        for value in leaves {
            if self.registers.free() <= needed {
                break;
            }
            let Some(register) = self.registers.keep_one() else { break };
            pinned.leaves.push((value, register));
        }
        pinned
    }

    /// Block after block, each over all steps: the state stays in registers.
    fn steps_inside(&mut self, pinned: &Pinned) -> Option<()> {
        let next_block = self.blocks();
        self.code.rewind();
        self.bring();
        for &(s, vector, register) in &pinned.state {
            if let Some(old) = self.plan.old[s as usize] {
                let value = self.value(old, vector);
                self.load(value, register);
            }
        }
        self.load_leaves(pinned);
        self.code.align();
        let next_step = self.code.here();
        self.step()?;
        self.code.advance(Base::PerStep, 8 * self.plan.per_step as i32);
        self.code.count_down(Counter::Steps, next_step);
        for &(s, vector, register) in &pinned.state {
            if let Some(next) = self.plan.next[s as usize] {
                let value = self.value(next, vector);
                self.store(s, value, register);
            }
        }
        self.take_back();
        self.move_on(1);
        self.end_of_blocks(next_block);
        Some(())
    }

    /// Numbers of one member that are lanes of vectors: each to its lane, before the first step.
    fn bring(&mut self) {
        let Some(packing) = &self.plan.packing else { return };
        self.code.of_width(1);
        for (from, to) in &packing.brought {
            let from = match *from {
                Source::State(s) => Place::new(Base::State, 8 * s as i32),
                Source::Row(i) => Place::new(Base::Rows, 8 * i as i32),
                Source::Pool(i) => Place::new(Base::Pool, (8 * self.shape.pool_copies()) as i32 * i as i32),
                _ => continue,
            };
            self.code.load(FREE_BETWEEN_STEPS, from);
            self.code.store(FREE_BETWEEN_STEPS, Place::new(Base::Scratch, 8 * *to as i32));
        }
    }

    /// Copies the packed state back to the rows of the state, after the last step.
    fn take_back(&mut self) {
        let Some(packing) = &self.plan.packing else { return };
        self.code.of_width(1);
        for (from, s) in &packing.returned {
            self.code.load(FREE_BETWEEN_STEPS, Place::new(Base::Scratch, 8 * *from as i32));
            self.code.store(FREE_BETWEEN_STEPS, Place::new(Base::State, 8 * *s as i32));
        }
    }

    /// Step after step, each over all blocks: the state passes through registers.
    fn blocks_inside(&mut self, pinned: &Pinned) -> Option<()> {
        let next_step = self.code.here();
        self.load_leaves(pinned);
        let next_block = self.blocks();
        self.step()?;
        self.move_on(1);
        self.end_of_blocks(next_block);
        self.move_on(-(self.shape.blocks as i32));
        self.code.advance(Base::PerStep, 8 * self.plan.per_step as i32);
        self.code.count_down(Counter::Steps, next_step);
        Some(())
    }

    fn blocks(&mut self) -> usize {
        if self.shape.blocks > 1 {
            self.code.count_blocks(self.shape.blocks as i32);
        }
        self.code.align();
        self.code.here()
    }

    fn end_of_blocks(&mut self, next_block: usize) {
        if self.shape.blocks > 1 {
            self.code.count_down(Counter::Blocks, next_block);
        }
    }

    /// Moves the pointers to rows by `blocks` blocks.
    fn move_on(&mut self, blocks: i32) {
        let bytes = (self.shape.width * self.shape.block_vectors * self.shape.bytes) as i32 * blocks;
        if self.shape.blocks > 1 {
            let sources = &self.plan.sources;
            let reads = |kind: fn(&Source) -> bool| sources.iter().any(kind);
            let moves: [(Base, bool); 3] = [
                (Base::State, true),
                (Base::Rows, reads(|source| matches!(source, Source::Row(_)))),
                (Base::Held, reads(|source| matches!(source, Source::Held(_)))),
            ];
            for (base, is_read) in moves {
                self.code.advance(base, if is_read { bytes } else { 0 });
            }
        }
    }

    fn load_leaves(&mut self, pinned: &Pinned) {
        for &(value, register) in &pinned.leaves {
            self.load(value, register);
        }
    }

    fn step(&mut self) -> Option<()> {
        for (place, (step, vector)) in std::mem::take(&mut self.order).into_iter().enumerate() {
            self.now = Self::time(place);
            self.make(step, vector)?;
        }
        Some(())
    }
}
