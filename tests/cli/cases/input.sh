# Images, weights, flags, PSFs and references that cannot be used.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

none='-RESTORE_TYPE NONE'
moffat='-PSF_TYPE MOFFAT -PSF_FWHM 3'

# --- the image

begin 'names with a blank at the beginning, beside files of the names without it'
make_fits tile ' a.fits' && make_fits psf ' psf.fits' && make_fits table ' ref.fits' && : >a.fits && : >psf.fits && : >ref.fits
leaves test.cat qa
expect 0 '' ' a.fits' -RESTORE_TYPE RL -RL_NITER 2 -PSF_TYPE FILE -PSF_NAME '" psf.fits"' -REFERENCE_NAME ' ref.fits' -QA_FIGURES N -QA_NAME qa

begin 'image that is not there'
expect 3 '^rextract: absent\.fits: cannot be opened: No such file or directory' absent.fits $none

begin 'image that is a folder'
mkdir tile.fits
expect 3 '^rextract: tile\.fits: is a folder, a FITS file was expected' tile.fits $none

begin 'image that is empty'
: >tile.fits
expect 3 '^rextract: tile\.fits: is an empty file' tile.fits $none

begin 'image that is text'
printf 'this is no image\n' >tile.fits
expect 3 '^rextract: tile\.fits: is not a FITS file: it does not begin with SIMPLE' tile.fits $none

begin 'image of random bytes'
"$fits" tile t.fits && tail -c 20000 t.fits >tile.fits && rm t.fits
expect 3 '^rextract: tile\.fits: is not a FITS file: it does not begin with SIMPLE' tile.fits $none

begin 'image cut in its pixels'
make_fits tile t.fits && head -c 20000 t.fits >tile.fits && rm t.fits
expect 3 '^rextract: tile\.fits\[0\]: is cut off: the header says 36864 bytes of data, the file' tile.fits $none

begin 'image cut in its pixels, to be restored'
make_fits tile t.fits && head -c 20000 t.fits >tile.fits && rm t.fits
expect 3 '^rextract: tile\.fits\[0\]: is cut off: the header says 36864 bytes of data, the file' tile.fits $moffat

begin 'image cut in its header'
make_fits tile t.fits && head -c 400 t.fits >tile.fits && rm t.fits
expect 3 '^rextract: tile\.fits: its header has no END: the file is cut off or damaged,' tile.fits $none

begin 'image cut behind its first card'
make_fits tile t.fits && head -c 80 t.fits >tile.fits && rm t.fits
expect 3 '^rextract: tile\.fits: cannot be read as FITS: second keyword not BITPIX$' tile.fits $none

begin 'header without END'
make_fits endless tile.fits
expect 3 '^rextract: tile\.fits: its header has no END: the file is cut off or damaged,' tile.fits $none

begin 'illegal BITPIX'
make_fits bitpix tile.fits
expect 3 '^rextract: tile\.fits: cannot be read as FITS: illegal BITPIX keyword value' tile.fits $none

begin 'huge axes in a short file'
make_fits huge tile.fits
expect 3 '^rextract: tile\.fits\[0\]: is cut off: the header says 4000000000000 bytes of data,' tile.fits $none

begin 'axes whose product overflows'
make_fits overflow tile.fits
expect 3 '^rextract: tile\.fits\[0\]: ends before it begins, by its size' tile.fits $none

begin 'negative axis'
make_fits negative tile.fits
expect 3 '^rextract: tile\.fits: cannot be read as FITS: illegal NAXISn keyword value' tile.fits $none

begin 'axis of length zero'
make_fits zero tile.fits
expect 3 '^rextract: tile\.fits\[1\]: this HDU cannot be read, and none before it holds a 2-D' tile.fits $none

begin 'one axis'
make_fits line tile.fits
expect 3 '^rextract: tile\.fits\[0\]: holds an image of 1 axis, a 2-D one was expected' tile.fits $none

begin 'three axes'
make_fits cube tile.fits
expect 3 "^rextract: tile\.fits\[0\]: holds an image of 3 axes \(96 x 96 x 3\), a 2-D one was expected; name one plane of it, the first by 'tile\.fits\[0\]\[\*,\*,1\]'" tile.fits $none

