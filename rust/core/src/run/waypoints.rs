//! Waypoints: where a member stood when its accepted steps had doubled once more, from which its steps are examined after the run.

use super::columns::Columns;
use crate::{group::AdaptiveBatch, step::pace::Pace};

/// The first waypoint is that of so many accepted steps.
const FIRST: u64 = 256;
/// The count of accepted steps of a waypoint of which the state before it is known so far.
const ON_THE_WAY: f64 = -1.0;
/// So many are kept, the last ones.
pub(crate) const WAYPOINTS: usize = 2;

/// How many accepted steps are left to the next state that is kept: those before and after the step to a waypoint.
pub(crate) fn steps_to_next(accepted: f64) -> usize {
    let after = accepted as u64 + 1;
    let waypoint = after.next_power_of_two().max(FIRST);
    if after == waypoint { 1 } else { (waypoint - after) as usize }
}

/// Keeps where a lane stands if its member is at a waypoint, or a step before one.
///
/// `rows` has for each waypoint the state before the step to it, the state after that, and the step-size control there, whose count
/// of accepted steps is zero where there is none, and `ON_THE_WAY` from the first of both states on. The next waypoint but one
/// takes the same rows.
pub(crate) fn keep(rows: &mut Columns<f64>, group: &dyn AdaptiveBatch, lane: usize, member: usize, accepted: u64) {
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
