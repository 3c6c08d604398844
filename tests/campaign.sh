#!/bin/sh
# Campaigns end to end, tiny ones of each kind: whole on one thread, killed at ten random moments and resumed,
# and in three shards that are merged: every byte of the report is the same.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
program=$programs/rextract-validate
need rextract-validate
enter

cat >restoration.conf <<'END'
CAMPAIGN_TYPE   RESTORATION
RESTORE_TYPE    NONE,RL
SCENES_FWHM     6
SCENES_SIGMA    6
SCENE_SIDE      96
FWHM_RANGE      2,4
SIGMA_RANGE     2,3
TUNE_SCENES     2
TUNE_NITER      2,10
TUNE_FILTER     0,0.5
EXAMPLES        2
QA_FIGURES      N
END

cat >photometry.conf <<'END'
CAMPAIGN_TYPE   PHOTOMETRY
RESTORE_TYPE    NONE,RL
FLUXES          AUTO,TEMPLATE
MAGNITUDES      15,19,2
TILES           6
STARS_PER_TILE  150
QA_FIGURES      N
SIM.IMAGE_SIZE  224
STAGE.RL_NITER  5
END

cat >detection.conf <<'END'
CAMPAIGN_TYPE   DETECTION
RESTORE_TYPE    NONE,RL
SCENES          STARS,GALAXIES,PAIRS
SCENE_TILES     2
SEEING          3
SKY_ERROR       0,0.3
TUNE_NITER      5,10
TUNE_FILTER     0.5
QA_FIGURES      N
SIM.IMAGE_SIZE  192
SIM.STAR_COUNT  800
STAGE.DETECT_THRESH 1.1
END

# start KIND OUTPUT JOURNAL THREADS ARGUMENT...: in the background as process $job, what it says in OUTPUT.log.
start() {
    settings=$1.conf output=$2 journal=$3 threads=$4
    shift 4
    "$program" "$settings" -OUTPUT_NAME "$output" -JOURNAL_NAME "$journal" -NTHREADS "$threads" "$@" \
        2>"$output.log" &
    job=$!
}

# The same, to its end.
campaign() {
    start "$@"
    wait $job
}

lines_of() {
    if [ -e "$1" ]; then wc -l <"$1"; else echo 0; fi
}

# a_moment NANOSECONDS: for a campaign that takes so long, so many units after a start, and so many seconds after that.
a_moment() {
    awk -v seed="$(date +%N)" -v took="$1" 'BEGIN { srand(seed); printf "%d %.3f", 2 * rand(), 0.1e-9 * took * rand() }'
}

python=$(for p in python3 /usr/bin/python3; do "$p" -c 'import scipy' 2>/dev/null && echo "$p" && break; done)
kills=${RX_KILLS:-10} # fewer where time is short
for kind in restoration photometry detection; do
    began=$(date +%s%N)
    campaign $kind $kind-whole $kind.whole 1
    result "$kind: a whole run on one thread" $? $kind-whole.log
    if [ -n "$python" ]; then
        "$python" -B "$top/tests/rows.py" $kind-whole >numbers 2>&1
        result "$kind: its numbers are those of its rows, by scipy" $? numbers
        "$python" -B "$top/validation/contests.py" $kind-whole >numbers 2>&1 && grep -q '"McNemar"\|"paired t"' contests.ecsv &&
            [ -s claims.ecsv ]
        result "$kind: its runs are tested against each other" $? numbers
    else
        skip "$kind: numbers and tests" "no python3 with scipy"
    fi

    # killed: what is done stays done; a run that came to its end before its moment is begun anew
    took=$(($(date +%s%N) - began)) hits=0 tries=0 kept=0
    while [ $hits -lt "$kills" ] && [ $tries -lt 60 ]; do
        tries=$((tries + 1))
        read -r units moment <<END
