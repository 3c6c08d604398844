#!/bin/sh
# The examples of the manual pages are run on the simulated tile: each command of an EXAMPLES section, a line after
# the other, in a folder with the files that the pages show (what follows `.\" file NAME`) and the images they name.
set -u
LC_ALL=C.UTF-8
export LC_ALL
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
program=${RX_PROGRAM:-$top/rextract}
folder=$(cd "$(dirname "$program")" && pwd)
for needed in "$program" "$folder/rextract-simulate" "$folder/rextract-validate" "$folder/rextract-train"; do
    [ -x "$needed" ] || {
        echo "run-examples.sh: $needed is missing; build first (make check)"
        exit 2
    }
done
scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-man-XXXXXX") || exit 2
trap 'rm -rf "$scratch"' EXIT
trap 'exit 2' INT TERM HUP
mkdir "$scratch/bin" "$scratch/home" "$scratch/work" && cd "$scratch/work" || exit 2
passed=0 failed=0 skipped=0

# Verbatim text of a page, without roff's escapes. `.nf` to `.fi`: with a file comment into that file, else, after
# EXAMPLES, commands to standard output.
read_page() {
    awk '
        /^\.SH / { examples = ($2 == "EXAMPLES") }
        /^\.nf/ { inside = 1; file = ""; next }
        /^\.fi/ { inside = 0; if (file != "") close(file); next }
        !inside { next }
        /^\.\\" file / { file = $3; next }
        { gsub(/\\-/, "-"); gsub(/\\e/, "\\"); gsub(/\\\(dq/, "\"") }
        file != "" { print > file; next }
        examples' "$1"
}
for page in rextract.1 rextract-simulate.1 rextract-validate.1 rextract-train.1 rextract-survey.1 rextract.conf.5; do
    read_page "$top/man/$page"
done >../commands

ln -s "$program" ../bin/rextract
ln -s "$folder/rextract-simulate" "$folder/rextract-validate" "$folder/rextract-train" "$folder/rextract-survey" ../bin
PATH=$scratch/bin:$PATH
HOME=$scratch/home
export PATH HOME
cp "$top/tests/data/sim.fits.fz" tile.fits && cp tile.fits deep.fits && cp "$top/tests/data/sim_truth.fits" truth.fits &&
    cp "$top/config/default.qa" "$top/config/default.param" "$top/config/default.conv" \
        "$top/config/psfnet.fits" . || exit 2
"${RX_BUILD_DIR:-$top}/tests/cli/make_fits" psf psf.fits || exit 2

# One command, with its continuation lines.
while read -r command; do
    case $command in
    psfex*) needed=psfex ;;
    *stars.psf) needed=psfex ;;
    *) needed= ;;
    esac
    if [ -n "$needed" ] && ! command -v "$needed" >/dev/null; then
        skipped=$((skipped + 1))
        echo "skipped, no $needed: $command"
        continue
    fi
    (eval "$command") >../out 2>../err </dev/null
    code=$?
    if [ "$code" = 0 ]; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        echo "FAILED with $code: $command"
        sed 's/^/    | /' ../err
    fi
done <<END
$(sed -e ':more' -e '/\\$/{N;s/\\\n *//;bmore' -e '}' ../commands)
END

# The examples were found, and what they name is there.
for file in tile.cat restored.fits tile.sex "$HOME/my tile.cat" test_RL.cat report/report.html net_report/report.html rextract_qa/summary.json self_report/report.html \
    sim.fits sim_truth.fits sharp.fits sim_report/report.html ccd.fits ccd.cat flags.fits injected.fits \
    injected_truth.fits tiny_report/report.html tiny.journal tiny.fits tiny.cat parts.1 stars_report/summary.json; do
    if [ -s "$file" ]; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        echo "FAILED: no example wrote $file"
    fi
done
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
