//! The occurrences that a run finds of its events.

/// Occurrences of an event, in no order.
#[derive(Debug, Default)]
pub struct Occurrences {
    /// The member of each.
    pub member: Vec<i64>,
    /// The number of its step.
    pub step: Vec<i64>,
    /// The share of that step.
    pub share: Vec<f64>,
    /// Its time.
    pub t: Vec<f64>,
    /// The state then, of all its numbers one after the other.
    pub states: Vec<f64>,
}

/// A member that is at rest at an event.
#[derive(Debug)]
pub struct Rest {
    /// The member.
    pub member: i64,
    /// The number of the event.
    pub event: i64,
    /// Whether the event leads the member back to where it is.
    pub led_back: bool,
    /// Since when the state was changed as often as it may be; NaN for others.
    pub often_since: f64,
    /// Which events set each other off without end.
    pub circle: Vec<bool>,
}

/// The events of all members.
#[derive(Debug, Default)]
pub struct Found {
    /// The occurrences of each event that are kept.
    pub occurrences: Vec<Occurrences>,
    /// How many each member has, by event and member.
    pub counts: Vec<i64>,
    /// When a member was stopped; NaN for others.
    pub stopped_at: Vec<f64>,
    /// Whether a saved time changed the steps of a member with adaptive ones.
    pub other_steps: Vec<bool>,
    /// The members at rest.
    pub rests: Vec<Rest>,
}

impl Found {
    /// An empty record of `events` events and `members` members.
    pub fn new(events: usize, members: usize) -> Found {
        Found {
            occurrences: (0..events).map(|_| Occurrences::default()).collect(),
            counts: vec![0; events * members],
            stopped_at: vec![f64::NAN; members],
            other_steps: vec![false; members],
            rests: Vec::new(),
        }
    }

    /// Takes what was found of the members from `first` on.
    pub(crate) fn take(&mut self, part: Found, first: usize) {
        let [members, of_part] = [self.stopped_at.len(), part.stopped_at.len()];
        for (all, mine) in self.occurrences.iter_mut().zip(part.occurrences) {
            all.member.extend(mine.member);
            all.step.extend(mine.step);
            all.share.extend(mine.share);
            all.t.extend(mine.t);
            all.states.extend(mine.states);
        }
        for (all, mine) in self.counts.chunks_exact_mut(members.max(1)).zip(part.counts.chunks_exact(of_part.max(1))) {
            all[first..first + of_part].copy_from_slice(mine);
        }
        self.stopped_at[first..first + of_part].copy_from_slice(&part.stopped_at);
        self.other_steps[first..first + of_part].copy_from_slice(&part.other_steps);
        self.rests.extend(part.rests);
    }
}
