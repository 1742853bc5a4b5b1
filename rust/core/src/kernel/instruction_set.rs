//! Facts about a CPU by which a kernel writer chooses instructions.

use std::fmt::Debug;

use super::pack::Move;
use crate::tape::Op;

/// The instructions of a CPU.
pub(crate) trait InstructionSet: Sized {
    /// An instruction, or a few that belong together.
    type Instruction: Copy + Debug;

    /// Whether the numbers of one member may be lanes of vectors.
    const PACKS: bool = false;

    /// The instruction of an operation, which is no change of sign and no selection.
    fn instruction(&self, op: Op) -> Self::Instruction;

    /// A change of sign; and the bits of its second operand, if that is a constant.
    fn negate(&self) -> (Self::Instruction, Option<u64>);

    /// A selection between the second and the third operand by the bits of the first. `is_mask`: each number of the first has
    /// all bits set, or none.
    fn select(&self, is_mask: bool) -> Self::Instruction;

    /// A comparison of the first two operands that selects the third or the fourth; None if that takes two instructions.
    fn pick(&self, comparison: Op) -> Option<Self::Instruction>;

    /// The minimum of two numbers (`a` if a < b, else `b`) or the maximum (`a` if a > b, else `b`); so `b` if one is NaN. None
    /// if that takes more than one instruction.
    fn min_or_max(&self, _is_greater: bool) -> Option<Self::Instruction> {
        None
    }

    /// The first number times two to the power of the second, a whole number; rounded once, so that no factor needs to be a
    /// normal number. None if that takes more than one instruction.
    fn scale(&self) -> Option<Self::Instruction> {
        None
    }

    /// Moves numbers of one member between lanes. Called only if [`InstructionSet::PACKS`].
    fn moving(&self, _to: Move) -> Self::Instruction {
        self.instruction(Op::Copy(0))
    }
}
