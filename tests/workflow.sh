#!/bin/sh
# The Snakemake workflow on one machine: the same roll-up as of rextract @LIST, tiles that fail told and not tried again,
# tiles of a machine that fails tried again, a run that was stopped goes on, and names that a shell would obey.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
need rextract rextract-survey rextract-simulate
if ! command -v snakemake >/dev/null; then
    skip 'the workflow' 'no snakemake'
    finish
fi
enter
export HOME="$scratch" PYTHONDONTWRITEBYTECODE=1

# shellcheck disable=SC2016 # such a name it is
strange='b $(touch obeyed); `touch obeyed`'\''s.fits'
n=0
for name in a.fits "$strange" c.fits d.fits; do
    n=$((n + 1))
    "$programs/rextract-simulate" -IMAGE_SIZE 96 -SEED $n -STAR_COUNT 3000 -GALAXY_COUNT 0 -IMAGE_NAME "$name" \
        -TRUTH_NAME "${name%.fits}.truth" -VERBOSE_TYPE QUIET || exit 2
done
cat >tiles.list <<END
a.fits
"$strange"          # a name that a shell would obey
missing.fits
c.fits -DETECT_THRESH 3

d.fits
END
printf 'RESTORE_TYPE NONE\nFILTER N\nPARAMETERS_NAME my.param\nREFERENCE_NAME {tile}.truth\nQA_FIGURES N\n' >my.sex
printf 'NUMBER\nX_IMAGE\nY_IMAGE\nMAG_AUTO\n' >my.param
cat >my.yaml <<END
settings: my.sex
rextract: "$programs/rextract"
survey: "$programs/rextract-survey"
survey_options: ["-QA_FIGURES", "N", "-VERBOSE_TYPE", "QUIET"]
END

workflow() {
    snakemake --snakefile "$top/workflow/Snakefile" --configfile my.yaml --cores 1 --quiet >log 2>&1 </dev/null
}

workflow
result 'all tiles, one of them missing' $? log
[ "$(find ./done -type f ! -name '.*' | wc -l)" = 5 ] && [ -f survey/report.html ] && [ ! -e obeyed ]
result 'every tile is done, and no name was obeyed' $? log
grep -q '"fine": 4' survey/summary.json && grep -q 'missing.fits: cannot be opened' survey/junit.xml
result 'the tile that failed is reported' $? survey/junit.xml

python=/usr/bin/python3
if $python -c 'import astropy, yaml' 2>/dev/null; then
    $python - >log 2>&1 <<'END'
from astropy.table import Table
tiles = Table.read('survey/tiles.ecsv', format='ascii.ecsv')
bins = Table.read('survey/bins.ecsv', format='ascii.ecsv')
assert len(tiles) == 4 and 'off' in tiles.colnames and len(bins) > 0, (tiles, bins)
END
    result 'astropy reads the tables of the roll-up' $? log
else
    skip 'astropy reads the tables of the roll-up' 'python3 with astropy is absent'
fi

