//! Waypoints: where a member stood when its accepted steps had doubled once more, from which its steps are examined after the run.

use super::columns::Columns;
use crate::group::AdaptiveBatch;

/// The first waypoint is that of so many accepted steps.
const FIRST: u64 = 256;
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
/// `rows` has for each waypoint the state before the step to it, the state after that, and the step-size control there. The next
/// waypoint but one takes the same rows.
pub(crate) fn keep(rows: &mut Columns<f64>, group: &dyn AdaptiveBatch, lane: usize, member: usize, accepted: u64) {
    let (before, after) = ((accepted + 1).is_power_of_two(), accepted.is_power_of_two());
    let waypoint = if before { accepted + 1 } else { accepted };
    if waypoint < FIRST || !(before || after) {
        return;
    }
    let state = group.state(lane);
    let place = waypoint.trailing_zeros() as usize % WAYPOINTS * (rows.rows() / WAYPOINTS);
    let first = if before { place } else { place + state.len() };
    let control: Vec<f64> =
        if before { Vec::new() } else { group.pace(lane).numbers().into_iter().chain(group.scales(lane)).collect() };
    for (row, number) in state.into_iter().chain(control).enumerate() {
        rows.row(first + row)[member] = number;
    }
}
