#!/bin/sh
# Many small tiles through one process: neither its memory nor its open files may grow.
#
#   RX_SOAK=N            tiles of each list (60; 24 under the address sanitizer)
#   RX_SOAK_ONLY=REGEX   the matching lists alone
#
# rextract @LIST, with what restores and measures in different ways; the list is a small tile, 96 x 96 pixels, N
# times. While it runs, VmRSS and the number of open descriptors are read about once a tile. Growth is what the
# last fifth of the samples has more than the second fifth, of the smallest of each: what a tile takes while it is
# at work goes up and down. Allowed are 6 descriptors (a tile at work has 3 more, and few samples may all have met
# one at work; a leak in each tile makes 14 or more), 2 MiB, and 1 KiB a tile: sep_extract() 1.2.1 loses two arrays
# of 4 bytes a source (tests/lsan.supp), which also keep what is freed around them from being used well.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
build=${RX_BUILD_DIR:-$top}
program=${RX_PROGRAM:-$build/rextract}
for needed in "$program" "$build/tests/cli/make_fits"; do
    [ -x "$needed" ] || {
        echo "soak.sh: $needed is missing; build first (make check)"
        exit 2
    }
done
[ -r /proc/self/fd ] || { echo 'soak.sh: no /proc here'; exit 77; }
scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-soak-XXXXXX") || exit 2
trap 'rm -rf "$scratch"' EXIT
trap 'exit 2' INT TERM HUP
cd "$scratch" || exit 2
passed=0 failed=0 skipped=0
slack=2048 usual=60
# freed memory waits in quarantine there, and shadows grow with it
grep -q __asan_init "$program" && slack=400000 usual=24
tiles=${RX_SOAK:-$usual}

"$build/tests/cli/make_fits" tile tile.fits || exit 2
"$build/tests/cli/make_fits" table ref.fits || exit 2
i=0
while [ $i -lt "$tiles" ]; do
    ln -s tile.fits "t$i.fits"
    echo "t$i.fits"
    i=$((i + 1))
done >list

# watch PROCESS: a line "KIBIBYTES DESCRIPTORS" each time the log tells of another tile.
watch() {
    seen=0
    while [ -r "/proc/$1/status" ]; do
        now=$(grep -c '^rextract: tile ' log)
        if [ "$now" -gt "$seen" ]; then
            seen=$now
            memory=$(sed -n 's/^VmRSS:[^0-9]*\([0-9]*\).*/\1/p' "/proc/$1/status" 2>/dev/null)
            files=$(find "/proc/$1/fd" -mindepth 1 2>/dev/null | wc -l)
            [ -z "$memory" ] || [ "$files" = 0 ] || echo "$memory $files" # not of one that just ends
        fi
        sleep 0.005
    done
}

# soak TITLE ARGUMENT...
soak() {
    title=$1
    shift
    printf '%s\n' "$title" | grep -Eq -- "${RX_SOAK_ONLY:-.}" || return 0
    mkdir out
    : >log
    "$program" @list -c "$top/config/default.sex" -PARAMETERS_NAME "$top/config/default.param" -FILTER N -NTHREADS 1 \
        -CATALOG_NAME 'out/{tile}.cat' -CATALOG_TYPE FITS_LDAC "$@" 2>log &
    process=$!
    watch "$process" >samples
    wait "$process"
    code=$?
    written=$(find out -name 't*.cat' | wc -l)
    rm -rf out
    awk -v code=$code -v slack=$slack -v tiles="$tiles" -v written="$written" -v title="$title" '
        function smallest(from, to, column,    i, word, least) {
            for (i = from; i <= to; i++) {
                split(line[i], word, " ")
                if (i == from || word[column] + 0 < least)
                    least = word[column] + 0
            }
            return least
        }
        { line[NR] = $0 }
        END {
            n = NR
            if (code != 0 || written != tiles) {
                printf "%s: exit status %d, %d of %d catalogues\n", title, code, written, tiles
                exit 1
            }
            if (n < 5) {
                printf "skipped: %s: %d samples only, this machine is too busy\n", title, n
                exit 77
            }
            f = int(n / 5)
            early = smallest(f + 1, 2 * f, 1); late = smallest(n - f + 1, n, 1)
            few = smallest(f + 1, 2 * f, 2); many = smallest(n - f + 1, n, 2)
            printf "%s: %d tiles, %d samples: memory %d -> %d KiB (%+d), descriptors %d -> %d\n", title, tiles, n,
                early, late, late - early, few, many
            exit late - early > slack + tiles || many - few > 6
        }' samples
    case $? in
    0) passed=$((passed + 1)) ;;
    77) skipped=$((skipped + 1)) ;;
    *)
        failed=$((failed + 1))
        echo "FAILED: $title"
        tail -n 3 log
        ;;
    esac
}

moffat='-PSF_TYPE MOFFAT -PSF_FWHM 3'
# shellcheck disable=SC2086 # two arguments each
{
    soak NONE -RESTORE_TYPE NONE -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME 'out/{tile}-b.fits'
    soak RL -RESTORE_TYPE RL $moffat -RL_NITER 5 -REFERENCE_NAME ref.fits -QA_NAME 'out/{tile}-qa' -QA_FIGURES N \
        -RECORD_NAME 'out/{tile}.record'
    soak NET -RESTORE_TYPE NET $moffat -NET_MODEL "$top/config/psfnet.fits"
    soak templates -RESTORE_TYPE NONE $moffat -PARAMETERS_NAME "$top/config/template.param"
}
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
