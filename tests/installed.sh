#!/bin/sh
# What is installed can be used from outside: every header by itself, in C and in C++, and the library through
# pkg-config, by the examples of rextract(3), which are run. `make installcheck` says where things are: CC, CXX, FLAGS, LIBS,
# PKG_CONFIG, DESTDIR, prefix, pkgincludedir, pkgconfigdir, libdir, srcdir.
set -eu
: "${CC:?}" "${PKG_CONFIG:?}" "${prefix:?}" "${pkgincludedir:?}" "${pkgconfigdir:?}" "${libdir:?}" "${srcdir:?}"
folder=$(mktemp -d) || exit 2
trap 'rm -rf "$folder"' EXIT
include=$DESTDIR$pkgincludedir
warnings='-Wall -Wextra -Wpedantic -Werror'

# What pkg-config says. The static library alone needs those that it was made with, too; --static would name all that
# they in turn need, static ones.
use=$(PKG_CONFIG_PATH="$DESTDIR$pkgconfigdir${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH}" \
    $PKG_CONFIG --define-variable=prefix="$DESTDIR$prefix" --cflags --libs librextract)
ls "$DESTDIR$libdir"/librextract.so >/dev/null 2>&1 || use="$use $LIBS"
LD_LIBRARY_PATH=$DESTDIR$libdir${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
export LD_LIBRARY_PATH
# In a build with sanitizers, what other libraries keep.
LSAN_OPTIONS=suppressions=$srcdir/tests/lsan.supp:print_suppressions=0
export LSAN_OPTIONS

# check COMPILER STANDARD SUFFIX
check() {
    headers=0
    for header in $(cd "$include" && find . -name '*.h' | sed 's,^\./,,' | LC_ALL=C sort); do
        printf '#include "%s"\nextern int unused;\n' "$header" >"$folder/one.$3"
        # shellcheck disable=SC2086
        $1 "-std=$2" $warnings -I"$include" -fsyntax-only "$folder/one.$3"
        headers=$((headers + 1))
    done
    [ "$headers" -gt 0 ] || { echo "no headers in $include"; exit 1; }
    # shellcheck disable=SC2086
    $1 "-std=$2" $warnings -o "$folder/find" "$srcdir/tests/examples/find.$3" $FLAGS $use -lm
    "$folder/find" >"$folder/found" 2>"$folder/said" || { cat "$folder/said"; exit 1; }
    # The examples plant nine stars, 64 pixels apart, of 5000 times 1 to 9 counts.
    awk '{ n++; dx = $1 % 64 - 32; dy = $2 % 64 - 32; flux = 5000 * (1 + int($1 / 64) + 3 * int($2 / 64))
           if (dx * dx + dy * dy > 0.09 || $3 < 0.97 * flux || $3 > 1.03 * flux) { print "not a star: " $0; bad = 1 } }
         END { if (n != 9) { print n + 0 " sources instead of 9"; bad = 1 }; exit bad }' "$folder/found" || {
        cat "$folder/found"
        echo "tests/examples/find.$3 does not find its stars"
        exit 1
    }
    echo "installed: $headers headers and an example for $1"
}

check "$CC" c11 c
if command -v "${CXX%% *}" >/dev/null; then check "$CXX" c++17 cc; else echo 'installed: no C++ compiler, not tried with one'; fi
