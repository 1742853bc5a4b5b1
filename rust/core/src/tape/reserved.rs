//! Parameters that no system has: numbers that the core itself hands to a tape.

/// The most attempts of a member.
pub const BUDGET: u32 = u32::MAX / 4;
/// The window over which rates of large systems see the mean of inputs: its ends and its length.
pub(crate) const WINDOW_ENDS: [u32; 3] = [BUDGET - 1, BUDGET - 2, BUDGET - 3];