$(a_moment $took)
END
        start $kind $kind-killed $kind.killed 2
        # at least until the journal has its head: the torn line below needs one
        while { [ "$(lines_of $kind.killed)" -lt $((kept + units)) ] || [ ! -s $kind.killed ]; } &&
            kill -0 $job 2>/dev/null; do
            sleep 0.01
        done
        sleep "$moment"
        kill -9 $job 2>/dev/null
        wait $job 2>/dev/null
        status=$?
        lines=$(lines_of $kind.killed)
        # a torn line is cut off, so one line may go
        [ "$lines" -ge $((kept - 1)) ] || echo "the journal lost lines: $kept, then $lines" >>lost
        kept=$lines
        echo "after $units units and $moment s: status $status, $lines lines" >>moments.list
        if [ $status -eq 137 ]; then
            hits=$((hits + 1))
        else
            rm -rf $kind.killed $kind-killed
            kept=0
        fi
    done
    [ $hits -eq "$kills" ]
    result "$kind: $kills kills strike" $? moments.list
    [ ! -e lost ]
    result "$kind: no unit was lost" $? lost
    rm -f lost moments.list
    printf '17 4 0.1 0.2 torn' >>$kind.killed
    campaign $kind $kind-killed $kind.killed 2
    result "$kind: resumed to its end" $? $kind-killed.log
    diff -r $kind-whole $kind-killed >difference 2>&1
    result "$kind: the report of the killed run has the same bytes" $? difference

    find . -name '.*.rx-*' >leftovers
    [ ! -s leftovers ]
    result "$kind: nothing is left of the killed runs" $? leftovers

    # shards
    campaign $kind $kind-shards $kind.shards 1 -SHARD 1/3
    result "$kind: shard 1" $? $kind-shards.log
    [ ! -e $kind-shards ] && grep -q "MERGE Y" $kind-shards.log
    result "$kind: one shard makes no report and says how to merge" $? $kind-shards.log
    campaign $kind $kind-shards $kind.shards 1 -SHARD 1/3 -MERGE Y
    [ $? -eq 3 ] && grep -q "shard 2/3 lacks .* (no journal), shard 3/3 lacks" $kind-shards.log
    result "$kind: merging too early says what is missing" $? $kind-shards.log
    for k in 2 3; do
        campaign $kind $kind-shards $kind.shards 3 -SHARD $k/3
        result "$kind: shard $k" $? $kind-shards.log
    done
    campaign $kind $kind-shards $kind.shards 2 -SHARD 1/3 -MERGE Y
    result "$kind: merged" $? $kind-shards.log
    diff -r $kind-whole $kind-shards >difference 2>&1
    result "$kind: the report of three shards has the same bytes" $? difference
done

# a complete journal makes its report again, without work
campaign restoration again restoration.whole 1
result "a complete journal gives its report again" $? again.log
diff -r restoration-whole again >difference 2>&1
result "with the same bytes" $? difference

# what decides results must not change under a journal
campaign restoration other restoration.whole 1 -SEED 2
[ $? -eq 2 ] && grep -q "SEED 1, now it is 2" other.log && [ ! -e other ]
result "a journal of another seed is refused by name" $? other.log
: >empty.journal
campaign restoration empty empty.journal 2 && diff -r restoration-whole empty >difference 2>&1
result "an empty journal, as a kill in its first moment leaves it, is begun" $? empty.log
echo "not ours" >letter
campaign restoration other letter 1
[ $? -eq 2 ] && [ "$(cat letter)" = "not ours" ]
result "a file that is no journal is refused and left alone" $? other.log
mkdir full && echo mine >full/thesis
campaign restoration full restoration.whole 1
[ $? -eq 2 ] && [ "$(cat full/thesis)" = "mine" ]
result "a folder of somebody else is refused before the work" $? full.log

# a polite signal: what is done is kept, and said
start photometry polite photometry.polite 1
polite=$job tries=0
while [ "$(lines_of photometry.polite)" -lt 1 ] && [ $tries -lt 200 ]; do
    sleep 0.02
    tries=$((tries + 1))
done
campaign photometry second photometry.polite 1
[ $? -eq 4 ] && grep -q "in use" second.log
result "a journal in use is left alone" $? second.log
kill -TERM $polite
wait $polite
[ $? -eq 143 ] && grep -q "the same command goes on from there" polite.log && [ ! -e polite ]
result "a signal ends the campaign after the units at work" $? polite.log
campaign photometry polite photometry.polite 2
result "which then goes on" $? polite.log
diff -r photometry-whole polite >difference 2>&1
result "to the same bytes" $? difference

# validation/run.sh: the report is of the model that it was given
given() {
    folder=$1
    shift
    RX_MODEL=$top/config/psfnet-fast.fits RX_VALIDATE=$program "$top/validation/run.sh" restoration small "$folder" -SEED 5 -SCENES_FWHM 2 -SCENES_SIGMA 2 \
        -SCENE_SIDE 96 -FWHM_RANGE 3,4 -SIGMA_RANGE 2,3 -TUNE_SCENES 1 -TUNE_NITER 2 -TUNE_FILTER 0 -EXAMPLES 1 -QA_FIGURES N "$@" >>given.log 2>&1
}
given mine && grep -q "digest $("$programs/rextract-train" -INFO "$top/config/psfnet-fast.fits" | sed -n '1s/.*, digest //p')\"" mine/restoration/summary.json &&
    ! given another -STAGE.NET_MODEL "$top/config/psfnet-blind.fits"
result "validation/run.sh evaluates the model that it was given, or fails" $? given.log

finish
