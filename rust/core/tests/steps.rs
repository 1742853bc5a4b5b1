//! Methods and systems: what they ask for, and that a step over numbers and the tape of a step over symbols are the same.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::sync::Arc;

use nalgebra::DVector;
use stepwell_core::{
    bodies,
    error::Error,
    model::{
        around::{
            self,
            contact::{self, Contacts},
        },
        method::Needs,
        methods::{Method, method},
        spec::{Parameters, Signature},
        steppers::RECORDS,
        system::{Make, Shape, System},
        systems::{self, KINDS},
    },
    tape::{
        Counts, Id, Op, Tape,
        equations::{Equations, Invariant},
        eval,
        number::{Number, Symbol, record},
    },
};

/// Evaluations of each method, and the times within a step at which they are made.
fn asked() -> Vec<(&'static str, usize, Vec<f64>)> {
    let (xi, chi) = (0.178_617_895_844_809_1, -0.066_264_582_669_818_5);
    let fehlberg = vec![0.0, 0.25, 0.375, 0.5, 12.0 / 13.0, 1.0];
    vec![
        ("backward_euler", 3, vec![1.0]),
        ("bs32", 3, vec![0.0, 0.5, 0.75]),
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
        ("dopri5", 6, vec![0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0]),
        ("false_euler", 1, vec![0.0]),
        ("false_heun", 2, vec![0.0, 1.0]),
        // The stage in the middle counts only in the estimate.
        ("fehlberg", 5, fehlberg.iter().copied().filter(|node| *node != 0.5).collect()),
        ("fehlberg_5", 6, fehlberg),
        ("implicit_midpoint", 3, vec![0.5]),
        ("leapfrog", 1, vec![0.0]),
        ("linearly_implicit_euler", 1, vec![1.0]),
        ("merson", 5, vec![0.0, 1.0 / 3.0, 0.5, 1.0]),
        ("pefrl", 4, vec![xi + chi, xi, 1.0 - xi, 1.0 - (xi + chi)]),
        ("rk4", 4, vec![0.0, 0.5, 1.0]),
        ("rodas4", 6, vec![0.0, 0.21, 0.386, 0.63, 1.0]),
        (
            "rodas5p",
            8,
            vec![0.0, 0.409_579_839_339_753_5, 0.428_840_360_955_866_4, 0.635_812_689_582_870_4, 0.976_930_672_506_071_6, 1.0],
        ),
        ("rosenbrock23", 2, vec![0.0, 0.5]),
        ("semi_false_heun", 2, vec![0.0, 1.0]),
        ("standard_euler", 1, vec![0.0]),
        ("standard_heun", 2, vec![0.0, 1.0]),
        ("taylor", 8, vec![0.0]),
        ("trapezoidal", 4, vec![0.0, 1.0]),
        ("tsit5", 6, vec![0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0]),
        ("verlet", 1, vec![0.0]),
        ("vern7", 9, vec![0.0, 0.005, 0.10888888888888888, 0.16333333333333333, 0.4555, 0.6095094489978381, 0.884, 0.925, 1.0]),
        (
            "vern9",
            15,
            vec![
                0.0,
                0.03462,
                0.06757,
                0.09702435063878044,
                0.14553652595817068,
                0.229007911590485,
                0.25,
                0.48375,
                0.544992088409515,
                0.561,
                0.645,
                0.6590650618730999,
                0.8206,
                0.9012,
                1.0,
            ],
        ),
        ("wisdom_holman", 1, vec![0.0]),
    ]
}

#[test]
fn methods_ask_as_often_and_when_they_should() {
    assert_eq!(asked().len(), RECORDS.len());
    for (name, evaluations, nodes) in asked() {
        let record = method(name).unwrap();
        let program = record.program();
        assert_eq!((program.evaluations(), program.nodes(record.needs == Needs::Rates)), (evaluations, nodes), "{name}");
    }
}

