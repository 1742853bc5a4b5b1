//! The words of instructions, against an assembler's.

use std::{fs, path::Path, process::Command};

use stepwell_core::kernel::aarch64::encode::{self as n, Code, General};

/// The width of vectors, the instruction that is written, its assembly, and the words that GNU's assembler (2.40) makes of that.
type Line = (usize, fn(&mut Code), &'static str, &'static [u32]);

#[rustfmt::skip]
const OF_DOUBLES: &[Line] = &[
    (2, |c| c.three(n::ADD, 31, 0, 17), "fadd v31.2d, v0.2d, v17.2d", &[0x4E71_D41F]),
    (1, |c| c.three(n::ADD, 31, 0, 17), "fadd d31, d0, d17", &[0x1E71_281F]),
    (2, |c| c.three(n::SUB, 30, 1, 18), "fsub v30.2d, v1.2d, v18.2d", &[0x4EF2_D43E]),
    (1, |c| c.three(n::SUB, 30, 1, 18), "fsub d30, d1, d18", &[0x1E72_383E]),
    (2, |c| c.three(n::MUL, 29, 2, 19), "fmul v29.2d, v2.2d, v19.2d", &[0x6E73_DC5D]),
    (1, |c| c.three(n::MUL, 29, 2, 19), "fmul d29, d2, d19", &[0x1E73_085D]),
    (2, |c| c.three(n::DIV, 28, 3, 20), "fdiv v28.2d, v3.2d, v20.2d", &[0x6E74_FC7C]),
    (1, |c| c.three(n::DIV, 28, 3, 20), "fdiv d28, d3, d20", &[0x1E74_187C]),
    (2, |c| c.three(n::EQUAL, 27, 4, 21), "fcmeq v27.2d, v4.2d, v21.2d", &[0x4E75_E49B]),
    (1, |c| c.three(n::EQUAL, 27, 4, 21), "fcmeq d27, d4, d21", &[0x5E75_E49B]),
    (2, |c| c.three(n::GREATER, 26, 5, 22), "fcmgt v26.2d, v5.2d, v22.2d", &[0x6EF6_E4BA]),
    (1, |c| c.three(n::GREATER, 26, 5, 22), "fcmgt d26, d5, d22", &[0x7EF6_E4BA]),
    (2, |c| c.three(n::GREATER_EQUAL, 25, 6, 23), "fcmge v25.2d, v6.2d, v23.2d", &[0x6E77_E4D9]),
    (1, |c| c.three(n::GREATER_EQUAL, 25, 6, 23), "fcmge d25, d6, d23", &[0x7E77_E4D9]),
    (2, |c| c.three(n::ADD_BITS, 24, 7, 24), "add v24.2d, v7.2d, v24.2d", &[0x4EF8_84F8]),
    (1, |c| c.three(n::ADD_BITS, 24, 7, 24), "add d24, d7, d24", &[0x5EF8_84F8]),
    (2, |c| c.three(n::SUB_BITS, 24, 7, 24), "sub v24.2d, v7.2d, v24.2d", &[0x6EF8_84F8]),
    (1, |c| c.three(n::SUB_BITS, 24, 7, 24), "sub d24, d7, d24", &[0x7EF8_84F8]),
    (2, |c| c.three(n::AND, 0, 30, 9), "and v0.16b, v30.16b, v9.16b", &[0x4E29_1FC0]),
    (1, |c| c.three(n::AND, 0, 30, 9), "and v0.8b, v30.8b, v9.8b", &[0x0E29_1FC0]),
    (2, |c| c.three(n::OR, 1, 29, 10), "orr v1.16b, v29.16b, v10.16b", &[0x4EAA_1FA1]),
    (1, |c| c.three(n::OR, 1, 29, 10), "orr v1.8b, v29.8b, v10.8b", &[0x0EAA_1FA1]),
    (2, |c| c.three(n::XOR, 2, 28, 11), "eor v2.16b, v28.16b, v11.16b", &[0x6E2B_1F82]),
    (1, |c| c.three(n::XOR, 2, 28, 11), "eor v2.8b, v28.8b, v11.8b", &[0x2E2B_1F82]),
    (2, |c| c.three(n::CHOOSE, 3, 27, 12), "bsl v3.16b, v27.16b, v12.16b", &[0x6E6C_1F63]),
    (1, |c| c.three(n::CHOOSE, 3, 27, 12), "bsl v3.8b, v27.8b, v12.8b", &[0x2E6C_1F63]),
    (2, |c| c.three(n::INSERT_WHERE, 4, 26, 13), "bit v4.16b, v26.16b, v13.16b", &[0x6EAD_1F44]),
    (1, |c| c.three(n::INSERT_WHERE, 4, 26, 13), "bit v4.8b, v26.8b, v13.8b", &[0x2EAD_1F44]),
    (2, |c| c.three(n::INSERT_WHERE_NOT, 5, 25, 14), "bif v5.16b, v25.16b, v14.16b", &[0x6EEE_1F25]),
    (1, |c| c.three(n::INSERT_WHERE_NOT, 5, 25, 14), "bif v5.8b, v25.8b, v14.8b", &[0x2EEE_1F25]),
    (2, |c| c.two(n::SQRT, 31, 14), "fsqrt v31.2d, v14.2d", &[0x6EE1_F9DF]),
    (1, |c| c.two(n::SQRT, 31, 14), "fsqrt d31, d14", &[0x1E61_C1DF]),
    (2, |c| c.two(n::NEG, 30, 15), "fneg v30.2d, v15.2d", &[0x6EE0_F9FE]),
    (1, |c| c.two(n::NEG, 30, 15), "fneg d30, d15", &[0x1E61_41FE]),
    (2, |c| c.two(n::FLOOR, 29, 16), "frintm v29.2d, v16.2d", &[0x4E61_9A1D]),
    (1, |c| c.two(n::FLOOR, 29, 16), "frintm d29, d16", &[0x1E65_421D]),
    (2, |c| c.two(n::shift_up(64, 0), 3, 29), "shl v3.2d, v29.2d, #0", &[0x4F40_57A3]),
    (1, |c| c.two(n::shift_up(64, 0), 3, 29), "shl d3, d29, #0", &[0x5F40_57A3]),
    (2, |c| c.two(n::shift_up(64, 1), 3, 29), "shl v3.2d, v29.2d, #1", &[0x4F41_57A3]),
    (1, |c| c.two(n::shift_up(64, 1), 3, 29), "shl d3, d29, #1", &[0x5F41_57A3]),
    (2, |c| c.two(n::shift_up(64, 52), 3, 29), "shl v3.2d, v29.2d, #52", &[0x4F74_57A3]),
    (1, |c| c.two(n::shift_up(64, 52), 3, 29), "shl d3, d29, #52", &[0x5F74_57A3]),
    (2, |c| c.two(n::shift_up(64, 63), 3, 29), "shl v3.2d, v29.2d, #63", &[0x4F7F_57A3]),
    (1, |c| c.two(n::shift_up(64, 63), 3, 29), "shl d3, d29, #63", &[0x5F7F_57A3]),
    (2, |c| c.two(n::shift_down(64, 1), 30, 7), "ushr v30.2d, v7.2d, #1", &[0x6F7F_04FE]),
    (1, |c| c.two(n::shift_down(64, 1), 30, 7), "ushr d30, d7, #1", &[0x7F7F_04FE]),
    (2, |c| c.two(n::shift_down(64, 52), 30, 7), "ushr v30.2d, v7.2d, #52", &[0x6F4C_04FE]),
    (1, |c| c.two(n::shift_down(64, 52), 30, 7), "ushr d30, d7, #52", &[0x7F4C_04FE]),
    (2, |c| c.two(n::shift_down(64, 63), 30, 7), "ushr v30.2d, v7.2d, #63", &[0x6F41_04FE]),
    (1, |c| c.two(n::shift_down(64, 63), 30, 7), "ushr d30, d7, #63", &[0x7F41_04FE]),
    (2, |c| c.overwrite(n::ADD_PRODUCT, 1, 30, 20), "fmla v1.2d, v30.2d, v20.2d", &[0x4E74_CFC1]),
    (2, |c| c.overwrite(n::SUB_PRODUCT, 31, 0, 15), "fmls v31.2d, v0.2d, v15.2d", &[0x4EEF_CC1F]),
    (1, |c| c.fused(n::MUL_ADD, 4, 31, 16, 9), "fmadd d4, d31, d16, d9", &[0x1F50_27E4]),
    (1, |c| c.fused(n::SUB_MUL, 30, 2, 19, 31), "fmsub d30, d2, d19, d31", &[0x1F53_FC5E]),
    (1, |c| c.fused(n::MUL_SUB, 17, 18, 3, 0), "fnmsub d17, d18, d3, d0", &[0x1F63_8251]),
    (2, |c| c.move_vector(31, 6), "mov v31.16b, v6.16b", &[0x4EA6_1CDF]),
    (1, |c| c.move_vector(5, 25), "mov v5.8b, v25.8b", &[0x0EB9_1F25]),
    (2, |c| c.spread(26, 11), "dup v26.2d, v11.d[0]", &[0x4E08_057A]),
    (2, |c| c.load_vector(31, General(3), 0, false, General(16)), "ldr q31, [x3, #0]", &[0x3DC0_007F]),
    (2, |c| c.store_vector(8, General(6), 0, General(16)), "str q8, [x6, #0]", &[0x3D80_00C8]),
    (2, |c| c.load_vector(31, General(3), 16, false, General(16)), "ldr q31, [x3, #16]", &[0x3DC0_047F]),
    (2, |c| c.store_vector(8, General(6), 16, General(16)), "str q8, [x6, #16]", &[0x3D80_04C8]),
    (2, |c| c.load_vector(31, General(3), 65520, false, General(16)), "ldr q31, [x3, #65520]", &[0x3DFF_FC7F]),
    (2, |c| c.store_vector(8, General(6), 65520, General(16)), "str q8, [x6, #65520]", &[0x3DBF_FCC8]),
    (2, |c| c.load_vector(9, General(4), 0, true, General(16)), "ldr d9, [x4, #0]", &[0xFD40_0089]),
    (1, |c| c.load_vector(10, General(1), 0, false, General(16)), "ldr d10, [x1, #0]", &[0xFD40_002A]),
    (1, |c| c.store_vector(30, General(2), 0, General(16)), "str d30, [x2, #0]", &[0xFD00_005E]),
    (2, |c| c.load_general(General(17), General(4), 0, General(16)), "ldr x17, [x4, #0]", &[0xF940_0091]),
    (2, |c| c.load_vector(9, General(4), 8, true, General(16)), "ldr d9, [x4, #8]", &[0xFD40_0489]),
    (1, |c| c.load_vector(10, General(1), 8, false, General(16)), "ldr d10, [x1, #8]", &[0xFD40_042A]),
    (1, |c| c.store_vector(30, General(2), 8, General(16)), "str d30, [x2, #8]", &[0xFD00_045E]),
    (2, |c| c.load_general(General(17), General(4), 8, General(16)), "ldr x17, [x4, #8]", &[0xF940_0491]),
    (2, |c| c.load_vector(9, General(4), 32760, true, General(16)), "ldr d9, [x4, #32760]", &[0xFD7F_FC89]),
    (1, |c| c.load_vector(10, General(1), 32760, false, General(16)), "ldr d10, [x1, #32760]", &[0xFD7F_FC2A]),
    (1, |c| c.store_vector(30, General(2), 32760, General(16)), "str d30, [x2, #32760]", &[0xFD3F_FC5E]),
    (2, |c| c.load_general(General(17), General(4), 32760, General(16)), "ldr x17, [x4, #32760]", &[0xF97F_FC91]),
    (2, |c| c.load_vector(2, General(5), 65536, false, General(16)), "mov x16, #0; movk x16, #1, lsl #16; ldr q2, [x5, x16]", &[0xD280_0010, 0xF2A0_0030, 0x3CF0_68A2]),
    (2, |c| c.load_vector(2, General(5), 24, false, General(16)), "mov x16, #24; ldr q2, [x5, x16]", &[0xD280_0310, 0x3CF0_68A2]),
    (2, |c| c.store_vector(28, General(6), 0x7FFF_FFF0, General(16)), "mov x16, #0xFFF0; movk x16, #0x7FFF, lsl #16; str q28, [x6, x16]", &[0xD29F_FE10, 0xF2AF_FFF0, 0x3CB0_68DC]),
    (2, |c| c.load_vector(2, General(4), 32768, true, General(16)), "mov x16, #32768; ldr d2, [x4, x16]", &[0xD290_0010, 0xFC70_6882]),
    (1, |c| c.load_vector(2, General(3), 32768, false, General(16)), "mov x16, #32768; ldr d2, [x3, x16]", &[0xD290_0010, 0xFC70_6862]),
    (1, |c| c.store_vector(13, General(3), 32768, General(16)), "mov x16, #32768; str d13, [x3, x16]", &[0xD290_0010, 0xFC30_686D]),
    (1, |c| c.load_general(General(17), General(4), 32768, General(16)), "mov x16, #32768; ldr x17, [x4, x16]", &[0xD290_0010, 0xF870_6891]),
    (2, |c| c.add_numbers(General(17), General(5), General(17)), "add x17, x5, x17, lsl #3", &[0x8B11_0CB1]),
    (2, |c| c.add_general(General(1), 0, General(16)), "", &[]),
    (2, |c| c.add_general(General(1), 16, General(16)), "add x1, x1, #16", &[0x9100_4021]),
    (2, |c| c.add_general(General(2), 4096, General(16)), "add x2, x2, #1, lsl #12", &[0x9140_0442]),
    (2, |c| c.add_general(General(5), 0xFF_FFFF, General(16)), "add x5, x5, #4095; add x5, x5, #4095, lsl #12", &[0x913F_FCA5, 0x917F_FCA5]),
    (2, |c| c.add_general(General(4), -0x1001, General(16)), "sub x4, x4, #1; sub x4, x4, #1, lsl #12", &[0xD100_0484, 0xD140_0484]),
    (2, |c| c.add_general(General(4), 0x0100_0000, General(16)), "mov x16, #0; movk x16, #0x100, lsl #16; add x4, x4, x16", &[0xD280_0010, 0xF2A0_2010, 0x8B10_0084]),
    (2, |c| c.add_general(General(1), i32::MIN, General(16)), "mov x16, #0; movk x16, #0x8000, lsl #16; sub x1, x1, x16", &[0xD280_0010, 0xF2B0_0010, 0xCB10_0021]),
    (2, |c| c.set_general(General(9), 65535), "mov x9, #65535", &[0xD29F_FFE9]),
    (2, |c| c.set_general(General(9), 0x1234_5678), "mov x9, #0x5678; movk x9, #0x1234, lsl #16", &[0xD28A_CF09, 0xF2A2_4689]),
    (2, |c| c.decrement_and_jump(General(7), 0), "subs x7, x7, #1; b.ne . - 4", &[0xF100_04E7, 0x54FF_FFE1]),
    (2, |c| { c.pad(); c.word(0xD503_201F); c.pad() }, "nop; nop; nop; nop; nop; nop; nop; nop", &[0xD503_201F, 0xD503_201F, 0xD503_201F, 0xD503_201F, 0xD503_201F, 0xD503_201F, 0xD503_201F, 0xD503_201F]),
    (2, |c| c.keep_vectors(), "stp d8, d9, [sp, #-64]!; stp d10, d11, [sp, #16]; stp d12, d13, [sp, #32]; stp d14, d15, [sp, #48]", &[0x6DBC_27E8, 0x6D01_2FEA, 0x6D02_37EC, 0x6D03_3FEE]),
    (2, |c| c.restore_vectors(), "ldp d14, d15, [sp, #48]; ldp d12, d13, [sp, #32]; ldp d10, d11, [sp, #16]; ldp d8, d9, [sp], #64", &[0x6D43_3FEE, 0x6D42_37EC, 0x6D41_2FEA, 0x6CC4_27E8]),
    (2, |c| c.get_rounding(General(10)), "mrs x10, fpcr", &[0xD53B_440A]),
    (2, |c| c.set_rounding(General(10)), "msr fpcr, x10", &[0xD51B_440A]),
    (2, |c| c.round_to_nearest(), "msr fpcr, xzr", &[0xD51B_441F]),
    (2, |c| c.end(), "ret", &[0xD65F_03C0]),
];

