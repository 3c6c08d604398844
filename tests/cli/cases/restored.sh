# RESTORE_TYPE FILE: pixels that were restored elsewhere.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

file='-RESTORE_TYPE FILE -RESTORED_NAME r.fits -RESTORED_PSF 2'

begin 'restored pixels without their name'
make_fits tile tile.fits && make_fits tile r.fits
expect 2 'RESTORE_TYPE FILE needs the restored pixels; name their file by RESTORED_NAME$' tile.fits -RESTORE_TYPE FILE -RESTORED_PSF 2

for psf in '' 0 -1; do
    begin "restored pixels with the PSF '$psf'"
    make_fits tile tile.fits && make_fits tile r.fits
    expect 2 'needs the PSF of the restored pixels; give RESTORED_PSF its FWHM in pixels, or the file of its image$' tile.fits $file -RESTORED_PSF "$psf"
done

begin 'restored pixels with a PSF that is not there'
make_fits tile tile.fits && make_fits tile r.fits
expect 3 '^rextract: nosuch\.fits: ' tile.fits $file -RESTORED_PSF nosuch.fits

begin 'restored pixels that are not there'
make_fits tile tile.fits && make_fits tile r.fits
expect 3 '^rextract: nosuch\.fits: cannot be opened' tile.fits $file -RESTORED_NAME nosuch.fits

begin 'restored pixels of another shape'
make_fits tile tile.fits && make_fits small small.fits
expect 3 '^rextract: small\.fits\[0\]: the restored image has .*; give a map of the tile.s shape$' tile.fits $file -RESTORED_NAME small.fits

begin 'restored pixels that an output would replace'
make_fits tile tile.fits && make_fits tile r.fits
expect 2 'CATALOG_NAME r\.fits is also (read|RESTORED_NAME)|r\.fits.*RESTORED_NAME' tile.fits $file -RESTORED_NAME r.fits -CATALOG_NAME r.fits

begin 'the noise of pixels that were restored elsewhere'
make_fits tile tile.fits && make_fits tile r.fits
expect 2 'RESTORED_RMS has the tile restored again, which FILE cannot do; leave out one of the two$' tile.fits $file -CHECKIMAGE_TYPE RESTORED_RMS

begin 'the noise of restored pixels, of a tile that only one restorer can do'
make_fits tile tile.fits && printf 'NUMBER\n' >my.param
leaves test_NONE.cat test_RL.cat m_NONE.fits m_RL.fits
expect 0 '' tile.fits -RESTORE_TYPE NONE,RL -PSF_TYPE AUTO -PSF_MINSNR 1e6 -PARAMETERS_NAME my.param -CHECKIMAGE_TYPE RESTORED_RMS -CHECKIMAGE_NAME m.fits

begin 'restored pixels in a campaign'
of rextract-validate
expect 2 'RESTORE_TYPE FILE is for single tiles' -CAMPAIGN_TYPE DETECTION -SIZE SMALL -RESTORE_TYPE NONE,FILE -OUTPUT_NAME out
