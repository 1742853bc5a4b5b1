//! The rates of a system as operations, from the state, the parameters, the inputs and the time: what a user's function wrote.

use std::{
    collections::HashMap,
    hash::{DefaultHasher, Hash, Hasher},
};

use super::{Id, Op, mass::Mass};

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

/// Friction that sticks: the most by which it decelerates, and which velocities it acts on.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Friction {
    /// The decelerations, one for each vector, or one in all.
    pub limit: Vec<Id>,
    /// The velocities that it acts on.
    pub on: On,
}

/// The velocities that friction acts on.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum On {
    /// Vectors of this many numbers each, one after the other: all of v.
    Vectors(usize),
    /// One number of v at that place; of the others, by how much each changes where that one changes by 1, or nothing if none
    /// does.
    One(usize, Vec<Id>),
}

impl Friction {
    /// Whether it is for a block of `v` numbers.
    fn fits(&self, v: usize) -> bool {
        match &self.on {
            On::Vectors(length) => *length > 0 && self.limit.len() * length == v,
            On::One(at, along) => *at < v && self.limit.len() == 1 && (along.is_empty() || along.len() == v),
        }
    }

    /// All its values.
    fn values(&self) -> impl Iterator<Item = &Id> {
        let along = match &self.on {
            On::Vectors(_) => &[][..],
            On::One(_, along) => along,
        };
        self.limit.iter().chain(along)
    }
}

/// A value that is a function of others.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Marked {
    /// The value.
    pub value: Id,
    /// Pairs of a value that it is a function of and the derivative by it.
    pub by: Vec<(Id, Id)>,
    /// If it is one branch of several, the bits of its bounds.
    pub bounds: Option<[u64; 2]>,
    /// Whether it is made of pieces, as |x| and ⌊x⌋ are.
    pub pieces: bool,
}

/// The rates of a system, as operations.
#[derive(Clone, Debug)]
pub struct Equations {
    pub(crate) ops: Vec<Op>,
    /// How many numbers v has, and their rates.
    pub(crate) dv: Vec<Id>,
    /// The rates of y; none if they are v itself.
    pub(crate) dy: Option<Vec<Id>>,
    /// Quantities of a state, each one number, by name.
    pub(crate) quantities: Vec<(String, Id)>,
    /// The invariant that a projection keeps.
    pub(crate) kept: Option<Invariant>,
    /// Values that are functions of others, whose operations do not tell their derivatives, for series.
    pub(crate) functions: Vec<Marked>,
    /// The mass matrix, if the rates are those of M·ẏ = f.
    pub(crate) mass: Option<Mass>,
    /// Friction that sticks, if there is some.
    pub(crate) friction: Option<Friction>,
    /// A digest that distinguishes it from others, computed once: traced steps are found by it.
    digest: u64,
}

impl PartialEq for Equations {
    fn eq(&self, other: &Equations) -> bool {
        let parts = |e: &Equations| (e.dv.clone(), e.dy.clone(), e.quantities.clone(), e.kept.clone(), e.functions.clone());
        let more = |e: &Equations| (e.mass.clone(), e.friction.clone());
        self.digest == other.digest && self.ops == other.ops && parts(self) == parts(other) && more(self) == more(other)
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
        Equations { ops, dv, dy, quantities, kept, functions: Vec::new(), mass: None, friction: None, digest: hasher.finish() }
    }

    /// Adds values that are known as functions of others, for methods that need the series of a solution.
    #[must_use]
    pub fn with_functions(self, functions: Vec<Marked>) -> Equations {
        let mut hasher = DefaultHasher::new();
        (self.digest, &functions).hash(&mut hasher);
        Equations { functions, digest: hasher.finish(), ..self }
    }

    /// Adds a mass matrix.
    #[must_use]
    pub fn with_mass(self, mass: Option<Mass>) -> Equations {
        let Some(mass) = mass else { return self };
        let mut hasher = DefaultHasher::new();
        (self.digest, &mass).hash(&mut hasher);
        Equations { mass: Some(mass), digest: hasher.finish(), ..self }
    }

    /// Adds friction that sticks.
    #[must_use]
    pub fn with_friction(self, friction: Option<Friction>) -> Equations {
        let Some(friction) = friction else { return self };
        let mut hasher = DefaultHasher::new();
        (self.digest, &friction).hash(&mut hasher);
        Equations { friction: Some(friction), digest: hasher.finish(), ..self }
    }

