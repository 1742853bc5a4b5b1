//! Functions and their quick forms, which `docs/forms.py` prints: see `forms.rs`.

use super::Op;

/// A function as operations, the first its argument and the last its value; and with fused operations.
#[derive(Debug)]
pub(super) struct Form {
    pub plain: &'static [Op],
    pub quick: &'static [Op],
}

#[rustfmt::skip]
pub(super) static FORMS: &[Form] = &[
    Form {
        plain: &[
            Op::State(0), Op::Const(0x7FFFFFFFFFFFFFFF), Op::And(0, 1), Op::Const(0x4310000000000000), Op::LessEqual(2, 3),
            Op::Const(0x7FF8000000000000), Op::Select(4, 2, 5), Op::Const(0x3FE45F306DC9C883), Op::Mul(6, 7),
            Op::Const(0x4338000000000000), Op::Add(8, 9), Op::Sub(10, 9), Op::Const(0x3FF921FB54000000), Op::Mul(11, 12),
            Op::Sub(6, 13), Op::Const(0x3E110B4612000000), Op::Mul(11, 15), Op::Sub(14, 16), Op::Const(0xBC3676733B000000),
            Op::Mul(11, 18), Op::Sub(14, 17), Op::Sub(20, 16), Op::Sub(19, 21), Op::Sub(17, 22), Op::Sub(17, 23),
            Op::Sub(24, 22), Op::Const(0x3A3701B839A25205), Op::Mul(11, 26), Op::Sub(25, 27), Op::Mul(23, 23),
            Op::Const(0x3FE0000000000000), Op::Mul(29, 30), Op::Const(0x3FF0000000000000), Op::Sub(32, 31),
            Op::Mul(23, 29), Op::Const(0x3DE5D8FB827E3D03), Op::Mul(29, 35), Op::Const(0xBE5AE5E597DB57C2),
            Op::Add(36, 37), Op::Mul(29, 38), Op::Const(0x3EC71DE35650A32A), Op::Add(39, 40), Op::Mul(29, 41),
            Op::Const(0xBF2A01A019BF8228), Op::Add(42, 43), Op::Mul(29, 44), Op::Const(0x3F8111111110F77E),
            Op::Add(45, 46), Op::Mul(29, 47), Op::Const(0xBFC5555555555548), Op::Add(48, 49), Op::Mul(34, 50),
            Op::Mul(28, 33), Op::Add(51, 52), Op::Sub(32, 33), Op::Sub(54, 31), Op::Mul(29, 29),
            Op::Const(0xBDA8FA9A7413E865), Op::Mul(29, 57), Op::Const(0x3E21EE9E17E6B4CC), Op::Add(58, 59),
            Op::Mul(29, 60), Op::Const(0xBE927E4F7F911E6A), Op::Add(61, 62), Op::Mul(29, 63),
            Op::Const(0x3EFA01A019C97A13), Op::Add(64, 65), Op::Mul(29, 66), Op::Const(0xBF56C16C16C1504C),
            Op::Add(67, 68), Op::Mul(29, 69), Op::Const(0x3FA555555555554B), Op::Add(70, 71), Op::Mul(56, 72),
            Op::Mul(23, 28), Op::Sub(73, 74), Op::Add(55, 75), Op::Const(0x0000000000000001), Op::And(10, 77),
            Op::Equal(77, 78), Op::Add(33, 76), Op::Add(23, 53), Op::Select(79, 80, 81), Op::ShiftUp(10, 62),
            Op::Xor(0, 83), Op::Const(0x8000000000000000), Op::And(84, 85), Op::Xor(82, 86),
        ],
        quick: &[
            Op::State(0), Op::Const(0x7FFFFFFFFFFFFFFF), Op::And(0, 1), Op::Const(0x4310000000000000), Op::LessEqual(2, 3),
            Op::Const(0x7FF8000000000000), Op::Select(4, 0, 5), Op::Const(0x4338000000000000),
            Op::Const(0x3FF0000000000000), Op::Const(0x3FD45F306DC9C883), Op::MulAdd(6, 9, 7), Op::Sub(10, 7),
            Op::Const(0x400921FB54442D18), Op::SubMul(11, 12, 6), Op::Const(0x3CA1A62633000000), Op::Mul(11, 14),
            Op::Sub(13, 15), Op::Const(0x3AA45C06E0E68948), Op::Sub(16, 13), Op::Add(15, 18), Op::MulAdd(11, 17, 19),
            Op::Mul(16, 16), Op::MulSub(16, 16, 21), Op::Const(0xBFC5555555555555), Op::MulAdd(21, 23, 8), Op::Sub(8, 24),
            Op::MulAdd(21, 23, 25), Op::Const(0x3CE881109F43A222), Op::Const(0xBD6AE4232AD3FE5C), Op::MulAdd(21, 27, 28),
            Op::Const(0x3DE6123C7AF70F6F), Op::MulAdd(21, 29, 30), Op::Const(0xBE5AE6454BE4428B), Op::MulAdd(21, 31, 32),
            Op::Const(0x3EC71DE3A526F44A), Op::MulAdd(21, 33, 34), Op::Const(0xBF2A01A01A014683), Op::MulAdd(21, 35, 36),
            Op::Const(0x3F811111111110C2), Op::MulAdd(21, 37, 38), Op::Mul(21, 21), Op::MulAdd(40, 39, 26),
            Op::Const(0xBFC147AE147AE148), Op::MulAdd(22, 42, 41), Op::Const(0xBFD9EB851EB851EC), Op::MulAdd(21, 44, 8),
            Op::Mul(20, 45), Op::MulSub(16, 43, 46), Op::MulAdd(16, 24, 47), Op::ShiftUp(10, 63), Op::Xor(48, 49),
        ],
    },
    Form {
        plain: &[
            Op::State(0), Op::Const(0xC087500000000000), Op::Less(0, 1), Op::Select(2, 1, 0),
            Op::Const(0x4086300000000000), Op::Less(4, 3), Op::Select(5, 4, 3), Op::Const(0x0000000000000000),
            Op::Less(6, 7), Op::Const(0x4338000000000463), Op::Const(0x43380000000003FE), Op::Select(8, 9, 10),
            Op::Const(0x3FF71547652B82FE), Op::Mul(6, 12), Op::Add(11, 13), Op::Sub(14, 11), Op::Const(0x3FE62E42FF000000),
            Op::Mul(15, 16), Op::Sub(6, 17), Op::Const(0xBDC718432A1B0E26), Op::Mul(15, 19), Op::Sub(18, 20),
            Op::Mul(21, 21), Op::Const(0x3E21F8BB233A20CF), Op::Mul(22, 23), Op::Const(0x3E927E4CC2827B2E),
            Op::Add(24, 25), Op::Mul(22, 26), Op::Const(0x3EFA01A01AD76D15), Op::Add(27, 28), Op::Mul(22, 29),
            Op::Const(0x3F56C16C16C1500B), Op::Add(30, 31), Op::Mul(22, 32), Op::Const(0x3FA5555555555558),
            Op::Add(33, 34), Op::Mul(22, 35), Op::Const(0x3FE0000000000000), Op::Add(36, 37),
            Op::Const(0x3E5AF6E9ED00ABEC), Op::Mul(22, 39), Op::Const(0x3EC71DDEE619014E), Op::Add(40, 41),
            Op::Mul(22, 42), Op::Const(0x3F2A01A01B44AFD9), Op::Add(43, 44), Op::Mul(22, 45),
            Op::Const(0x3F8111111110E9EF), Op::Add(46, 47), Op::Mul(22, 48), Op::Const(0x3FC555555555555C),
            Op::Add(49, 50), Op::Mul(21, 51), Op::Add(38, 52), Op::Mul(22, 53), Op::Sub(54, 20),
            Op::Const(0x3FF0000000000000), Op::Add(18, 56), Op::Sub(56, 57), Op::Add(18, 58), Op::Add(55, 59),
            Op::Add(57, 60), Op::ShiftUp(14, 52), Op::Mul(61, 62), Op::Const(0x39B0000000000000),
            Op::Const(0x4000000000000000), Op::Select(8, 64, 65), Op::Mul(63, 66),
        ],
        quick: &[
            Op::State(0), Op::Const(0xC087500000000000), Op::Const(0x4086300000000000), Op::Less(0, 1),
            Op::Select(3, 1, 0), Op::Less(2, 4), Op::Select(5, 2, 4), Op::Const(0x4338000000000000),
            Op::Const(0x3FF71547652B82FE), Op::MulAdd(6, 8, 7), Op::Sub(9, 7), Op::Const(0x3FE62E42FF000000),
            Op::SubMul(10, 11, 6), Op::Const(0xBDC718432A1B0E26), Op::SubMul(10, 13, 12), Op::Mul(14, 14),
            Op::Const(0x3E5AF6E9ED00ABEC), Op::Const(0x3EC71DDEE619014E), Op::MulAdd(15, 16, 17),
            Op::Const(0x3F2A01A01B44AFD9), Op::MulAdd(15, 18, 19), Op::Const(0x3F8111111110E9EF), Op::MulAdd(15, 20, 21),
            Op::Const(0x3FC555555555555C), Op::MulAdd(15, 22, 23), Op::Const(0x3E928B0EFA85FC2B),
            Op::Const(0x3EFA01995C12CADF), Op::MulAdd(15, 25, 26), Op::Const(0x3F56C16C186053D3), Op::MulAdd(15, 27, 28),
            Op::Const(0x3FA555555554FE0B), Op::MulAdd(15, 29, 30), Op::Const(0x3FE000000000000C), Op::MulAdd(15, 31, 32),
            Op::MulAdd(14, 24, 33), Op::Const(0x3FF0000000000000), Op::MulAdd(14, 34, 35), Op::MulAdd(14, 36, 35),
            Op::Const(0x0000000000000000), Op::Less(6, 38), Op::Const(0x4338000000000463), Op::Const(0x43380000000003FE),
            Op::Select(39, 40, 41), Op::Add(10, 42), Op::ShiftUp(43, 52), Op::Const(0x39B0000000000000),
            Op::Const(0x4000000000000000), Op::Select(39, 45, 46), Op::Mul(37, 44), Op::Mul(47, 48),
        ],
    },
];
