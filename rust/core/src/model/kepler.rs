//! Kepler's motion over a step, by a fixed number of operations: universal variables (Stumpff; Stiefel and Scheifele 1971).
//!
//! With s, the time over the distance, h = r₀·s + η·G₂ + ζ·G₃, where Gₙ = sⁿ·cₙ(β·s²), η = y·v, β = 2μ/r₀ − v², ζ = μ − β·r₀. The
//! left side grows with s, at the rate of the distance, so it has one solution, on orbits of every kind. It is found by three
//! improvements of fourth order from s = h/r₀. Where they do not suffice the result is NaN: a step that is too long for the
//! orbit.

use crate::tape::number::Number;

/// n!, exactly.
const fn factorial(n: u64) -> f64 {
    if n == 0 { 1.0 } else { n as f64 * factorial(n - 1) }
}

/// 1/n!, 1/(n + 2)!, …: of c₂ and c₃ in powers of β·s²/16. The next term is below a rounding up to [`MOST`].
const fn every_other(first: u64) -> [f64; 8] {
    let mut terms = [0.0; 8];
    let mut k = 0;
    while k < 8 {
        terms[k] = 1.0 / factorial(first + 2 * k as u64);
        k += 1;
    }
    terms
}

const EVEN: [f64; 8] = every_other(2);
const ODD: [f64; 8] = every_other(3);

/// 1/16, exactly: the argument of the series after two halvings of s.
const QUARTERED: f64 = 0.0625;

/// How many terms of them each improvement takes: what the last one does not need, the first ones need not have.
const TERMS: [usize; 3] = [4, 6, 8];

const SIXTH: f64 = 1.0 / 6.0;

/// 2⁻³⁶: the square of the last improvement as a share of s, and of what it bends; its fourth power is then below a rounding.
const SMALL: f64 = 1.0 / 68_719_476_736.0;

/// The largest |β·s²|: of an ellipse the square of the change of the eccentric anomaly, a little more than half a revolution.
const MOST: f64 = 12.0;

fn dot<N: Number>(a: &[N], b: &[N]) -> N {
    a.iter().zip(b).map(|(a, b)| *a * *b).reduce(|sum, product| sum + product).unwrap_or(N::of(0.0))
}

/// The changes of v and of y of a relative motion under μ in the time h.
pub(crate) fn moved<N: Number>(mu: N, h: N, v: &[N], y: &[N]) -> [Vec<N>; 2] {
    let of = N::of;
    let r0 = dot(y, y).sqrt();
    let inverse = of(1.0) / r0;
    let eta = dot(y, v);
    let beta = (mu + mu) * inverse - dot(v, v);
    let zeta = mu - beta * r0;
    let mut s = h * inverse;
    let [first @ .., last] = TERMS;
    for terms in first {
        let Nearer { newton, bend, curl, .. } = Nearer::new(h, r0, [eta, beta, zeta], s, terms);
        let nearer = newton / (of(1.0) + newton * bend);
        s += newton / (of(1.0) + nearer * (bend + nearer * curl));
    }
    let Nearer { g: [g0, g1, g2, g3], newton, bend, curl } = Nearer::new(h, r0, [eta, beta, zeta], s, last);
    let change = newton * (of(1.0) - newton * (bend - newton * ((bend + bend) * bend - curl)));
    let square = change * change;
    let (whole, bent, curled) = (beta * (s * s), change * bend, square * curl);
    let sound = (whole * whole).at_most(of(MOST * MOST))
        & square.at_most(of(SMALL) * (s * s))
        & (bent * bent).at_most(of(SMALL))
        & (curled * curled).at_most(of(SMALL * SMALL));
    // The functions at s + change: what is left out is the third power of the change.
    let half = of(0.5) * square;
    let g3 = (g3 + change * g2) + half * g1;
    let g2 = (g2 + change * g1) + half * g0;
    let g1 = (g1 + change * g0) - half * (beta * g1);
    let per = of(1.0) / ((r0 + eta * g1) + zeta * g2);
    let fall = -(mu * g2);
    let of_y = N::choose(sound, fall * inverse, of(f64::NAN));
    let (to_y, to_v) = (h - mu * g3, -(mu * g1) * (inverse * per));
    let along = |a: N, b: N| y.iter().zip(v).map(|(y, v)| a * *y + b * *v).collect();
    [along(to_v, fall * per), along(of_y, to_y)]
}

/// G₀ … G₃ at s, and how far the solution is: Newton's improvement, and by how much the curve bends.
struct Nearer<N> {
    g: [N; 4],
    newton: N,
    bend: N,
    curl: N,
}

impl<N: Number> Nearer<N> {
    fn new(h: N, r0: N, [eta, beta, zeta]: [N; 3], s: N, terms: usize) -> Nearer<N> {
        let of = N::of;
        let g = stiefel(beta, s, terms);
        let [g0, g1, g2, g3] = g;
        let per = of(1.0) / ((r0 + eta * g1) + zeta * g2);
        let newton = (h - ((r0 * s + eta * g2) + zeta * g3)) * per;
        let bend = of(0.5) * ((eta * g0 + zeta * g1) * per);
        let curl = of(SIXTH) * ((zeta * g0 - beta * (eta * g1)) * per);
        Nearer { g, newton, bend, curl }
    }
}

/// G₀ … G₃, by `terms` terms of their series.
fn stiefel<N: Number>(beta: N, s: N, terms: usize) -> [N; 4] {
    let of = N::of;
    let square = s * s;
    let z = of(QUARTERED) * (beta * square);
    let term = |k: usize| (of(EVEN[k]), of(ODD[k]));
    let ((even, odd), (next_even, next_odd)) = (term(terms - 2), term(terms - 1));
    let (mut c2, mut c3) = (even - z * next_even, odd - z * next_odd);
    for k in (0..terms - 2).rev() {
        (c2, c3) = (of(EVEN[k]) - z * c2, of(ODD[k]) - z * c3);
    }
    let (mut c0, mut c1) = (of(1.0) - z * c2, of(1.0) - z * c3);
    for _ in 0..2 {
        // Twice the argument of the sine.
        (c0, c1, c2, c3) = ((c0 + c0) * c0 - of(1.0), c0 * c1, of(0.5) * (c1 * c1), of(0.25) * (c2 + c0 * c3));
    }
    [c0, s * c1, square * c2, (square * s) * c3]
}
