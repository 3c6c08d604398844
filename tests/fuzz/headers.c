/* headers [-n RUNS] [-f FIRST] [-u] [-k FILE] FOLDER: the seeds in FOLDER, one to three cards of whose headers are replaced or
 * joined by others: a keyword that counts, a value of any kind, written in one of the ways in which a reader could
 * take it for that keyword, or not. Each goes to its target and to another one. The same runs every time.
 *
 * Beyond what the targets hold, cfitsio must read from every header that it is shown what we read from it. -u: cfitsio
 * is shown the files as they are, to see what the guard keeps from it. -k: the file of the first run is kept in FILE.
 *
 * A process does many runs; when one kills it, that is a crash, and a new one goes on behind it. */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fitsio.h>

#include "base/random.h"
#include "fuzz.h"
#include "io/cards.h"
#include "io/fits_file.h"
#include "io/fits_read.h"

enum { CARD = 80, BLOCK = 2880, MOST_SEEDS = 100, LONGEST_RUN = 20 /* seconds, with sanitizers */ };

typedef void target(const uint8_t *data, size_t size);
static const struct {
    const char *name;
    target *run;
} targets[] = {{"tile", fuzz_tile},
               {"maps", fuzz_maps},
               {"psf", fuzz_psf},
               {"table", fuzz_table},
               {"templates", fuzz_templates}};
enum { TARGETS = sizeof targets / sizeof *targets };

typedef struct seed {
    char *data;
    size_t size;
    int target;
} seed;

/* '#' is a number. The last are of world coordinates, which wcslib reads. */
static const char *const keys[] = {
    "BITPIX",   "NAXIS",   "NAXIS#",   "PCOUNT",   "GCOUNT",   "BSCALE",  "BZERO",    "BLANK",    "TFIELDS",
    "THEAP",    "TBCOL#",  "TSCAL#",   "TZERO#",   "TNULL#",   "ZBITPIX", "ZNAXIS",   "ZNAXIS#",  "ZPCOUNT",
    "ZGCOUNT",  "ZTILE#",  "ZVAL#",    "ZDITHER0", "ZBLANK",   "ZSCALE",  "ZZERO",    "ZIMAGE",   "ZTENSION",
    "ZCMPTYPE", "ZNAME#",  "ZQUANTIZ", "GROUPS",   "TFORM#",   "TTYPE#",  "TDIM#",    "XTENSION", "SIMPLE",
    "END",      "EXTEND",  "EXTNAME",  "EXTVER",   "EXTLEVEL", "INHERIT", "TUNIT#",   "CONTINUE", "LONGSTRN",
    "CHECKSUM", "DATASUM", "TFORM0#",  "TNULL+#",  "THEAPX",   "GAIN",    "HDUNAME",  "BLOCKED",  "ZMASKCMP",
    "NAXIS0#",  "CTYPE1",  "CTYPE2",   "WCSAXES",  "AMDX#",    "AMDY#",   "CNPIX#",   "PPO#",     "XPIXELSZ",
    "PLTDECSN", "PLATEID", "A_0_#",    "B_#_1",    "AP_1_#",   "A_ORDER", "WAT1_00#", "WAT2_00#", "PV1_#",
    "PV2_#",    "CD1_#",   "CRVAL#"};
enum {
    KEYS = sizeof keys / sizeof *keys,
    COUNTING = 25
}; /* the first of them: numbers by which memory and pixels are made */

