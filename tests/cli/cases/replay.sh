# Runs repeated from the record in their outputs (-REPLAY)
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

moffat='-PSF_TYPE MOFFAT -PSF_FWHM 3'

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
    begin "replay: $type, names of all kinds"
    image=$(printf 'a %% %%41 "b" $d \303\251 #&.fits') out=$(printf 'm\303\251 1,2;=#%%41 "q" [x] $$ &')
    make_fits tile "$image"
    made "$image" -RESTORE_TYPE NONE,RL $moffat -CATALOG_TYPE $type -CATALOG_NAME "$out.cat" \
        -CHECKIMAGE_TYPE RESTORED -CHECKIMAGE_NAME "\"$(printf 'r\303\251 , ')&.fits\""
    leaves made.out
    expect 0 '' -REPLAY "$(printf '%s' "${out}_RL.cat" | sed 's/\$\$/$/')" -NTHREADS 2
done

begin 'replay: names that begin with a blank, beside others'
make_fits tile ' a.fits' && : >a.fits && : >x.cat && : >r.fits
made ' a.fits' -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0 -CATALOG_NAME ' x.cat' -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME '" r.fits"'
expect 0 '' -REPLAY ' x.cat' -NTHREADS 2

begin 'replay: an image whose name begins with a blank'
make_fits tile ' a.fits' && : >a.fits && : >r.fits
made ' a.fits' -RESTORE_TYPE NONE -CATALOG_TYPE NONE -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME '" r.fits"'
expect 0 '' -REPLAY ' r.fits'

for threads in 1 2 3; do
    begin "replay: images, $threads threads"
    make_fits extensions tile.fits
    made tile.fits -RESTORE_TYPE RL_BLIND,NONE $moffat -CATALOG_TYPE NONE \
        -CHECKIMAGE_TYPE SEGMENTATION,RESIDUAL,MINIBACKGROUND -CHECKIMAGE_NAME s.fits,d.fits,m.fits -NTHREADS $threads
    expect 0 '' -REPLAY d_RL_BLIND.fits -NTHREADS $((4 - threads))
    expect 0 '' -REPLAY s_NONE.fits -NTHREADS 2
    expect 0 '' -REPLAY m_NONE.fits
done

for block in 32 64; do
    begin "replay: the network in blocks of $block"
    make_fits tile tile.fits
    make_model model.fits
    made tile.fits -RESTORE_TYPE NET -NET_MODEL model.fits $moffat -CATALOG_TYPE FITS_1.0 -NTHREADS 1 -NET_BLOCK 96 \
        -CHECKIMAGE_TYPE RESTORED -CHECKIMAGE_NAME r.fits
    expect 0 '' -REPLAY test.cat -NET_BLOCK $block -NTHREADS 3
    expect 0 '' -REPLAY r.fits -NET_BLOCK $block -NTHREADS 2
done

begin 'replay: a configuration file, maps, lists, a reference'
make_fits tile tile.fits
make_fits ones weight.fits
make_fits table ref.fits
printf 'NUMBER\nX_IMAGE\nY_IMAGE\nMAG_TEMPLATE\nFLAGS_RESTORE\n' >my.param
printf 'CONV NORM\n1 2 1\n2 4 2\n1 2 1\n' >my.conv
printf 'PARAMETERS_NAME my.param # columns\nFILTER_NAME my.conv\nDETECT_THRESH 2.5\nPIXEL_SCALE 1.0\n' >my.sex
made tile.fits -c my.sex $moffat -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0 -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE weight.fits -TEMPLATE_COVAR_NAME cov.fits -REFERENCE_NAME ref.fits -QA_FIGURES N
[ "$active" = 0 ] || rm my.sex # its values are in the record
expect 0 '' -REPLAY test.cat
expect 0 '' -REPLAY cov.fits
[ "$active" = 0 ] || printf 'NUMBER\n' >my.param
expect 3 '^rextract: my\.param: has changed since it was read \(PARAMETERS_NAME of the run that wrote test\.cat\); give it as it was$' \
    -REPLAY test.cat

begin 'a VOTable names each PARAM once, and is not repeated itself'
make_fits tile tile.fits
make_fits ones weight.fits
printf 'NUMBER\nX_IMAGE\n' >my.param
leaves made.out
made tile.fits $moffat -RESTORE_TYPE NONE,RL -CATALOG_TYPE ASCII_VOTABLE -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE weight.fits -PARAMETERS_NAME my.param
if [ "$active" = 1 ]; then
    run -REPLAY test_RL.cat -VERBOSE_TYPE QUIET
    sed -n 's/^ *<PARAM name="\([^"]*\)".*/\1/p' test_RL.cat | sort | uniq -d >>../err
    [ "$(grep -Ec 'name="READ([23])?"' test_RL.cat)" = 3 ] || echo 'not READ, READ2, READ3' >>../err
    judge 3 '^rextract: test_RL\.cat: holds no record of a run of rextract; give a FITS catalogue, a check-image or an ASCII_HEAD catalogue'
fi

begin 'replay: two images, the catalogue from standard output'
make_fits tile a.fits
make_fits tile b.fits
made a.fits,b.fits -RESTORE_TYPE NONE -CATALOG_NAME STDOUT
[ "$active" = 0 ] || mv made.out kept.cat
expect 0 '' -REPLAY kept.cat

