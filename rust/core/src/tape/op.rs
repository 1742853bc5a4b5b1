//! The operations of which a tape is made.

/// A value on a tape, by the index of its operation.
pub type Id = u32;

/// An operation. Comparisons set all bits of a number where they are true, and none where they are false.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Op {
    /// A number of the state, as it is at the start of the step.
    State(u32),
    /// A parameter of the member.
    Param(u32),
    /// The step h.
    Step,
    /// The time at the start of the step.
    Time,
    /// A number, by its bits; of 32 bits the lower half.
    Const(u64),
    /// A sampled input at a time.
    Sample(u32, Id),
    /// a + b
    Add(Id, Id),
    /// a − b
    Sub(Id, Id),
    /// a · b
    Mul(Id, Id),
    /// a / b
    Div(Id, Id),
    /// a · b + c, rounded once
    MulAdd(Id, Id, Id),
    /// a · b − c, rounded once
    MulSub(Id, Id, Id),
    /// c − a · b, rounded once
    SubMul(Id, Id, Id),
    /// √a
    Sqrt(Id),
    /// −a
    Neg(Id),
    /// The largest whole number not above a.
    Floor(Id),
    /// a < b; false of a NaN, as all comparisons are.
    Less(Id, Id),
    /// a ≤ b
    LessEqual(Id, Id),
    /// a = b
    Equal(Id, Id),
    /// Of bits: where the first is set the second, else the third. A mask comes from a comparison.
    Select(Id, Id, Id),
    /// Bits of both.
    And(Id, Id),
    /// Bits of either.
    Or(Id, Id),
    /// Bits of one and not of both.
    Xor(Id, Id),
    /// The sum of both as whole numbers of as many bits, without a carry out.
    AddBits(Id, Id),
    /// Bits moved up by so many places, zeros after them.
    ShiftUp(Id, u32),
    /// Bits moved down by so many places, zeros before them.
    ShiftDown(Id, u32),
    /// The same value again: where the next state is a number of the present one, or a constant.
    Copy(Id),
    /// Of a body ([`super::split::Body`]): a number of the member that is the same in every step.
    Row(u32),
    /// Of a body: a number that is the same for all members and steps. Of a tape that is being cut: a fact of an input, see
    /// `split`.
    Uniform(u32),
    /// Of a body: a number of the step, the same for all members.
    PerStep(u32),
    /// Of a body: a number of the member that its sampled inputs have at the step.
    Held(u32),
    /// Of a body: a sample, by its place, where members are at times of their own.
    Gather(Id),
}

impl Op {
    /// Its operands: the first so many of the three.
    #[inline]
    pub fn operands(self) -> ([Id; 3], usize) {
        use Op::*;
        match self {
            State(_) | Param(_) | Step | Time | Const(_) | Row(_) | Uniform(_) | PerStep(_) | Held(_) => ([0; 3], 0),
            Sample(_, a) | Sqrt(a) | Neg(a) | Floor(a) | ShiftUp(a, _) | ShiftDown(a, _) | Copy(a) | Gather(a) => ([a, 0, 0], 1),
            Add(a, b)
            | Sub(a, b)
            | Mul(a, b)
            | Div(a, b)
            | Less(a, b)
            | LessEqual(a, b)
            | Equal(a, b)
            | And(a, b)
            | Or(a, b)
            | Xor(a, b)
            | AddBits(a, b) => ([a, b, 0], 2),
            MulAdd(a, b, c) | MulSub(a, b, c) | SubMul(a, b, c) | Select(a, b, c) => ([a, b, c], 3),
        }
    }

    /// The same operation with other operands.
    #[must_use]
    pub fn with(self, mut f: impl FnMut(Id) -> Id) -> Op {
        let (mut operands, n) = self.operands();
        for id in &mut operands[..n] {
            *id = f(*id);
        }
        self.over(operands)
    }

    /// The same operation over the first so many of three operands.
    fn over(self, [a, b, c]: [Id; 3]) -> Op {
        use Op::*;
        match self {
            State(_) | Param(_) | Step | Time | Const(_) | Row(_) | Uniform(_) | PerStep(_) | Held(_) => self,
            Sample(i, _) => Sample(i, a),
            Sqrt(_) => Sqrt(a),
            Neg(_) => Neg(a),
            Floor(_) => Floor(a),
            ShiftUp(_, n) => ShiftUp(a, n),
            ShiftDown(_, n) => ShiftDown(a, n),
            Copy(_) => Copy(a),
            Gather(_) => Gather(a),
            Add(..) => Add(a, b),
            Sub(..) => Sub(a, b),
            Mul(..) => Mul(a, b),
            Div(..) => Div(a, b),
            Less(..) => Less(a, b),
            LessEqual(..) => LessEqual(a, b),
            Equal(..) => Equal(a, b),
            MulAdd(..) => MulAdd(a, b, c),
            MulSub(..) => MulSub(a, b, c),
            SubMul(..) => SubMul(a, b, c),
            Select(..) => Select(a, b, c),
            And(..) => And(a, b),
            Or(..) => Or(a, b),
            Xor(..) => Xor(a, b),
            AddBits(..) => AddBits(a, b),
        }
    }

    /// Whether its two operands may be exchanged.
    pub(crate) fn commutes(self) -> bool {
        use Op::*;
        matches!(self, Add(..) | Mul(..) | Equal(..) | And(..) | Or(..) | Xor(..) | AddBits(..))
    }

    /// Whether it is an input of the tape, without operands.
    pub fn is_leaf(self) -> bool {
        self.operands().1 == 0
    }
}

/// How often each kind of operation occurs. Changes of sign, copies and bit masks are not arithmetic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Additions and subtractions.
    pub additions: u32,
    /// Products.
    pub multiplications: u32,
    /// Fused multiply-adds: a product and a sum, rounded once.
    pub fused: u32,
    /// Quotients.
    pub divisions: u32,
    /// Square roots.
    pub square_roots: u32,
    /// Comparisons and choices.
    pub choices: u32,
    /// Operations on bits, roundings to whole numbers.
    pub bits: u32,
}

impl Counts {
    /// Counts one more.
    pub fn note(&mut self, op: Op) {
        use Op::*;
        match op {
            Add(..) | Sub(..) => self.additions += 1,
            Mul(..) => self.multiplications += 1,
            MulAdd(..) | MulSub(..) | SubMul(..) => self.fused += 1,
            Div(..) => self.divisions += 1,
            Sqrt(_) => self.square_roots += 1,
            Less(..) | LessEqual(..) | Equal(..) | Select(..) => self.choices += 1,
            And(..) | Or(..) | Xor(..) | AddBits(..) | ShiftUp(..) | ShiftDown(..) | Floor(_) => self.bits += 1,
            State(_) | Param(_) | Step | Time | Const(_) | Sample(..) | Neg(_) | Copy(_) | Row(_) | Uniform(_) | PerStep(_)
            | Held(_) | Gather(_) => {}
        }
    }

    /// All of them.
    pub(crate) fn total(&self) -> usize {
        let kinds =
            [self.additions, self.multiplications, self.fused, self.divisions, self.square_roots, self.choices, self.bits];
        kinds.iter().fold(0, |all, count| all + *count as usize)
    }
}
