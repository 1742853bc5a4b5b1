//! Every rule that shortens an expression, where it fires and on its border, where it must not.

use stepwell_core::tape::{Counts, Id, Op, Tape, fuse::fuse};

use crate::expressions::{Given, evaluate, same};

/// Reads an expression, such as `(+ x (sqrt 2))`, and gives each operation to `push` as it is asked for.
fn read(text: &str, push: &mut impl FnMut(Op) -> Id) -> Id {
    let spaced = text.replace('(', " ( ").replace(')', " ) ");
    let mut words = spaced.split_whitespace().peekable();
    let id = expression(&mut words, push);
    assert_eq!(words.next(), None, "{text}");
    id
}

fn expression<'a>(words: &mut impl Iterator<Item = &'a str>, push: &mut impl FnMut(Op) -> Id) -> Id {
    let word = words.next().unwrap();
    let op = match word {
        "x" => Op::State(0),
        "y" => Op::State(1),
        "z" => Op::State(2),
        "all" => Op::Const(u64::MAX),
        "(" => {
            let name = words.next().unwrap();
            let a = expression(words, push);
            let op = match name {
                "up" | "down" => {
                    let places = words.next().unwrap().parse().unwrap();
                    if name == "up" { Op::ShiftUp(a, places) } else { Op::ShiftDown(a, places) }
                }
                "sqrt" => Op::Sqrt(a),
                "neg" => Op::Neg(a),
                "floor" => Op::Floor(a),
                "copy" => Op::Copy(a),
                "sample" => Op::Sample(0, a),
                _ => {
                    let b = expression(words, push);
                    match name {
                        "+" => Op::Add(a, b),
                        "-" => Op::Sub(a, b),
                        "*" => Op::Mul(a, b),
                        "/" => Op::Div(a, b),
                        "<" => Op::Less(a, b),
                        "<=" => Op::LessEqual(a, b),
                        "=" => Op::Equal(a, b),
                        "and" => Op::And(a, b),
                        "or" => Op::Or(a, b),
                        "xor" => Op::Xor(a, b),
                        "plus" => Op::AddBits(a, b),
                        "select" => Op::Select(a, b, expression(words, push)),
                        _ => panic!("{name}"),
                    }
                }
            };
            assert_eq!(words.next(), Some(")"));
            op
        }
        number => Op::Const(number.parse::<f64>().unwrap().to_bits()),
    };
    push(op)
}

/// A value of a tape as text.
fn show(tape: &Tape, id: Id) -> String {
    let (name, op) = match tape.op(id) {
        Op::State(i) => return ["x", "y", "z"][i as usize].to_owned(),
        Op::Const(u64::MAX) => return "all".to_owned(),
        Op::Const(bits) => return format!("{:?}", f64::from_bits(bits)).trim_end_matches(".0").to_owned(),
        Op::ShiftUp(a, n) => return format!("(up {} {n})", show(tape, a)),
        Op::ShiftDown(a, n) => return format!("(down {} {n})", show(tape, a)),
        op @ Op::Sqrt(_) => ("sqrt", op),
        op @ Op::Neg(_) => ("neg", op),
        op @ Op::Floor(_) => ("floor", op),
        op @ Op::Copy(_) => ("copy", op),
        op @ Op::Sample(..) => ("sample", op),
        op @ Op::Add(..) => ("+", op),
        op @ Op::Sub(..) => ("-", op),
        op @ Op::Mul(..) => ("*", op),
        op @ Op::Div(..) => ("/", op),
        op @ Op::Less(..) => ("<", op),
        op @ Op::LessEqual(..) => ("<=", op),
        op @ Op::Equal(..) => ("=", op),
        op @ Op::And(..) => ("and", op),
        op @ Op::Or(..) => ("or", op),
        op @ Op::Xor(..) => ("xor", op),
        op @ Op::AddBits(..) => ("plus", op),
        op @ Op::Select(..) => ("select", op),
        op @ Op::MulAdd(..) => ("muladd", op),
        op @ Op::MulSub(..) => ("mulsub", op),
        op @ Op::SubMul(..) => ("submul", op),
        other => panic!("{other:?}"),
    };
    let (operands, n) = op.operands();
    let operands: Vec<String> = operands[..n].iter().map(|id| show(tape, *id)).collect();
    format!("({name} {})", operands.join(" "))
}

