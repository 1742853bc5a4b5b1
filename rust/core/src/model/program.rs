//! The step program: a method, recorded over blocks.
//!
//! A method says which value of which block is used, whatever a block is made of. So it is run once with
//! [`Block`]s that only record the operations on them: rates, sums, products with numbers. The program is then executed over
//! vectors of numbers or of symbols ([`Program::run`]; the latter gives a tape), or over long rows on the heap (`large/`).

use std::{
    cell::RefCell,
    collections::HashMap,
    ops::{Add, Mul, Sub},
};

use nalgebra::DVector;

use super::{implicit::Implicit, system::System};
use crate::tape::number::{Branch, Number, Series};

/// A velocity or coordinate block, by the number of the entry that makes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Block(u32);

/// A length of time, as a share of the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Length(f64);

/// A time within a step, by its distance from the start as a share of the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Time(f64);

impl Mul<Length> for f64 {
    type Output = Length;
    fn mul(self, h: Length) -> Length {
        Length(self * h.0)
    }
}

impl Add<Length> for Time {
    type Output = Time;
    fn add(self, length: Length) -> Time {
        Time(self.0 + length.0)
    }
}

impl Time {
    /// The time `steps` steps after the start.
    pub fn after(steps: f64) -> Time {
        Time(steps)
    }

    /// The start of the step.
    pub(crate) const START: Time = Time(0.0);

    /// Its distance from the start of the step, as a share of the step.
    pub fn node(self) -> f64 {
        self.0
    }

    /// t + node·h in numbers.
    pub(crate) fn at<N: Number>(self, t: N, h: N) -> N {
        match self.0 {
            0.0 => t,
            1.0 => t + h,
            node => t + N::of(node) * h,
        }
    }
}

/// One entry of a program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Entry {
    /// The v slot at the start of the step: v, or the carry.
    V,
    /// The coordinates at the start of the step.
    Y,
    /// One of the blocks that the method keeps between steps beside the state, at the start of the step; and whether it has the
    /// numbers of v, or those of y.
    Kept(u32, bool),
    /// h·v̇ at a time and a state.
    Dv(Time, Block, Block),
    /// h·ẏ at a time and a state.
    Dy(Time, Block, Block),
    /// The velocity whose increment of y is this block.
    Velocity(Block),
    /// a + b
    Add(Block, Block),
    /// a − b
    Sub(Block, Block),
    /// c·a
    Scale(f64, Block),
    /// The Taylor coefficient of that order of v, in powers of the share of the step, around the start of the step at a state.
    SeriesV(u32, Block, Block),
    /// Likewise of y.
    SeriesY(u32, Block, Block),
    /// x of (M − γhJ)·x = r, its block of v, with the mass matrix M and J of the rates at the start of the step.
    ImplicitV(f64, Block, Block),
    /// Likewise of y.
    ImplicitY(f64, Block, Block),
    /// M·y, with the mass matrix of the system.
    Mass(Block),
    /// h·v̇ at a time and a state, without the forces of the part whose motion is known.
    Kick(Time, Block, Block),
    /// v after a share of the step under that part alone.
    DriftV(f64, Block, Block),
    /// Likewise y.
    DriftY(f64, Block, Block),
    /// h times the derivative of h·v̇ by the time, at the start of the step.
    ByTimeV,
    /// Likewise of y.
    ByTimeY,
    /// The sum of the squares of all numbers of both blocks, at each place of a block of v.
    SquareV(Block, Block),
    /// Likewise of y.
    SquareY(Block, Block),
    /// Number by number the third of these blocks where the first is at most the second, else the fourth.
    IfAtMost([Block; 4]),
}

