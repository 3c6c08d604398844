#!/bin/sh
# The pages that programs write: a tile's, a run's report, a survey's, a campaign's, a training's. tests/pages.py says what each
# must have, and is seen to miss what is taken away. Where there is Chromium they are loaded: no error, nothing too wide.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
# shellcheck source=tests/lib.sh
. "$top/tests/lib.sh"
need rextract rextract-simulate rextract-survey rextract-validate rextract-train
command -v python3 >/dev/null || {
    skip 'pages' 'python3 is not installed'
    finish
}
enter
run() {
    p=$1
    shift
    "$programs/$p" "$@" >>log 2>&1
}
run rextract-simulate -IMAGE_NAME a.fits -TRUTH_NAME a.truth -IMAGE_SIZE 320 -SEED 3 -PSF_FWHM 3.5 -MAG_ZEROPOINT 25 -STAR_COUNT 3000 -STAR_MAG 14,20 \
    -GALAXY_COUNT 500 -NOISE_SIGMA 5 &&
    run rextract a.fits -MAG_ZEROPOINT 25 -RESTORE_TYPE NONE,RL -RL_NITER 5 -QA_TYPE TILE -QA_NAME qa -CATALOG_NAME a.cat -REFERENCE_NAME a.truth \
        -RECORD_NAME a.record && run rextract-survey a.record -OUTPUT_NAME survey
result 'a tile, its report and a survey' $? log
cat >sharp.conf <<'CONF'
CAMPAIGN_TYPE   RESTORATION
RESTORE_TYPE    NONE,RL
SCENES_FWHM     4
SCENES_SIGMA    4
SCENE_SIDE      96
FWHM_RANGE      2,4
SIGMA_RANGE     2,3
TUNE_SCENES     2
TUNE_NITER      2,10
TUNE_FILTER     0,0.5
EXAMPLES        1
CONF
run rextract-validate -c sharp.conf -OUTPUT_NAME campaign
result 'a campaign' $? log
run rextract-train -EPOCHS 2 -WIDTH 4 -BLOCKS 1 -PATCH 48 -PATCH_MARGIN 8 -FIELD_PATCHES 2 -GRID 2,1 -BIN_IMAGES 20 -BATCH 4 -SIM.STAR_COUNT 3000 \
    -MODEL_NAME model.fits -CHECKPOINT_NAME training.ck -OUTPUT_NAME training
result 'a training' $? log
pages='qa/tile.html qa/report.html survey/report.html campaign/report.html training/training.html'
# shellcheck disable=SC2086 # a list
python3 "$top/tests/pages.py" $pages >out 2>&1
result 'each has what a page must have' $? out
grep -q '<title>Validation: .*, sharp</title>' campaign/report.html && ! grep -q 'class="v PASS">0 ' campaign/report.html
result 'a campaign has a title of its own, and no praise for nothing' $? campaign/report.html
grep -n '<figure\|<h2' campaign/report.html | grep -m 2 'figure\|claims\|goals' | head -n 1 | grep -q '<figure' || ! command -v gnuplot >/dev/null
result 'its figures come before its claims' $? campaign/report.html
# break WORDS SED: without what WORDS name
break_page() {
    sed "$2" qa/tile.html >broken.html
    [ "$1" != 'less than 1 MB' ] || awk 'BEGIN { printf "%1000000s", "" }' >>broken.html
    if cmp -s broken.html qa/tile.html; then
        echo "$2 changes nothing" >>missed
    elif python3 "$top/tests/pages.py" broken.html >out 2>&1 || ! grep -q -F -e "lacks $1" out; then
        echo "not seen: $1" >>missed
    fi
}
break_page 'a language' 's/ lang="en"//'
break_page 'a title' '1,6s/<title>Tile.*<.title>//'
break_page 'one h1' 's/<h1>/<h1>one<\/h1><h1>/'
break_page 'one main' 's/<main id="main">/<div>/; s/<.main>/<\/div>/'
break_page 'a link to the main part' 's/class="skip"//'
break_page 'scope of th' '0,/ scope="col"/s///'
break_page 'words in th' '0,/>quantity</s//></'
break_page 'alt of img' 's/<h1>/<img src="data:,"><h1>/'
break_page 'nothing from elsewhere: img' 's/<h1>/<img alt="x" src="https:\/\/example.org\/a.png"><h1>/'
break_page 'nothing from elsewhere: style' 's/body{/body{background:url(a.png);/'
break_page 'no script: h1 has onclick' 's/<h1>/<h1 onclick="x()">/'
break_page 'a heading between' '0,/<h2 \(.*\)<.h2>/s//<h3 \1<\/h3>/'
break_page 'what a link leads to: #numbers' 's/id="numbers"//'
break_page 'an id only once: stars' 's/id="numbers"/id="stars"/'
break_page 'contrast of soft on ground' 's/--soft:#595959/--soft:#888/'
break_page 'styles for light, dark and paper' 's/@media print/@media tty/'
break_page 'less than 1 MB' 's/$/ /'
if command -v gnuplot >/dev/null; then
    break_page 'role of svg' '0,/ role="img"/s///'
    break_page 'a title of svg' 's/<title>Sky<.title>//'
    break_page 'a text for each figure' '0,/<figcaption>.*<.figcaption>/s///'
fi
[ ! -e missed ]
result 'and what is taken away is missed' $? missed

for chromium in chromium chromium-browser google-chrome ''; do
    command -v "$chromium" >/dev/null && break
done
if [ -n "$chromium" ] && "$chromium" --version >/dev/null 2>&1; then
    for page in $pages; do
        for width in 600 1200; do
            python3 "$top/tests/pages.py" -PROBE "$page" probe.html
            timeout 120 "$chromium" --headless=new --no-sandbox --disable-gpu --hide-scrollbars --user-data-dir="$scratch/profile" --enable-logging=stderr \
                --window-size=$width,2000 --dump-dom "file://$scratch/probe.html" >dom 2>console
            grep -o '<title>PROBE [^<]*' dom | sed 's/<title>//' | {
                read -r _ inner scroll wide
                [ "${inner:-0}" = $width ] && [ "$scroll" -le $width ] && [ -z "$wide" ]
            } || echo "$page, $width pixels: $(grep -o '<title>PROBE [^<]*' dom)" >>loaded
            ! grep -E 'CONSOLE|Uncaught' console >>loaded || echo "$page" >>loaded
        done
    done
    [ ! -s loaded ]
    result 'in Chromium they load without an error, and nothing is wider than 600 pixels' $? loaded
else
    skip 'Chromium' 'it is not installed'
fi
finish
