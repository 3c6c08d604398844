#!/bin/sh
# Command line tests: run.sh [FILE.sh...] runs the cases of tests/cli/cases/*.sh, or of those named, with the
# program $RX_PROGRAM, the ones beside it, and the helpers make_fits and make_model of the build in
# $RX_BUILD_DIR.
#
# A file of cases is a shell script made of
#
#   begin NAME                       a new case in a scratch folder of its own, which is the current one
#   of PROGRAM                       it is about another program, not rextract
#   leaves FILE...                   what the program may leave there besides what it found (nothing)
#   expect CODE PATTERN ARGUMENT...  run the program; exit code, and an extended regular expression for
#                                    standard error. The program is told to be quiet, so standard error
#                                    must be exactly one line, or empty where PATTERN is ''
#   talks PATTERN ARGUMENT...        the same where it is not told to be quiet: all that it says, as one line
#   skip WHY                         instead of expect
#
# Standard output must be empty unless `prints PATTERN` said otherwise; `says N` is for another number of
# lines on standard error; expect_exactly passes the arguments as they are. RX_TEST_ONLY=REGEX runs the matching
# cases alone, RX_TEST_NOT=REGEX leaves them out; the scratch folders are kept with RX_TEST_KEEP=1.
set -u
LC_ALL=C
export LC_ALL

top=$(cd "${srcdir:-$(dirname "$0")/../..}" && pwd)
build=${RX_BUILD_DIR:-$top}
rextract=${RX_PROGRAM:-$build/rextract}
programs=$(cd "$(dirname "$rextract")" && pwd)
program=$rextract
fits=$build/tests/cli/make_fits
model=$build/tests/cli/make_model
for needed in "$rextract" "$programs/rextract-simulate" "$programs/rextract-validate" "$programs/rextract-train" "$fits" "$model" \
    "$build/tests/cli/list_files"; do
    [ -x "$needed" ] || {
        echo "run.sh: $needed is missing; build first (make check)"
        exit 2
    }
done
scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-cli-XXXXXX") || exit 2
[ -n "${RX_TEST_KEEP-}" ] || trap 'chmod -R u+rwx "$scratch" 2>/dev/null; rm -rf "$scratch"' EXIT
trap 'exit 2' INT TERM HUP

# sep_extract() of libsep 1.2.1 forgets a few bytes a source; leaks of our own still count.
echo 'leak:libsep' >"$scratch/leaks"
LSAN_OPTIONS="suppressions=$scratch/leaks:print_suppressions=0${LSAN_OPTIONS:+:$LSAN_OPTIONS}"
export LSAN_OPTIONS

passed=0 failed=0 skipped=0 cases=0
name='' wanted='' printed='' said=1 active=1

# shellcheck disable=SC2317 # called by the files of cases
make_fits() { "$fits" "$@"; }
# shellcheck disable=SC2317
make_model() { "$model" "$@"; }

begin() {
    name=$1 wanted='' printed='' said=1 program=$rextract
    cases=$((cases + 1))
    active=1
    [ -z "${RX_TEST_ONLY-}" ] || printf '%s\n' "$name" | grep -Eq -- "$RX_TEST_ONLY" || active=0
    [ -z "${RX_TEST_NOT-}" ] || ! printf '%s\n' "$name" | grep -Eq -- "$RX_TEST_NOT" || active=0
    folder=$scratch/$cases
    mkdir "$folder" "$folder/work" && cd "$folder/work" || exit 2
}

of() { program=$programs/$1; }
leaves() { wanted=$*; }
prints() { printed=$1; }
says() { said=$1; }

skip() {
    [ "$active" = 1 ] || return 0
    skipped=$((skipped + 1))
    echo "skipped: $name: $1"
}

list_files() { "$build/tests/cli/list_files"; }

complain() {
    complaints="$complaints
    $1"
}

# Names of files and folders that are new or changed, without those declared; and of those that are gone.
left_behind() {
    cmp -s ../before ../after || wanted=$wanted awk '
        BEGIN { n = split(ENVIRON["wanted"], allowed, " ") }
        { name = $0; sub(/^[0-9]+ [0-9]+ /, "", name) }
        NR == FNR { before[name] = $0; next }
        { after[name] = 1 }
        before[name] != $0 {
            name = substr(name, 3)
            for (i = 1; i <= n; i++) if (name == allowed[i] || index(name, allowed[i] "/") == 1) next
            print name
        }
        END { for (name in before) if (before[name] != "" && !(name in after)) print substr(name, 3), "(removed)" }' ../before ../after
}

# judge CODE PATTERN: what the run left in ../code, ../out, ../err against what is expected. Hundreds of cases: no process
# that an empty file or an unchanged folder does not need.
judge() {
    complaints=''
    read -r code <../code
    list_files >../after
    # shellcheck disable=SC2254 # a pattern
    case $code in
    $1) ;; # may be a pattern such as [23]
    *) complain "exit code $code, expected $1" ;;
    esac
    if [ -z "$2" ]; then
        [ ! -s ../err ] || complain "standard error should be empty"
    else
        lines=$(grep -cv '^rextract: [^ ]*: no gain: errors leave out' ../err) # most of these tiles state none
        [ "$lines" = "$said" ] || complain "$lines lines on standard error, expected $said"
        grep -Eq -- "$2" ../err || complain "standard error does not match: $2"
    fi
    if [ -z "$printed" ]; then
        [ ! -s ../out ] || complain "standard output should be empty"
    else
        grep -Eq -- "$printed" ../out || complain "standard output does not match: $printed"
    fi
    if [ -s ../err ] && grep -Eq 'Sanitizer|runtime error:' ../err; then
        complain "a sanitizer spoke"
    fi
    left=$(left_behind)
    [ -z "$left" ] || complain "left behind: $(echo "$left" | tr '\n' ' ')"
    for file in $wanted; do
        [ -e "$file" ] || complain "did not write $file"
    done
    if [ -z "$complaints" ]; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        printf 'FAILED: %s%s\n' "$name" "$complaints"
        head -n 8 ../err | sed 's/^/    | /'
    fi
}

# run ARGUMENT...: the program under a time limit; stops after 60 seconds.
run() {
    list_files >../before
    timeout 60 "$program" "$@" >../out 2>../err </dev/null
    echo $? >../code
}

expect() {
    [ "$active" = 1 ] || return 0
    expected=$1 pattern=$2
    shift 2
    run "$@" -VERBOSE_TYPE QUIET
    judge "$expected" "$pattern"
}

expect_exactly() {
    [ "$active" = 1 ] || return 0
    expected=$1 pattern=$2
    shift 2
    run "$@"
    judge "$expected" "$pattern"
}

# talks PATTERN ARGUMENT...: what it says when it is not told to be quiet, in one line
# shellcheck disable=SC2317 # called by the files of cases
talks() {
    [ "$active" = 1 ] || return 0
    pattern=$1
    shift
    list_files >../before
    "$program" "$@" >../out 2>../said
    echo $? >../code
    { tr '\n' ' ' <../said | sed 's/rextract:  *//g'; echo; } >../err
    judge 0 "$pattern"
}

[ $# -gt 0 ] || set -- "$top"/tests/cli/cases/*.sh
for file in "$@"; do
    case $file in /*) ;; *) file=$PWD/$file ;; esac
    # shellcheck source=/dev/null
    . "$file"
    cd "$top" || exit 2
done
[ -z "${RX_TEST_KEEP-}" ] || echo "kept $scratch"
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
