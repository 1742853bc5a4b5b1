//! Random bodies and inputs, the same from the same seed.

use stepwell_core::tape::{
    Id, Op,
    real::{Precision, Real},
    split::Body,
};

/// SplitMix64.
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ x >> 31
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// True once in `n` times.
    pub(crate) fn once_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    pub(crate) fn one_of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }

    /// A number: often an ordinary one, or else any bits, or what is rare: NaN, infinities, subnormal, zeros, huge, small.
    pub(crate) fn number(&mut self) -> f64 {
        let sign = self.bits() & 1 << 63;
        let unit = (self.bits() >> 11) as f64 / (1u64 << 53) as f64;
        let size = match self.below(16) {
            0..8 => 4.0 * unit,
            8 => f64::from_bits(self.bits()),
            9 => f64::from_bits(self.bits() >> 12),
            10 => 0.0,
            11 => f64::INFINITY,
            12 => f64::NAN,
            13 => f64::MAX * unit,
            14 => f64::MIN_POSITIVE * (1.0 + unit),
            _ => (100.0 * unit).floor(),
        };
        f64::from_bits(size.to_bits() ^ sign)
    }
}

/// About how many operations the body of a seed has; one body in 400 is as long as that of a system of some hundred numbers.
pub(crate) fn length(seed: u64, random: &mut Random) -> usize {
    match random.below(8) {
        _ if seed % 400 == 17 => random.one_of(&[5000, 20_000, 70_000]),
        0 => 3 + random.below(6),
        7 => 200 + random.below(300),
        _ => 8 + random.below(80),
    }
}

impl Random {
    /// A number of either precision: of 32 bits often any bits, or a subnormal one.
    pub(crate) fn number_of<T: Real>(&mut self) -> T {
        match (T::PRECISION, self.below(8)) {
            (Precision::Single, 0) => T::from_pattern(self.bits()),
            (Precision::Single, 1) => T::from_pattern(self.bits() & 0x807F_FFFF),
            _ => T::of(self.number()),
        }
    }
}

/// The body for numbers of 32 bits.
#[allow(dead_code, reason = "not all tests have such bodies")]
pub(crate) fn in_single(body: Body) -> Body {
    let ops = body.ops.iter().map(|op| match *op {
        Op::Const(u64::MAX) => Op::Const(Precision::Single.all_bits()),
        Op::Const(bits) => Op::Const(Precision::Single.bits_of(f64::from_bits(bits))),
        Op::ShiftUp(a, places) => Op::ShiftUp(a, places % 32),
        Op::ShiftDown(a, places) => Op::ShiftDown(a, places % 32),
        other => other,
    });
    Body { ops: ops.collect(), precision: Precision::Single, ..body }
}

/// A body in the making.
struct Maker<'a> {
    random: &'a mut Random,
    ops: Vec<Op>,
    /// For each value whether its bits are promised: it cannot be a NaN that arithmetic made.
    sure: Vec<bool>,
    /// For each value whether it is a mask.
    mask: Vec<bool>,
}

impl Maker<'_> {
    fn push(&mut self, op: Op, sure: bool, mask: bool) -> Id {
        self.ops.push(op);
        self.sure.push(sure);
        self.mask.push(mask);
        self.ops.len() as Id - 1
    }

    /// A value, of late or of long ago.
    fn any(&mut self) -> Id {
        let n = self.ops.len();
        let back = if self.random.once_in(2) { n } else { n.min(6) };
        (n - 1 - self.random.below(back)) as Id
    }

    fn one_that(&mut self, is: impl Fn(&Self, Id) -> bool) -> Option<Id> {
        for _ in 0..20 {
            let id = self.any();
            if is(self, id) {
                return Some(id);
            }
        }
        None
    }

    fn operation(&mut self) {
        let (a, b) = (self.any(), self.any());
        let sure = |maker: &Self, id: Id| maker.sure[id as usize];
        match self.random.below(27) {
            0..3 => self.push(Op::Add(a, b), false, false),
            3..6 => self.push(Op::Sub(a, b), false, false),
            6..9 => self.push(Op::Mul(a, b), false, false),
            9 => self.push(Op::Div(a, b), false, false),
            10 => self.push(Op::Sqrt(a), false, false),
            11 => self.push(Op::Floor(a), false, false),
            12 => self.push(Op::Neg(a), sure(self, a), false),
            13 => self.push(Op::Less(a, b), true, true),
            14 => self.push(Op::LessEqual(a, b), true, true),
            15 => self.push(Op::Equal(a, b), true, true),
            16..19 => {
                // By a mask, which may be made for it.
                let mask = |maker: &Self, id: Id| maker.mask[id as usize];
                let m = if self.random.once_in(2) { self.one_that(mask) } else { None };
                let (c, d) = (self.any(), self.any());
                let m = m.unwrap_or_else(|| {
                    let op = self.random.one_of(&[Op::Less(c, d), Op::LessEqual(c, d), Op::Equal(c, d)]);
                    self.push(op, true, true)
                });
                let both = sure(self, a) && sure(self, b);
                self.push(Op::Select(m, a, b), both, false)
            }
            19 => {
                // Without what may be a NaN: then bits are promised, whatever made it.
                let is_number = self.push(Op::Equal(a, a), true, true);
                let other = self.one_that(sure).unwrap_or(0);
                self.push(Op::Select(is_number, a, other), true, false)
            }
            24.. => {
                let c = self.any();
                let op = self.random.one_of(&[Op::MulAdd(a, b, c), Op::MulSub(a, b, c), Op::SubMul(a, b, c)]);
                self.push(op, false, false)
            }
            kind => {
                let (Some(a), Some(b), Some(c)) = (self.one_that(sure), self.one_that(sure), self.one_that(sure)) else {
                    return;
                };
                let masks = self.mask[a as usize] && self.mask[b as usize];
                let places = self.random.below(64) as u32;
                match (kind, self.random.below(3)) {
                    (20, 0) => self.push(Op::And(a, b), true, masks),
                    (20, 1) => self.push(Op::Or(a, b), true, masks),
                    (20, _) => self.push(Op::Xor(a, b), true, masks),
                    (21, 0) => self.push(Op::AddBits(a, b), true, false),
                    (21, _) => self.push(Op::Select(c, a, b), true, false),
                    (22, 0) => self.push(Op::ShiftUp(a, places), true, false),
                    (22, _) => self.push(Op::ShiftDown(a, places), true, false),
                    _ => self.push(Op::Copy(a), true, self.mask[a as usize]),
                }
            }
        };
    }
}