begin 'a plane of a cube'
make_fits cube tile.fits
prints '^ +1 '
expect 0 '' 'tile.fits[0][*,*,3]' $none -CATALOG_NAME STDOUT -WEIGHT_TYPE MAP_WEIGHT -WEIGHT_IMAGE 'tile.fits[0][*,*,1]'

begin 'two planes of a cube, detection and measurement'
make_fits cube tile.fits
prints '^ +1 '
expect 0 '' 'tile.fits[0][*,*,1],tile.fits[0][*,*,2]' $none -CATALOG_NAME STDOUT

begin 'a plane that a cube does not have'
make_fits cube tile.fits
expect 3 '^rextract: tile\.fits\[0\]: has no plane 4 on axis 3; give one from 1 to 3' 'tile.fits[*,*,4]' $none

begin 'an image with its mask and variance'
make_fits calexp tile.fits
leaves test.cat
talks 'tile\.fits: MASK, VARIANCE: maps, not measured .*tile\.fits\[1\]: measured with the VARIANCE and the MASK' tile.fits $none

begin 'an image with its mask and variance, not to be used'
make_fits calexp tile.fits
prints '^ +1 '
expect 0 '' tile.fits $none -WEIGHT_TYPE NONE -CATALOG_NAME STDOUT

begin 'columns of two images'
make_fits extensions tile.fits
prints '# +[0-9]+ EXT_NUMBER '
expect 0 '' tile.fits $none -CATALOG_NAME STDOUT -CATALOG_TYPE ASCII_HEAD

begin 'no image at all'
make_fits primary-only tile.fits
expect 3 '^rextract: tile\.fits: holds no 2-D image in its 1 HDUs' tile.fits $none

begin 'a table where an image should be'
make_fits table tile.fits
expect 3 '^rextract: tile\.fits\[1\]: holds a table, a 2-D image was expected' tile.fits $none

begin 'the table named'
make_fits table tile.fits
expect 3 '^rextract: tile\.fits\[1\]: holds a table, a 2-D image was expected' 'tile.fits[1]' $none

begin 'an HDU that is not there'
make_fits extensions tile.fits
expect 3 '^rextract: tile\.fits\[7\]: there is no such HDU' 'tile.fits[7]' $none

begin 'an extension name that is not there'
make_fits extensions tile.fits
expect 3 '^rextract: tile\.fits: has no extension named .CCD9.' 'tile.fits[CCD9]' $none

begin 'a section outside the image'
make_fits tile tile.fits
expect 3 '^rextract: tile\.fits\[0\]: the section ends at 6000,10, outside of the image of 96 x' 'tile.fits[5000:6000,1:10]' $none

begin 'a section that is none'
make_fits tile tile.fits
expect 3 '^rextract: tile\.fits\[a:b,c\]: cannot use .\[a:b,c\].' 'tile.fits[a:b,c]' $none

begin 'all pixels NaN'
make_fits nan tile.fits
expect 3 '^rextract: tile\.fits\[0\]: all 9216 pixels are NaN, BLANK or beyond 1e20' tile.fits $none

begin 'all pixels NaN, to be restored'
make_fits nan tile.fits
expect 3 '^rextract: tile\.fits\[0\]: all 9216 pixels are NaN, BLANK or beyond 1e20' tile.fits $moffat

begin 'all pixels infinite'
make_fits infinite tile.fits
expect 3 '^rextract: tile\.fits\[0\]: all 9216 pixels are NaN, BLANK or beyond 1e20' tile.fits $none

if command -v bzip2 >/dev/null; then
    for bytes in 100 3000; do
        begin "bzip2 file cut short after $bytes bytes"
        make_fits tile tile.fits && bzip2 tile.fits && head -c "$bytes" tile.fits.bz2 >t.fits.bz2 && rm tile.fits.bz2
        expect 3 '^rextract: t\.fits\.bz2: (cannot be read: the packed file is cut off|cannot be read as FITS|its header has no END)' t.fits.bz2 $none
    done
fi

begin 'gzip file cut short'
make_fits tile tile.fits && gzip -n tile.fits && head -c 9000 tile.fits.gz >t.fits.gz && rm tile.fits.gz
expect 3 '^rextract: t\.fits\.gz: cannot be read: the packed file is cut off' t.fits.gz $none

