//! Waypoints: where a member stood when its accepted steps had doubled once more, from which its steps are examined after the
//! run.

use super::{
    adaptive_plan::{Assignment, Part},
    columns::Columns,
};
use crate::{group::AdaptiveBatch, step::pace::Pace};

/// The number of accepted steps at the first waypoint.
const FIRST: u64 = 256;
/// The count of accepted steps of a waypoint while only the state before it is known.
const ON_THE_WAY: f64 = -1.0;
/// Waypoints that are kept, the last ones.
pub(super) const WAYPOINTS: usize = 2;

/// How many accepted steps are left to the next state that is kept: those before and after the step to a waypoint.
fn steps_to_next(accepted: f64) -> usize {
    let after = accepted as u64 + 1;
    let waypoint = after.next_power_of_two().max(FIRST);
    if after == waypoint { 1 } else { (waypoint - after) as usize }
}

/// Keeps where a lane stands if its member is at a waypoint, or a step before one.
///
/// `rows` has for each waypoint the state before the step to it, the state after that, and the step-size control there, whose
/// count of accepted steps is zero where there is none, and `ON_THE_WAY` from the first of both states on. The next waypoint but
/// one takes the same rows.
fn keep(rows: &mut Columns<f64>, group: &dyn AdaptiveBatch, lane: usize, member: usize, accepted: u64) {
    let (before, after) = ((accepted + 1).is_power_of_two(), accepted.is_power_of_two());
    let waypoint = if before { accepted + 1 } else { accepted };
    if waypoint < FIRST || !(before || after) {
        return;
    }
    let state = group.state(lane);
    let place = waypoint.trailing_zeros() as usize % WAYPOINTS * (rows.rows() / WAYPOINTS);
    let count = place + 2 * state.len() + Pace::<f64>::ACCEPTED;
    if before {
        state.into_iter().enumerate().for_each(|(row, number)| rows.row(place + row)[member] = number);
        rows.row(count)[member] = ON_THE_WAY;
    } else if rows.row(count)[member] == ON_THE_WAY {
        let after = place + state.len();
        let control = group.pace(lane).numbers().into_iter().chain(group.scales(lane));
        state.into_iter().chain(control).enumerate().for_each(|(row, number)| rows.row(after + row)[member] = number);
    }
}

/// Keeps where a lane stands if it has come to a waypoint or a step before one since the last call.
pub(super) fn keep_lane(group: &dyn AdaptiveBatch, part: &mut Part, lane: usize, assigned: &mut Assignment, accepted: u64) {
    if accepted != assigned.passed && part.waypoints.rows() > 0 {
        assigned.passed = accepted;
        keep(&mut part.waypoints, group, lane, assigned.member, accepted);
    }
}

/// Looks for waypoints only after as many attempts as may have brought a lane to one.
pub(super) struct WaypointSearch {
    /// Fewer attempts bring no lane to its next waypoint, or to a step before one.
    attempts_to_next: usize,
    /// The number of a lane that counts its accepted steps.
    count: usize,
}

impl WaypointSearch {
    /// A search in states of `numbers` numbers.
    pub(super) fn new(numbers: usize) -> Self {
        WaypointSearch { attempts_to_next: 1, count: numbers + Pace::<f64>::ACCEPTED }
    }

    /// Looks in time for the next waypoint of a lane that has accepted `accepted` steps.
    pub(super) fn expect_after(&mut self, accepted: f64) {
        self.attempts_to_next = self.attempts_to_next.min(steps_to_next(accepted));
    }

    /// Makes `attempts` attempts in every lane, and keeps the states of lanes that come to a waypoint or to a step before one.
    pub(super) fn attempt(
        &mut self,
        group: &mut dyn AdaptiveBatch,
        part: &mut Part,
        attempts: usize,
        assignments: &mut [Option<Assignment>],
    ) {
        if part.waypoints.rows() == 0 {
            group.attempt(attempts);
            return;
        }
        let mut left = attempts;
        while left > 0 {
            let next = left.min(self.attempts_to_next);
            group.attempt(next);
            left -= next;
            self.attempts_to_next -= next;
            if self.attempts_to_next == 0 {
                self.attempts_to_next = self.keep_lanes(group, part, assignments);
            }
        }
    }

    /// Keeps where lanes stand that have come to a waypoint or a step before one; after how many attempts the next one may.
    fn keep_lanes(&self, group: &dyn AdaptiveBatch, part: &mut Part, assignments: &mut [Option<Assignment>]) -> usize {
        let (row, mut next) = (group.row(self.count), usize::MAX); // None if lanes do not stand side by side
        for (lane, assigned) in assignments.iter_mut().enumerate() {
            if let Some(assigned) = assigned {
                let accepted = row.map_or_else(|| group.pace(lane).accepted, |accepted| accepted[lane]);
                // An extra step accepts none, so the state of a lane that has accepted one is that of the run.
                keep_lane(group, part, lane, assigned, accepted as u64);
                next = next.min(steps_to_next(accepted));
            }
        }
        next
    }
}
