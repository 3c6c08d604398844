#!/bin/bash
# A survey on Slurm with faults in the middle, for real: a controller and a node on this machine, 50 simulated tiles and
# the real ones. A rextract is killed, a job is killed, the node dies with all that runs on it, the controller is started anew; yet
# nothing is lost, nothing is done twice but what the node had in hand, and the roll-up is that of an undisturbed run without
# Slurm, to the byte.
#
# It takes some minutes and is no part of make check; .ci/run calls it: RX_BUILD_DIR=BUILD tests/slurm/survey.sh
# Real tiles need RX_SHARED_DATA. RX_TILES: how many simulated ones, 50 without.
set -uo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
. "$top/tests/lib.sh"
need rextract rextract-survey rextract-simulate
data=${RX_SHARED_DATA:-$(cd "$top/../shared/data" 2>/dev/null && pwd)}
PATH=$PATH:/usr/sbin:/sbin
for other in snakemake munged slurmctld slurmd sbatch; do
    command -v "$other" >/dev/null || {
        skip 'a survey on Slurm' "$other is missing (Debian: snakemake, munge, slurm-wlm)"
        finish
    }
done
enter
slurm=$top/tests/slurm/slurm.sh
trap 'pkill -f "$scratch/"; bash "$slurm" stop "$scratch/slurm"; rm -rf "$scratch"' EXIT
export HOME=$scratch PYTHONDONTWRITEBYTECODE=1 SLURM_CONF=$scratch/slurm/slurm.conf

# The survey: the same files seen from two folders, one for each way to run it.
mkdir images calm faults
for n in $(seq "${RX_TILES:-50}"); do
    "$programs/rextract-simulate" -IMAGE_SIZE 128 -SEED "$n" -STAR_COUNT 3000 -GALAXY_COUNT 1000 -IMAGE_NAME "images/sim$n.fits" \
        -TRUTH_NAME "images/sim$n.truth" -VERBOSE_TYPE QUIET || exit 2
    echo "$scratch/images/sim$n.fits -REFERENCE_NAME $scratch/images/{tile}.truth" >>tiles.list
done
echo "$scratch/images/missing.fits" >>tiles.list
if [[ -n $data && -d $data ]]; then
    for tile in sextractor/galaxies.fits fields/M6707HH.fits fields/aligned_eso085-030-004.fit fields/spitzer_example_image.fits \
        fields/sep_image.fits fields/M13_blue_0001.fits odd/gitlfs_pointer_frame-r.fits; do
        echo "$data/$tile" >>tiles.list
    done
else
    skip 'real tiles' 'RX_SHARED_DATA names no folder of them'
fi
tiles=$(wc -l <tiles.list)
printf 'RESTORE_TYPE NONE\nFILTER N\nPARAMETERS_NAME my.param\nQA_FIGURES N\n' >my.sex
printf 'NUMBER\nX_IMAGE\nY_IMAGE\nMAG_AUTO\nMAGERR_AUTO\nFLAGS\n' >my.param

# rextract with a diary of its begins and ends, and a victim of each kind: it waits, the first time, to be killed.
cat >diary <<END
#!/bin/bash
case \$1 in -*) exec "$programs/rextract" "\$@" ;; esac # only a plan
tile=\$(basename "\$1" .fits)
echo "begin \$tile" >>diary.log
if [[ \$PWD = */faults && " sim3 sim17 sim31 " = *" \$tile "* && ! -e victim.\$tile ]]; then
    touch "victim.\$tile"
    case \$tile in
    sim3) # the program, in the middle of its work
        timeout -s KILL 0.02 "$programs/rextract" "\$@"
        echo "killed \$tile" >>diary.log
        exit 137 ;;
    *) sleep 600 ;;
    esac
fi
"$programs/rextract" "\$@"
code=\$?
echo "end \$tile \$code" >>diary.log
exit \$code
END
chmod +x diary
for folder in calm faults; do
    cp my.sex my.param tiles.list "$folder"
    cat >"$folder/my.yaml" <<END
