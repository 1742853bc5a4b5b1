//! Machine code, read back: that it touches nothing but its frame, and does nothing but arithmetic.

use iced_x86::{Decoder, DecoderOptions, FlowControl, Instruction, Mnemonic, OpAccess, OpKind, Register};
use stepwell_core::kernel::writer::{Assembled, Written};

/// Panics if anything is in the code that should not be. Fused multiply-adds should be if the body has some. Returns how many
/// instructions move numbers between lanes.
pub(crate) fn read(kernel: &Written, is_fused: bool) -> usize {
    let mut moves = 0;
    let (code, frame, shape) = (kernel.code(), kernel.frame(), kernel.shape());
    let mut decoder = Decoder::with_ip(64, code, 0, DecoderOptions::NONE);
    let mut starts = Vec::new();
    let (mut branches, mut pushes) = (0, 0);
    let bytes = shape.bytes as u64;
    let row = bytes * frame.lanes as u64;
    let block = bytes * (shape.width * shape.block_vectors) as u64;
    let in_rows = |at: u64, size: u64, rows: usize| at / row < rows as u64 && at % row + size <= block;
    loop {
        let i = decoder.decode();
        assert!(!i.is_invalid(), "no instruction at {:#x}", i.ip());
        starts.push(i.ip());
        let is_single = bytes == 4;
        assert!(is_known(i.mnemonic(), is_single) || is_fused && is_multiply_add(i.mnemonic(), is_single), "{i}");
        pushes += usize::from(i.mnemonic() == Mnemonic::Push);
        moves += usize::from(matches!(
            i.mnemonic(),
            Mnemonic::Vshufpd
                | Mnemonic::Vinsertf128
                | Mnemonic::Vinsertf64x2
                | Mnemonic::Vextractf128
                | Mnemonic::Vextractf64x2
                | Mnemonic::Vpermpd
        ));
        match i.flow_control() {
            FlowControl::Next => {}
            FlowControl::Return => break,
            FlowControl::ConditionalBranch => {
                branches += 1;
                let to = i.near_branch_target();
                assert!(i.mnemonic() == Mnemonic::Jne && starts.binary_search(&to).is_ok(), "{i} does not go back");
            }
            _ => panic!("{i}"),
        }
        for register in
            i.op_kinds().enumerate().filter(|(_, kind)| *kind == OpKind::Register).map(|(n, _)| i.op_register(n as u32))
        {
            let general = register.is_gpr();
            let full = register.full_register();
            let ours = [
                Register::RAX,
                Register::RCX,
                Register::RDX,
                Register::RBX,
                Register::RSI,
                Register::RDI,
                Register::R8,
                Register::R9,
                Register::R10,
                Register::R11,
            ];
            assert!(!general || ours.contains(&full), "{i}");
        }
        moves_on(&i, block, shape.blocks as u64);
        if i.mnemonic() != Mnemonic::Nop && i.op_kinds().any(|kind| kind == OpKind::Memory) {
            let (size, at) = (i.memory_size().size() as u64, i.memory_displacement64());
            let writes = writes(&i);
            let is_held = i.memory_index() == Register::RAX && i.memory_index_scale() == shape.bytes as u32;
            assert!(is_held || i.memory_index() == Register::None, "{i}");
            let (inside, may_write) = match (i.memory_base(), is_held) {
                (Register::RDI, false) => (in_rows(at, size, frame.body.next.len()), true),
                (Register::RSI, false) => (in_rows(at, size, frame.body.rows), false),
                (Register::R10, true) => (in_rows(at, size, 1), false),
                (Register::RDX, false) => (at + size <= bytes * frame.pool as u64, false),
                (Register::R8, false) => (at + size <= 8 * frame.body.per_step as u64, false),
                (Register::R9, false) => (at + size <= bytes * frame.scratch as u64, true),
                (Register::RBX, false) => (at + size <= 64, at == 56 && size == 4),
                _ => (false, false),
            };
            assert!(inside && (!writes || may_write), "{i}: {at:#x} and {size} bytes are outside of {frame:?}, {shape:?}");
        }
    }
    assert!(branches <= 2);
    // One word of the stack, and no operand is there: no guard page of Windows is passed over, and nothing is below rsp.
    assert_eq!(pushes, 1);
    moves
}

