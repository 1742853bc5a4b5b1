//! The instructions of AVX2 and AVX-512 for the operations of a tape.
//!
//! **To add an operation**, give it a line in `instruction`; if it is of a new kind, an arm in `make` as well.

use super::encode::{self as x, Code, Form, General, Memory, Operand};
use crate::{
    isa::Level,
    kernel::{
        frame::place,
        instruction_set::InstructionSet,
        machine::{Base, Counter, Machine, Place},
        pack::Move,
        plan::{Source, Step},
        registers::NONE,
        shape::Shape,
        write::{MakeOperation, Value, Where, Writer},
    },
    tape::Op,
};

/// An instruction, or a few that belong together.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Instruction {
    /// An instruction of two values. Whether they may be exchanged.
    Two(Form, bool),
    /// An instruction of one value, with or without an immediate byte.
    One(Form, Option<u8>),
    /// A product and a sum, rounded once.
    Fused(x::Fused),
    /// Moves bits up or down.
    Shift(u8, u8),
    /// A mask of two values, by predicate.
    Compare(u8),
    /// The second or the third, by the bits of the first. Whether that is surely a mask: all bits of a number or none.
    Select(bool),
    /// The comparison of the first two by predicate chooses of the third and the fourth.
    Pick(u8),
    /// A copy of the operand.
    Copy,
    /// A move of numbers of one member between lanes.
    Move(Move),
}

const LESS: u8 = 0x11;
const LESS_EQUAL: u8 = 0x12;
const EQUAL: u8 = 0;
/// Round down, without raising the inexact flag.
const FLOOR: u8 = 9;

/// The predicate that says the same of two values in the other order.
pub(crate) fn turned(predicate: u8) -> u8 {
    match predicate {
        LESS => 0x1E,
        LESS_EQUAL => 0x1D,
        other => other,
    }
}

fn predicate(comparison: Op) -> u8 {
    match comparison {
        Op::Less(..) => LESS,
        Op::LessEqual(..) => LESS_EQUAL,
        _ => EQUAL,
    }
}

const STEPS: General = General::Rcx;
const BLOCKS: General = General::R11;
const ARGUMENTS: General = General::Rbx;

/// The general register of a pointer.
fn pointer(base: Base) -> General {
    match base {
        Base::State => General::Rdi,
        Base::Rows => General::Rsi,
        Base::Pool => General::Rdx,
        Base::PerStep => General::R8,
        Base::Scratch => General::R9,
        Base::Held => General::R10,
    }
}

fn counter(counter: Counter) -> General {
    match counter {
        Counter::Steps => STEPS,
        Counter::Blocks => BLOCKS,
    }
}

fn memory(place: Place) -> Memory {
    Memory { indexed: place.held.is_some(), ..Memory::new(pointer(place.base), place.at) }
}

impl InstructionSet for Code {
    type Instruction = Instruction;

    const PACKS: bool = true;

    fn instruction(&self, op: Op) -> Instruction {
        match op {
            Op::Add(..) => Instruction::Two(x::ADD, true),
            Op::Sub(..) => Instruction::Two(x::SUB, false),
            Op::Mul(..) => Instruction::Two(x::MUL, true),
            Op::Div(..) => Instruction::Two(x::DIV, false),
            Op::MulAdd(..) => Instruction::Fused(x::MUL_ADD),
            Op::MulSub(..) => Instruction::Fused(x::MUL_SUB),
            Op::SubMul(..) => Instruction::Fused(x::SUB_MUL),
            Op::And(..) => Instruction::Two(x::AND, true),
            Op::Or(..) => Instruction::Two(x::OR, true),
            Op::Xor(..) => Instruction::Two(x::XOR, true),
            Op::AddBits(..) => Instruction::Two(x::ADD_BITS, true),
            Op::SubBits(..) => Instruction::Two(x::SUB_BITS, false),
            Op::Sqrt(_) => Instruction::One(x::SQRT, None),
            Op::Floor(_) => Instruction::One(x::ROUND, Some(FLOOR)),
            Op::ShiftUp(_, n) => Instruction::Shift(x::UP, n as u8),
            Op::ShiftDown(_, n) => Instruction::Shift(x::DOWN, n as u8),
            Op::Less(..) | Op::LessEqual(..) | Op::Equal(..) => Instruction::Compare(predicate(op)),
            // What is not asked for gets a default here.
            Op::Copy(_) | Op::Neg(_) | Op::Select(..) => Instruction::Copy,
            Op::State(_) | Op::Param(_) | Op::Step | Op::Time | Op::Const(_) | Op::Sample(..) => Instruction::Copy,
            Op::Row(_) | Op::Uniform(_) | Op::PerStep(_) | Op::Held(_) | Op::Gather(_) => Instruction::Copy,
        }
    }

