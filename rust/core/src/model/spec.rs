//! The description of a system: words, whole numbers, rows of parameters and tables of samples, each by its name.

use std::sync::Arc;

use crate::{
    error::Error,
    tape::{equations::Equations, number::Number, real::Real, split::HOLD_SLACK},
};

/// The numbers of one parameter or input, for every member; those of fewer members repeat.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a>(pub &'a [f64]);

impl Row<'_> {
    /// Whether one number serves all members.
    pub fn is_common(&self) -> bool {
        self.0.len() == 1
    }

    /// The value for a member; a row of length one serves all.
    pub fn at(&self, member: usize) -> f64 {
        match self.0 {
            [one] => *one,
            many => many.get(member % many.len().max(1)).copied().unwrap_or(f64::NAN),
        }
    }

    /// The values for the members from `first`, rounded to the precision of the lanes; what is past the `count`-th repeats the
    /// last.
    pub fn fill<T: Real>(&self, first: usize, count: usize, lanes: &mut [T]) {
        match self.0 {
            [one] => lanes.fill(T::of(*one)),
            many => {
                let own = if first < many.len() { first } else { first % many.len() }; // a division takes longer than a copy
                match many.get(own..own + count) {
                    Some(row) => lanes.iter_mut().zip(row).for_each(|(lane, x)| *lane = T::of(*x)),
                    None => lanes[..count].iter_mut().zip(many.iter().cycle().skip(own)).for_each(|(lane, x)| *lane = T::of(*x)),
                }
                lanes[count..].fill(T::of(self.at(first + count - 1)));
            }
        }
    }
}

/// A sampled input: `samples[i]` holds from `start + i·interval` until the next sample.
#[derive(Clone, Debug)]
pub struct Table<'a> {
    /// One row per sample.
    pub samples: Vec<Row<'a>>,
    /// Time of the first sample.
    pub start: f64,
    /// Time from one sample to the next.
    pub interval: f64,
}

impl Table<'_> {
    /// The sample of a member that holds at a time.
    pub(crate) fn at(&self, t: f64, member: usize) -> f64 {
        self.samples[holds_at(t, self.start, self.interval, self.samples.len())].at(member)
    }
}

/// The number of the sample that holds at a time: the last one not after it, or the first or last one outside; the first if the
/// time is a NaN. As `reference/signal.py` has it.
pub(crate) fn holds_at(t: f64, start: f64, interval: f64, samples: usize) -> usize {
    let number = ((t - start) / interval * HOLD_SLACK).floor();
    if number > 0.0 { (number as usize).min(samples - 1) } else { 0 }
}

/// Names and sizes of the parameters and inputs: all that a tape depends on, without their values.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Signature {
    /// The system's name: its file in `systems/`.
    pub system: String,
    /// Choices, such as the form of an oscillator.
    pub words: Vec<(String, String)>,
    /// Whole numbers, such as the dimensions of a space.
    pub wholes: Vec<(String, usize)>,
    /// Lists of whole numbers, such as the ends of springs.
    pub lists: Vec<(String, Arc<[u32]>)>,
    /// Parameters: how many rows each has, and for each row whether all members have it in common.
    pub rows: Vec<(String, Vec<bool>)>,
    /// Sampled inputs, and whether all members have all samples in common.
    pub tables: Vec<(String, bool)>,
    /// The rates of a user's own system, whose parameters and inputs these are.
    pub equations: Option<Arc<Equations>>,
    /// Quantities whose changes of sign are noticed, each with its direction as its name.
    pub watched: Option<Arc<Equations>>,
    /// The computation of a sampled controller: the parameters that it sets, and its next state.
    pub controller: Option<Arc<Equations>>,
}

fn find<'a, T>(list: &'a [(String, T)], name: &str) -> Option<&'a T> {
    list.iter().find(|(known, _)| known == name).map(|(_, value)| value)
}

impl Signature {
    /// The choice of that name; empty if none was made.
    pub(crate) fn word(&self, name: &str) -> &str {
        find(&self.words, name).map_or("", String::as_str)
    }

    /// The whole number of that name; zero if it was not given.
    pub(crate) fn whole(&self, name: &str) -> usize {
        find(&self.wholes, name).copied().unwrap_or(0)
    }

    /// The list of whole numbers of that name; empty if it was not given.
    pub(crate) fn list(&self, name: &str) -> &[u32] {
        find(&self.lists, name).map_or(&[], |list| list)
    }

    /// How many rows the parameter of that name has; zero if it was not given.
    pub fn count(&self, name: &str) -> usize {
        find(&self.rows, name).map_or(0, Vec::len)
    }