/// An expression as a tape shortens it.
fn shortened(text: &str) -> String {
    let mut tape = Tape::default();
    for i in 0..3 {
        tape.push(Op::State(i));
    }
    let id = read(text, &mut |op| tape.push(op));
    show(&tape, id)
}

/// The numbers at which anything may be different.
const NUMBERS: [f64; 15] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    2.5,
    -3.0,
    f64::MIN_POSITIVE,
    5e-324,
    -5e-324,
    f64::MAX,
    f64::MIN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    0.1,
];

/// The first x, y and z at which two expressions have other bits.
fn difference(a: &str, b: &str) -> Option<[f64; 3]> {
    let ops = |text: &str| {
        let mut ops = Vec::new();
        read(text, &mut |op| {
            ops.push(op);
            ops.len() as Id - 1
        });
        ops
    };
    let (a, b) = (ops(a), ops(b));
    let value = |ops: &[Op], state: [f64; 3]| *evaluate(ops, &Given { state: &state, ..Given::default() }).last().unwrap();
    let all = NUMBERS.iter().flat_map(|x| NUMBERS.iter().flat_map(move |y| NUMBERS.iter().map(move |z| [*x, *y, *z])));
    all.into_iter().find(|state| !same(value(&a, *state), value(&b, *state)))
}

#[test]
fn rules_fire_and_change_no_bit() {
    for (asked, made) in [
        // Constants are folded.
        ("(+ 2 3)", "5"),
        ("(- 2 3)", "-1"),
        ("(* 2 3)", "6"),
        ("(/ 1 4)", "0.25"),
        ("(/ 1 0)", "inf"),
        ("(/ 1 -0)", "-inf"),
        ("(sqrt 9)", "3"),
        ("(sqrt -0)", "-0"),
        ("(neg 2)", "-2"),
        ("(floor -2.5)", "-3"),
        ("(+ 0 -0)", "0"),
        ("(+ -0 -0)", "-0"),
        ("(* 0 -3)", "-0"),
        ("(* 1e308 10)", "inf"),
        ("(* 5e-324 0.5)", "0"),
        ("(< 1 2)", "all"),
        ("(< 2 1)", "0"),
        ("(<= nan 1)", "0"),
        ("(= 0 -0)", "all"),
        ("(select (< 1 2) 3 4)", "3"),
        ("(xor 1 -0)", "-1"),
        ("(and -1 all)", "-1"),
        ("(or 1 -0)", "-1"),
        ("(plus 0 1)", "1"),
        ("(up 5e-324 1)", "1e-323"),
        ("(down (up 5e-324 3) 3)", "5e-324"),
        ("(+ x (+ 1 2))", "(+ x 3)"),
        // A change of sign is undone, and moved out of sums and products.
        ("(neg (neg x))", "x"),
        ("(+ x (neg y))", "(- x y)"),
        ("(+ (neg x) y)", "(- y x)"),
        ("(+ (neg x) (neg y))", "(- (neg x) y)"),
        ("(+ (neg x) 0)", "(- 0 x)"),
        ("(- x (neg y))", "(+ x y)"),
        ("(- -0 x)", "(neg x)"),
        ("(* (neg x) y)", "(neg (* x y))"),
        ("(* x (neg y))", "(neg (* x y))"),
        ("(* (neg x) (neg y))", "(* x y)"),
        ("(* (neg x) (neg x))", "(* x x)"),
        ("(* x -1)", "(neg x)"),
        ("(* -1 x)", "(neg x)"),
        ("(* -1 (neg x))", "x"),
        ("(+ y (* -1 x))", "(- y x)"),
        // Zeros and ones.
        ("(+ x -0)", "x"),
        ("(+ -0 x)", "x"),
        ("(- x 0)", "x"),
        ("(* x 1)", "x"),
        ("(* 1 x)", "x"),
        ("(/ x 1)", "x"),
        // What cannot be −0 stays as it is with 0 added.
        ("(+ (* x x) 0)", "(* x x)"),
        ("(+ 0 (* x x))", "(* x x)"),
        ("(+ (+ x 2) 0)", "(+ x 2)"),
        ("(+ (+ x (* y y)) 0)", "(+ x (* y y))"),
        ("(+ (- 2 x) 0)", "(- 2 x)"),
        ("(+ (- (* x x) y) 0)", "(- (* x x) y)"),
        ("(+ (sqrt (* x x)) 0)", "(sqrt (* x x))"),
        ("(+ (select (< x y) (* x x) 2) 0)", "(select (< x y) (* x x) 2)"),
        // The zero that a sum begins with.
        ("(+ (+ 0 x) (* y y))", "(+ x (* y y))"),
        ("(+ (* y y) (+ x 0))", "(+ x (* y y))"),
        ("(+ (+ x 0) 2)", "(+ x 2)"),
        // Order does not matter.
        ("(+ y x)", "(+ x y)"),
        ("(* y x)", "(* x y)"),
        ("(= y x)", "(= x y)"),
        ("(and y x)", "(and x y)"),
        ("(or y x)", "(or x y)"),
        ("(xor y x)", "(xor x y)"),
        ("(plus y x)", "(plus x y)"),
        // What chooses nothing and moves nothing.
        ("(select (< x y) z z)", "z"),
        ("(select (< 1 2) x y)", "x"),
        ("(select (< 2 1) x y)", "y"),
        ("(copy x)", "x"),
        ("(up x 0)", "x"),
        ("(down x 0)", "x"),
    ] {
        assert_eq!(shortened(asked), made, "{asked}");
        assert_eq!(difference(asked, made), None, "{asked} is not {made}");
    }
}

