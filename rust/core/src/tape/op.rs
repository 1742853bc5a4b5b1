//! The operations of a tape.

/// A value on a tape, by the index of its operation.
pub type Id = u32;

/// The table of operations, one a line: its fields, which of them are operands, what it takes besides, its name, its text in a
/// listing, among which [`Counts`] it is counted, and whether its two operands may be exchanged.
macro_rules! operations {
    ($($(#[$doc:meta])* $op:ident $(($($field:ident: $type:ty),*))?, [$($operand:ident),*], $extra:expr, $name:literal,
       $text:literal, $counted:ident $(, $commutes:ident)?;)*) => {
        /// An operation. Comparisons set all bits of a number where they are true, and none where they are false.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Op {
            $($(#[$doc])* $op $(($($type),*))?,)*
        }

        /// For each operation its name, how many operands it has, among which counts it is, and whether they may be exchanged.
        pub const OPERATIONS: &[(&str, usize, &str, bool)] =
            &[$(($name, <[&str]>::len(&[$(stringify!($operand)),*]), stringify!($counted), commutes!($($commutes)?))),*];

        #[allow(unused_variables)]
        impl Op {
            /// Its operands in the first places of three, and their number.
            #[inline]
            pub fn operands(self) -> ([Id; 3], usize) {
                match self {
                    $(Op::$op $(($($field),*))? => first([$($operand),*]),)*
                }
            }

            /// The operation with its operands taken from the first of these three.
            fn over(self, operands: [Id; 3]) -> Op {
                let mut operands = operands.into_iter();
                match self {
                    $(Op::$op $(($($field),*))? => {
                        $(let $operand = operands.next().unwrap_or_default();)*
                        Op::$op $(($($field),*))?
                    })*
                }
            }

            /// Its name.
            pub fn name(self) -> &'static str {
                match self {
                    $(Op::$op { .. } => $name,)*
                }
            }

            /// Among which [`Counts`] it is.
            pub(super) fn counted(self) -> &'static str {
                match self {
                    $(Op::$op { .. } => stringify!($counted),)*
                }
            }

            /// The number that it takes besides the operands: the index of a leaf, the bits of a constant, a number of places.
            pub fn extra(self) -> u64 {
                match self {
                    $(Op::$op $(($($field),*))? => $extra.into(),)*
                }
            }

            /// Its text in a listing.
            pub(super) fn text(self) -> String {
                match self {
                    $(Op::$op $(($($field),*))? => format!($text),)*
                }
            }

            /// Whether its two operands may be exchanged.
            pub(crate) fn commutes(self) -> bool {
                match self {
                    $(Op::$op { .. } => commutes!($($commutes)?),)*
                }
            }
        }

        impl Counts {
            /// Counts one more.
            pub fn note(&mut self, op: Op) {
                match op {
                    $(Op::$op { .. } => count!(self, $counted),)*
                }
            }
        }
    };
}

macro_rules! commutes {
    () => {
        false
    };
    (commutes) => {
        true
    };
}

macro_rules! count {
    ($counts:expr, none) => {{}};
    ($counts:expr, $kind:ident) => {
        $counts.$kind += 1
    };
}

