# Template photometry: keywords, columns, check-images and the table of covariances.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

moffat='-RESTORE_TYPE NONE -PSF_TYPE MOFFAT -PSF_FWHM 3'
columns='NUMBER\nX_IMAGE\nFLUX_TEMPLATE\nFLUXERR_TEMPLATE\nMAG_TEMPLATE\nSNR_TEMPLATE\nGROUP_TEMPLATE\nFLAGS_RESTORE\n'

# --- refused

while read -r keyword value pattern; do
    begin "$keyword $value"
    make_fits tile tile.fits
    expect 2 "^rextract: -$keyword: $pattern" tile.fits $moffat "-$keyword" "$value"
done <<'END'
TEMPLATE_TYPE PIXELS unknown word 'PIXELS'; give one of AUTO, PROFILE, POINT$
TEMPLATE_TYPE POINTS unknown word 'POINTS' \(did you mean POINT\?\)
TEMPLATE_PASSES 0 0 is out of range, give 1 to 100$
TEMPLATE_PASSES 101 101 is out of range, give 1 to 100$
CROWDING MAYBE unknown word 'MAYBE'; give one of AUTO, Y, N$
TEMPLATE_PASSES one 'one' is not a number$
TEMPLATE_BACKSIZE -1 -1 is out of range, give 0 to
TEMPLATE_PSFERR 1.5 1\.5 is out of range, give 0 to 1$
TEMPLATE_PSFERR -0.1 -0\.1 is out of range, give 0 to 1$
PRECISION_TARGET 1 1 is out of range, give 0 to 0.999$
QA_MAG MAG_TEMPLAT unknown word 'MAG_TEMPLAT' \(did you mean MAG_TEMPLATE\?\)
CHECKIMAGE_TYPE TEMPLATE_RESIDUALS unknown word 'TEMPLATE_RESIDUALS' \(did you mean TEMPLATE_RESIDUAL\?\)
END

begin 'a bad value of a template keyword in a file'
make_fits tile tile.fits
printf 'DETECT_MINAREA 5\nTEMPLATE_PASSES 101\n' >my.sex
expect 2 '^rextract: my\.sex:2: TEMPLATE_PASSES: 101 is out of range' tile.fits -c my.sex

begin 'a template column that is misspelt'
make_fits tile tile.fits
printf 'NUMBER\nFLUX_TEMPLAT\n' >my.param
expect 2 '^rextract: my\.param:2: .*FLUX_TEMPLAT.*FLUX_TEMPLATE' tile.fits $moffat -PARAMETERS_NAME my.param

begin 'covariances where nobody can write'
make_fits tile tile.fits
expect 4 '^rextract: /proc/c\.cat: ' tile.fits $moffat -TEMPLATE_COVAR_NAME /proc/c.cat

begin 'covariances that are a folder'
make_fits tile tile.fits && mkdir c.cat
expect 2 '^rextract: c\.cat: is a folder' tile.fits $moffat -TEMPLATE_COVAR_NAME c.cat

begin 'covariances under the name of the catalogue'
make_fits tile tile.fits
expect 2 '^rextract: TEMPLATE_COVAR_NAME test\.cat is also CATALOG_NAME' tile.fits $moffat -TEMPLATE_COVAR_NAME test.cat

begin 'covariances that would replace the image'
make_fits tile tile.fits
expect 2 'TEMPLATE_COVAR_NAME \./tile\.fits is also read, as tile\.fits' tile.fits $moffat -TEMPLATE_COVAR_NAME ./tile.fits

begin 'covariances that would replace the image under the name they get'
make_fits tile c_RL.fits
expect 2 'TEMPLATE_COVAR_NAME c_RL\.fits is also read' c_RL.fits -RESTORE_TYPE NONE,RL -PSF_TYPE MOFFAT -PSF_FWHM 3 -TEMPLATE_COVAR_NAME c.fits

begin 'covariances in a folder that a report replaces'
make_fits tile tile.fits && make_fits table ref.fits && mkdir qa && touch qa/.rextract
expect 2 'qa/c\.cat lies in the folder qa, .*QA_NAME' tile.fits $moffat -REFERENCE_NAME ref.fits -QA_NAME qa -TEMPLATE_COVAR_NAME qa/c.cat

# --- columns

begin 'template columns'
make_fits tile tile.fits && printf "%b" "$columns" >my.param
prints '^ +16 .* +0$'
expect 0 '' tile.fits $moffat -PSF_TYPE AUTO -PARAMETERS_NAME my.param -CATALOG_NAME STDOUT -CATALOG_TYPE ASCII

