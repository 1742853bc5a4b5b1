//! A prepared real-time loop over arrays that the caller owns.

use std::sync::atomic::Ordering::Relaxed;

pub use super::fixed::events::Between;
use super::{
    Model,
    fixed::{
        Steppable, all_below,
        events::{Looks, Stepped},
        huge, kept, save,
    },
    workers::{self, GoOn, Workers},
};

use crate::{
    error::Error,
    events::{motion::Events, watch::Watch},
    group::Group,
    model::{around::force::NAME, spec::Spec},
    stage::{Clock, Force, Machine, Stop},
    tape::real::Real,
};

struct Share<T> {
    group: Box<dyn Group<T>>,
    first: usize,
    count: usize,
    /// The slots, and the blocks that the method keeps, before the step that is being made, if that can be stopped, and before
    /// the last one.
    before: [Vec<T>; 2],
}

impl<T: Real> Share<T> {
    fn load(&mut self, v: &[T], y: &[T], members: usize) {
        let (share, lanes) = ((self.first, self.count), self.group.lanes());
        let (v_slot, y_slot) = self.group.slots_mut();
        load(v, members, share, v_slot, lanes);
        load(y, members, share, y_slot, lanes);
    }

    fn store(&self, v: &mut [T], y: &mut [T], members: usize) {
        let (share, lanes) = ((self.first, self.count), self.group.lanes());
        let (v_slot, y_slot) = self.group.slots();
        store(v, members, share, v_slot, lanes);
        store(y, members, share, y_slot, lanes);
    }
}

/// A prepared loop: a step allocates nothing and checks nothing.
pub struct World<T = f64> {
    clock: Clock,
    shares: Vec<Share<T>>,
    members: usize,
    sizes: (usize, usize),
    /// Whether the method has a carry, or keeps blocks beside the state.
    carries: bool,
    /// Numbers of all members that the method keeps, and that a sampled controller remembers.
    kept: usize,
    /// Numbers per member that the controller remembers.
    memory: usize,
    /// The arrays as last written, if the method has a carry: if they differ now, the caller changed the state.
    written: (Vec<T>, Vec<T>),
    /// Whether the slots belong to the arrays as last written.
    is_written: bool,
    step: i64,
    /// Steps between two checks of whether to stop; none if a single step may take long.
    steps_between_checks: Option<i64>,
    stop: Stop,
    /// The number of the first row of the force among all parameters, if there is one.
    force: Option<usize>,
}

/// The steps of a run.
#[derive(Clone, Copy, Debug)]
pub struct RunSteps {
    /// Number of the first step.
    pub first: i64,
    /// Number of steps.
    pub steps: i64,
    /// Steps after which a state is saved, and at the start; the last alone if none.
    pub every: Option<i64>,
}

/// How often a world will be stepped is unknown; kernels are chosen for many steps.
const UNKNOWN_STEPS: f64 = f64::INFINITY;

fn load<T: Copy>(array: &[T], members: usize, share: (usize, usize), slot: &mut [T], lanes: usize) {
    let (first, count) = share;
    for (row, slot) in array.chunks_exact(members).zip(slot.chunks_exact_mut(lanes)) {
        slot[..count].copy_from_slice(&row[first..first + count]);
        let last = slot[count - 1];
        slot[count..].fill(last);
    }
}

fn store<T: Copy>(array: &mut [T], members: usize, share: (usize, usize), slot: &[T], lanes: usize) {
    let (first, count) = share;
    for (row, slot) in array.chunks_exact_mut(members).zip(slot.chunks_exact(lanes)) {
        row[first..first + count].copy_from_slice(&slot[..count]);
    }
}

fn equal_bits<T: Real>(array: &[T], written: &[T]) -> bool {
    array.iter().zip(written).all(|(a, w)| a.pattern() == w.pattern())
}