/* Short, longer and longest. */
static const char *const values[] = {
    "0",          "1",        "-1",         "2",          "8",          "32",         "9E-1",
    "1.5",        "0.",       "1E5",        "1.D0",       "2147483647", "2147483648", "'RICE_1'",
    "'RICE_1  '", "'GZIP_1'", "'GZIP_2'",   "'PLIO_1'",   "'RICE_ONE'", "' RICE_1'",  "'rice_1'",
    "RICE_1",     "T",        "F",          "'T'",        "",           "'",          "'it''s",
    "'0'",        "'0.5 '",   "NaN",        "inf",        "0x10",       "1 2",        "1/2",
    "+1",         "(1, 2",    "'NONE'",     "'1PB(9)'",   "'0PB'",      "'9A1'",      "'1PI'",
    "'E'",        "'(3,4)'",  "'(0,0)'",    "(2,2)",      "'BINTABLE'", "'TABLE'",    "'IMAGE'",
    "BINTABLE",   "'ZSCALE'", "'NOISEBIT'", "'RA---TAN'", "'DEC--ZEA'", "'RA---TNX'", "'RA---ZPX'",
    "'-'",        "4096",     ".1"};
static const char *const longer[] = {"-2147483648",           "'HCOMPRESS_1'",       "'NOCOMPRESS'",
                                     "'NO_DITHER'",           "'2147483647E'",       "' BINTABLE'",
                                     "'BLOCKSIZE'",           "9223372036854775807", "-9223372036854775808",
                                     "-18446744073709551616", "( 10 / length (1)",   "'1QB(2147483647)'",
                                     "'99999999999A'",        "'COMPRESSED_DATA'",   "'UNCOMPRESSED_DATA'"};
static const char *const longest[] = {
    "99999999999999999999999999",
    "(1,22222222222222222222222222222222222222222222222222)",
    "'''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''",
    "LLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLL",
    "'LLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLL'",
    "257257257257257257257257  12",
    "'SUBTRACTIVE_DITHER_2'",
    "'(9223372036854775807,2)'",
    "'GZIP_COMPRESSED_DATA'",
    "'wtype=tnx axtype=ra lngcor = \"3. 2. 2. 2. 0 1 0 1 1 2 3 \"'",
    "'wtype=zpx projp1=1 projp99=2 lngcor = \"1. 9. 9. 7. 0 1 0 1 1 2 3 \"'"};
#define COUNT(list) (sizeof(list) / sizeof *(list))
enum { SHORT = COUNT(values), SHORTER = SHORT + COUNT(longer), VALUES = SHORTER + COUNT(longest) };

static const char *value_of(uint32_t v)
{
    return v < SHORT ? values[v] : v < SHORTER ? longer[v - SHORT] : longest[v - SHORTER];
}

/* How a card is written: what stands before the keyword, which may be filled up to 8 characters, before its value, and
 * behind that. */
static const struct {
    const char *before, *between, *behind;
    bool is_filled;
} forms[] = {{"", "= ", "", true},
             {"", "=", "", true},
             {"", " ", "", true},
             {"", "=       ", "", true},
             {"", "= ", " words", true},
             {"", "= ", "/", true},
             {"", "X= ", "", true},
             {"", "=\t", "", true},
             {"", "\v= ", "", true},
             {"HIERARCH ", " = ", "", false},
             {"HIERARCH   ", "= ", "", false},
             {"HIERARCH ", "=", "", false},
             {"hierarch ", " = ", "", false},
             {"", "= ", "", false},
             {"", "  X= ", "", false},
             {"", "=", "", false},
             {"", "\t= ", "", false},
             {" ", " = ", "", false},
             {"COMMENT ", " = ", "", false}};
enum { FORMS = sizeof forms / sizeof *forms, SMALL = FORMS, NUL, WAYS };

typedef struct dice {
    uint64_t run, next;
} dice;

static uint32_t below(dice *r, uint32_t n)
{
    uint32_t word[4];
    rx_random_block(47, r->run, r->next++, word);
    return word[0] % n;
}

/* --- a header as cards --- */

static bool begins_header(const char *block)
{
    return strncmp(block, "SIMPLE  ", 8) == 0 || strncmp(block, "XTENSION", 8) == 0;
}

/* The last header of the file, or the one before: cards without END into `cards`, where it begins and its data do. */
static void find_header(const seed *s, dice *r, size_t *begin, size_t *data)
{
    size_t at[16], n = 0;
    for (size_t k = 0; k + BLOCK <= s->size && n < 16; k += BLOCK)
        if (begins_header(s->data + k))
            at[n++] = k;
    fuzz_require(n > 0, "a seed has a header");
    *begin = at[below(r, 4) == 0 ? below(r, (uint32_t)n) : n - 1];
    for (*data = *begin; strncmp(s->data + *data, "END     ", 8) != 0; *data += CARD)
        continue;
}

