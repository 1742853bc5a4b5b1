//! The bytes of instructions: the few dozen forms that kernels are made of.
//!
//! An instruction on vectors is prefix, opcode, operands, and perhaps a byte behind. The prefix is VEX (AVX2: 16 registers, a
//! memory operand is a whole vector) or EVEX (AVX-512: 32 registers, a memory operand may be one number for all lanes). Both say
//! the same things, so that one table of [`Form`]s serves both. Intel's manual, volume 2, sections 2.3 and 2.7.

/// An opcode and what selects it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Form {
    /// The opcode map: 1 is 0F, 2 is 0F 38, 3 is 0F 3A.
    pub map: u8,
    /// The codes for numbers of 64 bits.
    pub double: Codes,
    /// The codes for numbers of 32 bits.
    pub single: Codes,
    /// Whether VEX has to say (W) that numbers are of 64 bits. EVEX always does.
    pub wide: bool,
}

/// The mandatory prefix (0 none, 1 is 66, 2 is F3, 3 is F2) and the opcode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Codes {
    /// The instruction on vectors.
    pub vector: (u8, u8),
    /// The instruction on the first number of a vector only, if there is one.
    pub first: Option<(u8, u8)>,
}

const fn codes(prefix: u8, opcode: u8) -> Codes {
    Codes { vector: (prefix, opcode), first: None }
}

/// An instruction that is the same for both sizes of numbers, but for what EVEX says.
const fn form(map: u8, prefix: u8, opcode: u8) -> Form {
    Form { map, double: codes(prefix, opcode), single: codes(prefix, opcode), wide: false }
}

/// An instruction with another opcode for numbers of 32 bits.
const fn sized(map: u8, prefix: u8, double: u8, single: u8) -> Form {
    Form { single: codes(prefix, single), ..form(map, prefix, double) }
}

/// An instruction with prefix 66 for numbers of 64 bits, and none for those of 32 bits.
const fn plain(opcode: u8) -> Form {
    Form { single: codes(0, opcode), ..form(1, P66, opcode) }
}

/// As `plain`, with an instruction for the first number only.
const fn arithmetic(opcode: u8) -> Form {
    Form {
        double: Codes { first: Some((PF2, opcode)), ..codes(P66, opcode) },
        single: Codes { first: Some((PF3, opcode)), ..codes(0, opcode) },
        ..form(1, P66, opcode)
    }
}

const P66: u8 = 1;
const PF3: u8 = 2;
const PF2: u8 = 3;

pub(crate) const ADD: Form = arithmetic(0x58);
pub(crate) const MUL: Form = arithmetic(0x59);
pub(crate) const SUB: Form = arithmetic(0x5C);
pub(crate) const DIV: Form = arithmetic(0x5E);
/// The lesser, or the greater of two; the second if either is a NaN or both are zeros.
pub(crate) const MINIMUM: Form = arithmetic(0x5D);
pub(crate) const MAXIMUM: Form = arithmetic(0x5F);
/// The first times two to the power of the second, rounded once (EVEX).
pub(crate) const SCALE: Form = Form {
    double: Codes { first: Some((P66, 0x2D)), ..codes(P66, 0x2C) },
    single: Codes { first: Some((P66, 0x2D)), ..codes(P66, 0x2C) },
    ..form(2, P66, 0x2C)
};
pub(crate) const SQRT: Form = arithmetic(0x51);
pub(crate) const COMPARE: Form = arithmetic(0xC2);
/// Rounds to a whole number as the byte behind says.
pub(crate) const ROUND: Form = Form {
    double: Codes { first: Some((P66, 0x0B)), ..codes(P66, 0x09) },
    single: Codes { first: Some((P66, 0x0A)), ..codes(P66, 0x08) },
    ..form(3, P66, 0x09)
};
/// A fused multiply-add overwrites one of its operands; which one, the instruction says.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fused {
    /// to ← to · second ± first
    pub over_factor: Form,
    /// to ← first · to ± second
    pub over_other: Form,
    /// to ← first · second ± to
    pub over_term: Form,
}

const fn fused(opcode: u8) -> Fused {
    const fn of(opcode: u8) -> Form {
        let both = Codes { first: Some((P66, opcode + 1)), ..codes(P66, opcode) };
        Form { map: 2, double: both, single: both, wide: true }
    }
    Fused { over_factor: of(opcode), over_other: of(opcode + 0x10), over_term: of(opcode + 0x20) }
}

