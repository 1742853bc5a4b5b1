//! Where a quantity changes its sign within steps: `reference/events.py`, which says why, over many parts of steps at a time.

use smallvec::{SmallVec, smallvec};

use super::motion::Numbers;

/// See `reference/events.py` for these.
pub(super) const SPACING: f64 = 1.0 / (1u64 << 52) as f64;
const SHARE: f64 = 1.0 / (1u64 << 48) as f64;
const MOST_TRIALS: i32 = 56;
/// A share of a step that counts as its start: 2⁻¹⁰⁰⁰.
pub(super) const LEAST_SHARE: f64 = f64::from_bits((1023 - 1000) << 52);
const TRUNCATION: f64 = 0.02;
const BENDS: f64 = 1.4;
const BENDS_TWICE: f64 = 1.25;
const MOST_HALVINGS: usize = 26;
const MOST_PARTS: usize = 32;
const MOST_HALVINGS_FROM_ZERO: usize = 60;

/// A part of a step. Positions are shares of the step, slopes are over the whole of it.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// The number of its step.
    pub of: usize,
    pub low: f64,
    pub high: f64,
    pub g_low: f64,
    pub g_high: f64,
    pub slope_low: f64,
    pub slope_high: f64,
    /// The state at its end.
    pub state: Numbers,
}

/// The quantity, its slope and the state at shares of steps; the numbers of states follow each other.
pub(super) struct Looks {
    pub g: Vec<f64>,
    pub slopes: Vec<f64>,
    pub states: Vec<f64>,
}

/// Times that differ by at most this many units in the last place are equal.
const ROUNDINGS: f64 = 2.0;

/// Whether there are only roundings of times between these: `is_no_time` of `runs/events/parts.py`.
pub(super) fn is_no_time(t: f64, other: f64) -> bool {
    let size = t.abs().max(other.abs());
    (other - t).abs() <= ROUNDINGS * (size.next_up() - size)
}

/// The sign of a number as NumPy gives it: zero of zero, NaN of NaN.
pub(super) fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x * 0.0
    }
}

impl Part {
    /// The sign of g just after the beginning and just before the end.
    fn sides(&self) -> (f64, f64) {
        let begin = if self.g_low == 0.0 { sign(self.slope_low) } else { sign(self.g_low) };
        let end = if self.g_high == 0.0 { -sign(self.slope_high) } else { sign(self.g_high) };
        (begin, if end == 0.0 && self.g_low != 0.0 { begin } else { end })
    }

    /// Whether it may have more zeros than the signs at its ends show.
    fn bends(&self) -> bool {
        let (begin, end) = self.sides();
        let third = (self.high - self.low) / 3.0;
        let (into, back) = (third * self.slope_low, -third * self.slope_high);
        let across = |side: f64, g: f64, by: f64| side * (g + by) < 0.0;
        if begin * end < 0.0 {
            across(begin, self.g_low, BENDS_TWICE * into) && across(end, self.g_high, BENDS_TWICE * back)
        } else {
            across(begin, self.g_low, BENDS * into) || across(begin, self.g_high, BENDS * back)
        }
    }

    /// Where to cut it if g leaves zero and returns.
    fn return_to_zero(&self) -> f64 {
        let width = self.high - self.low;
        let back = self.slope_low * width / (self.slope_low * width - self.g_high);
        let cut = if 1.5 * back < 0.75 { 1.5 * back } else { 0.5 * back };
        self.low + width * if cut > 0.0 && cut < 0.75 { cut } else { 0.5 }
    }
}

/// Shares of steps, by their numbers.
pub(super) type Shares<'a> = &'a [(usize, f64)];
/// Evaluates a quantity at these shares.
type Look<'a> = &'a mut dyn FnMut(Shares) -> Looks;
/// Quantities there and, one after the other, the numbers of states.
type Trial<'a> = &'a mut dyn FnMut(Shares) -> (Vec<f64>, Vec<f64>);