begin 'compressed image with broken pixels'
cp "$top/tests/data/sim.fits.fz" tile.fits.fz && chmod u+w tile.fits.fz
middle=$(($(wc -c <tile.fits.fz) / 2))
head -c 60000 /dev/zero | tr '\000' '\377' | dd of=tile.fits.fz bs=1 seek="$middle" conv=notrunc 2>/dev/null
expect 3 '^rextract: tile\.fits\.fz\[1\]: the compressed image is damaged' tile.fits.fz $none

begin 'compressed image cut short'
head -c 100000 "$top/tests/data/sim.fits.fz" >tile.fits.fz
expect 3 '^rextract: tile\.fits\.fz\[1\]: is cut off: the header says 210619 bytes of data, the file' tile.fits.fz $none

# --- two images

begin 'measurement image that is not there'
make_fits tile tile.fits
expect 3 '^rextract: absent\.fits: cannot be opened: No such file or directory' tile.fits,absent.fits $none

begin 'two images of different shapes'
make_fits tile a.fits && make_fits small b.fits
expect 3 '^rextract: b\.fits.*64 x 48 pixels.*96 x 96' a.fits,b.fits $none

begin 'two files with different numbers of images'
make_fits extensions a.fits && make_fits tile b.fits
expect 3 '^rextract: b\.fits: has 1 images, the detection file 2' a.fits b.fits $none

# --- weights and flags

begin 'weight that is not there'
make_fits tile tile.fits
expect 3 '^rextract: absent\.fits: cannot be opened: No such file or directory' tile.fits $none -WEIGHT_TYPE MAP_WEIGHT -WEIGHT_IMAGE absent.fits

begin 'weight of another shape'
make_fits tile tile.fits && make_fits small weight.fits
expect 3 '^rextract: weight\.fits\[0\]: the weight map has 64 x 48 pixels, the tile 96 x 96' tile.fits $none -WEIGHT_TYPE MAP_WEIGHT

begin 'weight that is a cube'
make_fits tile tile.fits && make_fits cube weight.fits
expect 3 '^rextract: weight\.fits\[0\]: holds an image of 3 axes \(96 x 96 x 3\), a 2-D one was expected; name one plane' tile.fits $none -WEIGHT_TYPE MAP_VAR

begin 'flag map that is not there'
make_fits tile tile.fits && printf 'NUMBER\nIMAFLAGS_ISO\n' >my.param
expect 3 '^rextract: flag\.fits: cannot be opened: No such file or directory' tile.fits $none -PARAMETERS_NAME my.param

begin 'flag map of another shape'
make_fits tile tile.fits && make_fits small flag.fits && printf 'NUMBER\nIMAFLAGS_ISO\n' >my.param
expect 3 '^rextract: flag\.fits\[0\]: the flag map has 64 x 48 pixels, the tile 96 x 96' tile.fits $none -PARAMETERS_NAME my.param

begin 'ASSOC list that is not there'
make_fits tile tile.fits && printf 'NUMBER\nVECTOR_ASSOC(1)\n' >my.param
expect 3 '^rextract: absent\.list: cannot be opened: No such file or directory' tile.fits $none -PARAMETERS_NAME my.param -ASSOC_NAME absent.list

begin 'ASSOC list with a ragged row'
make_fits tile tile.fits && printf 'NUMBER\nVECTOR_ASSOC(1)\n' >my.param && printf '1 2 3\n1 2\n' >my.list
expect 3 '^rextract: my\.list:2' tile.fits $none -PARAMETERS_NAME my.param -ASSOC_NAME my.list -ASSOC_PARAMS 1,2

begin 'ASSOC list with decimal commas'
make_fits tile tile.fits && printf 'NUMBER\nVECTOR_ASSOC(1)\n' >my.param && printf '1.5 2.5\n1,5 2,5\n' >my.list
expect 3 "^rextract: my\.list:2: '1,5' in column col1 is no number; give numbers, with decimal points$" tile.fits $none -PARAMETERS_NAME my.param -ASSOC_NAME my.list -ASSOC_PARAMS 1,2

begin 'reference with words for magnitudes'
make_fits tile tile.fits && printf '# x_image y_image mag\n10 10 20\n20 20 bright\n' >my.list
expect 3 "^rextract: my\.list:3: 'bright' in column mag is no number" tile.fits $none -REFERENCE_NAME my.list