    /// An error unless the parameter of that name has `expected` rows.
    pub(crate) fn expect(&self, what: &'static str, expected: usize) -> Result<(), Error> {
        let got = self.count(what);
        if got == expected { Ok(()) } else { Err(Error::Shape { what, expected, got }) }
    }

    /// Whether anything of that name was given: a parameter, or an input of any kind.
    pub(crate) fn has(&self, name: &str) -> bool {
        let table = |name: &str| find(&self.tables, name).is_some();
        self.count(name) > 0 || table(name) || table(&format!("{name}.0")) || self.count(&format!("{name}.amplitude")) > 0
    }

    /// How many rows of parameters there are in all.
    pub fn parameters(&self) -> usize {
        self.rows.iter().map(|(_, rows)| rows.len()).sum::<usize>()
    }

    /// The place of a parameter's first row among all.
    pub fn place(&self, name: &str) -> Option<usize> {
        let at = self.rows.iter().position(|(known, _)| known == name)?;
        Some(self.rows[..at].iter().map(|(_, rows)| rows.len()).sum::<usize>())
    }

    /// Whether all members have a row of parameters in common.
    pub(crate) fn is_common(&self, row: u32) -> bool {
        self.rows.iter().flat_map(|(_, rows)| rows).nth(row as usize).copied().unwrap_or(false)
    }

    /// Whether all members have a sampled input in common.
    pub(crate) fn is_common_table(&self, table: u32) -> bool {
        self.tables.get(table as usize).is_some_and(|(_, common)| *common)
    }

    /// The error for a choice that the system does not know.
    pub(crate) fn unknown(&self, name: &str) -> Error {
        Error::Options { system: self.system.clone(), options: format!("{name} = {:?}", self.word(name)) }
    }
}

/// A system with its parameters and inputs.
#[derive(Clone, Debug, Default)]
pub struct Spec<'a> {
    /// Names and counts.
    pub signature: Arc<Signature>,
    /// The rows of all parameters, in the order of the signature.
    pub rows: Vec<Row<'a>>,
    /// The sampled inputs, likewise.
    pub tables: Vec<Table<'a>>,
}

impl Spec<'_> {
    /// Whether all members have everything in common.
    pub(crate) fn is_common(&self) -> bool {
        self.rows.iter().chain(self.tables.iter().flat_map(|table| &table.samples)).all(Row::is_common)
    }
}

/// The numbers of one member, by name: what a system is made of.
pub struct Parameters<'a, N: Number> {
    /// Names and counts.
    pub signature: &'a Signature,
    /// The step.
    pub h: N,
    /// All parameters, in the order of the signature.
    pub numbers: Vec<N>,
    /// A sampled input, by its number, at a time.
    pub sample: fn(u32, N) -> N,
}

impl<N: Number> Parameters<'_, N> {
    /// A parameter of one number that is surely given; a NaN if it is not.
    pub(crate) fn number(&self, name: &str) -> N {
        self.maybe(name).unwrap_or_else(|| N::of(f64::NAN))
    }

    /// A parameter of one number, if it was given.
    pub(crate) fn maybe(&self, name: &str) -> Option<N> {
        self.numbers(name).first().copied()
    }

    /// A parameter of several numbers; none if it was not given.
    pub(crate) fn numbers(&self, name: &str) -> &[N] {
        let Some(first) = self.signature.place(name) else { return &[] };
        &self.numbers[first..first + self.signature.count(name)]
    }

    /// The input of that name, if it was given.
    pub(crate) fn signal(&self, name: &str) -> Option<crate::model::signal::Signal<N>> {
        use crate::model::signal::Signal;
        if let Some(value) = self.maybe(name) {
            return Some(Signal::Constant(value));
        }
        if let Some(table) = self.signature.tables.iter().position(|(known, _)| known == name) {
            return Some(Signal::Held { table: table as u32, sample: self.sample, factor: None });
        }
        if let Some(table) = self.signature.tables.iter().position(|(known, _)| *known == format!("{name}.0")) {
            let is_next =
                |k: &usize| self.signature.tables.get(table + k).is_some_and(|(known, _)| *known == format!("{name}.{k}"));
            let degree = (1..).take_while(is_next).count() as u32;
            return Some(Signal::Curve { table: table as u32, degree, sample: self.sample, factor: None });
        }
        let part = |part: &str| self.maybe(&format!("{name}.{part}"));
        let (amplitude, omega, phase) = (part("amplitude")?, part("omega")?, part("phase")?);
        Some(Signal::Sine { amplitude, omega, phase })
    }
}
