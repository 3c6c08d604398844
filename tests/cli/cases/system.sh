# What the system does to a run: signals, permissions, full disks, folders that vanish, closed streams.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

none='-RESTORE_TYPE NONE'
endless='-PSF_TYPE MOFFAT -PSF_FWHM 3 -RL_NITER 100000'
everything='-CATALOG_TYPE FITS_LDAC -CHECKIMAGE_TYPE RESTORED,SEGMENTATION -CHECKIMAGE_NAME r.fits,s.fits'

# --- signals, as timeout sends them; 128 + the number of the signal that ended the program

# interrupted SIGNAL SECONDS CODE
interrupted() {
    [ "$active" = 1 ] || return 0
    list_files >../before
    timeout --foreground --preserve-status -s "$1" "$2" "$program" tile.fits $endless $everything \
        -VERBOSE_TYPE QUIET >../out 2>../err </dev/null
    echo $? >../code
    judge "$3" '^rextract: interrupted by a signal; nothing was written$'
}

for signal in 'INT 130' 'TERM 143' 'HUP 129'; do
    begin "SIG${signal% *} while a large tile is restored"
    make_fits large tile.fits
    echo old >test.cat
    interrupted "${signal% *}" 2 "${signal#* }"
done

begin 'a signal that the shell ignores does not end the work'
make_fits tile tile.fits
leaves test.cat
if [ "$active" = 1 ]; then
    list_files >../before
    (trap '' HUP && exec "$program" tile.fits -PSF_TYPE MOFFAT -PSF_FWHM 3 -RL_NITER 3000 -VERBOSE_TYPE QUIET) \
        >../out 2>../err </dev/null &
    process=$!
    sleep 0.2
    kill -HUP "$process"
    wait "$process"
    echo $? >../code
    judge 0 ''
fi

# --- permissions: as another user where this one is root, who may write anywhere

# unprivileged ARGUMENT...
unprivileged() {
    if [ "$(id -u)" != 0 ]; then
        timeout 60 "$program" "$@"
    else
        [ -x "$scratch/bin/rextract" ] || { mkdir "$scratch/bin" && cp "$program" "$scratch/bin/rextract"; }
        chmod 755 "$scratch" "$scratch/bin" "$scratch/bin/rextract" ..
        timeout 60 setpriv --reuid=65534 --regid=65534 --clear-groups "$scratch/bin/rextract" "$@"
    fi
}

# refused CODE PATTERN ARGUMENT...: expect(), as a user who may not.
refused() {
    [ "$active" = 1 ] || return 0
    if [ "$(id -u)" = 0 ] && ! command -v setpriv >/dev/null; then
        skip 'root may write anywhere, and there is no setpriv'
        return 0
    fi
    expected=$1 pattern=$2
    shift 2
    list_files >../before
    unprivileged "$@" -VERBOSE_TYPE QUIET >../out 2>../err </dev/null
    echo $? >../code
    chmod -R u+rwX .
    judge "$expected" "$pattern"
}

begin 'image that this user must not read'
make_fits tile tile.fits && chmod 000 tile.fits
refused 3 '^rextract: tile\.fits.*Permission denied' tile.fits $none

begin 'configuration that this user must not read'
make_fits tile tile.fits && echo 'DETECT_THRESH 3' >my.sex && chmod 000 my.sex
refused 2 '^rextract: my\.sex: cannot be opened: Permission denied' tile.fits $none -c my.sex

begin 'folder that this user must not write'
make_fits tile tile.fits && chmod 555 .
refused 4 '^rextract: test\.cat: cannot be written: Permission denied' tile.fits $none

begin 'folder of the check-image that this user must not write'
make_fits tile tile.fits && mkdir images && chmod 555 images
refused 4 '^rextract: images/b\.fits: cannot be written: Permission denied' tile.fits $none -CATALOG_TYPE NONE \
    -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME images/b.fits

begin 'folder of the report that this user must not write'
make_fits tile tile.fits && make_fits table ref.fits && mkdir reports && chmod 555 reports
refused 4 '^rextract: reports/qa: cannot be made: Permission denied' tile.fits $none -CATALOG_TYPE NONE \
    -REFERENCE_NAME ref.fits -QA_NAME reports/qa

# --- full disks: a limit on the size of files, in blocks of 512 or 1024 bytes, stands for them. What is said goes
# through a pipe, which has no limit.

