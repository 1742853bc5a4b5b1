//! Methods: the metadata of each, and its step over blocks.

use super::program::{Block, Length, Program, Rates, Time};

/// The metadata of a method. Python attributes, `__doc__`, the tables of the docs, the command line, tests,
/// charts and benches all read it.
#[derive(Debug)]
pub struct Record {
    /// The name users type.
    pub name: &'static str,
    /// Hoffmann's name, as a title.
    pub title: &'static str,
    /// Standard names of the same method.
    pub other_names: &'static [&'static str],
    /// Methods with which it is easily confused.
    pub false_friends: &'static [&'static str],
    /// Order of convergence of both blocks.
    pub order: u32,
    /// The family of methods to which it belongs.
    pub family: &'static str,
    /// The undamped oscillator is stable for Φ = ω₀T below this; 0 means never.
    pub limit: f64,
    /// Its requirements on a system.
    pub needs: Needs,
    /// Its carry: the block that it keeps between steps in place of `v`, if any.
    pub carry: Option<Carry>,
    /// Its estimate of the error of a step, if it has one: adaptive steps need it.
    pub estimate: Option<Estimate>,
    /// Section of Hoffmann (2002).
    pub section: &'static str,
    /// Publication.
    pub reference: &'static str,
    /// Description, in a few sentences.
    pub about: &'static str,
    /// One step: the new v and y.
    pub step: Blocks,
}

/// A function from a state to two blocks, one in place of v and one in place of y.
pub(crate) type Blocks = fn(Rates, Time, Length, Block, Block) -> (Block, Block);

/// A function from a state to blocks of v and y, one pair for each power.
pub(crate) type Powers = fn(Rates, Time, Length, Block, Block) -> Vec<(Block, Block)>;

/// The requirements of a method on a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing beyond the two increments.
    Rates,
    /// A second-order system, ÿ = a(t, y), whose forces do not depend on the velocity.
    Acceleration,
}

/// The block that a method keeps between steps in place of the velocity.
#[derive(Debug)]
pub struct Carry {
    /// Its name.
    pub name: &'static str,
    /// Ways to start, the default first; empty if there is nothing to choose.
    pub starts: &'static [&'static str],
    /// Turns the velocity into what is carried. The number is that of the way to start.
    pub start: fn(Rates, usize, Time, Block, Block) -> Block,
    /// Turns what is carried back into the velocity: the inverse of `start`.
    pub finish: fn(Rates, usize, Time, Block, Block) -> Block,
}

/// How a method estimates the error of a step.
#[derive(Debug)]
pub struct Estimate {
    /// Order of h in which it does.
    pub order: u32,
    /// The estimate for both blocks.
    pub error: Blocks,
    /// A second estimate, of other weights of the same stages, beside which the first may not be next to nothing by chance. One
    /// of lower order corrects a first of more than the fifth, so that both together behave as one of the method's order.
    pub coarse: Option<Blocks>,
    /// The coefficients of the powers of θ in the state at the share θ of a step; none where that takes a step of its own.
    pub extension: Option<Powers>,
}

/// A fact about a method, to be shown.
#[derive(Debug)]
pub enum Fact {
    /// A text.
    Text(&'static str),
    /// A text that may be missing.
    MaybeText(Option<&'static str>),
    /// Several texts.
    Texts(&'static [&'static str]),
    /// A whole number that may be missing.
    Whole(Option<usize>),
    /// A number.
    Number(f64),
    /// Several numbers.
    Numbers(Vec<f64>),
    /// Yes or no.
    Truth(bool),
}

impl Record {
    /// All metadata, by their names in Python. Some follow from the step itself and are read from its program.
    pub fn facts(&self) -> Vec<(&'static str, Fact)> {
        let program = self.program();
        vec![
            ("name", Fact::Text(self.name)),
            ("title", Fact::Text(self.title)),
            ("other_names", Fact::Texts(self.other_names)),
            ("false_friends", Fact::Texts(self.false_friends)),
            ("order", Fact::Whole(Some(self.order as usize))),
            ("evaluations", Fact::Whole(Some(program.evaluations()))),
            ("attempt_evaluations", Fact::Whole(Some(self.attempt().map_or(0, |attempt| attempt.evaluations())))),
            ("extension_evaluations", Fact::Whole(Some(self.extension().map_or(0, |program| program.evaluations())))),
            ("family", Fact::Text(self.family)),
            ("limit", Fact::Number(self.limit)),
            ("nodes", Fact::Numbers(program.nodes(self.needs == Needs::Rates))),
            ("needs_acceleration", Fact::Truth(self.needs == Needs::Acceleration)),
            ("is_implicit", Fact::Truth(program.is_implicit())),
            ("carry", Fact::MaybeText(self.carry.as_ref().map(|carry| carry.name))),
            ("starts", Fact::Texts(self.carry.as_ref().map_or(&[], |carry| carry.starts))),
            ("error_order", Fact::Whole(self.estimate.as_ref().map(|estimate| estimate.order as usize))),
            ("section", Fact::Text(self.section)),
            ("reference", Fact::Text(self.reference)),
            ("about", Fact::Text(self.about)),
        ]
    }

    /// The program of a step: results are the new v and y.
    pub fn program(&self) -> Program {
        Program::record(|s, t, h, v, y| {
            let (v, y) = (self.step)(s, t, h, v, y);
            vec![v, y]
        })
    }

    /// The program of an attempt: results are the new v and y and the estimates of their errors, two or four blocks.
    pub fn attempt(&self) -> Option<Program> {
        let estimate = self.estimate.as_ref()?;
        Some(Program::record(|s, t, h, v, y| {
            let (new_v, new_y) = (self.step)(s, t, h, v, y);
            let (error_v, error_y) = (estimate.error)(s, t, h, v, y);
            let mut results = vec![new_v, new_y, error_v, error_y];
            if let Some(coarse) = estimate.coarse {
                let (coarse_v, coarse_y) = coarse(s, t, h, v, y);
                results.extend([coarse_v, coarse_y]);
            }
            results
        }))
    }

    /// The program of the coefficients of the continuous extension: results are those of v and of y, power by power.
    pub fn extension(&self) -> Option<Program> {
        let extension = self.estimate.as_ref()?.extension?;
        Some(Program::record(|s, t, h, v, y| extension(s, t, h, v, y).into_iter().flat_map(|(v, y)| [v, y]).collect()))
    }

    /// The program that turns a velocity into what the method carries.
    pub fn start(&self, choice: usize) -> Option<Program> {
        let carry = self.carry.as_ref()?;
        Some(Program::record(|s, t, _, v, y| vec![(carry.start)(s, choice, t, v, y)]))
    }

    /// The program that turns what the method carries into a velocity.
    pub fn finish(&self, choice: usize) -> Option<Program> {
        let carry = self.carry.as_ref()?;
        Some(Program::record(|s, t, _, v, y| vec![(carry.finish)(s, choice, t, v, y)]))
    }
}