#[rustfmt::skip]
const OF_SINGLES: &[Line] = &[
    (4, |c| c.three(n::ADD, 31, 0, 17), "fadd v31.4s, v0.4s, v17.4s", &[0x4E31_D41F]),
    (1, |c| c.three(n::ADD, 31, 0, 17), "fadd s31, s0, s17", &[0x1E31_281F]),
    (4, |c| c.three(n::SUB, 30, 1, 18), "fsub v30.4s, v1.4s, v18.4s", &[0x4EB2_D43E]),
    (1, |c| c.three(n::SUB, 30, 1, 18), "fsub s30, s1, s18", &[0x1E32_383E]),
    (4, |c| c.three(n::MUL, 29, 2, 19), "fmul v29.4s, v2.4s, v19.4s", &[0x6E33_DC5D]),
    (1, |c| c.three(n::MUL, 29, 2, 19), "fmul s29, s2, s19", &[0x1E33_085D]),
    (4, |c| c.three(n::DIV, 28, 3, 20), "fdiv v28.4s, v3.4s, v20.4s", &[0x6E34_FC7C]),
    (1, |c| c.three(n::DIV, 28, 3, 20), "fdiv s28, s3, s20", &[0x1E34_187C]),
    (4, |c| c.three(n::EQUAL, 27, 4, 21), "fcmeq v27.4s, v4.4s, v21.4s", &[0x4E35_E49B]),
    (1, |c| c.three(n::EQUAL, 27, 4, 21), "fcmeq s27, s4, s21", &[0x5E35_E49B]),
    (4, |c| c.three(n::GREATER, 26, 5, 22), "fcmgt v26.4s, v5.4s, v22.4s", &[0x6EB6_E4BA]),
    (1, |c| c.three(n::GREATER, 26, 5, 22), "fcmgt s26, s5, s22", &[0x7EB6_E4BA]),
    (4, |c| c.three(n::GREATER_EQUAL, 25, 6, 23), "fcmge v25.4s, v6.4s, v23.4s", &[0x6E37_E4D9]),
    (1, |c| c.three(n::GREATER_EQUAL, 25, 6, 23), "fcmge s25, s6, s23", &[0x7E37_E4D9]),
    (4, |c| c.three(n::ADD_BITS, 24, 7, 24), "add v24.4s, v7.4s, v24.4s", &[0x4EB8_84F8]),
    (1, |c| c.three(n::ADD_BITS, 24, 7, 24), "add v24.2s, v7.2s, v24.2s", &[0x0EB8_84F8]),
    (4, |c| c.three(n::SUB_BITS, 24, 7, 24), "sub v24.4s, v7.4s, v24.4s", &[0x6EB8_84F8]),
    (1, |c| c.three(n::SUB_BITS, 24, 7, 24), "sub v24.2s, v7.2s, v24.2s", &[0x2EB8_84F8]),
    (4, |c| c.three(n::AND, 0, 30, 9), "and v0.16b, v30.16b, v9.16b", &[0x4E29_1FC0]),
    (1, |c| c.three(n::AND, 0, 30, 9), "and v0.8b, v30.8b, v9.8b", &[0x0E29_1FC0]),
    (4, |c| c.three(n::OR, 1, 29, 10), "orr v1.16b, v29.16b, v10.16b", &[0x4EAA_1FA1]),
    (1, |c| c.three(n::OR, 1, 29, 10), "orr v1.8b, v29.8b, v10.8b", &[0x0EAA_1FA1]),
    (4, |c| c.three(n::XOR, 2, 28, 11), "eor v2.16b, v28.16b, v11.16b", &[0x6E2B_1F82]),
    (1, |c| c.three(n::XOR, 2, 28, 11), "eor v2.8b, v28.8b, v11.8b", &[0x2E2B_1F82]),
    (4, |c| c.three(n::CHOOSE, 3, 27, 12), "bsl v3.16b, v27.16b, v12.16b", &[0x6E6C_1F63]),
    (1, |c| c.three(n::CHOOSE, 3, 27, 12), "bsl v3.8b, v27.8b, v12.8b", &[0x2E6C_1F63]),
    (4, |c| c.three(n::INSERT_WHERE, 4, 26, 13), "bit v4.16b, v26.16b, v13.16b", &[0x6EAD_1F44]),
    (1, |c| c.three(n::INSERT_WHERE, 4, 26, 13), "bit v4.8b, v26.8b, v13.8b", &[0x2EAD_1F44]),
    (4, |c| c.three(n::INSERT_WHERE_NOT, 5, 25, 14), "bif v5.16b, v25.16b, v14.16b", &[0x6EEE_1F25]),
    (1, |c| c.three(n::INSERT_WHERE_NOT, 5, 25, 14), "bif v5.8b, v25.8b, v14.8b", &[0x2EEE_1F25]),
    (4, |c| c.two(n::SQRT, 31, 14), "fsqrt v31.4s, v14.4s", &[0x6EA1_F9DF]),
    (1, |c| c.two(n::SQRT, 31, 14), "fsqrt s31, s14", &[0x1E21_C1DF]),
    (4, |c| c.two(n::NEG, 30, 15), "fneg v30.4s, v15.4s", &[0x6EA0_F9FE]),
    (1, |c| c.two(n::NEG, 30, 15), "fneg s30, s15", &[0x1E21_41FE]),
    (4, |c| c.two(n::FLOOR, 29, 16), "frintm v29.4s, v16.4s", &[0x4E21_9A1D]),
    (1, |c| c.two(n::FLOOR, 29, 16), "frintm s29, s16", &[0x1E25_421D]),
    (4, |c| c.two(n::shift_up(32, 0), 3, 29), "shl v3.4s, v29.4s, #0", &[0x4F20_57A3]),
    (1, |c| c.two(n::shift_up(32, 0), 3, 29), "shl v3.2s, v29.2s, #0", &[0x0F20_57A3]),
    (4, |c| c.two(n::shift_up(32, 1), 3, 29), "shl v3.4s, v29.4s, #1", &[0x4F21_57A3]),
    (1, |c| c.two(n::shift_up(32, 1), 3, 29), "shl v3.2s, v29.2s, #1", &[0x0F21_57A3]),
    (4, |c| c.two(n::shift_up(32, 23), 3, 29), "shl v3.4s, v29.4s, #23", &[0x4F37_57A3]),
    (1, |c| c.two(n::shift_up(32, 23), 3, 29), "shl v3.2s, v29.2s, #23", &[0x0F37_57A3]),
    (4, |c| c.two(n::shift_up(32, 31), 3, 29), "shl v3.4s, v29.4s, #31", &[0x4F3F_57A3]),
    (1, |c| c.two(n::shift_up(32, 31), 3, 29), "shl v3.2s, v29.2s, #31", &[0x0F3F_57A3]),
    (4, |c| c.two(n::shift_down(32, 1), 30, 7), "ushr v30.4s, v7.4s, #1", &[0x6F3F_04FE]),
    (1, |c| c.two(n::shift_down(32, 1), 30, 7), "ushr v30.2s, v7.2s, #1", &[0x2F3F_04FE]),
    (4, |c| c.two(n::shift_down(32, 23), 30, 7), "ushr v30.4s, v7.4s, #23", &[0x6F29_04FE]),
    (1, |c| c.two(n::shift_down(32, 23), 30, 7), "ushr v30.2s, v7.2s, #23", &[0x2F29_04FE]),
    (4, |c| c.two(n::shift_down(32, 31), 30, 7), "ushr v30.4s, v7.4s, #31", &[0x6F21_04FE]),
    (1, |c| c.two(n::shift_down(32, 31), 30, 7), "ushr v30.2s, v7.2s, #31", &[0x2F21_04FE]),
    (4, |c| c.overwrite(n::ADD_PRODUCT, 1, 30, 20), "fmla v1.4s, v30.4s, v20.4s", &[0x4E34_CFC1]),
    (4, |c| c.overwrite(n::SUB_PRODUCT, 31, 0, 15), "fmls v31.4s, v0.4s, v15.4s", &[0x4EAF_CC1F]),
    (1, |c| c.fused(n::MUL_ADD, 4, 31, 16, 9), "fmadd s4, s31, s16, s9", &[0x1F10_27E4]),
    (1, |c| c.fused(n::SUB_MUL, 30, 2, 19, 31), "fmsub s30, s2, s19, s31", &[0x1F13_FC5E]),
    (1, |c| c.fused(n::MUL_SUB, 17, 18, 3, 0), "fnmsub s17, s18, s3, s0", &[0x1F23_8251]),
    (4, |c| c.two(n::shift_down(32, 32), 30, 7), "ushr v30.4s, v7.4s, #32", &[0x6F20_04FE]),
    (1, |c| c.two(n::shift_down(32, 32), 30, 7), "ushr v30.2s, v7.2s, #32", &[0x2F20_04FE]),
    (4, |c| c.move_vector(31, 6), "mov v31.16b, v6.16b", &[0x4EA6_1CDF]),
    (1, |c| c.move_vector(5, 25), "mov v5.8b, v25.8b", &[0x0EB9_1F25]),
    (4, |c| c.spread(26, 11), "dup v26.4s, v11.s[0]", &[0x4E04_057A]),
    (4, |c| c.load_vector(31, General(3), 16, false, General(16)), "ldr q31, [x3, #16]", &[0x3DC0_047F]),
    (4, |c| c.store_vector(8, General(6), 65520, General(16)), "str q8, [x6, #65520]", &[0x3DBF_FCC8]),
    (4, |c| c.load_vector(9, General(4), 0, true, General(16)), "ldr s9, [x4, #0]", &[0xBD40_0089]),
    (1, |c| c.load_vector(10, General(1), 0, false, General(16)), "ldr s10, [x1, #0]", &[0xBD40_002A]),
    (1, |c| c.store_vector(30, General(2), 0, General(16)), "str s30, [x2, #0]", &[0xBD00_005E]),
    (4, |c| c.load_vector(9, General(4), 4, true, General(16)), "ldr s9, [x4, #4]", &[0xBD40_0489]),
    (1, |c| c.load_vector(10, General(1), 4, false, General(16)), "ldr s10, [x1, #4]", &[0xBD40_042A]),
    (1, |c| c.store_vector(30, General(2), 4, General(16)), "str s30, [x2, #4]", &[0xBD00_045E]),
    (4, |c| c.load_vector(9, General(4), 16380, true, General(16)), "ldr s9, [x4, #16380]", &[0xBD7F_FC89]),
    (1, |c| c.load_vector(10, General(1), 16380, false, General(16)), "ldr s10, [x1, #16380]", &[0xBD7F_FC2A]),
    (1, |c| c.store_vector(30, General(2), 16380, General(16)), "str s30, [x2, #16380]", &[0xBD3F_FC5E]),
    (4, |c| c.load_vector(2, General(5), 20, false, General(16)), "mov x16, #20; ldr q2, [x5, x16]", &[0xD280_0290, 0x3CF0_68A2]),
    (4, |c| c.store_vector(28, General(6), 65536, General(16)), "mov x16, #0; movk x16, #1, lsl #16; str q28, [x6, x16]", &[0xD280_0010, 0xF2A0_0030, 0x3CB0_68DC]),
    (4, |c| c.load_vector(2, General(4), 16384, true, General(16)), "mov x16, #16384; ldr s2, [x4, x16]", &[0xD288_0010, 0xBC70_6882]),
    (1, |c| c.load_vector(2, General(3), 16384, false, General(16)), "mov x16, #16384; ldr s2, [x3, x16]", &[0xD288_0010, 0xBC70_6862]),
    (1, |c| c.store_vector(13, General(3), 16384, General(16)), "mov x16, #16384; str s13, [x3, x16]", &[0xD288_0010, 0xBC30_686D]),
    (1, |c| c.load_general(General(17), General(4), 8, General(16)), "ldr x17, [x4, #8]", &[0xF940_0491]),
    (4, |c| c.add_numbers(General(17), General(5), General(17)), "add x17, x5, x17, lsl #2", &[0x8B11_08B1]),
];