impl Entry {
    /// The blocks that it reads.
    pub fn operands(self) -> Vec<Block> {
        match self {
            Entry::V | Entry::Y | Entry::Kept(..) | Entry::ByTimeV | Entry::ByTimeY => vec![],
            Entry::Velocity(a) | Entry::Scale(_, a) | Entry::Mass(a) => vec![a],
            Entry::Dv(_, a, b) | Entry::Dy(_, a, b) | Entry::Add(a, b) | Entry::Sub(a, b) => vec![a, b],
            Entry::SeriesV(_, a, b) | Entry::SeriesY(_, a, b) => vec![a, b],
            Entry::ImplicitV(_, a, b) | Entry::ImplicitY(_, a, b) => vec![a, b],
            Entry::Kick(_, a, b) | Entry::DriftV(_, a, b) | Entry::DriftY(_, a, b) => vec![a, b],
            Entry::SquareV(a, b) | Entry::SquareY(a, b) => vec![a, b],
            Entry::IfAtMost(blocks) => blocks.to_vec(),
        }
    }

    /// The entry with its blocks at their new places.
    fn moved(self, to: impl Fn(Block) -> Block) -> Entry {
        match self {
            Entry::V | Entry::Y | Entry::Kept(..) | Entry::ByTimeV | Entry::ByTimeY => self,
            Entry::Dv(t, a, b) => Entry::Dv(t, to(a), to(b)),
            Entry::Dy(t, a, b) => Entry::Dy(t, to(a), to(b)),
            Entry::Velocity(a) => Entry::Velocity(to(a)),
            Entry::Add(a, b) => Entry::Add(to(a), to(b)),
            Entry::Sub(a, b) => Entry::Sub(to(a), to(b)),
            Entry::Scale(c, a) => Entry::Scale(c, to(a)),
            Entry::SeriesV(k, a, b) => Entry::SeriesV(k, to(a), to(b)),
            Entry::SeriesY(k, a, b) => Entry::SeriesY(k, to(a), to(b)),
            Entry::ImplicitV(gamma, a, b) => Entry::ImplicitV(gamma, to(a), to(b)),
            Entry::ImplicitY(gamma, a, b) => Entry::ImplicitY(gamma, to(a), to(b)),
            Entry::Mass(a) => Entry::Mass(to(a)),
            Entry::Kick(t, a, b) => Entry::Kick(t, to(a), to(b)),
            Entry::DriftV(c, a, b) => Entry::DriftV(c, to(a), to(b)),
            Entry::DriftY(c, a, b) => Entry::DriftY(c, to(a), to(b)),
            Entry::SquareV(a, b) => Entry::SquareV(to(a), to(b)),
            Entry::SquareY(a, b) => Entry::SquareY(to(a), to(b)),
            Entry::IfAtMost(blocks) => Entry::IfAtMost(blocks.map(to)),
        }
    }

    /// Its key for equality. Numbers are compared by their bits.
    fn key(self) -> (u8, u64, u32, u32) {
        match self {
            Entry::V => (0, 0, 0, 0),
            Entry::Y => (1, 0, 0, 0),
            Entry::Dv(t, a, b) => (2, t.0.to_bits(), a.0, b.0),
            Entry::Dy(t, a, b) => (3, t.0.to_bits(), a.0, b.0),
            Entry::Velocity(a) => (4, 0, a.0, 0),
            Entry::Add(a, b) => (5, 0, a.0, b.0),
            Entry::Sub(a, b) => (6, 0, a.0, b.0),
            Entry::Scale(c, a) => (7, c.to_bits(), a.0, 0),
            Entry::SeriesV(k, a, b) => (8, u64::from(k), a.0, b.0),
            Entry::SeriesY(k, a, b) => (9, u64::from(k), a.0, b.0),
            Entry::ImplicitV(gamma, a, b) => (10, gamma.to_bits(), a.0, b.0),
            Entry::ImplicitY(gamma, a, b) => (11, gamma.to_bits(), a.0, b.0),
            Entry::ByTimeV => (12, 0, 0, 0),
            Entry::ByTimeY => (13, 0, 0, 0),
            Entry::Mass(a) => (14, 0, a.0, 0),
            Entry::Kept(i, of_v) => (15, 0, i, u32::from(of_v)),
            Entry::Kick(t, a, b) => (16, t.0.to_bits(), a.0, b.0),
            Entry::DriftV(c, a, b) => (17, c.to_bits(), a.0, b.0),
            Entry::DriftY(c, a, b) => (18, c.to_bits(), a.0, b.0),
            Entry::SquareV(a, b) => (19, 0, a.0, b.0),
            Entry::SquareY(a, b) => (20, 0, a.0, b.0),
            Entry::IfAtMost([a, b, yes, no]) => (21, u64::from(a.0) << 32 | u64::from(b.0), yes.0, no.0),
        }
    }
}

