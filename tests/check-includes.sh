#!/bin/sh
# The fences of the house (CONTRIBUTING.md, "Floors"): who may include whom and no circles of it, which library is
# used where, no exit, no printing and no changing file-scope variable in the library, seven arguments at the most, one
# type of one name, no comparison in tests that cannot fail.
# Says file:line for everything that breaks one. With RX_BUILD_DIR the objects of a build are
# searched for variables too.
set -u
cd "${srcdir:-$(dirname "$0")/..}" || exit 2

scratch=$(mktemp -d) || exit 2
trap 'rm -rf "$scratch"' EXIT

# Folder by folder: the folders below it that it may include, besides itself, data and base.
cat >"$scratch/may" <<'END'
base
data
num
par
io
config    io
nn        num io
psf       num io
restore   nn num psf
detect    num
measure   num
template  fit num psf
fit       num psf
simulate  io num nn psf config
catalog   io num psf
quality   io num psf
report    quality io num psf
train     report nn simulate par quality config io num psf
pipeline  nn psf restore detect measure template fit num
check     report pipeline simulate quality restore measure fit num io
stage     report check pipeline io num nn psf restore detect measure template catalog quality simulate config
survey    report stage pipeline par quality catalog io config num
lab       stage check pipeline simulate report quality restore catalog config io nn num psf
programs  stage survey lab train par quality simulate config catalog
END

# Header (as a pattern), what it belongs to, and the folders that may include it.
cat >"$scratch/libraries" <<'END'
^fitsio      cfitsio   io
^bzlib       bzip2     io
^zlib        zlib      io
^(wcslib/|wcs|wcshdr|wcsfix) wcslib io
^fftw        FFTW      num
^gsl/        GSL       num
^sep\.h      sep       detect measure
^mpi\.h      MPI       par
^expat       expat     catalog
^xxhash      xxHash    base
END

find src -type f \( -name '*.c' -o -name '*.h' -o -name '*.def' \) | LC_ALL=C sort >"$scratch/files"

