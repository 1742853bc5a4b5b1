//! The core without Python: runs, errors, interruption, divergence.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

use proptest::prelude::*;
use stepwell_core::{
    batch::{Arrays, Plan, run, saves},
    error::Error,
    group::{Clock, Row, Spec, Table},
    isa::Level,
    table::{Model, RECORDS},
    world::World,
};

fn clock(h: f64) -> Clock {
    Clock { t0: 0.0, h, start: 0, level: Level::choose().unwrap(), threads: 1 }
}

fn oscillators<'a>(omega: &'a [f64], method: &'a str) -> Model<'a> {
    let spec = Spec { system: "oscillator", options: vec!["canonical"], rows: vec![Row(omega)], ..Spec::default() };
    Model::Direct { spec, method }
}

fn plan<'a>(model: Model<'a>, h: f64, steps: i64, members: usize, threads: usize) -> Plan<'a> {
    let (v, y) = (vec![Row(&[0.0])], vec![Row(&[1.0])]);
    Plan { model, clock: clock(h), first: 0, steps, every: None, v, y, members, threads, carried: false, carries: false }
}

type Last = (Vec<f64>, Vec<f64>, Vec<i64>);

/// The last v and y from v = 0 and y = 1, and who diverged when.
fn last(plan: &Plan) -> Result<Last, Error> {
    let (mut v, mut y, mut bad) = (vec![0.0; plan.members], vec![0.0; plan.members], vec![-1; plan.members]);
    let arrays =
        Arrays { saved_v: &mut v, saved_y: &mut y, recorded: &mut [], tally: &mut [], carry: &mut [], first_bad: &mut bad };
    run(plan, arrays, &mut |_| true)?;
    Ok((v, y, bad))
}

#[test]
fn false_euler_is_its_formula() {
    let omega: Vec<f64> = (0..203).map(|i| 0.5 + f64::from(i) / 100.0).collect();
    let (v, y, bad) = last(&plan(oscillators(&omega, "false_euler"), 0.1, 500, 203, 1)).unwrap();
    for (i, omega) in omega.iter().enumerate() {
        let (mut a, mut b) = (0.0, 1.0);
        for _ in 0..500 {
            a += -((0.1 * omega) * b);
            b += (0.1 * omega) * a;
        }
        assert_eq!((v[i], y[i], bad[i]), (a, b, -1), "member {i}");
    }
}

#[test]
fn every_method_is_the_same_for_every_number_of_threads() {
    let omega: Vec<f64> = (0..1003).map(|i| 0.5 + f64::from(i) / 400.0).collect();
    for record in RECORDS {
        let one = last(&plan(oscillators(&omega, record.name), 1.0, 400, 1003, 1)).unwrap();
        let five = last(&plan(oscillators(&omega, record.name), 1.0, 400, 1003, 5)).unwrap();
        let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!((bits(&one.0), bits(&one.1), &one.2), (bits(&five.0), bits(&five.1), &five.2), "{}", record.name);
    }
}

#[test]
fn a_batch_of_any_size_is_its_members() {
    // Wide groups of 192 lanes, three members abreast, narrow ones of 8, one or several after another: sizes on both sides of each.
    let omega: Vec<f64> = (0..385).map(|i| 0.5 + f64::from(i) / 200.0).collect();
    let parameters: Vec<&[f64]> = vec![&omega, &[0.2], &[0.7], &[1.1], &[0.3]];
    let pendulums = |members: usize| {
        let rows = parameters.iter().map(|x| Row(&x[..x.len().min(members)])).collect();
        let spec = Spec { system: "pendulum", options: vec!["damped", "sine"], rows, ..Spec::default() };
        Model::Direct { spec, method: "rk4" }
    };
    let (v, y, _) = last(&plan(pendulums(385), 0.1, 50, 385, 1)).unwrap();
    for members in [1, 2, 7, 8, 9, 16, 17, 31, 32, 33, 64, 191, 192, 193, 200, 224, 225, 384] {
        let (some_v, some_y, _) = last(&plan(pendulums(members), 0.1, 50, members, 1)).unwrap();
        assert_eq!((&some_v[..], &some_y[..]), (&v[..members], &y[..members]), "{members} members");
    }
}

#[test]
fn the_first_bad_step_is_exact_on_both_sides_of_a_look() {
    // Steps 1023, 1024 and 1025 stand around the first look; growth is chosen so that members overflow there.
    let omega: Vec<f64> = (0..400).map(|i| 2.10 + f64::from(i) * 2e-4).collect();
    let (_, _, bad) = last(&plan(oscillators(&omega, "false_euler"), 1.0, 3000, 400, 1)).unwrap();
    assert!(bad.contains(&1024) && bad.contains(&1025));
    for (omega, bad) in omega.iter().zip(&bad) {
        for steps in [bad - 1, *bad] {
            let (v, y, _) = last(&plan(oscillators(&[*omega], "false_euler"), 1.0, steps, 1, 1)).unwrap();
            assert_eq!(v[0].is_finite() && y[0].is_finite(), steps < *bad);
        }
    }
}

