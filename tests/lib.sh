# What scripts of tests have in common; sourced by them, which have set `top` to the source folder before:
#
#   need NAME...             programs of the build that must be there; $programs is their folder
#   enter                    into a scratch folder, $scratch, that is removed at the end
#   result TITLE STATUS LOG  counts a case; of one that failed the log is shown, where one is given
#   skip TITLE WHY
#   finish                   says how many, and ends
# shellcheck shell=sh disable=SC2154 # variables of who sources it

programs=$(cd "$(dirname "${RX_PROGRAM:-$top/rextract}")" && pwd)
passed=0 failed=0 skipped=0
script=$(basename "$0")

need() {
    for needed in "$@"; do
        [ -x "$programs/$needed" ] || {
            echo "$script: $programs/$needed is missing; build first (make check)"
            exit 2
        }
    done
}

enter() {
    scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-${script%.sh}-XXXXXX") || exit 2
    trap 'rm -rf "$scratch"' EXIT
    cd "$scratch" || exit 2
}

result() {
    if [ "$2" -eq 0 ]; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        echo "FAILED: $1"
        [ $# -lt 3 ] || sed 's/^/    | /' "$3"
    fi
}

skip() {
    skipped=$((skipped + 1))
    echo "skipped: $1 ($2)"
}

finish() {
    echo "$passed passed, $failed failed, $skipped skipped"
    [ "$failed" -eq 0 ]
    exit
}
