#!/bin/sh
# The network's kernels on another processor: tests/unit/nn/test_direct.c, compiled for aarch64 (vectors of 4 floats, NEON) and
# run by qemu. Skipped where the compiler or qemu is missing (Debian: gcc-aarch64-linux-gnu, libc6-dev-arm64-cross,
# qemu-user-static). Not part of `make check`: half a minute, for the same sources on every machine.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
cc=${AARCH64_CC:-aarch64-linux-gnu-gcc}
qemu=$(command -v qemu-aarch64-static || command -v qemu-aarch64)
for tool in "$cc" "${qemu:-qemu-aarch64}"; do
    command -v "$tool" >/dev/null || {
        echo "aarch64.sh: no $tool"
        echo '0 passed, 0 failed, 1 skipped'
        exit 0
    }
done
scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-aarch64-XXXXXX") || exit 2
trap 'rm -rf "$scratch"' EXIT
trap 'exit 2' INT TERM HUP
cd "$top" || exit 2
status=0
# the flags of configure; without threads (base/threads.c needs OpenMP) some parameters of base/ are unused
compile() {
    "$cc" -std=c11 -O2 -Wall -Wextra -Wpedantic -Werror -Wno-unused-parameter -fopenmp-simd -ffp-contract=off -fno-math-errno \
        -D_GNU_SOURCE -static -Itests/cross -Isrc "$@"
}
for lanes in 4 8 16; do
    compile -DRX_LANES=$lanes -c src/nn/direct_kernels.c -o "$scratch/direct$lanes.o" || status=1
done
compile tests/unit/nn/test_direct.c src/nn/direct.c src/nn/layers.c src/base/[!t]*.c src/base/text.c "$scratch"/direct*.o \
    -o "$scratch/test_direct" -lm &&
    "$qemu" "$scratch/test_direct" || status=1
[ $status -eq 0 ] && echo '1 passed, 0 failed, 0 skipped' || echo '0 passed, 1 failed, 0 skipped'
exit $status