# Comments become blanks and the inside of strings goes, lines stay lines; include lines stay whole.
cat >"$scratch/source.awk" <<'END'
BEGIN {
    standard_error = "(^|[^A-Za-z0-9_])stderr([^A-Za-z0-9_]|$)"
    standard_streams = "(^|[^A-Za-z0-9_])(stdout|stderr)([^A-Za-z0-9_]|$)"
}
function complain(text) { print FILENAME ":" FNR ": " text; bad = 1 }
FILENAME == ARGV[1] { may[$1] = " " $0 " data base "; next }
FILENAME == ARGV[2] { n++; header[n] = $1; library[n] = $2; $1 = $2 = ""; owner[n] = $0 " "; next }
FNR == 1 {
    split(FILENAME, part, "/"); folder = part[2]; inside = 0
    if (!(folder in may)) complain("folder " folder " is not in the table of tests/check-includes.sh")
}
{
    line = $0; code = ""
    while (line != "") {
        if (inside) {
            end = index(line, "*/")
            if (!end) { line = ""; break }
            line = substr(line, end + 2); inside = 0; code = code " "
        } else if (match(line, /\/\*|\/\/|"([^"\\]|\\.)*"|'([^'\\]|\\.)*'/)) {
            token = substr(line, RSTART, RLENGTH)
            code = code substr(line, 1, RSTART - 1)
            line = substr(line, RSTART + RLENGTH)
            if (token == "/*") inside = 1
            else if (token == "//") line = ""
            else if (code ~ /^[ \t]*#[ \t]*include[ \t]*$/) code = code token
            else code = code "\"\""
        } else { code = code line; line = "" }
    }
}
code ~ /^[ \t]*#[ \t]*include/ {
    what = code
    sub(/^[^"<]*/, "", what)
    quoted = substr(what, 1, 1) == "\""
    gsub(/["<>]|[ \t]+$/, "", what)
    if (quoted) {
        if (what !~ /\//) complain("include \"" what "\": name its folder, \"" folder "/" what "\"")
        else {
            split(what, part, "/")
            if (part[1] != folder && index(may[folder], " " part[1] " ") == 0)
                complain(folder " must not include " what)
        }
    } else
        for (i = 1; i <= n; i++)
            if (what ~ header[i] && index(owner[i], " " folder " ") == 0)
                complain(library[i] " (" what ") is not for " folder "/, only for" owner[i])
    next
}
folder == "programs" || FILENAME == "src/base/log.c" { next }
# The stage names stdout, and that only, as the file of CATALOG_NAME STDOUT.
match(code, /(^|[^A-Za-z0-9_.>])(exit|_exit|_Exit|quick_exit|abort|assert)[ \t]*\(/) {
    complain("library code never ends the process; return a status")
}
match(code, /(^|[^A-Za-z0-9_.>])(printf|vprintf|puts|putchar|perror|gsl_error_default)[ \t]*\(/) ||
match(code, folder == "stage" ? standard_error : standard_streams) {
    complain("library code never prints; use the log or return an error")
}
match(code, /(^|[^A-Za-z0-9_.>])(system|popen|fork|vfork|exec[lv][pe]*|posix_spawnp?)[ \t]*\(/) && folder != "report" {
    complain("only report/ runs another program (gnuplot)")
}
# An error object of one's own hides the caller's stop (base/error.h) from all that is below.
folder !~ /^(base|par|survey|lab|train)$/ && code ~ /RX_ERROR_NONE/ {
    complain("hides the stop of the caller; use rx_error_part(err)")
}
folder != "base" && code ~ /\*err = / && code !~ /RX_ERROR_NONE/ {
    complain("forgets the stop of the caller; use rx_error_take(err, &part)")
}
match(code, /(^|[^A-Za-z0-9_.>])(rand|srand|random|drand48|time|localtime|gmtime)[ \t]*\(/) {
    complain("outputs depend on nothing but the inputs; use base/random.h, no clock")
}
END
# shellcheck disable=SC2046 # names of our own files hold no blanks
LC_ALL=C awk -f "$scratch/source.awk" "$scratch/may" "$scratch/libraries" $(cat "$scratch/files") >"$scratch/found"

# Seven arguments at the most: an eighth says that a noun is missing. What another library calls has its own (XMLCALL);
# what a table or a kind of campaign is made of is no argument.
cat >"$scratch/arguments.awk" <<'END'
function judge(text,    depth, commas, most, i, c) {
    for (i = 1; i <= length(text); i++) {
        c = substr(text, i, 1)
        if (c == "(") { if (++depth == 1) commas = 0 }
        else if (c == ")") { if (--depth == 0 && commas > most) most = commas }
        else if (c == "," && depth == 1) commas++
    }
    if (most >= 7 && text !~ /XMLCALL/ && text !~ /^[ \t]*RX_(COLUMNS|LAB_KIND)\(/)
        print FILENAME ":" start ": takes " most + 1 " arguments; find the noun that is missing (seven at the most)"
}
FNR == 1 { braces = 0; inside = 0; macro = 0; text = "" }
{
    line = $0
    gsub(/"([^"\\]|\\.)*"|'([^'\\]|\\.)*'/, "0", line)
    if (inside) { if (!match(line, /\*\//)) next; line = substr(line, RSTART + 2); inside = 0 }
    gsub(/\/\*([^*]|\*+[^*\/])*\*+\//, "", line)
    if (match(line, /\/\*/)) { line = substr(line, 1, RSTART - 1); inside = 1 }
    sub(/\/\/.*/, "", line)
    continued = line ~ /\\$/
    if (macro || line ~ /^[ \t]*#/) { macro = continued; next }
    n = length(line)
    for (k = 1; k <= n; k++) {
        c = substr(line, k, 1)
        if (braces == 0) {
            if (c == "{" || c == ";") { judge(text); text = "" }
            else { if (text ~ /^[ \t]*$/) start = FNR; text = text c }
        }
        if (c == "{") braces++
        else if (c == "}") { braces--; if (braces == 0) text = "" }
    }
}
END
# shellcheck disable=SC2046
LC_ALL=C awk -f "$scratch/arguments.awk" $(grep -E '[.][ch]$' "$scratch/files") >>"$scratch/found"

# Files that only exist because another was cut: what they hold is a header's, or the files are one subject.
grep -E '_parts[.][ch]$' "$scratch/files" | sed 's/$/:1: parts of what? Put it into the proper header, or join the files/' \
    >>"$scratch/found"

# No circle of headers, of folders, nor of files: a .c file and its .h are one.
# shellcheck disable=SC2046
awk '/^#include "[a-z_]*\// { split($0, part, "\""); print FILENAME, "src/" part[2] }' $(cat "$scratch/files") >"$scratch/uses"
awk '$1 ~ /[.]h$/ { print }' "$scratch/uses" >"$scratch/headers"
awk '{ split($1, a, "/"); split($2, b, "/"); if (a[2] != b[2]) print a[2], b[2] }' "$scratch/uses" | sort -u >"$scratch/rooms"
awk '{ gsub(/[.](c|h|def)/, ""); if ($1 != $2) print }' "$scratch/uses" >"$scratch/pairs"
for graph in headers rooms pairs; do
    tsort "$scratch/$graph" 2>&1 >/dev/null | sed -n "s;^tsort: \([a-z].*\)$;\1: in a circle of $graph;p"
done >>"$scratch/found"

# One name, one type, for all that headers declare.
grep '[.]h$' "$scratch/files" >"$scratch/headers"
xargs grep -hoE '^} rx_[a-z0-9_]+;|^typedef (struct|enum) [^;{(]* rx_[a-z0-9_]+;|^typedef (struct|enum) rx_[a-z0-9_]+ \{.*\} rx_[a-z0-9_]+;' \
    <"$scratch/headers" | sed 's/.* \(rx_[a-z0-9_]*\);$/\1/' | sort | uniq -d | while read -r name; do
    xargs grep -nE "(^}|^typedef .*) $name;" <"$scratch/headers" |
        sed "s/^\([^:]*:[0-9]*\):.*/\1: a second type of the name $name/"
done >>"$scratch/found"

# A header that is installed includes none that is not, or a stranger's program does not compile.
cat src/*/local.mk | sed -e ':more' -e '/\\$/{N;s/\\\n//;b more' -e '}' | sed -n 's/^\(dist_\)\{0,1\}rx_[a-z]*_\(HEADERS\|DATA\) *= *//p' |
    tr -s ' \t' '\n\n' | sed 's,^src/,,' | LC_ALL=C sort >"$scratch/installed"
while read -r header; do
    sed -n 's/^#include "\(.*\)"/\1/p' "src/$header" | grep -vxFf "$scratch/installed" |
        sed "s;.*;src/$header:1: is installed, & is not;"
done <"$scratch/installed" >>"$scratch/found"

# Campaigns, training, ranks and surveys are for programs, no part of librextract.
grep -nE '^librextract_la_SOURCES' src/lab/local.mk src/par/local.mk src/survey/local.mk src/train/local.mk |
    sed 's/^\([^:]*:[0-9]*\):.*/\1: goes into librextract; librextract-lab or librextract-train is for programs/' >>"$scratch/found"

# Variables that can change: symbols in .data, .bss and their thread-local forms. Constant tables
# of pointers live in .data.rel.ro and are fine. Sanitizers add symbols of their own, so their
# builds are left out.
objects=0
if [ -n "${RX_BUILD_DIR:-}" ] && command -v nm >/dev/null; then
    # Of the library, where it is shared, and of programs.
    sed -n "s;^\(.*/\)\(.*\)[.]c$;$RX_BUILD_DIR/\1.libs/\2.o $RX_BUILD_DIR/\1\2.o;p" "$scratch/files" | tr ' ' '\n' | while read -r object; do
        [ ! -f "$object" ] || echo "$object"
    done >"$scratch/objects"
    xargs nm -f sysv <"$scratch/objects" | awk -F'|' -v build="$RX_BUILD_DIR/" '
        function tell(    i) {
            if (object == "" || foreign) return
            print "object", object
            for (i = 1; i <= n; i++) print object, variable[i]
        }
        /^Symbols from / { tell(); object = substr($0, 14); sub(/:$/, "", object); object = substr(object, length(build) + 1)
            sub(/\.libs\//, "", object); sub(/o$/, "c", object); foreign = n = 0; next }
        { gsub(/ /, "", $1); gsub(/ /, "", $7) }
        $1 ~ /__asan_init|__gcov_/ { foreign = 1 }
        $7 ~ /^(\.data|\.data\.rel|\.data\.rel\.local|\.bss|\.tdata|\.tbss|\*COM\*)(\.[a-z].*)?$/ &&
        $7 !~ /^\.data\.rel\.ro/ && $1 !~ /^\./ { sub(/[.].*/, "", $1); variable[++n] = $1 }
        END { tell() }' >"$scratch/variables"
    objects=$(grep -c '^object ' "$scratch/variables")
    # malloc() has no argument that a reserve could be passed down by
    grep -v -e '^object ' -e '^src/base/memory\.c is_refused$' -e '^src/programs/reserve\.c \(next\|reserve\)$' "$scratch/variables" | while read -r source variable; do
        line=$(grep -nw "$variable" "$source" | head -n 1 | cut -d: -f1)
        echo "$source:${line:-1}: $variable is a variable that outlives its function; pass it down instead"
    done >>"$scratch/found"
fi

# cmocka's own comparison casts to float, lets 1.2e-7 pass whatever the tolerance is, and NaN too.
grep -rnE --include='*.[ch]' 'assert_(float|double)_(not_)?equal' tests |
    sed 's/^\([^:]*:[0-9]*\):.*/\1: compares as floats and passes NaN; use assert_near (tests\/unit\/near.h)/' >>"$scratch/found"

# One number per assertion, or a failure does not say which; one may run over several lines.
find tests -name '*.[ch]' -exec awk '
    FNR == 1 { text = "" }
    text == "" && match($0, /assert_true\(/) { text = substr($0, RSTART); line = FNR; $0 = "" }
    text != "" { text = text $0 }
    text ~ /;/ {
        if (text ~ /&&/ && text !~ /\|\||== \(|\?/) print FILENAME ":" line ": asserts two things at once; one assert_true, or assert_between, for each"
        text = ""
    }' {} + >>"$scratch/found"

cat "$scratch/found"
files=$(wc -l <"$scratch/files")
broken=$(wc -l <"$scratch/found")
[ "$files" -gt 0 ] || { echo "no sources found"; exit 2; }
echo "checked $files sources and $objects objects: $broken broken fences"
[ "$broken" -eq 0 ]
