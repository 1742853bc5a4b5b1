//! One step of the vectors of a block, instruction after instruction.
//!
//! A value is in a register, in memory, or both. Leaves are in memory from the start; a result is spilled to the scratch only when
//! registers run out. Each number of the state has a home: a register of its own, or its row. The next value goes there as soon as
//! the old one is not needed any more: at once if the instruction that computes it is the last to read the old one.

use super::{
    Shape,
    encode::{self as x, Code, Form, General, Memory, Operand},
    plan::{Doing, Plan, Source, Step, turned},
};
use crate::kernel::registers::{NONE, Registers, Uses};

/// Where a value is in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Where {
    Nowhere,
    /// As its source says.
    Leaf,
    /// In the scratch.
    Slot(u32),
    /// In the row of a number of the state, which it has replaced.
    State(u32),
}

/// A value of one of the vectors of a block.
pub type Value = u32;

#[derive(Debug)]
pub struct Writer<'a> {
    pub plan: &'a Plan,
    pub shape: Shape,
    /// The operations, each for a vector, in the order in which they are made.
    pub order: Vec<(&'a Step, usize)>,
    pub code: Code,
    pub registers: Registers,
    pub uses: Uses,
    pub memory: Vec<Where>,
    /// Which number of the state a value of the plan replaces.
    pub replaces: Vec<Option<u32>>,
    /// Of each number of the state in each vector of the block its register, if it has one.
    pub homes: Vec<Option<u8>>,
    /// Of the same, whether the next value waits for the old one to be read.
    pub waits: Vec<bool>,
    /// The current time: twice the index in the order.
    pub now: u32,
    pub free_slots: Vec<u32>,
    pub slots: u32,
}

/// The general registers of a kernel. Those that point to rows are advanced from block to block.
pub const STATE: General = General::Rdi;
pub const ROWS: General = General::Rsi;
pub const POOL: General = General::Rdx;
pub const STEPS: General = General::Rcx;
pub const PER_STEP: General = General::R8;
pub const SCRATCH: General = General::R9;
pub const HELD: General = General::R10;
pub const BLOCKS: General = General::R11;
pub const ARGUMENTS: General = General::Rbx;