# Files as an editor with byte order marks writes them.
begin 'byte order marks'
make_fits tile tile.fits
printf '\357\273\277NUMBER\nVECTOR_ASSOC(1)\n' >my.param
printf '\357\273\277CONV NORM\n1 2 1\n2 4 2\n1 2 1\n' >my.conv
printf '\357\273\27710 10\n' >my.list
printf '\357\273\277DETECT_MINAREA 5\nPARAMETERS_NAME my.param\nFILTER_NAME my.conv\nASSOC_NAME my.list\nASSOC_PARAMS 1,2\n' >my.sex
printf '\357\273\277tile.fits\n' >my.tiles
leaves test.cat
expect 0 '' tile.fits $none -c my.sex

begin 'byte order mark of a list'
make_fits tile tile.fits && printf '\357\273\277tile.fits\n' >my.tiles
leaves tile.cat
expect 0 '' @my.tiles $none -CATALOG_NAME tile.cat

begin 'ASSOC list with too few columns'
make_fits tile tile.fits && printf 'NUMBER\nVECTOR_ASSOC(1)\n' >my.param && printf '1 2\n' >my.list
expect '[23]' '^rextract: .*ASSOC|^rextract: my\.list' tile.fits $none -PARAMETERS_NAME my.param -ASSOC_NAME my.list -ASSOC_PARAMS 1,7

# --- the PSF

begin 'PSF that is not there'
make_fits tile tile.fits
expect 3 '^rextract: absent\.fits: cannot be opened: No such file or directory' tile.fits -PSF_TYPE FILE -PSF_NAME absent.fits

begin 'PSF whose sum is zero'
make_fits tile tile.fits && make_fits psf-zero psf.fits
expect 3 '^rextract: psf\.fits: the PSF image sums to 0' tile.fits -PSF_TYPE FILE -PSF_NAME psf.fits

begin 'PSF that is negative'
make_fits tile tile.fits && make_fits psf-minus psf.fits
expect 3 '^rextract: psf\.fits: the PSF image sums to -225' tile.fits -PSF_TYPE FILE -PSF_NAME psf.fits

begin 'PSF that is NaN'
make_fits tile tile.fits && make_fits psf-nan psf.fits
expect 3 '^rextract: psf\.fits: pixel \([0-9]+,[0-9]+\) of the PSF image is not a number' tile.fits -PSF_TYPE FILE -PSF_NAME psf.fits

begin 'PSF larger than the tile'
make_fits tile tile.fits && make_fits psf-large psf.fits
expect 3 '^rextract: psf\.fits: a PSF of 201 x 201 pixels is larger than the tile of 96 x 96' tile.fits -PSF_TYPE FILE -PSF_NAME psf.fits

begin 'PSF that is a table'
make_fits tile tile.fits && make_fits table psf.fits
expect 3 '^rextract: psf\.fits: holds no image in its 2 HDUs' tile.fits -PSF_TYPE FILE -PSF_NAME psf.fits

begin 'PSFEx model that is an image'
make_fits tile tile.fits && make_fits psf my.psf
expect 3 '^rextract: my\.psf: holds no table' tile.fits -PSF_TYPE PSFEX -PSF_NAME my.psf

begin 'PSFEx model that is another table'
make_fits tile tile.fits && make_fits table my.psf
expect 3 '^rextract: my\.psf: a table of 16 rows where a PSFEx model has one' tile.fits -PSF_TYPE PSFEX -PSF_NAME my.psf

while IFS='|' read -r kind cards reason; do
    begin "PSF file of a $kind that says $cards"
    make_fits tile tile.fits
    (
        IFS=';'
        # shellcheck disable=SC2086 # a list of cards
        make_fits "$kind" psf.fits $cards
    )
    expect 3 "^rextract: psf\\.fits.*$reason" tile.fits -PSF_TYPE FILE -PSF_NAME psf.fits