# limited BLOCKS PATTERN ARGUMENT...
limited() {
    [ "$active" = 1 ] || return 0
    blocks=$1 pattern=$2
    shift 2
    list_files >../before
    {
        (ulimit -f "$blocks" && exec timeout 60 "$program" "$@" -VERBOSE_TYPE QUIET 2>&1 >/dev/null </dev/null)
        echo $? >../code
    } | cat >../err
    : >../out
    judge 4 "$pattern"
}

for type in ASCII ASCII_HEAD ASCII_SKYCAT ASCII_VOTABLE FITS_1.0 FITS_LDAC; do
    begin "disk full at a catalogue, $type"
    make_fits tile tile.fits
    echo old >test.cat
    limited 1 '^rextract: test\.cat: cannot be ' tile.fits $none -CATALOG_TYPE $type
done

for blocks in 0 2 16; do
    begin "disk full at a check-image after $blocks blocks"
    make_fits large tile.fits
    limited $blocks '^rextract: s\.fits: ' tile.fits $none -CATALOG_TYPE NONE -CHECKIMAGE_TYPE SEGMENTATION \
        -CHECKIMAGE_NAME s.fits
done

for blocks in 0 1 4 16; do
    begin "disk full at the report after $blocks blocks"
    make_fits tile tile.fits && make_fits table ref.fits
    limited $blocks '^rextract: .*report.*cannot be ' tile.fits $none -CATALOG_TYPE NONE -REFERENCE_NAME ref.fits \
        -QA_NAME report -QA_FIGURES N
done

begin 'disk full at figures'
make_fits tile tile.fits && make_fits table ref.fits
if command -v gnuplot >/dev/null; then
    limited 32 '^rextract: .*report.*cannot be ' tile.fits $none -CATALOG_TYPE NONE -REFERENCE_NAME ref.fits -QA_NAME report
else
    skip 'no gnuplot'
fi

# --- folders that vanish while the work is done

# vanishing FOLDER PATTERN ARGUMENT...: the folder goes once an output has been begun in the folder target.
vanishing() {
    [ "$active" = 1 ] || return 0
    folder=$1 pattern=$2
    shift 2
    list_files | grep -v "\./$folder" >../before
    "$program" "$@" -PSF_TYPE MOFFAT -PSF_FWHM 3 -RL_NITER 300 -VERBOSE_TYPE QUIET >../out 2>../err </dev/null &
    process=$!
    for _ in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20; do
        [ -n "$(ls -A target)" ] && break
        sleep 0.1
    done
    rm -rf "$folder"
    wait "$process"
    echo $? >../code
    judge 4 "$pattern"
}

begin 'folder of a check-image that vanishes'
make_fits large tile.fits && mkdir target
vanishing target '^rextract: target/' tile.fits -CATALOG_NAME target/test.cat -CHECKIMAGE_TYPE RESTORED \
    -CHECKIMAGE_NAME target/r.fits

begin 'folder of the catalogue that vanishes'
make_fits large tile.fits && mkdir target other
vanishing other '^rextract: other/test\.cat' tile.fits -CATALOG_NAME other/test.cat -CHECKIMAGE_TYPE RESTORED \
    -CHECKIMAGE_NAME target/r.fits

# --- streams that are closed: no output may take their place

begin 'standard error that is closed'
make_fits tile tile.fits
leaves test.cat b.fits s.fits
if [ "$active" = 1 ]; then
    list_files >../before
    set -- tile.fits $none -CHECKIMAGE_TYPE BACKGROUND,SEGMENTATION -CHECKIMAGE_NAME b.fits,s.fits \
        -INTERP_TYPE NONE -VERBOSE_TYPE FULL
    "$program" "$@" 2>/dev/null && cat test.cat b.fits s.fits | cksum >../expected
    rm -f test.cat b.fits s.fits
    "$program" "$@" >../out 2>&- <&-
    echo $? >../code
    cat test.cat b.fits s.fits | cksum | diff ../expected - >../err
    judge 0 ''
fi

begin 'standard output that is closed'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    timeout 60 "$program" tile.fits $none -CATALOG_NAME STDOUT -VERBOSE_TYPE QUIET >&- 2>../err
    echo $? >../code
    : >../out
    judge 4 '^rextract: .*standard output'
fi

begin 'a reader of the help that has seen enough'
if [ "$active" = 1 ]; then
    list_files >../before
    {
        sleep 0.2
        env --default-signal=PIPE "$program" -dd 2>../err
        echo $? >../code
    } | :
    : >../out
    judge 0 ''
