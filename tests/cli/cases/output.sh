# What is written, what is left when it cannot be, and what a signal leaves.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

none='-RESTORE_TYPE NONE'
moffat='-PSF_TYPE MOFFAT -PSF_FWHM 3'

begin 'catalogue without restoration'
make_fits tile tile.fits
leaves test.cat
expect 0 '' tile.fits $none

begin 'catalogue with restoration'
make_fits tile tile.fits
leaves test.cat
expect 0 '' tile.fits $moffat

begin 'PSF from the tile'
make_fits tile tile.fits
leaves test.cat
expect 0 '' tile.fits

begin 'LDAC catalogue'
make_fits tile tile.fits
leaves a.cat
expect 0 '' tile.fits $none -CATALOG_TYPE FITS_LDAC -CATALOG_NAME a.cat

begin 'no catalogue wanted'
make_fits tile tile.fits
expect 0 '' tile.fits $none -CATALOG_TYPE NONE

begin 'catalogue on standard output'
make_fits tile tile.fits
prints '^ +1 '
expect 0 '' tile.fits $none -CATALOG_NAME STDOUT

begin 'a tile without sources'
make_fits flat tile.fits
leaves test.cat
expect 0 '' tile.fits $none

begin 'a tile without stars for its PSF'
make_fits flat tile.fits
leaves test.cat
expect 0 '' tile.fits -PSF_TYPE AUTO

begin 'a tile without stars, and a stated seeing far below a pixel'
make_fits flat tile.fits
leaves test.cat
expect 0 '' tile.fits -PSF_TYPE AUTO -SEEING_FWHM 0.01 -PIXEL_SCALE 1000

# What is stated of the PSF where no star shows it: TITLE, PATTERN of RXPSF ('': not restored), CARD, ARGUMENT...
stated() {
    begin "a tile without stars: $1"
    pattern=$2 card=$3
    shift 3
    make_fits flat tile.fits "$card"
    if [ "$active" = 1 ]; then
        leaves test.cat
        run tile.fits -PSF_TYPE AUTO -RESTORE_TYPE RL -CATALOG_TYPE FITS_1.0 -VERBOSE_TYPE QUIET "$@"
        found=$(tr -c '[:print:]' '\n' <test.cat | fold -w 80 | sed -n "/^RXPSF /,/[^&]' *\$/s/^[^']*'//p" | tr -d "&'\n")
        case $found in $pattern) ;; *) echo "RXPSF is '$found', not like '$pattern'" >>../err ;; esac
        judge 0 ''
    fi
}
stated 'nothing stated' '' 'OBJECT  = 1' -PIXEL_SCALE 0.4
stated 'SEEING_FWHM given' '*FWHM 3.000*from SEEING_FWHM*' 'OBJECT  = 1' -PIXEL_SCALE 0.4 -SEEING_FWHM 1.2
stated 'a header in pixels' '*FWHM 4.023*from FWHM of the header*' 'FWHM    = 4.022961 / Median FWHM in pixels'
stated 'a header in arcsec' '*FWHM 3.000*from SEEING of the header*' 'SEEING  = 1.2 / [arcsec]' -PIXEL_SCALE 0.4 -SEEING_FWHM 9
stated 'a header without a unit' '' 'SEEING  = 1.2 / seeing' -PIXEL_SCALE 0.4
stated 'PSF_FWHM given' '*FWHM 2.500*from PSF_FWHM*' 'FWHM    = 4.022961 / Median FWHM in pixels' -PSF_FWHM 2.5

stated 'MOFFAT, nothing stated' '' 'OBJECT  = 1' -PSF_TYPE MOFFAT -PIXEL_SCALE 0.4
stated 'MOFFAT, SEEING_FWHM given' '*FWHM 3.000*from SEEING_FWHM*' 'OBJECT  = 1' -PSF_TYPE MOFFAT -PIXEL_SCALE 0.4 -SEEING_FWHM 1.2
stated 'MOFFAT, a header in pixels' '*FWHM 4.023*from FWHM of the header*' 'FWHM    = 4.022961 / Median FWHM in pixels' -PSF_TYPE MOFFAT
stated 'MOFFAT, PSF_FWHM given' '*FWHM 2.500*' 'FWHM    = 4.022961 / Median FWHM in pixels' -PSF_TYPE MOFFAT -PSF_FWHM 2.5