    fn negate(&self) -> (Instruction, Option<u64>) {
        (Instruction::Two(x::XOR, true), Some(1 << (8 * self.size - 1)))
    }

    fn select(&self, is_mask: bool) -> Instruction {
        Instruction::Select(is_mask)
    }

    /// With a mask register.
    fn pick(&self, comparison: Op) -> Option<Instruction> {
        self.evex.then(|| Instruction::Pick(predicate(comparison)))
    }

    fn min_or_max(&self, is_greater: bool) -> Option<Instruction> {
        Some(Instruction::Two(if is_greater { x::MAXIMUM } else { x::MINIMUM }, false))
    }

    fn scale(&self) -> Option<Instruction> {
        self.evex.then_some(Instruction::Two(x::SCALE, false))
    }

    fn moving(&self, to: Move) -> Instruction {
        Instruction::Move(to)
    }
}

impl Machine for Code {
    // Jumps fit into 31 bits: an operation takes at most some hundred bytes.
    const MOST_OPERATIONS: usize = 1 << 22;

    fn new(shape: Shape, instructions: usize) -> Code {
        Code {
            bytes: Vec::with_capacity(16 * instructions + 512),
            evex: shape.level == Level::Avx512,
            width: shape.width,
            size: shape.bytes,
        }
    }

    fn of_width(&mut self, width: usize) {
        self.width = width;
    }

    fn load(&mut self, register: u8, from: Place) {
        if let Some(entry) = from.held {
            self.load_general(General::Rax, Memory::new(pointer(Base::PerStep), entry as i32 * 8));
        }
        let form = if from.one && self.width > 1 { x::BROADCAST } else { x::LOAD };
        self.vector(form, register, 0, Operand::Memory(memory(from)));
    }

    fn store(&mut self, register: u8, to: Place) {
        self.vector(x::STORE, register, 0, Operand::Memory(memory(to)));
    }

    fn copy(&mut self, to: u8, from: u8) {
        self.vector(x::MOVE, to, 0, Operand::Register(from));
    }

    fn enter(&mut self) {
        self.keep_rbx(General::Rdi);
        self.keep_rounding(Memory::new(ARGUMENTS, place::ROUNDING));
        self.set_rounding(Memory::new(ARGUMENTS, place::ROUNDING + 4));
        let arguments = [
            (pointer(Base::State), place::STATE),
            (pointer(Base::Rows), place::ROWS),
            (pointer(Base::Pool), place::POOL),
            (pointer(Base::Held), place::HELD),
            (pointer(Base::Scratch), place::SCRATCH),
            (pointer(Base::PerStep), place::PER_STEP),
            (STEPS, place::STEPS),
        ];
        for (register, at) in arguments {
            self.load_general(register, Memory::new(ARGUMENTS, at));
        }
    }

    fn leave(&mut self) {
        self.set_rounding(Memory::new(ARGUMENTS, place::ROUNDING));
        self.end();
    }

    fn rewind(&mut self) {
        self.load_general(pointer(Base::PerStep), Memory::new(ARGUMENTS, place::PER_STEP));
        self.load_general(STEPS, Memory::new(ARGUMENTS, place::STEPS));
    }

    fn advance(&mut self, base: Base, bytes: i32) {
        self.add_general(pointer(base), bytes);
    }

    fn count_blocks(&mut self, blocks: i32) {
        self.set_general(BLOCKS, blocks);
    }

    fn align(&mut self) {
        self.pad();
    }

    fn here(&self) -> usize {
        self.bytes.len()
    }

    fn count_down(&mut self, of: Counter, to: usize) {
        self.decrement_and_jump(counter(of), to);
    }

    fn take_bytes(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.bytes)
    }
}