#[derive(Debug, Default)]
struct Recording {
    entries: Vec<Entry>,
    seen: HashMap<(u8, u64, u32, u32), Block>,
}

thread_local! {
    static RECORDING: RefCell<Recording> = RefCell::new(Recording::default());
}

fn write(entry: Entry) -> Block {
    RECORDING.with_borrow_mut(|recording| {
        let next = Block(recording.entries.len() as u32);
        *recording.seen.entry(entry.key()).or_insert_with(|| {
            recording.entries.push(entry);
            next
        })
    })
}

impl Add for Block {
    type Output = Block;
    fn add(self, other: Block) -> Block {
        write(Entry::Add(self, other))
    }
}

impl Sub for Block {
    type Output = Block;
    fn sub(self, other: Block) -> Block {
        write(Entry::Sub(self, other))
    }
}

impl Mul<Block> for f64 {
    type Output = Block;
    fn mul(self, block: Block) -> Block {
        write(Entry::Scale(self, block))
    }
}

/// The system as a method sees it: increments of both blocks.
#[derive(Clone, Copy, Debug)]
pub struct Rates(());

impl Rates {
    /// h·v̇(t, v, y)
    pub(crate) fn dv(self, t: Time, v: Block, y: Block) -> Block {
        write(Entry::Dv(t, v, y))
    }

    /// h·ẏ(t, v, y)
    pub(crate) fn dy(self, t: Time, v: Block, y: Block) -> Block {
        write(Entry::Dy(t, v, y))
    }

    /// The Taylor coefficients of v and y around the start of the step, from the first to that order; the increment of the step
    /// is their sum.
    pub(crate) fn series(self, order: u32, v: Block, y: Block) -> Vec<(Block, Block)> {
        (1..=order).map(|k| (write(Entry::SeriesV(k, v, y)), write(Entry::SeriesY(k, v, y)))).collect()
    }

    /// x of (M − γhJ)·x = r, with J of the rates at the start of the step.
    pub(crate) fn implicit(self, gamma: f64, (v, y): (Block, Block)) -> (Block, Block) {
        (write(Entry::ImplicitV(gamma, v, y)), write(Entry::ImplicitY(gamma, v, y)))
    }

    /// The mass matrix times an increment of the state; the increment itself, if the system has none.
    pub(crate) fn mass(self, (v, y): (Block, Block)) -> (Block, Block) {
        (v, write(Entry::Mass(y)))
    }

    /// h·v̇ without the forces of the part whose motion is known: all of it, of a system that has no such part.
    pub(crate) fn kick(self, t: Time, v: Block, y: Block) -> Block {
        write(Entry::Kick(t, v, y))
    }

    /// The state after a share of the step under the part whose motion is known: free flight, of a system that has none.
    pub(crate) fn drift(self, share: f64, v: Block, y: Block) -> (Block, Block) {
        (write(Entry::DriftV(share, v, y)), write(Entry::DriftY(share, v, y)))
    }

    /// h times the derivatives of h·v̇ and h·ẏ by the time, at the start of the step.
    pub(crate) fn by_time(self) -> (Block, Block) {
        (write(Entry::ByTimeV), write(Entry::ByTimeY))
    }

