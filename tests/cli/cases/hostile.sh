# Input made to do harm: headers that claim what is not there, names that mean more than a file, markup and
# control characters where a page, a script or a terminal could obey them.
# shellcheck shell=sh disable=SC2154,SC2086,SC2016,SC2088 # variables of run.sh; lists of arguments, bare `$` and `~` are meant

none='-RESTORE_TYPE NONE'
no_catalog='-RESTORE_TYPE NONE -CATALOG_TYPE NONE'
wcs1="CTYPE1  = 'RA---TAN'" wcs2="CTYPE2  = 'DEC--TAN'" wcs3='CRVAL1  = 150' wcs4='CRVAL2  = 2'

# --- headers of images

while IFS='|' read -r card reason; do
    begin "tile that says $card"
    make_fits tile tile.fits "$card"
    expect 3 "^rextract: tile\.fits.*$reason" tile.fits $none
done <<'cards'
NAXIS   = 999|missing NAXISn keywords
NAXIS   = -1|illegal NAXIS keyword value
NAXIS   = 2147483648|illegal NAXIS keyword value
NAXIS1  = 9223372036854775807|NAXIS1 = 9223372036854775807 is no whole number of at most 18 digits
NAXIS1  = 18446744073709551615|NAXIS1 = 18446744073709551615 is no whole number
BITPIX  = -18446744073709551616|BITPIX = -18446744073709551616 is no whole number
NAXIS2  = 1000000000|96 x 1000000000 pixels, which no tile has
BITPIX  = 0|illegal BITPIX
BITPIX  = -31|illegal BITPIX
BITPIX  = 9999999999|illegal BITPIX
BITPIX  = abc|BITPIX = abc is no whole number
PCOUNT  = 1000000000000|the pixels cannot be read
GCOUNT  = -5|ends before it begins, by its size
BSCALE  = NaN|BSCALE = NaN is no number
BSCALE  = 1E400|BSCALE = 1E400 is no number
BSCALE  = 'text'|BSCALE = 'text' is no number
BSCALE  = '10.0 10'|BSCALE = '10\.0 10' is no number
BSCALE  = ''|BSCALE = '' is no number
BSCALE  = 10,0|BSCALE = 10,0 is no number
BSCALE  =|BSCALE =  is no number
BZERO   = '32,768'|BZERO = '32,768' is no number
BZERO   = -Inf|BZERO = -Inf is no number
BZERO   = 1E308|all 9216 pixels are NaN, BLANK or beyond 1e20
cards

begin 'axes of 1e9 x 1e9 pixels'
make_fits tile tile.fits 'NAXIS1  = 1000000000' 'NAXIS2  = 1000000000'
expect 3 '^rextract: tile\.fits.*1000000000 x 1000000000 pixels, which no tile has' tile.fits $none

begin 'axes of 1e9 x 1e9 pixels in an extension are told, and the other is done'
make_fits extensions tile.fits 'NAXIS1  = 1000000000' 'NAXIS2  = 1000000000'
leaves test.cat
says 3
expect_exactly 0 'warning: tile\.fits\[2\]: skipped: .*1000000000 x 1000000000' tile.fits $none -c "$top/config/default.sex" \
    -PARAMETERS_NAME "$top/config/default.param" -FILTER_TYPE CONV -FILTER N

begin 'a file of nothing but a hole, as long as its header says'
make_fits tile t.fits 'NAXIS1  = 1000000' 'NAXIS2  = 1000000' && head -c 2880 t.fits >tile.fits && rm t.fits
if grep -q __asan_init "$rextract"; then
    skip 'the address sanitizer ends a program that asks for so much memory'
elif truncate -s 4100G tile.fits 2>/dev/null; then
    timeout 60 "$rextract" tile.fits $none -VERBOSE_TYPE QUIET >../out 2>../err </dev/null # run() would read all of it
    echo $? >../code
    : >tile.fits && list_files >../before
    [ "$active" = 0 ] || judge 4 '^rextract: .*out of memory asking for [0-9]{13} bytes'
else
    skip 'no files with holes here'
fi

begin 'a header of megabytes without END'
make_fits tile t.fits && head -c 400 t.fits >tile.fits && rm t.fits
head -c 8000000 /dev/zero | tr '\000' ' ' >>tile.fits
expect 3 '^rextract: tile\.fits: its header has no END' tile.fits $none

begin 'a header of megabytes'
make_fits tile t.fits && head -c 400 t.fits >tile.fits
head -c 2001200 /dev/zero | tr '\000' ' ' >>tile.fits && printf '%-80s' END >>tile.fits
head -c $((2880 * 696 - 400 - 2001200 - 80)) /dev/zero | tr '\000' ' ' >>tile.fits && tail -c +2881 t.fits >>tile.fits && rm t.fits
expect 0 '' tile.fits $no_catalog

