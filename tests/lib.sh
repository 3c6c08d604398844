# What scripts of tests have in common; sourced by them, which have set `top` to the source folder before:
#
#   need NAME...             programs that must be there, their folder is $programs; or tests/..., helpers of the build,
#                            which is $build
#   need_data [MODULE...]    real images, $data, and modules of /usr/bin/python3; or the script ends as skipped
#   enter                    into a scratch folder, $scratch, that is removed at the end, by a signal too
#   result TITLE STATUS LOG  counts a case; of one that failed the end of the log is shown, where one is given
#   skip TITLE WHY
#   finish                   says how many, and ends
# shellcheck shell=sh disable=SC2154 # variables of who sources it

programs=$(cd "$(dirname "${RX_PROGRAM:-${RX_BUILD_DIR:-$top}/rextract}")" && pwd)
build=$(cd "${RX_BUILD_DIR:-$programs}" && pwd)
passed=0 failed=0 skipped=0
script=$(basename "$0")

need() {
    for needed in "$@"; do
        case $needed in tests/*) needed=$build/$needed ;; *) needed=$programs/$needed ;; esac
        [ -x "$needed" ] || {
            echo "$script: $needed is missing; build first (make check)"
            exit 2
        }
    done
}

need_data() {
    data=${RX_SHARED_DATA:-}
    why=''
    [ -n "$data" ] && [ -d "$data" ] || why='RX_SHARED_DATA names no folder of real tiles'
    for module in "$@"; do
        /usr/bin/python3 -c "import $module" 2>/dev/null || why="python3 has no $module"
    done
    [ -n "$why" ] || return 0
    skip "$script" "$why"
    finish
}

enter() {
    scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-${script%.sh}-XXXXXX") || exit 2
    trap 'rm -rf "$scratch"' EXIT
    trap 'exit 2' INT TERM HUP
    cd "$scratch" || exit 2
}

result() {
    if [ "$2" -eq 0 ]; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        echo "FAILED: $1"
        [ $# -lt 3 ] || tail -n 60 "$3" | sed 's/^/    | /'
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
