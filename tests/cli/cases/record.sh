# Runs repeated from the record in their outputs (-c OUTPUT)
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

moffat='-PSF_TYPE MOFFAT -PSF_FWHM 3'
again='-CATALOG_NAME again.cat'

# made ARGUMENT...: a run whose outputs are then there
made() {
    [ "$active" = 1 ] || return 0
    timeout 60 "$rextract" "$@" -VERBOSE_TYPE QUIET </dev/null >made.out 2>&1 ||
        echo "made: exit code $?" >&2
}

no_sum='xxh128sum is missing (Debian package xxhash)'

# sealed FILE: an ASCII_HEAD catalogue whose END fits again to what stands above it
sealed() {
    sum=$(sed -n 's/^# //p' "$1" | sed -n '/^RECORD = /,/^END = /p' | sed '$d' | xxh128sum | cut -d ' ' -f 1)
    sed "s/^# END = .*/# END = $sum/" "$1" >sealed.tmp && mv sealed.tmp "$1"
}

for type in FITS_1.0 FITS_LDAC ASCII_HEAD; do
    begin "record: $type, names of all kinds"
    image=$(printf 'a %% %%41 "b" $d \303\251 #&.fits') out=$(printf 'm\303\251 1,2;=#%%41 "q" [x] $$ &')
    make_fits tile "$image"
    made "$image" -RESTORE_TYPE NONE,RL $moffat -CATALOG_TYPE $type -CATALOG_NAME "$out.cat" \
        -CHECKIMAGE_TYPE RESTORED -CHECKIMAGE_NAME "\"$(printf 'r\303\251 , ')&.fits\""
    leaves made.out again_NONE.cat again_RL.cat again_NONE.fits again_RL.fits
    expect 0 '' -c "$(printf '%s' "${out}_RL.cat" | sed 's/\$\$/$/')" -NTHREADS 2 $again -CHECKIMAGE_NAME again.fits
done

begin 'record: names that begin with a blank, beside others'
make_fits tile ' a.fits' && : >a.fits && : >x.cat && : >r.fits
made ' a.fits' -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0 -CATALOG_NAME ' x.cat' -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME '" r.fits"'
leaves again.cat again.fits
expect 0 '' -c ' x.cat' -NTHREADS 2 $again -CHECKIMAGE_NAME again.fits

begin 'record: an image whose name begins with a blank'
make_fits tile ' a.fits' && : >a.fits && : >r.fits
made ' a.fits' -RESTORE_TYPE NONE -CATALOG_TYPE NONE -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME '" r.fits"'
leaves again.fits
expect 0 '' -c ' r.fits' -CHECKIMAGE_NAME again.fits

for threads in 1 2 3; do
    begin "record: images, $threads threads"
    make_fits extensions tile.fits
    made tile.fits -RESTORE_TYPE RL_BLIND,NONE $moffat -CATALOG_TYPE NONE \
        -CHECKIMAGE_TYPE SEGMENTATION,RESIDUAL,MINIBACKGROUND -CHECKIMAGE_NAME s.fits,d.fits,m.fits -NTHREADS $threads
    leaves 1_NONE.fits 2_NONE.fits 3_NONE.fits 1_RL_BLIND.fits 2_RL_BLIND.fits 3_RL_BLIND.fits
    expect 0 '' -c d_RL_BLIND.fits -NTHREADS $((4 - threads)) -CHECKIMAGE_NAME 1.fits,2.fits,3.fits
    expect 0 '' -c s_NONE.fits -NTHREADS 2 -CHECKIMAGE_NAME 1.fits,2.fits,3.fits
    expect 0 '' tile.fits -c m_NONE.fits -CHECKIMAGE_NAME 1.fits,2.fits,3.fits
done

for block in 32 64; do
    begin "record: the network in blocks of $block"
    make_fits tile tile.fits
    make_model model.fits
    made tile.fits -RESTORE_TYPE NET -NET_MODEL model.fits $moffat -CATALOG_TYPE FITS_1.0 -NTHREADS 1 -NET_BLOCK 96 \
        -CHECKIMAGE_TYPE RESTORED -CHECKIMAGE_NAME r.fits
    leaves again.cat again.fits
    expect 0 '' -c test.cat -NET_BLOCK $block -NTHREADS 3 $again -CHECKIMAGE_NAME again.fits
    expect 0 '' -c r.fits -NET_BLOCK $block -NTHREADS 2 $again -CHECKIMAGE_NAME again.fits
done