begin 'template columns without a PSF, without sources'
make_fits flat tile.fits && printf "%b" "$columns" >my.param
leaves test.cat
expect 0 '' tile.fits -PSF_TYPE AUTO -PARAMETERS_NAME my.param

# Too few stars for AUTO: sources are there, their template columns are empty, and it is told.
begin 'template columns without a PSF'
make_fits tile tile.fits && printf "%b" "$columns" >my.param
if [ "$active" = 1 ]; then
    list_files >../before
    "$program" tile.fits -RESTORE_TYPE NONE -PSF_TYPE AUTO -PSF_MINSNR 1e6 -PARAMETERS_NAME my.param \
        -CATALOG_TYPE ASCII -CATALOG_NAME test.cat -TEMPLATE_COVAR_NAME c.cat -PRECISION_TARGET 0.95 \
        -CHECKIMAGE_TYPE TEMPLATE_RESIDUAL -CHECKIMAGE_NAME r.fits >../out 2>../said
    echo $? >../code
    {
        grep -q 'warning: tile.fits.0.: the PSF is not known, so no templates are fitted' ../said || echo 'no warning'
        grep -q 'warning: tile.fits.0.: NONE: no source can be tested, so that PRECISION_TARGET leaves the list' ../said || echo 'not said of the list'
        [ "$(awk '$3 == "nan" && $4 == "nan" && $6 == "nan" && $7 == 0 && $8 == 4' test.cat | wc -l)" = 16 ] || cat test.cat
        [ "$(wc -l <c.cat)" = 0 ] || echo 'covariances of nothing'
    } >../err
    leaves test.cat c.cat r.fits
    judge 0 ''
fi

begin 'columns of PSF and Sersic fits, as the file of a survey names them'
make_fits tile tile.fits
printf '%s\n' NUMBER FLUX_TEMPLATE FLUX_PSF MAG_PSF XPSF_IMAGE ALPHAPSF_J2000 CHI2_PSF SPREAD_MODEL SPREADERR_MODEL FLUX_MODEL FLUX_SPHEROID \
    SPHEROID_REFF_IMAGE SPHEROID_SERSICN SPHEROID_ASPECT_IMAGE SPHEROID_THETA_IMAGE MAG_DISK >my.param
if [ "$active" = 1 ]; then
    list_files >../before
    "$program" tile.fits $moffat -PSF_TYPE AUTO -PARAMETERS_NAME my.param -CATALOG_TYPE ASCII -CATALOG_NAME test.cat >../out 2>../said
    echo $? >../code
    {
        grep -q 'columns of SExtractor that are not offered here are left out: MAG_DISK$' ../said || cat ../said
        [ "$(awk '$1 <= 16 && $3 > 0.95 * $2 && $3 < 1.05 * $2 && $8^2 < 25 * $9^2 && $10 == $2 && $11 > 0.9 * $2 && $13 > 0' test.cat | wc -l)" = 16 ] || cat test.cat
    } >../err
    leaves test.cat
    judge 0 ''
fi

# The stars of this tile are Gaussians.
begin 'the right PSF leaves noise'
make_fits tile tile.fits && printf "%b" "$columns" >my.param
prints '^# RXMODEL = 0[.]0*$'
expect 0 '' tile.fits $moffat -PSF_TYPE AUTO -PARAMETERS_NAME my.param -CATALOG_NAME STDOUT

begin 'a wrong PSF leaves more than noise, in the catalogue and the log'
make_fits tile tile.fits && printf "%b" "$columns" >my.param && touch default.sex
prints '^# RXMISFIT = PSF$'
says 4
expect_exactly 0 'its PSF may put fluxes off by a share of .* .NONE; RXMISFIT PSF.' tile.fits $moffat -PARAMETERS_NAME my.param -CATALOG_NAME STDOUT

begin 'made-up sources dropped'
make_fits tile tile.fits && printf "%b" "$columns" >my.param
if [ "$active" = 1 ]; then
    list_files >../before
    "$program" tile.fits $moffat -PSF_TYPE AUTO -PARAMETERS_NAME my.param -CATALOG_TYPE ASCII -CATALOG_NAME test.cat \
        -TEMPLATE_TYPE POINT -DETECT_THRESH 0.6 -DETECT_MINAREA 2 -VERBOSE_TYPE QUIET >../out 2>../err &&
        awk '$8 % 4 == 0' test.cat | cut -c 11- >../kept && cp test.cat ../all &&
        "$program" tile.fits $moffat -PSF_TYPE AUTO -PARAMETERS_NAME my.param -CATALOG_TYPE ASCII -CATALOG_NAME test.cat \
            -TEMPLATE_TYPE POINT -DETECT_THRESH 0.6 -DETECT_MINAREA 2 -PRECISION_TARGET 0.5 -VERBOSE_TYPE QUIET >>../out 2>>../err
    echo $? >../code
    cut -c 11- test.cat | diff ../kept - >>../err
    if [ "$(wc -l <../kept)" -le 4 ] || [ "$(wc -l <../kept)" -ge "$(($(wc -l <../all) - 4))" ]; then wc -l ../kept ../all >>../err; fi
    leaves test.cat
    judge 0 ''