/// The size of a number in bytes, and the lines for numbers of that size.
const TABLES: [(usize, &[Line]); 2] = [(8, OF_DOUBLES), (4, OF_SINGLES)];

fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
}

#[test]
fn instructions_have_the_words_of_an_assembler() {
    for (size, lines) in TABLES {
        for (width, write, text, want) in lines {
            let mut code = Code { bytes: Vec::new(), width: *width, size };
            write(&mut code);
            assert_eq!(words(&code.bytes), *want, "{text}");
        }
    }
}

/// The tables are what the assembler makes, where there is one.
#[test]
fn the_tables_are_the_assembler_s() {
    if !crate::has("aarch64-linux-gnu-as") || !crate::has("aarch64-linux-gnu-objcopy") {
        return crate::skipped("there is no aarch64-linux-gnu-as");
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let [text, object, binary] = ["words.s", "words.o", "words.bin"].map(|name| folder.join(name));
    let table = || TABLES.iter().flat_map(|(_, lines)| *lines);
    let lines: Vec<&str> = table().flat_map(|(_, _, text, _)| text.split("; ")).collect();
    fs::write(&text, lines.join("\n") + "\n").unwrap();
    assert!(Command::new("aarch64-linux-gnu-as").arg("-o").args([&object, &text]).status().unwrap().success());
    let copied =
        Command::new("aarch64-linux-gnu-objcopy").args(["-O", "binary", "-j", ".text"]).args([&object, &binary]).status();
    assert!(copied.unwrap().success());
    let want: Vec<u32> = table().flat_map(|(_, _, _, words)| words.iter().copied()).collect();
    assert_eq!(words(&fs::read(&binary).unwrap()), want);
}

/// A branch on a condition reaches 2²⁰ bytes, another one 2²⁷.
#[test]
fn a_jump_that_is_too_far_for_its_condition_is_made_by_another() {
    for far in [false, true] {
        // The branch itself is the second instruction behind so many: 2¹⁸ words back at the farthest.
        let before = (1 << 18) - 1 + usize::from(far);
        let mut code = Code { bytes: vec![0; 4 * before], width: 2, size: 8 };
        code.decrement_and_jump(General(7), 0);
        let made = words(&code.bytes[4 * before..]);
        let subtract = 0xF100_04E7; // subs x7, x7, #1
        if far {
            let back = (1 << 26) - (before as u32 + 2);
            assert_eq!(made, [subtract, 0x5400_0040, 0x1400_0000 | back]); // b.eq over the next, b
        } else {
            let back = (1 << 19) - (before as u32 + 1);
            assert_eq!(made, [subtract, 0x5400_0001 | back << 5]); // b.ne
        }
    }
}