#[test]
fn an_estimate_asks_for_one_more_rate_where_a_stage_counts_in_it_alone() {
    for record in RECORDS {
        if let Some(attempt) = record.attempt() {
            let with_such_a_stage = ["bs32", "dopri5", "fehlberg", "rosenbrock23", "tsit5", "vern7", "vern9"];
            let more = usize::from(with_such_a_stage.contains(&record.name));
            assert_eq!(attempt.evaluations(), record.program().evaluations() + more, "{}", record.name);
        }
    }
}

#[test]
fn a_program_has_no_entry_of_which_nothing_is_made() {
    let programs = RECORDS.iter().flat_map(|record| {
        let slots = (0..2).flat_map(|choice| [record.start(choice), record.finish(choice)]);
        [Some(record.program()), record.attempt()].into_iter().chain(slots).flatten()
    });
    for program in programs {
        let read: Vec<_> = program.entries.iter().flat_map(|entry| entry.operands()).chain(program.results.clone()).collect();
        let unread = (2..program.entries.len()).filter(|i| read.iter().all(|block| block.index() != *i));
        assert_eq!(unread.count(), 0, "{program:?}");
        // What an entry reads was made before it.
        assert!(program.entries.iter().enumerate().all(|(i, entry)| entry.operands().iter().all(|block| block.index() < i)));
    }
}

/// The signature of a system: words and whole numbers, numbers of rows, sampled inputs, all by name.
fn signature(
    system: &str,
    words: &[(&str, &str)],
    wholes: &[(&str, usize)],
    rows: &[(&str, usize)],
    tables: &[&str],
) -> Signature {
    Signature {
        system: system.to_owned(),
        words: words.iter().map(|(name, word)| (name.to_string(), word.to_string())).collect(),
        wholes: wholes.iter().map(|(name, whole)| (name.to_string(), *whole)).collect(),
        lists: Vec::new(),
        rows: rows.iter().map(|(name, count)| (name.to_string(), vec![true; *count])).collect(),
        tables: tables.iter().map(|name| (name.to_string(), true)).collect(),
        equations: None,
        watched: None,
        controller: None,
    }
}

fn bodies(n: usize, dim: usize, force: &str, control: &[(&str, &str)]) -> Signature {
    let mut words = vec![("force", force)];
    words.extend(control);
    let mut rows = vec![("masses", n), ("strength", n), ("softening", 1)];
    match control.first() {
        Some((_, "energy")) => rows.extend([("control.gain", 1), ("control.target", 1)]),
        Some(_) => rows.push(("control.target", 1)),
        None => {}
    }
    signature("nbody", &words, &[("dim", dim)], &rows, &[])
}

/// Bodies, some of which have no mass.
fn with_massless(n: usize, massless: &[u32], dim: usize, force: &str, control: &[(&str, &str)]) -> Signature {
    Signature { lists: vec![("massless".to_owned(), massless.into())], ..bodies(n, dim, force, control) }
}

const SINE_A: [(&str, usize); 3] = [("a.amplitude", 1), ("a.omega", 1), ("a.phase", 1)];
const CONTROLS: [[(&str, &str); 2]; 4] = [
    [("control", "energy"), ("control.form", "limited")],
    [("control", "energy"), ("control.form", "printed")],
    [("control", "projection"), ("control.way", "scaling")],
    [("control", "projection"), ("control.way", "nacozy")],
];

