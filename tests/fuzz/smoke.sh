#!/bin/sh
# smoke.sh SECONDS [TARGET...]: libFuzzer on each target for so long, from the seeds. Builds the programs in
# $RX_BUILD_DIR/fuzz when they are not there, with clang, the address and the undefined-behaviour sanitizers.
# What is found lies in $RX_BUILD_DIR/fuzz/found; the inputs that reached new code in $RX_BUILD_DIR/fuzz/corpus.
set -u
build=${RX_BUILD_DIR:?}/fuzz source=${srcdir:?}
seconds=${1:-1}
[ $# -gt 0 ] && shift
clang=$(command -v clang || command -v clang-14)
passed=0 failed=0

if ! echo 'int LLVMFuzzerTestOneInput(const char *d, long n); int LLVMFuzzerTestOneInput(const char *d, long n) { return !d && n; }' |
    "${clang:-false}" -fsanitize=fuzzer,address -x c -o /dev/null - 2>/dev/null; then
    echo "no clang with libFuzzer (Debian packages clang, libclang-rt-dev)"
    echo "0 passed, 0 failed, 1 skipped"
    exit 0
fi
mkdir -p "$build/corpus" "$build/found" "$build/seeds" && cd "$build" || exit 2
if [ ! -f Makefile ]; then
    "$source/configure" --disable-shared --without-mpi CC="${RX_FUZZ_CC:-$clang}" \
        CFLAGS='-O1 -g -fno-omit-frame-pointer -ffunction-sections -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined' \
        >configure.log 2>&1 || { tail -n 20 configure.log; exit 1; }
    # Kernels of one processor, which no outside byte reaches: with sanitizers clang takes half an hour for them.
    make librextract-direct4.la librextract-direct8.la librextract-direct16.la CFLAGS='-O1 -g' >build.log 2>&1
fi
make -j"${RX_FUZZ_JOBS:-2}" fuzz-programs >>build.log 2>&1 || { tail -n 20 build.log; exit 1; }
"$RX_BUILD_DIR/tests/fuzz/seeds" "$build/seeds" "$source/tests/fuzz/texts" || exit 1
LSAN_OPTIONS="suppressions=$source/tests/fuzz/lsan.supp:print_suppressions=0"
OMP_NUM_THREADS=1
export LSAN_OPTIONS OMP_NUM_THREADS

all=$(sed -n 's/^TARGET(\([a-z]*\),.*/\1/p' "$source/tests/fuzz/targets.def")
[ $# -gt 0 ] && all=$*
for target in $all; do
    most=$(sed -n "s/^TARGET($target, \([0-9]*\),.*/\1/p" "$source/tests/fuzz/targets.def")
    mkdir -p "corpus/$target" "found/$target"
    case $target in
    table | psf | model | tile | maps | wcs | templates | repeated) words=fits ;;
    *) words=text ;;
    esac
    cat "$source/tests/fuzz/$words.dict" >>"seeds/$target.dict"
    if "./fuzz/$target" -max_total_time="$seconds" -max_len="$most" -rss_limit_mb=2048 -timeout=20 \
        -dict="seeds/$target.dict" -artifact_prefix="found/$target/" -print_final_stats=1 \
        "corpus/$target" "seeds/$target" >"$target.log" 2>&1; then
        passed=$((passed + 1))
        echo "PASS: $target ($(sed -n 's/^stat::number_of_executed_units: *//p' "$target.log") executions)"
    else
        failed=$((failed + 1))
        echo "FAIL: $target"
        grep -A 12 -E 'ERROR|runtime error|does not hold' "$target.log"
    fi
done
echo "$passed passed, $failed failed, 0 skipped"
[ "$failed" -eq 0 ]