settings: my.sex
rextract: "$scratch/diary"
survey: "$programs/rextract-survey"
survey_options: ["-QA_FIGURES", "N", "-VERBOSE_TYPE", "QUIET"]
memory_mb: 400
END
done

# victim NAME: wait until it has begun
victim() {
    for _ in $(seq 3000); do
        [[ -e faults/victim.$1 ]] && return
        sleep 0.2
    done
    echo "survey.sh: $1 was never begun" >&2
    return 1
}

# job NAME: the number of the Slurm job that runs this victim
job() {
    local pid
    for pid in $(pgrep -f "^/bin/bash $scratch/diary .*/$1\.fits"); do
        tr '\0' '\n' <"/proc/$pid/environ" | sed -n 's/^SLURM_JOB_ID=//p'
    done
}

disturb() {
    local hit
    victim sim17 && hit=$(job sim17) && [[ -n $hit ]] && scancel --signal=KILL --full "$hit" && echo "job $hit killed" || return 1
    bash "$slurm" restart-controller slurm && echo "controller stopped and started again" || return 1
    victim sim31 && bash "$slurm" kill-node slurm && echo "node killed" || return 1
    sleep 1
    bash "$slurm" restart-node slurm && echo "node started again" || return 1
    # What the node had is tried again by Slurm in two minutes; no need to wait for them.
    for _ in $(seq 100); do
        for hit in $(squeue -h -t PENDING -o %i); do scontrol update JobId="$hit" StartTime=now; done
        sleep 1
        [[ -n $(squeue -h -o %i) ]] || return 0
    done
}

(cd calm && snakemake --snakefile "$top/workflow/Snakefile" --configfile my.yaml --cores 2 --quiet) >calm.log 2>&1 </dev/null
result "$tiles tiles without Slurm" $? calm.log

bash "$slurm" start slurm || exit 2
mkdir faults/slurm
disturb >disturb.log 2>&1 &
(cd faults && snakemake --snakefile "$top/workflow/Snakefile" --configfile my.yaml --profile "$top/workflow/profiles/slurm" \
    --latency-wait 5) >faults.log 2>&1 </dev/null
result "$tiles tiles on Slurm, with faults" $? faults.log
wait $!
result 'a job and the node were killed, the controller started anew' $? disturb.log
cat disturb.log
mapfile -t restarted < <(scontrol -o show job | sed -n 's|^JobId=\([0-9]*\) .* Restarts=[1-9].*|faults/slurm/\1.log|p') # their logs
awk '{ n[$1 $2]++ } END { exit !(n["killedsim3"] == 1 && n["beginsim3"] == 2 && n["beginsim17"] == 2 && n["beginsim31"] == 2) }' \
    faults/diary.log
result 'and so was a rextract; what they were at was begun again' $? faults/diary.log

diff -r -x .snakemake_timestamp calm/survey faults/survey >log 2>&1
result 'the roll-up is that of the undisturbed run' $? log
diff -r calm/catalogs faults/catalogs >log 2>&1
result 'and so are the catalogues' $? log
diff <(cd calm/done && find . -type f ! -name '.*' | sort) <(cd faults/done && find . -type f ! -name '.*' | sort) >log &&
    [[ $(find faults/done -type f ! -name '.*' | wc -l) = "$tiles" ]]
result 'no tile is lost' $? log
# A node that dies between the end of a program and that of its job takes the word of it along: Slurm has to begin that one anew.
awk '$1 == "end" && n[$2]++ { print $2, n[$2] " times" }' faults/diary.log >log
again=0
while read -r tile times; do
    [[ $times == '2 times' ]] && grep -qwF "done/$tile" "${restarted[@]}" || again=1
done <log
[[ $again = 0 && $(grep -c '^end' faults/diary.log) = $((tiles + $(wc -l <log))) ]] && grep -qwF done/sim31 "${restarted[@]}"
result 'no tile is done twice, but for jobs that the node died with' $? log
grep -q '"fine"' faults/survey/summary.json && grep -q 'missing.fits: cannot be opened' faults/survey/junit.xml
result 'the tiles that failed are told' $? faults/survey/summary.json

finish
