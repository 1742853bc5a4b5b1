//! What a kernel writer needs to know of a CPU to choose instructions.

use std::fmt::Debug;

use super::pack::Move;
use crate::tape::Op;

/// The instructions of a CPU.
pub(crate) trait InstructionSet: Sized {
    /// An instruction, or a few that belong together.
    type Instruction: Copy + Debug;

    /// Whether the numbers of one member may be lanes of vectors.
    const PACKS: bool = false;

    /// The instruction of an operation. Changes of sign and choices are not asked for.
    fn instruction(&self, op: Op) -> Self::Instruction;

    /// A change of sign, and the bits of a constant that is its second operand, if it has one.
    fn negate(&self) -> (Self::Instruction, Option<u64>);

    /// By the bits of the first, of the second and the third. Whether the first is surely a mask: all bits of a number or none.
    fn select(&self, is_mask: bool) -> Self::Instruction;

    /// A comparison of the first two that chooses of the third and the fourth; None where that takes two instructions anyway.
    fn pick(&self, comparison: Op) -> Option<Self::Instruction>;

    /// The lesser of two numbers, or the greater: `a` if a < b, or if a > b, and else `b`, as where one is a NaN. None where that
    /// takes more than one instruction.
    fn min_or_max(&self, _is_greater: bool) -> Option<Self::Instruction> {
        None
    }

    /// What moves numbers of one member between lanes. Asked for only if it [packs](InstructionSet::PACKS).
    fn moving(&self, _to: Move) -> Self::Instruction {
        self.instruction(Op::Copy(0))
    }
}