impl MakeOperation for Code {
    fn make(writer: &mut Writer<Code>, step: &Step<Instruction>, vector: usize, of: &[Value]) -> Option<u8> {
        Some(match step.instruction {
            Instruction::Two(form, commutes) => {
                let (first, second) = if commutes { writer.in_order(of[0], of[1]) } else { (of[0], of[1]) };
                let first = writer.fetch(first)?;
                let second = writer.operand(second, form)?;
                let to = writer.result(step.id, vector, of)?;
                writer.code.vector(form, to, first, second);
                to
            }
            Instruction::One(form, byte) => {
                // Of single numbers such an instruction has two operands: the other lanes are those of the first.
                let single = writer.code.width == 1 && form.double.first.is_some();
                let second = if single { Operand::Register(writer.fetch(of[0])?) } else { writer.operand(of[0], form)? };
                let first = if let (true, Operand::Register(register)) = (single, second) { register } else { 0 };
                let to = writer.result(step.id, vector, of)?;
                writer.code.vector(form, to, first, second);
                writer.code.bytes.extend(byte);
                to
            }
            Instruction::Fused(fused) => writer.fused(fused, step, vector, of)?,
            Instruction::Shift(way, places) => {
                let second =
                    if writer.code.evex { writer.operand(of[0], x::SHIFT)? } else { Operand::Register(writer.fetch(of[0])?) };
                let to = writer.result(step.id, vector, of)?;
                writer.code.vector_and_byte(x::SHIFT, way, to, second, places);
                to
            }
            Instruction::Compare(predicate) => {
                let (first, second, predicate) = writer.compared(of[0], of[1], predicate)?;
                let to = writer.result(step.id, vector, of)?;
                if writer.code.evex {
                    writer.code.vector_and_byte(x::COMPARE, 1, first, second, predicate);
                    writer.code.vector(x::SPREAD_MASK, to, 0, Operand::Register(1));
                } else {
                    writer.code.vector_and_byte(x::COMPARE, to, first, second, predicate);
                }
                to
            }
            Instruction::Pick(predicate) => {
                let (first, second, predicate) = writer.compared(of[0], of[1], predicate)?;
                writer.code.vector_and_byte(x::COMPARE, 1, first, second, predicate);
                let no = writer.fetch(of[3])?;
                let yes = writer.operand(of[2], x::BLEND)?;
                let to = writer.result(step.id, vector, of)?;
                writer.code.masked(x::BLEND, to, no, yes, 1);
                to
            }
            Instruction::Select(is_mask) => writer.select(is_mask, step, vector, of)?,
            Instruction::Move(to) => writer.moved(to, step, vector, of)?,
            Instruction::Copy => {
                let from = writer.operand(of[0], x::LOAD)?;
                let to = writer.result(step.id, vector, of)?;
                match from {
                    Operand::Register(from) if from == to => {}
                    Operand::Register(_) => writer.code.vector(x::MOVE, to, 0, from),
                    Operand::Memory(_) => {
                        writer.load(of[0], to);
                        writer.registers.release(of[0]);
                    }
                }
                to
            }
        })
    }
}

impl Writer<'_, Code> {
    /// The value in memory as an operand, if this instruction can take it from there.
    fn in_place(&self, value: Value, form: Form) -> Option<Memory> {
        let source = self.source(value);
        let single = self.code.width == 1;
        let is_whole = single && form.double.first.is_some();
        let has_home = self.plan.packing.is_some() && !matches!(source, Source::PerStep(_));
        let can = match source {
            // Its address must be loaded first.
            Source::Held(_) => false,
            _ if self.code.evex => true,
            _ if has_home => true,
            _ if single => is_whole || matches!(source, Source::Pool(_)),
            _ => !matches!(source, Source::PerStep(_)),
        };
        let broadcast = self.code.evex && if single { !is_whole } else { source.is_shared() };
        can.then(|| Memory { broadcast, ..memory(self.place(value)) })
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

    /// All operands are fetched: they may be shorter in memory than what an instruction would read there.
    fn moved(&mut self, how: Move, step: &Step<Instruction>, vector: usize, of: &[Value]) -> Option<u8> {
        let first = self.fetch(of[0])?;
        let second = match of.get(1) {
            Some(value) => self.fetch(*value)?,
            None => first,
        };
        let to = self.result(step.id, vector, of)?;
        let second = Operand::Register(second);
        let code = &mut self.code;
        match how {
            Move::Pick(lanes) => code.vector_and_byte(x::PICK, to, first, second, lanes),
            Move::Join => code.vector_and_byte(x::JOIN, to, first, second, 1),
            Move::Permute(lanes) => code.vector_and_byte(x::PERMUTE, to, 0, second, lanes),
            Move::High => {
                code.of_width(4);
                code.vector_and_byte(x::HIGH, first, 0, Operand::Register(to), 1);
                code.of_width(2);
            }
        }
        Some(to)
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
    fn fused(&mut self, fused: x::Fused, step: &Step<Instruction>, vector: usize, of: &[Value]) -> Option<u8> {
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

    fn select(&mut self, is_mask: bool, step: &Step<Instruction>, vector: usize, of: &[Value]) -> Option<u8> {
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
}
