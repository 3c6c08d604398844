# The restorer NET: its model, its blocks
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

net='-RESTORE_TYPE NET -NET_MODEL model.fits -PSF_TYPE MOFFAT -PSF_FWHM 3'

begin 'network: a model that is not there'
make_fits tile tile.fits
expect 3 '^rextract: model\.fits: is neither here nor in .*; name the network.s model by NET_MODEL$' tile.fits $net

begin 'network: a model in a folder that is not there'
make_fits tile tile.fits
expect 3 '^rextract: \./absent/model\.fits: ' tile.fits $net -NET_MODEL ./absent/model.fits

begin 'network: a tile is no model'
make_fits tile tile.fits
expect 3 '^rextract: \./tile\.fits\[0\]: is no model: ' tile.fits $net -NET_MODEL tile.fits

begin 'network: a model cut short'
make_fits tile tile.fits
make_model whole.fits && head -c 9000 whole.fits >model.fits
expect 3 '^rextract: \./model\.fits\[2\]: the table does not begin with XTENSION' tile.fits $net

begin 'network: an absent model is no concern of others'
make_fits tile tile.fits
leaves test.cat
expect 0 '' tile.fits $net -RESTORE_TYPE NONE

begin 'network: blocks that are no multiple of 4'
make_fits tile tile.fits
make_model model.fits
expect 2 'NET_BLOCK: 50 is no multiple of 4; give 52' tile.fits $net -NET_BLOCK 50

begin 'network: a tile, verified'
make_fits tile tile.fits
make_model model.fits
leaves test.cat
expect 0 '' tile.fits $net -VERIFY_SEAMS Y -NET_BLOCK 32

begin 'network: verified with blocks larger than the tile'
make_fits tile tile.fits
make_model model.fits
leaves test.cat
expect 0 '' tile.fits $net -VERIFY_SEAMS Y -NET_BLOCK 4096

for boxed in "$top"/config/psfnet*.fits; do
    begin "network: ${boxed##*/}, verified"
    make_fits tile tile.fits
    leaves test.cat
    expect 0 '' tile.fits $net -NET_MODEL "$boxed" -OUT_OF_DOMAIN WARN -VERBOSE_TYPE QUIET -VERIFY_SEAMS Y -NET_BLOCK 32
done

unknown='-RESTORE_TYPE NET -NET_MODEL model.fits -PSF_TYPE AUTO -PSF_MINSNR 1e6 -CATALOG_TYPE FITS_1.0'

begin 'network: blind and without a PSF'
make_fits tile tile.fits
make_model model.fits BLIND
if [ "$active" = 1 ]; then
    list_files >../before
    {
        timeout 60 "$program" tile.fits $unknown -CHECKIMAGE_TYPE RESTORED,RESIDUAL,SUPPORT \
            -CHECKIMAGE_NAME a.fits,b.fits,c.fits -VERBOSE_TYPE QUIET
        echo $? >../code
        tr -d '\000' <test.cat | grep -q "RXREST  = 'NET" || echo 'the network did not run'
        rm -f test.cat a.fits b.fits c.fits
    } >../err 2>&1
    : >../out
    judge 0 ''
fi

begin 'network: a model whose training has not ended, named'
make_fits tile tile.fits
make_model model.fits UNFINISHED
if [ "$active" = 1 ]; then
    list_files >../before
    {
        timeout 60 "$program" tile.fits $net -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL -VERBOSE_TYPE FULL >../log 2>&1
        echo $? >../code
        tr -d '\000' <test.cat | grep -q "RXNETEND= 'F" || echo 'no RXNETEND in the header'
        grep -q '^rextract: warning: ./model.fits: its training has not ended, it is of epoch 0 after 0$' ../log || echo 'no warning'
        grep -q 'NET_MODEL model.fits is ./model.fits$' ../log || echo 'not said where the model was found'
        tr -d '\000' <test.cat | grep -q 'NET_MODEL = ./model.fits' || echo 'its header may mean an installed one'
        grep -q 'NET: model toy (.*, training not ended)' ../log || echo 'not said of the tile'
        rm -f model.fits test.cat
        make_model model.fits && timeout 60 "$program" tile.fits $net -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL -VERBOSE_TYPE QUIET
        tr -d '\000' <test.cat | grep -o 'RXNETEND= .F'
        rm -f model.fits test.cat
        make_model model.fits UNFINISHED
    } >../err 2>&1
    : >../out
    judge 0 ''
fi

begin 'network: noise that it makes sources of raises the threshold, and says so'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    {
        low="$net -NET_MODEL $top/config/psfnet.fits -DETECT_THRESH 0.2 -DETECT_MINAREA 3 -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL"
        timeout 60 "$program" tile.fits $low -VERBOSE_TYPE NORMAL >../log 2>&1
        echo $? >../code
        grep -q 'above NOISE_FALSE_MAX 10: DETECT_THRESH is raised' ../log || cat ../log
        tr -d '\000' <test.cat | grep -q 'RXBLKD  = ' || echo 'not in the header'
        rm -f test.cat
        timeout 60 "$program" tile.fits $low -NOISE_FALSE_MAX 0 -VERBOSE_TYPE NORMAL 2>&1 | grep 'is raised'
        tr -d '\000' <test.cat | grep -q "RXBLKT  = *'*1.0*[ ']" || echo 'raised without a limit'
        rm -f test.cat
        timeout 60 "$program" tile.fits $low -BLANK_CHECK 0 -VERBOSE_TYPE NORMAL 2>&1 | grep 'blank check'
        tr -d '\000' <test.cat | grep -o 'RXBLKN'
        rm -f test.cat
    } >../err 2>&1
    : >../out
    judge 0 ''
