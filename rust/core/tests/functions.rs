//! The functions that both languages share, beside those of the machine. Here and not beside their code, or the whole core would be
//! compiled twice for the tests.

mod trig {
    use stepwell_core::trig::sin;

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
    use stepwell_core::log::log;

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