# A file that `rextract -d` wrote states nothing, its SEEING_FWHM neither; one that was edited does.
for seeing in 1.2 2.4; do
    "$rextract" -d | sed "s/^SEEING_FWHM .*/SEEING_FWHM $seeing/" >"$scratch/my-$seeing.sex"
    wanted_psf=
    [ $seeing = 1.2 ] || wanted_psf='*FWHM 6.000*from SEEING_FWHM*'
    for type in AUTO MOFFAT; do
        stated "$type, a file that says SEEING_FWHM $seeing" "$wanted_psf" 'OBJECT  = 1' -c "$scratch/my-$seeing.sex" -FILTER N \
            -PARAMETERS_NAME "$top/config/default.param" -PSF_TYPE $type -PIXEL_SCALE 0.4
    done
done

begin 'MOFFAT without a FWHM, without leave to fall back'
make_fits flat tile.fits
expect 10 '^rextract: tile\.fits\[0\]: cannot be done by RL: its PSF is not known' tile.fits -PSF_TYPE MOFFAT \
    -PIXEL_SCALE 0.4 -RESTORE_FALLBACK N

begin 'a tile without any weight'
make_fits tile tile.fits && make_fits zeros weight.fits
leaves test.cat
expect 0 '' tile.fits $moffat -WEIGHT_TYPE MAP_WEIGHT

begin 'a tile without data: told in log, catalogue and report, which has its figures'
make_fits flat tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    {
        timeout 60 "$program" tile.fits $moffat -RESTORE_TYPE NONE -PARAMETERS_NAME "$top/config/template.param" -QA_TYPE TILE -QA_NAME qa \
            -VERBOSE_TYPE NORMAL >../log 2>&1
        echo $? >../code
        grep -q '100.0 % of its pixels, in runs of one value, hold no data (RXNODATA)' ../log || cat ../log
        grep -E 'without figures|nan' ../log
        grep -q '100 % of the pixels are not used' qa/tile.html || echo 'not in the report'
        rm -rf test.cat qa
    } >../err 2>&1
    : >../out
    judge 0 ''
fi

begin 'weights that are NaN'
make_fits tile tile.fits && make_fits nan weight.fits
leaves test.cat
expect 0 '' tile.fits $moffat -WEIGHT_TYPE MAP_RMS

begin 'all images of a file'
make_fits extensions tile.fits
leaves a.cat
expect 0 '' tile.fits $none -CATALOG_TYPE FITS_LDAC -CATALOG_NAME a.cat

begin 'a part of an image'
make_fits tile tile.fits
leaves test.cat
expect 0 '' 'tile.fits[1:60,5:70]' $none

begin 'check-images'
make_fits tile tile.fits
leaves test.cat r.fits s.fits
expect 0 '' tile.fits $moffat -CHECKIMAGE_TYPE RESTORED,SEGMENTATION -CHECKIMAGE_NAME r.fits,s.fits

begin 'report'
make_fits tile tile.fits && make_fits table ref.fits
leaves test.cat report
expect 0 '' tile.fits $none -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N

begin 'gate that fails'
make_fits tile tile.fits && make_fits table ref.fits
leaves test.cat report
printf 'bias_mag all >= 3\n' >my.qa
expect 5 'gate' tile.fits $none -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N -QA_GATES my.qa

begin 'gate that cannot be decided'
make_fits tile tile.fits && make_fits table ref.fits
leaves test.cat report
printf 'recall all >= 0.95\n' >my.qa
expect 6 'too few' tile.fits $none -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N -QA_GATES my.qa

begin 'older outputs are replaced'
make_fits tile tile.fits && echo old >test.cat
leaves test.cat
expect 0 '' tile.fits $none

begin 'older outputs stay when the work fails'
make_fits nan tile.fits && echo old >test.cat
expect 3 '^rextract: tile\.fits\[0\]: all 9216 pixels are NaN' tile.fits $none

begin 'folders of outputs that are not there are made'
make_fits tile tile.fits
leaves absent
expect 0 '' tile.fits $none -CATALOG_NAME absent/cats/test.cat -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME absent/a.fits \
    -RECORD_NAME absent/cats/tile.record -QA_TYPE TILE -QA_NAME absent/qa/tile -XML_NAME absent/xml/run.xml -WRITE_XML Y

