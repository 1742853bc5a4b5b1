//! The core without Python: runs, errors, interruption, divergence.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod common;

use common::{Of, model, oscillators, spec};
use proptest::prelude::*;
use stepwell_core::{
    error::Error,
    isa::{Level, UnknownLevel},
    model::{
        spec::{Row, Spec, Table},
        steppers::RECORDS,
    },
    run::{
        Model,
        fixed::{Arrays, FixedRun, Steppable, kept, run, save},
        world::World,
    },
    stage::{Clock, Machine, PreparedStage, Stage},
    tape::{Op, Tape, split::split},
};

fn clock(h: f64) -> Clock {
    Clock { t0: 0.0, h }
}

fn machine(threads: usize) -> Machine {
    Machine { level: Level::choose().unwrap(), threads }
}

fn plan(model: Model<'_>, h: f64, steps: i64, members: usize, threads: usize) -> FixedRun<'_> {
    let (v, y) = (vec![Row(&[0.0])], vec![Row(&[1.0])]);
    FixedRun {
        model,
        clock: clock(h),
        machine: machine(threads),
        first: 0,
        steps,
        every: None,
        v,
        y,
        members,
        carried: false,
        own: members,
        events: None,
    }
}

type Last<T = f64> = (Vec<T>, Vec<T>, Vec<i64>);

/// The last v and y from v = 0 and y = 1, and the steps at which members diverged.
fn last(plan: &FixedRun) -> Result<Last, Error> {
    last_of(plan)
}

/// The last v and y and the steps at which members diverged, in either precision.
fn last_of<T: Steppable>(plan: &FixedRun) -> Result<Last<T>, Error> {
    let [mut v, mut y] = [(); 2].map(|()| vec![T::of(0.0); plan.members]);
    let mut bad = vec![-1; plan.members];
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
    // Tiles of several interleaved vectors, narrow ones of one vector, and single members, one or several after another: sizes
    // around each.
    let omega: Vec<f64> = (0..385).map(|i| 0.5 + f64::from(i) / 200.0).collect();
    let pendulums = |members: usize| driven_pendulums(&omega[..members]);
    let (v, y, _) = last(&plan(pendulums(385), 0.1, 50, 385, 1)).unwrap();
    let whole = pendulums(385);
    let tile = |members: usize| whole.lanes::<f64>(&whole.traced().unwrap(), machine(1), members, 1e9).unwrap();
    let edges = [tile(385), tile(8)].into_iter().flat_map(|tile| [tile - 1, tile, tile + 1, 2 * tile + 1]);
    let sizes = [1, 2, 7, 8, 9, 16, 17, 31, 32, 33, 64, 191, 192, 193, 200, 224, 225, 384];
    for members in sizes.into_iter().chain(edges).filter(|members| (1..=385).contains(members)) {
        let (some_v, some_y, _) = last(&plan(pendulums(members), 0.1, 50, members, 1)).unwrap();
        assert_eq!((&some_v[..], &some_y[..]), (&v[..members], &y[..members]), "{members} members");
    }
}

/// Sines of the state of each member, and one of the time that all share.
fn driven_pendulums(omega: &[f64]) -> Model<'_> {
    let one = |x: &'static f64| vec![Row(std::slice::from_ref(x))];
    let rows = [
        ("omega", vec![Row(omega)]),
        ("damping", one(&0.2)),
        ("a.amplitude", one(&0.7)),
        ("a.omega", one(&1.1)),
        ("a.phase", one(&0.3)),
    ];
    model(spec("pendulum", Of { rows: &rows, ..Of::default() }), "rk4")
}

#[test]
fn machine_code_has_the_bits_of_the_interpreter_in_both_precisions() {
    fn compare<T: Steppable>() {
        let omega: Vec<f64> = (0..101).map(|i| 0.5 + f64::from(i) / 50.0).collect();
        let steps = 1000; // of which the last are made by machine code, even of a single member
        let at = |level: Level, members: usize, fused: bool| {
            let mut plan = plan(driven_pendulums(&omega[..members]), 0.1, steps, members, 1);
            plan.machine.level = level;
            (plan.model.key.precision, plan.model.key.fused) = (T::PRECISION, fused);
            last_of::<T>(&plan).unwrap()
        };
        for fused in [false, true] {
            let (v, y, _) = at(Level::Baseline, 101, fused);
            assert!(v.iter().all(|v| v.wide().abs() < 10.0) && v[0] != v[1]);
            for level in Level::available() {
                for members in [1, 2, 5, 101] {
                    let (some_v, some_y, bad) = at(level, members, fused);
                    assert_eq!((&some_v[..], &some_y[..]), (&v[..members], &y[..members]), "{level:?}, {members} members");
                    assert!(bad.iter().all(|step| *step == -1));
                }
            }
        }
    }
    compare::<f64>();
    compare::<f32>();
}