begin 'record: a configuration file, maps, lists, a reference'
make_fits tile tile.fits
make_fits ones weight.fits
make_fits table ref.fits
printf 'NUMBER\nX_IMAGE\nY_IMAGE\nMAG_TEMPLATE\nFLAGS_RESTORE\n' >my.param
printf 'CONV NORM\n1 2 1\n2 4 2\n1 2 1\n' >my.conv
printf 'PARAMETERS_NAME my.param # columns\nFILTER_NAME my.conv\nDETECT_THRESH 2.5\nPIXEL_SCALE 1.0\n' >my.sex
made tile.fits -c my.sex $moffat -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0 -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE weight.fits -TEMPLATE_COVAR_NAME cov.fits -REFERENCE_NAME ref.fits -QA_FIGURES N
[ "$active" = 0 ] || rm my.sex # its values are in the record
leaves again.cat covariance qa
expect 0 '' -c test.cat $again -TEMPLATE_COVAR_NAME covariance -QA_NAME qa
expect 0 '' -c cov.fits $again -TEMPLATE_COVAR_NAME covariance -QA_NAME qa
expect 2 '^rextract: test\.cat: is not repeated over outputs that are there \(CATALOG_NAME test\.cat, TEMPLATE_COVAR_NAME cov\.fits, QA_NAME rextract_qa\); give' \
    -c test.cat
[ "$active" = 0 ] || printf 'NUMBER\n' >my.param
expect 3 '^rextract: my\.param: is not what the run that wrote test\.cat read \(PARAMETERS_NAME\); give it as it was$' \
    -c test.cat $again -TEMPLATE_COVAR_NAME covariance -QA_NAME qa

begin 'record: listed positions'
make_fits tile tile.fits
printf '# X_IMAGE Y_IMAGE\n20 30\n40 50\n' >my.list
made tile.fits $moffat -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0 -POSITIONS_NAME my.list
leaves again.cat again_FORCED.cat
expect 0 '' -c test.cat $again
expect 0 '' -c test_FORCED.cat $again
[ "$active" = 0 ] || echo '60 70' >>my.list
expect 3 '^rextract: my\.list: is not what the run that wrote test\.cat read \(POSITIONS_NAME\); give it as it was$' -c test.cat $again

begin 'a VOTable names each PARAM once, and is not repeated itself'
make_fits tile tile.fits
make_fits ones weight.fits
printf 'NUMBER\nX_IMAGE\n' >my.param
leaves made.out
made tile.fits $moffat -RESTORE_TYPE NONE,RL -CATALOG_TYPE ASCII_VOTABLE -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE weight.fits -PARAMETERS_NAME my.param
if [ "$active" = 1 ]; then
    run -c test_RL.cat $again -VERBOSE_TYPE QUIET
    sed -n 's/^ *<PARAM name="\([^"]*\)".*/\1/p' test_RL.cat | sort | uniq -d >>../err
    [ "$(grep -Ec 'name="READ([23])?"' test_RL.cat)" = 3 ] || echo 'not READ, READ2, READ3' >>../err
    judge 3 '^rextract: test_RL\.cat: holds no record of a run of rextract; give a FITS catalogue, a check-image or an ASCII_HEAD catalogue'
fi

begin 'record: two images, the catalogue from standard output'
make_fits tile a.fits
make_fits tile b.fits
made a.fits,b.fits -RESTORE_TYPE NONE -CATALOG_NAME STDOUT
[ "$active" = 0 ] || mv made.out kept.cat
prints '^ '
expect 0 '' -c kept.cat
prints ''
leaves again.cat
expect 0 '' b.fits a.fits -c kept.cat $again

begin 'record: tiles of a list'
make_fits tile a.fits
make_fits tile b.fits
printf 'a.fits -DETECT_THRESH 2\nb.fits\n' >tiles.list
mkdir cats
made @tiles.list -RESTORE_TYPE NONE -CATALOG_NAME 'cats/{tile}.cat'
leaves again.cat
expect 0 '' -c cats/a.cat $again
expect 0 '' -c cats/b.cat $again
expect 2 '^rextract: cats/a\.cat: is of one tile, which @tiles\.list is not; give its image$' @tiles.list -c cats/a.cat

begin 'record: another value in the configuration'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE ASCII_HEAD
if [ "$active" = 1 ]; then
    sed 's/^# PHOT_APERTURES = 5$/# PHOT_APERTURES = 6/' test.cat >other.cat
    cp other.cat sealed.cat
    sealed sealed.cat
fi
leaves again.cat
expect 9 '^rextract: other\.cat: is not repeated: part 1 test\.cat has other rows or pixels; its record was changed after it was written$' -c other.cat $again
if command -v xxh128sum >/dev/null; then
    expect 9 '^rextract: sealed\.cat: is not repeated: part 1 test\.cat has other rows or pixels$' -c sealed.cat $again
else
    skip "$no_sum"
fi

begin 'record: a row that was changed'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE
[ "$active" = 0 ] || sed '$s/1/2/' test.cat >changed.cat
leaves again.cat
expect 9 '^rextract: changed\.cat: is not repeated: rows or pixels of part 1 were changed after they were written$' -c changed.cat $again

begin 'record: a pixel that was changed'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE NONE -CHECKIMAGE_TYPE -BACKGROUND -CHECKIMAGE_NAME r.fits
[ "$active" = 0 ] || printf '\001' | dd of=r.fits bs=1 conv=notrunc seek=$(($(wc -c <r.fits) - 2880)) 2>/dev/null
leaves again.fits
expect 9 '^rextract: r\.fits: is not repeated: rows or pixels of part 1 were changed after they were written$' -c r.fits -CHECKIMAGE_NAME again.fits

