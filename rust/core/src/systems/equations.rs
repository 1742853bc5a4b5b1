//! A user's own equations: the rates as operations, from the state, the parameters, the inputs and the time.
//!
//! They come from a function that was run once with symbols. Evaluated over any kind of number, they are a system like others.

use std::{
    collections::HashMap,
    hash::{DefaultHasher, Hash, Hasher},
};

use crate::{
    error::Error,
    number::{Number, Symbol},
    series,
    spec::{Given, Parameters},
    system::{Block, Energies, Gradient, Kind, Shape, System},
    tape::{Id, Op, eval},
};

/// The record of the system. It is given the equations, and the numbering of their leaves.
pub const KIND: Kind = Kind {
    name: "equations",
    shape,
    velocity_term: |given| given.equations.as_ref().filter(|e| e.reads_v()).map(|_| "a force that depends on v"),
    quantities,
    operations: |given| given.equations.as_ref().map_or(0, |e| e.operations()),
    long: None,
    make,
};

/// An invariant that is kept, and its gradient.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Invariant {
    /// Its value.
    pub value: Id,
    /// Its derivatives by the numbers of v.
    pub along_v: Vec<Id>,
    /// Its derivatives by the numbers of y.
    pub along_y: Vec<Id>,
    /// The square of the gradient's length.
    pub square: Id,
}

/// A value that is a function of others: pairs of a value and the derivative by it; and, if it is one branch of several, the bits of its
/// bounds.
pub type Marked = (Id, Vec<(Id, Id)>, Option<[u64; 2]>);

/// The rates of a system, as operations.
#[derive(Clone, Debug)]
pub struct Equations {
    ops: Vec<Op>,
    /// How many numbers v has, and their rates.
    dv: Vec<Id>,
    /// The rates of y; none if they are v itself.
    dy: Option<Vec<Id>>,
    /// Quantities of a state, each one number, by name.
    quantities: Vec<(String, Id)>,
    /// The invariant that a projection keeps.
    kept: Option<Invariant>,
    /// Values that are functions of others, whose operations do not tell their derivatives, for series.
    functions: Vec<Marked>,
    /// A digest that distinguishes it from others, computed once: traced steps are found by it.
    digest: u64,
}

impl PartialEq for Equations {
    fn eq(&self, other: &Equations) -> bool {
        let parts = |e: &Equations| (e.dv.clone(), e.dy.clone(), e.quantities.clone(), e.kept.clone(), e.functions.clone());
        self.digest == other.digest && self.ops == other.ops && parts(self) == parts(other)
    }
}

impl Eq for Equations {}

impl Hash for Equations {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.digest.hash(state);
    }
}

impl Equations {
    /// Rates as operations; those of y are none if they are v itself.
    pub fn new(
        ops: Vec<Op>,
        dv: Vec<Id>,
        dy: Option<Vec<Id>>,
        quantities: Vec<(String, Id)>,
        kept: Option<Invariant>,
    ) -> Equations {
        let mut hasher = DefaultHasher::new();
        (&ops, &dv, &dy, &quantities, &kept).hash(&mut hasher);
        Equations { ops, dv, dy, quantities, kept, functions: Vec::new(), digest: hasher.finish() }
    }

    /// The same with values that are known as functions of others, for methods that need the series of a solution.
    #[must_use]
    pub fn with_functions(self, functions: Vec<Marked>) -> Equations {
        let mut hasher = DefaultHasher::new();
        (self.digest, &functions).hash(&mut hasher);
        Equations { functions, digest: hasher.finish(), ..self }
    }

    /// The same without operations whose result is not used.
    #[must_use]
    pub fn without_the_rest(self) -> Equations {
        let needed = self.needed_with_functions(self.roots().collect());
        let mut place = vec![0; self.ops.len()];
        let mut ops = Vec::new();
        for (id, op) in self.ops.iter().enumerate().filter(|(id, _)| needed[*id]) {
            place[id] = ops.len() as Id;
            ops.push(op.with(|operand| place[operand as usize]));
        }
        let at = |id: Id| place[id as usize];
        let all = |ids: Vec<Id>| ids.into_iter().map(at).collect::<Vec<_>>();
        let kept = self.kept.map(|kept| Invariant {
            value: at(kept.value),
            along_v: all(kept.along_v),
            along_y: all(kept.along_y),
            square: at(kept.square),
        });
        let quantities = self.quantities.into_iter().map(|(name, id)| (name, at(id))).collect();
        let functions = self.functions.into_iter().filter(|(value, ..)| needed[*value as usize]);
        let functions = functions
            .map(|(value, by, bounds)| (at(value), by.into_iter().map(|(of, factor)| (at(of), at(factor))).collect(), bounds));
        let functions = functions.collect();
        Equations::new(ops, all(self.dv), self.dy.map(all), quantities, kept).with_functions(functions)
    }

