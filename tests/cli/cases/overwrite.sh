# No output takes the place of another file of the run: every pair of file keywords, as the programs' own tables (-dd) say what
# becomes of each, under names of many kinds.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

# file_keywords: "read NAME", "written NAME" or "folder NAME" for each file keyword of the program; those of parts that have no
# effect in it are no files of its runs.
file_keywords() {
    "$program" -dd | awk '
        function end() {
            if (match(text, /\[(read|written|folder that is replaced)\] *$/)) print substr(text, RSTART + 1, 4) == "read" ? "read" : text ~ /written\] *$/ ? "written" : "folder", name
        }
        /^[A-Z]/ { end(); name = $1; text = "" }
        /^ *#-/ { next }
        { sub(/^ *#/, ""); gsub(/ +/, " "); text = text " " $0 }
        END { end() }'
}

# refused A B NAME CODE: is `said` the refusal of that pair, or of a keyword that has no place in such a run?
refused() {
    grep -Eq -- "($1|$2) .* has no effect" said && return 0
    [ "$4" = 2 ] && grep -Eq 'is also (read|[A-Z])|lies in the folder|has no place in|of simulated fields|about a real tile|needs a reference' said && return 0
    echo "$1, $2 $3: exit code $4: $(tail -n 1 said)"
}

# try A B NAME: does the program refuse to have that name twice, and leave the file?
try() {
    echo kept >same
    timeout 60 "$program" $arguments -$1 same -$2 $3 >/dev/null 2>said
    refused $1 $2 $3 $?
    [ "$(cat same)" = kept ] || echo "$1, $2 $3: the file is gone"
    pairs=$((pairs + 1))
}

# every_pair PROGRAM ARGUMENT...: with which each file keyword has an effect
every_pair() {
    begin "$1: no file of one keyword is written by another${title-}"
    of "$1"
    shift
    arguments=$*
    [ "$active" = 1 ] || return 0
    list_files >../before
    echo kept >same && ln -s same link && ln same hard && mkdir folder && echo kept >folder/in && echo 'not FITS' >tile.fits
    file_keywords >keywords
    pairs=0 number=0
    while read -r role output; do
        case $role.$output in
        read.* | *.SIM.* | *.STAGE.*) continue ;;
        esac
        while read -r other keyword; do
            case $other.$keyword in
            *."$output" | written.*.* | folder.*.*) continue ;;
            esac
            number=$((number + 1))
            case $((number % 4)) in
            0) try "$output" "$keyword" ./same ;;
            1) try "$output" "$keyword" link ;;
            2) try "$output" "$keyword" hard ;;
            *) try "$output" "$keyword" same ;;
            esac
            [ "$role" != folder ] || {
                timeout 60 "$program" $arguments -$output folder -$keyword folder/in >/dev/null 2>said
                refused $output $keyword folder/in $?
            }
        done <keywords
    done <keywords >../err
    [ $pairs -gt 2 ] || echo "only $pairs pairs" >>../err
    [ "$(cat folder/in)" = kept ] || echo 'folder/in is gone' >>../err
    rm -rf same link hard folder keywords said tile.fits
    echo 0 >../code
    : >../out
    judge 0 ''
}

every_pair rextract tile.fits -c /dev/null -RESTORE_TYPE NET -WEIGHT_TYPE MAP_RMS -PSF_TYPE FILE -NOISE_CORRELATION FILE \
    -CHECKIMAGE_TYPE BACKGROUND -WRITE_XML Y -QA_TYPE TILE -SELF_CHECK Y -REFERENCE_NAME ref.fits
every_pair rextract-simulate -PSF_TYPE FILE -INJECT_IMAGE tile.fits
every_pair rextract-validate -SIM.PSF_TYPE FILE -STAGE.WEIGHT_TYPE MAP_RMS -STAGE.PSF_TYPE FILE -STAGE.NOISE_CORRELATION FILE \
    -STAGE.RESTORE_TYPE NET -TILE_NAME tile.fits -FIELDS INJECTED
every_pair rextract-train -INIT_MODEL tile.fits
every_pair rextract-survey tile.fits

begin 'lists: a file that one holds is not written'
of rextract-simulate
make_fits tile cutout.fits && printf '# cut-outs\ncutout.fits # one\n' >cutouts
expect 2 'IMAGE_NAME cutout\.fits is also read, as cutout\.fits' -TEMPLATE_NAME @cutouts -TEMPLATE_COUNT 10 -IMAGE_NAME cutout.fits

begin 'lists: records of a survey'
of rextract-survey
echo '' >a.record && echo a.record >records
expect 2 'MERGED_NAME \./a\.record is also read, as a\.record' @records -MERGED_NAME ./a.record

begin 'an image in a folder of its own with brackets'
mkdir 'night[1]' && make_fits tile 'night[1]/tile.fits'
expect 2 'CATALOG_NAME night\[1\]/tile\.fits is also read' 'night[1]/tile.fits[0]' -CATALOG_NAME 'night[1]/tile.fits'

begin 'a file of a folder that is read'
of rextract-simulate
mkdir cutouts && make_fits tile cutouts/a.fits
expect 2 'IMAGE_NAME cutouts/a\.fits is also read, from the folder cutouts' -TEMPLATE_NAME cutouts -TEMPLATE_COUNT 10 -IMAGE_NAME cutouts/a.fits

begin 'what the configuration of INJECT_CONFIG reads'
of rextract-simulate
make_fits tile tile.fits && make_fits ones weight.fits && printf 'WEIGHT_TYPE MAP_WEIGHT\nWEIGHT_IMAGE weight.fits\n' >my.sex
expect 2 'TRUTH_NAME weight\.fits is also read, as weight\.fits' -INJECT_IMAGE tile.fits -INJECT_CONFIG my.sex -TRUTH_NAME weight.fits

begin 'a device may be named for all'
make_fits tile tile.fits
expect 0 '' tile.fits -c /dev/null -RESTORE_TYPE NONE -CATALOG_NAME /dev/null -PARAMETERS_NAME "$top/config/default.param"

begin 'every keyword that takes a text says whether it names a file'
if [ "$active" = 1 ]; then
    list_files >../before
    # NOWORDS of a text would leave it out of all this
    grep -En '^KEY\(STRINGS?,.*NOWORDS' "$top"/src/config/*.def >../err
    echo 0 >../code
    : >../out
    judge 0 ''
fi

begin 'a reference in the folder of an extension'
make_fits extensions tile.fits && mkdir qa_2 && make_fits table qa_2/ref.fits
expect 2 'qa_2/ref\.fits lies in the folder qa_2, which is replaced as a whole \(QA_NAME\)' tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE NONE \
    -REFERENCE_NAME qa_2/ref.fits -QA_NAME qa
