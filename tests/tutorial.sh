#!/bin/sh
# The documents whose commands stand in ```sh blocks (docs/tutorial.md and others) are run as a reader would, each in a copy of the
# clone's folders, and what they print is compared with the ```text block below. Commands of plain blocks (README.md,
# docs/survey.md) are run line by line on small tiles of the names that they have; what they need and is absent is skipped. The restorer of docs/adding-a-restorer.md is built
# and run, and lists in the texts are those of the tables.
# shellcheck disable=SC2154 # programs, build, scratch are of tests/lib.sh
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
# shellcheck source=tests/lib.sh
. "$top/tests/lib.sh"
need rextract rextract-train
enter

# follow PAGE FOLDER: its commands, in FOLDER with the programs of the folder $made, as one script that stops at the first one that fails; its output against the blocks.
# A line of a ```text block must be printed, in that order, by the block of commands above: words are the same, numbers to 3 %
# or two of the last digit, and "..." is the rest of a line.
follow() {
    mkdir "$2"
    for part in config docs man src tests validation workflow; do ln -s "$top/$part" "$2/$part"; done
    ln -s "$made" "$2/build"
    awk '/^```sh$/ { inside = 1; print "echo @@@", ++n; next } /^```/ { inside = 0 } inside' "$1" >"$2.commands"
    [ -s "$2.commands" ] || { echo "no commands in $1"; return 1; }
    (cd "$2" && OMP_NUM_THREADS=${OMP_NUM_THREADS:-2} sh -eu "../$2.commands") >"$2.printed" 2>&1 </dev/null || {
        echo "a command fails, the last one of:"
        tail -n 20 "$2.printed"
        return 1
    }
    awk -v printed="$2.printed" '
        function same(word, found,    step) {
            if (word == found) return 1
            if (word !~ /^[-+]?[0-9.]+[,;:]?$/ || found !~ /^[-+]?[0-9.]+[,;:]?$/) return 0
            gsub(/[,;:]$/, "", word); gsub(/[,;:]$/, "", found)
            step = word ~ /\./ ? 10 ^ -(length(word) - index(word, ".")) : 1
            word -= found
            return word * word <= (0.03 * found) ^ 2 || word * word <= (2.1 * step) ^ 2
        }
        function matches(line, text,    n, m, i, words, found) {
            n = split(line, words); m = split(text, found)
            for (i = 1; i <= n; i++) {
                if (words[i] == "...") return 1
                if (i > m || !same(words[i], found[i])) return 0
            }
            return n == m
        }
        BEGIN { while ((getline text < printed) > 0) { if (text ~ /^@@@ /) block++; else out[block, ++lines[block]] = text } }
        /^```sh$/ { n++; at = 0 }
        /^```text$/ { inside = 1; next }
        /^```/ { inside = 0 }
        inside {
            seen++
            for (i = at + 1; i <= lines[n] && !matches($0, out[n, i]); i++) ;
            if (i <= lines[n]) { at = i; next }
            print FILENAME ":" FNR ": not printed: " $0; bad = 1
            for (i = 1; i <= lines[n]; i++) { # what begins alike
                split(out[n, i], found)
                if (found[1] == $1 && (found[2] == $2 || NF < 2)) print "    printed: " out[n, i]
            }
        }
        END { exit bad }' "$1"
}

# The restorer of docs/adding-a-restorer.md is applied to copies of what it changes, and built into a program of its own.
page=$top/docs/adding-a-restorer.md why=''
if ! command -v patch >/dev/null; then
    why='patch is not installed'
else
    mkdir -p new/build new/src/data new/src/restore
    cp "$top/src/data/restorers.h" new/src/data && cp "$top/src/restore/local.mk" new/src/restore && chmod -R u+w new
    awk '/^```diff$/ { inside = 1; next } /^```/ { inside = 0 } inside' "$page" | (cd new && patch -p1) >log 2>&1
    result 'docs/adding-a-restorer.md: its change can be applied' $? log
    grep -q 'src/restore/sharpen\.c$' new/src/restore/local.mk
    result 'and adds its file' $?
    cat >new.mk <<'END'
include Makefile
sources = restore/restore.c stage/plan.c config/keytables.c programs/rextract.c programs/extract.c programs/program.c
new:
	$(CC) $(DEFS) -I$(where)/src $(AM_CPPFLAGS) $(CPPFLAGS) $(AM_CFLAGS) $(CFLAGS) -Werror -o $(where)/build/rextract \
	  $(where)/src/restore/sharpen.c $(addprefix $(top_srcdir)/src/,$(sources)) .libs/librextract-lab.a .libs/librextract-all.a \
	  $(RX_LDFLAGS) $(LDFLAGS) $(RX_LIBS)
END
    MAKEFLAGS='' make -s -C "$build" -f "$scratch/new.mk" where="$scratch/new" new >log 2>&1
    result 'it is built without a warning' $? log
fi

for page in "$top"/docs/*.md; do
    grep -q '^```sh$' "$page" || continue
    name=$(basename "$page" .md) made=$build
    if [ "$name" = adding-a-restorer ]; then
        [ -z "$why" ] || { skip "docs/$name.md" "$why"; continue; }
        made=$scratch/new/build
    fi
    follow "$page" "$name" >"$name.log" 2>&1
    status=$?
    result "docs/$name.md: its commands work and print what it says" $status "$name.log"
    pages="${pages-} $name"
done
expected=' adding-a-restorer'
[ -z "$why" ] || expected=''
[ "${pages-}" = "$expected compare from-sextractor train tutorial" ]
result 'all pages with commands were found' $?
made=$build

# Names of keywords, columns and cards in these pages are names; what has no effect here is what the tables say.
{
    for table in rextract rextract-train rextract-simulate; do "$programs/$table" -dd; done
    "$programs/rextract" -dp
    cat "$top/src/catalog/missing.def" "$top/man/rextract.1" "$top/man/rextract.conf.5" "$top/src/config/keys.def" "$top/tests/data/make_sdss.py"
} | grep -oE '[A-Z][A-Z0-9_]{3,}' | sort -u >names
for name in adding-a-restorer from-sextractor train tutorial; do
    awk '/^```diff$/ { inside = 1 } !inside; /^```$/ { inside = 0 }' "$top/docs/$name.md"
done | grep -oE '\b[A-Z][A-Z0-9]*_[A-Z0-9_]+|\bRX[A-Z0-9]{3,}' | grep -v '^RX_' | sort -u | comm -23 - names >unknown
[ ! -s unknown ]
result 'keywords, columns and cards named in these pages exist' $? unknown
"$build/man/make_man" keywords | awk '/^\.BR/ { name = $2 } /^Accepted, without effect here\./ { print name, "silent" }
    /^Accepted, without effect here:/ { print name, "warning" }' | sort >tables
awk '/^\| no effect/ { gsub(/\([^)]*\)/, ""); kind = /silent/ ? "silent" : "warning"; sub(/^[^|]*\|[^|]*\|/, "")
    while (match($0, /[A-Z][A-Z0-9_]+/)) { print substr($0, RSTART, RLENGTH), kind; $0 = substr($0, RSTART + RLENGTH) } }' \
    "$top/docs/from-sextractor.md" | sort >said