    /// The first increments of v and y if these corrections are in all no longer than those, else the second ones.
    pub(crate) fn if_shorter(
        self,
        (v, y): (Block, Block),
        (than_v, than_y): (Block, Block),
        yes: (Block, Block),
        no: (Block, Block),
    ) -> (Block, Block) {
        let (of_v, of_y) = (write(Entry::SquareV(v, y)), write(Entry::SquareY(v, y)));
        let (most_v, most_y) = (write(Entry::SquareV(than_v, than_y)), write(Entry::SquareY(than_v, than_y)));
        (write(Entry::IfAtMost([of_v, most_v, yes.0, no.0])), write(Entry::IfAtMost([of_y, most_y, yes.1, no.1])))
    }

    /// The velocity whose increment of y is d, in a second-order system.
    pub(crate) fn velocity(self, d: Block) -> Block {
        write(Entry::Velocity(d))
    }
}

/// The operations of a method on blocks, in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// The entries, each after what it reads.
    pub entries: Vec<Entry>,
    /// The blocks that it is for: of a step the new v and y, then those of estimates of the error.
    pub results: Vec<Block>,
}

impl Program {
    /// Records the operations of a method.
    pub(crate) fn record(method: impl FnOnce(Rates, Time, Length, Block, Block) -> Vec<Block>) -> Program {
        let outer = RECORDING.take();
        let (v, y) = (write(Entry::V), write(Entry::Y));
        let results = method(Rates(()), Time(0.0), Length(1.0), v, y);
        let recording = RECORDING.replace(outer);
        Program { entries: recording.entries, results }.without_unused()
    }

    /// A program of these entries, each after those that it reads; None if one reads another that is missing.
    pub fn of(entries: Vec<Entry>, results: Vec<usize>) -> Option<Program> {
        let begins = entries.len() >= 2 && entries[0] == Entry::V && entries[1] == Entry::Y;
        let reads = |(i, entry): (usize, &Entry)| entry.operands().iter().all(|operand| operand.index() < i);
        let is_sound = begins && entries.iter().enumerate().all(reads) && results.iter().all(|result| *result < entries.len());
        let results = results.into_iter().map(|result| Block(result as u32)).collect();
        is_sound.then(|| Program { entries, results }.without_unused())
    }

    /// The program without entries that no result depends on, such as a stage that counts only in an estimate of the error.
    /// The state stays, at its place.
    fn without_unused(self) -> Program {
        let mut used = vec![false; self.entries.len()];
        used[..2].fill(true);
        self.results.iter().for_each(|result| used[result.index()] = true);
        for (i, entry) in self.entries.iter().enumerate().rev() {
            if used[i] {
                entry.operands().iter().for_each(|operand| used[operand.index()] = true);
            }
        }
        let mut place = Vec::with_capacity(used.len());
        let mut entries = Vec::with_capacity(used.len());
        for (entry, used) in self.entries.into_iter().zip(used) {
            place.push(Block(entries.len() as u32));
            if used {
                entries.push(entry.moved(|block| place[block.index()]));
            }
        }
        Program { entries, results: self.results.into_iter().map(|result| place[result.index()]).collect() }
    }

    /// Number of evaluations of the rate of v. Each order of a series counts as one.
    pub fn evaluations(&self) -> usize {
        self.entries.iter().filter(|entry| matches!(entry, Entry::Dv(..) | Entry::Kick(..) | Entry::SeriesV(..))).count()
    }

    /// The highest order of a series; 0 without one.
    pub fn series_order(&self) -> u32 {
        let order = |entry: &Entry| if let Entry::SeriesV(k, ..) | Entry::SeriesY(k, ..) = entry { *k } else { 0 };
        self.entries.iter().map(order).max().unwrap_or(0)
    }

    /// Whether it needs derivatives of the rates, so that it goes over symbols only.
    pub fn has_derivatives(&self) -> bool {
        self.series_order() > 0 || self.is_implicit()
    }

    /// Whether it splits a system into a part whose motion is known and the rest.
    pub fn splits(&self) -> bool {
        self.entries.iter().any(|entry| matches!(entry, Entry::DriftV(..) | Entry::DriftY(..)))
    }