/// Whether g may have two zeros in a step, by its values and slopes at both ends.
pub(crate) fn bends(g: [f64; 2], slopes: [f64; 2]) -> bool {
    let [[g_low, g_high], [slope_low, slope_high]] = [g, slopes];
    Part { of: 0, low: 0.0, high: 1.0, g_low, g_high, slope_low, slope_high, state: Numbers::new() }.bends()
}

/// Divides steps into parts in which g changes its sign once, ascending; and the numbers of the steps at whose start g is zero
/// and returns to zero within rounding errors. `look` is asked for shares of steps by their numbers.
pub(super) fn parted(mut parts: Vec<Part>, look: Look) -> (Vec<Part>, Vec<usize>) {
    let (mut once, mut stuck) = (Vec::new(), Vec::new());
    let count = parts.iter().map(|part| part.of + 1).max().unwrap_or(0);
    for halving in 0..=MOST_HALVINGS_FROM_ZERO {
        let mut halved: SmallVec<[usize; 4]> = smallvec![0; count];
        let each: SmallVec<[_; 4]> = parts
            .iter()
            .map(|part| {
                let (begin, end) = part.sides();
                let changes = begin * end < 0.0;
                let leaves_zero = changes && part.g_low * begin <= 0.0;
                let zero_at_end = part.g_high == 0.0 && end != 0.0;
                let halves = (part.bends() || (changes && zero_at_end)) && halving < MOST_HALVINGS;
                halved[part.of] += usize::from(halves);
                (end, changes, leaves_zero, zero_at_end, halves)
            })
            .collect();
        let mut split = Vec::new();
        for (mut part, (end, changes, leaves_zero, zero_at_end, halves)) in parts.into_iter().zip(each) {
            if leaves_zero || (halves && halved[part.of] <= MOST_PARTS) {
                split.push((part, leaves_zero));
            } else if changes {
                once.push(part);
            } else if zero_at_end {
                (part.low, part.g_low) = (part.high, end);
                once.push(part);
            }
        }
        if halving == MOST_HALVINGS_FROM_ZERO {
            stuck.extend(split.iter().map(|(part, _)| part.of));
            break;
        }
        if split.is_empty() {
            break;
        }
        let cut = |(part, leaves_zero): &(Part, bool)| {
            let at_return = *leaves_zero && halving % 3 < 2;
            (part.of, if at_return { part.return_to_zero() } else { 0.5 * (part.low + part.high) })
        };
        let cuts: Vec<_> = split.iter().map(cut).collect();
        parts = Vec::with_capacity(2 * split.len());
        let Looks { g, slopes, states } = look(&cuts);
        let numbers = states.len() / cuts.len();
        for (i, ((part, _), (_, middle))) in split.into_iter().zip(&cuts).enumerate() {
            let (g, slope, state) = (g[i], slopes[i], Numbers::from_slice(&states[i * numbers..(i + 1) * numbers]));
            if part.g_low == 0.0 && g == 0.0 && part.g_high == 0.0 {
                continue; // it stays at zero
            }
            parts.push(Part { high: *middle, g_high: g, slope_high: slope, state, ..part });
            // It has not left zero yet, and is on the same side.
            let lies = part.g_low == 0.0 && g == 0.0 && slope == 0.0;
            let slope_low = if lies { part.slope_low } else { slope };
            parts.push(Part { low: *middle, g_low: g, slope_low, state: part.state, ..part });
        }
    }
    once.sort_by(|a, b| a.of.cmp(&b.of).then(a.high.total_cmp(&b.high)));
    (once, stuck)
}

/// Where a change of sign is: between two shares of a step. What is in the part is brought to that.
struct Bracket {
    low: f64,
    high: f64,
    g_low: f64,
    g_high: f64,
    sign: f64,
    within: f64,
    left: i32,
    unit: f64,
}

