//! The order in which the springs of a net are computed, and the forces that each particle takes.
//!
//! A vector of springs or of particles loads fast only what lies side by side. In a lattice it mostly does: springs sorted by the
//! distance of their ends' numbers, and then by their first end, form runs, in which both ends go up by one from spring to
//! spring. The order in which springs are computed changes no bit. The order of a particle's sum does: it is that of the springs
//! as they are given. What a particle does not take part in adds −0 to its sum, which changes no number.

/// Springs or particles of a vector.
pub(super) const SIDE: usize = 8;
/// The margin before and behind the forces, for vectors that reach beyond them.
pub(crate) const MARGIN: usize = SIDE;
/// Forces that a vector of them must give to particles on average; with fewer it is faster to add them one by one.
const MIN_FORCES_PER_ADDEND: usize = 2;

/// A vector of springs whose ends are particles side by side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    /// The place of the first spring.
    pub at: u32,
    /// The first ends of the first spring, and its second.
    pub ends: [u32; 2],
}

/// A vector of forces, side by side, that are added to particles side by side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Addend {
    /// The place of the force on the first particle, with the margin before it.
    pub at: u32,
    /// The particles that take part, a bit for each.
    pub takes: u8,
    /// Whether they are second ends, which are pulled the other way.
    pub is_second: bool,
}

/// A force that is added to a particle by itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Single {
    /// The place of the force, with the margin before it.
    pub at: u32,
    /// As of an [`Addend`].
    pub is_second: bool,
}

/// The order of a net.
pub(crate) struct Order {
    /// For each place the spring that is computed there; the last are filled with the last spring.
    pub springs: Vec<u32>,
    /// Vectors of springs in runs.
    pub runs: Vec<Run>,
    /// The first ends and the second ends of the other springs, vector by vector, and the place of the first.
    pub others: Vec<[[u32; SIDE]; 2]>,
    /// See `others`.
    pub first_other: usize,
    /// All vectors of forces that particles add, particles after particles.
    pub addends: Vec<Addend>,
    /// The end of the addends of each vector of particles.
    pub until: Vec<u32>,
    /// Forces one by one, particle after particle, for vectors of particles whose forces hardly ever lie side by side.
    pub singles: Vec<Single>,
    /// The end of the single forces of each particle.
    pub until_single: Vec<u32>,
}

/// Both ends of a spring.
fn ends_of(pairs: &[u32], spring: u32) -> [u32; 2] {
    [pairs[2 * spring as usize], pairs[2 * spring as usize + 1]]
}

impl Order {
    /// The order of the springs between these pairs of the `n` particles; no forces are added for fixed ones.
    pub(crate) fn new(n: usize, pairs: &[u32], is_fixed: &[bool]) -> Order {
        let mut springs: Vec<u32> = (0..(pairs.len() / 2) as u32).collect();
        let key = |spring: &u32| {
            let [i, j] = ends_of(pairs, *spring);
            (i64::from(j) - i64::from(i), i, *spring)
        };
        springs.sort_by_key(key);
        let follows = |a: &u32, b: &u32| ends_of(pairs, *b) == ends_of(pairs, *a).map(|end| end + 1);
        let (long, short): (Vec<&[u32]>, Vec<&[u32]>) = springs.chunk_by(follows).partition(|run| run.len() >= SIDE);
        let mut runs = Vec::new();
        let mut at = 0;
        for run in &long {
            // The last vector of a run overlaps with the one before it: springs that are computed twice are so with the same
            // result.
            for from in (0..run.len()).step_by(SIDE).map(|from| from.min(run.len() - SIDE)) {
                runs.push(Run { at: (at + from) as u32, ends: ends_of(pairs, run[from]) });
            }
            at += run.len();
        }
        let first_other = at;
        let mut springs: Vec<u32> = long.into_iter().chain(short).flatten().copied().collect();
        if springs.len() > first_other {
            let filled = first_other + (springs.len() - first_other).next_multiple_of(SIDE);
            springs.resize(filled, springs[springs.len() - 1]);
        }
        let (vectors, _) = springs[first_other..].as_chunks::<SIDE>();
        let others = vectors.iter().map(|vector| [0, 1].map(|end| vector.map(|spring| ends_of(pairs, spring)[end]))).collect();

        let mut place = vec![0; pairs.len() / 2];
        springs.iter().enumerate().rev().for_each(|(at, spring)| place[*spring as usize] = at);
        let (addends, until, singles, until_single) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut order = Order { springs, runs, others, first_other, addends, until, singles, until_single };
        for particles in of_particles(n, pairs, is_fixed, &place).chunks(SIDE) {
            let addends = vectors_of_forces(particles);
            let by_vector = addends.len() * MIN_FORCES_PER_ADDEND <= particles.iter().map(Vec::len).sum::<usize>();
            if by_vector {
                order.addends.extend(addends);
            }
            for forces in particles {
                let single = |(at, is_second): &(usize, bool)| Single { at: (MARGIN + at) as u32, is_second: *is_second };
                order.singles.extend(forces.iter().filter(|_| !by_vector).map(single));
                order.until_single.push(order.singles.len() as u32);
            }
            order.until.push(order.addends.len() as u32);
        }
        order
    }
}

/// The forces of each particle in the order of the springs: the place of each, and whether it is for a second end.
fn of_particles(n: usize, pairs: &[u32], is_fixed: &[bool], place: &[usize]) -> Vec<Vec<(usize, bool)>> {
    let mut forces = vec![Vec::new(); n];
    for (end, particle) in pairs.iter().map(|particle| *particle as usize).enumerate() {
        if !is_fixed[particle] {
            forces[particle].push((place[end / 2], end % 2 == 1));
        }
    }
    forces
}

/// Vectors of forces for a vector of particles. Each takes the next force of as many particles as have theirs side by side.
fn vectors_of_forces(particles: &[Vec<(usize, bool)>]) -> Vec<Addend> {
    let mut addends = Vec::new();
    let mut left: Vec<&[(usize, bool)]> = particles.iter().map(Vec::as_slice).collect();
    // Where a vector would begin that has a particle's next force in its place.
    let begins = |lane: usize, left: &[(usize, bool)]| left.first().map(|(at, is_second)| (MARGIN + at - lane, *is_second));
    loop {
        let next: Vec<Option<(usize, bool)>> = left.iter().enumerate().map(|(lane, left)| begins(lane, left)).collect();
        let shared = |one: &(usize, bool)| next.iter().flatten().filter(|other| *other == one).count();
        let Some((at, is_second)) = next.iter().flatten().copied().max_by_key(shared) else { return addends };
        let mut takes = 0;
        for (lane, left) in left.iter_mut().enumerate().filter(|(lane, _)| next[*lane] == Some((at, is_second))) {
            takes |= 1 << lane;
            *left = &left[1..];
        }
        addends.push(Addend { at: at as u32, takes, is_second });
    }
}