    /// Whether it solves equations.
    pub fn is_implicit(&self) -> bool {
        self.entries.iter().any(|entry| matches!(entry, Entry::ImplicitV(..) | Entry::ImplicitY(..)))
    }

    /// γ of the equations that it solves, all with one matrix.
    pub(crate) fn gamma(&self) -> Option<f64> {
        let gamma = |entry: &Entry| if let Entry::ImplicitV(gamma, ..) = entry { Some(*gamma) } else { None };
        self.entries.iter().find_map(gamma)
    }

    /// How many systems of linear equations a step solves.
    pub(crate) fn solutions(&self) -> usize {
        self.entries.iter().filter(|entry| matches!(entry, Entry::ImplicitV(..))).count()
    }

    /// Times within a step at which the rates are evaluated, as fractions of the step, ascending.
    ///
    /// `of_y`: those of ẏ count too; of a second-order system it does not depend on the time.
    pub fn nodes(&self, of_y: bool) -> Vec<f64> {
        let mut nodes: Vec<f64> = Vec::new();
        for entry in &self.entries {
            match entry {
                Entry::Dv(t, ..) | Entry::Kick(t, ..) => nodes.push(t.0),
                Entry::Dy(t, ..) if of_y => nodes.push(t.0),
                Entry::SeriesV(..) | Entry::SeriesY(..) | Entry::ByTimeV | Entry::ByTimeY => nodes.push(0.0),
                _ => {}
            }
        }
        nodes.sort_by(f64::total_cmp);
        nodes.dedup();
        nodes
    }

    /// Executes the program over vectors of numbers, and returns its results.
    pub fn run<N: Number>(&self, s: &dyn System<N>, t: N, h: N, v: &DVector<N>, y: &DVector<N>) -> Vec<DVector<N>> {
        self.run_with(s, t, h, v, y, &[])
    }

