#!/bin/sh
# Ranks as processes: mpiexec runs tests/unit/par/mpi_ranks (messages, sums, ends of all kinds), lists of tiles,
# whose catalogues must not depend on how many processes there are, and a small training, whose model must have the same
# bytes for any number of them. MPI stays out of everything but rextract-train and rextract-mpi. Nothing may hang: every run has its limit.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
ranks=$build/tests/unit/par/mpi_ranks
train=$programs/rextract-train
need rextract-train tests/unit/par/mpi_ranks
enter

# --- who is linked with MPI ---

if command -v ldd >/dev/null; then
    : >links.log
    for program in "$programs"/rextract "$programs"/rextract-simulate "$programs"/rextract-validate \
        "$build"/.libs/librextract.so; do
        [ -f "$program" ] || continue
        ldd "$program" 2>&1 | grep -i mpi | sed "s,^,$(basename "$program"): ," >>links.log
    done
    [ ! -s links.log ]
    result "MPI is in no program that can do without it" $? links.log
else
    skip "MPI is in no program that can do without it" "no ldd"
fi

if ! command -v mpiexec >/dev/null; then
    skip "runs under mpiexec" "no mpiexec"
    finish
fi
if ! "$ranks" has-mpi >/dev/null 2>&1; then
    skip "runs under mpiexec" "built without MPI"
    finish
fi

# MPI's libraries keep memory of their own until the process ends.
ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}detect_leaks=0"
OMP_NUM_THREADS=1
export ASAN_OPTIONS OMP_NUM_THREADS

# processes COUNT PROGRAM...: under mpiexec; 124 when it hangs.
processes() {
    count=$1
    shift
    timeout -k 5 100 mpiexec -launcher fork -n "$count" "$@"
}

# expect TITLE STATUS WORDS COUNT CASE: a case of mpi_ranks; the words stand once in what it says.
expect() {
    title=$1 status=$2 words=$3 count=$4
    shift 4
    processes "$count" "$ranks" "$@" >case.log 2>&1
    code=$?
    echo "exit code $code, expected $status; expected once: $words" >>case.log
    [ "$code" = "$status" ] && [ "$(grep -v '^exit code' case.log | grep -c -- "$words")" = 1 ]
    result "$title" $? case.log
}

expect "messages of one other rank" 0 '^15000000 bytes of each came$' 2 messages
expect "messages of three other ranks" 0 '^15000000 bytes of each came$' 4 messages
for count in 2 3 8; do
    expect "sums of $count ranks" 0 "^sums of $count ranks in order\$" $count sums
done
expect "a rank that fails is heard by all" 3 'no galaxies are left$' 3 failing
expect "the same among many" 3 'no galaxies are left$' 8 failing
expect "a rank that ends without a word" 4 'rank 2 ended while it was still needed$' 3 leaving
expect "the same while others sum" 4 'rank 2 ended while it was still needed$' 3 leaving-sum
processes 3 "$ranks" unread >case.log 2>&1
code=$?
echo "exit code $code" >>case.log
[ "$code" = 4 ]
result "messages on their way to a rank that ends" $? case.log
expect "a message of another size" 4 'rank 1 sent 8 bytes, not 4' 2 size
expect "a signal while rank 0 waits for any" 7 'interrupted by a signal' 3 interrupted

processes 3 "$ranks" killed >case.log 2>&1
code=$?
echo "exit code $code" >>case.log
[ "$code" != 0 ] && [ "$code" != 124 ]
result "a process that is killed takes the others with it" $? case.log

# --- a list of tiles ---

rextract=$programs/rextract
for i in 1 2 3 4 5; do
    "$programs"/rextract-simulate -IMAGE_SIZE 64 -SEED $i -IMAGE_NAME t$i.fits -TRUTH_NAME t$i.truth -VERBOSE_TYPE QUIET
done
# cards that cfitsio alone reads: 0 pixels per block, which it divides by, and more digits than it has room for
LC_ALL=C sed "s,ZVAL1   = .\{70\},$(printf '%-80s' 'HIERARCH ZVAL1 = 0')," "$top/tests/data/sim.fits.fz" >divides.fits.fz
LC_ALL=C sed "s#ZVAL1   = .\{70\}#$(printf 'HIERARCH BLANK = (1,%050d)%10s' 2 '')#" "$top/tests/data/sim.fits.fz" >overflows.fits.fz
printf '%s\n' t1.fits t2.fits missing.fits divides.fits.fz overflows.fits.fz t3.fits 't4.fits -DETECT_THRESH 3' t5.fits >tiles.list
printf 'NUMBER\nX_IMAGE\nY_IMAGE\nFLUX_AUTO\n' >columns.param
extract="-PSF_TYPE MOFFAT -PSF_FWHM 3 -VERBOSE_TYPE QUIET -PARAMETERS_NAME columns.param -FILTER N"

