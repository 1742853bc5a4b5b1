// Functions of complex numbers that NumPy takes from the C library of Windows, and that the one of Wine 8.0 lacks: without them
// `import numpy` ends in "unimplemented function ucrtbase.dll.crealf". They are those of MinGW, called as Microsoft's compiler does.
#include <complex.h>

typedef struct { double re, im; } Complex;
typedef struct { float re, im; } Single;
typedef double complex Number;

static Number of(Complex z) { return __builtin_complex(z.re, z.im); }
static Number of_single(Single z) { return __builtin_complex((double)z.re, (double)z.im); }
static Complex complex_of(Number z) { return (Complex){creal(z), cimag(z)}; }
static Single single_of(Number z) { return (Single){(float)creal(z), (float)cimag(z)}; }

// Numbers of more than 64 bits do not exist there: `l` stands for doubles.
#define TO_COMPLEX(name) \
    Complex own_##name(Complex z) { return complex_of(name(of(z))); } \
    Complex own_##name##l(Complex z) { return complex_of(name(of(z))); } \
    Single own_##name##f(Single z) { return single_of(name(of_single(z))); }
#define TO_REAL(name) \
    double own_##name(Complex z) { return name(of(z)); } \
    double own_##name##l(Complex z) { return name(of(z)); } \
    float own_##name##f(Single z) { return (float)name(of_single(z)); }

TO_COMPLEX(ccos) TO_COMPLEX(ccosh) TO_COMPLEX(cexp) TO_COMPLEX(csin) TO_COMPLEX(csinh) TO_COMPLEX(ctan) TO_COMPLEX(ctanh)
TO_REAL(cabs) TO_REAL(carg) TO_REAL(cimag) TO_REAL(creal)
Complex own_cpow(Complex a, Complex b) { return complex_of(cpow(of(a), of(b))); }
Complex own_cpowl(Complex a, Complex b) { return complex_of(cpow(of(a), of(b))); }
Single own_cpowf(Single a, Single b) { return single_of(cpow(of_single(a), of_single(b))); }