fi

begin 'the magnitude of templates in the report'
make_fits tile tile.fits && make_fits table ref.fits
leaves test.cat report
expect 0 '' tile.fits $moffat -REFERENCE_NAME ref.fits -QA_NAME report -QA_FIGURES N -QA_MAG MAG_TEMPLATE

begin 'template check-images of two restorers'
make_fits tile tile.fits
leaves test_NONE.cat test_RL.cat r_NONE.fits r_RL.fits m_NONE.fits m_RL.fits x_NONE.fits x_RL.fits
expect 0 '' tile.fits -RESTORE_TYPE NONE,RL -PSF_TYPE MOFFAT -PSF_FWHM 3 \
    -CHECKIMAGE_TYPE TEMPLATE_RESIDUAL,TEMPLATE_MODEL,TEMPLATE_CHI -CHECKIMAGE_NAME r.fits,m.fits,x.fits

# --- covariances, in the format of the catalogue where that can hold them

for type in NONE ASCII ASCII_HEAD ASCII_SKYCAT ASCII_VOTABLE FITS_1.0 FITS_LDAC; do
    begin "covariances beside a catalogue of CATALOG_TYPE $type"
    make_fits extensions tile.fits
    if [ "$active" = 1 ]; then
        list_files >../before
        timeout 60 "$program" tile.fits $moffat -CATALOG_TYPE $type -CATALOG_NAME test.cat -TEMPLATE_COVAR_NAME c.cat \
            -VERBOSE_TYPE QUIET >../out 2>../err
        echo $? >../code
        case $type in
        NONE | ASCII_HEAD | ASCII_SKYCAT) wanted_text='^#   4 COVAR_TEMPLATE' ;;
        ASCII) ;;
        ASCII_VOTABLE) wanted_text='<FIELD.* name="COVAR_TEMPLATE"' ;;
        *) wanted_text="^TTYPE4  = 'COVAR_TEMPLATE'" ;;
        esac
        # a list without headings is empty where no two sources share a group
        if [ "$type" = ASCII ]; then
            [ -e c.cat ] || echo 'no table' >>../err
        else
            case $type in FITS*) fold -w 80 c.cat ;; *) cat c.cat ;; esac | grep -aq -- "$wanted_text" || echo 'no COVAR_TEMPLATE' >>../err
        fi
        leaves c.cat
        [ $type = NONE ] || leaves test.cat c.cat
        judge 0 ''
    fi
done

# --- listed positions

begin 'listed positions that are not there'
make_fits tile tile.fits
expect 3 '^rextract: my\.list: cannot be opened: ' tile.fits $moffat -POSITIONS_NAME my.list

begin 'listed positions without columns of positions'
make_fits tile tile.fits && printf '1 20 30\n2 40 50\n' >my.list
expect 3 '^rextract: my\.list: no position columns were recognised; call them ALPHA_J2000 and DELTA_J2000, or X_IMAGE and Y_IMAGE$' \
    tile.fits $moffat -POSITIONS_NAME my.list

begin 'listed positions that are words'
make_fits tile tile.fits && printf '# X_IMAGE Y_IMAGE\n20 30\n40 here\n' >my.list
expect 3 "^rextract: my\.list:3: 'here' in column Y_IMAGE is no number" tile.fits $moffat -POSITIONS_NAME my.list

begin 'listed positions on the sky of a tile without one'
make_fits tile tile.fits && printf '# RA DEC\n150 2\n' >my.list
expect 3 '^rextract: tile\.fits\[0\]: has no celestial coordinates, and my\.list no pixels; give it X_IMAGE and Y_IMAGE$' \
    tile.fits $moffat -POSITIONS_NAME my.list

for catalogue in '-CATALOG_NAME STDOUT' '-CATALOG_TYPE NONE'; do
    begin "listed positions and $catalogue"
    make_fits tile tile.fits && printf '# X_IMAGE Y_IMAGE\n20 30\n' >my.list
    expect 2 'positions of POSITIONS_NAME go into a file beside the catalogue; give CATALOG_NAME' \
        tile.fits $moffat -POSITIONS_NAME my.list $catalogue