begin 'and removed when the run fails'
make_fits nan tile.fits
expect 3 '^rextract: tile\.fits\[0\]: all 9216 pixels are NaN' tile.fits $none -CATALOG_NAME absent/cats/test.cat -QA_TYPE TILE \
    -QA_NAME absent/qa/tile

begin 'folder of the catalogue that cannot be made'
make_fits tile tile.fits && echo mine >file
expect 4 "^rextract: file/cats/test\.cat: cannot be written: its folder '/.*/file' cannot be made: Not a directory" tile.fits $none \
    -CATALOG_NAME file/cats/test.cat

begin 'catalogue that is a folder'
make_fits tile tile.fits && mkdir test.cat
expect 2 'test\.cat' tile.fits $none

begin 'check-image in a folder that cannot be made'
make_fits tile tile.fits
expect 4 '^rextract: /proc/absent/a\.fits: ' tile.fits $none -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME /proc/absent/a.fits

begin 'two outputs of one name, their folder not there'
make_fits tile tile.fits
expect 2 'CHECKIMAGE_NAME.*absent/x is also' tile.fits $none -CATALOG_NAME absent/x -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME ./absent/x

begin 'two outputs of one name'
make_fits tile tile.fits
expect 2 'a\.fits' tile.fits $none -CATALOG_NAME a.fits -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME a.fits

begin 'catalogue that would replace the image'
make_fits tile tile.fits
expect 2 'CATALOG_NAME \./tile\.fits is also read, as tile\.fits\[0\]' 'tile.fits[0]' $none -CATALOG_NAME ./tile.fits

begin 'catalogue that would replace the image under the name it gets'
make_fits tile a_RL.fits
expect 2 'CATALOG_NAME a_RL\.fits is also read, as a_RL\.fits' a_RL.fits $none -RESTORE_TYPE NONE,RL -CATALOG_NAME a.fits

begin 'check-image that would replace the measurement image'
make_fits tile a.fits && make_fits tile b.fits && ln b.fits c.fits
expect 2 'CHECKIMAGE_NAME c\.fits is also read, as b\.fits' a.fits,b.fits $none -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME c.fits

begin 'catalogue that would replace the reference'
make_fits tile tile.fits && make_fits table ref.fits
expect 2 'CATALOG_NAME ref\.fits is also read' tile.fits $none -REFERENCE_NAME ref.fits -CATALOG_NAME ref.fits

begin 'catalogue that would replace the model'
make_fits tile tile.fits && make_model model.fits
expect 2 'CATALOG_NAME model\.fits is also read, as \./model\.fits' tile.fits -RESTORE_TYPE NET -NET_MODEL ./model.fits \
    -PSF_TYPE MOFFAT -PSF_FWHM 3 -CATALOG_NAME model.fits

begin 'record that would replace the image, of several restorers'
make_fits tile tile.fits
expect 2 'RECORD_NAME tile\.fits is also read, as tile\.fits' tile.fits -RESTORE_TYPE NONE,RL -RECORD_NAME tile.fits

begin 'record of the name of a catalogue'
make_fits tile tile.fits
expect 2 'RECORD_NAME \./c_RL\.cat is also CATALOG_NAME; give each' tile.fits -RESTORE_TYPE NONE,RL -CATALOG_NAME c.cat -RECORD_NAME ./c_RL.cat

begin 'files in a folder that a report replaces'
make_fits tile tile.fits && make_fits table ref.fits && mkdir -p qa/deep && touch qa/.rextract && cp ref.fits qa/deep/
expect 2 'qa/deep/ref\.fits lies in the folder qa, .*QA_NAME' tile.fits $none -REFERENCE_NAME qa/deep/ref.fits -QA_NAME qa
expect 2 'qa/new\.cat lies in the folder qa, .*QA_NAME' tile.fits $none -REFERENCE_NAME ref.fits -QA_NAME qa -CATALOG_NAME qa/new.cat

begin 'check-image where an unused weight is named'
make_fits tile tile.fits && make_fits ones weight.fits
leaves test.cat weight.fits
expect 0 '' tile.fits $none -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME weight.fits

begin 'report where a file is'
make_fits tile tile.fits && make_fits table ref.fits && echo old >report
expect 2 'report' tile.fits $none -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N

begin 'folder that cannot be written'
make_fits tile tile.fits
expect 4 '/proc/test\.cat' tile.fits $none -CATALOG_NAME /proc/test.cat