static void make_card(dice *r, const char *cards, long ncards, char card[CARD])
{
    char key[20], value[CARD + 1] = "", text[300] = "";
    const char *name = keys[below(r, KEYS)], *own = cards + below(r, (uint32_t)ncards) * CARD;
    const uint32_t way = below(r, WAYS), n = 1 + below(r, below(r, 4) == 0 ? 999 : 3);
    snprintf(key, sizeof key, "%.*s", (int)strcspn(name, "#"), name);
    if (strchr(name, '#') != NULL)
        snprintf(key + strlen(key), sizeof key - strlen(key), "%u%s", n, strchr(name, '#') + 1);
    if (below(r, 2) == 0)
        snprintf(key, sizeof key, "%.*s", (int)(strcspn(own, " =") < 8 ? strcspn(own, " =") : 8), own);
    const long there = rx_cards_find(cards, (size_t)ncards, key);
    if (there >= 0 && below(r, 4) == 0) /* as it was, in another way */
        snprintf(value, sizeof value, "%.*s", CARD - 10, cards + there * CARD + 10);
    else
        snprintf(value, sizeof value, "%s", value_of(below(r, VALUES)));
    value[strcspn(value, "/")] = '\0';
    const size_t f = way < FORMS ? way : 0;
    snprintf(text, sizeof text, "%s%-*s%s%s%s", forms[f].before, forms[f].is_filled ? 8 : 0, key,
             forms[f].between, value, forms[f].behind);
    for (char *c = text; way == SMALL && *c != '\0'; c++)
        *c = *c >= 'A' && *c <= 'Z' ? (char)(*c - 'A' + 'a') : *c;
    const size_t length = strlen(text);
    memset(card, ' ', CARD);
    memcpy(card, text, length < CARD ? length : CARD);
    if (way == NUL)
        card[strlen(key)] = '\0';
}

/* The seed with other cards, into dst. */
static void mutate(const seed *s, uint64_t run, rx_text *dst)
{
    dice r = {.run = run};
    size_t begin, end;
    rx_text cards = {0};
    find_header(s, &r, &begin, &end);
    rx_text_add_bytes(&cards, s->data + begin, end - begin);
    for (uint32_t k = 0, n = 1 + below(&r, 3); k < n; k++) {
        char card[CARD];
        const uint32_t ncards = (uint32_t)(cards.length / CARD);
        make_card(&r, cards.data, ncards, card);
        const bool replaces = below(&r, 2) == 0;
        char key[9] = "";
        memcpy(key, card, 8);
        key[strcspn(key, " =")] = '\0';
        const long same = rx_cards_find(cards.data, ncards, key);
        size_t at = same >= 0 && below(&r, 4) > 0 ? (size_t)same : below(&r, ncards + 1);
        if (replaces && at < ncards) {
            memcpy(cards.data + at * CARD, card, CARD);
            continue;
        }
        at += same >= 0 && below(&r, 2) == 0 && at < ncards;
        rx_text_add_bytes(&cards, card, CARD);
        memmove(cards.data + (at + 1) * CARD, cards.data + at * CARD, (ncards - at) * CARD);
        memcpy(cards.data + at * CARD, card, CARD);
    }
    rx_text_add_bytes(dst, s->data, begin);
    rx_text_add_bytes(dst, cards.data, cards.length);
    char blank[CARD];
    memset(blank, ' ', CARD);
    memcpy(blank, "END", 3);
    do {
        rx_text_add_bytes(dst, blank, CARD);
        memset(blank, ' ', 3);
    } while (dst->length % BLOCK != 0);
    end = (end / BLOCK + 1) * BLOCK;
    rx_text_add_bytes(dst, s->data + end, s->size - end);
    fuzz_require(!cards.failed && !dst->failed, "there is memory");
    rx_text_free(&cards);
}

