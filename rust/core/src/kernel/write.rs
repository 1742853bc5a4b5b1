//! One step of the vectors of a block, instruction after instruction.
//!
//! A value is in a register, in memory, or both. Leaves are in memory from the start; a result is spilled to the scratch only
//! when registers run out. Each number of the state has a home: a register of its own, or its row. The next value goes there as
//! soon as the old one is not needed any more: at once if the instruction that computes it is the last to read the old one.

use super::{
    machine::{Base, Machine, Place},
    pack::MOST_LANES,
    plan::{KernelPlan, Source, Step},
    registers::{NONE, Registers, Uses},
    shape::Shape,
};

/// Where a value is in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Where {
    Nowhere,
    /// As its source says.
    Leaf,
    /// A slot of the scratch.
    Slot(u32),
    /// The row of a number of the state, which it has replaced.
    State(u32),
}

/// A value of one of the vectors of a block.
pub(crate) type Value = u32;

/// A CPU that the writer can write for.
pub(crate) trait MakeOperation: Machine {
    /// Writes an operation for one vector, and returns where its result is. None if there are too few registers.
    fn make(writer: &mut Writer<Self>, step: &Step<Self::Instruction>, vector: usize, of: &[Value]) -> Option<u8>;
}

/// The code of a kernel while it is written, and where each value is at that point.
#[derive(Debug)]
pub(crate) struct Writer<'a, M: MakeOperation> {
    pub plan: &'a KernelPlan<M::Instruction>,
    pub shape: Shape,
    /// Numbers in the vectors of the operation that is written.
    pub width: usize,
    /// The operations, each for a vector, in the order in which they are made.
    pub order: Vec<(&'a Step<M::Instruction>, usize)>,
    pub code: M,
    pub registers: Registers,
    pub uses: Uses,
    pub memory: Vec<Where>,
    /// The number of the state that each value of the plan replaces.
    pub replaces: Vec<Option<u32>>,
    /// For each number of the state in each vector of the block its register, if it has one.
    pub homes: Vec<Option<u8>>,
    /// For the same, whether the next value waits for the old one to be read.
    pub waits: Vec<bool>,
    /// The current time: twice the index in the order.
    pub now: u32,
    pub free_slots: Vec<u32>,
    pub slots: u32,
}