/// A net in `dim` dimensions: a lattice of rows of particles side by side, whose springs lie in runs, and some springs across,
/// which do not. The first particle is fixed if there is more than one row.
fn net(rows: usize, columns: usize, dim: usize, numbers: &[(&str, usize)], control: &[(&str, &str)]) -> Signature {
    let n = rows * columns;
    let mut pairs: Vec<[usize; 2]> = (0..n).filter(|i| i % columns + 1 < columns).map(|i| [i, i + 1]).collect();
    pairs.extend((columns..n).map(|i| [i, i - columns]));
    pairs.extend((2..n / 2).step_by(3).map(|i| [n - i, i / 2]));
    let fixed = if rows > 1 { vec![0] } else { Vec::new() };
    let mut parameters = vec![("masses", 1), ("stiffness", 1), ("rest", 1)];
    for (name, count) in numbers {
        parameters.retain(|(known, _)| known != name);
        parameters.push((name, if *count == 0 { pairs.len() } else { *count }));
    }
    match control.first() {
        Some((_, "energy")) => parameters.extend([("control.gain", 1), ("control.target", 1)]),
        Some(_) => parameters.push(("control.target", 1)),
        None => {}
    }
    let list = |numbers: Vec<usize>| numbers.into_iter().map(|number| number as u32).collect();
    let lists = vec![("pairs".to_owned(), list(pairs.concat())), ("fixed".to_owned(), list(fixed))];
    Signature { lists, ..signature("springs", control, &[("n", n), ("dim", dim)], &parameters, &[]) }
}

/// Nets of springs: a pair, and those of every kind; 0 stands for as many numbers as there are springs.
fn nets() -> Vec<Signature> {
    let damped = [("masses", 12), ("stiffness", 0), ("rest", 0), ("damping", 0), ("gravity", 3), ("drag", 12)];
    vec![
        net(1, 2, 1, &[], &[]),
        net(1, 4, 2, &[("damping", 1)], &[]),
        net(3, 4, 3, &damped, &[]),
        net(2, 6, 3, &damped[..3], &[]),
        net(3, 4, 2, &[("masses", 12), ("gravity", 2)], &[]),
        net(2, 11, 2, &[("drag", 1), ("rest", 0)], &[]),
    ]
}

/// Systems of every kind, in every form.
fn systems() -> Vec<Signature> {
    let mut all = Vec::new();
    for form in ["canonical", "physical"] {
        let oscillator = |rows: &[(&str, usize)], tables: &[&str]| signature("oscillator", &[("form", form)], &[], rows, tables);
        all.push(oscillator(&[("omega", 1)], &[]));
        all.push(oscillator(&[("omega", 1), ("damping", 1)], &[]));
        all.push(oscillator(&[("omega", 1), ("x", 1)], &["a"]));
        all.push(oscillator(&[&[("omega", 1), ("damping", 1)], &SINE_A[..]].concat(), &["x"]));
    }
    all.push(signature("pendulum", &[], &[], &[("omega", 1)], &[]));
    all.push(signature("pendulum", &[], &[], &[("omega", 1), ("damping", 1), ("a", 1)], &[]));
    all.push(signature("pendulum", &[], &[], &[&[("omega", 1)], &SINE_A[..]].concat(), &[]));
    let points = [("masses", 2), ("gravity", 2)];
    let plane = [("contact_0_normal", 2), ("contact_0_offset", 1), ("contact_0_restitution", 1), ("contact_0_friction", 1)];
    all.push(signature("particles", &[], &[("dim", 2)], &points, &[]));
    all.push(signature("particles", &[], &[("dim", 2)], &[&points[..], &[("drag", 1)]].concat(), &[]));
    let words = [("contact_0", "plane"), ("contact_0_way", "safe")];
    all.push(signature("particles", &words, &[("dim", 2), ("contacts", 1)], &[&points[..], &plane].concat(), &[]));
    all.push(signature("restricted_three_body", &[], &[], &[("mu", 1)], &[]));
    let inertia = ("inertia", 3);
    all.push(signature("rigid_body", &[], &[], &[inertia], &[]));
    all.push(signature("rigid_body", &[("keeps", "control")], &[], &[inertia, ("damping", 3), ("strength", 1)], &["torque[1]"]));
    let heavy = [inertia, ("weight", 1), ("centre", 3), ("space_torque[2]", 1)];
    all.push(signature("rigid_body", &[("keeps", "projection")], &[("space_torque", 3)], &heavy, &[]));
    for (words, strength) in [(&[][..], 0), (&[("keeps", "control")], 1), (&[("keeps", "projection")], 0)] {
        let numbers = [("length", 1), ("gravity", 1), ("strength", strength)];
        all.push(signature("pendulum_3d", words, &[], if strength == 1 { &numbers } else { &numbers[..2] }, &[]));
        // Three points: the first on an anchor, a chain of two from it, and a loop between the last two and the first.
        let ends = [[3, 0], [0, 1], [2, 1], [0, 2]];
        let names: Vec<[String; 2]> = (0..4).map(|k| [0, 1].map(|end| format!("rods[{k}][{end}]"))).collect();
        let mut wholes = vec![("dim", 3), ("rods", 4)];
        wholes.extend(names.iter().flatten().map(String::as_str).zip(ends.into_iter().flatten()));
        let numbers = [("masses", 3), ("lengths", 4), ("anchors", 3), ("gravity", 1), ("strength", strength)];
        all.push(signature("rods", words, &wholes, if strength == 1 { &numbers } else { &numbers[..4] }, &[]));
    }
    for n in [1, 4] {
        all.push(signature("chain", &[], &[], &[("stiffness", n + 1), ("mass", n)], &[]));
    }
    all.push(signature("linear", &[("kind", "acceleration")], &[("n_v", 2)], &[("rows", 16)], &[]));
    all.push(signature("linear", &[], &[("n_v", 0)], &[("rows", 9)], &[]));
    all.push(signature("linear", &[], &[("n_v", 2), ("inputs", 2)], &[("rows", 8), ("inputs[0]", 1)], &["inputs[1]"]));
    for force in ["logarithmic", "newton", "printed"] {
        for (n, dim) in [(1, 2), (2, 2), (2, 3), (3, 3), (4, 2), (9, 3)] {
            all.push(bodies(n, dim, force, &[]));
        }
        all.extend(CONTROLS.iter().flat_map(|control| [bodies(3, 2, force, control), bodies(10, 3, force, control)]));
    }
    all.push(bodies(35, 2, "newton", &[]));
    all.extend([with_massless(4, &[0, 2], 2, "newton", &[]), with_massless(3, &[0, 1, 2], 3, "logarithmic", &[])]);
    all.extend(CONTROLS.map(|control| with_massless(6, &[1, 3, 4], 3, "newton", &control)));
    all.extend(nets());
    all.extend(CONTROLS.map(|control| net(2, 5, 3, &[("masses", 10), ("gravity", 3)], &control)));
    all.extend(own());
    all
}