begin 'replay: tiles of a list'
make_fits tile a.fits
make_fits tile b.fits
printf 'a.fits -DETECT_THRESH 2\nb.fits\n' >tiles.list
mkdir cats
made @tiles.list -RESTORE_TYPE NONE -CATALOG_NAME 'cats/{tile}.cat'
expect 0 '' -REPLAY cats/a.cat
expect 0 '' -REPLAY cats/b.cat

begin 'replay: another value in the configuration'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE ASCII_HEAD
if [ "$active" = 1 ]; then
    sed 's/^# PHOT_APERTURES = 5$/# PHOT_APERTURES = 6/' test.cat >other.cat
    cp other.cat sealed.cat
    sealed sealed.cat
fi
expect 9 '^rextract: other\.cat: is not repeated: its record was changed after it was written; part 1 test\.cat has other rows or pixels$' -REPLAY other.cat
if command -v xxh128sum >/dev/null; then
    expect 9 '^rextract: sealed\.cat: is not repeated: part 1 test\.cat has other rows or pixels$' -REPLAY sealed.cat
else
    skip "$no_sum"
fi

begin 'replay: a row that was changed'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE
[ "$active" = 0 ] || sed '$s/1/2/' test.cat >changed.cat
expect 9 '^rextract: changed\.cat: is not repeated: rows or pixels of part 1 were changed after they were written$' -REPLAY changed.cat

begin 'replay: a pixel that was changed'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE NONE -CHECKIMAGE_TYPE -BACKGROUND -CHECKIMAGE_NAME r.fits
[ "$active" = 0 ] || printf '\001' | dd of=r.fits bs=1 conv=notrunc seek=$(($(wc -c <r.fits) - 2880)) 2>/dev/null
expect 9 '^rextract: r\.fits: is not repeated: rows or pixels of part 1 were changed after they were written$' -REPLAY r.fits

begin 'replay: the image has changed'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0
[ "$active" = 0 ] || printf 'x' | dd of=tile.fits bs=1 conv=notrunc seek=5000 2>/dev/null
expect 3 '^rextract: tile\.fits: has changed since it was read \(IMAGE of the run that wrote test\.cat\); give it as it was$' -REPLAY test.cat
[ "$active" = 0 ] || rm tile.fits
expect 3 '^rextract: tile\.fits: is not there \(IMAGE of the run that wrote test\.cat\); repeat it in the folder where it ran$' -REPLAY test.cat

begin 'replay: a file that was not there then'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0
[ "$active" = 0 ] || printf 'CONV NORM\n1 2 1\n2 4 2\n1 2 1\n' >default.conv
expect 9 'FILTER_NAME default\.conv is read now, and was not then' -REPLAY test.cat

begin 'replay: another version and another machine are told'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE
if [ "$active" = 1 ]; then
    sed 's/^# VERSION = .*/# VERSION = 0.0.1/; s/^# MACHINE = x/# MACHINE = y/' test.cat >old.cat
    sealed old.cat
fi
if command -v xxh128sum >/dev/null; then
    says 4
    expect_exactly 0 'old\.cat was made by rextract 0\.0\.1, this is ' -REPLAY old.cat
else
    skip "$no_sum"
fi

begin 'replay: a file that is none of ours'
make_fits tile tile.fits
expect 3 '^rextract: tile\.fits: holds no record of a run of rextract; give a FITS catalogue' -REPLAY tile.fits
echo '1 2 3' >list.txt
expect 3 '^rextract: list\.txt: holds no record of a run of rextract' -REPLAY list.txt
expect 3 '^rextract: absent\.cat: cannot be opened' -REPLAY absent.cat

begin 'replay: a catalogue without a record'
"$programs/rextract-simulate" -IMAGE_SIZE 32 -VERBOSE_TYPE QUIET
expect 3 '^rextract: sim\.fits: was written by Rextract .* without a record of the run; nothing can be repeated$' -REPLAY sim.fits

begin 'replay: records that cannot be used'
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
    sed 's/^# OUTPUT = .*/# OUTPUT = any.cat/' test.cat >output.cat
fi
expect 3 "^rextract: value\.cat: its record cannot be used: -DETECT_THRESH: 'many' is not a number$" -REPLAY value.cat
expect 3 '^rextract: name\.cat: its record cannot be used: unknown keyword' -REPLAY name.cat
expect 3 '^rextract: lacks\.cat: its record lacks the line SET; it was changed' -REPLAY lacks.cat
expect 3 "^rextract: kind\.cat: its record is of another kind, '7, " -REPLAY kind.cat
expect 9 '^rextract: made\.cat: is not repeated: its record was changed' -REPLAY made.cat
expect 3 '^rextract: escape\.cat: its record cannot be read' -REPLAY escape.cat
expect 3 '^rextract: end\.cat: holds no record of a run' -REPLAY end.cat
expect 3 "^rextract: output\.cat: its record cannot be used: no keyword of it names the output 'any\.cat'$" -REPLAY output.cat

begin 'replay: what does not go with it'
make_fits tile tile.fits
made tile.fits -RESTORE_TYPE NONE
expect 2 '^rextract: -DETECT_THRESH would change what is compared; leave it out$' -REPLAY test.cat -DETECT_THRESH 3
expect 2 "^rextract: -REPLAY takes image and configuration from test\.cat; leave out 'tile\.fits'$" -REPLAY test.cat tile.fits
expect 2 '^rextract: the name of the output to repeat is empty' -REPLAY ''