begin 'standard output that is full'
make_fits tile tile.fits
if [ -c /dev/full ] && [ "$active" = 1 ]; then
    list_files >../before
    timeout 60 "$program" tile.fits $none -CATALOG_NAME STDOUT -VERBOSE_TYPE QUIET >/dev/full 2>../err
    echo $? >../code
    : >../out
    judge 4 '^rextract: '
else
    skip 'no /dev/full'
fi

begin 'a check-image to a full device: the catalogue stays away, too'
make_fits tile tile.fits
if [ -c /dev/full ]; then
    expect 4 '^rextract: /dev/full: cannot be written' tile.fits $none -CHECKIMAGE_TYPE SEGMENTATION,BACKGROUND \
        -CHECKIMAGE_NAME s.fits,/dev/full
else
    skip 'no /dev/full'
fi

for signal in USR1=138 USR2=140 QUIT=131 ALRM=142 XCPU=152; do
    ends=${signal#*=} signal=${signal%=*}
    for named in rextract rextract-simulate; do
        begin "$named: SIG$signal leaves nothing"
        of $named
        make_fits large tile.fits
        case $program in
        */rextract) set -- tile.fits -RESTORE_TYPE RL -RL_NITER 1000 -PSF_TYPE MOFFAT -PSF_FWHM 3 ;;
        *) set -- -IMAGE_SIZE 6000 -STAR_COUNT 20000 ;;
        esac
        if [ "$active" = 1 ]; then
            list_files >../before
            (ulimit -c 0 && exec timeout --foreground --preserve-status -s $signal 1 "$program" "$@" -VERBOSE_TYPE QUIET) \
                >../out 2>../err </dev/null
            echo $? >../code
            judge "$ends" 'interrupted by a signal'
        fi
    done
done

# The others block the same signals.
for named in rextract-validate rextract-train rextract-survey; do
    begin "$named: SIGUSR1 leaves what it can go on from"
    make_fits tile tile.fits
    case $named in
    rextract-validate)
        leaves campaign.journal
        set -- 'the same command goes on from there' -CAMPAIGN_TYPE RESTORATION -SCENE_SIDE 1000
        ;;
    rextract-train)
        leaves trained.checkpoint
        set -- 'the same command goes on from there' -PATCH 48 -PATCH_MARGIN 8 -FIELD_PATCHES 2 -GRID 1,1 -BIN_IMAGES 2000
        ;;
    *) set -- 'nothing was written' records ;;
    esac
    if [ "$active" = 1 ]; then
        if [ $named = rextract-survey ]; then # its tiles come slowly
            "$program" tile.fits $none -CATALOG_TYPE NONE -RECORD_NAME ../record -VERBOSE_TYPE QUIET && mkfifo records || exit 2
            { cat ../record && sleep 3 && cat ../record; } >records &
        fi
        of $named
        remark=$1
        shift
        list_files >../before
        timeout --foreground --preserve-status -s USR1 1 "$program" "$@" -QA_FIGURES N -VERBOSE_TYPE QUIET >../out 2>../err </dev/null
        echo $? >../code
        judge 138 "^$named: .*interrupted by a signal.*$remark"
    fi
done

begin "names with Unicode's ends of lines, as astropy reads them"
odd=$(printf 'a\302\205b\342\200\250c\342\200\251d')
make_fits tile "$odd.fits" && make_fits table ref.fits
python=
for candidate in python3 /usr/bin/python3; do
    "$candidate" -c 'import astropy.table, yaml' 2>/dev/null && python=$candidate && break
done
if [ -z "$python" ]; then
    skip 'no python3 with astropy'
elif [ "$active" = 1 ]; then
    leaves report survey record
    run "$odd.fits" $none -CATALOG_TYPE NONE -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N -RECORD_NAME record -VERBOSE_TYPE QUIET
    "$programs/rextract-survey" record -QA_FIGURES N -VERBOSE_TYPE QUIET 2>>../err
    # A cell has no codes, and an end of line in it would be read as that of ASCII: it says that a character is not there.
    "$python" - 2>>../err <<'END' || echo 1 >../code
import glob
from astropy.table import Table
names = glob.glob("report/*.ecsv")
assert names
for name in names:
    assert Table.read(name).meta["tile"] == "a\x85b\u2028c\u2029d.fits", name
