//! The words of instructions: the few dozen forms that kernels are made of.
//!
//! Every instruction is a word of 32 bits with the numbers of its registers at fixed places. Arm Architecture Reference Manual for
//! A-profile, section C7.2 (vectors) and C6.2 (the others).

/// An instruction on vectors of two numbers, and the one on a single number. All are for numbers of 64 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    /// Over two numbers.
    pub vector: u32,
    /// Over one. It makes the other half of its register zero.
    pub single: u32,
}

const fn form(vector: u32, single: u32) -> Form {
    Form { vector, single }
}

/// On bits: over 16 bytes, or over 8.
const fn bitwise(vector: u32) -> Form {
    form(vector, vector & !(1 << 30))
}

pub const ADD: Form = form(0x4E60_D400, 0x1E60_2800);
pub const SUB: Form = form(0x4EE0_D400, 0x1E60_3800);
pub const MUL: Form = form(0x6E60_DC00, 0x1E60_0800);
pub const DIV: Form = form(0x6E60_FC00, 0x1E60_1800);
pub const SQRT: Form = form(0x6EE1_F800, 0x1E61_C000);
/// Changes the sign, of a NaN as well.
pub const NEG: Form = form(0x6EE0_F800, 0x1E61_4000);
/// To a whole number, downwards.
pub const FLOOR: Form = form(0x4E61_9800, 0x1E65_4000);
/// All ones where it is true; false of a NaN.
pub const EQUAL: Form = form(0x4E60_E400, 0x5E60_E400);
pub const GREATER: Form = form(0x6EE0_E400, 0x7EE0_E400);
pub const GREATER_EQUAL: Form = form(0x6E60_E400, 0x7E60_E400);
pub const AND: Form = bitwise(0x4E20_1C00);
pub const OR: Form = bitwise(0x4EA0_1C00);
pub const XOR: Form = bitwise(0x6E20_1C00);
/// What is overwritten chooses: the first where its bit is set, else the second (BSL).
pub const CHOOSE: Form = bitwise(0x6E60_1C00);
/// Overwrites by the first where the second is set (BIT).
pub const INSERT_WHERE: Form = bitwise(0x6EA0_1C00);
/// Overwrites by the first where the second is not set (BIF).
pub const INSERT_WHERE_NOT: Form = bitwise(0x6EE0_1C00);
pub const ADD_BITS: Form = form(0x4EE0_8400, 0x5EE0_8400);
/// Adds first · second to what is overwritten, rounded once. Of a single number that is [`Code::fused`].
pub const ADD_PRODUCT: u32 = 0x4E60_CC00;
/// Subtracts it.
pub const SUB_PRODUCT: u32 = 0x4EE0_CC00;
/// Of single numbers, with an operand for each: term + first · second, rounded once.
pub const MUL_ADD: u32 = 0x1F40_0000;
/// term − first · second
pub const SUB_MUL: u32 = 0x1F40_8000;
/// first · second − term
pub const MUL_SUB: u32 = 0x1F60_8000;

/// Moves bits up by 0 to 63 places.
pub const fn shift_up(places: u32) -> Form {
    let amount = (64 + places) << 16;
    form(0x4F00_5400 | amount, 0x5F00_5400 | amount)
}

/// Moves bits down by 1 to 64 places: there is none by 0.
pub const fn shift_down(places: u32) -> Form {
    let amount = (128 - places) << 16;
    form(0x6F00_0400 | amount, 0x7F00_0400 | amount)
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
    /// How many numbers a vector has: 1 or 2.
    pub width: usize,
}

impl Code {
    pub fn word(&mut self, word: u32) {
        self.bytes.extend(word.to_le_bytes());
    }

    fn of(&self, form: Form) -> u32 {
        if self.width == 1 { form.single } else { form.vector }
    }

    /// `to` ← `from`.
    pub fn two(&mut self, form: Form, to: u8, from: u8) {
        self.word(self.of(form) | u32::from(from) << 5 | u32::from(to));
    }

    /// `to` ← `first`, `second`.
    pub fn three(&mut self, form: Form, to: u8, first: u8, second: u8) {
        self.overwrite(self.of(form), to, first, second);
    }

    /// `to` ← `to`, `first`, `second`, as a word without operands says.
    pub fn overwrite(&mut self, word: u32, to: u8, first: u8, second: u8) {
        self.word(word | u32::from(second) << 16 | u32::from(first) << 5 | u32::from(to));
    }

    /// `to` ← `term` and `first` · `second`, of single numbers.
    pub fn fused(&mut self, word: u32, to: u8, first: u8, second: u8, term: u8) {
        self.overwrite(word | u32::from(term) << 10, to, first, second);
    }

    pub fn move_vector(&mut self, to: u8, from: u8) {
        self.three(OR, to, from, from);
    }

    /// The first number of `from` to both lanes.
    pub fn spread(&mut self, to: u8, from: u8) {
        self.word(0x4E08_0400 | u32::from(from) << 5 | u32::from(to));
    }

    /// A vector from so many bytes behind a pointer; of one number only, if asked for. What lies far away takes `spare`.
    pub fn load_vector(&mut self, to: u8, base: General, at: u32, one: bool, spare: General) {
        let (near, far, size) =
            if one || self.width == 1 { (0xFD40_0000, 0xFC60_6800, 8) } else { (0x3DC0_0000, 0x3CE0_6800, 16) };
        self.access([near, far], size, u32::from(to), base, at, spare);
    }

    pub fn store_vector(&mut self, from: u8, base: General, at: u32, spare: General) {
        let (near, far, size) = if self.width == 1 { (0xFD00_0000, 0xFC20_6800, 8) } else { (0x3D80_0000, 0x3CA0_6800, 16) };
        self.access([near, far], size, u32::from(from), base, at, spare);
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

    /// `to` ← `base` + 8 · `index`.
    pub fn add_numbers(&mut self, to: General, base: General, index: General) {
        self.word(0x8B00_0C00 | index.0 << 16 | base.0 << 5 | to.0);
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