/// Equations of a user's own: a force p·x(t) − p·y, the same with a rate of y, with a choice that depends on v, and with an
/// invariant.
fn own() -> [Signature; 4] {
    let system = |control: &[(&str, &str)], equations: Equations| {
        let rows = [("p", 1), ("control.target", 1)];
        let signature = signature("equations", control, &[], &rows[..if control.is_empty() { 1 } else { 2 }], &["x"]);
        Signature { equations: Some(Arc::new(equations)), ..signature }
    };
    let leaves = [Op::State(0), Op::State(1), Op::Param(0), Op::Time, Op::Sample(0, 3)];
    let force = [&leaves[..], &[Op::Sub(4, 1), Op::Mul(2, 5)]].concat();
    let rate = [&force[..], &[Op::Mul(0, 2), Op::Sqrt(7)]].concat();
    let choice = [&force[..], &[Op::Less(0, 1), Op::Select(7, 0, 6)]].concat();
    // p·y²/2 + v²/2, with its derivatives p·y and v, and the square of their length.
    let half = Op::Const(0.5_f64.to_bits());
    let energy =
        [half, Op::Mul(2, 1), Op::Mul(8, 1), Op::Mul(0, 0), Op::Add(9, 10), Op::Mul(7, 11), Op::Mul(8, 8), Op::Add(13, 10)];
    let kept = Invariant { value: 12, along_v: vec![0], along_y: vec![8], square: 14 };
    [
        system(&[], Equations::new(force.clone(), vec![6], None, Vec::new(), None)),
        system(&[], Equations::new(rate, vec![6], Some(vec![8]), Vec::new(), None)),
        system(&[], Equations::new(choice, vec![8], None, Vec::new(), None)),
        system(&CONTROLS[3], Equations::new([&force[..], &energy].concat(), vec![6], None, Vec::new(), Some(kept))),
    ]
}

