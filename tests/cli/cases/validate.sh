# rextract-validate: what is printed, refused, and what a campaign leaves.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

# validates NAME: a case about this program.
validates() {
    begin "rextract-validate: $1"
    of rextract-validate
}

# A campaign of seconds.
make_campaign() {
    cat "$top/tests/data/campaign.conf" - >tiny.conf <<'END'
OUTPUT_NAME    report
JOURNAL_NAME   journal
END
}

# --- printed

validates 'no argument'
says 3
expect_exactly 2 '^usage: rextract-validate \[-c\] FILE'

validates 'help'
prints 'rextract-validate\(1\)'
expect_exactly 0 '' -h

validates 'version'
prints '^Rextract version [0-9]+\.[0-9]+'
expect_exactly 0 '' --version

validates 'default campaign'
prints '^CAMPAIGN_TYPE +PHOTOMETRY '
expect_exactly 0 '' -d

validates 'extended campaign'
prints '^STAGE\.ASSOC_RADIUS +2\.0 '
expect_exactly 0 '' -dd

# --- refused on the command line

validates 'two campaign files'
expect 2 "^rextract-validate: 'b\.conf' is one configuration file too many, after 'a\.conf'; give one$" a.conf b.conf

validates 'two campaign files, one by -c'
expect 2 "^rextract-validate: 'b\.conf' is one configuration file too many, after 'a\.conf'; give one$" -c b.conf a.conf

validates 'unknown keyword'
expect 2 "^rextract-validate: unknown keyword '-CAMPAIN_TYPE'; did you mean -CAMPAIGN_TYPE\?$" -CAMPAIN_TYPE RESTORATION

validates 'unknown keyword of the simulator'
expect 2 "unknown keyword '-SIM\.STAR_CONT'; did you mean -SIM\.STAR_COUNT\?$" -SIM.STAR_CONT 3

validates 'keyword of the simulator without its prefix'
expect 2 "unknown keyword '-STAR_COUNT'; did you mean -SIM\.STAR_COUNT\?$" -STAR_COUNT 3

validates 'bad value of the stage'
expect 2 "^rextract-validate: -STAGE\.DETECT_MINAREA: 'few' is not a number$" -STAGE.DETECT_MINAREA few

validates 'range of the simulator the wrong way round'
expect 2 '^rextract-validate: -SIM\.STAR_MAG: 22 is above 18' -SIM.STAR_MAG 22,18

for shard in 0/2 3/2 1/0 2 1/x 1/2/3 -1/2; do
    validates "SHARD $shard"
    expect 2 '^rextract-validate: -SHARD: ' -SHARD "$shard"
done

validates 'restorer twice'
expect 2 '^rextract-validate: -RESTORE_TYPE: RL is named twice' -RESTORE_TYPE RL,NONE,RL

validates 'unknown restorer'
expect 2 "unknown word 'RL_BLID' \(did you mean RL_BLIND\?\)" -RESTORE_TYPE RL_BLID

validates 'stars injected nowhere'
expect 2 '^rextract-validate: -TILE_NAME: is empty' -FIELDS INJECTED

validates 'a campaign that went'
expect 2 'CAMPAIGN_TYPE: FLUXES is no longer offered; give PHOTOMETRY with FLUXES AUTO,TEMPLATE' -CAMPAIGN_TYPE FLUXES

validates 'a scene that went'
expect 2 'SCENES: PLATEAU is no longer offered; validation/pixels\.py has plateaus' -SCENES STARS,PLATEAU

validates 'a keyword that went'
expect 2 'RING_SNR is no longer a keyword; validation/pixels\.py has bright stars' -RING_SNR 5,6

validates 'fluxes of an unknown kind'
expect 2 "unknown word 'TEMPLAT' \(did you mean TEMPLATE\?\)" -FLUXES AUTO,TEMPLAT

validates 'magnitudes without step'
expect 2 '^rextract-validate: -MAGNITUDES: the step 0 must be above 0' -MAGNITUDES 18,22,0

validates 'no number of scenes for the size'
expect 2 '^rextract-validate: -TILES: has no second number' -SIZE PAPER -TILES 3

# --- refused in a campaign file

validates 'campaign file that is not there'
expect 2 '^rextract-validate: absent\.conf: cannot be opened: No such file' absent.conf

