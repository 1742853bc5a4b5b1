#!/bin/sh
# The core's tests under what watches memory and threads: tests/campaign/sanitizers.sh address|thread|miri|valgrind, from the root.
#
# Machine code that is written at run time is not instrumented, so the first two see the interpreter, the driver and everything around
# kernels; valgrind sees the machine code as well, up to AVX2. Miri interprets Rust: it has no executable pages and is slow, so it is
# given the tape, its passes, and steps by the interpreter.
set -eu
how=$1
here=$(rustc -vV | sed -n 's/host: //p')
tests="--test driver --test functions --test kernels --test large --test random_systems --test steps --test tape"
export STEPWELL_FUZZ="${STEPWELL_FUZZ:-20000}" PROPTEST_CASES="${PROPTEST_CASES:-16}"
case $how in
address | thread)
    # The standard library is built with the sanitizer as well: a thread sanitizer that does not see its locks reports races that are none.
    RUSTFLAGS="-Zsanitizer=$how" ASAN_OPTIONS="detect_leaks=1" \
        cargo +nightly test -Zbuild-std --release --target "$here" --target-dir "${CARGO_TARGET_DIR:-target}/$how" \
        -p stepwell-core $tests -- --skip process::
    ;;
miri)
    export MIRIFLAGS="${MIRIFLAGS:--Zmiri-disable-isolation -Zmiri-ignore-leaks}" STEPWELL_KERNELS=interpret
    cargo +nightly miri test --target-dir "${CARGO_TARGET_DIR:-target}/miri" -p stepwell-core --test tape
    ;;
valgrind)
    cargo test --release --no-run -p stepwell-core --test kernels --test random_systems
    for test in kernels random_systems; do
        binary=$(find "${CARGO_TARGET_DIR:-target}/release/deps" -maxdepth 1 -name "$test-*" -perm -u+x ! -name '*.d' -printf '%T@ %p\n' |
            sort -n | tail -1 | cut -d' ' -f2)
        valgrind --quiet --error-exitcode=9 --smc-check=all --track-origins=no "$binary" --test-threads 1 --skip process::
    done
    ;;
*)
    echo "address, thread, miri or valgrind?" && exit 2
    ;;
esac
