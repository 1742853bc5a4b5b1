//! Register allocation: when there are too few, the value that is needed again last is spilled (Belady).
//!
//! Nothing here knows a CPU.

/// No use, or no value.
pub(crate) const NONE: u32 = u32::MAX;

/// The times at which each value is needed.
#[derive(Debug)]
pub(crate) struct Uses {
    /// For each value its next use, as a place in `uses`.
    first: Vec<u32>,
    /// The time of a use, and the place of the use after it.
    uses: Vec<(u32, u32)>,
}

impl Uses {
    /// A list of uses of `values` values, empty.
    pub(crate) fn new(values: usize) -> Uses {
        Uses { first: vec![NONE; values], uses: Vec::new() }
    }

    /// Adds a use of a value before those already added: uses are given from the last to the first. Returns whether it is the
    /// value's last use.
    pub(crate) fn add_earlier_use(&mut self, value: u32, when: u32) -> bool {
        let first = &mut self.first[value as usize];
        let is_last = *first == NONE;
        self.uses.push((when, *first));
        *first = self.uses.len() as u32 - 1;
        is_last
    }

    /// The next use after a time, or [`NONE`]. The times of successive calls must not decrease.
    pub(crate) fn next(&mut self, value: u32, after: u32) -> u32 {
        let first = &mut self.first[value as usize];
        while *first != NONE {
            let (when, behind) = self.uses[*first as usize];
            if when > after {
                return when;
            }
            *first = behind;
        }
        NONE
    }
}

/// Registers and what they hold.
#[derive(Debug)]
pub(crate) struct Registers {
    /// For each register the value that it holds.
    holds: [u32; 32],
    /// For each value its register.
    of: Vec<u8>,
    /// A bit for each register that can be taken.
    free: u32,
    /// A bit for each that never is given to another value.
    kept: u32,
    /// A bit for each that must stay as it is at the moment.
    locked: u32,
    count: u8,
}

const NO_REGISTER: u8 = u8::MAX;

impl Registers {
    /// An allocator of `count` registers for `values` values.
    pub(crate) fn new(count: u8, values: usize) -> Registers {
        let free = if count == 32 { u32::MAX } else { (1 << count) - 1 };
        Registers { holds: [NONE; 32], of: vec![NO_REGISTER; values], free, kept: 0, locked: 0, count }
    }

    /// Where a value is.
    pub(crate) fn of(&self, value: u32) -> Option<u8> {
        let register = self.of[value as usize];
        (register != NO_REGISTER).then_some(register)
    }

    /// Takes a register out of the game.
    pub(crate) fn keep_one(&mut self) -> Option<u8> {
        let register = self.any_free()?;
        self.free &= !(1 << register);
        self.kept |= 1 << register;
        Some(register)
    }

    /// Whether a register was taken out of the game.
    pub(crate) fn is_kept(&self, register: u8) -> bool {
        self.kept >> register & 1 == 1
    }

    /// How many are free.
    pub(crate) fn free(&self) -> u32 {
        self.free.count_ones()
    }

    /// A free one. It stays free until something is put there.
    pub(crate) fn any_free(&self) -> Option<u8> {
        let free = self.free & !self.locked;
        (free != 0).then(|| free.trailing_zeros() as u8)
    }

    /// Puts a value into a register, and forgets where it was.
    pub(crate) fn put(&mut self, value: u32, register: u8) {
        self.release(value);
        self.of[value as usize] = register;
        if !self.is_kept(register) {
            self.holds[register as usize] = value;
            self.free &= !(1 << register);
        }
    }

    /// A value is not in a register any more.
    pub(crate) fn release(&mut self, value: u32) {
        let register = std::mem::replace(&mut self.of[value as usize], NO_REGISTER);
        if register != NO_REGISTER && !self.is_kept(register) {
            self.holds[register as usize] = NONE;
            self.free |= 1 << register;
            self.locked &= !(1 << register);
        }
    }

    /// A register must stay as it is until `unlock`.
    pub(crate) fn lock(&mut self, register: u8) {
        self.locked |= 1 << register;
    }

    /// Lets all registers be changed again.
    pub(crate) fn unlock(&mut self) {
        self.locked = 0;
    }

    /// The value to give up: of those not locked the one with the highest price, which is above `least`.
    pub(crate) fn victim(&self, least: u32, mut price: impl FnMut(u32) -> u32) -> Option<u32> {
        let mut best = None;
        let mut most = least;
        let mut candidates = !(self.free | self.kept | self.locked);
        if self.count < 32 {
            candidates &= (1 << self.count) - 1;
        }
        while candidates != 0 {
            let register = candidates.trailing_zeros();
            candidates &= candidates - 1;
            let value = self.holds[register as usize];
            if value == NONE {
                continue;
            }
            let price = price(value);
            if price > most {
                most = price;
                best = Some(value);
            }
        }
        best
    }
}