tiles = Table.read("survey/tiles.ecsv")
assert list(tiles["image"]) == ["a\ufffdb\ufffdc\ufffdd.fits"], tiles["image"]
END
    judge 0 ''
fi

begin 'help to a full device'
if [ -c /dev/full ] && [ "$active" = 1 ]; then
    list_files >../before
    "$program" -h >/dev/full 2>../err
    echo $? >../code
    : >../out
    judge 4 'standard output cannot be written'
else
    skip 'no /dev/full'
fi

# A limit on the size of files stands for the full disk.
begin 'disk full at the catalogue'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    (ulimit -f 2 && exec timeout 60 "$program" tile.fits $none -CATALOG_TYPE FITS_LDAC -VERBOSE_TYPE QUIET) >/dev/null 2>../err.pipe
    echo $? >../code
    mv ../err.pipe ../err
    : >../out
    judge 4 'test\.cat'
fi

begin 'disk full at a check-image'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    (ulimit -f 16 && exec timeout 60 "$program" tile.fits $none -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME b.fits -VERBOSE_TYPE QUIET) >/dev/null 2>../err
    echo $? >../code
    : >../out
    judge 4 'b\.fits'
fi

begin 'disk full at the report'
make_fits tile tile.fits && make_fits table ref.fits
if [ "$active" = 1 ]; then
    list_files >../before
    (ulimit -f 8 && exec timeout 60 "$program" tile.fits $none -CATALOG_TYPE NONE -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N -VERBOSE_TYPE QUIET) >/dev/null 2>../err
    echo $? >../code
    : >../out
    judge 4 'report'
fi

# Structural cards in small letters are not copied, nor what no header may hold.
begin 'outputs of an odd header are FITS'
make_fits tile tile.fits 'naxis1  = 96' 'extend  = T' 'bzero   = 0.' 'A.B     = 1' 'PV1_0  = 2.0' "NAME    = '&'" \
    "CONTINUE  'and an end'" "object  = 'field'"
if ! command -v fitsverify >/dev/null; then
    skip 'fitsverify is not installed'
elif [ "$active" = 1 ]; then
    leaves test.cat b.fits
    run tile.fits $moffat -CATALOG_TYPE FITS_1.0 -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME b.fits -VERBOSE_TYPE QUIET
    fitsverify -q b.fits test.cat | grep -v '^verification OK' >>../err
    judge 0 ''
fi

begin 'catalogues say in which system positions are'
make_fits tile tile.fits "RADESYS = 'FK5'" 'EQUINOX = 2000.0' "DATE-OBS= '2011-12-13'"
if [ "$active" = 1 ]; then
    leaves test.cat
    run tile.fits $none -CATALOG_TYPE FITS_1.0 -VERBOSE_TYPE QUIET
    for card in "RADESYS = 'FK5'" 'EQUINOX = 2000.0' "DATE-OBS= '2011-12-13'"; do
        [ "$(grep -aoF "$card" test.cat | wc -l)" = 1 ] || echo "not one $card" >>../err
    done
    "$program" tile.fits $none -CATALOG_TYPE ASCII_VOTABLE -CATALOG_NAME STDOUT -VERBOSE_TYPE QUIET 2>/dev/null |
        grep -q '<COOSYS ID="J2000" equinox="J2000" epoch="J2000" system="ICRS"/>' || echo 'no COOSYS' >>../err
    judge 0 ''
fi

# Two spellings that users mix up, and a name that misleads other programs.
begin 'CATALOG_TYPE FITS is FITS_1.0'
make_fits tile tile.fits
leaves test.fits
if [ "$active" = 1 ]; then
    run tile.fits $none -CATALOG_TYPE FITS -CATALOG_NAME test.fits -VERBOSE_TYPE QUIET
    [ "$(head -c 6 test.fits)" = SIMPLE ] || echo 'no FITS file' >>../err
    judge 0 ''
fi

for word in ASCII_HEAD ASCII_VOTABLE; do
    for end in fits FIT; do
        begin "$word in a file that is called .$end"
        make_fits tile tile.fits
        leaves test.$end
        if [ "$active" = 1 ]; then
            run tile.fits $none -CATALOG_TYPE $word -CATALOG_NAME test.$end
            grep 'warning: test' ../err >../warnings
            mv ../warnings ../err
            judge 0 "warning: test\.$end is no FITS file but $word; give CATALOG_TYPE FITS"
        fi
    done
