//! The instructions of NEON for the operations of a tape.
//!
//! Operands are in registers, and most instructions have a register of its own for the result.
//!
//! **To add an operation**, give it a line in `instruction`; if it is of a new kind, an arm in `make` as well.

use super::encode::{self as n, Code, Form, General, Words};
use crate::{
    kernel::{
        frame::place,
        instruction_set::InstructionSet,
        machine::{Base, Counter, Machine, Place},
        plan::Step,
        shape::Shape,
        write::{MakeOperation, Value, Writer},
    },
    tape::Op,
};

/// An instruction, or a few that belong together.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Instruction {
    /// An instruction of two values.
    Two(Form),
    /// An instruction of two values, the second first.
    Turned(Form),
    /// An instruction of one value.
    One(Form),
    /// a · b + c, rounded once.
    MulAdd,
    /// a · b − c
    MulSub,
    /// c − a · b
    SubMul,
    /// The second or the third value, by the bits of the first.
    Select,
    /// A copy of the operand.
    Copy,
}

const ARGUMENTS: General = General(0);
const STEPS: General = General(7);
const BLOCKS: General = General(9);
/// How the caller rounds.
const ROUNDING: General = General(10);
/// Registers for an address, and for an offset that does not fit into an instruction.
const ADDRESS: General = General(17);
const SPARE: General = General(16);

/// The general register of a pointer. All are the callee's to use.
fn pointer(base: Base) -> General {
    General(match base {
        Base::State => 1,
        Base::Rows => 2,
        Base::Pool => 3,
        Base::PerStep => 4,
        Base::Held => 5,
        Base::Scratch => 6,
    })
}

impl InstructionSet for Code {
    type Instruction = Instruction;

    fn instruction(&self, op: Op) -> Instruction {
        let bits = 8 * self.size as u32;
        match op {
            Op::Add(..) => Instruction::Two(n::ADD),
            Op::Sub(..) => Instruction::Two(n::SUB),
            Op::Mul(..) => Instruction::Two(n::MUL),
            Op::Div(..) => Instruction::Two(n::DIV),
            Op::MulAdd(..) => Instruction::MulAdd,
            Op::MulSub(..) => Instruction::MulSub,
            Op::SubMul(..) => Instruction::SubMul,
            Op::And(..) => Instruction::Two(n::AND),
            Op::Or(..) => Instruction::Two(n::OR),
            Op::Xor(..) => Instruction::Two(n::XOR),
            Op::AddBits(..) => Instruction::Two(n::ADD_BITS),
            Op::SubBits(..) => Instruction::Two(n::SUB_BITS),
            Op::Sqrt(_) => Instruction::One(n::SQRT),
            Op::Floor(_) => Instruction::One(n::FLOOR),
            Op::ShiftUp(_, places) => Instruction::One(n::shift_up(bits, places)),
            Op::ShiftDown(_, 0) => Instruction::Copy,
            Op::ShiftDown(_, places) => Instruction::One(n::shift_down(bits, places)),
            Op::Less(..) => Instruction::Turned(n::GREATER),
            Op::LessEqual(..) => Instruction::Turned(n::GREATER_EQUAL),
            Op::Equal(..) => Instruction::Two(n::EQUAL),
            // What is not asked for gets a default here.
            Op::Copy(_) | Op::Neg(_) | Op::Select(..) => Instruction::Copy,
            Op::State(_) | Op::Param(_) | Op::Step | Op::Time | Op::Const(_) | Op::Sample(..) => Instruction::Copy,
            Op::Row(_) | Op::Uniform(_) | Op::PerStep(_) | Op::Held(_) | Op::Gather(_) => Instruction::Copy,
        }
    }

    fn negate(&self) -> (Instruction, Option<u64>) {
        (Instruction::One(n::NEG), None)
    }

    fn select(&self, _is_mask: bool) -> Instruction {
        Instruction::Select
    }

    fn pick(&self, _comparison: Op) -> Option<Instruction> {
        None
    }
}

impl Machine for Code {
    // A jump reaches 2²⁷ bytes. An operation takes at most 23 instructions, 92 bytes: four for each of its operands and its
    // result, four for a value that it spills, and three of its own.
    const MOST_OPERATIONS: usize = 1 << 20;

    fn new(shape: Shape, instructions: usize) -> Code {
        Code { bytes: Vec::with_capacity(8 * instructions + 512), width: shape.width, size: shape.bytes }
    }

    fn load(&mut self, register: u8, from: Place) {
        let mut base = pointer(from.base);
        if let Some(entry) = from.held {
            self.load_general(ADDRESS, pointer(Base::PerStep), entry * 8, SPARE);
            self.add_numbers(ADDRESS, base, ADDRESS);
            base = ADDRESS;
        }
        self.load_vector(register, base, from.at as u32, from.one, SPARE);
        if from.one && self.width > 1 {
            self.spread(register, register);
        }
    }