/* --- runs --- */

/* Does cfitsio look for the keyword in such an HDU? */
static bool counts(const char *key, int type, bool is_compressed)
{
    const bool of_image = key[0] == 'B' && key[1] != 'I';
    return key[0] == 'Z'   ? is_compressed
           : key[0] == 'T' ? type != IMAGE_HDU
                           : !of_image || type == IMAGE_HDU || is_compressed;
}

/* Keywords whose values are numbers, in an HDU that cfitsio has read: the same for it and for us. */
static void compare(fitsfile *file)
{
    rx_text cards = {0};
    int n = 0, failed = 0, type = 0;
    fits_get_hdu_type(file, &type, &failed);
    const bool is_compressed = fits_is_compressed_image(file, &failed) != 0;
    fits_get_hdrspace(file, &n, NULL, &failed);
    for (int i = 1; i <= n && !failed; i++) {
        char card[FLEN_CARD] = "", whole[CARD + 1];
        fits_read_record(file, i, card, &failed);
        snprintf(whole, sizeof whole, "%-*s", CARD, card);
        for (int k = 0; k < CARD; k++)
            whole[k] = whole[k] >= ' ' ? whole[k] : '?'; /* as rx_fits_read_cards() gives them */
        rx_text_add_bytes(&cards, whole, CARD);
    }
    for (size_t k = 0; k < COUNTING && !failed; k++)
        for (int number = 1; number <= (strchr(keys[k], '#') != NULL ? 3 : 1); number++) {
            char key[20];
            double ours = 0, its = 0;
            int absent = 0;
            snprintf(key, sizeof key, "%.*s", (int)strcspn(keys[k], "#"), keys[k]);
            if (strchr(keys[k], '#') != NULL)
                snprintf(key + strlen(key), sizeof key - strlen(key), "%d", number);
            fits_read_key(file, TDOUBLE, key, &its, NULL, &absent);
            fits_clear_errmsg();
            if (counts(key, type, is_compressed) &&
                rx_cards_number(cards.data, (long)(cards.length / CARD), key, &ours))
                fuzz_require(absent == 0 && its == ours, key);
        }
    rx_text_free(&cards);
}

/* 1: it was read. */
static int open_file(const rx_text *bytes, bool unguarded)
{
    const char *path = fuzz_file(0, bytes->data, bytes->length);
    rx_fits_source source = {0};
    int failed = 0, n = 0;
    if (unguarded) {
        fits_open_diskfile(&source.file, path, READONLY, &failed);
        for (int hdu = 1; failed == 0 && hdu < 9 && fits_movabs_hdu(source.file, hdu, NULL, &failed) == 0;
             hdu++)
            n++;
        rx_fits_done(&source);
        return n > 0;
    }
    if (rx_fits_open(path, &source, NULL) != RX_OK)
        return 0;
    for (int hdu = 0; hdu < 9 && rx_fits_goto(&source, hdu, NULL) == RX_OK; hdu++)
        compare(source.file);
    rx_fits_done(&source);
    return 1;
}

static int one(const seed *seeds, int n, uint64_t run, bool unguarded)
{
    const seed *s = &seeds[run % (uint64_t)n];
    rx_text bytes = {0}, packed = {0};
    alarm(LONGEST_RUN);
    mutate(s, run, &bytes);
    const int read = open_file(&bytes, unguarded);
    if (!unguarded) {
        const int other = (int)(run / 4 % TARGETS);
        if (s->target == 0 && run % 8 == 0) {
            rx_text_add(&packed, "GZIP\n");
            rx_text_add_bytes(&packed, bytes.data, bytes.length);
            fuzz_tile((uint8_t *)packed.data, packed.length);
        }
        targets[s->target].run((uint8_t *)bytes.data, bytes.length);
        if (other != s->target && run % 4 == 0)
            targets[other].run((uint8_t *)bytes.data, bytes.length);
    }
    rx_text_free(&packed);
    rx_text_free(&bytes);
    return read;
}