diff said tables >log 2>&1
result 'docs/from-sextractor.md: what has no effect is what the table of keywords says' $? log

# lines PAGE FOLDER: each line of its plain blocks, in FOLDER with the programs in PATH. What installs, builds or asks a batch
# system is run by .ci/run and tests/slurm.
lines() {
    for part in config workflow; do ln -s "$top/$part" "$2/$part"; done
    ln -s "$programs" "$2/build"
    awk '/^```/ { open = !open; inside = open && $0 == "```"; next } inside && NF' "$1" >"$2.lines"
    while IFS= read -r line; do
        why='' program=${line%% *}
        case $line in
        ./quickstart* | autoreconf*) continue ;;
        *profiles/slurm*) program=sbatch ;;
        mpiexec*) [ -x "$programs/rextract-mpi" ] || why='no rextract-mpi' ;;
        esac
        (cd "$2" && PATH=$programs:$PATH command -v "$program") >/dev/null || why="no $program"
        [ -z "$why" ] || { skip "${1#"$top"/}: $line" "$why"; continue; }
        (cd "$2" && PATH=$programs:$PATH OMP_NUM_THREADS=${OMP_NUM_THREADS:-2} HOME=$scratch sh -euc "$line") >log 2>&1 </dev/null
        result "${1#"$top"/}: $line" $? log
        ran="${ran-} $program"
    done <"$2.lines"
}
small() { "$programs/rextract-simulate" -IMAGE_SIZE 192 -STAR_COUNT 8000 -STAR_MAG 14,20 -GALAXY_COUNT 0 -NOISE_SIGMA 5 -MAG_ZEROPOINT 25 -VERBOSE_TYPE QUIET "$@"; }
mkdir readme survey
small -IMAGE_NAME readme/TILE.fits -TRUTH_NAME readme/truth.fits && (
    cd readme && for name in IMAGE R.fits G.fits DETECT.fits MEASURE.fits; do cp TILE.fits $name; done; cp truth.fits list.fits
    cp "$top"/config/default.* . && chmod u+w default.sex && echo 'SELF_CHECK_COUNT 30' >>default.sex # the tile is small
    echo TILE.fits >tiles.list
    printf 'ALPHA_J2000\nDELTA_J2000\nMAG_AUTO\n' >sky.param
    "$programs/rextract" TILE.fits -RESTORE_TYPE NONE -FILTER N -PARAMETERS_NAME sky.param -CATALOG_NAME sky.cat -VERBOSE_TYPE QUIET &&
        awk 'BEGIN { print "ra,dec,phot_g_mean_mag" } !/^#/ { print $1 "," $2 "," $3 + 25 }' sky.cat >gaia.csv
) >log 2>&1
result 'small tiles for README.md' $? log
lines "$top/README.md" readme
(
    cd survey && cp "$top"/config/default.* . && echo a.fits >tiles.list && echo b.fits >>tiles.list && echo 'options: ["-RESTORE_TYPE", "NONE"]' >my.yaml
    small -IMAGE_NAME a.fits -TRUTH_NAME NONE && small -IMAGE_NAME b.fits -TRUTH_NAME NONE -NOISE_SEED 2 && for name in a b; do
        "$programs/rextract" $name.fits -RESTORE_TYPE NONE -CATALOG_TYPE FITS_LDAC -CATALOG_NAME $name.cat -VERBOSE_TYPE QUIET || exit
    done && mv a.cat tile.cat
) >log 2>&1
result 'small tiles for docs/survey.md' $? log
lines "$top/docs/survey.md" survey
[ "$(grep -c rextract readme.lines)" -ge 12 ] && [ "$(grep -c rextract survey.lines)" -ge 5 ] && [ -s survey/cats/b.cat ] && [ -s survey/records/a.record ]
result 'their commands were found and run' $?

# The index has every page.
for page in "$top"/docs/*.md; do
    page=$(basename "$page")
    [ "$page" = README.md ] || grep -q "]($page)" "$top/docs/README.md" || echo "docs/README.md has no line for $page"
done >log
[ ! -s log ]
result 'docs/README.md lists every page' $? log

# The same on a page that is right, and on some that are wrong.
page() { printf '```sh\nrextract=$PWD/build/rextract\n$rextract %s\necho FWHM 3.360, of 11\n```\n\n```text\n%s\n```\n' "$1" "$2" >"$3.md"; }
page -v 'FWHM 3.361, of ...' right
page -vv 'FWHM 3.361, of 11' command
page -v 'FWHM 3.560, of 11' number
page -v 'FWHN 3.360, of 11' word
page -v 'FWHM 3.360, of 11 stars' longer
follow right.md right >log 2>&1
result 'a page that is right passes' $? log
for wrong in command number word longer; do
    follow $wrong.md $wrong >log 2>&1
    [ $? -eq 1 ]
    result "a page with a wrong $wrong does not" $? log
done
finish