done

begin 'listed positions that the table of them would replace'
make_fits tile tile.fits && printf '# X_IMAGE Y_IMAGE\n20 30\n' >a_RL_FORCED.cat
expect 2 'CATALOG_NAME a_RL_FORCED\.cat is also read, as a_RL_FORCED\.cat; give the output another name' \
    tile.fits -RESTORE_TYPE NONE,RL -PSF_TYPE MOFFAT -PSF_FWHM 3 -POSITIONS_NAME a_RL_FORCED.cat -CATALOG_NAME a.cat

begin 'listed positions, none of them on the tile'
make_fits tile tile.fits && printf '# X_IMAGE Y_IMAGE\n2000 30\nnan nan\n' >my.list
leaves test.cat test_FORCED.cat
says 4
[ "$active" = 0 ] || : >default.sex
expect_exactly 0 'warning: tile\.fits\[0\]: none of the 2 positions of my\.list lies on it$' \
    tile.fits -RESTORE_TYPE NONE -PSF_TYPE AUTO -POSITIONS_NAME my.list

begin 'a list of no positions'
make_fits tile tile.fits && printf '# X_IMAGE Y_IMAGE\n' >my.list
leaves test.cat test_FORCED.cat
expect 0 '' tile.fits $moffat -POSITIONS_NAME my.list

# Rows stay in their order whatever is there, with their own names, and the catalogue has the bytes that it has without the list.
begin 'fluxes at listed positions'
make_fits tile tile.fits
printf '# NAME X_IMAGE Y_IMAGE\nfar -100 5\nempty 5.5 5.5\nno nan 7\n' >my.list
if [ "$active" = 1 ]; then
    arguments="tile.fits $moffat -PSF_TYPE AUTO -CATALOG_TYPE ASCII -VERBOSE_TYPE QUIET"
    printf 'X_IMAGE\nY_IMAGE\nFLUX_TEMPLATE\nXTEMPLATE_IMAGE\nYTEMPLATE_IMAGE\n' >my.param
    list_files >../before
    {
        "$program" $arguments -PARAMETERS_NAME my.param -CATALOG_NAME without.cat && awk '{print "star", $4, $5}' without.cat >>my.list &&
            tail -n 1 my.list | sed 's/star/again/' >>my.list &&
            "$program" $arguments -PARAMETERS_NAME my.param -CATALOG_NAME with.cat -POSITIONS_NAME my.list
    } >../out 2>../err
    echo $? >../code
    {
        cmp without.cat with.cat
        [ "$(awk '{print $1}' with_FORCED.cat | tr '\n' ' ')" = "$(awk 'NR > 1 {print $1}' my.list | tr '\n' ' ')" ] || echo 'other rows'
        # NAME, EXT_NUMBER, ALPHA, DELTA, X, Y, FLUX, FLUXERR, FLUXLIM, MAG, MAGERR, MAGLIM, SNR, CHI2, BLEND, NUMBER_ASSOC, FLAGS
        awk '($1 == "far" || $1 == "no") && !($7 == "nan" && $8 == "nan" && $9 == "nan" && $17 == 32) {print "fitted: " $0}
             $1 == "empty" && !($13 < 4 && $13 > -4 && $9 > 0 && $16 == 0) {print "not empty: " $0}
             ($1 == "star" || $1 == "again") && !($16 == 1 && $9 > $7 + 1.64 * $8) {print "no star: " $0}' with_FORCED.cat
        awk 'NR == FNR {flux[FNR] = $3; next} $1 == "star" {n++; d = $7 - flux[n]; if (d * d > $8 * $8 / 4) print "not " flux[n] ": " $0}' \
            without.cat with_FORCED.cat
        [ "$(tail -n 2 with_FORCED.cat | sed 's/^ *[a-z]*//' | uniq | wc -l)" = 1 ] || echo 'a row twice is two fluxes'
    } >>../err 2>&1
    leaves my.list my.param without.cat with.cat with_FORCED.cat
    judge 0 ''
fi

for type in ASCII ASCII_HEAD ASCII_SKYCAT ASCII_VOTABLE FITS_1.0 FITS_LDAC DS9; do
    begin "listed positions beside a catalogue of CATALOG_TYPE $type"
    make_fits extensions tile.fits && printf '# X_IMAGE Y_IMAGE\n20 30\n' >my.list
    leaves test.cat test_FORCED.cat
    expect 0 '' tile.fits $moffat -CATALOG_TYPE $type -POSITIONS_NAME my.list
done
