//! The input and output of a run of adaptive steps, and the shares of both that a thread and a lane work on.

use super::{
    Model,
    columns::{Columns, cut},
};
use crate::{
    events::{motion::Events, watch::Stop},
    model::spec::Row,
    stage::Machine,
};

/// A run to be made.
#[derive(Clone, Debug)]
pub struct AdaptiveRun<'a> {
    /// The system and the method.
    pub model: Model<'a>,
    /// The instruction set and threads of hot loops.
    pub machine: Machine,
    /// Times to keep the state at, ascending, by rows.
    pub at: Vec<Row<'a>>,
    /// The times that no step crosses, by rows: those just before each, ascending, and behind them those just after.
    pub jumps: Vec<Row<'a>>,
    /// The members' paces at the start, by rows, in the order of [`crate::step::pace::Pace::numbers`], and after them
    /// their scales: group sizes and tolerances.
    pub paces: Vec<Row<'a>>,
    /// Whether the steps to try first and the lengths of the blocks are still to be found: see `Pace::begun`.
    pub begins: bool,
    /// Whether states before the last time are those of the continuous extension of the method, which it then has.
    pub extends: bool,
    /// Whether the run goes on after the last time, which is then one as the others.
    pub is_part: bool,
    /// The most attempts of a member.
    pub budget: i64,
    /// Every `every`-th accepted step is kept in [`Arrays::steps`]; 0 for none. A member that has filled its rows there ends,
    /// with a status of its own, and can go on from its pace.
    pub every: i64,
    /// Velocities at the start, by rows.
    pub v: Vec<Row<'a>>,
    /// Coordinates at the start, by rows.
    pub y: Vec<Row<'a>>,
    /// How many members.
    pub members: usize,
    /// The events to look for.
    pub events: Option<&'a Events<'a>>,
}

/// How a member ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Status {
    /// Its rows of [`Arrays::steps`] are full.
    Full = -1,
    /// It came to the last time.
    Ok = 0,
    /// Out of attempts.
    Budget = 2,
    /// A step no longer moves the time.
    Underflow = 3,
    /// As `Underflow`, because no step, however short, gave a finite state.
    NotFinite = 4,
}

/// The output of a run: arrays of rows of one number per member.
#[derive(Debug)]
pub struct Arrays<'a> {
    /// The states at the output times; NaN from where a member stopped.
    pub saved_v: &'a mut [f64],
    /// Likewise the coordinates.
    pub saved_y: &'a mut [f64],
    /// Rows of the members' states at the end, v and y: those before the step that contains the last output time.
    pub state: &'a mut [f64],
    /// The members' paces at the end, by rows.
    pub paces: &'a mut [f64],
    /// One row: the status.
    pub status: &'a mut [i64],
    /// Empty; or for each time of [`AdaptiveRun::at`], which are then all the same, the times of the members, and behind them the
    /// steps to try next. Then attempts are made one by one until that time is passed, and what is kept is where members stand
    /// before the first and after each. No step is held.
    pub attempt_log: &'a mut [f64],
    /// The states after accepted steps that are kept, by rows: their times, velocities and coordinates; empty if none are.
    pub steps: [&'a mut [f64]; 3],
    /// One row: how many of them each member has.
    pub accepted_steps: &'a mut [i64],
    /// Empty; or where members stood at their last waypoints: see `run/waypoints.rs`.
    pub waypoints: &'a mut [f64],
}

/// The arrays of some of the members, which one thread steps.
pub(super) struct Part<'a> {
    pub(super) first: usize,
    pub(super) count: usize,
    pub(super) saved_v: Columns<'a, f64>,
    pub(super) saved_y: Columns<'a, f64>,
    pub(super) state: Columns<'a, f64>,
    pub(super) paces: Columns<'a, f64>,
    pub(super) status: Columns<'a, i64>,
    pub(super) attempt_log: Columns<'a, f64>,
    pub(super) steps: [Columns<'a, f64>; 3],
    pub(super) accepted_steps: Columns<'a, i64>,
    pub(super) waypoints: Columns<'a, f64>,
}

impl<'a> Arrays<'a> {
    /// The arrays, cut for shares of these numbers of members.
    pub(super) fn parts(self, b: usize, shares: Vec<usize>) -> Vec<Part<'a>> {
        let mut whole = [self.status, self.accepted_steps].map(|a| cut(a, b, &shares).into_iter());
        let [t, v, y] = self.steps;
        let mut rows = [self.saved_v, self.saved_y, self.state, self.paces, self.attempt_log, t, v, y, self.waypoints]
            .map(|a| cut(a, b, &shares).into_iter());
        let mut parts = Vec::with_capacity(shares.len());
        let mut first = 0;
        for count in shares {
            if let (
                [
                    Some(saved_v),
                    Some(saved_y),
                    Some(state),
                    Some(paces),
                    Some(attempt_log),
                    Some(t),
                    Some(v),
                    Some(y),
                    Some(waypoints),
                ],
                [Some(status), Some(accepted_steps)],
            ) = (rows.each_mut().map(Iterator::next), whole.each_mut().map(Iterator::next))
            {
                let steps = [t, v, y];
                parts.push(Part {
                    first,
                    count,
                    saved_v,
                    saved_y,
                    state,
                    paces,
                    status,
                    attempt_log,
                    steps,
                    accepted_steps,
                    waypoints,
                });
            }
            first += count;
        }
        parts
    }
}

/// The member of the part that a lane steps, and the next of the saved times.
pub(super) struct Assignment {
    pub(super) member: usize,
    pub(super) next: usize,
    /// While an extra step is made: the state that it starts from, to be put back, and how many attempts were rejected before.
    pub(super) origin: Option<(Vec<f64>, f64)>,
    /// A run that goes on is held, and the coefficients of its series have to be found first.
    pub(super) held_before: bool,
    /// How many accepted steps it had at the last check of a step, and how many are kept of this run.
    pub(super) accepted: f64,
    pub(super) accepted_steps: usize,
    /// How many accepted steps it had at the last check for a waypoint.
    pub(super) passed: u64,
    /// Whether states within the step that comes next, or is held, are made by steps.
    pub(super) by_steps: bool,
    /// Where an event stops it.
    pub(super) stop: Option<Stop>,
}

impl Assignment {
    /// The assignment of a member in the log of attempts.
    pub(super) fn of_log(member: usize, next: usize) -> Assignment {
        Assignment {
            member,
            next,
            origin: None,
            held_before: false,
            accepted: 0.0,
            accepted_steps: 0,
            passed: 0,
            by_steps: false,
            stop: None,
        }
    }
}