validates 'campaign file that is a folder'
mkdir my.conf
expect 2 '^rextract-validate: my\.conf: is a folder' my.conf

validates 'campaign file with an unknown keyword'
printf 'SEED 1\nSTAGE.DETECT_TRESH 3\n' >my.conf
expect 2 "^rextract-validate: my\.conf:2: unknown keyword 'STAGE\.DETECT_TRESH'; did you mean STAGE\.DETECT_THRESH\?$" my.conf

validates 'campaign file with a bad value'
printf 'SIM.PSF_FWHM wide\n' >my.conf
expect 2 "^rextract-validate: my\.conf:1: SIM\.PSF_FWHM: 'wide' is not a number$" -c my.conf

validates 'campaign file with a bad relation'
printf 'SEED 1\n\nSIM.NOISE_TYPE CCD\nSIM.GAIN 0\n' >my.conf
expect 2 '^rextract-validate: my\.conf:4: SIM\.GAIN: 0 e-/ADU is no gain' -c my.conf

# --- inputs and outputs

validates 'tile that is not there'
expect 3 'absent\.fits' -FIELDS INJECTED -TILE_NAME absent.fits -TILES 1

validates 'journal that would replace the campaign file'
make_campaign
expect 2 '^rextract-validate: JOURNAL_NAME tiny\.conf is also read' tiny.conf -JOURNAL_NAME tiny.conf

validates 'journal in the folder that the report replaces'
make_campaign
mkdir report && touch report/.rextract
expect 2 '^rextract-validate: report/tiny\.journal lies in the folder report.*OUTPUT_NAME' tiny.conf -OUTPUT_NAME report -JOURNAL_NAME report/tiny.journal

validates 'journal that is another file'
make_campaign
echo 'my diary' >journal
expect 2 '^rextract-validate: journal' tiny.conf

validates 'folder of the journal that cannot be made'
make_campaign
expect 4 '/proc/absent/journal' tiny.conf -JOURNAL_NAME /proc/absent/journal

validates 'report where a file is'
make_campaign
echo old >report
expect 2 'report' tiny.conf

validates 'report in a folder with other things'
make_campaign
mkdir report && echo mine >report/thesis.tex
expect 2 'report' tiny.conf

validates 'folder of the report that cannot be made'
make_campaign
expect 4 'absent' tiny.conf -OUTPUT_NAME /proc/absent/report

validates 'nothing to merge'
make_campaign
expect 3 'shard 1/2 lacks .*no journal' tiny.conf -SHARD 1/2 -MERGE Y

# --- campaigns that run

validates 'a campaign'
make_campaign
leaves report journal
expect 0 '' tiny.conf

validates 'a journal of other settings'
make_campaign
if [ "$active" = 1 ]; then
    timeout 60 "$program" tiny.conf -VERBOSE_TYPE QUIET
    expect 2 '^rextract-validate: journal.*SEED' tiny.conf -SEED 2
fi

validates 'shards merged are the whole, a second time does nothing'
make_campaign
leaves report journal parts.1 parts.2 merged
if [ "$active" = 1 ]; then
    list_files >../before
    {
        timeout 60 "$program" tiny.conf -VERBOSE_TYPE QUIET &&
            cp -r report ../first && cp journal ../journal &&
            timeout 60 "$program" tiny.conf -VERBOSE_TYPE QUIET &&
            cmp journal ../journal && diff -r report ../first &&
            for part in 1 2; do
                timeout 60 "$program" tiny.conf -JOURNAL_NAME parts -SHARD $part/2 -VERBOSE_TYPE QUIET || break
            done &&
            timeout 60 "$program" tiny.conf -JOURNAL_NAME parts -SHARD 2/2 -MERGE Y -OUTPUT_NAME merged -VERBOSE_TYPE QUIET
        echo $? >../code
        diff report/summary.json merged/summary.json
    } >../out 2>../err
    judge 0 ''
fi

validates 'help to a full device'
if [ -c /dev/full ] && [ "$active" = 1 ]; then
    list_files >../before
    "$program" -h >/dev/full 2>../err
    echo $? >../code
    : >../out
    judge 4 '^rextract-validate: standard output cannot be written'
else
    skip 'no /dev/full'
fi
