//! Any linear system (§3): ṡ = A·s + B·x(t), with the state s = (v, y) of any size, cut into the two blocks where the user says.
//!
//! An increment is a row of h·A and h·B times the columns v, y and x, summed in this order.

use crate::{
    error::Error,
    model::{
        signal::Signal,
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: `n_v`, how many of the states are in v; `inputs`, how many, and `inputs[0]`, …; `rows`, [A B] by rows; the word
/// `kind` is `acceleration` if ẏ is v times a number and v̇ does not depend on v.
pub const KIND: Kind = Kind {
    name: "linear",
    shape,
    velocity_term: |signature| (signature.word("kind") != "acceleration").then_some("rates of another kind"),
    quantities: |_| Vec::new(),
    controllable: false,
    operations: |signature| 2 * signature.count("rows"),
    make,
};

fn input(i: usize) -> String {
    format!("inputs[{i}]")
}

fn shape(signature: &Signature) -> Result<Shape, Error> {
    let (v, inputs) = (signature.whole("n_v"), signature.whole("inputs"));
    let got = (0..inputs).filter(|i| signature.has(&input(*i))).count();
    if got != inputs {
        return Err(Error::Shape { what: "inputs", expected: inputs, got });
    }
    let mut n = v.max(1);
    let numbers = |n: usize| n.saturating_mul(n.saturating_add(inputs));
    while numbers(n) < signature.count("rows") {
        n += 1;
    }
    signature.expect("rows", numbers(n))?;
    match signature.word("kind") {
        "" => {}
        "acceleration" if v == n - v => {}
        _ => return Err(signature.unknown("kind")),
    }
    Ok(Shape { v, y: n - v })
}

struct Linear<N: Number> {
    /// A row of h·A and h·B for each number of v, then of y.
    rows: Vec<Vec<N>>,
    inputs: Vec<Signal<N>>,
    velocities: usize,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let inputs = (0..p.signature.whole("inputs")).map(|i| p.signal(&input(i)).unwrap_or(Signal::Constant(N::of(f64::NAN))));
    let inputs: Vec<_> = inputs.collect();
    let velocities = p.signature.whole("n_v");
    let numbers: Vec<N> = p.numbers("rows").iter().map(|number| p.h * *number).collect();
    let states = shape(p.signature).map_or(1, |shape| shape.v + shape.y);
    let rows = numbers.chunks(states + inputs.len()).map(<[N]>::to_vec).collect();
    Box::new(Linear { rows, inputs, velocities })
}

/// Rows that are summed side by side: a sum in a fixed order is a chain of additions that wait for each other.
const ROWS_AT_ONCE: usize = 4;

/// Sums of products, by row and column, from the left.
pub(crate) fn products<N: Number>(rows: usize, columns: usize, product: impl Fn(usize, usize) -> N) -> Vec<N> {
    let mut sums = Vec::with_capacity(rows);
    for first in (0..rows).step_by(ROWS_AT_ONCE) {
        let some = first..rows.min(first + ROWS_AT_ONCE);
        let mut sum: Vec<N> = some.clone().map(|i| if columns == 0 { N::of(0.0) } else { product(i, 0) }).collect();
        for j in 1..columns {
            some.clone().zip(&mut sum).for_each(|(i, sum)| *sum += product(i, j));
        }
        sums.extend(sum);
    }
    sums
}

impl<N: Number> Linear<N> {
    /// Rows times the columns v, y and x, from the left.
    fn times(&self, rows: &[Vec<N>], t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let columns: Vec<N> = v.iter().chain(y).copied().chain(self.inputs.iter().map(|x| x.at(t))).collect();
        Block::from_vec(products(rows.len(), columns.len(), |i, j| rows[i][j] * columns[j]))
    }
}

impl<N: Number> System<N> for Linear<N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.times(&self.rows[..self.velocities], t, v, y)
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.times(&self.rows[self.velocities..], t, v, y)
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        let speed = self.rows.get(self.velocities).and_then(|row| row.first()).copied();
        d.map(|d| d / speed.unwrap_or(N::of(f64::NAN)))
    }
}