/// A body of about `operations` operations.
pub(crate) fn body(random: &mut Random, operations: usize, states: usize) -> Body {
    let (rows, uniforms, per_step) = (random.below(6), random.below(4), random.below(5));
    // Numbers of the state whose bits are promised, since their next values are.
    let sure_states: Vec<bool> = (0..states).map(|_| random.once_in(3)).collect();
    let mut leaves: Vec<(Op, bool, bool)> = (0..states).map(|s| (Op::State(s as u32), sure_states[s], false)).collect();
    leaves.extend((0..rows).map(|i| (Op::Row(i as u32), true, false)));
    leaves.extend((0..uniforms).map(|i| (Op::Uniform(i as u32), true, false)));
    for i in 0..per_step as u32 {
        leaves.push((if random.once_in(2) { Op::Held(i) } else { Op::PerStep(i) }, true, false));
    }
    leaves.push((Op::Const(0), true, true));
    leaves.push((Op::Const(u64::MAX), true, true));
    for _ in 0..random.below(6) {
        leaves.push((Op::Const(random.number().to_bits()), true, false));
    }
    let mut maker = Maker { random, ops: Vec::new(), sure: Vec::new(), mask: Vec::new() };
    // Leaves come anywhere.
    while !leaves.is_empty() && maker.ops.len() < operations {
        if maker.ops.len() < 3 || maker.random.once_in(3) {
            let (op, sure, mask) = leaves.swap_remove(maker.random.below(leaves.len()));
            maker.push(op, sure, mask);
        } else {
            maker.operation();
        }
    }
    while maker.ops.len() < operations {
        maker.operation();
    }
    let mut taken = vec![false; 2 * (operations + 8 + 3 * states)];
    let mut next = Vec::new();
    for (s, is_sure) in sure_states.iter().enumerate() {
        let right = |maker: &Maker, id: Id| !*is_sure || maker.sure[id as usize];
        let old = maker.ops.iter().position(|op| *op == Op::State(s as u32));
        if let Some(old) = old.filter(|_| maker.random.once_in(6)) {
            next.push(old as Id);
            continue;
        }
        let found = maker.one_that(|maker, id| right(maker, id) && !maker.ops[id as usize].is_leaf() && !taken[id as usize]);
        let id = found.unwrap_or_else(|| {
            let what = maker.one_that(right).unwrap_or_else(|| maker.push(Op::Const(1), true, false));
            let sure = maker.sure[what as usize];
            maker.push(Op::Copy(what), sure, false)
        });
        taken[id as usize] = true;
        next.push(id);
    }
    let body = Body { ops: maker.ops, next, rows, uniforms, per_step, precision: Precision::Double };
    if random.once_in(5) { body } else { needed(body) }
}

/// The body without operations whose result is not used.
fn needed(body: Body) -> Body {
    let mut needed = vec![false; body.ops.len()];
    body.next.iter().for_each(|id| needed[*id as usize] = true);
    for id in (0..body.ops.len()).rev().collect::<Vec<_>>() {
        if needed[id] {
            let (operands, n) = body.ops[id].operands();
            operands[..n].iter().for_each(|operand| needed[*operand as usize] = true);
        }
    }
    let mut place = vec![0; body.ops.len()];
    let mut ops = Vec::new();
    for (id, op) in body.ops.iter().enumerate().filter(|(id, _)| needed[*id]) {
        place[id] = ops.len() as Id;
        ops.push(op.with(|operand| place[operand as usize]));
    }
    let next = body.next.iter().map(|id| place[*id as usize]).collect();
    Body { ops, next, ..body }
}