begin 'record: the image has changed'
make_fits tile tile.fits && cp tile.fits first.fits
made tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0
[ "$active" = 0 ] || printf 'x' | dd of=tile.fits bs=1 conv=notrunc seek=5000 2>/dev/null
expect 3 '^rextract: tile\.fits: is not what the run that wrote test\.cat read \(IMAGE\); give it as it was$' -c test.cat $again
[ "$active" = 0 ] || mv tile.fits moved.fits
expect 3 '^rextract: tile\.fits: cannot be opened' -c test.cat $again
expect 3 '^rextract: moved\.fits: is not what the run that wrote test\.cat read \(IMAGE\)' moved.fits -c test.cat $again
[ "$active" = 0 ] || cp first.fits moved.fits
leaves again.cat
expect 0 '' moved.fits -c test.cat $again

begin 'record: a file that was not there then'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0
[ "$active" = 0 ] || printf 'CONV NORM\n1 2 1\n2 4 2\n1 2 1\n' >default.conv
expect 3 '^rextract: default\.conv: is not what the run that wrote test\.cat read \(FILTER_NAME\); give it as it was$' -c test.cat $again

begin 'record: another version and another machine are told'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE
if [ "$active" = 1 ]; then
    sed 's/^# VERSION = .*/# VERSION = 0.0.1/; s/^# MACHINE = x/# MACHINE = y/' test.cat >old.cat
    sealed old.cat
fi
if command -v xxh128sum >/dev/null; then
    says 6
    leaves again.cat
    expect_exactly 0 'old\.cat was made by rextract 0\.0\.1, this is ' -c old.cat $again
else
    skip "$no_sum"
fi

begin 'record: a file that is none of ours'
make_fits tile tile.fits
expect 3 '^rextract: tile\.fits: holds no record of a run of rextract; give a FITS catalogue' tile.fits -c tile.fits
echo '1 2 3' >list.txt
expect 2 "^rextract: list\.txt:1: unknown keyword '1'" tile.fits -c list.txt
expect 2 '^rextract: absent\.cat: cannot be opened' tile.fits -c absent.cat

begin 'record: a catalogue without a record'
"$programs/rextract-simulate" -IMAGE_SIZE 32 -VERBOSE_TYPE QUIET
expect 3 '^rextract: sim\.fits: was written by Rextract .* without a record of the run; nothing can be repeated$' -c sim.fits

begin 'record: records that cannot be used'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE
if [ "$active" = 1 ]; then
    sed 's/^# DETECT_THRESH = .*/# DETECT_THRESH = many/' test.cat >value.cat
    sed 's/^# DETECT_THRESH = /# DETECT_TRESH = /' test.cat >name.cat
    sed '/^# SET = /d' test.cat >lacks.cat
    sed 's/^# RECORD = 1/# RECORD = 7/' test.cat >kind.cat
    sed 's/^# MADE = .*/# MADE = x/' test.cat >made.cat
    sed 's/^# SOM_NAME = .*/# SOM_NAME = %4/' test.cat >escape.cat
    sed '/^# END = /d' test.cat >end.cat
fi
expect 3 "^rextract: value\.cat: its record cannot be used: -DETECT_THRESH: 'many' is not a number$" -c value.cat $again
expect 3 '^rextract: name\.cat: its record cannot be used: unknown keyword' -c name.cat $again
expect 3 '^rextract: lacks\.cat: its record lacks the line SET; it was changed' -c lacks.cat $again
expect 3 "^rextract: kind\.cat: its record is of another kind, '7, " -c kind.cat $again
leaves again.cat
expect 9 '^rextract: made\.cat: is not repeated: .*; its record was changed after it was written; rows or pixels of part 1' -c made.cat $again
expect 3 '^rextract: escape\.cat: its record cannot be read' -c escape.cat $again
expect 3 '^rextract: end\.cat: holds no record of a run' -c end.cat $again

begin 'record: what does not go with it'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE
expect 2 '^rextract: CATALOG_NAME test\.cat is also read, as test\.cat; give the output another name$' -c test.cat -CATALOG_NAME test.cat
expect 2 '^rextract: test\.cat: is not repeated over outputs that are there \(CATALOG_NAME test\.cat\); give' tile.fits -c test.cat
expect 2 '^rextract: -REPLAY is no longer a keyword; give the output in place of a configuration file \(rextract -c OUTPUT\)' -REPLAY test.cat
expect 2 '^rextract: the name of the configuration file is empty' -c ''
leaves again.cat
expect 9 '^rextract: test\.cat: is not repeated: part 1 test\.cat has other rows or pixels; DETECT_THRESH is 3, and was 5$' \
    -c test.cat $again -DETECT_THRESH 3
expect 0 '' -c test.cat $again

begin 'record: said in one line'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE
leaves again.cat
talks 'test\.cat: repeated; 1 of 1 digests are the same' -c test.cat $again