/// a · b + c
pub(crate) const MUL_ADD: Fused = fused(0x98);
/// a · b − c
pub(crate) const MUL_SUB: Fused = fused(0x9A);
/// c − a · b
pub(crate) const SUB_MUL: Fused = fused(0x9C);
pub(crate) const AND: Form = plain(0x54);
/// Not the first, and the second.
pub(crate) const AND_NOT: Form = plain(0x55);
pub(crate) const OR: Form = plain(0x56);
pub(crate) const XOR: Form = plain(0x57);
pub(crate) const ADD_BITS: Form = sized(1, P66, 0xD4, 0xFE);
pub(crate) const SUB_BITS: Form = sized(1, P66, 0xFB, 0xFA);
/// Shifts by the byte behind; the place of the result in the operands says which way, [`UP`] or [`DOWN`].
pub(crate) const SHIFT: Form = sized(1, P66, 0x73, 0x72);
pub(crate) const UP: u8 = 6;
pub(crate) const DOWN: u8 = 2;
/// The second where a bit of the mask is set, else the first (EVEX).
pub(crate) const BLEND: Form = form(2, P66, 0x65);
/// The second where the sign of a third register is set, else the first (VEX).
pub(crate) const BLEND_BY_SIGN: Form = sized(3, P66, 0x4B, 0x4A);
/// Any function of three bits (EVEX).
pub(crate) const BITS_OF_THREE: Form = form(3, P66, 0x25);
/// Sets all ones where a bit of the mask is set (EVEX).
pub(crate) const SPREAD_MASK: Form = form(2, PF3, 0x38);
pub(crate) const LOAD: Form = arithmetic(0x10);
pub(crate) const STORE: Form = arithmetic(0x11);
/// Copies from register to register.
pub(crate) const MOVE: Form = plain(0x28);
/// Copies one number to all lanes.
pub(crate) const BROADCAST: Form = sized(2, P66, 0x19, 0x18);

/// A vector of two: a number of the first and one of the second, by the byte behind.
pub(crate) const PICK: Form = form(1, P66, 0xC6);
/// The high half of a vector of four; the operands are the other way round: the second is the result.
pub(crate) const HIGH: Form = form(3, P66, 0x19);
/// A vector of four: the low half of the first, and the second as the high half.
pub(crate) const JOIN: Form = form(3, P66, 0x18);
/// Numbers of a vector of four in another order, by the byte behind.
pub(crate) const PERMUTE: Form = Form { wide: true, ..form(3, P66, 0x01) };

/// A general register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum General {
    Rax = 0,
    Rcx = 1,
    Rdx = 2,
    Rbx = 3,
    Rsi = 6,
    Rdi = 7,
    R8 = 8,
    R9 = 9,
    R10 = 10,
    R11 = 11,
}

/// A place in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Memory {
    pub base: General,
    pub at: i32,
    /// Whether rax is added, as a count of numbers.
    pub indexed: bool,
    /// One number, for all lanes.
    pub broadcast: bool,
}

impl Memory {
    pub(crate) fn new(base: General, at: i32) -> Memory {
        Memory { base, at, indexed: false, broadcast: false }
    }
}

/// Where an operand of a vector instruction is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operand {
    Register(u8),
    Memory(Memory),
}

/// Instructions, as bytes.
#[derive(Debug)]
pub(crate) struct Code {
    pub bytes: Vec<u8>,
    /// EVEX and not VEX.
    pub evex: bool,
    /// How many numbers a vector has.
    pub width: usize,
    /// The size of a number in bytes: 8 or 4.
    pub size: usize,
}

impl Code {
    /// The codes of a form for numbers of this size.
    pub(crate) fn codes(&self, form: Form) -> Codes {
        if self.size == 8 { form.double } else { form.single }
    }

    /// An instruction on vectors: `to` ← `first`, `second`. In a kernel of width one it works on the first number only, where
    /// there is such an instruction, and on 128 bits otherwise. What has no `first` is given 0.
    pub(crate) fn vector(&mut self, form: Form, to: u8, first: u8, second: Operand) {
        self.masked(form, to, first, second, 0);
    }

    /// As `vector`, with a byte behind.
    pub(crate) fn vector_and_byte(&mut self, form: Form, to: u8, first: u8, second: Operand, byte: u8) {
        self.vector(form, to, first, second);
        self.bytes.push(byte);
    }

    /// As `vector`, with a mask register.
    pub(crate) fn masked(&mut self, form: Form, to: u8, first: u8, second: Operand, mask: u8) {
        let codes = self.codes(form);
        let first_only = codes.first.filter(|_| self.width == 1);
        let (prefix, opcode) = first_only.unwrap_or(codes.vector);
        let wide = u8::from(self.size == 8);
        let no = |x: u8, bit: u8| (!x >> bit) & 1;
        // The bits of the second operand's number that are in the prefix: of a register, or of base and index.
        let (b, x) = match second {
            Operand::Register(r) => (no(r, 3), no(r, 4)),
            Operand::Memory(m) => (no(m.base as u8, 3), 1),
        };
        let length = match self.width * self.size {
            64 => 2,
            32 => 1,
            _ => 0,
        };
        if self.evex {
            let broadcast = matches!(second, Operand::Memory(Memory { broadcast: true, .. }));
            let high = no(to, 3) << 7 | x << 6 | b << 5 | no(to, 4) << 4 | form.map;
            let middle = wide << 7 | (!first & 15) << 3 | 1 << 2 | prefix;
            let low = length << 5 | u8::from(broadcast) << 4 | no(first, 4) << 3 | mask;
            self.bytes.extend([0x62, high, middle, low, opcode]);
            // A short displacement counts in units of what is read.
            let one = first_only.is_some() || broadcast || codes == self.codes(BROADCAST);
            let unit = self.size * if one { 1 } else { self.width };
            self.operand(to & 7, second, unit as i32);
        } else {
            self.bytes.extend([0xC4, no(to, 3) << 7 | 1 << 6 | b << 5 | form.map]);
            self.bytes.extend([(u8::from(form.wide) & wide) << 7 | (!first & 15) << 3 | (length & 1) << 2 | prefix, opcode]);
            self.operand(to & 7, second, 1);
        }
    }