impl<T: Steppable> World<T> {
    /// Prepares the groups of all members.
    pub fn new(model: &Model, clock: Clock, machine: Machine, members: usize, step: i64) -> Result<Self, Error> {
        let traced = model.traced()?;
        model.room(traced.shape, 1)?;
        let steps_between_checks = (!traced.is_long(members)).then(|| traced.steps_of(members, OPERATIONS_BETWEEN_CHECKS));
        let stop = Stop::default();
        let mut shares = Vec::new();
        let mut first = 0;
        while first < members {
            let whole = members - first >= model.lanes::<T>(&traced, machine, members, UNKNOWN_STEPS)?;
            let mut group =
                T::group(model, &traced, machine, if whole { members } else { members - first }, &clock, UNKNOWN_STEPS)?;
            let count = (members - first).min(group.lanes());
            group.prepare(&model.spec, first, count);
            group.compile_now();
            group.set_stop_flag(&stop);
            let before = Default::default();
            shares.push(Share { group, first, count, before });
            first += count;
        }
        let sizes = (traced.shape.v * members, traced.shape.y * members);
        let (carries, kept) = (traced.carries || traced.kept > 0, traced.kept * members);
        let written = if carries { (vec![T::default(); sizes.0], vec![T::default(); sizes.1]) } else { Default::default() };
        let force = model.spec.signature.place(NAME);
        Ok(World {
            clock,
            shares,
            members,
            sizes,
            carries,
            kept,
            memory: traced.memory,
            written,
            is_written: false,
            step,
            steps_between_checks,
            stop,
            force,
        })
    }

    /// How many numbers each array holds.
    pub fn sizes(&self) -> (usize, usize) {
        self.sizes
    }

    /// How many members there are.
    pub fn members(&self) -> usize {
        self.members
    }

    /// The number of the step at which the world stands.
    pub fn step_number(&self) -> i64 {
        self.step
    }

    /// The time at which the world stands.
    pub fn time(&self) -> f64 {
        self.clock.at(self.step)
    }

    /// How many steps are made in some milliseconds; none if a single one may take long, and is for
    /// [`World::step_in_background`].
    pub fn steps_between_checks(&self) -> Option<i64> {
        self.steps_between_checks
    }

    /// Takes the force from outside for the steps to come, as rows of one number per member.
    pub fn set_force(&mut self, rows: &[T]) {
        if let Some(place) = self.force {
            let force = Force { numbers: rows, members: self.members, place };
            self.shares.iter_mut().for_each(|share| share.group.set_force(&force, share.first, share.count));
        }
    }

    /// Takes other numbers for the same parameters. A method with a carry starts again from the state, as with another system.
    pub fn renew(&mut self, spec: &Spec) {
        for Share { group, first, count, .. } in &mut self.shares {
            group.renew(spec, *first, *count);
        }
        self.is_written = false;
    }

    /// Starts these members again from their state in the arrays, and goes on with all others, whose carry was this before.
    pub fn restart(&mut self, members: &[usize], carry: &mut [T], v: &[T], y: &[T]) {
        if !self.carries || carry.len() != self.sizes.0 + self.kept {
            return;
        }
        let (all, k) = (self.members, self.step);
        for share in &mut self.shares {
            share.load(v, y, all);
            share.group.start(k);
        }
        for (row, started) in carry.chunks_exact_mut(all).zip(self.held().chunks_exact(all)) {
            members.iter().for_each(|member| row[*member] = started[*member]);
        }
        self.carry_on(carry, v, y);
    }

    /// The memory of a sampled controller, as rows of one number per member.
    pub fn memory(&self) -> Vec<T> {
        self.held().split_off(self.sizes.0 + self.kept - self.memory * self.members)
    }

    /// Sets the memory of a sampled controller, as rows of one number per member.
    pub fn remember(&mut self, memory: &[T]) {
        if memory.len() != self.memory * self.members {
            return;
        }
        for share in &mut self.shares {
            let lanes = share.group.lanes();
            if let Some(block) = share.group.kept_mut().last_mut() {
                let first = block.len() - self.memory * lanes;
                load(memory, self.members, (share.first, share.count), &mut block[first..], lanes);
            }
        }
    }

