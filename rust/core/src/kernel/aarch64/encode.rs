//! The words of instructions: the few dozen forms that kernels are made of.
//!
//! Every instruction is a word of 32 bits with the numbers of its registers at fixed places. Arm Architecture Reference Manual
//! for A-profile, section C7.2 (vectors) and C6.2 (the others).

/// The word of an instruction for either size of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words {
    /// The word for numbers of 64 bits.
    pub double: u32,
    /// The word for numbers of 32 bits.
    pub single: u32,
}

/// An instruction on vectors of 16 bytes, and the one on one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    /// Over two numbers of 64 bits, or four of 32.
    pub vector: Words,
    /// Over one. It makes the rest of its register zero.
    pub one: Words,
}

/// Set where numbers have 64 bits, in instructions of arithmetic; the other bits are the same for both sizes.
const IS_DOUBLE: u32 = 1 << 22;
/// Set where a vector has 16 bytes, and not 8.
const IS_WHOLE: u32 = 1 << 30;
/// Set where an instruction that there is for vectors is on one number.
const IS_ONE: u32 = 1 << 28;

const fn sized(double: u32) -> Words {
    Words { double, single: double & !IS_DOUBLE }
}

const fn same(word: u32) -> Words {
    Words { double: word, single: word }
}

const fn form(vector: u32, one: u32) -> Form {
    Form { vector: sized(vector), one: sized(one) }
}

/// An instruction on bits: over 16 bytes, or over 8.
const fn bitwise(vector: u32) -> Form {
    Form { vector: same(vector), one: same(vector & !IS_WHOLE) }
}

/// An instruction on whole numbers. None is on one of 32 bits; that on two leaves the second, which is zero, as it is.
const fn whole(vector: u32) -> Form {
    let vector = sized(vector);
    Form { vector, one: Words { double: vector.double | IS_ONE, single: vector.single & !IS_WHOLE } }
}

pub const ADD: Form = form(0x4E60_D400, 0x1E60_2800);
pub const SUB: Form = form(0x4EE0_D400, 0x1E60_3800);
pub const MUL: Form = form(0x6E60_DC00, 0x1E60_0800);
pub const DIV: Form = form(0x6E60_FC00, 0x1E60_1800);
pub const SQRT: Form = form(0x6EE1_F800, 0x1E61_C000);
/// Changes the sign, of a NaN as well.
pub const NEG: Form = form(0x6EE0_F800, 0x1E61_4000);
/// Rounds down to a whole number.
pub const FLOOR: Form = form(0x4E61_9800, 0x1E65_4000);
/// Comparisons: all ones where true; false for a NaN.
pub const EQUAL: Form = form(0x4E60_E400, 0x5E60_E400);
pub const GREATER: Form = form(0x6EE0_E400, 0x7EE0_E400);
pub const GREATER_EQUAL: Form = form(0x6E60_E400, 0x7E60_E400);
pub const AND: Form = bitwise(0x4E20_1C00);
pub const OR: Form = bitwise(0x4EA0_1C00);
pub const XOR: Form = bitwise(0x6E20_1C00);
/// Chooses by the overwritten register: the first operand where its bit is set, else the second (BSL).
pub const CHOOSE: Form = bitwise(0x6E60_1C00);
/// Overwrites by the first where the second is set (BIT).
pub const INSERT_WHERE: Form = bitwise(0x6EA0_1C00);
/// Overwrites by the first where the second is not set (BIF).
pub const INSERT_WHERE_NOT: Form = bitwise(0x6EE0_1C00);
pub const ADD_BITS: Form = whole(0x4EE0_8400);
pub const SUB_BITS: Form = whole(0x6EE0_8400);
/// Adds first · second to the overwritten register, rounded once. For one number that is [`Code::fused`].
pub const ADD_PRODUCT: Words = sized(0x4E60_CC00);
/// Subtracts first · second, likewise.
pub const SUB_PRODUCT: Words = sized(0x4EE0_CC00);
/// For one number, with an operand for each: term + first · second, rounded once.
pub const MUL_ADD: Words = sized(0x1F40_0000);
/// term − first · second
pub const SUB_MUL: Words = sized(0x1F40_8000);
/// first · second − term
pub const MUL_SUB: Words = sized(0x1F60_8000);