fi

begin 'network: informed and without a PSF'
make_fits tile tile.fits
make_model model.fits
leaves test.cat
expect 0 '' tile.fits $unknown

begin 'network: a tile of one pixel'
make_fits pixel tile.fits
make_model model.fits
leaves test.cat
expect 0 '' tile.fits $net

begin 'network: a tile without a good pixel'
make_fits nan tile.fits
make_model model.fits
expect 3 '^rextract: tile\.fits\[0\]: all 9216 pixels are NaN' tile.fits $net

begin 'network: same bytes for any number of threads and any blocks'
make_fits tile tile.fits
make_model model.fits
if [ "$active" = 1 ]; then
    list_files >../before
    for run in '1 512' '2 512' '3 512'; do
        set -- $run
        timeout 60 "$program" tile.fits -NTHREADS $1 $net -NET_BLOCK $2 -CATALOG_TYPE FITS_LDAC \
            -CHECKIMAGE_TYPE RESTORED,RESIDUAL,SUPPORT -CHECKIMAGE_NAME a.fits,b.fits,c.fits -VERBOSE_TYPE QUIET
        echo $? >../code
        cat test.cat a.fits b.fits c.fits | cksum
        rm -f test.cat a.fits b.fits c.fits
    done >../sums 2>../err
    for block in 32 64; do
        timeout 60 "$program" tile.fits $net -NET_BLOCK $block -CATALOG_TYPE ASCII -VERBOSE_TYPE QUIET
        cksum <test.cat
        rm -f test.cat
    done >../blocks 2>>../err
    [ "$(sort -u ../sums | wc -l)" = 1 ] || echo 'outputs depend on the number of threads' >>../err
    [ "$(sort -u ../blocks | wc -l)" = 1 ] || echo 'the catalogue depends on the blocks' >>../err
    : >../out
    judge 0 ''
fi

begin 'network: what the header says'
make_fits tile tile.fits
make_model model.fits
if [ "$active" = 1 ]; then
    list_files >../before
    {
        timeout 60 "$program" tile.fits $net -VERIFY_SEAMS Y -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL -CATALOG_NAME test.fits -VERBOSE_TYPE QUIET
        echo $? >../code
        for card in "RXREST  = 'NET" 'RXSEAM  =' 'RXCHI2  =' 'model toy'; do
            tr -d '\000' <test.fits | grep -q "$card" || echo "no $card in the header"
        done
        timeout 60 "$program" tile.fits $net -CATALOG_TYPE FITS_1.0 -CATALOG_NAME test.fits -VERBOSE_TYPE QUIET
        cards=$(tr -d '\000' <test.fits | fold -b -w 80 | grep -a -c '^RX')
        [ "$cards" -ge 15 ] && [ "$cards" -le 25 ] || echo "$cards cards of ours by default"
        rm -f test.fits
    } >../err 2>&1
    : >../out
    judge 0 ''
fi

begin 'network: every catalogue and check-image says that RL did it'
make_fits tile tile.fits
make_model model.fits
if [ "$active" = 1 ]; then
    list_files >../before
    {
        for type in ASCII_HEAD FITS_1.0 FITS_LDAC ASCII_VOTABLE; do
            timeout 60 "$program" tile.fits $net -PSF_FWHM 1 -CATALOG_TYPE $type -CHECKIMAGE_TYPE RESTORED \
                -CHECKIMAGE_NAME a.fits -VERBOSE_TYPE QUIET
            echo $? >../code
            for file in test.cat a.fits; do
                for word in 'RXREST[^A-Z]*RL' 'RXASKED[^A-Z]*NET' 'RXWHY.*FWHM 1 pixels is below 1.8, 0.9 of the network'; do
                    tr '\000' '\n' <$file | sed 's/="" *//; s/datatype="char" arraysize="[^"]*"//; s/value=//' |
                        grep -q "$word" || echo "$type: $file lacks $word"
                done
            done
            rm -f test.cat a.fits
        done
    } >../err 2>&1
    : >../out
    judge 0 ''
fi

begin 'network: RL instead, which RESTORE_FALLBACK N forbids'
make_fits tile tile.fits
make_model model.fits
expect 10 '^rextract: tile\.fits\[0\]: cannot be done by NET: FWHM 1 pixels is below 1\.8, 0\.9 of the network.s output; RESTORE_FALLBACK Y lets RL do it$' \
    tile.fits $net -PSF_FWHM 1 -RESTORE_FALLBACK N

begin 'network: no PSF, and RESTORE_FALLBACK N'
make_fits tile tile.fits
make_model model.fits
expect 10 '^rextract: tile\.fits\[0\]: cannot be done by NET: its PSF is not known; RESTORE_FALLBACK Y lets NONE do it$' \
    tile.fits $unknown -RESTORE_FALLBACK N

begin 'network: RESTORE_FALLBACK N against OUT_OF_DOMAIN RL'
make_fits tile tile.fits
expect 2 '^rextract: -RESTORE_FALLBACK: N forbids what OUT_OF_DOMAIN RL asks for; give OUT_OF_DOMAIN WARN or FAIL$' \
    tile.fits -OUT_OF_DOMAIN RL -RESTORE_FALLBACK N