    fn store(&mut self, register: u8, to: Place) {
        self.store_vector(register, pointer(to.base), to.at as u32, SPARE);
    }

    fn copy(&mut self, to: u8, from: u8) {
        self.move_vector(to, from);
    }

    fn enter(&mut self) {
        self.keep_vectors();
        self.get_rounding(ROUNDING);
        self.round_to_nearest();
        let arguments = [
            (Base::State, place::STATE),
            (Base::Rows, place::ROWS),
            (Base::Pool, place::POOL),
            (Base::Held, place::HELD),
            (Base::Scratch, place::SCRATCH),
        ];
        for (base, at) in arguments {
            self.load_general(pointer(base), ARGUMENTS, at as u32, SPARE);
        }
        self.rewind();
    }

    fn leave(&mut self) {
        self.set_rounding(ROUNDING);
        self.restore_vectors();
        self.end();
    }

    fn rewind(&mut self) {
        self.load_general(pointer(Base::PerStep), ARGUMENTS, place::PER_STEP as u32, SPARE);
        self.load_general(STEPS, ARGUMENTS, place::STEPS as u32, SPARE);
    }

    fn advance(&mut self, base: Base, bytes: i32) {
        self.add_general(pointer(base), bytes, SPARE);
    }

    fn count_blocks(&mut self, blocks: i32) {
        self.set_general(BLOCKS, blocks as u32);
    }

    fn align(&mut self) {
        self.pad();
    }

    fn here(&self) -> usize {
        self.bytes.len()
    }

    fn count_down(&mut self, of: Counter, to: usize) {
        let counter = match of {
            Counter::Steps => STEPS,
            Counter::Blocks => BLOCKS,
        };
        self.decrement_and_jump(counter, to);
    }

    fn take_bytes(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.bytes)
    }
}

impl MakeOperation for Code {
    fn make(writer: &mut Writer<Code>, step: &Step<Instruction>, vector: usize, of: &[Value]) -> Option<u8> {
        let mut registers = [0; 3];
        for (register, value) in registers.iter_mut().zip(of) {
            *register = writer.fetch(*value)?;
        }
        let [a, b, c] = registers;
        match step.instruction {
            Instruction::MulAdd if writer.shape.width > 1 => writer.fused(n::ADD_PRODUCT, false, step.id, vector, of),
            Instruction::MulSub if writer.shape.width > 1 => writer.fused(n::ADD_PRODUCT, true, step.id, vector, of),
            Instruction::SubMul if writer.shape.width > 1 => writer.fused(n::SUB_PRODUCT, false, step.id, vector, of),
            Instruction::Select => {
                let to = writer.result_over(step.id, vector, of, of, &[])?;
                let code = &mut writer.code;
                match to {
                    _ if to == b && to != a => code.three(n::INSERT_WHERE_NOT, to, c, a),
                    _ if to == c && to != a => code.three(n::INSERT_WHERE, to, b, a),
                    _ => {
                        if to != a {
                            code.move_vector(to, a);
                        }
                        code.three(n::CHOOSE, to, b, c);
                    }
                }
                Some(to)
            }
            instruction => {
                let to = writer.result(step.id, vector, of)?;
                let code = &mut writer.code;
                match instruction {
                    Instruction::Two(form) => code.three(form, to, a, b),
                    Instruction::Turned(form) => code.three(form, to, b, a),
                    Instruction::One(form) => code.two(form, to, a),
                    Instruction::MulAdd => code.fused(n::MUL_ADD, to, a, b, c),
                    Instruction::MulSub => code.fused(n::MUL_SUB, to, a, b, c),
                    Instruction::SubMul => code.fused(n::SUB_MUL, to, a, b, c),
                    Instruction::Copy | Instruction::Select if to == a => {}
                    Instruction::Copy | Instruction::Select => code.move_vector(to, a),
                }
                Some(to)
            }
        }
    }
}

impl Writer<'_, Code> {
    /// Of vectors, the sum overwrites its term, which may have to change its sign before: the factors must then be elsewhere.
    fn fused(&mut self, words: Words, negated: bool, id: u32, vector: usize, of: &[Value]) -> Option<u8> {
        let &[a, b, c] = of else { return None };
        let term = self.registers.of(c)?;
        let (first, second) = (self.registers.of(a)?, self.registers.of(b)?);
        let mut apart = [first, second];
        if !negated {
            // A product of the term itself is added to it as any other: all operands are read before the result is written. The
            // place of the other factor is no place for it.
            apart = [first, second].map(|factor| if factor != term { factor } else { u8::MAX });
        }
        let to = self.result_over(id, vector, of, &[c], &apart)?;
        if negated {
            self.code.two(n::NEG, to, term);
        } else if to != term {
            self.code.move_vector(to, term);
        }
        self.code.overwrite(words, to, first, second);
        Some(to)
    }
}