/// A shift. The place of its amount is also that of the size of numbers: the word is for numbers of `bits` bits only.
const fn shift(vector: u32, bits: u32, amount: u32) -> Form {
    let vector = vector | amount << 16;
    let one = if bits == 64 { vector | IS_ONE } else { vector & !IS_WHOLE };
    Form { vector: same(vector), one: same(one) }
}

/// Moves the bits of numbers of `bits` bits up by fewer places than that.
pub const fn shift_up(bits: u32, places: u32) -> Form {
    shift(0x4F00_5400, bits, bits + places)
}

/// Moves these bits down, by 1 place to all: there is none by 0.
pub const fn shift_down(bits: u32, places: u32) -> Form {
    shift(0x6F00_0400, bits, 2 * bits - places)
}

/// A general register, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct General(pub u32);

const STACK: u32 = 31;
/// The last register of the vectors that belong to the caller, and of each the first 64 bits.
const CALLERS: [u32; 4] = [8, 10, 12, 14];

/// Instructions, as bytes.
#[derive(Debug)]
pub struct Code {
    pub bytes: Vec<u8>,
    /// How many numbers a vector has: 1, or 16 bytes of them.
    pub width: usize,
    /// The size of a number in bytes: 8 or 4.
    pub size: usize,
}

impl Code {
    pub fn word(&mut self, word: u32) {
        self.bytes.extend(word.to_le_bytes());
    }

    fn of(&self, form: Form) -> Words {
        if self.width == 1 { form.one } else { form.vector }
    }

    /// The first or the second, for numbers of this size.
    fn sized<T>(&self, double: T, single: T) -> T {
        if self.size == 8 { double } else { single }
    }

    fn operands(&mut self, words: Words, operands: u32) {
        self.word(self.sized(words.double, words.single) | operands);
    }

    /// `to` ← `from`.
    pub fn two(&mut self, form: Form, to: u8, from: u8) {
        self.operands(self.of(form), u32::from(from) << 5 | u32::from(to));
    }

    /// `to` ← `first`, `second`.
    pub fn three(&mut self, form: Form, to: u8, first: u8, second: u8) {
        self.overwrite(self.of(form), to, first, second);
    }

    /// `to` ← `to`, `first`, `second`, as a word without operands says.
    pub fn overwrite(&mut self, words: Words, to: u8, first: u8, second: u8) {
        self.operands(words, u32::from(second) << 16 | u32::from(first) << 5 | u32::from(to));
    }

    /// `to` ← `term` and `first` · `second`, of one number.
    pub fn fused(&mut self, words: Words, to: u8, first: u8, second: u8, term: u8) {
        let [to, first, second, term] = [to, first, second, term].map(u32::from);
        self.operands(words, second << 16 | term << 10 | first << 5 | to);
    }

    pub fn move_vector(&mut self, to: u8, from: u8) {
        self.three(OR, to, from, from);
    }

    /// The first number of `from` to all lanes.
    pub fn spread(&mut self, to: u8, from: u8) {
        self.operands(Words { double: 0x4E08_0400, single: 0x4E04_0400 }, u32::from(from) << 5 | u32::from(to));
    }

    /// A vector from `at` bytes behind a pointer, or only one number. A distant address takes `spare`.
    pub fn load_vector(&mut self, to: u8, base: General, at: u32, one: bool, spare: General) {
        let of_one = self.sized([0xFD40_0000, 0xFC60_6800], [0xBD40_0000, 0xBC60_6800]);
        let is_one = one || self.width == 1;
        let (words, size) = if is_one { (of_one, self.size as u32) } else { ([0x3DC0_0000, 0x3CE0_6800], 16) };
        self.access(words, size, u32::from(to), base, at, spare);
    }

    pub fn store_vector(&mut self, from: u8, base: General, at: u32, spare: General) {
        let of_one = self.sized([0xFD00_0000, 0xFC20_6800], [0xBD00_0000, 0xBC20_6800]);
        let (words, size) = if self.width == 1 { (of_one, self.size as u32) } else { ([0x3D80_0000, 0x3CA0_6800], 16) };
        self.access(words, size, u32::from(from), base, at, spare);
    }

