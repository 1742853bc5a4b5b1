//! Groups: members stepped together. Here are those whose whole step is one tape; [`crate::large`] has others.

pub mod adaptive_lanes;
pub mod lanes;
pub mod single_lanes;

use crate::{
    model::spec::Spec,
    stage::{Force, Stop},
    step::{pace::Pace, series_pace::SIDE},
    tape::real::Real,
};

/// Members stepped together.
///
/// `v` and `y` are rows of [`Group::lanes`] numbers, one row per number of a member's block. The `v` slot holds what the
/// method carries between steps: the velocity, unless its record names another carry.
pub trait Group<T: Real = f64>: Send + Sync {
    /// How many members it steps together.
    fn lanes(&self) -> usize;

    /// Takes the parameters of the members from `first`; lanes past the `count`-th repeat the last member.
    fn prepare(&mut self, spec: &Spec, first: usize, count: usize);

    /// Takes other numbers for the same parameters of the members from `first`, which were prepared before.
    fn renew(&mut self, spec: &Spec, first: usize, count: usize) {
        self.prepare(spec, first, count);
    }

    /// Takes the force from outside for the members from `first`, for the steps to come.
    fn set_force(&mut self, _force: &Force<T>, _first: usize, _count: usize) {}

    /// Compiles now instead of after some interpreted steps: for real-time loops.
    fn compile_now(&mut self) {}

    /// Sets the flag at which a step that may take long stops early.
    fn set_stop_flag(&mut self, _stop: &Stop) {}

    /// Both slots.
    fn slots(&self) -> (&[T], &[T]);

    /// Both slots, to write.
    fn slots_mut(&mut self) -> (&mut [T], &mut [T]);

    /// Turns velocities in the `v` slot into what the method carries, and makes what it keeps, at step `k`.
    fn start(&mut self, k: i64);

    /// `n` steps from step `k`.
    fn advance(&mut self, k: i64, n: i64);

    /// How many steps of these members, which were prepared before, one call of [`Group::advance_unrolled`] makes; 0 if that is
    /// not faster than step by step.
    fn unrolled(&mut self, _spec: &Spec, _first: usize, _count: usize) -> usize {
        0
    }

    /// Makes that many steps from step `k`, a multiple of their number. Returns the velocities before each step, then the
    /// coordinates before each step.
    fn advance_unrolled(&mut self, _k: i64) -> &[T] {
        &[]
    }

    /// Turns what the method carries into velocities, at step `k`: the inverse of `start`.
    fn finish(&mut self, k: i64);

    /// How many numbers of a member it records.
    fn recorded(&self) -> usize;

    /// Records the present state, whose v slot is finished: rows of lanes.
    fn record(&mut self, rows: &mut [T]);

    /// The blocks that the method keeps between steps beside both slots, each as rows of lanes.
    fn kept(&self) -> Vec<&[T]> {
        Vec::new()
    }

    /// The blocks of [`Group::kept`], to write.
    fn kept_mut(&mut self) -> Vec<&mut [T]> {
        Vec::new()
    }

    /// The sums over the steps, such as the work of a control, and what is watched: rows of lanes, or nothing.
    fn tally(&self) -> &[T];

    /// The sums of [`Group::tally`], to write.
    fn tally_mut(&mut self) -> &mut [T];
}

/// A batch of members with adaptive steps; their rates are scaled to a step of 1.
pub trait AdaptiveBatch: Send {
    /// How many members there are.
    fn lanes(&self) -> usize;

    /// Takes the parameters of a member into one lane.
    fn prepare_lane(&mut self, spec: &Spec, lane: usize, member: usize);

    /// Takes other numbers for the parameters that all members have in common, before lanes are prepared again. Returns whether
    /// it did.
    fn renew(&mut self, _spec: &Spec) -> bool {
        false
    }

    /// Puts a state, v and y, into a lane.
    fn set_state(&mut self, lane: usize, state: &[f64]);

    /// The state of a lane.
    fn state(&self, lane: usize) -> Vec<f64>;

    /// The step-size control of a lane.
    fn pace(&self, lane: usize) -> Pace<f64>;

    /// One number of all lanes: of v, of y or, behind these, of the step-size control. None where lanes do not stand side by
    /// side.
    fn row(&self, _number: usize) -> Option<&[f64]> {
        None
    }

    /// A row as [`AdaptiveBatch::row`], to write; None, too, where the rows of the state are not numbers of 64 bits.
    fn row_mut(&mut self, _number: usize) -> Option<&mut [f64]> {
        None
    }

    /// Sets the step-size control of a lane.
    fn set_pace(&mut self, lane: usize, pace: Pace<f64>);

    /// The scales of a lane, which follow its step-size control: the largest sizes of its groups, and tolerances of their own.
    fn scales(&self, lane: usize) -> Vec<f64>;

    /// Sets the scales of a lane.
    fn set_scales(&mut self, lane: usize, numbers: &[f64]);

    /// Whether it knows where a member stands at the start, so that [`AdaptiveBatch::begin`] can be asked.
    fn begins(&self) -> bool {
        false
    }

    /// Brings the step-size control of a lane to what it is at the start of that member.
    fn begin(&mut self, _spec: &Spec, _lane: usize, _member: usize) {}

    /// Makes `attempts` attempts in every lane that runs.
    fn attempt(&mut self, attempts: usize);

    /// Whether the coefficients of a series are known after an attempt, so that [`AdaptiveBatch::attempt_alone`] needs no
    /// others.
    fn has_terms(&self) -> bool {
        false
    }

    /// Whether steps are those of a series: how long one is follows from its coefficients, which the attempt finds.
    fn is_series(&self) -> bool {
        false
    }

    /// Writes whether each lane has a step of the run to try.
    fn find_running(&self, budget: f64, runs: &mut [bool]) {
        runs.iter_mut().enumerate().for_each(|(lane, runs)| *runs = self.pace(lane).runs(budget));
    }

    /// How many steps of the present length lanes have left to their next saved times, in the mean of those that are not there.
    fn steps_left(&self) -> f64 {
        1.0
    }

    /// One attempt of one lane, while others stay: of a series at the start of a step whose coefficients are known.
    fn attempt_alone(&mut self, _spec: &Spec, _lane: usize, _member: usize) {}

    /// Whether states within a step are sums of its coefficients alone, which [`AdaptiveBatch::sum_terms`] makes: those of a
    /// series, or of the continuous extension of a method.
    fn has_sums(&self) -> bool {
        false
    }

    /// Keeps where lanes stand, before an attempt of a step within which states are wanted.
    fn keep_starts(&mut self) {}

    /// Whether a number of a lane changes too much in that step for its states to be such sums.
    fn changes_within(&mut self, _lane: usize) -> bool {
        false
    }

    /// Puts a lane to where that step began.
    fn restore(&mut self, _lane: usize) {}

    /// The states of one lane at times within the step that began at the start that was kept, number by number.
    fn sum_terms(&mut self, _lane: usize, _times: &[f64; SIDE], _states: &mut [[f64; SIDE]]) {}

    /// Sets the flag at which an attempt that may take long stops early.
    fn set_stop_flag(&mut self, _stop: &Stop) {}
}