    /// Whether these arrays are not what the slots hold.
    fn is_moved(&self, v: &[T], y: &[T]) -> bool {
        !(self.is_written && equal_bits(v, &self.written.0) && equal_bits(y, &self.written.1))
    }

    /// The carry of the method and what it keeps, as rows of one number per member; none if the next step begins with `v` itself.
    pub fn carry(&self, v: &[T], y: &[T]) -> Option<Vec<T>> {
        (!self.is_moved(v, y)).then(|| self.held())
    }

    /// The v slots and what the method keeps, as rows of one number per member.
    fn held(&self) -> Vec<T> {
        let mut carry = vec![T::default(); self.sizes.0 + self.kept];
        for share in &self.shares {
            let mut rest = carry.as_mut_slice();
            for block in std::iter::once(share.group.slots().0).chain(share.group.kept()) {
                let (rows, others) = rest.split_at_mut(block.len() / share.group.lanes() * self.members);
                store(rows, self.members, (share.first, share.count), block, share.group.lanes());
                rest = others;
            }
        }
        carry
    }

    /// Continues with the carry that belongs to these arrays.
    pub fn carry_on(&mut self, carry: &[T], v: &[T], y: &[T]) {
        if self.carries && carry.len() == self.sizes.0 + self.kept {
            let (members, (slot, kept)) = (self.members, carry.split_at(self.sizes.0));
            for share in &mut self.shares {
                share.load(slot, y, members);
                let (lanes, mut rest) = (share.group.lanes(), kept);
                for block in share.group.kept_mut() {
                    let (rows, others) = rest.split_at(block.len() / lanes * members);
                    load(rows, members, (share.first, share.count), block, lanes);
                    rest = others;
                }
            }
            self.written.0.copy_from_slice(v);
            self.written.1.copy_from_slice(y);
            self.is_written = true;
        }
    }

    /// A run of some steps from this start, both by rows of one number per member, and all states that it saves. Returns what
    /// the method carries at the end, and keeps, or none if some number is not finite: then [`super::fixed::run`] finds whose,
    /// and when.
    pub fn run(&mut self, steps: RunSteps, start: [&[T]; 2], saved_v: &mut [T], saved_y: &mut [T]) -> Option<Vec<T>> {
        let RunSteps { first, steps, every } = steps;
        let (members, [v, y]) = (self.members, start);
        for share in &mut self.shares {
            share.load(v, y, members);
            share.group.start(first);
        }
        let (mut made, (p, q)) = (0, self.sizes);
        for i in 0..kept(steps, every) {
            let until = save(steps, every, i);
            for share in &mut self.shares {
                share.group.advance(first + made, until - made);
            }
            made = until;
            self.publish(first + made, &mut saved_v[i * p..][..p], &mut saved_y[i * q..][..q]);
        }
        // The slots are no longer those of the caller's arrays.
        self.is_written = false;
        let held = if self.carries { self.held() } else { Vec::new() };
        let is_finite = are_finite(saved_v, saved_y) && all_below(&held, huge(self.clock.h));
        is_finite.then_some(held)
    }

    /// The recorded quantities of a state, as rows of one number per member.
    pub fn recorded(&mut self, v: &[T], y: &[T]) -> Vec<T> {
        let members = self.members;
        let mut rows = Vec::new();
        for share in &mut self.shares {
            share.load(v, y, members);
            let (recorded, lanes) = (share.group.recorded(), share.group.lanes());
            rows.resize(recorded * members, T::default());
            let mut slot = vec![T::default(); recorded * lanes];
            share.group.record(&mut slot);
            store(&mut rows, members, (share.first, share.count), &slot, lanes);
        }
        self.is_written = false;
        rows
    }

