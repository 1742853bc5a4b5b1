//! Kernels with wrong instructions: the comparison under the emulator notices each.

use crate::emulated::{Case, compare, runner};
use stepwell_core::tape::real::Real;

/// The mistake, the mask and the bits of the words that it is for, and the wrong bits in their place.
type Mistake = (&'static str, u32, u32, u32);

const OF_DOUBLES: [Mistake; 12] = [
    ("a sum for a difference", 0xFFE0_FC00, 0x4EE0_D400, 0x4E60_D400),
    ("less or equal for less", 0xFFE0_FC00, 0x6EE0_E400, 0x6E60_E400),
    ("less for less or equal", 0xFFE0_FC00, 0x6E60_E400, 0x6EE0_E400),
    ("a fused sum for a fused difference", 0xFFE0_FC00, 0x4EE0_CC00, 0x4E60_CC00),
    ("a fused difference with the wrong sign, of one number", 0xFFE0_8000, 0x1F60_8000, 0x1F40_8000),
    ("the other choice", 0xFFE0_FC00, 0x6E60_1C00, 0x6EE0_1C00),
    ("the other place", 0xFFE0_FC00, 0x6EA0_1C00, 0x6EE0_1C00),
    ("to the nearest whole number for downwards", 0xFFFF_FC00, 0x4E61_9800, 0x4E61_8800),
    ("the sign moved down with the bits", 0xFF80_FC00, 0x6F00_0400, 0x4F00_0400),
    ("one number in the first lane only", 0xFFFF_FC00, 0x4E08_0400, 0x5E08_0400),
    ("rounding as the caller does", u32::MAX, 0xD51B_441F, 0xD503_201F),
    ("a register of the caller not given back", u32::MAX, 0x6D41_2FEA, 0xD503_201F),
];

/// Mostly numbers of another size. That one sum of whole numbers is of 64 bits is no mistake: its high bits are not read.
const OF_SINGLES: [Mistake; 18] = [
    ("a sum of two numbers of 64 bits", 0xFFE0_FC00, 0x4E20_D400, 0x4E60_D400),
    ("a difference of one number of 64 bits", 0xFFE0_FC00, 0x1E20_3800, 0x1E60_3800),
    ("a product over two of four numbers", 0xFFE0_FC00, 0x6E20_DC00, 0x2E20_DC00),
    ("a root of two numbers of 64 bits", 0xFFFF_FC00, 0x6EA1_F800, 0x6EE1_F800),
    ("a sign of two numbers of 64 bits", 0xFFFF_FC00, 0x6EA0_F800, 0x6EE0_F800),
    ("less of two numbers of 64 bits", 0xFFE0_FC00, 0x6EA0_E400, 0x6EE0_E400),
    ("less or equal for less, of one number", 0xFFE0_FC00, 0x7EA0_E400, 0x7E20_E400),
    ("a fused sum of two numbers of 64 bits", 0xFFE0_FC00, 0x4E20_CC00, 0x4E60_CC00),
    ("a fused difference with the wrong sign, of one number", 0xFFE0_8000, 0x1F20_8000, 0x1F00_8000),
    ("to the nearest whole number for downwards", 0xFFFF_FC00, 0x4E21_9800, 0x4E21_8800),
    ("a sum of two whole numbers of 64 bits", 0xFFE0_FC00, 0x4EA0_8400, 0x4EE0_8400),
    ("bits moved up into the next number", 0xFFE0_FC00, 0x4F20_5400, 0x4F40_5400),
    ("the sign moved down with the bits", 0xFFE0_FC00, 0x6F20_0400, 0x4F20_0400),
    ("the sign moved down with the bits, of one number", 0xFFE0_FC00, 0x2F20_0400, 0x0F20_0400),
    ("one number and the next for all lanes", 0xFFFF_FC00, 0x4E04_0400, 0x4E08_0400),
    ("one number of 64 bits loaded", 0xFFC0_0000, 0xBD40_0000, 0xFD40_0000),
    ("one number of 64 bits stored", 0xFFC0_0000, 0xBD00_0000, 0xFD00_0000),
    ("rounding as the caller does", u32::MAX, 0xD51B_441F, 0xD503_201F),
];

fn notice<T: Real>(mistakes: &[Mistake], files: &str) {
    let Some(runner) = runner(files) else { return };
    for &(what, bits, right, wrong) in mistakes {
        assert_eq!(right & !bits, 0, "{what}");
        // Few kernels show some of them: a wrong number may be lost in a choice.
        let is_noticed = (0..300).step_by(60).any(|first| {
            let mut made = 0;
            let mut cases: Vec<Case<T>> = (first..first + 60).flat_map(Case::all).collect();
            for word in cases.iter_mut().flat_map(|case| case.assembled.code.as_chunks_mut().0) {
                let old = u32::from_le_bytes(*word);
                if old & bits == right {
                    *word = (old ^ right ^ wrong).to_le_bytes();
                    made += 1;
                }
            }
            made > 0 && compare(&runner, &cases, files).is_err()
        });
        assert!(is_noticed, "{what}");
    }
}

#[test]
fn every_mistake_is_noticed() {
    notice::<f64>(&OF_DOUBLES, "mistakes");
}

#[test]
fn every_mistake_of_single_precision_is_noticed() {
    notice::<f32>(&OF_SINGLES, "mistakes-single");
}