fi

begin 'a reader of the catalogue that has seen enough: the other outputs are written'
make_fits tile tile.fits
leaves b.fits
if [ "$active" = 1 ]; then
    list_files >../before
    {
        sleep 0.2
        timeout 60 "$program" tile.fits $none -CATALOG_NAME STDOUT -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME b.fits -VERBOSE_TYPE QUIET 2>../err
        echo $? >../code
    } | :
    : >../out
    judge 0 ''
fi

begin 'a disk that is full is a failure, though a closed pipe is none'
make_fits tile tile.fits
if [ "$active" = 1 ] && [ -c /dev/full ]; then
    list_files >../before
    timeout 60 "$program" tile.fits $none -CATALOG_NAME STDOUT -VERBOSE_TYPE QUIET >/dev/full 2>../err
    echo $? >../code
    : >../out
    judge 4 '^rextract: .*standard output'
fi

# --- a gnuplot that does not do its work: the report comes without figures

# gnuplot_is LINE: a script of that name, found before any other.
gnuplot_is() {
    mkdir bin && printf '#!/bin/sh\n%s\n' "$1" >bin/gnuplot && chmod 755 bin/gnuplot
}

for line in 'kill -KILL $$' 'exit 1' 'echo "<svg" >completeness.svg'; do
    begin "report where gnuplot says: $line"
    make_fits tile tile.fits && make_fits table ref.fits && gnuplot_is "$line"
    leaves qa
    path=$PATH PATH=$folder/work/bin:$PATH
    expect 0 '' tile.fits $none -CATALOG_TYPE NONE -REFERENCE_NAME ref.fits -QA_NAME qa
    PATH=$path
done

begin 'gnuplot that hangs, and a signal'
make_fits tile tile.fits && make_fits table ref.fits && gnuplot_is 'exec sleep 300'
if [ "$active" = 1 ]; then
    list_files >../before
    PATH=$folder/work/bin:$PATH timeout --foreground --preserve-status -s TERM 2 "$program" tile.fits $none \
        -REFERENCE_NAME ref.fits -QA_NAME qa -VERBOSE_TYPE QUIET >../out 2>../err </dev/null
    echo $? >../code
    judge 143 '^rextract: interrupted by a signal; nothing was written$'
fi

# --- a file system that is really full, where this user may mount one in a name space of his own

begin 'file systems of 16 to 128 KB'
make_fits tile tile.fits && make_fits table ref.fits
if ! unshare -m mount -t tmpfs none . 2>/dev/null; then
    skip 'no tmpfs can be mounted'
elif [ "$active" = 1 ]; then
    mkdir small
    list_files >../before
    for size in 16 48 80 96 128; do
        # shellcheck disable=SC2016 # of the inner shell
        unshare -m sh -c 'mount -t tmpfs -o size="$1"k none small && echo old >small/test.cat || exit 99
            "$2" tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE FITS_LDAC -CATALOG_NAME small/test.cat -CHECKIMAGE_TYPE RESTORED \
                -CHECKIMAGE_NAME small/r.fits -REFERENCE_NAME ref.fits -QA_NAME small/qa -QA_FIGURES N -VERBOSE_TYPE QUIET
            echo "$1 KB: $? $(ls -A small | tr "\n" " ")$(cat small/test.cat)"' sh $size "$program" 2>&1 </dev/null
    done >../said
    grep -v '^rextract: small/.*: cannot be .*' ../said | grep -v '^[0-9]* KB: 4 test.cat old$' >../err
    grep -c '^rextract: small/' ../said | grep -q '^5$' || cat ../said >>../err
    : >../out
    echo 0 >../code
    judge 0 ''
fi

begin 'catalogue where a link to nothing is'
make_fits tile tile.fits && ln -s nothing test.cat
leaves nothing test.cat
expect 0 '' tile.fits $none

# --- a disk that fails: a read of the reference has an error, one after the other; it is told, or nothing is lost

begin 'reads that fail in a table'
make_fits tile tile.fits && make_fits table ref.fits
if grep -q __asan_init "$rextract" || ! strace -e inject=read:error=EIO:when=60000 -o ../trace true 2>/dev/null; then
    skip 'no strace'
