#!/bin/sh
# The numbers in README.md, PROMISES.md and validation/ are those of the committed results (validation/texts.py), and a
# number that is changed, in a text or in a result, is found.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
# shellcheck source=/dev/null
. "$top/tests/lib.sh"
command -v python3 >/dev/null || { skip "texts and results" "python3 is not installed"; finish; }
enter
texts() { RX_TEXTS_TOP=$scratch/copy PYTHONDONTWRITEBYTECODE=1 python3 "$top/validation/texts.py" "$@" >log 2>&1; }

PYTHONDONTWRITEBYTECODE=1 python3 "$top/validation/texts.py" check >log 2>&1
result "the texts hold the numbers of the committed results (python3 validation/texts.py write)" $? log

python3 "$top/validation/cost/cost.py" >cost.md 2>log && cmp cost.md "$top/validation/results/cost/cost.md" >>log
result "what a survey costs is calculated from the committed benchmark (python3 validation/cost/cost.py)" $? log

# a copy to be spoilt: links, but for the files that change
mkdir copy
cp -RL "$top/README.md" "$top/PROMISES.md" copy
cp -Rs "$top/validation" copy
cp --remove-destination "$top/validation/results/sdss/AUTO.json" copy/validation/results/sdss/AUTO.json
line=$(grep -n '^| as observed (NONE)' copy/README.md | cut -d: -f1)
recall=$(sed -n "${line}p" copy/README.md | cut -d'|' -f4 | tr -d ' ')

sed -i "${line}s/$recall/0.999/" copy/README.md
texts check
[ $? -eq 1 ] && grep -Fxq "README.md:$line: found \"0.999\", wanted \"$recall\"" log
result "a number changed in a text is found, with its line" $? log

texts write && texts check && cmp -s copy/README.md "$top/README.md"
result "and written as it was" $? log

sed -i 's/"references": [0-9]*/"references": 12345/' copy/validation/results/sdss/AUTO.json
texts check
[ $? -eq 1 ] && grep -q '^README.md:[0-9]*: found "([0-9]*", wanted "(12345"$' log
result "a number changed in a result is found" $? log

cp "$top/README.md" copy
sed -i "$((line + 6)),\$s/^<!-- end -->\$//" copy/README.md
texts check
[ $? -eq 1 ] && grep -q 'without its end' log
result "a block without its end is found" $? log
finish