done <<'cards'
cube||: 3 PSFs in a cube, and nothing says where
cube|DET_YX0 = '(1, 2)';DET_YX1 = 'middle'|: 3 PSFs in a cube, and nothing says where
cube|NXPSFS  = 3;NYPSFS  = 1;IPSFX01 = 1|: 3 PSFs in a cube, and nothing says where
cube|NXPSFS  = 1e300;NYPSFS  = 0|: 3 PSFs in a cube, and nothing says where
cube|NAXIS3  = 300|is cut off: the header says
cube|NAXIS3  = 2000000000|is cut off: the header says
cube|NAXIS3  = 0|holds no
psf|OVERSAMP= -4|: OVERSAMP = -4 samples of the PSF image per pixel of the tile cannot be right
psf|DET_SAMP= 1E9|: DET_SAMP = 1e.09 samples of the PSF image per pixel
psf|OVERSAMP= 0.5|: OVERSAMP = 0.5 samples of the PSF image per pixel
psf|FUNCTION= 'gauss';VARORDER= 0|: is a model of DAOPHOT; give the file that python3 -m rextract.psf_models MODEL OUT.fits makes of it
psf-zero|FUNCTION= 'gauss';VARORDER= -1|: is a model of DAOPHOT; give
cards

begin 'PSF_SAMPLING below 1'
make_fits tile tile.fits && make_fits psf psf.fits
expect 3 '^rextract: psf\.fits: PSF_SAMPLING = 0\.5 samples of the PSF image per pixel' tile.fits -PSF_TYPE FILE -PSF_NAME psf.fits -PSF_SAMPLING 0.5

begin 'PSF_STARS_NAME that is not there'
make_fits tile tile.fits
expect 3 '^rextract: absent\.cat: cannot be opened: No such file or directory' tile.fits -PSF_STARS_NAME absent.cat

begin 'PSF_STARS_NAME without positions'
make_fits tile tile.fits && printf '# mag name\n17.5 a\n' >stars.cat
expect 3 '^rextract: stars\.cat: holds no positions of stars; give columns X_IMAGE and Y_IMAGE \(pixels\), or ALPHA_J2000 and DELTA_J2000' tile.fits -PSF_STARS_NAME stars.cat

begin 'PSF_STARS_NAME with words for positions'
make_fits tile tile.fits && printf '# X_IMAGE Y_IMAGE\n10.5 20\n10,5 20\n' >stars.cat
expect 3 "^rextract: stars\.cat:3: '10,5' in column X_IMAGE is no number" tile.fits -PSF_STARS_NAME stars.cat

begin 'PSF_STARS_NAME in degrees, and an image without coordinates'
make_fits tile tile.fits && printf '# ra dec\n10.5 20\n' >stars.cat
expect 3 "^rextract: tile\.fits\[0\]: has no celestial coordinates, and PSF_STARS_NAME 'stars\.cat' holds no pixels" tile.fits -PSF_STARS_NAME stars.cat

begin 'PSF_STARS_NAME whose stars are elsewhere'
make_fits tile tile.fits && printf '# X_IMAGE Y_IMAGE\n1000 2000\n' >stars.cat
leaves test.cat
talks 'found 0 usable stars of S/N above 20 among those of PSF_STARS_NAME and needs 1;' tile.fits -PSF_STARS_NAME stars.cat

begin 'PSF_STARS_NAME of sources that the program finds'
make_fits tile tile.fits && printf 'X_IMAGE\nY_IMAGE\n' >xy.param
leaves stars.cat
expect 0 '' tile.fits $none -PARAMETERS_NAME xy.param -CATALOG_NAME stars.cat -CATALOG_TYPE FITS_1.0
leaves test.cat
talks 'stars\.cat: [0-9]+ of [0-9]+ sources are among its [0-9]+ stars .*PSF AUTO: ' tile.fits -PSF_STARS_NAME stars.cat

begin 'PSF_STARS_NAME where no stars are asked for'
make_fits tile tile.fits && printf '# X_IMAGE Y_IMAGE\n10 20\n' >stars.cat
leaves test.cat
talks 'PSF_STARS_NAME is for PSF_TYPE AUTO, and is not used' tile.fits $moffat -RL_NITER 2 -PSF_STARS_NAME stars.cat

begin 'PSF file beside an image whose stars give none'
make_fits flat tile.fits && make_fits psf tile.psf
leaves test.cat
talks 'found 0 usable stars .*; the PSF is that of tile\.psf beside the image' tile.fits -RL_NITER 2

