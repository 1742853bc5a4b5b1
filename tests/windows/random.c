// `bcryptprimitives.dll`, which Rust's standard library asks for random numbers, and which Wine 8.0 lacks: no program of Rust starts
// without it ("Library bcryptprimitives.dll not found").
#include <windows.h>
#include <ntsecapi.h>

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE into, SIZE_T bytes) { return RtlGenRandom(into, (ULONG)bytes); }
