#!/bin/sh
# The numbers in README.md, docs/ and validation/ are those of the committed results (validation/texts.py), and a
# number that is changed, in a text or in a result, is found; so is a link that leads nowhere.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
# shellcheck source=/dev/null
. "$top/tests/lib.sh"
command -v python3 >/dev/null || { skip "texts and results" "python3 is not installed"; finish; }
enter
# shellcheck disable=SC2154 # scratch is of tests/lib.sh
texts() { RX_TEXTS_TOP=$scratch/copy PYTHONDONTWRITEBYTECODE=1 python3 "$top/validation/texts.py" "$@" >log 2>&1; }

PYTHONDONTWRITEBYTECODE=1 python3 "$top/validation/texts.py" check >log 2>&1
result "the texts hold the numbers of the committed results (python3 validation/texts.py write)" $? log

python3 "$top/validation/cost/cost.py" >cost.md 2>log && cmp cost.md "$top/validation/results/cost/cost.md" >>log
result "what a survey costs is calculated from the committed benchmark (python3 validation/cost/cost.py)" $? log

# a copy to be spoilt: links, but for the files that may be written
mkdir copy
cp -r "$top/README.md" "$top/docs" "$top/PROMISES.md" "$top/CONTRIBUTING.md" copy
chmod -R u+w copy
page=docs/validation.md
for part in validation src tests man config python workflow LICENSE NEWS CITATION.cff; do cp -Rs "$top/$part" copy; done
(cd "$top" && find validation -name README.md -o -path '*/sdss/*.json') | while read -r file; do
    cp --remove-destination "$top/$file" "copy/$file"
done
line=$(grep -n '^| as observed (NONE)' copy/$page | cut -d: -f1)
recall=$(sed -n "${line}p" copy/$page | cut -d'|' -f4 | tr -d ' ')

sed -i "${line}s/$recall/0.999/" copy/$page
texts check
[ $? -eq 1 ] && grep -Fxq "$page:$line: found \"0.999\", expected \"$recall\"" log
result "a number changed in a text is found, with its line" $? log

texts write && texts check && cmp -s copy/$page "$top/$page"
result "and written as it was" $? log

sed -i 's/"references": [0-9]*/"references": 12345/' copy/validation/results/sdss/AUTO.json
texts check
[ $? -eq 1 ] && grep -q "^$page:[0-9]*: found \"([0-9]*\", expected \"(12345\"\$" log
result "a number changed in a result is found" $? log

sed -i 's/"detections":/"found":/' copy/validation/results/sdss/AUTO.json
texts check
[ $? -eq 1 ] && grep -q "^$page:[0-9]*: block sdss-frame cannot be made: KeyError('detections')" log
result "a result that lacks what a text needs is named" $? log

rm -f copy/docs/bench.md
cp "$top/docs/survey.md" copy/docs/bench.md
texts check
[ $? -eq 1 ] && grep -q '^docs/survey.md:[0-9]*: bench.md#planning leads nowhere$' log
result "a link to a title that is not there is found" $? log
cp "$top/docs/bench.md" copy/docs

cp "$top/$page" copy/docs
sed -i "$((line + 6)),\$s/^<!-- end -->\$//" copy/$page
texts check
[ $? -eq 1 ] && grep -q 'without its end' log
result "a block without its end is found" $? log

# a run's folder: its files agree with the committed ones but for one, in the third digit
mkdir run
cp "$top/validation/results/sdss/AUTO.json" copy/validation/results/sdss
cp "$top/validation/results/sdss/AUTO.json" "$top/validation/results/sdss/PSFEX.json" run
texts compare sdss run
result "a new run that gave the same agrees" $? log
recall=$(sed -n 's/.*"recall": {"value": \(0\.[0-9]*\),.*/\1/p' run/AUTO.json | sed -n 1p)
sed -i "s/\"recall\": {\"value\": $recall,/\"recall\": {\"value\": $(awk "BEGIN { print $recall * 1.002 }"),/" run/AUTO.json
texts compare sdss run 4
[ $? -eq 1 ] && grep -q "/recall/value: $recall, now" log
result "one that differs in the third digit is found to differ in four" $? log
texts compare sdss run 2
result "and to agree in two" $? log
texts take sdss run && cmp -s run/AUTO.json copy/validation/results/sdss/AUTO.json
result "a new run's files take the place of the committed ones" $? log
# final seeds: once each, by a commit, with its settings
if command -v git >/dev/null; then
    mkdir ledger && git -C ledger init -q && printf 'experiment\tseed\tcommit\n' >ledger/final_seeds.tsv && echo 1 >ledger/code && git -C ledger add . &&
        git -C ledger -c user.name=x -c user.email=x@x commit -q -m x || exit 2
    why=''
    claim() { RX_LEDGER=$scratch/ledger/final_seeds.tsv python3 -B "$top/validation/ledger.py" claim psf "$@" >log 2>&1; }
    refused() {
        claim "$@"
        [ $? -eq 1 ] && grep -q "^ledger: $why" log
    }
    claim out 7 -PSF_FWHM 3 && [ ! -e out ] && claim out 1000 1001 -NTHREADS 2 && claim out 1000 && [ "$(wc -l <ledger/final_seeds.tsv)" -eq 3 ]
    result "a final seed is run once, and goes on in its folder; below 1000 all is free" $? log
    why='psf was run with final seed 1001' refused elsewhere 1001
    result "not twice" $? log
    why='-PSF_FWHM changes what is judged' refused out 1002 -PSF_FWHM 3
    result "not with other settings" $? log
    echo 2 >ledger/code
    why='code differs from the commit' refused out 1002
    result "not by files that differ from the commit" $? log
    git -C ledger -c user.name=x -c user.email=x@x commit -q -a -m y
    why='out was begun by commit' refused out 1000
    result "nor does another commit go on with it" $? log
else
    skip "final seeds" "git is not installed"
fi
finish