#[test]
fn rules_do_not_fire_past_their_border() {
    // What is asked for, how it stays, and what would be wrong.
    for (asked, stays, wrong) in [
        ("(+ x 0)", "(+ x 0)", "x"),
        ("(+ 0 x)", "(+ x 0)", "x"),
        ("(+ (* x y) 0)", "(+ (* x y) 0)", "(* x y)"),
        ("(+ (+ x y) 0)", "(+ (+ x y) 0)", "(+ x y)"),
        ("(+ (- x y) 0)", "(+ (- x y) 0)", "(- x y)"),
        ("(+ (- x (* y y)) 0)", "(+ (- x (* y y)) 0)", "(- x (* y y))"),
        ("(+ (/ 1 x) 0)", "(+ (/ 1 x) 0)", "(/ 1 x)"),
        ("(+ (sqrt x) 0)", "(+ (sqrt x) 0)", "(sqrt x)"),
        ("(+ (floor x) 0)", "(+ (floor x) 0)", "(floor x)"),
        ("(+ (select (< x y) (* x x) z) 0)", "(+ (select (< x y) (* x x) z) 0)", "(select (< x y) (* x x) z)"),
        ("(+ (select (< x y) -0 (* x x)) 0)", "(+ (select (< x y) -0 (* x x)) 0)", "(select (< x y) -0 (* x x))"),
        ("(+ (neg x) 0)", "(- 0 x)", "(neg x)"),
        ("(+ (+ x 0) y)", "(+ y (+ x 0))", "(+ x y)"),
        ("(+ (+ x 0) (* y z))", "(+ (+ x 0) (* y z))", "(+ x (* y z))"),
        ("(- (+ x 0) y)", "(- (+ x 0) y)", "(- x y)"),
        ("(- x -0)", "(- x -0)", "x"),
        ("(- 0 x)", "(- 0 x)", "(neg x)"),
        ("(- x x)", "(- x x)", "0"),
        ("(neg (- x y))", "(neg (- x y))", "(- y x)"),
        ("(- (neg x) y)", "(- (neg x) y)", "(neg (+ x y))"),
        ("(* x 0)", "(* x 0)", "0"),
        ("(/ 0 x)", "(/ 0 x)", "0"),
        ("(/ x x)", "(/ x x)", "1"),
        ("(/ x -1)", "(/ x -1)", "x"),
        ("(/ 1 x)", "(/ 1 x)", "x"),
        ("(- y x)", "(- y x)", "(- x y)"),
        ("(/ y x)", "(/ y x)", "(/ x y)"),
        ("(< y x)", "(< y x)", "(< x y)"),
        ("(<= y x)", "(<= y x)", "(<= x y)"),
        ("(<= x y)", "(<= x y)", "(xor (< y x) all)"),
        ("(= x x)", "(= x x)", "all"),
        ("(select (< x y) x y)", "(select (< x y) x y)", "x"),
        ("(select (< x y) 0 -0)", "(select (< x y) 0 -0)", "0"),
        ("(select (= x y) x y)", "(select (= x y) x y)", "y"),
        ("(up x 1)", "(up x 1)", "x"),
        ("(down x 1)", "(down x 1)", "x"),
        ("(+ (+ x y) z)", "(+ z (+ x y))", "(+ x (+ y z))"),
        ("(* (* x y) z)", "(* z (* x y))", "(* x (* y z))"),
        ("(+ (* x y) (* x z))", "(+ (* x y) (* x z))", "(* x (+ y z))"),
        ("(- (+ x y) y)", "(- (+ x y) y)", "x"),
        ("(* (sqrt x) (sqrt x))", "(* (sqrt x) (sqrt x))", "x"),
        ("(/ x 2.5)", "(/ x 2.5)", "(* x 0.4)"),
    ] {
        assert_eq!(shortened(asked), stays, "{asked}");
        assert_eq!(difference(asked, stays), None, "{asked} is not {stays}");
        assert!(difference(stays, wrong).is_some(), "{stays} and {wrong} are the same: this is no border");
    }
}