# tiles TITLE COUNT FOLDER: five of eight tiles are done, the others are reported once each.
tiles() {
    rm -rf cats && mkdir cats # catalogues hold their names
    # shellcheck disable=SC2086 # words
    processes "$2" "$rextract" @tiles.list $extract -VERBOSE_TYPE NORMAL -CATALOG_NAME "cats/{tile}.cat" >tiles.log 2>&1
    code=$?
    echo "exit code $code" >>tiles.log
    [ "$code" = 8 ] && grep -q 'tiles.list: 3 of 8 tiles failed' tiles.log && [ "$(ls cats | wc -l)" = 5 ] &&
        [ "$(grep -c 'exit status 3 .*missing.fits: cannot be opened' tiles.log)" = 1 ] &&
        [ "$(grep -c 'exit status 3 .*divides.fits.fz.*ZVAL1' tiles.log)" = 1 ] &&
        [ "$(grep -c 'exit status 3 .*overflows.fits.fz.*longer' tiles.log)" = 1 ] && mv cats "$3"
    result "$1" $? tiles.log
}

tiles "a list of tiles, one process" 1 tiles1
tiles "a list of tiles, one that works" 2 tiles2
tiles "a list of tiles, three that work" 4 tiles4
tiles "more processes than tiles" 9 tiles9
for other in tiles2 tiles4 tiles9; do
    diff -r tiles1 "$other" >tiles.log 2>&1
    result "the same catalogues in $other" $? tiles.log
done