/// The result of a step: the state, then the tally.
fn step<N: Number>(method: &Method, make: Make<N>, p: &Parameters<N>, shape: Shape, t: N, state: &[N], tally: N) -> Vec<N> {
    let system = around::wrap(p, make(p), tally);
    let (v, y) = state.split_at(shape.v);
    let (v0, y0) = (DVector::from_column_slice(v), DVector::from_column_slice(y));
    let next = method.program().run(&*system, t, p.h, &v0, &y0);
    let (mut v, mut y) = system.project(next[0].clone(), next[1].clone());
    if let Some(contacts) = Contacts::new(p) {
        let carry = contact::carry(method, 0);
        [v, y] = contacts.after(carry, &*system, t, [&v0, &y0], [v, y], &mut []);
    }
    v.iter().chain(&y).copied().chain(system.tally()).collect()
}

/// The step as a tape, and what it makes.
fn trace(method: &Method, signature: &Signature) -> (Tape, Vec<Id>) {
    let kind = systems::kind(signature).unwrap();
    let shape = around::fit(kind, signature, method).unwrap();
    let state = shape.v + shape.y;
    let (tape, made) = record(Tape::default(), || {
        let numbers = (0..signature.parameters() as u32).map(|i| Symbol::new(Op::Param(i))).collect();
        let p = Parameters { signature, h: Symbol::new(Op::Step), numbers, sample: |i, t| Symbol::new(Op::Sample(i, t.0)) };
        let symbols: Vec<Symbol> = (0..=state as u32).map(|i| Symbol::new(Op::State(i))).collect();
        step(method, kind.make, &p, shape, Symbol::new(Op::Time), &symbols[..state], symbols[state])
    });
    (tape, made.into_iter().map(|symbol| symbol.0).collect())
}

fn sample(table: u32, t: f64) -> f64 {
    f64::from(table) + (3.0 * t).floor()
}

/// The values of the tape for these numbers.
fn evaluate(tape: &Tape, roots: &[Id], h: f64, t: f64, parameters: &[f64], state: &[f64]) -> Vec<u64> {
    let mut values: Vec<u64> = Vec::with_capacity(tape.ops().len());
    for op in tape.ops() {
        let ([a, b, c], _) = op.operands();
        let of = |id: Id| values.get(id as usize).copied().unwrap_or_default();
        values.push(match *op {
            Op::State(i) => state[i as usize].to_bits(),
            Op::Param(i) => parameters[i as usize].to_bits(),
            Op::Step => h.to_bits(),
            Op::Time => t.to_bits(),
            Op::Sample(table, at) => sample(table, f64::from_bits(of(at))).to_bits(),
            op => eval::apply(op, of(a), of(b), of(c)),
        });
    }
    roots.iter().map(|root| values[*root as usize]).collect()
}