mkdir other && cp ./*.fits ./*.truth my.sex my.param tiles.list other && (
    cd other && mkdir catalogs records reports &&
        "$programs/rextract" @tiles.list -c my.sex -VERBOSE_TYPE QUIET -CATALOG_NAME 'catalogs/{tile}.cat' \
            -RECORD_NAME 'records/{tile}.record' -QA_NAME 'reports/{tile}'
    [ $? = 8 ] && cat records/*.record >all.records &&
        "$programs/rextract-survey" all.records -TILES_NAME tiles.list -QA_FIGURES N -VERBOSE_TYPE QUIET
) >log 2>&1
diff -r -x .snakemake_timestamp survey other/survey >>log 2>&1 && diff -r catalogs other/catalogs >>log 2>&1
result 'the same catalogues and roll-up as of rextract @LIST' $? log

# rollup NAME RECORDS ARGUMENT...: into the folder NAME
rollup() {
    name=$1 records=$2
    shift 2
    "$programs/rextract-survey" "$records" -TILES_NAME tiles.list -QA_FIGURES N -VERBOSE_TYPE QUIET -OUTPUT_NAME "$name" "$@" >>log 2>&1
}
: >log
cat records/d.record records/a.record >some.records
printf '%s\n' some.records records/c.record '# twice' records/a.record records/missing.record >records.names
printf '%s\n' "records/${strange%.fits}.record" >>records.names
rollup shards @records.names -MERGED_NAME all.records && diff -r -x .snakemake_timestamp survey shards >>log &&
    cat records/*.record >unsorted.records && rollup sorted unsorted.records -MERGED_NAME sorted.records &&
    cmp all.records sorted.records >>log && rollup again all.records && diff -r shards again >>log &&
    rollup piped /dev/stdin <all.records && diff -r shards piped >>log
result 'the same roll-up of records in any files and order, and of the merged ones' $? log

PYTHONPATH=$top/workflow/scripts /usr/bin/python3 - "$programs/rextract" >log 2>&1 <<'END'
import json, os, subprocess, sys, tiles
calls = []
run = subprocess.run
def counted(*words, **how):
    calls.append(words)
    return run(*words, **how)
def plans(found):
    return tiles.Plans(found, sys.argv[1], "my.sex", ["-RESTORE_TYPE", "RL"], 2, 777)
plan = plans(tiles.read("tiles.list")).of
words = [sys.argv[1], "-PLAN", "Y", "a.fits", "-c", "my.sex", "-RESTORE_TYPE", "RL", "-NTHREADS", "2"]
told = json.loads(subprocess.run(words + ["-PLAN_DENSITY", "2000"], check=True, stdout=subprocess.PIPE).stdout)["all"]
print(plan("a", 2000), plan("a", 500000), plan("missing", 2000), told)
assert 0 <= plan("a", 2000) - tiles.WORKFLOW_MB - told["memory_bytes"] / 1e6 < 1.1
assert plan("a", 500000) > plan("a", 2000)
assert plan("missing", 2000) == 777
with open("many.list", "w") as many:
    for i in range(300):
        many.write(f"n{i}.fits -REFERENCE_NAME a.truth" + " -DETECT_TRESH 3" * (i == 123) + "\n")
        if i != 200:
            os.link("a.fits", f"n{i}.fits")
subprocess.run = counted
many = tiles.read("many.list")
plan = plans(many).of
alone = plan("n299", 2000)
assert alone > tiles.WORKFLOW_MB and len(calls) == 1
assert [name for name in many if plan(name, 2000) != alone] == ["n123", "n200"] and plan("n123", 2000) == 777
print(len(calls), "calls")
assert len(calls) < 30
for i in range(300):
    if i != 200:
        os.unlink(f"n{i}.fits")
END
result 'a job asks for what rextract -PLAN says' $? log

touch -r survey/report.html before
workflow && ! grep -q 'rule tile' log && [ -z "$(find survey/report.html -newer before)" ]
result 'nothing is done twice' $? log
rm -rf done/c survey
workflow && [ -f survey/report.html ] && [ -f done/c ] && [ "$(find catalogs -newer before -name '*.cat' | wc -l)" = 1 ]
result 'a run that was stopped goes on with what is left' $? log

# a machine that fails: twice out of memory, then fine
cat >flaky <<END
#!/bin/sh
case \$* in *'-PLAN '*) ;; a.fits*) echo x >>tries; [ "\$(wc -l <tries)" -gt 2 ] || exit 4 ;; esac
exec "$programs/rextract" "\$@"
END
chmod +x flaky
sed -i "s,^rextract:.*,rextract: \"$scratch/flaky\"," my.yaml
rm -rf ./done survey records
workflow && [ "$(wc -l <tries)" = 3 ] && diff -r -x .snakemake_timestamp survey other/survey >>log 2>&1
result 'a tile that failed for want of memory is tried again' $? log
rm -rf ./done survey records tries
sed -i 's,-gt 2,-gt 99,' flaky
! workflow && [ "$(wc -l <tries)" = 3 ] && [ ! -e done/a ] && [ ! -e survey ] && grep -q 'a.fits: rextract ended with 4, no record' log
result 'one that never succeeds and leaves no record fails the run' $? log
sed -i "s,^rextract:.*,rextract: \"$programs/rextract\"," my.yaml
workflow && [ -f done/a ] && diff -r -x .snakemake_timestamp survey other/survey >>log 2>&1
result 'and the run goes on once it can' $? log

# status 10, by a program that counts its tries
cp tiles.list whole.list
cp my.yaml good.yaml
cat >counting <<END
#!/bin/sh
case \$* in *'-PLAN '*) ;; *) echo x >>tries ;; esac
exec "$programs/rextract" "\$@"
END
chmod +x counting
sed -i "s,^rextract:.*,rextract: \"$scratch/counting\"," my.yaml
echo 'a.fits -RESTORE_TYPE RL -PSF_TYPE AUTO -PSF_MINSNR 1e6 -RESTORE_FALLBACK N' >tiles.list
rm -rf ./done survey records tries
workflow && [ -f done/a ] && [ "$(wc -l <tries)" = 1 ] && grep -q 'cannot be done by RL' logs/a.log
result 'a tile that its restorer cannot do is not tried again' $? log
mv good.yaml my.yaml
mv whole.list tiles.list

slurm=$top/workflow/profiles/slurm
sed 's/^cluster-generic-submit-cmd:/cluster:/; s/^cluster-generic-\(.*\)-cmd:/cluster-\1:/; /^executor: cluster-generic$/d; /^#/d' \
    "$slurm/config.v8+.yaml" >after7
grep -v '^#' "$slurm/config.yaml" | diff - after7 >log
result 'the profiles of Snakemake 7 and of 8 and later say the same' $? log

# --- what is wrong with the configuration ---

# refused TITLE PATTERN: the run fails with that line, and nothing is done.
refused() {
    rm -rf ./done survey records
    ! workflow && grep -q -- "$2" log && [ -z "$(ls "done" records survey 2>/dev/null)" ]
    result "$1" $? log
}

cp my.yaml good.yaml
sed -i 's/^settings:.*/settings: absent.sex/' my.yaml
refused 'a configuration file that is missing' 'absent.sex: cannot be opened'
sed 's/^settings:.*/settings: bad.sex/' good.yaml >my.yaml
(cat my.sex && echo 'DETECT_TRESH 3') >bad.sex
refused 'a misspelt keyword for all tiles' 'bad.sex:6: .*DETECT_TRESH'
(cat good.yaml && echo 'tiles: 3') >my.yaml
refused 'a list that is a number' '^tiles: 3: give a name'
(cat good.yaml && echo 'tiles: absent.list') >my.yaml
refused 'a list that is missing' '^tiles: absent.list: No such file'
(cat good.yaml && echo 'options: "-DETECT_THRESH 3"') >my.yaml
refused 'options that are no list' '^options: -DETECT_THRESH 3: give a list'
sed 's/^rextract:.*/rextract: absent/' good.yaml >my.yaml
refused 'a program that is missing' '^rextract: absent: No such file'
cp good.yaml my.yaml
cp tiles.list whole.list
printf 'a.fits\nc.fits -DETECT_TRESH 3\n' >tiles.list
rm -rf ./done survey records
! workflow && [ ! -e done/c ] && [ ! -e survey ] && grep -q 'c.fits: rextract ended with 2, a keyword is wrong' log
result 'a wrong keyword of one tile' $? log
cp a.fits 'e{x}.fits'
cp a.truth 'e{x}.truth'
printf 'e{x}.fits\n' >tiles.list
workflow && [ -f survey/report.html ] && grep -q '"fine": 1' survey/summary.json
result 'a name with braces' $? log
cp whole.list tiles.list

echo '"a.fits' >tiles.list
! workflow && grep -q 'tiles.list:1: a quote is not closed' log
result 'a list that is wrong' $? log

finish