    pub fn load_general(&mut self, to: General, base: General, at: u32, spare: General) {
        self.access([0xF940_0000, 0xF860_6800], 8, to.0, base, at, spare);
    }

    /// An offset counts in units of what is accessed and has 12 bits; another one must be in a register.
    fn access(&mut self, [near, far]: [u32; 2], size: u32, register: u32, base: General, at: u32, spare: General) {
        if at.is_multiple_of(size) && at / size < 1 << 12 {
            self.word(near | (at / size) << 10 | base.0 << 5 | register);
        } else {
            self.set_general(spare, at);
            self.word(far | spare.0 << 16 | base.0 << 5 | register);
        }
    }

    pub fn set_general(&mut self, to: General, value: u32) {
        self.word(0xD280_0000 | (value & 0xFFFF) << 5 | to.0);
        if value >> 16 != 0 {
            self.word(0xF2A0_0000 | (value >> 16) << 5 | to.0);
        }
    }

    /// `to` ← `base` + `index` numbers.
    pub fn add_numbers(&mut self, to: General, base: General, index: General) {
        self.word(0x8B00_0000 | self.size.trailing_zeros() << 10 | index.0 << 16 | base.0 << 5 | to.0);
    }

    /// Adds a number to a register. One of more than 24 bits takes `spare`.
    pub fn add_general(&mut self, to: General, value: i32, spare: General) {
        let (size, is_less) = (value.unsigned_abs(), u32::from(value < 0) << 30);
        let own = to.0 << 5 | to.0;
        if size >> 24 != 0 {
            self.set_general(spare, size);
            return self.word(0x8B00_0000 | is_less | spare.0 << 16 | own);
        }
        if size & 0xFFF != 0 {
            self.word(0x9100_0000 | is_less | (size & 0xFFF) << 10 | own);
        }
        if size >> 12 != 0 {
            self.word(0x9140_0000 | is_less | (size >> 12) << 10 | own);
        }
    }

    /// Counts down, and jumps back to a place unless that makes zero.
    pub fn decrement_and_jump(&mut self, counter: General, to: usize) {
        self.word(0xF100_0400 | counter.0 << 5 | counter.0);
        let back = |code: &Code| (to as i64 - code.bytes.len() as i64) / 4;
        if back(self) >= -(1 << 18) {
            self.word(0x5400_0001 | (back(self) as u32 & 0x7_FFFF) << 5);
        } else {
            // Over a jump that reaches farther.
            self.word(0x5400_0040);
            self.word(0x1400_0000 | back(self) as u32 & 0x3FF_FFFF);
        }
    }

    /// Pads, so that what follows stands at a multiple of 32 bytes.
    pub fn pad(&mut self) {
        while !self.bytes.len().is_multiple_of(32) {
            self.word(0xD503_201F);
        }
    }

    /// Keeps the vector registers that belong to the caller.
    pub fn keep_vectors(&mut self) {
        for register in CALLERS {
            // The first makes room.
            let word = if register == CALLERS[0] { 0x6DBC_0000 } else { 0x6D00_0000 | (register - CALLERS[0]) << 15 };
            self.word(word | (register + 1) << 10 | STACK << 5 | register);
        }
    }

    /// Gives them back.
    pub fn restore_vectors(&mut self) {
        for register in CALLERS.into_iter().rev() {
            let word = if register == CALLERS[0] { 0x6CC4_0000 } else { 0x6D40_0000 | (register - CALLERS[0]) << 15 };
            self.word(word | (register + 1) << 10 | STACK << 5 | register);
        }
    }

    /// How numbers are rounded, to a register.
    pub fn get_rounding(&mut self, to: General) {
        self.word(0xD53B_4400 | to.0);
    }

    pub fn set_rounding(&mut self, from: General) {
        self.word(0xD51B_4400 | from.0);
    }

    /// To nearest, subnormal numbers as they are, a NaN of a NaN, no traps: all bits are zero.
    pub fn round_to_nearest(&mut self) {
        self.set_rounding(General(31));
    }

    pub fn end(&mut self) {
        self.word(0xD65F_03C0);
    }
}