impl Writer<'_> {
    /// The value of the plan in a vector.
    pub fn value(&self, id: u32, vector: usize) -> Value {
        let vector = if self.plan.sources[id as usize].is_shared() { 0 } else { vector };
        id * self.shape.block_vectors as u32 + vector as u32
    }

    fn source(&self, value: Value) -> Source {
        self.plan.sources[value as usize / self.shape.block_vectors]
    }

    fn bytes(&self) -> i32 {
        8 * self.shape.width as i32
    }

    fn in_row(&self, base: General, row: u32, value: Value) -> Memory {
        let vector = value as usize % self.shape.block_vectors;
        Memory::new(base, (row as usize * self.shape.lanes() * 8) as i32 + vector as i32 * self.bytes())
    }

    fn place(&self, value: Value) -> Memory {
        match (self.memory[value as usize], self.source(value)) {
            (Where::Slot(slot), _) => Memory::new(SCRATCH, slot as i32 * self.bytes()),
            (Where::State(s), _) | (_, Source::State(s) | Source::Kept(s)) => self.in_row(STATE, s, value),
            (_, Source::Row(i)) => self.in_row(ROWS, i, value),
            (_, Source::Pool(i)) => Memory::new(POOL, (i as usize * self.shape.pool_copies() * 8) as i32),
            (_, Source::PerStep(i)) => Memory::new(PER_STEP, i as i32 * 8),
            (_, Source::Held(_)) => Memory { indexed: true, ..self.in_row(HELD, 0, value) },
            (_, Source::Made) => Memory::new(SCRATCH, 0), // It is in a register: never read from here.
        }
    }

    /// The value in memory as an operand, if this instruction can take it from there.
    fn in_place(&self, value: Value, form: Form) -> Option<Memory> {
        let source = self.source(value);
        let single = self.shape.width == 1;
        let is_whole = single && form.single.is_some();
        let can = match source {
            // Its address must be loaded first.
            Source::Held(_) => false,
            _ if self.code.evex => true,
            _ if single => is_whole || matches!(source, Source::Pool(_)),
            _ => !matches!(source, Source::PerStep(_)),
        };
        let broadcast = self.code.evex && if single { !is_whole } else { source.is_shared() };
        can.then(|| Memory { broadcast, ..self.place(value) })
    }

    /// Loads a value.
    pub fn load(&mut self, value: Value, register: u8) {
        let place = self.place(value);
        if let Source::Held(i) = self.source(value) {
            self.code.load_general(General::Rax, Memory::new(PER_STEP, i as i32 * 8));
        }
        let is_one = match self.source(value) {
            Source::Pool(_) => self.code.evex,
            Source::PerStep(_) => true,
            _ => false,
        };
        let form = if is_one && self.shape.width > 1 { x::BROADCAST } else { x::LOAD };
        self.code.vector(form, register, 0, Operand::Memory(place));
        self.registers.put(value, register);
    }

    /// Stores to the row of a number of the state.
    pub fn store(&mut self, s: u32, value: Value, register: u8) {
        let row = self.in_row(STATE, s, value);
        self.code.vector(x::STORE, register, 0, Operand::Memory(row));
    }

    /// The cost of keeping a value in its register: how many operations until it is needed, twice as many if memory holds it too.
    fn price(uses: &mut Uses, memory: &[Where], now: u32, value: Value) -> u32 {
        let wait = uses.next(value, now).saturating_sub(now);
        if memory[value as usize] == Where::Nowhere { wait } else { wait.saturating_mul(2) }
    }

    /// A register to write to. The value that it held is spilled if it is still needed.
    fn take(&mut self) -> Option<u8> {
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
            self.code.vector(x::STORE, register, 0, Operand::Memory(place));
        }
        self.registers.release(victim);
        Some(register)
    }

    /// The register of a value, which is loaded if it is in none.
    fn fetch(&mut self, value: Value) -> Option<u8> {
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

    /// A value as the last operand of an instruction: from memory if that is as good.
    fn operand(&mut self, value: Value, form: Form) -> Option<Operand> {
        if self.registers.of(value).is_none()
            && let Some(place) = self.in_place(value, form)
        {
            let next = self.uses.next(value, self.now);
            if next == NONE {
                return Some(Operand::Memory(place));
            }
            if self.registers.free() < 2 {
                // It is worth a register if no value that is needed later has to leave one.
                let (uses, memory, now) = (&mut self.uses, &self.memory, self.now);
                let price = |value| match memory[value as usize] {
                    Where::Nowhere => 0,
                    _ => uses.next(value, now) - now,
                };
                match self.registers.victim(next - now, price) {
                    Some(victim) => self.registers.release(victim),
                    None => return Some(Operand::Memory(place)),
                }
            }
        }
        self.fetch(value).map(Operand::Register)
    }

    fn is_needed(&mut self, value: Value) -> bool {
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

    /// The register for what is made of these: the home of the number of the state that it replaces, one of theirs, or another.
    fn result(&mut self, id: u32, vector: usize, of: &[Value]) -> Option<u8> {
        self.let_go(of);
        if let Some(s) = self.replaces[id as usize]
            && let Some(home) = self.homes[s as usize * self.shape.block_vectors + vector]
            && !self.is_old_needed(s, vector)
        {
            return Some(home);
        }
        self.take()
    }

    fn is_old_needed(&mut self, s: u32, vector: usize) -> bool {
        self.plan.old[s as usize].is_some_and(|old| {
            let old = self.value(old, vector);
            self.is_needed(old)
        })
    }

    /// Writes one operation for one vector. None if there are too few registers even so.
    pub fn make(&mut self, step: &Step, vector: usize) -> Option<()> {
        let mut of = [0; 4];
        for (value, id) in of.iter_mut().zip(step.of()) {
            *value = self.value(*id, vector);
        }
        let of = &of[..step.of().len()];
        for value in of {
            if let Some(register) = self.registers.of(*value) {
                self.registers.lock(register);
            }
        }
        let to = match step.doing {
            Doing::Two(form, commutes) => {
                let (first, second) = if commutes { self.in_order(of[0], of[1]) } else { (of[0], of[1]) };
                let first = self.fetch(first)?;
                let second = self.operand(second, form)?;
                let to = self.result(step.id, vector, of)?;
                self.code.vector(form, to, first, second);
                to
            }
            Doing::One(form, byte) => {
                // Of single numbers such an instruction has two operands: the other lanes are those of the first.
                let single = self.shape.width == 1 && form.single.is_some();
                let second = if single { Operand::Register(self.fetch(of[0])?) } else { self.operand(of[0], form)? };
                let first = if let (true, Operand::Register(register)) = (single, second) { register } else { 0 };
                let to = self.result(step.id, vector, of)?;
                self.code.vector(form, to, first, second);
                self.code.bytes.extend(byte);
                to
            }
            Doing::Fused(fused) => self.fused(fused, step, vector, of)?,
            Doing::Shift(way, places) => {
                let second = if self.code.evex { self.operand(of[0], x::SHIFT)? } else { Operand::Register(self.fetch(of[0])?) };
                let to = self.result(step.id, vector, of)?;
                self.code.vector_and_byte(x::SHIFT, way, to, second, places);
                to
            }
            Doing::Compare(predicate) => {
                let (first, second, predicate) = self.compared(of[0], of[1], predicate)?;
                let to = self.result(step.id, vector, of)?;
                if self.code.evex {
                    self.code.vector_and_byte(x::COMPARE, 1, first, second, predicate);
                    self.code.vector(x::SPREAD_MASK, to, 0, Operand::Register(1));
                } else {
                    self.code.vector_and_byte(x::COMPARE, to, first, second, predicate);
                }
                to
            }
            Doing::Pick(predicate) => {
                let (first, second, predicate) = self.compared(of[0], of[1], predicate)?;
                self.code.vector_and_byte(x::COMPARE, 1, first, second, predicate);
                let no = self.fetch(of[3])?;
                let yes = self.operand(of[2], x::BLEND)?;
                let to = self.result(step.id, vector, of)?;
                self.code.masked(x::BLEND, to, no, yes, 1);
                to
            }
            Doing::Select(is_mask) => self.select(is_mask, step, vector, of)?,
            Doing::Copy => {
                let from = self.operand(of[0], x::LOAD)?;
                let to = self.result(step.id, vector, of)?;
                match from {
                    Operand::Register(from) if from == to => {}
                    Operand::Register(_) => self.code.vector(x::MOVE, to, 0, from),
                    Operand::Memory(_) => {
                        self.load(of[0], to);
                        self.registers.release(of[0]);
                    }
                }
                to
            }
        };
        self.made(step.id, vector, to, of)
    }

    /// Two values in the order in which the one in memory, if there is one, comes last; else the one that is needed longer first.
    fn in_order(&mut self, a: Value, b: Value) -> (Value, Value) {
        match (self.registers.of(a), self.registers.of(b)) {
            (None, Some(_)) => (b, a),
            (None, None) if self.uses.next(a, self.now) > self.uses.next(b, self.now) => (b, a),
            _ => (a, b),
        }
    }

    fn compared(&mut self, a: Value, b: Value, predicate: u8) -> Option<(u8, Operand, u8)> {
        let (first, second) = self.in_order(a, b);
        let predicate = if first == a { predicate } else { turned(predicate) };
        let first = self.fetch(first)?;
        Some((first, self.operand(second, x::COMPARE)?, predicate))
    }

    /// One of three operands is overwritten, and one may come from memory.
    fn fused(&mut self, fused: x::Fused, step: &Step, vector: usize, of: &[Value]) -> Option<u8> {
        let &[a, b, c] = of else { return None };
        let (a, b) = self.in_order(a, b);
        let a = self.fetch(a)?;
        if self.registers.of(c).is_none() {
            let b = self.fetch(b)?;
            let c = self.operand(c, fused.over_other)?;
            let to = self.result(step.id, vector, of)?;
            let other = if to == b { a } else { b };
            if to != a && to != b {
                // What it overwrites may be the third operand's, if that has a register after all.
                if let Operand::Register(c) = c
                    && to == c
                {
                    self.code.vector(fused.over_term, to, a, Operand::Register(b));
                    return Some(to);
                }
                self.code.vector(x::MOVE, to, 0, Operand::Register(a));
            }
            self.code.vector(fused.over_other, to, other, c);
            return Some(to);
        }
        let c = self.fetch(c)?;
        let b = self.operand(b, fused.over_term)?;
        let to = self.result(step.id, vector, of)?;
        match b {
            _ if to == c => self.code.vector(fused.over_term, to, a, b),
            _ if to == a => self.code.vector(fused.over_factor, to, c, b),
            Operand::Register(b) if to == b => self.code.vector(fused.over_other, to, a, Operand::Register(c)),
            _ => {
                self.code.vector(x::MOVE, to, 0, Operand::Register(c));
                self.code.vector(fused.over_term, to, a, b);
            }
        }
        Some(to)
    }

    fn select(&mut self, is_mask: bool, step: &Step, vector: usize, of: &[Value]) -> Option<u8> {
        let &[m, a, b] = of else { return None };
        if self.code.evex {
            // A function of three bits overwrites one of its operands; which one decides the table of the function.
            let (m, a) = (self.fetch(m)?, self.fetch(a)?);
            let b = self.operand(b, x::BITS_OF_THREE)?;
            let to = self.result(step.id, vector, of)?;
            let (first, second, table) = match b {
                _ if to == m => (a, b, 0xCA),
                _ if to == a => (m, b, 0xE2),
                Operand::Register(b) if to == b => (m, Operand::Register(a), 0xB8),
                _ => {
                    self.code.vector(x::MOVE, to, 0, Operand::Register(m));
                    (a, b, 0xCA)
                }
            };
            self.code.vector_and_byte(x::BITS_OF_THREE, to, first, second, table);
            return Some(to);
        }
        let (m, b) = (self.fetch(m)?, self.fetch(b)?);
        if is_mask {
            let a = self.operand(a, x::BLEND_BY_SIGN)?;
            let to = self.result(step.id, vector, of)?;
            self.code.vector_and_byte(x::BLEND_BY_SIGN, to, b, a, m << 4);
            return Some(to);
        }
        let a = self.operand(a, x::AND)?;
        let chosen = self.take()?;
        self.registers.lock(chosen);
        self.code.vector(x::AND, chosen, m, a);
        let to = self.result(step.id, vector, of)?;
        self.code.vector(x::AND_NOT, to, m, Operand::Register(b));
        self.code.vector(x::OR, to, chosen, Operand::Register(to));
        Some(to)
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
                    self.code.vector(x::MOVE, home, 0, Operand::Register(register));
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
