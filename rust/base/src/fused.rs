//! Fused multiply-adds where the C library has none that rounds once.
//!
//! `f64::mul_add` is an instruction where the CPU has one and the caller was compiled for it, and else the C library's `fma`.
//! MinGW's `fma`, against which programs for Windows are linked, rounds twice: of four million random triples it was wrong for
//! one in eight. A function of the same name in the program itself comes before a library's, so these two are what is called.

/// a·b + c rounded once.
#[allow(unsafe_code, reason = "the name is the C library's, and so are the types")]
#[unsafe(no_mangle)]
extern "C" fn fma(a: f64, b: f64, c: f64) -> f64 {
    libm::fma(a, b, c)
}

/// a·b + c of float32, rounded once.
#[allow(unsafe_code, reason = "the name is the C library's, and so are the types")]
#[unsafe(no_mangle)]
extern "C" fn fmaf(a: f32, b: f32, c: f32) -> f32 {
    libm::fmaf(a, b, c)
}