done

begin 'CATALOG_NAME NONE is a name, and a warning says so'
make_fits tile tile.fits
leaves NONE
if [ "$active" = 1 ]; then
    run tile.fits $none -CATALOG_NAME NONE
    grep 'warning: CATALOG_NAME' ../err >../warnings
    mv ../warnings ../err
    judge 0 'warning: CATALOG_NAME NONE .*CATALOG_TYPE NONE'
fi

begin 'no word about a FITS catalogue that is called .cat'
make_fits tile tile.fits
leaves test.cat
if [ "$active" = 1 ]; then
    run tile.fits $none -CATALOG_TYPE FITS
    grep 'warning: test' ../err >../warnings
    mv ../warnings ../err
    judge 0 ''
fi

# SExtractor's own files, as a survey has them: no word about keywords without effect.
begin 'configuration, columns and filter of SExtractor'
make_fits tile tile.fits
if [ ! -f /usr/share/source-extractor/default.param ] || ! command -v source-extractor >/dev/null; then
    skip 'source-extractor is not installed'
elif [ "$active" = 1 ]; then
    source-extractor -dd >default.sex 2>/dev/null
    cp /usr/share/source-extractor/default.param /usr/share/source-extractor/default.conv \
        /usr/share/source-extractor/default.nnw .
    printf 'NUMBER\nX_IMAGE\nY_IMAGE\nMAG_AUTO\nFLAGS\nCLASS_STAR\n' >default.param
    leaves test.cat
    run tile.fits $none
    grep -Ev '^rextract: (tile\.fits|written: )' ../err >../warnings
    mv ../warnings ../err
    judge 0 ''
fi

begin 'termination leaves nothing'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    "$program" tile.fits $moffat -RL_NITER 100000 -CHECKIMAGE_TYPE RESTORED -VERBOSE_TYPE QUIET >../out 2>../err </dev/null &
    process=$!
    sleep 2
    kill -TERM "$process"
    wait "$process" 2>/dev/null
    echo $? >../code
    judge 143 'interrupted'
fi

begin 'same bytes for any number of threads'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    for threads in 1 2 3; do
        timeout 60 "$program" tile.fits -NTHREADS $threads -CATALOG_TYPE FITS_LDAC -CATALOG_NAME test.cat \
            -CHECKIMAGE_TYPE RESTORED,BACKGROUND,SEGMENTATION -CHECKIMAGE_NAME r.fits,b.fits,s.fits -VERBOSE_TYPE QUIET
        echo $? >../code
        cat test.cat r.fits b.fits s.fits | cksum
        rm -f test.cat r.fits b.fits s.fits
    done >../sums 2>../err
    [ "$(sort -u ../sums | wc -l)" = 1 ] || echo 'outputs depend on the number of threads' >>../err
    : >../out
    judge 0 ''
fi

begin 'a MAGZERO that differs from MAG_ZEROPOINT is named'
make_fits tile tile.fits 'MAGZERO = 26.1'
leaves test.cat
says 5 # no default.sex, this, the PSF, the count, what was written
expect_exactly 0 'MAG_ZEROPOINT is 0, the header.s MAGZERO 26\.1; MAG_ZEROPOINT_KEY MAGZERO takes it' tile.fits $none

begin 'a MAGZERO that is taken'
make_fits tile tile.fits 'MAGZERO = 26.1'
leaves test.cat
says 4
expect_exactly 0 'sources' tile.fits $none -MAG_ZEROPOINT_KEY MAGZERO