#[test]
fn what_is_no_number_or_no_constant_is_not_folded() {
    for stays in
        ["(/ 0 0)", "(- inf inf)", "(* 0 inf)", "(sqrt -1)", "(+ NaN 1)", "(floor NaN)", "(sample 1)", "(+ x 3)", "(sqrt x)"]
    {
        assert_eq!(shortened(stays), stays);
    }
}

#[test]
fn equal_operations_are_one_and_zeros_of_other_signs_are_two() {
    let mut tape = Tape::default();
    let (x, y) = (tape.push(Op::State(0)), tape.push(Op::State(1)));
    assert_eq!(tape.push(Op::State(0)), x);
    assert_eq!(tape.push(Op::Add(x, y)), tape.push(Op::Add(y, x)));
    assert_ne!(tape.constant(0.0), tape.constant(-0.0));
    assert_ne!(tape.push(Op::Const(f64::NAN.to_bits())), tape.push(Op::Const((-f64::NAN).to_bits())));
    assert_ne!(tape.push(Op::Sample(0, x)), tape.push(Op::Sample(1, x)));
    assert_ne!(tape.push(Op::ShiftUp(x, 1)), tape.push(Op::ShiftUp(x, 2)));
}

#[test]
fn operations_are_counted_before_and_after() {
    // (x + y)·(y + x) + 0·1 − √(x + y)/x, and a choice whose outcome is known.
    let text = "(select (< 1 2) (- (+ (* (+ x y) (+ y x)) (* 0 1)) (/ (sqrt (+ x y)) x)) (floor (up 1 2)))";
    let mut tape = Tape::default();
    let id = read(text, &mut |op| tape.push(op));
    // What is made of constants alone is not counted: 0·1, 1 < 2, and the other choice.
    let written = Counts { additions: 5, multiplications: 1, fused: 0, divisions: 1, square_roots: 1, choices: 1, bits: 0 };
    assert_eq!(tape.written([id]), written);
    // The sum once; (x + y)² is never −0, so the zero is gone; the choice is made.
    let computed = Counts { additions: 2, multiplications: 1, fused: 0, divisions: 1, square_roots: 1, choices: 0, bits: 0 };
    assert_eq!(tape.counts([id]), computed);
    assert_eq!(tape.counts([]), Counts::default());
    // A value that is not used is on the tape but not counted.
    let (x, y) = (tape.push(Op::State(0)), tape.push(Op::State(1)));
    let sum = tape.push(Op::Add(x, y));
    assert_eq!(tape.counts([sum]), Counts { additions: 1, ..Counts::default() });
    // Changes of sign and copies are no arithmetic.
    let mut tape = Tape::default();
    let id = read("(copy (neg x))", &mut |op| tape.push(op));
    assert_eq!((tape.written([id]), tape.counts([id])), (Counts::default(), Counts::default()));
    // Of inputs what is needed of them counts, once; and nothing of parameters alone.
    let mut tape = Tape::default();
    let [x, t, h] = [Op::State(0), Op::Time, Op::Step].map(|op| tape.push(op));
    let later = tape.push(Op::Add(t, h));
    let (sample, twice) = (tape.push(Op::Sample(0, later)), tape.push(Op::Add(h, h)));
    let input = tape.push(Op::Mul(sample, twice));
    let needless = tape.push(Op::Div(t, h));
    tape.push(Op::Mul(sample, twice));
    let next = tape.push(Op::Sub(x, input));
    let counts = Counts { additions: 2, multiplications: 1, ..Counts::default() };
    assert_eq!(tape.written([next]), counts);
    assert_eq!(tape.written([next, needless]), Counts { divisions: 1, ..counts });
}