    /// `n` steps, in place. `v` and `y` are rows of one number per member.
    pub fn step(&mut self, n: i64, v: &mut [T], y: &mut [T]) {
        let (k, until, members, carries) = (self.step, self.step + n, self.members, self.carries);
        let moved = !carries || self.is_moved(v, y);
        for share in &mut self.shares {
            if moved {
                share.load(v, y, members);
            }
            if moved && carries {
                share.group.start(k);
            }
            share.group.advance(k, n);
            if !carries {
                share.store(v, y, members);
            }
        }
        if carries {
            self.publish(until, v, y);
        }
        self.step = until;
    }

    /// Makes a step. Of the rows of y the first `kept` go on, and those up to `read` are read only. `give` takes the rows after
    /// these, with the number of the first member, that of members, and how long rows are.
    pub fn play(&mut self, [kept, read]: [usize; 2], y: &mut [T], mut give: impl FnMut(&[T], usize, usize, usize)) {
        let members = self.members;
        for share in &mut self.shares {
            share.load(&[], &y[..read * members], members);
            share.group.advance(self.step, 1);
            share.store(&mut [], &mut y[..kept * members], members);
            let lanes = share.group.lanes();
            give(&share.group.slots().1[read * lanes..], share.first, share.count, lanes);
        }
        self.step += 1;
    }

    /// As `step`, by another thread. The monitor is called on this one. When it returns false, the world stays at the last
    /// complete step or, where its velocities would take long to compute, at the one before.
    pub fn step_in_background(
        &mut self,
        n: i64,
        v: &mut [T],
        y: &mut [T],
        monitor: &mut dyn FnMut(f64) -> bool,
    ) -> Result<(), Error> {
        self.stop.store(false, Relaxed);
        let workers = Workers { threads: 1, background: true, total: n as f64, stop: Stop::clone(&self.stop) };
        let no_other_worker = || Err(Error::Interrupted);
        workers::share(vec![()], &workers, monitor, (self, v, y), no_other_worker, |(world, v, y), (), go_on| {
            world.steps(n, v, y, go_on)
        })
    }

    fn steps(&mut self, n: i64, v: &mut [T], y: &mut [T], go_on: GoOn) -> Result<(), Error> {
        let (from, members) = (self.step, self.members);
        if !self.carries || self.is_moved(v, y) {
            self.is_written = false;
            for share in &mut self.shares {
                share.load(v, y, members);
                share.group.start(from);
            }
            if !go_on(0) {
                return Err(Error::Interrupted);
            }
        }
        let mut made = 0;
        while made < n {
            for Share { group, before, .. } in &mut self.shares {
                before.swap(0, 1);
                before[0].clear();
                let (v, y) = group.slots();
                [v, y].into_iter().chain(group.kept()).for_each(|block| before[0].extend_from_slice(block));
                group.advance(from + made, 1);
            }
            if !go_on(1) {
                break;
            }
            made += 1;
        }
        if made == n && self.publish(from + n, v, y) {
            self.step = from + n;
            return Ok(());
        }
        // The arrays are still those of the start. For a method with a carry, v at the state of the slots takes a rate there,
        // which cannot be stopped. Systems with slow rates keep the last rate that they computed, which is that of the start of
        // the last step. So the state before that step is the one that can be returned at once.
        let back = usize::from(self.carries && 0 < made && made < n);
        for Share { group, before, .. } in &mut self.shares {
            let (v, y) = group.slots_mut();
            let (old_v, rest) = before[back].split_at(v.len());
            let (old_y, mut rest) = rest.split_at(y.len());
            v.copy_from_slice(old_v);
            y.copy_from_slice(old_y);
            for block in group.kept_mut() {
                let (old, others) = rest.split_at(block.len());
                block.copy_from_slice(old);
                rest = others;
            }
        }
        made = (made - back as i64).min(n - 1);
        if made > 0 {
            self.stop.store(false, Relaxed);
            self.publish(from + made, v, y);
            self.step = from + made;
        }
        Err(Error::Interrupted)
    }