    /// The quantities by name.
    pub fn quantities(&self) -> &[(String, Id)] {
        &self.quantities
    }

    /// Whether there is an invariant that a projection can keep.
    pub fn has_gradient(&self) -> bool {
        self.kept.is_some()
    }

    /// All values that are needed.
    fn roots(&self) -> impl Iterator<Item = Id> {
        let kept = self.kept.iter().flat_map(|kept| kept.along_v.iter().chain(&kept.along_y).chain([&kept.value, &kept.square]));
        self.dv.iter().chain(self.dy.iter().flatten()).chain(self.quantities.iter().map(|(_, id)| id)).chain(kept).copied()
    }

    /// How many operations the rates, quantities and gradients have.
    pub fn operations(&self) -> usize {
        if self.functions.is_empty() {
            return self.ops.len();
        }
        self.needed(&self.roots().collect::<Vec<_>>()).into_iter().filter(|needed| *needed).count()
    }

    /// The size of the blocks, or an error if the operations do not belong to what is given.
    pub fn fit(&self, given: &Given) -> Result<Shape, Error> {
        let shape = self.shape();
        self.check(given, shape.v + shape.y)?;
        Ok(shape)
    }

    fn shape(&self) -> Shape {
        Shape { v: self.dv.len(), y: self.dy.as_ref().map_or(self.dv.len(), Vec::len) }
    }

    /// Whether a rate of v depends on v.
    pub fn reads_v(&self) -> bool {
        let needed = self.needed(&self.dv);
        self.ops.iter().zip(needed).any(|(op, needed)| needed && matches!(op, Op::State(i) if (*i as usize) < self.dv.len()))
    }

    /// Whether anything depends on the time.
    pub fn reads_time(&self) -> bool {
        self.ops.iter().any(|op| matches!(op, Op::Time))
    }

    /// Whether the rates are made of pieces, one of which is chosen by the state or the time. What is within a function does not count.
    pub fn chooses(&self) -> bool {
        let functions: HashMap<Id, &Vec<(Id, Id)>> = self.functions.iter().map(|(value, by, _)| (*value, by)).collect();
        let mut varies: Vec<bool> = Vec::with_capacity(self.ops.len());
        for op in &self.ops {
            let (operands, n) = op.operands();
            varies.push(matches!(op, Op::State(_) | Op::Time) || operands[..n].iter().any(|id| varies[*id as usize]));
        }
        let mut seen = vec![false; self.ops.len()];
        let mut open: Vec<Id> = self.dv.iter().chain(self.dy.iter().flatten()).copied().collect();
        while let Some(id) = open.pop() {
            if std::mem::replace(&mut seen[id as usize], true) || !varies[id as usize] {
                continue;
            }
            let op = self.ops[id as usize];
            let (operands, n) = op.operands();
            match functions.get(&id) {
                Some(by) if by.is_empty() => return true, // as floor and sign, whose derivative is zero between jumps
                Some(by) => open.extend(by.iter().flat_map(|(of, factor)| [*of, *factor])),
                None if matches!(op, Op::Select(truth, ..) if varies[truth as usize]) => return true,
                None if rounds_or_works_on_bits(op) => return true,
                None => open.extend(&operands[..n]),
            }
        }
        false
    }

    /// Whether a rate depends on the step, as the limited form of a control does.
    pub fn reads_step(&self) -> bool {
        let needed = self.needed(&self.dv.iter().chain(self.dy.iter().flatten()).copied().collect::<Vec<_>>());
        self.ops.iter().zip(needed).any(|(op, needed)| needed && matches!(op, Op::Step))
    }

    /// Which operations these values depend on.
    fn needed(&self, roots: &[Id]) -> Vec<bool> {
        let mut needed = vec![false; self.ops.len()];
        roots.iter().for_each(|id| needed[*id as usize] = true);
        for (id, op) in self.ops.iter().enumerate().rev() {
            if needed[id] {
                let (operands, n) = op.operands();
                operands[..n].iter().for_each(|operand| needed[*operand as usize] = true);
            }
        }
        needed
    }

