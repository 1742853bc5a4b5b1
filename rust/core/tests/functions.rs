//! The functions that both languages share, beside those of the machine. Here and not beside their code, or the whole core would
//! be compiled twice for the tests.

mod trig {
    use stepwell_core::functions::sin;

    #[test]
    fn agrees_with_libm() {
        // Both are within 1 ulp of the true sine, an ulp of 1 is 2⁻⁵² and results are at most 1: 2 ulp apart at most.
        let mut x = -1.0e3;
        while x < 1.0e3 {
            assert!((sin(x) - f64::sin(x)).abs() <= 2.0 * f64::EPSILON, "sin({x})");
            x += 0.0137;
        }
        for big in [1.0e5, 123_456.789, -9.9e5, 1.0e6] {
            assert!((sin(big) - f64::sin(big)).abs() <= 2.0 * f64::EPSILON, "sin({big})");
        }
    }

    #[test]
    fn error_grows_no_faster_than_the_argument_is_known() {
        for big in [1.0e7, 3.3e9, 1.0e12] {
            // Half an ulp of the argument moves the sine by up to |x|·2⁻⁵³; the reduction's roundings are a few of those.
            assert!((sin(big) - f64::sin(big)).abs() <= 4.0 * big * f64::EPSILON, "sin({big})");
        }
    }

    #[test]
    fn not_a_number_stays_one() {
        assert!(sin(f64::NAN).is_nan() && sin(f64::INFINITY).is_nan());
    }
}

mod log {
    use stepwell_core::functions::log;

    #[test]
    fn agrees_with_libm() {
        // Both are within 1 ulp of the true value: 2 ulp apart at most.
        let mut x = 1.0e-300;
        while x < 1.0e300 {
            let (a, b) = (log(x), f64::ln(x));
            assert!((a - b).abs() <= 2.0 * f64::EPSILON * b.abs(), "log({x}) = {a}, not {b}");
            x *= 1.0373;
        }
        for x in [1.0, 1.0 + 1e-15, 1.0 - 1e-15, 0.7, 1.4, 0.71, 1.42, 2.0, 0.5] {
            assert!((log(x) - f64::ln(x)).abs() <= 2.0 * f64::EPSILON * f64::ln(x).abs(), "log({x})");
        }
        assert_eq!(log(1.0), 0.0);
    }
}

mod symbols {
    use stepwell_core::{
        functions::{log, sin},
        tape::{
            Op, Tape, eval,
            number::{Symbol, record},
        },
    };

    /// A function's tape makes the bits that the function makes.
    fn holds(f: fn(f64) -> f64, of_symbol: fn(Symbol) -> Symbol, numbers: impl Iterator<Item = f64>) {
        let (tape, made) = record(Tape::default(), || of_symbol(Symbol::new(Op::State(0))));
        for x in numbers {
            let mut values: Vec<u64> = Vec::new();
            for op in tape.ops() {
                let of = |id: u32| values.get(id as usize).copied().unwrap_or_default();
                let ([a, b, c], _) = op.operands();
                values.push(if *op == Op::State(0) { x.to_bits() } else { eval::apply(*op, of(a), of(b), of(c)) });
            }
            assert_eq!(values[made.0 as usize], f(x).to_bits(), "of {x:?}");
        }
    }

    #[test]
    fn of_symbols_are_those_of_numbers() {
        let small = (-4000..4000).map(|i| f64::from(i) * 0.0137);
        let wide = (-300..300).map(|i| 1.7 * 10f64.powi(i));
        holds(sin, sin, small.chain([0.0, -0.0, 1e6, 1e12, f64::MIN_POSITIVE, 5e-324]));
        holds(log, log, wide.chain([1.0, 0.5, 2.0, 1.0 + 1e-15, 1.0 - 1e-15, f64::MAX, f64::MIN_POSITIVE]));
    }
}

mod fused {
    use std::hint::black_box;

    /// Where it is no instruction of the CPU, too, whatever C library the program is linked with. Rounded twice, none of these is
    /// right.
    #[test]
    fn multiply_add_is_rounded_once() {
        let wanted = [
            ([-1.940727735054662, -1.0510269395072387, -4.2300311273163946e-308], 2.0397571317913163),
            ([-2.4219913019074057e161, 1.9069232203702824, 4.618551453142084e161], 1.078372695694632e146),
            ([f64::MAX, 4.023768e6, f64::NEG_INFINITY], f64::NEG_INFINITY),
            ([5e-324, -1.1302133916300054, 5e-324], -0.0),
        ];
        for (of, wanted) in wanted {
            let [a, b, c] = of.map(black_box);
            assert_eq!(a.mul_add(b, c).to_bits(), f64::to_bits(wanted), "{of:?}");
        }
        let wanted = [
            ([8.881077e3f32, -8.877085e26, -8.8038376e-16], -7.883808e30),
            ([1.526359e-26, -6.830714e29, 2.671443e-23], -1.0426122e4),
        ];
        for (of, wanted) in wanted {
            let [a, b, c] = of.map(black_box);
            assert_eq!(a.mul_add(b, c).to_bits(), f32::to_bits(wanted), "{of:?}");
        }
    }
}