# --- world coordinates that are none: told, and no reason to stop

while read -r cards; do
    begin "world coordinates with $cards"
    make_fits tile tile.fits "$wcs1" "$wcs2" "$wcs3" "$wcs4" 'CD2_2   = 1E-4' 'CD1_1   = 1E-4' "${cards%%;*}" "${cards#*;}"
    expect 0 '' tile.fits $no_catalog
done <<'cards'
CD1_1   = 0;CD2_2   = 0
CD1_1   = NaN;CD2_2   = 1E400
CD1_1   = 1E300;CRPIX1  = 1E300
CRVAL1  = NaN;CRVAL2  = 1E300
WCSAXES = 99999;WCSAXESA= 99999
WCSAXES = 2147483647;WCSAXES = 2147483647
WCSAXES = -1;WCSAXES = -1
CTYPE99 = 'X';PV99_99 = 1
CTYPE1  = 'RA---%s%n';CUNIT1  = '%n%n'
A_ORDER = 999999999;B_ORDER = 2147483647
A_ORDER = -3;B_ORDER = 9
PV1_39  = NaN;PV2_1   = 1E300
CPDIS1  = 'Polynomial';DP1     = 'NAXES: 2147483647'
CTYPE1  = 'RA---TAB';PS1_0   = '/etc/passwd'
LONPOLE = 1E300;LATPOLE = NaN
GAIN    = NaN;SATURATE= -1E400
cards

# --- tables and compressed images

while IFS='|' read -r card reason; do
    begin "reference that says $card"
    make_fits tile tile.fits
    make_fits table ref.fits "$card"
    expect 3 "^rextract: ref\.fits.*$reason" tile.fits $no_catalog -REFERENCE_NAME ref.fits
done <<'cards'
NAXIS2  = 1099511627776|is cut off: the header says 13194139533312 bytes
NAXIS1  = 1099511627776|holds no table
NAXIS2  = 9223372036854775807|NAXIS2 = 9223372036854775807 is no whole number
PCOUNT  = 9223372036854775807|PCOUNT = 9223372036854775807 is no whole number
PCOUNT  = -1|the table does not begin with XTENSION, 
TFIELDS = 999|holds no table
TFIELDS = 1000|the table does not begin with XTENSION, 
TFIELDS = -1|the table does not begin with XTENSION, 
TFORM1  = '9999999999E'|holds no table
TFORM1  = '9223372036854775807D'|holds no table
TFORM1  = '1QE(9999999999)'|holds no table
TFORM1  = '-5E'|holds no table
TFORM1  = '4A0'|the table cannot be read: bad first element number
TFORM1  = '999999999X'|holds no table
TFORM1  = 'ZZZ'|holds no table
cards