/// An expression of x, y and z as it is fused, if these others are asked for as well.
fn fused(text: &str, also: &[&str]) -> String {
    let mut tape = Tape::default();
    for i in 0..3 {
        tape.push(Op::State(i));
    }
    let roots: Vec<Id> = std::iter::once(&text).chain(also).map(|text| read(text, &mut |op| tape.push(op))).collect();
    let (tape, roots) = fuse(&tape, &roots);
    show(&tape, roots[0])
}

#[test]
fn a_product_of_one_use_is_fused_into_its_sum() {
    for (text, want) in [
        ("(+ x (* y z))", "(muladd y z x)"),
        ("(+ (* y z) x)", "(muladd y z x)"),
        ("(- (* y z) x)", "(mulsub y z x)"),
        ("(- x (* y z))", "(submul y z x)"),
        // Of two that are equally deep the one whose factors come later.
        ("(+ (* x x) (* y y))", "(muladd y y (* x x))"),
        ("(- (* x x) (* y y))", "(submul y y (* x x))"),
        ("(+ (+ (* x x) (* y y)) (* z z))", "(muladd z z (muladd y y (* x x)))"),
        // A change of sign works with it, as it does without.
        ("(+ x (neg (* y z)))", "(submul y z x)"),
        // A fused sum is no product, and a product of it is one like others.
        ("(+ z (* x (+ x (* y z))))", "(muladd x (muladd y z x) z)"),
    ] {
        assert_eq!(fused(text, &[]), want, "{text}");
    }
}

#[test]
fn what_would_not_vanish_or_is_not_of_the_state_is_not_fused() {
    // Twice in the sum itself, in a sum and a root, in a sum and a state, in two sums.
    for (text, also) in [
        ("(+ (* x y) (* x y))", ""),
        ("(+ (* x y) (sqrt (* x y)))", ""),
        ("(+ z (* x y))", "(* x y)"),
        ("(+ z (* x y))", "(- z (* x y))"),
    ] {
        let also: Vec<&str> = Some(also).filter(|also| !also.is_empty()).into_iter().collect();
        assert_eq!(fused(text, &also), text, "{also:?}");
    }
    // A product of parameters is computed before the steps, whether members share them or not.
    let mut tape = Tape::default();
    let [x, a, b] = [Op::State(0), Op::Param(0), Op::Param(1)].map(|op| tape.push(op));
    let product = tape.push(Op::Mul(a, b));
    let sum = tape.push(Op::Add(x, product));
    let (fused, made) = fuse(&tape, &[sum]);
    assert!(matches!(fused.op(made[0]), Op::Add(..)));
    // Of the state is what is a parameter times it.
    let product = tape.push(Op::Mul(a, x));
    let sum = tape.push(Op::Add(b, product));
    let (fused, made) = fuse(&tape, &[sum]);
    assert!(matches!(fused.op(made[0]), Op::MulAdd(..)));
}