    /// As `run`, for a method that keeps blocks between steps.
    pub(crate) fn run_with<N: Number>(
        &self,
        s: &dyn System<N>,
        t: N,
        h: N,
        v: &DVector<N>,
        y: &DVector<N>,
        kept: &[DVector<N>],
    ) -> Vec<DVector<N>> {
        let mut blocks: Vec<DVector<N>> = Vec::with_capacity(self.entries.len());
        let mut series: Option<Vec<(DVector<N>, DVector<N>)>> = None;
        let mut implicit: Option<Implicit<N>> = if self.is_implicit() { Implicit::new(s, t, h, v, y) } else { None };
        let unknown = |block: &DVector<N>| block.map(|_| N::of(f64::NAN));
        for entry in &self.entries {
            let of = |block: Block| &blocks[block.0 as usize];
            let made = match *entry {
                Entry::V => v.clone(),
                Entry::Y => y.clone(),
                Entry::Kept(i, _) => kept[i as usize].clone(),
                Entry::Dv(at, v, y) => s.dv(at.at(t, h), of(v), of(y)),
                Entry::Dy(at, v, y) => s.dy(at.at(t, h), of(v), of(y)),
                Entry::Velocity(d) => s.velocity(of(d)),
                Entry::Mass(d) => s.mass().map_or_else(|| of(d).clone(), |mass| mass.times(of(d))),
                Entry::Add(a, b) => of(a).zip_map(of(b), |a, b| a + b),
                Entry::Sub(a, b) => of(a).zip_map(of(b), |a, b| a - b),
                Entry::Scale(c, a) => of(a).map(|a| N::of(c) * a),
                Entry::SeriesV(k, v, y) | Entry::SeriesY(k, v, y) => {
                    let made = series.get_or_insert_with(|| {
                        let made = coefficients(s, self.series_order(), [t, h, N::of(1.0)], of(v), of(y));
                        made.0
                    });
                    let (v, y) = &made[k as usize - 1];
                    if matches!(entry, Entry::SeriesV(..)) { v.clone() } else { y.clone() }
                }
                Entry::ImplicitV(gamma, r_v, r_y) | Entry::ImplicitY(gamma, r_v, r_y) => {
                    let right = [of(r_v), of(r_y)];
                    let [v, y] = implicit.as_mut().map_or_else(|| right.map(unknown), |it| it.solve(gamma, right));
                    if matches!(entry, Entry::ImplicitV(..)) { v } else { y }
                }
                Entry::Kick(at, v, y) => {
                    let dv = s.dv(at.at(t, h), of(v), of(y));
                    s.central(of(y)).map_or_else(|| dv.clone(), |central| &dv - central)
                }
                Entry::DriftV(share, v, y) => s.drift(share, of(v), of(y)).map_or_else(|| of(v).clone(), |[v, _]| v),
                Entry::DriftY(share, v, y) => s.drift(share, of(v), of(y)).map_or_else(
                    || {
                        let dy = s.dy(t, of(v), of(y));
                        of(y).zip_map(&dy, |y, dy| y + if share == 1.0 { dy } else { N::of(share) * dy })
                    },
                    |[_, y]| y,
                ),
                Entry::ByTimeV => implicit.as_ref().map_or_else(|| unknown(v), |it| it.by_time(h)[0].clone()),
                Entry::ByTimeY => implicit.as_ref().map_or_else(|| unknown(y), |it| it.by_time(h)[1].clone()),
                Entry::SquareV(a, b) => DVector::from_element(v.len(), square(of(a).iter().chain(of(b)))),
                Entry::SquareY(a, b) => DVector::from_element(y.len(), square(of(a).iter().chain(of(b)))),
                Entry::IfAtMost([a, b, yes, no]) => {
                    let [a, b, yes, no] = [a, b, yes, no].map(of);
                    DVector::from_fn(yes.len(), |i, _| N::choose(a[i].at_most(b[i]), yes[i], no[i]))
                }
            };
            blocks.push(made);
        }
        self.results.iter().map(|block| blocks[block.0 as usize].clone()).collect()
    }
}

/// The sum of the squares, from the first on; 0 of no numbers.
pub(crate) fn square<'a, N: Number>(numbers: impl Iterator<Item = &'a N>) -> N {
    numbers.map(|x| *x * *x).reduce(|sum, square| sum + square).unwrap_or(N::of(0.0))
}

/// Coefficients of v and y, from the first on.
pub(crate) type Terms<N> = Vec<(DVector<N>, DVector<N>)>;

/// The Taylor coefficients of v and y around a state, from the first on, and the branches of functions that the rates are on; NaN
/// of numbers, which have no series. The time is that of [`Number::series`].
pub(crate) fn coefficients<N: Number>(
    s: &dyn System<N>,
    order: u32,
    time: [N; 3],
    v: &DVector<N>,
    y: &DVector<N>,
) -> (Terms<N>, Vec<Branch<N>>) {
    let start: Vec<N> = v.iter().chain(y).copied().collect();
    let t = time[0];
    let mut rates = || s.dv(t, v, y).iter().chain(&s.dy(t, v, y)).copied().collect();
    let Some(Series { terms, branches }) = N::series(order, &start, time, &mut rates) else {
        let unknown = N::of(f64::NAN);
        return ((1..=order).map(|_| (v.map(|_| unknown), y.map(|_| unknown))).collect(), Vec::new());
    };
    let block = |numbers: &[N]| DVector::from_column_slice(numbers);
    (terms.iter().map(|numbers| (block(&numbers[..v.len()]), block(&numbers[v.len()..]))).collect(), branches)
}

impl Block {
    /// The coordinates at the start of the step, in every program.
    pub(crate) const Y: Block = Block(1);

    /// The number of the entry that makes it.
    pub fn index(self) -> usize {
        self.0 as usize
    }

    /// The block of the entry of that number.
    pub fn at(entry: usize) -> Block {
        Block(entry as u32)
    }
}