operations! {
    /// A number of the state, as it is at the start of the step.
    State(i: u32), [], i, "state", "state[{i}]", none;
    /// A parameter of the member.
    Param(i: u32), [], i, "parameter", "param[{i}]", none;
    /// The step h.
    Step, [], 0u32, "step", "h", none;
    /// The time at the start of the step.
    Time, [], 0u32, "time", "t", none;
    /// A number, by its bits; of 32 bits the lower half.
    Const(bits: u64), [], bits, "constant", "bits {bits:#018x}", none;
    /// A sampled input at a time.
    Sample(i: u32, t: Id), [t], i, "sample", "input[{i}] at %{t}", none;
    /// a + b
    Add(a: Id, b: Id), [a, b], 0u32, "add", "%{a} + %{b}", additions, commutes;
    /// a − b
    Sub(a: Id, b: Id), [a, b], 0u32, "subtract", "%{a} - %{b}", additions;
    /// a · b
    Mul(a: Id, b: Id), [a, b], 0u32, "multiply", "%{a} * %{b}", multiplications, commutes;
    /// a / b
    Div(a: Id, b: Id), [a, b], 0u32, "divide", "%{a} / %{b}", divisions;
    /// a · b + c, rounded once
    MulAdd(a: Id, b: Id, c: Id), [a, b, c], 0u32, "multiply add", "fused %{a} * %{b} + %{c}", fused;
    /// a · b − c, rounded once
    MulSub(a: Id, b: Id, c: Id), [a, b, c], 0u32, "multiply subtract", "fused %{a} * %{b} - %{c}", fused;
    /// c − a · b, rounded once
    SubMul(a: Id, b: Id, c: Id), [a, b, c], 0u32, "subtract multiply", "fused %{c} - %{a} * %{b}", fused;
    /// √a
    Sqrt(a: Id), [a], 0u32, "square root", "sqrt %{a}", square_roots;
    /// −a
    Neg(a: Id), [a], 0u32, "negate", "- %{a}", none;
    /// The largest whole number not above a.
    Floor(a: Id), [a], 0u32, "floor", "floor %{a}", bits;
    /// a < b; false of a NaN, as all comparisons are.
    Less(a: Id, b: Id), [a, b], 0u32, "less", "%{a} < %{b}", choices;
    /// a ≤ b
    LessEqual(a: Id, b: Id), [a, b], 0u32, "at most", "%{a} <= %{b}", choices;
    /// a = b
    Equal(a: Id, b: Id), [a, b], 0u32, "equal", "%{a} = %{b}", choices, commutes;
    /// Bits: where the first is set those of the second, else of the third. A mask comes from a comparison.
    Select(m: Id, a: Id, b: Id), [m, a, b], 0u32, "choose", "%{m} ? %{a} : %{b}", choices;
    /// Bits of both.
    And(a: Id, b: Id), [a, b], 0u32, "and", "%{a} and %{b}", bits, commutes;
    /// Bits of either.
    Or(a: Id, b: Id), [a, b], 0u32, "or", "%{a} or %{b}", bits, commutes;
    /// Bits of one and not of both.
    Xor(a: Id, b: Id), [a, b], 0u32, "exclusive or", "%{a} xor %{b}", bits, commutes;
    /// The sum of both as whole numbers of as many bits, without a carry out.
    AddBits(a: Id, b: Id), [a, b], 0u32, "add bits", "%{a} plus %{b}", bits, commutes;
    /// The first as a whole number less the second, without a borrow.
    SubBits(a: Id, b: Id), [a, b], 0u32, "subtract bits", "%{a} minus %{b}", bits;
    /// Bits moved up by `n` places, zeros after them.
    ShiftUp(a: Id, n: u32), [a], n, "shift up", "%{a} << {n}", bits;
    /// Bits moved down by `n` places, zeros before them.
    ShiftDown(a: Id, n: u32), [a], n, "shift down", "%{a} >> {n}", bits;
    /// A value again: where the next state is a number of the present one, or a constant.
    Copy(a: Id), [a], 0u32, "copy", "%{a}", none;
    /// Of a body ([`super::split::Body`]): a number of the member that is the same in every step.
    Row(i: u32), [], i, "row", "row[{i}]", none;
    /// Of a body: a number that is the same for all members and steps. Of a tape that is being cut: a fact of an input, see
    /// `split`.
    Uniform(i: u32), [], i, "uniform", "uniform[{i}]", none;
    /// Of a body: a number of the step, the same for all members.
    PerStep(i: u32), [], i, "of the step", "step[{i}]", none;
    /// Of a body: a number of the member that its sampled inputs have at the step.
    Held(i: u32), [], i, "held", "held[{i}]", none;
    /// Of a body: a sample, by its place, where members are at times of their own.
    Gather(a: Id), [a], 0u32, "gather", "sample %{a}", none;
}

/// At most three operands in three places, and their number.
const fn first<const N: usize>(operands: [Id; N]) -> ([Id; 3], usize) {
    let (mut three, mut i) = ([0; 3], 0);
    while i < N {
        three[i] = operands[i];
        i += 1;
    }
    (three, N)
}

impl Op {
    /// The operation with other operands.
    #[must_use]
    pub fn with(self, mut f: impl FnMut(Id) -> Id) -> Op {
        let (mut operands, n) = self.operands();
        for id in &mut operands[..n] {
            *id = f(*id);
        }
        self.over(operands)
    }

    /// The operation with its operands in order, if they may be exchanged.
    #[must_use]
    pub(super) fn in_order(self) -> Op {
        let ([a, b, c], _) = self.operands();
        if self.commutes() { self.over([a.min(b), a.max(b), c]) } else { self }
    }

    /// Whether it makes a number, rounded, and not the bits of its operands or a mask.
    pub(super) fn rounds(self) -> bool {
        use Op::*;
        let is_mask = matches!(self, Less(..) | LessEqual(..) | Equal(..));
        let of_bits = matches!(self, And(..) | Or(..) | Xor(..) | AddBits(..) | SubBits(..) | ShiftUp(..) | ShiftDown(..));
        !(self.is_leaf() || is_mask || of_bits || matches!(self, Neg(_) | Copy(_) | Select(..) | Sample(..) | Gather(_)))
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
    /// The sum of all counts.
    pub(crate) fn total(&self) -> usize {
        let kinds =
            [self.additions, self.multiplications, self.fused, self.divisions, self.square_roots, self.choices, self.bits];
        kinds.iter().fold(0, |all, count| all + *count as usize)
    }
}