# As long as the card it takes the place of.
while IFS='|' read -r card reason; do
    begin "compressed tile that says $card"
    LC_ALL=C sed "s,\(^\|[^A-Z]\)${card%=*}= .\{20\},\1$(printf '%-8s= %20s' "${card%=*}" "${card#*=}")," "$top/tests/data/sim.fits.fz" >tile.fits.fz
    expect 3 "^rextract: tile\.fits\.fz.*$reason" tile.fits.fz $none
done <<'cards'
ZNAXIS1 =1000000000|this HDU cannot be read, and none before it holds a 2-D image
ZNAXIS1 =-1|the image has -1 x 512 pixels
ZNAXIS2 =2147483648|this HDU cannot be read, and none before it holds a 2-D image
ZNAXIS  =999|this HDU cannot be read, and none before it holds a 2-D image
ZTILE1  =0|ZTILE1 of the compressed image is no size
ZTILE1  =-512|ZTILE1 of the compressed image is no size
ZTILE1  =9223372036854775807|ZTILE1 = 9223372036854775807 is no whole number
ZTILE2  =1000000000|this HDU cannot be read, and none before it holds a 2-D image
ZBITPIX =7|ZBITPIX = 7 of the compressed image is no kind of pixels
ZVAL1   =0|ZVAL1 of the compressed image is no size
ZVAL1   =-32|ZVAL1 of the compressed image is no size
ZVAL2   =2147483647|the compressed image is damaged
NAXIS2  =1099511627776|this HDU cannot be read, and none before it holds a 2-D image
PCOUNT  =9223372036854775807|PCOUNT = 9223372036854775807 is no whole number
TFIELDS =999|this HDU cannot be read, and none before it holds a 2-D image
cards

begin 'compressed tile without a size of blocks, in gzip'
LC_ALL=C sed 's,ZVAL1   = .\{20\},ZVAL1   =                    0,' "$top/tests/data/sim.fits.fz" | gzip -n >tile.fits.gz
expect 3 '^rextract: tile\.fits\.gz\[1\]: ZVAL1 of the compressed image' tile.fits.gz $none

begin 'compressed tile without a size of tiles, in gzip'
LC_ALL=C sed 's,ZTILE2  = .\{20\},ZTILE2  =                    0,' "$top/tests/data/sim.fits.fz" | gzip -n >tile.fits.gz
expect 3 '^rextract: tile\.fits\.gz\[1\]: ZTILE2 of the compressed image' tile.fits.gz $none

# Cards that cfitsio finds and others do not, or the other way round, in the place of ZVAL1 (no card is longer than 80).
while IFS='|' read -r card reason; do
    begin "compressed tile with a card $card"
    LC_ALL=C sed "s#ZVAL1   = .\{70\}#$(printf '%-80s' "$card")#" "$top/tests/data/sim.fits.fz" >tile.fits.fz
    expect 3 "^rextract: tile\.fits\.fz\[1\]: .*$reason" tile.fits.fz $none
done <<'cards'
HIERARCH ZVAL1 = 0|the card 'HIERARCH ZVAL1 = 0' is ZVAL1 to some programs
HIERARCH BLANK = (1,22222222222222222222222222222222222222222222222222)|longer than any of its kind
ZVAL1  X= 0|the card 'ZVAL1  X= 0' is ZVAL1
ZVAL1=0|is ZVAL1 to some programs
ZVAL1   = 9E-1|ZVAL1 of the compressed image is no size
ZVAL2   = 7|ZVAL2 is there twice, and not the same
TFORM01 = '1PI'|is TFORM01 to some programs
cards

begin 'one tile with such a card does not end a list'
LC_ALL=C sed "s,ZVAL1   = .\{70\},$(printf '%-80s' 'HIERARCH ZVAL1 = 0')," "$top/tests/data/sim.fits.fz" >a.fits.fz
make_fits tile b.fits && printf 'a.fits.fz\nb.fits\n' >tiles.list
leaves b.cat
expect 8 '^rextract: tiles\.list: 1 of 2 tiles failed; the others are done' @tiles.list $none -CATALOG_NAME '{tile}.cat'

begin 'values in other columns, small letters and no slash are what they are'
LC_ALL=C sed "s,ZCMPTYPE= .\{70\},$(printf '%-80s' "ZCMPTYPE=   'RICE_1'"),;s,ZVAL1   = .\{70\},$(printf '%-80s' 'zval1   =32 pixels')," \
    "$top/tests/data/sim.fits.fz" >tile.fits.fz
if [ "$active" = 1 ]; then
    run tile.fits.fz $none -VERBOSE_TYPE QUIET -CATALOG_NAME ../odd.cat
    run "$top/tests/data/sim.fits.fz" $none -VERBOSE_TYPE QUIET -CATALOG_NAME ../same.cat
    grep -v '^#' ../odd.cat >../odd && grep -v '^#' ../same.cat | cmp - ../odd >>../err
    judge 0 ''
fi

# --- names: what cfitsio would make of them must not happen, and no shell may see them. `pwned` would be left
# behind, and so would any other file; nothing listens on port 1.

for odd in http://127.0.0.1:1/t.fits https://127.0.0.1:1/t.fits ftp://127.0.0.1:1/t.fits root://127.0.0.1:1/t.fits \
    gsiftp://127.0.0.1/t.fits ftps://127.0.0.1/t.fits httpcompress://127.0.0.1:1/t.fits mem://t.fits shmem://h1 stdin stdin:// \
    file://t.fits 't.fits(out.fits)' 't.fits[col Y=1]' 't.fits[1][#row<5]' 't.fits[pix X*2]' 't.fits[bin 2]' '!t.fits' '|cat t.fits' \
    't.fits|' 't.fits;touch pwned' '$(touch pwned)' '`touch pwned`' '~/t.fits' 't.fits%n%n%s' 't.tpl' '../t.fits/../x' /dev/zero /; do
    begin "no such tile: $odd"
    make_fits tile t.fits
    echo 'SIMPLE = T' >t.tpl
    HOME=$PWD expect 3 '^rextract: ' "$odd" $none
done

for odd in http://127.0.0.1:1 ftp://127.0.0.1:1 root://127.0.0.1:1 mem:// shmem:// file:// stdin:// '~' '!x' '|pwned' '$(pwned)' '`pwned`'; do
    begin "a folder of that name holds the tile: $odd"
    mkdir -p "$odd" home && make_fits tile "$odd/t.fits" && echo 'not this one' >home/t.fits
    HOME=$PWD/home expect 0 '' "$odd/t.fits" $no_catalog
    begin "a folder of that name for outputs: $odd"
    mkdir -p "$odd" home && make_fits tile t.fits
    if [ "$active" = 1 ]; then
        HOME=$PWD/home run t.fits $none -VERBOSE_TYPE QUIET -CATALOG_TYPE FITS_1.0 -CATALOG_NAME "$odd/t.cat" \
            -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME "$odd/b.fits"
        [ -s "$odd/t.cat" ] && [ -s "$odd/b.fits" ] && rm "$odd/t.cat" "$odd/b.fits" || echo 'no outputs' >>../err
        judge 0 ''
    fi
done

for odd in '!b.fits' 'b.fits(c.fits)' 'b.fits[compress]' 'b.fits.gz' '|pwned' '$(pwned)' 'b%n%s.fits'; do
    begin "an output of that name, no other: $odd"
    make_fits tile t.fits
    if [ "$active" = 1 ]; then
        run t.fits $no_catalog -VERBOSE_TYPE QUIET -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME "$odd"
        [ "$(head -c 6 "$odd")" = SIMPLE ] && rm "$odd" || echo 'it is not there' >>../err
        judge 0 ''
    fi
done

begin 'names of a list that lead elsewhere'
mkdir in && cd in || exit 2
make_fits tile a.fits
printf '../in/a.fits\n' >tiles.list
leaves a.cat
expect 0 '' @tiles.list $none -CATALOG_NAME '{tile}.cat'
for odd in ../ .. . /; do
    begin "a tile of a list that names no file: $odd"
    echo "$odd" >tiles.list
    expect 2 '^rextract: tiles\.list:1: ' @tiles.list $none -CATALOG_NAME '{tile}.cat'
done

# --- one tile whose name and header are full of it: pages, tables and figures hold it as text, the terminal gets
# one line a message, and gnuplot is the only program that is started.

# hostile_run ARGUMENT...: rextract, with every start of a program and every socket in ../trace where strace works; the leak
# sanitizer does not work under it
hostile_run() {
    if ! grep -q __asan_init "$rextract" && strace -f -o ../trace true 2>/dev/null; then
        strace -f -o ../trace -e trace=execve,socket,connect "$rextract" "$@"
    else
        "$rextract" "$@"
    fi
}

# harmless FOLDER: markup in pages and XML, programs, and control characters in ../err, told there.
harmless() {
    grep -rlE '<img|<script|<b>%s' "$1" --include='*.html' --include='*.svg' --include='*.xml' | sed 's/^/markup in /' >../found
    [ ! -f ../trace ] || grep -E 'execve\(|socket\(|connect\(' ../trace | grep -v 'ENOENT' | sed 1d |
        grep -v 'execve("[^"]*/gnuplot", \["gnuplot", "-d", "figures.gp"\]' >>../found
    LC_ALL=C grep -n "$(printf '[\001-\010\013-\037\177]\\|\302[\200-\237]')" ../err >>../found
    LC_ALL=C grep -v '^rextract: ' ../err >>../found
    if command -v xmllint >/dev/null; then
        find "$1" -name '*.html' | while read -r page; do
            xmllint --html --noout "$page" 2>&1 | grep -v 'Tag .* invalid' | grep 'error :'
        done >>../found
        find . -name '*.xml' | while read -r page; do xmllint --noout "$page" 2>&1; done >>../found
    fi
    mv ../found ../err
}

evil=$(printf '<img src=x onerror=alert(1)>`touch pwned`$(touch pwned)%%s%%n"; system("touch pwned") #'\'' | touch pwned\033]0;x\007\033[31m\n\302\233x')
begin 'markup, commands and escapes in names and headers'
make_fits tile "$evil.fits" "OBJECT  = '<script>alert(1)</script>'" "EXTNAME = '<b>%s%n\`touch pwned\`'" \
    'FILTER  = <script>' "TELESCOP= '$(printf '\033[31m\nx')'"
make_fits table "ref$evil.fits" "EXTNAME = '<script>alert(1)</script>'" "TTYPE1  = 'X_IMAGE'"
if [ "$active" = 1 ]; then
    list_files >../before
    mkdir out
    hostile_run "$evil.fits" -RESTORE_TYPE NONE,RL -PSF_TYPE MOFFAT -PSF_FWHM 3 -RL_NITER 3 -NTHREADS 1 \
        -REFERENCE_NAME "ref$evil.fits" -QA_NAME out/qa -CATALOG_TYPE ASCII_VOTABLE -CATALOG_NAME out/c.xml \
        -RECORD_NAME out/r.record -VERBOSE_TYPE FULL >../out 2>../err </dev/null
    echo $? >../code
    "$programs/rextract-survey" out/r.record -OUTPUT_NAME out/survey >../out 2>&1 || echo 'rextract: no roll-up' >>../err
    harmless out
    : >../out
    leaves out
    judge 0 ''
fi