    /// Removes operations whose results are not used.
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
        let functions = self.functions.into_iter().filter(|each| needed[each.value as usize]).map(|each| {
            let by = each.by.iter().map(|(of, factor)| (at(*of), at(*factor))).collect();
            Marked { value: at(each.value), by, ..each }
        });
        let functions = functions.collect();
        let friction = self.friction.map(|friction| Friction {
            limit: all(friction.limit),
            on: match friction.on {
                On::Vectors(length) => On::Vectors(length),
                On::One(at, along) => On::One(at, all(along)),
            },
        });
        let plain = Equations::new(ops, all(self.dv), self.dy.map(all), quantities, kept);
        plain.with_functions(functions).with_mass(self.mass).with_friction(friction)
    }

    /// The quantities by name.
    pub(crate) fn quantities(&self) -> &[(String, Id)] {
        &self.quantities
    }

    /// Whether there is an invariant that a projection can keep.
    pub(crate) fn has_gradient(&self) -> bool {
        self.kept.is_some()
    }

    /// All values that the equations need.
    fn roots(&self) -> impl Iterator<Item = Id> {
        let kept = self.kept.iter().flat_map(|kept| kept.along_v.iter().chain(&kept.along_y).chain([&kept.value, &kept.square]));
        let friction = self.friction.iter().flat_map(Friction::values);
        let quantities = self.quantities.iter().map(|(_, id)| id);
        self.dv.iter().chain(self.dy.iter().flatten()).chain(quantities).chain(kept).chain(friction).copied()
    }

    /// How many operations the rates, quantities and gradients have.
    pub(crate) fn operations(&self) -> usize {
        if self.functions.is_empty() {
            return self.ops.len();
        }
        self.needed(&self.roots().collect::<Vec<_>>()).into_iter().filter(|needed| *needed).count()
    }

    /// How many numbers v and y have.
    pub(crate) fn blocks(&self) -> [usize; 2] {
        [self.dv.len(), self.dy.as_ref().map_or(self.dv.len(), Vec::len)]
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

    /// Whether the rates are piecewise, with a choice by the state or the time. Choices within a function do not count.
    pub fn chooses(&self) -> bool {
        let functions: HashMap<Id, &Marked> = self.functions.iter().map(|each| (each.value, each)).collect();
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
                Some(function) if function.pieces => return true,
                // What its derivatives choose at the end of its domain is no piece of the rates.
                Some(function) => open.extend(function.by.iter().map(|(of, _)| *of)),
                None if matches!(op, Op::Select(truth, ..) if varies[truth as usize]) => return true,
                None if rounds_or_works_on_bits(op) => return true,
                None => open.extend(&operands[..n]),
            }
        }
        false
    }

    /// Whether a rate depends on the step, as the limited form of a control does.
    pub(crate) fn reads_step(&self) -> bool {
        let needed = self.needed(&self.dv.iter().chain(self.dy.iter().flatten()).copied().collect::<Vec<_>>());
        self.ops.iter().zip(needed).any(|(op, needed)| needed && matches!(op, Op::Step))
    }

    /// Which operations these values depend on.
    pub(crate) fn needed(&self, roots: &[Id]) -> Vec<bool> {
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
    pub(crate) fn needed_with_functions(&self, mut roots: Vec<Id>) -> Vec<bool> {
        let mut needed = self.needed(&roots);
        loop {
            let known = roots.len();
            for each in self.functions.iter().filter(|each| needed[each.value as usize]) {
                roots.extend(each.by.iter().flat_map(|(of, factor)| [*of, *factor]).filter(|id| !needed[*id as usize]));
            }
            if roots.len() == known {
                return needed;
            }
            needed = self.needed(&roots);
        }
    }

    /// Whether each operation comes after what it reads, no leaf is beyond these counts of parameters, tables and numbers of the
    /// state, an invariant has a derivative by each number of the blocks, a mass matrix works with y alone, and friction fits v.
    pub(crate) fn is_sound(&self, parameters: usize, tables: usize, states: usize) -> bool {
        let is_read = |(id, op): (usize, &Op)| {
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
        let whole = self.kept.as_ref().is_none_or(|kept| [kept.along_v.len(), kept.along_y.len()] == self.blocks());
        let [v, y] = self.blocks();
        let mass_fits = self.mass.as_ref().is_none_or(|mass| v == 0 && mass.fits(y));
        let friction_fits = self.friction.as_ref().is_none_or(|friction| friction.fits(v));
        whole
            && mass_fits
            && friction_fits
            && self.ops.iter().enumerate().all(is_read)
            && self.roots().all(|id| (id as usize) < self.ops.len())
    }
}

/// Whether its value is constant but for jumps, or is made bit by bit: outside of a function there is no smooth value of such an
/// operation.
fn rounds_or_works_on_bits(op: Op) -> bool {
    op.counted() == "bits"
}