impl Bracket {
    fn new(part: &Part) -> Bracket {
        let sign = if part.g_low < 0.0 { 1.0 } else { -1.0 };
        let (low, high) = (part.low, part.high);
        let (g_low, g_high) = (sign * part.g_low, sign * part.g_high);
        Bracket { low, high, g_low, g_high, sign, within: SHARE, left: MOST_TRIALS, unit: high - low }
    }

    /// The next share to try; none if it is narrow enough.
    fn next(&mut self) -> Option<f64> {
        let width = self.high - self.low;
        let edge = SPACING * self.high;
        if width <= edge.max(LEAST_SHARE) || self.g_high == 0.0 {
            return None;
        }
        if width <= self.within || self.left == 0 {
            (self.within, self.unit) = (edge, width);
            self.left = exponent(width) - exponent(self.within) + 2;
        }
        let middle = 0.5 * (self.low + self.high);
        let secant = (self.g_high * self.low - self.g_low * self.high) / (self.g_high - self.g_low);
        let towards = if secant <= middle { 1.0 } else { -1.0 };
        let moved = TRUNCATION * (width / self.unit) * width;
        let near = if moved <= (middle - secant).abs() { secant + towards * moved } else { middle };
        let near = near.max(self.low + edge).min(self.high - edge);
        let most = times_power(0.5 * self.within, self.left) - 0.5 * width;
        let share = if (near - middle).abs() <= most { near } else { middle - towards * most };
        self.left -= 1;
        Some(if self.low < share && share < self.high { share } else { middle })
    }
}

impl Bracket {
    /// Takes the quantity at a share. Returns whether the change is there or before.
    fn take(&mut self, share: f64, g: f64) -> bool {
        let g = self.sign * g;
        if g >= 0.0 {
            (self.high, self.g_high) = (share, g);
            return true;
        }
        (self.low, self.g_low) = (share, g);
        false
    }
}

/// The exponent of the power of two above a number above zero.
fn exponent(x: f64) -> i32 {
    const SCALE: f64 = (1u64 << 54) as f64;
    let of_normal = |x: f64| (x.to_bits() >> 52) as i32 - 1022;
    if x < f64::MIN_POSITIVE { of_normal(x * SCALE) - 54 } else { of_normal(x) }
}

/// A number times a power of two, zero or more.
fn times_power(x: f64, power: i32) -> f64 {
    let of = |power: i32| f64::from_bits((1023 + power as u64) << 52);
    x * of(power / 2) * of(power - power / 2)
}

/// As `located` for one part; `trial` puts the state at a share of the step into the part, if that is at or after the change, as
/// the sign of its quantity there says.
pub(super) fn located_alone(part: &mut Part, mut trial: impl FnMut(f64) -> (f64, Numbers)) -> f64 {
    let mut bracket = Bracket::new(part);
    while let Some(share) = bracket.next() {
        let (g, state) = trial(share);
        if bracket.take(share, g) {
            part.state = state;
        }
    }
    bracket.high
}

/// Locates the change of sign in each part: its share of the step, and the state there, which is at or after the change. `trial`
/// is asked for shares of steps, by the numbers of parts.
pub(super) fn located(parts: &mut [Part], trial: Trial) -> Vec<f64> {
    let mut brackets: Vec<Bracket> = parts.iter().map(Bracket::new).collect();
    loop {
        let asked: Vec<_> = brackets.iter_mut().enumerate().filter_map(|(i, bracket)| Some((i, bracket.next()?))).collect();
        if asked.is_empty() {
            return brackets.into_iter().map(|bracket| bracket.high).collect();
        }
        let (g, states) = trial(&asked);
        let numbers = states.len() / asked.len();
        for (((i, share), g), state) in asked.iter().zip(g).zip(states.chunks_exact(numbers)) {
            if brackets[*i].take(*share, g) {
                parts[*i].state.copy_from_slice(state);
            }
        }
    }
}
