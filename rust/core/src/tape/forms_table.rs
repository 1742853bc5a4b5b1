//! Functions and their quick forms, which `docs/forms.py` prints: see `forms.rs`.

use super::Op;

/// A function as operations, of which the first is its argument and the last its value; and with fused operations.
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
];
