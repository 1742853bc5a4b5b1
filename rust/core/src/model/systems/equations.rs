//! A user's own equations: the rates as operations, from the state, the parameters, the inputs and the time.
//!
//! They come from a function that was run once with symbols. Evaluated over any kind of number, they are a system like others.

use std::sync::Arc;

use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{self, Block, Energies, Friction, Gradient, Kind, Shape, System},
    },
    tape::{
        Id, Op,
        equations::{Equations, On},
        eval,
        mass::Mass,
        number::{Number, Symbol},
        series,
    },
};

/// The record of the system. It is given the equations, and the numbering of their leaves.
pub const KIND: Kind = Kind {
    name: "equations",
    shape,
    velocity_term: |signature| signature.equations.as_ref().filter(|e| e.reads_v()).map(|_| "a force that depends on v"),
    quantities,
    controllable: false,
    operations: |signature| signature.equations.as_ref().map_or(0, |e| e.operations()),
    make,
};

/// The size of the blocks, or an error if the operations do not fit the parameters.
pub(crate) fn fit(equations: &Equations, signature: &Signature) -> Result<Shape, Error> {
    let [v, y] = equations.blocks();
    check(equations, signature, v + y)?;
    Ok(Shape { v, y })
}

/// An error unless the operations are well formed, and read only known parameters and `states` numbers of the state.
pub(crate) fn check(equations: &Equations, signature: &Signature, states: usize) -> Result<(), Error> {
    if equations.is_sound(signature.parameters(), signature.tables.len(), states) {
        Ok(())
    } else {
        Err(Error::Options { system: signature.system.clone(), options: "operations that do not belong together".into() })
    }
}

fn quantities(signature: &Signature) -> Vec<(String, usize)> {
    signature.equations.iter().flat_map(|e| &e.quantities).map(|(name, _)| (name.clone(), 1)).collect()
}

fn shape(signature: &Signature) -> Result<Shape, Error> {
    let Some(equations) = &signature.equations else {
        return Err(Error::Shape { what: "equations", expected: 1, got: 0 });
    };
    fit(equations, signature)
}

/// A number on which every operation is defined.
pub trait Operand: Number {
    /// The result of an operation.
    fn made(op: Op, operands: [Self; 3]) -> Self;

    /// Whether a series is traced, which must know what is a function of what.
    fn is_marking() -> bool {
        false
    }

    /// Notes the derivatives of a value by others, and its bounds.
    fn mark(self, _by: Vec<(Self, Self)>, _bounds: Option<[f64; 2]>) {}

    /// Notes that a series may begin at the ends of domains.
    fn mark_ends() {}
}

impl Operand for f64 {
    fn made(op: Op, operands: [f64; 3]) -> f64 {
        let [a, b, c] = operands.map(f64::to_bits);
        f64::from_bits(eval::apply(op, a, b, c))
    }
}

impl Operand for Symbol {
    fn made(op: Op, operands: [Symbol; 3]) -> Symbol {
        let mut operands = operands.into_iter().map(|symbol| symbol.0);
        Symbol::new(op.with(|id| operands.next().unwrap_or(id)))
    }

    fn is_marking() -> bool {
        series::is_marking()
    }

    fn mark(self, by: Vec<(Symbol, Symbol)>, bounds: Option<[f64; 2]>) {
        series::mark(self, series::Mark::Factors(by, bounds));
    }

    fn mark_ends() {
        series::mark_ends();
    }
}

struct Own<N: Number> {
    h: N,
    numbers: Vec<N>,
    sample: fn(u32, N) -> N,
    equations: Arc<Equations>,
    /// Which operations the rates of v, and those of y, need.
    of_v: Vec<bool>,
    of_y: Vec<bool>,
}

pub(super) fn make<N: Operand>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let equations =
        p.signature.equations.clone().unwrap_or_else(|| Equations::new(Vec::new(), Vec::new(), None, Vec::new(), None).into());
    let (of_v, of_y) = (equations.needed(&equations.dv), equations.needed(equations.dy.as_deref().unwrap_or(&[])));
    Box::new(Own { h: p.h, numbers: p.numbers.clone(), sample: p.sample, equations, of_v, of_y })
}

/// The values of these quantities for a state of any system with these parameters.
pub(crate) fn values_of(
    equations: &Arc<Equations>,
    p: &Parameters<Symbol>,
    t: Symbol,
    v: &Block<Symbol>,
    y: &Block<Symbol>,
) -> Vec<Symbol> {
    let roots: Vec<Id> = equations.quantities.iter().map(|(_, id)| *id).collect();
    let (of_v, of_y) = (Vec::new(), Vec::new());
    let own = Own { h: p.h, numbers: p.numbers.clone(), sample: p.sample, equations: equations.clone(), of_v, of_y };
    own.values(&equations.needed(&roots), &roots, t, v, y).iter().copied().collect()
}