impl<M: MakeOperation> Writer<'_, M> {
    /// The value of the plan in a vector.
    pub(crate) fn value(&self, id: u32, vector: usize) -> Value {
        let vector = if self.plan.sources[id as usize].is_shared() { 0 } else { vector };
        id * self.shape.block_vectors as u32 + vector as u32
    }

    /// Where a value comes from.
    pub(crate) fn source(&self, value: Value) -> Source {
        self.plan.sources[value as usize / self.shape.block_vectors]
    }

    fn bytes(&self) -> i32 {
        (self.shape.bytes * self.shape.width) as i32
    }

    /// Writes code for vectors as long as a value is.
    fn as_wide_as(&mut self, value: Value, write: impl FnOnce(&mut M)) {
        match &self.plan.packing {
            None => write(&mut self.code),
            Some(packing) => {
                self.code.of_width(packing.widths[value as usize] as usize);
                write(&mut self.code);
                self.code.of_width(self.width);
            }
        }
    }

    fn in_row(&self, base: Base, row: u32, value: Value) -> Place {
        let vector = value as usize % self.shape.block_vectors;
        Place::new(base, (row as usize * self.shape.lanes() * self.shape.bytes) as i32 + vector as i32 * self.bytes())
    }

    /// Where a value is in memory.
    pub(crate) fn place(&self, value: Value) -> Place {
        if let Some(packing) = &self.plan.packing {
            let home = |home: usize| Place::new(Base::Scratch, (8 * MOST_LANES * home) as i32);
            match (self.memory[value as usize], self.source(value)) {
                (Where::Slot(slot), _) => return home(packing.homes + slot as usize),
                (Where::State(s), _) | (_, Source::State(s) | Source::Row(s)) => return home(s as usize),
                _ => {}
            }
        }
        match (self.memory[value as usize], self.source(value)) {
            (Where::Slot(slot), _) => Place::new(Base::Scratch, slot as i32 * self.bytes()),
            (Where::State(s), _) | (_, Source::State(s) | Source::Kept(s)) => self.in_row(Base::State, s, value),
            (_, Source::Row(i)) => self.in_row(Base::Rows, i, value),
            (_, Source::Pool(i)) => {
                let copies = self.shape.pool_copies();
                Place { one: copies == 1, ..Place::new(Base::Pool, (i as usize * copies * self.shape.bytes) as i32) }
            }
            (_, Source::PerStep(i)) => Place { one: true, ..Place::new(Base::PerStep, i as i32 * 8) },
            (_, Source::Held(i)) => Place { held: Some(i), ..self.in_row(Base::Held, 0, value) },
            (_, Source::Made) => Place::new(Base::Scratch, 0), // It is in a register: never read from here.
        }
    }

    /// Loads a value.
    pub(crate) fn load(&mut self, value: Value, register: u8) {
        let place = self.place(value);
        self.as_wide_as(value, |code| code.load(register, place));
        self.registers.put(value, register);
    }

    /// Stores to the row of a number of the state.
    pub(crate) fn store(&mut self, s: u32, value: Value, register: u8) {
        let row = match self.plan.packing {
            None => self.in_row(Base::State, s, value),
            Some(_) => Place::new(Base::Scratch, 8 * (MOST_LANES as u32 * s) as i32),
        };
        self.as_wide_as(value, |code| code.store(register, row));
    }

    /// The cost of keeping a value in its register: how many operations until it is needed, twice as many if memory holds it too.
    pub(crate) fn price(uses: &mut Uses, memory: &[Where], now: u32, value: Value) -> u32 {
        let wait = uses.next(value, now).saturating_sub(now);
        if memory[value as usize] == Where::Nowhere { wait } else { wait.saturating_mul(2) }
    }

    /// A register to write to. The value that it held is spilled if it is still needed.
    pub(crate) fn take(&mut self) -> Option<u8> {
        if let Some(register) = self.registers.any_free() {
            return Some(register);
        }
        let (uses, memory, now) = (&mut self.uses, &self.memory, self.now);
        let victim = self.registers.victim(0, |value| Self::price(uses, memory, now, value))?;
        let register = self.registers.of(victim)?;
        if self.memory[victim as usize] == Where::Nowhere {
            let slot = self.free_slots.pop().unwrap_or_else(|| {
                self.slots += 1;
                self.slots - 1
            });
            self.memory[victim as usize] = Where::Slot(slot);
            let place = self.place(victim);
            self.as_wide_as(victim, |code| code.store(register, place));
        }
        self.registers.release(victim);
        Some(register)
    }

    /// The register of a value, which is loaded if it is in none.
    pub(crate) fn fetch(&mut self, value: Value) -> Option<u8> {
        let register = match self.registers.of(value) {
            Some(register) => register,
            None => {
                let register = self.take()?;
                self.load(value, register);
                register
            }
        };
        self.registers.lock(register);
        Some(register)
    }

    /// Whether a value is needed later.
    pub(crate) fn is_needed(&mut self, value: Value) -> bool {
        self.uses.next(value, self.now) != NONE
    }

    /// Frees the registers of those that are not needed any more.
    fn let_go(&mut self, of: &[Value]) {
        for value in of {
            if !self.is_needed(*value) {
                self.registers.release(*value);
            }
        }
    }

    /// The home of the number of the state that a value replaces, if it has one and the old number is not needed any more.
    fn free_home(&mut self, id: u32, vector: usize) -> Option<u8> {
        let s = self.replaces[id as usize]?;
        let home = self.homes[s as usize * self.shape.block_vectors + vector]?;
        (!self.is_old_needed(s, vector)).then_some(home)
    }

    /// The register for what is made of these: the home of the number of the state that it replaces, one of theirs, or another.
    pub(crate) fn result(&mut self, id: u32, vector: usize, of: &[Value]) -> Option<u8> {
        self.let_go(of);
        match self.free_home(id, vector) {
            Some(home) => Some(home),
            None => self.take(),
        }
    }

    /// As `result`, for an instruction that overwrites an operand: one of `over` if it is not needed any more. None of the
    /// registers `apart`.
    pub(crate) fn result_over(&mut self, id: u32, vector: usize, of: &[Value], over: &[Value], apart: &[u8]) -> Option<u8> {
        let home = self.free_home(id, vector).filter(|home| !apart.contains(home));
        let own = over.iter().find_map(|value| {
            let register = self.registers.of(*value)?;
            let can = !self.is_needed(*value) && !self.registers.is_kept(register) && !apart.contains(&register);
            can.then_some(register)
        });
        // Taken while the registers of the operands are locked: it is none of theirs.
        let to = match home.or(own) {
            Some(register) => register,
            None => self.take()?,
        };
        self.let_go(of);
        Some(to)
    }

    fn is_old_needed(&mut self, s: u32, vector: usize) -> bool {
        self.plan.old[s as usize].is_some_and(|old| {
            let old = self.value(old, vector);
            self.is_needed(old)
        })
    }

    /// Writes one operation for one vector. None if there are too few registers even so.
    pub(crate) fn make(&mut self, step: &Step<M::Instruction>, vector: usize) -> Option<()> {
        let mut of = [0; 4];
        for (value, id) in of.iter_mut().zip(step.of()) {
            *value = self.value(*id, vector);
        }
        let of = &of[..step.of().len()];
        if let Some(packing) = &self.plan.packing {
            self.width = packing.widths[step.id as usize] as usize;
            self.code.of_width(self.width);
        }
        for value in of {
            if let Some(register) = self.registers.of(*value) {
                self.registers.lock(register);
            }
        }
        let to = M::make(self, step, vector, of)?;
        self.made(step.id, vector, to, of)
    }

    /// Records that a value was computed in a register, and frees what is not needed any more.
    fn made(&mut self, id: u32, vector: usize, to: u8, of: &[Value]) -> Option<()> {
        self.registers.unlock();
        self.let_go(of);
        for value in of {
            self.free_slot(*value);
        }
        let value = self.value(id, vector);
        self.registers.put(value, to);
        self.now += 1;
        if let Some(s) = self.replaces[id as usize] {
            self.waits[s as usize * self.shape.block_vectors + vector] = true;
            self.store_next(s, vector)?;
        }
        for value in of {
            if let Source::State(s) = self.source(*value) {
                self.store_next(s, vector)?;
            }
        }
        self.let_go(&[value]);
        Some(())
    }

    fn free_slot(&mut self, value: Value) {
        if let Where::Slot(slot) = self.memory[value as usize]
            && !self.is_needed(value)
        {
            self.free_slots.push(slot);
            self.memory[value as usize] = Where::Nowhere;
        }
    }

    /// Moves the next value of a number of the state to its register or row, if it waits and the old one is not needed any more.
    fn store_next(&mut self, s: u32, vector: usize) -> Option<()> {
        let at = s as usize * self.shape.block_vectors + vector;
        let Some(id) = self.plan.next[s as usize].filter(|_| self.waits[at]) else { return Some(()) };
        if self.is_old_needed(s, vector) {
            return Some(());
        }
        self.waits[at] = false;
        let value = self.value(id, vector);
        match (self.homes[at], self.registers.of(value)) {
            (Some(home), None) => self.load(value, home),
            (Some(home), Some(register)) => {
                if home != register {
                    self.as_wide_as(value, |code| code.copy(home, register));
                }
                self.registers.put(value, home);
            }
            (None, register) => {
                if register.is_none() {
                    let register = self.take()?;
                    self.load(value, register);
                }
                let register = self.registers.of(value)?;
                self.store(s, value, register);
                if let Where::Slot(slot) = self.memory[value as usize] {
                    self.free_slots.push(slot);
                }
                self.memory[value as usize] = Where::State(s);
            }
        }
        self.free_slot(value);
        self.let_go(&[value]);
        Some(())
    }
}