: >tiles.log
for catalogue in tiles4/*.cat; do
    "$rextract" -c "$catalogue" -CATALOG_NAME again -VERBOSE_TYPE QUIET >>tiles.log 2>&1 || echo "$catalogue: exit code $?" >>tiles.log
done
[ ! -s tiles.log ]
result "what several processes made is repeated by one" $? tiles.log
processes 3 "$rextract" -c tiles4/t1.cat -CATALOG_NAME again >tiles.log 2>&1
[ $? = 2 ] && [ "$(grep -c "t1.fits' is one tile, and mpiexec started several processes" tiles.log)" = 1 ]
result "repeating is not for several processes" $? tiles.log

# shellcheck disable=SC2086 # words
processes 3 "$rextract" -PLAN Y @tiles.list $extract -CATALOG_NAME '{tile}.cat' >plan.json 2>tiles.log
code=$?
"$rextract" -PLAN Y @tiles.list $extract -CATALOG_NAME '{tile}.cat' -NTHREADS 1 >plan1.json 2>>tiles.log
[ $? = 8 ] && [ $code = 8 ] && [ "$(ls ./*.cat 2>/dev/null)" = '' ] && diff plan.json plan1.json >>tiles.log
result "the plan of a list, made once and of one thread a tile" $? tiles.log
printf 't1.fits\nt2.fits -PLAN Y\n' >bad.list
processes 3 "$rextract" @bad.list >tiles.log 2>&1
[ $? = 2 ] && [ "$(grep -c 'bad.list:2: -PLAN is of the whole list' tiles.log)" = 1 ]
result "a plan within a line of a list is told of once" $? tiles.log

processes 3 "$programs"/rextract-simulate -IMAGE_NAME crowd.fits >tiles.log 2>&1
[ $? = 2 ] && [ "$(grep -c 'one of 3 processes that mpiexec started' tiles.log)" = 1 ] && [ ! -e crowd.fits ]
result "a program that does not share its work refuses" $? tiles.log
printf 't1.fits\nt2.fits -NO_SUCH_KEY 1\n' >bad.list
processes 3 "$rextract" @bad.list >tiles.log 2>&1
[ $? = 2 ] && [ "$(grep -c NO_SUCH_KEY tiles.log)" = 1 ]
result "a list that is wrong is told of once" $? tiles.log
processes 3 "$rextract" t1.fits >tiles.log 2>&1
[ $? = 2 ] && [ "$(grep -c 'give a list of tiles' tiles.log)" = 1 ]
result "one tile is not for several processes" $? tiles.log

"$programs"/rextract-simulate -IMAGE_SIZE 512 -SEED 6 -IMAGE_NAME long.fits -TRUTH_NAME '' -VERBOSE_TYPE QUIET
printf 'long.fits -CATALOG_NAME 1.cat\nlong.fits -CATALOG_NAME 2.cat\n' >long.list
# The processes themselves are told, as a batch system tells a job's: what mpiexec returns of a signal of its own is a
# matter of moments.
: >pids
# shellcheck disable=SC2086,SC2016 # words; for the shell inside
processes 3 sh -c 'echo $$ >>pids; exec "$@"' sh "$rextract" @long.list $extract -RL_NITER 100000 -VERBOSE_TYPE NORMAL >tiles.log 2>&1 &
run=$!
waited=0
until grep -q 'tile 2 of 2' tiles.log || [ $waited = 60 ]; do
    sleep 1
    waited=$((waited + 1))
done
sleep 1
# shellcheck disable=SC2046 # several
kill -TERM $(cat pids)
wait $run
code=$?
echo "exit code $code" >>tiles.log
[ $code = 7 ] && [ "$(grep -c 'interrupted by a signal' tiles.log)" = 1 ] && ! grep -q 'ended while' tiles.log &&
    grep -q 'interrupted by a signal; 0 of 2 tiles had ended' tiles.log && [ "$(ls -A ./*.cat ./.*.cat* 2>/dev/null)" = '' ]
result "a list of tiles that a signal ends is told of once" $? tiles.log

printf 't1.fits -CATALOG_NAME t1.cat\nt2.fits -CATALOG_NAME STDOUT\n' >stdout.list
# shellcheck disable=SC2086 # words
processes 3 "$rextract" @stdout.list $extract >stdout.cat 2>tiles.log
code=$?
# shellcheck disable=SC2086 # words
"$rextract" t2.fits $extract -CATALOG_NAME STDOUT >alone.cat 2>>tiles.log
[ $code = 0 ] && [ -s t1.cat ] && [ -s alone.cat ] && cmp stdout.cat alone.cat >>tiles.log 2>&1
result "a catalogue of a list on standard output" $? tiles.log
rm -f t1.cat

# The program itself, without rextract before it: in one process it is rextract.
for launch in "" "processes 1"; do
    # shellcheck disable=SC2086 # words
    $launch "$rextract-mpi" @stdout.list $extract >stdout.cat 2>tiles.log
    code=$?
    [ $code = 0 ] && [ -s t1.cat ] && cmp stdout.cat alone.cat >>tiles.log 2>&1 &&
        $launch "$rextract-mpi" -c t1.cat -CATALOG_NAME again -VERBOSE_TYPE QUIET >>tiles.log 2>&1
    result "rextract-mpi ${launch:-without mpiexec}: one process" $? tiles.log
    rm -f t1.cat
done

# --- a training ---

cat >small.conf <<'END'
EPOCHS        3
WIDTH         4
BLOCKS        1
BATCH         5
PATCH         32
PATCH_MARGIN  4
FIELD_PATCHES 2
FIELD_USES    2
GRID          2,2
FWHM_RANGE    2,3
BIN_IMAGES    14
NTHREADS      1
QA_FIGURES    N
VERBOSE_TYPE  QUIET
END

# training TITLE FOLDER COMMAND...: a run in a folder of its own.
training() {
    title=$1 place=$2
    shift 2
    mkdir "$place"
    (cd "$place" && "$@" >run.log 2>&1)
    result "$title" $? "$place/run.log"
}

# same_model TITLE FOLDER
same_model() {
    cmp alone/trained.fits "$2/trained.fits" >cmp.log 2>&1 && cmp alone/trained.checkpoint "$2/trained.checkpoint" >>cmp.log 2>&1
    result "$1" $? cmp.log
}

training "training without mpiexec" alone timeout 100 "$train" -c ../small.conf
training "training in one process of mpiexec" one processes 1 "$train" -c ../small.conf
same_model "one process of mpiexec gives the same model" one
training "training in two processes, of two threads" two processes 2 "$train" -c ../small.conf -NTHREADS 2
same_model "two processes give the same model" two
training "training in three processes" three processes 3 "$train" -c ../small.conf
same_model "three processes give the same model" three
training "more processes than images in a step" seven processes 7 "$train" -c ../small.conf
same_model "seven processes give the same model" seven

# said_once TITLE STATUS WORDS LOG CODE
said_once() {
    echo "exit code $5, expected $2; expected once: $3" >>"$4"
    [ "$5" = "$2" ] && [ "$(grep -v '^exit code' "$4" | grep -c -- "$3")" = 1 ]
    result "$1" $? "$4"
}

processes 3 "$train" -c small.conf -EPOCHS none >wrong.log 2>&1
said_once "a wrong keyword is told once" 2 'EPOCHS' wrong.log $?
processes 3 "$train" -c small.conf -MODEL_NAME none.fits -CHECKPOINT_NAME none.checkpoint \
    -SIM.TEMPLATE_COUNT 1000 -SIM.TEMPLATE_NAME absent.fits >wrong.log 2>&1
said_once "what fails in all processes is said once" 3 'absent.fits' wrong.log $?

# Stopped by a signal to mpiexec after its first epoch; the same command goes on, in one process as well.
mkdir stopped && cd stopped || exit 2
timeout -k 5 100 mpiexec -launcher fork -n 3 "$train" -c ../small.conf -EPOCHS 100000 -PATIENCE 0 \
    >run.log 2>&1 &
started=$!
waited=0
until [ -f trained.checkpoint ] || [ "$waited" -ge 300 ]; do
    sleep 0.2
    waited=$((waited + 1))
done
kill -TERM "$started"
wait "$started"
said_once "a training stopped by a signal says where it goes on" 1 'the same command goes on' run.log 1
timeout 100 "$train" -c ../small.conf -EPOCHS 1 -VERBOSE_TYPE NORMAL >again.log 2>&1
said_once "it goes on in one process" 0 'goes on' again.log $?
cd ..

finish