begin 'PSF file beside an image that is none'
make_fits flat tile.fits && make_fits psf-nan tile.psf
leaves test.cat
talks 'tile\.psf beside it is no PSF of it: ' tile.fits -RL_NITER 2

begin 'CHECKIMAGE_TYPE PSF of a tile without one writes what is no PSF'
make_fits flat tile.fits
leaves check.psf
talks 'tile\.fits\[0\]: no PSF is known: CHECKIMAGE_TYPE PSF holds NaN for it' tile.fits $none -CATALOG_TYPE NONE -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME check.psf
expect 3 '^rextract: check\.psf: image 0 of the PSFEx model holds values that are not numbers' tile.fits -PSF_TYPE PSFEX -PSF_NAME check.psf

# --- the reference

begin 'reference that is not there'
make_fits tile tile.fits
expect 3 '^rextract: absent\.fits: cannot be opened: No such file or directory' tile.fits $none -REFERENCE_NAME absent.fits

begin 'reference that is text'
make_fits tile tile.fits && printf 'no catalogue\n' >ref.cat
expect 3 '^rextract: ref\.cat: no position columns were recognised' tile.fits $none -REFERENCE_NAME ref.cat

begin 'reference that is an image'
make_fits tile tile.fits
expect 3 '^rextract: tile\.fits: holds no table' tile.fits $none -REFERENCE_NAME tile.fits

begin 'reference with an illegal column format'
make_fits tile tile.fits && make_fits table-form ref.fits
expect 3 '^rextract: ref\.fits: holds no table' tile.fits $none -REFERENCE_NAME ref.fits

begin 'reference cut short'
make_fits tile tile.fits && make_fits table t.fits && head -c 5800 t.fits >ref.fits && rm t.fits
expect 3 '^rextract: ref\.fits\[1\]: is cut off: the header says 192 bytes of data, the file has' tile.fits $none -REFERENCE_NAME ref.fits

begin 'reference without the column named'
make_fits tile tile.fits && make_fits table ref.fits
expect '[23]' 'ref\.fits.*MAG_ATUO' tile.fits $none -REFERENCE_NAME ref.fits -REFERENCE_COLUMNS X_IMAGE,Y_IMAGE,MAG_ATUO

begin 'reference in degrees, tile without coordinates'
make_fits tile tile.fits && printf 'ra,dec,mag\n10,10,15\n' >ref.csv
expect 3 '^rextract: ' tile.fits $none -REFERENCE_NAME ref.csv -REFERENCE_COLUMNS ra,dec,mag

begin 'reference list with a ragged row'
make_fits tile tile.fits
printf '#   1 X_IMAGE x\n#   2 Y_IMAGE y\n#   3 MAG_AUTO m\n 1 2 3\n 4 5\n' >ref.cat
expect 3 '^rextract: ref\.cat:5' tile.fits $none -REFERENCE_NAME ref.cat

begin 'VOTable cut short'
make_fits tile tile.fits
printf '<?xml version="1.0"?>\n<VOTABLE version="1.3"><RESOURCE><TABLE>\n<FIELD name="X_IMAGE" datatype="float"/>\n<DATA><TABLEDATA><TR><TD>1' >ref.vot
expect 3 '^rextract: ref\.vot:4: is not well-formed XML: no element found' tile.fits $none -REFERENCE_NAME ref.vot

begin 'the second element of a vector is no number'
make_fits tile tile.fits && printf 'NUMBER\nVECTOR_ASSOC(1)\n' >my.param && printf '#   1 POS\n#   3 MAG\n10 10 20\n20 bright 20\n' >my.list
expect 3 "^rextract: my\.list:4: 'bright' in column POS is no number" tile.fits $none -PARAMETERS_NAME my.param -ASSOC_NAME my.list -ASSOC_PARAMS 1,2

begin 'a sky above SATUR_LEVEL is said'
make_fits tile tile.fits
leaves test.cat
if [ "$active" = 1 ]; then
    run tile.fits $none -SATUR_LEVEL 1e-6
    grep 'warning: tile' ../err >../warnings
    mv ../warnings ../err
    judge 0 'warning: tile\.fits\[0\]: .* of its pixels are at SATUR_LEVEL 1e-06 or above, .*give SATUR_LEVEL'
fi
