//! Models of the core, by names and numbers.

use stepwell_core::{
    model::spec::{Row, Signature, Spec, Table},
    run::Model,
    step::key::{StepKind, TapeKey},
    tape::real::Precision,
};

/// The options, parameters and inputs of a system.
#[derive(Default)]
pub(crate) struct Of<'a, 'b> {
    pub words: &'b [(&'b str, &'b str)],
    pub wholes: &'b [(&'b str, usize)],
    pub rows: &'b [(&'b str, Vec<Row<'a>>)],
    pub tables: Vec<(&'b str, Table<'a>)>,
}

pub(crate) fn spec<'a>(system: &str, of: Of<'a, '_>) -> Spec<'a> {
    let commons = |rows: &[Row]| rows.iter().map(Row::is_common).collect::<Vec<bool>>();
    let signature = Signature {
        system: system.to_owned(),
        words: of.words.iter().map(|(name, word)| (name.to_string(), word.to_string())).collect(),
        wholes: of.wholes.iter().map(|(name, whole)| (name.to_string(), *whole)).collect(),
        lists: Vec::new(),
        rows: of.rows.iter().map(|(name, rows)| (name.to_string(), commons(rows))).collect(),
        tables: of.tables.iter().map(|(name, t)| (name.to_string(), t.samples.iter().all(Row::is_common))).collect(),
        equations: None,
        watched: None,
        controller: None,
    };
    let rows = of.rows.iter().flat_map(|(_, rows)| rows.clone()).collect();
    Spec { signature: signature.into(), rows, tables: of.tables.into_iter().map(|(_, table)| table).collect() }
}

/// A system stepped by a method.
pub(crate) fn model<'a>(spec: Spec<'a>, method: &str) -> Model<'a> {
    let how = StepKind::Method { name: method.to_owned(), choice: 0 };
    Model {
        key: TapeKey { signature: spec.signature.clone(), how, record: Vec::new(), fused: false, precision: Precision::Double },
        spec,
    }
}

/// Free oscillators in canonical form.
pub(crate) fn oscillators<'a>(omega: &'a [f64], method: &str) -> Model<'a> {
    model(
        spec("oscillator", Of { words: &[("form", "canonical")], rows: &[("omega", vec![Row(omega)])], ..Of::default() }),
        method,
    )
}
