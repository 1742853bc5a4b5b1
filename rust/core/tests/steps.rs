//! Methods and systems: what they ask for, and that a step over numbers and the tape of a step over symbols are the same.

use stepwell_core::{
    method::{self, Needs},
    steppers::RECORDS,
};

/// Evaluations of each method, and the times within a step at which they are made.
fn asked() -> Vec<(&'static str, usize, Vec<f64>)> {
    let (xi, chi) = (0.178_617_895_844_809_1, -0.066_264_582_669_818_5);
    let fehlberg = vec![0.0, 0.25, 0.375, 0.5, 12.0 / 13.0, 1.0];
    vec![
        ("damped_euler", 1, vec![0.0]),
        (
            "dop853",
            12,
            vec![
                0.0,
                0.05260015195876773,
                0.0789002279381516,
                0.1183503419072274,
                0.25,
                0.2816496580927726,
                4.0 / 13.0,
                1.0 / 3.0,
                0.6,
                127.0 / 195.0,
                6.0 / 7.0,
                1.0,
            ],
        ),
        ("false_euler", 1, vec![0.0]),
        ("false_heun", 2, vec![0.0, 1.0]),
        ("fehlberg", 6, fehlberg.clone()),
        ("fehlberg_5", 6, fehlberg),
        ("leapfrog", 1, vec![0.0]),
        ("merson", 5, vec![0.0, 1.0 / 3.0, 0.5, 1.0]),
        ("pefrl", 4, vec![xi + chi, xi, 1.0 - xi, 1.0 - (xi + chi)]),
        ("rk4", 4, vec![0.0, 0.5, 1.0]),
        ("semi_false_heun", 2, vec![0.0, 1.0]),
        ("standard_euler", 1, vec![0.0]),
        ("standard_heun", 2, vec![0.0, 1.0]),
        ("verlet", 1, vec![0.0]),
    ]
}

#[test]
fn methods_ask_as_often_and_when_they_should() {
    assert_eq!(asked().len(), RECORDS.len());
    for (name, evaluations, nodes) in asked() {
        let record = method::record(name).unwrap();
        let program = record.program();
        assert_eq!((program.evaluations(), program.nodes(record.needs == Needs::Rates)), (evaluations, nodes), "{name}");
    }
}

#[test]
fn an_estimate_asks_for_no_more_rates() {
    for record in RECORDS {
        if let Some(attempt) = record.attempt() {
            assert_eq!(attempt.evaluations(), record.program().evaluations(), "{}", record.name);
        }
    }
}