#[test]
fn the_first_bad_step_is_exact() {
    // Growth is chosen so that members overflow at steps 1024 and 1025, among others.
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
    assert!(error(oscillators(&[1.0], "rk5"), 1).starts_with("there is no method \"rk5\"; known: backward_euler, "));
    assert_eq!(error(oscillators(&[1.0, 2.0], "rk4"), 3), "a parameter: expected 3, got 2");
    assert!(error(model(spec("spring", Of::default()), "rk4"), 1).starts_with("there is no system \"spring\"; known: chain, "));
    let rows = [("omega", vec![Row(&[1.0])]), ("damping", vec![Row(&[0.1])])];
    let model = model(spec("oscillator", Of { words: &[("form", "canonical")], rows: &rows, ..Of::default() }), "verlet");
    assert_eq!(error(model, 1), "verlet needs forces that do not depend on the velocity, but oscillator has damping");
}

#[test]
fn a_world_in_pieces_is_a_run() {
    let omega: Vec<f64> = (0..91).map(|i| 0.5 + f64::from(i) / 100.0).collect();
    for record in RECORDS {
        let model = oscillators(&omega, record.name);
        let (mut v, mut y) = (vec![0.0; 91], vec![1.0; 91]);
        let mut world = World::new(&model, clock(0.1), machine(1), 91, 0).unwrap();
        for n in [1, 0, 40, 59] {
            world.step(n, &mut v, &mut y);
        }
        let (sv, sy, _) = last(&plan(model, 0.1, 100, 91, 1)).unwrap();
        assert_eq!((v, y), (sv, sy), "{}", record.name);
        assert_eq!((world.step_number(), world.time()), (100, 100.0 * 0.1));
    }
}

#[test]
fn kernels_are_chosen_by_name() {
    let named = |name: &str| Level::named(Some(name.as_ref()));
    let best = Level::available().last().copied().unwrap();
    assert_eq!(Level::named(None), Ok(best));
    assert_eq!(named(""), Ok(best));
    for level in Level::available() {
        assert_eq!(named(level.name()), Ok(level));
    }
    let known = Level::available().into_iter().map(Level::name).collect::<Vec<_>>().join(", ");
    for name in ["baseline", "avx1024", "Interpret"] {
        assert_eq!(named(name), Err(UnknownLevel { name: name.to_owned(), known: known.clone() }));
    }
}

#[test]
fn accepted_steps() {
    let kept = |steps, every| (0..kept(steps, every)).map(|i| save(steps, every, i)).collect::<Vec<_>>();
    assert_eq!(kept(10, None), [10]);
    assert_eq!(kept(10, Some(1)).len(), 11);
    assert_eq!(kept(10, Some(3)), [0, 3, 6, 9, 10]);
    assert_eq!(kept(9, Some(3)), [0, 3, 6, 9]);
    assert_eq!(kept(2, Some(7)), [0, 2]);
}

/// A stage whose state is, after a step, the sampled input 0 at that step's time; or, `own`, at the time that the member has in
/// its second number.
fn sampled(common: bool, own: bool) -> Stage {
    let mut tape = Tape::default();
    let time = tape.push(if own { Op::State(1) } else { Op::Time });
    let sample = tape.push(Op::Sample(0, time));
    let next = if own { vec![sample, time] } else { vec![sample] };
    Stage::new(split(&tape, &next, &|_| true, &|_| common))
}

const LANES: usize = 8;

/// The samples that members find: `rows` holds one number for all or one each, `t0` is the time of step 0, and `own` says that
/// members are at times of their own. What a step and its time give.
fn found(rows: &[Vec<f64>], h: f64, own: bool, t0: f64, steps: std::ops::RangeInclusive<i64>) -> Vec<(i64, Vec<f64>)> {
    let table = Table { samples: rows.iter().map(|row| Row(row)).collect(), start: 0.0, interval: h };
    let spec = Spec { tables: vec![table], ..Spec::default() };
    let (stage, clock) = (sampled(rows[0].len() == 1, own), Clock { t0, h });
    let mut prepared = PreparedStage::new(&stage, &spec, Level::Baseline, 8, &clock, 0.0);
    assert_eq!(prepared.lanes(), LANES);
    prepared.prepare(&stage, &spec, 0, LANES);
    let step = |k: i64| {
        let mut state = vec![-1.0; LANES];
        state.extend(vec![clock.at(k); if own { LANES } else { 0 }]);
        prepared.advance(&stage, &clock, k, 1, &mut state);
        (k, state[..LANES].to_vec())
    };
    steps.map(step).collect()
}

proptest! {
    /// A held input gives sample k at t0 + k·h for every k, however h and t0 round, and holds in between: whether members have it
    /// in common or not, and whether they are at the same time or not.
    #[test]
    fn every_sample_is_found(h in 1e-6..1e3f64, n in 1usize..200, later in 0.0..0.999f64) {
        for (width, own) in [(1, false), (LANES, false), (1, true), (LANES, true)] {
            let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..width).map(|l| (i + 1000 * l) as f64).collect()).collect();
            let expected = |i: usize| (0..LANES).map(|l| rows[i][l.min(width - 1)]).collect::<Vec<f64>>();
            let last = n as i64 - 1;
            for t0 in [0.0, later * h] {
                for (k, got) in found(&rows, h, own, t0, -1..=last + 6) {
                    prop_assert_eq!(got, expected(k.clamp(0, last) as usize), "step {} at {:e} from {:e}", k, h, t0);
                }
            }
        }
    }
}