/// How many sums and products are written before the first instruction that reads the state of a vector of the block.
pub(crate) fn sums_before(assembled: &Assembled, vector: u64) -> usize {
    let row = (assembled.shape.bytes * assembled.frame.lanes) as u64;
    let size = (assembled.shape.bytes * assembled.shape.width) as u64;
    let is_of = |i: &Instruction| i.memory_base() == Register::RDI && i.memory_displacement64() % row / size == vector;
    let arithmetic = [Mnemonic::Vaddpd, Mnemonic::Vsubpd, Mnemonic::Vmulpd];
    let decoder = Decoder::with_ip(64, &assembled.code, 0, DecoderOptions::NONE);
    decoder.into_iter().take_while(|i| !is_of(i)).filter(|i| arithmetic.contains(&i.mnemonic())).count()
}

/// Which vector registers are in the code.
#[cfg(windows)]
pub(crate) fn vectors(kernel: &Written) -> Vec<usize> {
    let decoder = Decoder::with_ip(64, kernel.code(), 0, DecoderOptions::NONE);
    let registers = decoder.into_iter().flat_map(|i| [i.op0_register(), i.op1_register(), i.op2_register()]);
    registers.filter(|register| register.is_vector_register()).map(|register| register.number()).collect()
}

fn writes(i: &Instruction) -> bool {
    let mut factory = iced_x86::InstructionInfoFactory::new();
    let info = factory.info(i);
    let reads = |access: OpAccess| matches!(access, OpAccess::Read | OpAccess::CondRead | OpAccess::None | OpAccess::NoMemAccess);
    info.used_memory().iter().any(|memory| !reads(memory.access()))
}

/// Checks that pointers to rows move by blocks only.
fn moves_on(i: &Instruction, block: u64, blocks: u64) {
    let to = i.op0_register();
    if i.mnemonic() == Mnemonic::Add {
        let by = i.immediate(1) as i64;
        match to {
            Register::RDI | Register::RSI | Register::R10 => {
                assert!(by == block as i64 || by == -((block * blocks) as i64), "{i}");
            }
            Register::R8 => assert!(by > 0),
            _ => panic!("{i}"),
        }
    }
}

fn is_multiply_add(mnemonic: Mnemonic, is_single: bool) -> bool {
    let name = format!("{mnemonic:?}");
    ["Vfmadd", "Vfmsub", "Vfnmadd"].iter().any(|kind| name.starts_with(kind))
        && (name.ends_with(if is_single { "ps" } else { "pd" }) || name.ends_with(if is_single { "ss" } else { "sd" }))
}

/// Whether kernels may have this instruction. All others are not exact, or not the same on all machines.
fn is_known(mnemonic: Mnemonic, is_single: bool) -> bool {
    use Mnemonic::*;
    #[rustfmt::skip]
    let double = [
        Vaddpd, Vaddsd, Vsubpd, Vsubsd, Vmulpd, Vmulsd, Vminpd, Vminsd, Vmaxpd, Vmaxsd, Vdivpd, Vdivsd, Vsqrtpd, Vsqrtsd, Vcmppd, Vcmpsd, Vroundpd, Vroundsd,
        Vrndscalepd, Vrndscalesd, Vandpd, Vandnpd, Vorpd, Vxorpd, Vpaddq, Vpsllq, Vpsrlq, Vblendmpd, Vblendvpd, Vpternlogq, Vpmovm2q,
        Vmovupd, Vmovapd, Vmovsd, Vbroadcastsd,
        Vshufpd, Vinsertf128, Vinsertf64x2, Vextractf128, Vextractf64x2, Vpermpd,
    ];
    #[rustfmt::skip]
    let single = [
        Vaddps, Vaddss, Vsubps, Vsubss, Vmulps, Vmulss, Vminps, Vminss, Vmaxps, Vmaxss, Vdivps, Vdivss, Vsqrtps, Vsqrtss, Vcmpps, Vcmpss, Vroundps, Vroundss,
        Vrndscaleps, Vrndscaless, Vandps, Vandnps, Vorps, Vxorps, Vpaddd, Vpslld, Vpsrld, Vblendmps, Vblendvps, Vpternlogd, Vpmovm2d,
        Vmovups, Vmovaps, Vmovss, Vbroadcastss,
    ];
    #[rustfmt::skip]
    let both = [Mov, Add, Dec, Jne, Push, Pop, Ret, Stmxcsr, Ldmxcsr, Vstmxcsr, Vldmxcsr, Vzeroupper, Nop];
    both.contains(&mnemonic) || if is_single { single.contains(&mnemonic) } else { double.contains(&mnemonic) }
}