#[test]
fn a_monitor_that_says_no_ends_the_run() {
    for threads in [1, 2] {
        let omega = vec![1.0; 1000];
        let plan = plan(oscillators(&omega, "rk4"), 0.1, 1_000_000_000, 1000, threads);
        let (mut v, mut y, mut bad) = (vec![0.0; 1000], vec![1.0; 1000], vec![-1; 1000]);
        let arrays =
            Arrays { saved_v: &mut v, saved_y: &mut y, recorded: &mut [], tally: &mut [], carry: &mut [], first_bad: &mut bad };
        let mut shares = Vec::new();
        let mut monitor = |share: f64| {
            shares.push(share);
            shares.len() < 3
        };
        assert_eq!(run(&plan, arrays, &mut monitor), Err(Error::Interrupted));
        assert!(shares.len() >= 3 && shares.is_sorted() && shares.iter().all(|s| (0.0..=1.0).contains(s)));
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let error = |model: Model, members: usize| last(&plan(model, 0.1, 1, members, 1)).unwrap_err().to_string();
    assert!(error(oscillators(&[1.0], "rk5"), 1).starts_with("there is no method \"rk5\"; known: damped_euler, "));
    assert_eq!(error(oscillators(&[1.0, 2.0], "rk4"), 3), "a parameter: expected 3, got 2");
    let spec = Spec { system: "spring", ..Spec::default() };
    let model = Model::Direct { spec, method: "rk4" };
    assert_eq!(
        error(model, 1),
        "there is no system \"spring\"; known: chain, linear, nbody, oscillator, pendulum, restricted_three_body"
    );
    let spec = Spec { system: "oscillator", options: vec!["canonical", "damped"], ..Spec::default() };
    let model = Model::Direct { spec, method: "verlet" };
    assert_eq!(error(model, 1), "verlet needs forces that do not depend on the velocity, but oscillator has damping");
}

#[test]
fn a_world_in_pieces_is_a_run() {
    let omega: Vec<f64> = (0..91).map(|i| 0.5 + f64::from(i) / 100.0).collect();
    for record in RECORDS {
        let model = oscillators(&omega, record.name);
        let carries = record.carry.is_some();
        let (mut v, mut y) = (vec![0.0; 91], vec![1.0; 91]);
        let mut world = World::new(&model, clock(0.1), 91, carries, 0).unwrap();
        for n in [1, 0, 40, 59] {
            world.step(n, &mut v, &mut y);
        }
        let mut whole = plan(model, 0.1, 100, 91, 1);
        whole.carries = carries;
        let (sv, sy, _) = last(&whole).unwrap();
        assert_eq!((v, y), (sv, sy), "{}", record.name);
        assert_eq!((world.step_number(), world.time()), (100, 100.0 * 0.1));
    }
}

#[test]
fn kept_steps() {
    let kept = |steps, every| saves(steps, every).collect::<Vec<_>>();
    assert_eq!(kept(10, None), [10]);
    assert_eq!(kept(10, Some(1)).len(), 11);
    assert_eq!(kept(10, Some(3)), [0, 3, 6, 9, 10]);
    assert_eq!(kept(9, Some(3)), [0, 3, 6, 9]);
    assert_eq!(kept(2, Some(7)), [0, 2]);
}

proptest! {
    /// A held input gives sample k at t0 + k·h for every k, however h and t0 round, and holds in between.
    #[test]
    fn every_sample_is_found(h in 1e-6..1e3f64, n in 1usize..200, later in 0.0..0.999f64) {
        let values: Vec<[f64; 1]> = (0..n).map(|i| [i as f64]).collect();
        let samples = values.iter().map(|v| Row(v)).collect();
        let table = Table { samples, start: 0.0, interval: h };
        let held = stepwell_core::tile::Samples::<2>::new(&table, |_| 1.0, |_| 0);
        for k in 0..n {
            let t = k as f64 * h;
            prop_assert_eq!(held.view().at(t), &[k as f64; 2]);
            prop_assert_eq!(held.view().at(t + later * h), &[k as f64; 2]);
        }
        prop_assert_eq!(held.view().at(-h), &[0.0; 2]);
        prop_assert_eq!(held.view().at(h * (n as f64 + 5.0)), &[(n - 1) as f64; 2]);
    }
}