    /// Likewise, and for functions also what they and their derivatives depend on.
    fn needed_with_functions(&self, mut roots: Vec<Id>) -> Vec<bool> {
        let mut needed = self.needed(&roots);
        loop {
            let known = roots.len();
            for (_, by, _) in self.functions.iter().filter(|(value, ..)| needed[*value as usize]) {
                roots.extend(by.iter().flat_map(|(of, factor)| [*of, *factor]).filter(|id| !needed[*id as usize]));
            }
            if roots.len() == known {
                return needed;
            }
            needed = self.needed(&roots);
        }
    }

    /// An error unless each operation comes after what it reads and no leaf is beyond what is given.
    pub fn check(&self, given: &Given, states: usize) -> Result<(), Error> {
        let (parameters, tables) = (given.parameters(), given.tables.len());
        let fits = |(id, op): (usize, &Op)| {
            let (operands, n) = op.operands();
            let leaf = match *op {
                Op::State(i) => (i as usize) < states,
                Op::Param(i) => (i as usize) < parameters,
                Op::Sample(table, _) => (table as usize) < tables,
                Op::Row(_) | Op::Uniform(_) | Op::PerStep(_) | Op::Held(_) | Op::Gather(_) => false,
                _ => true,
            };
            leaf && operands[..n].iter().all(|operand| (*operand as usize) < id)
        };
        let shape = self.shape();
        let whole = self.kept.as_ref().is_none_or(|kept| (kept.along_v.len(), kept.along_y.len()) == (shape.v, shape.y));
        if whole && self.ops.iter().enumerate().all(fits) && self.roots().all(|id| (id as usize) < self.ops.len()) {
            Ok(())
        } else {
            Err(Error::Options { system: given.system.clone(), options: "operations that do not belong together".into() })
        }
    }
}

fn quantities(given: &Given) -> Vec<(String, usize)> {
    given.equations.iter().flat_map(|e| &e.quantities).map(|(name, _)| (name.clone(), 1)).collect()
}

fn shape(given: &Given) -> Result<Shape, Error> {
    let Some(equations) = &given.equations else {
        return Err(Error::Shape { what: "equations", expected: 1, got: 0 });
    };
    equations.fit(given)
}

/// A number on which every operation is defined.
pub trait Operand: Number {
    /// What an operation makes.
    fn made(op: Op, operands: [Self; 3]) -> Self;

    /// Whether a series is traced, which must know what is a function of what.
    fn is_marking() -> bool {
        false
    }

    /// Notes the derivatives of a value by others, and its bounds.
    fn mark(self, _by: Vec<(Self, Self)>, _bounds: Option<[f64; 2]>) {}
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
}

/// Whether its value is constant but for jumps, or is made bit by bit: outside of a function there is no smooth value of such an operation.
fn rounds_or_works_on_bits(op: Op) -> bool {
    matches!(op, Op::Floor(_) | Op::And(..) | Op::Or(..) | Op::Xor(..) | Op::AddBits(..) | Op::ShiftUp(..) | Op::ShiftDown(..))
}

struct Own<N: Number> {
    h: N,
    numbers: Vec<N>,
    sample: fn(u32, N) -> N,
    equations: std::sync::Arc<Equations>,
    /// Which operations the rates of v, and those of y, need.
    of_v: Vec<bool>,
    of_y: Vec<bool>,
}

pub(super) fn make<N: Operand>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let equations =
        p.given.equations.clone().unwrap_or_else(|| Equations::new(Vec::new(), Vec::new(), None, Vec::new(), None).into());
    let (of_v, of_y) = (equations.needed(&equations.dv), equations.needed(equations.dy.as_deref().unwrap_or(&[])));
    Box::new(Own { h: p.h, numbers: p.numbers.clone(), sample: p.sample, equations, of_v, of_y })
}

/// The values of these quantities for a state of any system with these parameters.
pub fn values_of(
    equations: &std::sync::Arc<Equations>,
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
pub fn next_state(
    step: &std::sync::Arc<Equations>,
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
            for (value, by, bounds) in self.equations.functions.iter().filter(|(value, ..)| needed[*value as usize]) {
                let by = by.iter().map(|(of, factor)| (made[*of as usize], made[*factor as usize])).collect();
                made[*value as usize].mark(by, bounds.map(|bounds| bounds.map(f64::from_bits)));
            }
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

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        let (_, id) = self.equations.quantities.iter().find(|(name, _)| name == quantity)?;
        Some(vec![self.of_state(&[*id], v, y)[0]])
    }
}