/* Is not one of the seeds that are lines? */
static int is_plain(const struct dirent *entry)
{
    return entry->d_name[0] != '.' && strstr(entry->d_name, "-lines") == NULL &&
           strstr(entry->d_name, "-gzip") == NULL;
}

static int load(const char *folder, seed dst[MOST_SEEDS])
{
    int n = 0;
    for (int t = 0; t < TARGETS; t++) {
        struct dirent **entries = NULL;
        char path[1100];
        snprintf(path, sizeof path, "%.500s/%s", folder, targets[t].name);
        const int found = scandir(path, &entries, is_plain, alphasort);
        fuzz_require(found > 0, "there are seeds");
        for (int i = 0; i < found; i++) {
            snprintf(path, sizeof path, "%.500s/%s/%.255s", folder, targets[t].name, entries[i]->d_name);
            FILE *file = fopen(path, "rb");
            char *data = malloc(1 << 20);
            fuzz_require(file != NULL && data != NULL && n < MOST_SEEDS, "a seed can be read");
            const size_t size = fread(data, 1, 1 << 20, file);
            fclose(file);
            free(entries[i]);
            if (size >= BLOCK && begins_header(data))
                dst[n++] = (seed){.data = data, .size = size, .target = t};
            else
                free(data);
        }
        free(entries);
    }
    return n;
}

/* What a process has come to, for the one that started it. */
typedef struct progress {
    volatile uint64_t run;
    volatile long read, refused;
} progress;

int main(int argc, char **argv)
{
    uint64_t runs = 10000, first = 0;
    bool unguarded = false;
    const char *keep = NULL;
    long crashes = 0;
    seed seeds[MOST_SEEDS];
    for (int option; (option = getopt(argc, argv, "n:f:uk:")) != -1;) {
        if (option == 'u')
            unguarded = true;
        else if (option == 'k')
            keep = optarg;
        else if (option == 'n')
            runs = strtoull(optarg, NULL, 10);
        else if (option == 'f')
            first = strtoull(optarg, NULL, 10);
        else
            return 2;
    }
    if (optind + 1 != argc) {
        fputs("usage: headers [-n RUNS] [-f FIRST] [-u] [-k FILE] FOLDER\n", stderr);
        return 2;
    }
    const int n = load(argv[optind], seeds);
    if (keep != NULL) {
        rx_text bytes = {0};
        mutate(&seeds[first % (uint64_t)n], first, &bytes);
        FILE *file = fopen(keep, "wb");
        fuzz_require(file != NULL && fwrite(bytes.data, 1, bytes.length, file) == bytes.length &&
                         fclose(file) == 0,
                     "a file can be kept");
        rx_text_free(&bytes);
    }
    progress *p = mmap(NULL, sizeof *p, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    fuzz_require(p != MAP_FAILED, "there is memory");
    for (uint64_t next = first; next < first + runs;) {
        int state = 0;
        fflush(stdout);
        const pid_t child = fork();
        if (child == 0) {
            for (p->run = next; p->run < first + runs; p->run = p->run + 1) {
                const int read = one(seeds, n, p->run, unguarded);
                p->read += read;
                p->refused += !read;
            }
            exit(0);
        }
        fuzz_require(child > 0 && waitpid(child, &state, 0) == child, "a process can be started");
        next = p->run + 1;
        if (WIFEXITED(state) && WEXITSTATUS(state) == 0)
            break;
        crashes++;
        fprintf(stderr, "run %llu: %s %d\n", (unsigned long long)p->run,
                WIFSIGNALED(state) ? "signal" : "exit",
                WIFSIGNALED(state) ? WTERMSIG(state) : WEXITSTATUS(state));
    }
    printf("%llu headers: %ld read, %ld refused, %ld crashes\n", (unsigned long long)runs, p->read,
           p->refused, crashes);
    for (int i = 0; i < n; i++)
        free(seeds[i].data);
    return crashes == 0 ? 0 : 1;
}