    fn operand(&mut self, register: u8, operand: Operand, unit: i32) {
        let m = match operand {
            Operand::Register(r) => return self.bytes.push(0xC0 | register << 3 | (r & 7)),
            Operand::Memory(m) => m,
        };
        let short = i8::try_from(m.at / unit).ok().filter(|_| m.at % unit == 0);
        let mode = match short {
            Some(0) => 0,
            Some(_) => 0x40,
            None => 0x80,
        };
        let base = m.base as u8 & 7;
        if m.indexed {
            let scale = self.size.trailing_zeros() as u8;
            self.bytes.extend([mode | register << 3 | 4, scale << 6 | base]);
        } else {
            self.bytes.push(mode | register << 3 | base);
        }
        match short {
            Some(0) => {}
            Some(at) => self.bytes.push(at as u8),
            None => self.bytes.extend(m.at.to_le_bytes()),
        }
    }

    /// An instruction on a general register of 64 bits and a second operand.
    fn general(&mut self, opcode: u8, register: u8, operand: Operand) {
        let second = match operand {
            Operand::Register(r) => r,
            Operand::Memory(m) => m.base as u8,
        };
        self.bytes.extend([0x48 | (register >> 3) << 2 | second >> 3, opcode]);
        self.operand(register & 7, operand, 1);
    }

    pub(crate) fn load_general(&mut self, to: General, from: Memory) {
        self.general(0x8B, to as u8, Operand::Memory(from));
    }

    pub(crate) fn move_general(&mut self, to: General, from: General) {
        self.general(0x8B, to as u8, Operand::Register(from as u8));
    }

    /// A number of at most 31 bits.
    pub(crate) fn set_general(&mut self, to: General, value: i32) {
        self.general(0xC7, 0, Operand::Register(to as u8));
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn add_general(&mut self, to: General, value: i32) {
        if value != 0 {
            self.general(0x81, 0, Operand::Register(to as u8));
            self.bytes.extend(value.to_le_bytes());
        }
    }

    /// Pads with nops, so that what follows stands at a multiple of 64 bytes: a loop then takes as few lines of the cache as it
    /// can.
    pub(crate) fn pad(&mut self) {
        while !self.bytes.len().is_multiple_of(64) {
            // Nops of up to eight bytes, as the manual recommends them.
            const NOPS: [&[u8]; 8] = [
                &[0x90],
                &[0x66, 0x90],
                &[0x0F, 0x1F, 0x00],
                &[0x0F, 0x1F, 0x40, 0],
                &[0x0F, 0x1F, 0x44, 0, 0],
                &[0x66, 0x0F, 0x1F, 0x44, 0, 0],
                &[0x0F, 0x1F, 0x80, 0, 0, 0, 0],
                &[0x0F, 0x1F, 0x84, 0, 0, 0, 0, 0],
            ];
            let missing = 64 - self.bytes.len() % 64;
            self.bytes.extend(NOPS[missing.min(8) - 1]);
        }
    }

    /// Counts down, and jumps back unless that makes zero.
    pub(crate) fn decrement_and_jump(&mut self, counter: General, to: usize) {
        self.general(0xFF, 1, Operand::Register(counter as u8));
        let from = self.bytes.len() + 6;
        self.bytes.extend([0x0F, 0x85]);
        self.bytes.extend((to as i32 - from as i32).to_le_bytes());
    }

    /// Keeps rbx, which belongs to the caller, and puts the argument there.
    pub(crate) fn keep_rbx(&mut self, argument: General) {
        self.bytes.push(0x53);
        self.move_general(General::Rbx, argument);
    }

    /// Gives rbx back, and returns.
    pub(crate) fn end(&mut self) {
        self.bytes.extend([0xC5, 0xF8, 0x77]); // vzeroupper
        self.bytes.extend([0x5B, 0xC3]); // pop rbx, ret
    }

    /// Keeps how numbers are rounded.
    pub(crate) fn keep_rounding(&mut self, to: Memory) {
        self.bytes.extend([0x0F, 0xAE]);
        self.operand(3, Operand::Memory(to), 1);
    }

    pub(crate) fn set_rounding(&mut self, from: Memory) {
        self.bytes.extend([0x0F, 0xAE]);
        self.operand(2, Operand::Memory(from), 1);
    }
}