/// The state after a step that is given as operations: its rates are the next numbers of both blocks.
pub(crate) fn next_state(
    step: &Arc<Equations>,
    p: &Parameters<Symbol>,
    t: Symbol,
    v: &Block<Symbol>,
    y: &Block<Symbol>,
) -> Block<Symbol> {
    let roots: Vec<Id> = step.dv.iter().chain(step.dy.iter().flatten()).copied().collect();
    let (of_v, of_y) = (Vec::new(), Vec::new());
    let own = Own { h: p.h, numbers: p.numbers.clone(), sample: p.sample, equations: step.clone(), of_v, of_y };
    own.values(&step.needed(&roots), &roots, t, v, y)
}

impl<N: Operand> Own<N> {
    /// h times these rates.
    fn rates(&self, needed: &[bool], roots: &[Id], t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.values(needed, roots, t, v, y) * self.h
    }

    /// Values of a state, whatever the time.
    fn of_state(&self, roots: &[Id], v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.values(&self.equations.needed(roots), roots, N::of(0.0), v, y)
    }

    fn values(&self, needed: &[bool], roots: &[Id], t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let with_functions = N::is_marking().then(|| self.equations.needed_with_functions(roots.to_vec()));
        let needed = with_functions.as_deref().unwrap_or(needed);
        let mut made: Vec<N> = Vec::with_capacity(needed.len());
        for (op, needed) in self.equations.ops.iter().zip(needed) {
            let (operands, n) = op.operands();
            // Operations that are not needed are left out: no needed one reads them.
            let value = match *op {
                _ if !needed => t,
                Op::State(i) if (i as usize) < v.len() => v[i as usize],
                Op::State(i) => y[i as usize - v.len()],
                Op::Param(i) => self.numbers[i as usize],
                Op::Time => t,
                Op::Step => self.h,
                Op::Sample(table, at) => (self.sample)(table, made[at as usize]),
                _ => {
                    let mut values = [t; 3];
                    operands[..n].iter().zip(&mut values).for_each(|(id, value)| *value = made[*id as usize]);
                    N::made(*op, values)
                }
            };
            made.push(value);
        }
        if N::is_marking() {
            for each in self.equations.functions.iter().filter(|each| needed[each.value as usize]) {
                let by = each.by.iter().map(|(of, factor)| (made[*of as usize], made[*factor as usize])).collect();
                made[each.value as usize].mark(by, each.bounds.map(|bounds| bounds.map(f64::from_bits)));
            }
            N::mark_ends();
        }
        Block::from_iterator(roots.len(), roots.iter().map(|id| made[*id as usize]))
    }
}

impl<N: Operand> System<N> for Own<N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.rates(&self.of_v, &self.equations.dv, t, v, y)
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        match &self.equations.dy {
            Some(dy) => self.rates(&self.of_y, dy, t, v, y),
            None => v * self.h,
        }
    }

    fn mass(&self) -> Option<&Mass> {
        self.equations.mass.as_ref()
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    fn energies(&self, v: &Block<N>, y: &Block<N>) -> Option<Energies<N>> {
        let kept = self.equations.kept.as_ref()?;
        let unknown = N::of(f64::NAN); // what is kept is one number, of which no part is kinetic; rates are not asked for
        let whole = self.h * self.of_state(&[kept.value], v, y)[0];
        Some(Energies { dv: Block::from_element(v.len(), unknown), kinetic: unknown, whole })
    }

    fn gradient(&self, v: &Block<N>, y: &Block<N>, _: &Energies<N>) -> Option<Gradient<N>> {
        let kept = self.equations.kept.as_ref()?;
        let along = |roots: &[Id]| self.of_state(roots, v, y);
        Some(Gradient { v: along(&kept.along_v), y: along(&kept.along_y), square: along(&[kept.square])[0] })
    }

    fn friction(&self, t: N, v: &Block<N>, y: &Block<N>) -> Option<Friction<N>> {
        let friction = self.equations.friction.as_ref()?;
        let values = |roots: &[Id]| self.values(&self.equations.needed(roots), roots, t, v, y);
        let limit = values(&friction.limit) * self.h;
        let on = match &friction.on {
            On::Vectors(length) => system::On::Vectors(*length),
            On::One(at, along) => system::On::One(*at, values(along)),
        };
        Some(Friction { limit, on })
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        let (_, id) = self.equations.quantities.iter().find(|(name, _)| name == quantity)?;
        Some(vec![self.of_state(&[*id], v, y)[0]])
    }
}