elif [ "$active" = 1 ]; then
    list_files >../before
    set -- tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE NONE -REFERENCE_NAME ref.fits -QA_FIGURES N -VERBOSE_TYPE QUIET -QA_NAME qa
    "$program" "$@" >../out 2>../err </dev/null
    mv qa whole
    n=0
    while n=$((n + 1)) && [ $n -le 50 ]; do
        strace -f -o ../trace -P ref.fits -e trace=read,pread64 -e inject=read,pread64:error=EIO:when=$n "$program" "$@" 2>&1 </dev/null |
            sed '/^strace: Requested path/d' >../said
        if [ -d qa ]; then diff -r qa whole; else grep -c '' ../said | grep -v '^1$'; fi
        sed '/^rextract: ref\.fits.* cannot be read/d' ../said
        rm -rf qa
        grep -q INJECTED ../trace || break
    done >>../err
    rm -r whole
    [ $n -gt 6 ] || echo "only $n reads" >>../err
    echo 0 >../code
    judge 0 ''
fi

# --- FIFOs: a writer that never comes is waited for no longer than until a signal; all that is read, as -dd says

for fifo in FIFO @FIFO; do
    begin "signals end the wait for ${fifo%FIFO}FIFO, whatever it is to be"
    mkfifo FIFO && make_fits tile tile.fits && make_fits table ref.fits
    [ "$active" = 1 ] || continue
    list_files >../before
    {
        echo IMAGE
        "$program" -dd | awk '/^[A-Z]/ { name = $1 } /\[read\] *$/ { print name }'
    } >../keywords
    [ $fifo = FIFO ] || echo IMAGE >../keywords
    while read -r keyword; do
        image=tile.fits
        [ "$keyword" = IMAGE ] || set -- "-$keyword" $fifo
        [ "$keyword" != IMAGE ] || { image=$fifo && set --; }
        timeout -k 5 0.4 "$program" $image -c /dev/null $none -REFERENCE_NAME ref.fits -QA_FIGURES N -PARAMETERS_NAME "$top/config/template.param" \
            -NOISE_CORRELATION FILE -NOISE_KERNEL_NAME "$top/config/default.conv" -WEIGHT_TYPE MAP_RMS -PSF_TYPE FILE "$@" \
            -CATALOG_TYPE NONE -VERBOSE_TYPE QUIET </dev/null >/dev/null 2>../said
        [ $? != 137 ] || echo "$keyword: had to be killed"
        rm -rf rextract_qa
    done <../keywords >../err
    timeout -k 5 0.4 "$program" tile.fits -c $fifo $none >/dev/null 2>&1
    [ $? != 137 ] || echo '-c: had to be killed' >>../err
    timeout -k 5 2 "$program" tile.fits -c /dev/null $none -PARAMETERS_NAME "$top/config/default.param" -CATALOG_NAME FIFO >/dev/null 2>&1
    [ $? != 137 ] || echo 'CATALOG_NAME: had to be killed' >>../err
    echo 0 >../code
    : >../out
    judge 0 ''
done

begin 'a FIFO with a writer is read, and written to a reader'
mkfifo from to && make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    timeout 60 sh -c "{ sleep 1 && printf 'NUMBER\\nX_IMAGE\\n'; } >from" &
    timeout 60 sed -n '$p' to >../last &
    run tile.fits -c /dev/null $none -PARAMETERS_NAME from -CATALOG_NAME to -VERBOSE_TYPE QUIET
    wait
    grep -Eq '^ +[0-9]+ +[0-9.]+ *$' ../last || cat ../last >>../err
    judge 0 ''
fi

begin 'the program is built to end where a buffer is overrun'
if ! command -v readelf >/dev/null || readelf -Ws "$program" | grep -q __asan_init; then
    skip 'no readelf, or a build with sanitizers'
elif [ "$active" = 1 ]; then
    list_files >../before
    {
        readelf -Wd "$program" | grep -q 'BIND_NOW\|FLAGS_1.*NOW' || echo 'no -z now'
        readelf -Wl "$program" | grep -q GNU_RELRO || echo 'no -z relro'
        readelf -Wh "$program" | grep -q 'Type: *DYN' || echo 'no PIE'
        readelf -Ws "$program" | grep -q __stack_chk_fail || echo 'no stack protector'
        readelf -Ws "$program" | grep -q '__[a-z]*_chk@' || echo 'no _FORTIFY_SOURCE'
    } >../err
    echo 0 >../code
    : >../out
    judge 0 ''
fi