begin 'a tile has ten lines at NORMAL, warnings and what was written among them'
make_fits tile tile.fits 'MAGZERO = 26.1' 'GAINA   = 2.5'
make_fits table ref.fits
make_model model.fits
if [ "$active" = 1 ]; then
    list_files >../before
    printf '%s\n' 'recall all >= 0' 'precision all >= 0' 'recall all >= 0.9' >my.qa
    timeout 60 "$program" tile.fits -RESTORE_TYPE NONE,RL,NET -NET_MODEL model.fits -PSF_TYPE MOFFAT -PSF_FWHM 1 -RL_NITER 3 \
        -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N -QA_GATES my.qa \
        -CHECKIMAGE_TYPE RESTORED,BACKGROUND,SEGMENTATION -CHECKIMAGE_NAME restored.fits,background.fits,segments.fits \
        -RECORD_NAME tile.record -c "$top/config/default.sex" -PARAMETERS_NAME "$top/config/template.param" -FILTER N >../out 2>../log
    cp ../log ../err
    [ "$(grep -c '' ../log)" -le 10 ] || echo 'more than ten lines' >>../err
    [ "$(grep -c 'written: ' ../log)" = 1 ] || echo 'written: not once' >>../err
    for word in 'warning: .*NET: done by RL' 'written: test_NONE\.cat, .*' 'more lines of information with VERBOSE_TYPE FULL'; do
        grep -Eq "$word" ../log || echo "no $word" >>../err
    done
    cmp -s ../log ../err && : >../err
    rm -rf my.qa report* test_*.cat restored* background* segments* tile.record
    echo 0 >../code
    judge 0 ''
fi

begin 'what was written is told once, the record with it'
make_fits tile tile.fits
leaves test.cat tile.record
says 4 # no default.sex, the PSF, the count, this
expect_exactly 0 '^rextract: written: test\.cat, tile\.record$' tile.fits $none -RECORD_NAME tile.record

begin 'a record alone is what a tile wrote that failed'
make_fits tile tile.fits 'BITPIX  = 13'
leaves tile.record
says 3
expect_exactly 3 '^rextract: written: tile\.record$' tile.fits $none -RECORD_NAME tile.record

begin 'two images: the log says which is for what'
make_fits tile a.fits
make_fits tile b.fits
leaves test.cat
says 5 # no default.sex, the PSF, this, the count, what was written
expect_exactly 0 '^rextract: two images: sources are detected on a\.fits\[0\] and measured on b\.fits\[0\]$' a.fits b.fits $none

# Names may hold what terminals obey; no line of any program brings it to one.
begin 'names with control characters'
odd=$(printf 'a\033[31m\a\302\2332J')
make_fits tile "$odd.fits" && make_fits table "$odd.ref"
if [ "$active" = 1 ]; then
    leaves report "$odd.cat" "$odd.record" "$odd.sim" sim_truth.fits survey
    list_files >../before
    {
        "$program" "$odd.fits" $none -CATALOG_NAME "$odd.cat" -REFERENCE_NAME "$odd.ref" -QA_NAME report -QA_FIGURES N -RECORD_NAME "$odd.record"
        "$program" "$odd.fits" $none -CATALOG_NAME "$odd.fits"
        "$program" "$odd" "-$odd"
        "$programs/rextract-simulate" -IMAGE_SIZE 32 -IMAGE_NAME "$odd.sim"
        "$programs/rextract-survey" "$odd.record" -QA_FIGURES N
        "$programs/rextract-survey" "$odd.record" -QA_FIGURES N -MERGED_NAME "$odd.record"
        echo "$odd.fits" >../tiles
        "$program" @../tiles $none -CATALOG_TYPE NONE
    } >../out 2>&1 </dev/null
    LC_ALL=C grep -a "$(printf '[\001-\010\013-\037\177]\\|\302[\200-\237]')" ../out >../err
    grep -q 'written: a?\[31m' ../out || echo 'no line of what was written' >>../err
    echo 0 >../code
    : >../out
    judge 0 ''
fi

begin 'a report that the user added to is kept'
make_fits tile tile.fits && make_fits table ref.fits
if [ "$active" = 1 ]; then
    leaves report
    run tile.fits $none -CATALOG_TYPE NONE -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N -VERBOSE_TYPE QUIET
    cp -R report ../first
    "$program" tile.fits $none -CATALOG_TYPE NONE -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N -VERBOSE_TYPE QUIET 2>>../err ||
        echo 'is not renewed' >>../err
    cmp -s report/.rextract ../first/.rextract || echo 'the same report has another list' >>../err
    judge 0 ''
fi
[ "$active" = 0 ] || echo note >report/note
leaves ''
expect 2 "^rextract: report: holds 'note', which is not what a run of rextract wrote there" tile.fits $none -CATALOG_NAME a.cat \
    -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N

begin 'a folder with an entry of the name .rextract is no report'
make_fits tile tile.fits && mkdir -p notes/.rextract && echo note >notes/.rextract/note
expect 2 '^rextract: notes: its \.rextract does not list' tile.fits $none -CATALOG_NAME a.cat -QA_TYPE TILE -QA_NAME notes
