#!/bin/sh
# The Python package (python/) on the library of this build: its own tests, each a case, those of python/tests. Where Debian's python3-cffi,
# python3-numpy, python3-astropy and python3-setuptools are. RX_PYTHON: another python3, in which the package may be installed
# already (RX_PYTHON_INSTALLED=1).
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
# shellcheck source=tests/lib.sh
. "$top/tests/lib.sh"
need rextract
python=${RX_PYTHON:-/usr/bin/python3}

why=''
[ -e "$build/.libs/librextract.so" ] || [ -n "${RX_PYTHON_INSTALLED:-}" ] || why='librextract was built without a shared library'
command -v pkg-config >/dev/null || why='pkg-config is not installed'
command -v cc >/dev/null || why='there is no compiler cc'
[ -e "$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))' 2>/dev/null)/Python.h" ] || why="$python has no Python.h (python3-dev)"
for module in cffi setuptools numpy astropy; do
    "$python" -c "import $module" 2>/dev/null || why="$python has no $module"
done
if [ -n "$why" ]; then
    skip 'the Python package' "$why"
    finish
fi

enter
tests=$top/python/tests
if [ -z "${RX_PYTHON_INSTALLED:-}" ]; then
    # librextract-uninstalled.pc of the build folder stands for the library; nothing is written among the sources
    cp -R "$top/python" package && chmod -R u+w package
    (cd package && PKG_CONFIG_PATH=$build "$python" setup.py -q egg_info build_ext --inplace) >built.log 2>&1
    result 'the extension is built' $? built.log
    [ "$failed" -eq 0 ] || finish
    PYTHONPATH=$scratch/package${PYTHONPATH:+:$PYTHONPATH}
    tests=$scratch/package/tests
    export PYTHONPATH
fi
srcdir=$top RX_PROGRAM=$programs/rextract
export srcdir RX_PROGRAM
cd "$tests" || exit 2
PYTHONDONTWRITEBYTECODE=1 "$python" -m unittest -v >"$scratch/tests.log" 2>&1
status=$?
ran=$(sed -n 's/^Ran \([0-9]*\) tests\{0,1\} in .*/\1/p' "$scratch/tests.log")
left_out=$(sed -n 's/.*skipped=\([0-9]*\).*/\1/p' "$scratch/tests.log" | tail -n 1)
failures=$(grep -c '^\(FAIL\|ERROR\): ' "$scratch/tests.log")
skipped=$((skipped + ${left_out:-0}))
passed=$((passed + ${ran:-0} - ${left_out:-0} - failures))
grep "\.\.\. skipped '" "$scratch/tests.log" | sed 's/^/skipped: /'
grep '^\(FAIL\|ERROR\): ' "$scratch/tests.log"
if [ "$status" -ne 0 ]; then
    [ "$failures" -gt 0 ] || { failures=1 && tail -n 20 "$scratch/tests.log"; } # it crashed
    failed=$((failed + failures))
    sed -n '/^=====/,$p' "$scratch/tests.log" | head -n 200
fi
finish
