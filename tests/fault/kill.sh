#!/bin/sh
# Whole runs that are killed at random moments, and two at once. Afterwards each output is that of one of two
# configurations, to the byte, and the next run leaves exactly its own outputs: no temporary of a killed one.
# RX_KILLS: how many (20). RX_SEED: of the moments.
set -u
LC_ALL=C
export LC_ALL
top=$(cd "${srcdir:-$(dirname "$0")/../..}" && pwd)
. "$top/tests/lib.sh"
need rextract tests/cli/make_fits
make_fits=$build/tests/cli/make_fits
kills=${RX_KILLS:-20} seed=${RX_SEED:-$(date +%s)}
enter
# libsep forgets a few bytes, which LeakSanitizer would make an error.
ASAN_OPTIONS=detect_leaks=0${ASAN_OPTIONS:+:$ASAN_OPTIONS}
export ASAN_OPTIONS
echo "seed $seed"

"$make_fits" tile tile.fits && "$make_fits" table ref.fits || exit 2

# with THRESHOLD: becomes the program, in the current folder. The report has figures where there is gnuplot.
with() {
    exec "$programs/rextract" ../tile.fits -DETECT_THRESH "$1" -RESTORE_TYPE NONE,RL -RL_NITER 20 -PSF_TYPE MOFFAT -PSF_FWHM 3 \
        -CATALOG_TYPE FITS_LDAC -CHECKIMAGE_TYPE RESTORED,SEGMENTATION -CHECKIMAGE_NAME r.fits,s.fits \
        -REFERENCE_NAME ../ref.fits -QA_NAME qa -RECORD_NAME tile.record -VERBOSE_TYPE QUIET -NTHREADS 1
}

milliseconds() {
    echo $(($(date +%s%N) / 1000000))
}

# Every output in work is that of one of the two; temporaries may be there.
whole() {
    for output in one/*; do
        output=${output#one/}
        diff -r "one/$output" "work/$output" >/dev/null 2>&1 || diff -r "two/$output" "work/$output" >/dev/null 2>&1 || {
            echo "$output is of neither run"
            return 1
        }
    done
}

mkdir one two
(cd one && with 1.5) && begin=$(milliseconds) && (cd two && with 4)
result 'two undisturbed runs' $?
span=$(($(milliseconds) - begin))
[ "$failed" -eq 0 ] || finish
cp -a one work

# struck SIGNAL THRESHOLD MILLISECONDS: a run of its own, ended in its course; its exit code.
struck() {
    (cd work && with "$2" 2>../said) &
    process=$!
    sleep "$(awk -v ms="$3" 'BEGIN { printf "%.3f", ms / 1000 }')"
    kill -s "$1" $process 2>/dev/null
    wait $process 2>/dev/null
}

hits=0 i=0
awk -v seed="$seed" -v n="$kills" 'BEGIN { srand(seed); while (n-- > 0) print rand() }' >moments
while read -r share; do
    moment=$(awk -v s="$share" -v ms="$span" 'BEGIN { print int(s * ms) }')
    i=$((i + 1))
    if [ $((i % 2)) -eq 0 ]; then threshold=1.5 next=4 expected=two; else threshold=4 next=1.5 expected=one; fi
    struck KILL $threshold "$moment"
    [ $? -eq 137 ] && hits=$((hits + 1))
    whole >complaint || result "kill $i, after $moment ms" 1 complaint
    begin=$(milliseconds)
    (cd work && with $next 2>../said) && span=$(($(milliseconds) - begin)) && diff -rq $expected work >complaint 2>&1
    result "the run after kill $i, after $moment ms" $? complaint
done <moments
# Three of four, nine of ten on a quiet machine; the moments are those of the run before, which had perhaps a busier one.
[ $((4 * hits)) -ge "$kills" ]
result "$hits of $kills kills struck" $?

# A polite signal: nothing is left at once, and the exit code is that of the signal, or 0 where the work was done.
i=0
awk -v seed="$seed" 'BEGIN { srand(seed + 1); for (i = 0; i < 6; i++) print rand() }' >moments
while read -r share; do
    i=$((i + 1))
    if [ $((i % 2)) -eq 0 ]; then name=HUP code=129; else name=TERM code=143; fi
    (cd work && with 4 2>../said) >/dev/null &
    process=$!
    sleep "$(awk -v s="$share" -v ms="$span" 'BEGIN { printf "%.3f", 0.01 + s * ms / 1000 }')"
    kill -s $name $process 2>/dev/null
    wait $process 2>/dev/null
    found=$?
    whole >complaint
    sound=$?
    find work -name '.*.rx-*' >>complaint
    [ $sound -eq 0 ] && [ ! -s complaint ] && { [ $found -eq 0 ] || [ $found -eq $code ]; }
    result "SIG$name, exit code $found" $? complaint
done <moments

# Two runs that write the same outputs at once: neither takes anything from the other.
for i in 1 2 3; do
    rm -rf work
    [ $i -eq 1 ] && mkdir work || cp -a one work
    (cd work && with 1.5 2>../said1) &
    process=$!
    (cd work && with 4 2>../said2)
    second=$?
    wait $process
    first=$?
    cat said1 said2 >complaint
    whole >>complaint && [ $first -eq 0 ] && [ $second -eq 0 ]
    sound=$?
    find work -name '.*.rx-*' >>complaint
    [ $sound -eq 0 ] && [ ! -s complaint ]
    result "two at once, $i: exit codes $first and $second" $? complaint
done

echo "$hits of $kills kills struck"
finish