/// Numbers between ½ and 2, always the same.
fn numbers(count: usize, seed: u64) -> Vec<f64> {
    let mut x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = || {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        0.5 + 1.5 * (x >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn a_tape_makes_what_the_step_makes() {
    let (h, t) = (0.0123, 1.7);
    let mut seen = 0;
    for signature in systems() {
        let (kind, make) = (systems::kind(&signature).unwrap(), systems::make(&signature.system).unwrap());
        let parameters = numbers(signature.parameters(), 1);
        let methods = RECORDS.iter().map(|record| method(record.name).unwrap());
        for method in methods.filter(|method| !method.program().has_derivatives()) {
            let shape = match around::fit(kind, &signature, &method) {
                Ok(shape) => shape,
                Err(Error::VelocityDependent { .. }) => continue,
                Err(error) => panic!("{error}"),
            };
            let state = numbers(shape.v + shape.y + 1, 2);
            let (tape, roots) = trace(&method, &signature);
            let p = Parameters { signature: &signature, h, numbers: parameters.clone(), sample };
            let stepped = step(&method, make, &p, shape, t, &state[..shape.v + shape.y], state[shape.v + shape.y]);
            let stepped: Vec<u64> = stepped.into_iter().map(f64::to_bits).collect();
            assert_eq!(evaluate(&tape, &roots, h, t, &parameters, &state), stepped, "{} on {signature:?}", method.name);
            // A state by chance may have orbits for which the step is too long, and that is said by NaN.
            let is_sound = |bits: &u64| f64::from_bits(*bits).is_finite() || method.program().splits();
            assert!(stepped.iter().all(is_sound), "{} on {signature:?}", method.name);
            seen += 1;
        }
    }
    assert!(seen > 600, "{seen}");
}

#[test]
fn every_kind_of_system_is_tried() {
    let tried = systems();
    assert!(KINDS.iter().all(|kind| tried.iter().any(|signature| signature.system == kind.name)));
}

/// How many operations of each kind depend on the state.
fn of_the_state(tape: &Tape, roots: &[Id]) -> Counts {
    let mut counts = Counts::default();
    let mut depends: Vec<bool> = Vec::new();
    for (op, needed) in tape.ops().iter().zip(tape.needed(roots.iter().copied())) {
        let (operands, n) = op.operands();
        let lane = matches!(op, Op::State(_)) || operands[..n].iter().any(|id| depends[*id as usize]);
        depends.push(lane);
        if lane && needed {
            counts.note(*op);
        }
    }
    counts
}

#[test]
fn false_euler_on_an_oscillator_is_four_operations() {
    for form in ["canonical", "physical"] {
        let signature = signature("oscillator", &[("form", form)], &[], &[("omega", 1)], &[]);
        let (tape, roots) = trace(&method("false_euler").unwrap(), &signature);
        assert_eq!(of_the_state(&tape, &roots), Counts { additions: 2, multiplications: 2, ..Counts::default() }, "{form}");
    }
}

#[test]
fn zeros_that_begin_the_sums_of_a_few_bodies_cost_nothing() {
    // A pair: differences, their square and the softening; then what each number of each body gets, which is two pushes, the one
    // from the body before it taken from zero; then the step itself.
    for (n, pairs, additions) in [(2, 1, 1), (3, 3, 2)] {
        for dim in [2, 3] {
            let (tape, roots) = trace(&method("false_euler").unwrap(), &bodies(n, dim, "newton", &[]));
            let most = pairs * (2 * dim) + additions * n * dim + 2 * n * dim;
            assert!(of_the_state(&tape, &roots).additions as usize <= most, "{n} bodies in {dim} dimensions");
        }
    }
}

#[test]
fn every_pair_of_bodies_meets_once() {
    for n in (1..=131).chain([256, 511, 512, 513, 600]) {
        let mut met = vec![false; n * n];
        for k in bodies::partners(n).into_iter().flatten().flatten() {
            for i in 0..bodies::meeting(n, k) {
                let j = (i + k) % n;
                let pair = &mut met[i.min(j) * n + i.max(j)];
                assert!(i != j && !*pair, "{n} bodies: {i} and {j}");
                *pair = true;
            }
        }
        assert_eq!(met.into_iter().filter(|met| *met).count(), n * (n - 1) / 2, "{n} bodies");
    }
}

/// The quantities of a state of bodies, by name.
fn quantity<N: Number>(make: Make<N>, p: &Parameters<N>, name: &str, v: &[N], y: &[N]) -> Vec<N> {
    make(p).record(name, &DVector::from_column_slice(v), &DVector::from_column_slice(y)).unwrap()
}

#[test]
fn quantities_of_bodies_are_what_they_are_said_to_be() {
    for (n, dim, force) in [(1, 2, "newton"), (3, 2, "printed"), (4, 3, "logarithmic"), (11, 3, "newton")] {
        let signature = bodies(n, dim, force, &[]);
        let kind = systems::kind(&signature).unwrap();
        let (parameters, state) = (numbers(signature.parameters(), 3), numbers(2 * n * dim, 4));
        let (v, y) = state.split_at(n * dim);
        for (name, size) in (kind.quantities)(&signature) {
            let p = Parameters { signature: &signature, h: 0.5, numbers: parameters.clone(), sample };
            let made = quantity(systems::make(kind.name).unwrap(), &p, &name, v, y);
            assert_eq!(made.len(), size, "{name}");
            let (tape, symbols) = record(Tape::default(), || {
                let numbers = (0..signature.parameters() as u32).map(|i| Symbol::new(Op::Param(i))).collect();
                let p = Parameters {
                    signature: &signature,
                    h: Symbol::new(Op::Step),
                    numbers,
                    sample: |i, t| Symbol::new(Op::Sample(i, t.0)),
                };
                let symbols: Vec<Symbol> = (0..2 * (n * dim) as u32).map(|i| Symbol::new(Op::State(i))).collect();
                let (v, y) = symbols.split_at(n * dim);
                quantity(kind.make, &p, &name, v, y)
            });
            let roots: Vec<Id> = symbols.into_iter().map(|symbol| symbol.0).collect();
            let bits: Vec<u64> = made.iter().map(|number| number.to_bits()).collect();
            assert_eq!(evaluate(&tape, &roots, 0.5, 0.0, &parameters, &state), bits, "{name}");
            if name == "momentum" {
                let sum: f64 = (0..n).map(|i| parameters[i] * v[dim * i]).sum();
                assert!((made[0] - sum).abs() < 1e-12 * sum);
            }
        }
    }
}

#[test]
fn what_cannot_be_made_is_refused() {
    let standard_euler = method("standard_euler").unwrap();
    let fit = |signature: &Signature| around::fit(systems::kind(signature).unwrap(), signature, &standard_euler);
    let unknown = |signature: Signature| assert!(matches!(fit(&signature), Err(Error::Options { .. })), "{signature:?}");
    let misshapen = |signature: Signature| assert!(matches!(fit(&signature), Err(Error::Shape { .. })), "{signature:?}");
    unknown(signature("oscillator", &[("form", "square")], &[], &[("omega", 1)], &[]));
    unknown(bodies(3, 4, "newton", &[]));
    unknown(bodies(3, 2, "magnetic", &[]));
    unknown(bodies(3, 2, "newton", &[("control", "energy"), ("control.form", "loose")]));
    unknown(bodies(3, 2, "newton", &[("control", "projection"), ("control.way", "up")]));
    unknown(bodies(3, 2, "newton", &[("control", "cruise")]));
    unknown(signature("linear", &[("kind", "odd")], &[("n_v", 1)], &[("rows", 4)], &[]));
    unknown(signature("linear", &[("kind", "acceleration")], &[("n_v", 1)], &[("rows", 9)], &[]));
    let controlled = [("form", "physical"), ("control", "energy"), ("control.form", "limited")];
    unknown(signature("oscillator", &controlled, &[], &[("omega", 1), ("control.gain", 1), ("control.target", 1)], &[]));
    misshapen(signature("oscillator", &[("form", "physical")], &[], &[], &[]));
    misshapen(signature("pendulum", &[], &[], &[("omega", 2)], &[]));
    misshapen(signature("restricted_three_body", &[], &[], &[], &[]));
    unknown(signature("rigid_body", &[("keeps", "length")], &[], &[("inertia", 3)], &[]));
    misshapen(signature("rigid_body", &[], &[], &[("inertia", 2)], &[]));
    misshapen(signature("rigid_body", &[], &[], &[("inertia", 3), ("damping", 1)], &[]));
    misshapen(signature("rigid_body", &[], &[], &[("inertia", 3), ("weight", 1)], &[]));
    misshapen(signature("rigid_body", &[("keeps", "control")], &[], &[("inertia", 3)], &[]));
    misshapen(signature("chain", &[], &[], &[], &[]));
    misshapen(signature("chain", &[], &[], &[("stiffness", 3), ("mass", 3)], &[]));
    misshapen(signature("linear", &[], &[("n_v", 0)], &[], &[]));
    misshapen(signature("linear", &[], &[("n_v", usize::MAX)], &[("rows", 4)], &[]));
    misshapen(signature("linear", &[], &[("n_v", 1), ("inputs", 1)], &[("rows", 6)], &[]));
    misshapen(signature("linear", &[], &[("n_v", 1)], &[("rows", 5)], &[]));
    misshapen(signature(
        "nbody",
        &[("force", "newton")],
        &[("dim", 2)],
        &[("masses", 2), ("strength", 3), ("softening", 1)],
        &[],
    ));
    misshapen(signature("nbody", &[("force", "newton")], &[("dim", 2)], &[("softening", 1)], &[]));
    for massless in [&[3][..], &[1, 0], &[2, 2], &[0, u32::MAX]] {
        unknown(with_massless(3, massless, 2, "newton", &[]));
    }
    misshapen(net(2, 3, 2, &[("masses", 5)], &[]));
    misshapen(net(2, 3, 2, &[("drag", 2)], &[]));
    misshapen(net(2, 3, 2, &[("stiffness", 2)], &[]));
    misshapen(net(2, 3, 2, &[("gravity", 3)], &[]));
    unknown(net(2, 3, 4, &[], &[]));
    for pairs in [vec![], vec![0, 1, 2], vec![0, 6]] {
        unknown(Signature { lists: vec![("pairs".to_owned(), pairs.into())], ..net(2, 3, 2, &[], &[]) });
    }
}

#[test]
fn forces_of_the_velocity_are_refused_where_they_do_harm() {
    let term = |signature: &Signature, name: &str| match around::fit(
        systems::kind(signature).unwrap(),
        signature,
        &method(name).unwrap(),
    ) {
        Err(Error::VelocityDependent { term, .. }) => Some(term),
        _ => None,
    };
    let damped = signature("pendulum", &[], &[], &[("omega", 1), ("damping", 1)], &[]);
    let turning = signature("restricted_three_body", &[], &[], &[("mu", 1)], &[]);
    for method in ["verlet", "leapfrog", "pefrl"] {
        assert_eq!(term(&damped, method), Some("damping"));
        assert_eq!(term(&turning, method), Some("the Coriolis force"));
        assert_eq!(term(&bodies(3, 2, "newton", &CONTROLS[0]), method), Some("energy control"));
        assert_eq!(term(&bodies(3, 2, "newton", &[]), method), None);
    }
    assert_eq!(term(&damped, "rk4"), None);
    let [undamped, damped, dragged] =
        [&[][..], &[("damping", 1), ("drag", 1)], &[("drag", 1)]].map(|numbers| net(2, 3, 2, numbers, &[]));
    let terms = [&undamped, &damped, &dragged].map(|net| term(net, "verlet"));
    assert_eq!(terms, [None, Some("damping"), Some("drag")]);
}

#[test]
fn what_is_carried_turns_back_into_the_velocity() {
    let signature = bodies(3, 3, "newton", &[]);
    let p = Parameters { signature: &signature, h: 0.01, numbers: numbers(signature.parameters(), 5), sample };
    let system: Box<dyn System<f64>> = systems::make("nbody").unwrap()(&p);
    let (v, y) = (DVector::from_vec(numbers(9, 6)), DVector::from_vec(numbers(9, 7)));
    for record in RECORDS {
        let choices = record.carry.as_ref().map_or(0, |carry| carry.starts.len().max(1));
        for choice in 0..choices {
            let carried = record.start(choice).unwrap().run(&*system, 0.0, p.h, &v, &y);
            let back = record.finish(choice).unwrap().run(&*system, 0.0, p.h, &carried[0], &y);
            assert!((&back[0] - &v).amax() < 1e-12, "{} {choice}", record.name);
        }
    }
}