    /// Writes the states of step `k` to the arrays, unless it was stopped before.
    fn publish(&mut self, k: i64, v: &mut [T], y: &mut [T]) -> bool {
        let members = self.members;
        if self.carries {
            // The array of the velocities last written stores the carry meanwhile.
            self.is_written = false;
            for Share { group, first, count, .. } in &mut self.shares {
                store(&mut self.written.0, members, (*first, *count), group.slots().0, group.lanes());
                group.finish(k);
            }
            if self.stop.load(Relaxed) {
                return false;
            }
        }
        for share in &mut self.shares {
            share.store(v, y, members);
            if self.carries {
                let (lanes, slot) = (share.group.lanes(), share.group.slots_mut().0);
                load(&self.written.0, members, (share.first, share.count), slot, lanes);
            }
        }
        if self.carries {
            self.written.0.copy_from_slice(v);
            self.written.1.copy_from_slice(y);
            self.is_written = true;
        }
        true
    }
}

impl World<f64> {
    /// Makes `n` steps with events, in place. `go_on` is asked now and then whether to; returns whether all were made. `between`
    /// is the event search of the members since the last call.
    pub fn step_and_look(
        &mut self,
        n: i64,
        [v, y]: [&mut [f64]; 2],
        events: &Events<'_>,
        between: &mut Between,
        go_on: &mut dyn FnMut() -> bool,
    ) -> bool {
        let mut watch = Watch::new(events);
        watch.begin(0, self.members);
        let mut left = n;
        while left > 0 {
            let piece = self.steps_between_checks.unwrap_or(1).min(left);
            self.look(piece, [v, y], &mut watch, between);
            left -= piece;
            if left > 0 && !go_on() {
                break;
            }
        }
        watch.end();
        left == 0
    }

    fn look(&mut self, n: i64, [v, y]: [&mut [f64]; 2], watch: &mut Watch<'_>, between: &mut Between) {
        let (k, members, carries, h) = (self.step, self.members, self.carries, self.clock.h);
        let (moved, start) = (!carries || self.is_moved(v, y), [v.to_vec(), y.to_vec()]);
        let state = start.each_ref().map(Vec::as_slice);
        let groups: Vec<usize> = self.shares.iter().map(|share| share.count).collect();
        let begins = between.begin(watch, &groups, state);
        let mut given = Vec::new();
        for (group, share) in self.shares.iter_mut().enumerate() {
            if moved {
                share.load(v, y, members);
            }
            if moved && carries {
                share.group.start(k);
            }
            let mut first_bad = vec![-1; share.count];
            let mut on = Stepped {
                group: &mut *share.group,
                carries,
                spec: None,
                first: share.first,
                count: share.count,
                h,
                first_bad: &mut first_bad,
                carried: false,
                begin: [&[], &[]],
            };
            let mut looks = Looks::again(watch, between, &mut on, k, (state, begins, group));
            <f64 as Steppable>::look(&mut looks, &mut on, k, n);
            given.extend(looks.pause(between, &mut on, (k + n, group)));
            if !carries {
                share.store(v, y, members);
            }
        }
        if carries {
            self.publish(k + n, v, y);
        }
        let p = self.sizes.0 / members;
        for (member, state) in given {
            for (row, number) in state.into_iter().enumerate() {
                let (array, written, row) =
                    if row < p { (&mut *v, &mut self.written.0, row) } else { (&mut *y, &mut self.written.1, row - p) };
                array[row * members + member] = number;
                if carries {
                    written[row * members + member] = number;
                }
            }
        }
        between.end([v, y]);
        self.step = k + n;
    }
}

/// Whether both blocks are finite.
pub fn are_finite<T: Real>(v: &[T], y: &[T]) -> bool {
    all_below(v, T::INFINITY) && all_below(y, T::INFINITY)
}

/// Operations between two checks of whether to stop: some milliseconds.
const OPERATIONS_BETWEEN_CHECKS: usize = 1 << 25;
