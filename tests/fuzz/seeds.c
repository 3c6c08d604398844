/* seeds FOLDER TEXTS: for every target a folder FOLDER/<target> of small inputs to start from, and a dictionary
 * FOLDER/<target>.dict. They are made here, by the project's own writers where there is one, or stand in TEXTS. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fitsio.h>

#include "catalog/catalog.h"
#include "catalog/columns.h"
#include "config/keyword.h"
#include "fuzz.h"
#include "io/fits_write.h"
#include "nn/psfnet.h"
#include "quality/metrics.h"
#include "stage/provenance.h"
#include "train/state.h"

enum { SIDE = 12 };

static void put(const char *folder, const char *target, const char *name, const void *data, size_t size)
{
    char path[600];
    snprintf(path, sizeof path, "%s/%s/%s", folder, target, name);
    FILE *file = fopen(path, "wb");
    fuzz_require(file != NULL && fwrite(data, 1, size, file) == size && fclose(file) == 0,
                 "a seed can be written");
}

/* A file as it is and as lines, for those targets. */
static void put_fits(const char *folder, const char *const *targets, const char *name, const char *path)
{
    rx_text lines = {0};
    struct stat about;
    FILE *file = fopen(path, "rb");
    fuzz_require(file != NULL && stat(path, &about) == 0, "a FITS file was written");
    char *data = malloc((size_t)about.st_size);
    fuzz_require(data != NULL && fread(data, 1, (size_t)about.st_size, file) == (size_t)about.st_size,
                 "a FITS file can be read");
    fclose(file);
    const int condensed = fuzz_condense((uint8_t *)data, (size_t)about.st_size, &lines);
    for (; *targets != NULL; targets++) {
        char other[100];
        snprintf(other, sizeof other, "%s-lines", name);
        put(folder, *targets, name, data, (size_t)about.st_size);
        if (condensed)
            put(folder, *targets, other, lines.data, lines.length);
        if (condensed && strcmp(*targets, "tile") == 0) {
            rx_text gzip = {0};
            rx_text_add(&gzip, "GZIP\n");
            rx_text_add_bytes(&gzip, lines.data, lines.length);
            snprintf(other, sizeof other, "%s-gzip", name);
            put(folder, *targets, other, gzip.data, gzip.length);
            rx_text_free(&gzip);
        }
    }
    free(data);
    rx_text_free(&lines);
    unlink(path);
}

/* --- text --- */

static void text_seeds(const char *folder)
{
    const rx_keytable *const tables[] = {rx_keytable_rextract(), rx_keytable_simulate(),
                                         rx_keytable_validate(), rx_keytable_train(), rx_keytable_survey()};
    for (size_t i = 0; i < sizeof tables / sizeof *tables; i++) {
        rx_text dump = {0}, line = {0};
        rx_settings *settings = NULL;
        fuzz_require(rx_settings_new(tables[i], &settings, NULL) == RX_OK, "settings can be made");
        for (int r = 0; r < tables[i]->nrows; r++)
            if (tables[i]->rows[r].kind != RX_KIND_SECTION) {
                rx_text_printf(&dump, "%s ", tables[i]->rows[r].name);
                rx_keyword_print(&dump, settings, r, true);
                rx_text_add(&dump, r % 7 == 0 ? " # comment\n" : "\n");
                if (r % 9 == 1) {
                    rx_text_printf(&line, "-%s\n", tables[i]->rows[r].name);
                    rx_keyword_print(&line, settings, r, false);
                    rx_text_add(&line, "\n");
                }
            }
        put(folder, "config", tables[i]->program, dump.data, dump.length);
        put(folder, "arguments", tables[i]->program, line.data, line.length);
        rx_settings_free(settings);
        rx_text_free(&dump);
        rx_text_free(&line);
    }
    rx_text dump = {0};
    rx_columns_dump(&dump);
    for (char *c = dump.data; *c != '\0'; c++)
        if (*c == '#')
            *c = ' ';
    put(folder, "param", "all", dump.data, dump.length < 8000 ? dump.length : 8000);
    rx_text_free(&dump);
    rx_text net = {0};
    rx_text_add(&net, "NNW\n# a network\n3\n10 2 1\n");
    for (int i = 0; i < 20 + 2 * 11 + 3 + 2; i++)
        rx_text_printf(&net, "%g%s", 0.25 * i - 3, i % 8 == 7 ? "\n" : " ");
    put(folder, "nnw", "small", net.data, net.length);
    rx_text_free(&net);
}

/* Those of a file, each behind a line "== TARGET NAME". */
static void written_seeds(const char *folder, const char *path)
{
    char *all = NULL, target[20], name[20];
    int used = 0;
    fuzz_require(rx_text_read_file(path, 1 << 20, &all, NULL, NULL) == RX_OK, "the texts can be read");
    for (char *at = all, *end; at != NULL; at = end) {
        fuzz_require(sscanf(at, "== %19s %19s%n", target, name, &used) == 2,
                     "a text has a target and a name");
        at += used + 1;
        end = strstr(at - 1, "\n== ");
        end = end != NULL ? end + 1 : NULL;
        put(folder, target, name, at, end != NULL ? (size_t)(end - at) : strlen(at));
    }
    free(all);
}

/* --- FITS --- */

static const char *const IMAGES[] = {"tile", "maps", "psf", "templates", NULL};
static const char *const TILES[] = {"tile", "maps", NULL};
static const char *const TABLES[] = {"table", "templates", NULL};
static const char *const PSFS[] = {"psf", "table", NULL};
static const char *const MODELS[] = {"model", NULL};

static void blob(float *pixels, int side)
{
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++) {
            const double dx = x - side / 2, dy = y - side / 2;
            pixels[y * side + x] = (float)(100 * exp(-(dx * dx + dy * dy) / 4) + (x * 7 + y * 3) % 5);
        }
}

static void image_seeds(const char *folder, const char *scratch)
{
    static const int types[] = {BYTE_IMG, SHORT_IMG, LONG_IMG, LONGLONG_IMG, FLOAT_IMG, DOUBLE_IMG};
    static const int packings[] = {RICE_1, GZIP_1, GZIP_2, PLIO_1, HCOMPRESS_1};
    float pixels[SIDE * SIDE];
    short integers[SIDE * SIDE];
    long axes[2] = {SIDE, SIDE};
    char name[40];
    fitsfile *file = NULL;
    int failed = 0;
    blob(pixels, SIDE);
    for (int i = 0; i < SIDE * SIDE; i++)
        integers[i] = (short)pixels[i];
    for (int i = 0; i < 6; i++) {
        remove(scratch);
        fits_create_diskfile(&file, scratch, &failed);
        fits_create_img(file, types[i], 2, axes, &failed);
        fits_write_key_dbl(file, "GAIN", 2.5, 3, "", &failed);
        fits_write_key_dbl(file, "MAGZERO", 25, 3, "", &failed);
        fits_write_img(file, TFLOAT, 1, SIDE * SIDE, pixels, &failed);
        if (i == 1)
            fits_write_key_lng(file, "BLANK", 3, "", &failed);
        if (i == 4) { /* further images, one that takes the primary header over */
            fits_create_img(file, SHORT_IMG, 2, axes, &failed);
            fits_write_key_log(file, "INHERIT", 1, "", &failed);
            fits_write_key_str(file, "EXTNAME", "SCI", "", &failed);
            fits_write_img(file, TFLOAT, 1, SIDE * SIDE, pixels, &failed);
            fits_create_img(file, BYTE_IMG, 1, axes, &failed);
        }
        fits_close_file(file, &failed);
        fuzz_require(failed == 0, "cfitsio writes an image");
        snprintf(name, sizeof name, "image%d", i);
        put_fits(folder, i == 4 ? IMAGES : TILES, name, scratch);
    }
    for (int i = 0; i < 5; i++)
        for (int real = 0; real < 2; real++) {
            if (packings[i] == PLIO_1 && real)
                continue;
            remove(scratch);
            fits_create_diskfile(&file, scratch, &failed);
            fits_set_compression_type(file, packings[i], &failed);
            fits_create_img(file, real ? FLOAT_IMG : SHORT_IMG, 2, axes, &failed);
            fits_write_img(file, real ? TFLOAT : TSHORT, 1, SIDE * SIDE, real ? (void *)pixels : integers,
                           &failed);
            fits_close_file(file, &failed);
            fuzz_require(failed == 0, "cfitsio writes a compressed image");
            snprintf(name, sizeof name, "packed%d%s", i, real ? "-real" : "");
            put_fits(folder, TILES, name, scratch);
        }
}

/* A PSFEx model of degree 1, its two polynomials of the position. */
static void psfex_seed(const char *folder, const char *scratch)
{
    enum { N = 7 };
    static const struct {
        const char *name;
        double value;
    } numbers[] = {{"POLZERO1", 30}, {"POLSCAL1", 60}, {"POLZERO2", 30}, {"POLSCAL2", 60}, {"PSF_SAMP", 0.8}};
    static const struct {
        const char *name;
        long value;
    } counts[] = {{"POLNAXIS", 2}, {"POLNGRP", 1},  {"POLDEG1", 1},  {"POLGRP1", 1}, {"POLGRP2", 1},
                  {"PSFNAXIS", 3}, {"PSFAXIS1", N}, {"PSFAXIS2", N}, {"PSFAXIS3", 3}};
    static const char *const types[] = {"PSF_MASK"};
    char form[16], *forms[] = {form};
    float mask[3 * N * N] = {0};
    long dims[3] = {N, N, 3};
    fitsfile *file = NULL;
    int failed = 0;
    blob(mask, N);
    for (int i = 0; i < N * N; i++)
        mask[N * N + i] = mask[i] / 100 * (float)(i % N - N / 2);
    snprintf(form, sizeof form, "%dE", 3 * N * N);
    fits_create_diskfile(&file, scratch, &failed);
    fits_create_img(file, BYTE_IMG, 0, NULL, &failed);
    fits_create_tbl(file, BINARY_TBL, 1, 1, (char **)(void *)types, forms, NULL, "PSF_DATA", &failed);
    fits_write_tdim(file, 1, 3, dims, &failed);
    fits_write_key_str(file, "POLNAME1", "X_IMAGE", "", &failed);
    fits_write_key_str(file, "POLNAME2", "Y_IMAGE", "", &failed);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        fits_write_key_dbl(file, numbers[i].name, numbers[i].value, 6, "", &failed);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        fits_write_key_lng(file, counts[i].name, counts[i].value, "", &failed);
    fits_write_col(file, TFLOAT, 1, 1, 1, 3 * N * N, mask, &failed);
    fits_close_file(file, &failed);
    fuzz_require(failed == 0, "cfitsio writes a PSFEx model");
    put_fits(folder, PSFS, "psfex", scratch);
}

/* A cube with places in its header. */
static void cube_seed(const char *folder, const char *scratch)
{
    enum { N = 11 };
    static const char *const places[] = {"(3.0, 5.0)", "(3.0, 50.0)", "(40.5, 20.0)"};
    long axes[3] = {N, N, 3};
    float cube[3 * N * N];
    fitsfile *file = NULL;
    int failed = 0;
    char key[24];
    for (int k = 0; k < 3; k++)
        blob(cube + k * N * N, N);
    remove(scratch);
    fits_create_diskfile(&file, scratch, &failed);
    fits_create_img(file, FLOAT_IMG, 3, axes, &failed);
    for (int k = 0; k < 3; k++) {
        snprintf(key, sizeof key, "DET_YX%d", k);
        fits_write_key_str(file, key, places[k], "", &failed);
    }
    fits_write_key_lng(file, "OVERSAMP", 2, "", &failed);
    fits_write_img(file, TFLOAT, 1, 3 * N * N, cube, &failed);
    fits_close_file(file, &failed);
    fuzz_require(failed == 0, "cfitsio writes a cube");
    put_fits(folder, PSFS, "grid", scratch);
}

/* Every type of column, scaled ones, one with a TNULL; and the same as an ASCII table. */
static void table_seeds(const char *folder, const char *scratch)
{
    static const char *const names[] = {"X_IMAGE", "Y_IMAGE", "MAG_AUTO", "FLAGS", "NAME",
                                        "BITS",    "PAIR",    "BIG",      "LIST",  "GAL_HDU"};
    static const char *const forms[] = {"1D", "1E", "2E", "1I", "8A", "3X", "1C", "1K", "1PJ", "1J"};
    static const char *const galaxies[] = {"GAL_FILENAME", "GAL_HDU", "PSF_FILENAME", "PSF_HDU"};
    static const char *const galaxy_forms[] = {"12A", "1J", "12A", "1J"};
    static const char *const words[] = {"0", "0"};
    double values[] = {1.5, 2.5, 30};
    for (int kind = 0; kind < 3; kind++) {
        fitsfile *file = NULL;
        int failed = 0;
        remove(scratch);
        fits_create_diskfile(&file, scratch, &failed);
        fits_create_img(file, BYTE_IMG, 0, NULL, &failed);
        if (kind == 0)
            fits_create_tbl(file, BINARY_TBL, 3, 10, (char **)(void *)names, (char **)(void *)forms, NULL,
                            "OBJECTS", &failed);
        else if (kind == 1)
            fits_create_tbl(file, ASCII_TBL, 3, 2, (char **)(void *)names,
                            (char *[]){(char[]){"F10.3"}, (char[]){"I6"}}, NULL, "", &failed);
        else
            fits_create_tbl(file, BINARY_TBL, 1, 4, (char **)(void *)galaxies, (char **)(void *)galaxy_forms,
                            NULL, "", &failed);
        for (int c = 1; kind < 2 && c <= (kind == 0 ? 3 : 2); c++)
            fits_write_col(file, TDOUBLE, c, 1, 1, 3, values, &failed);
        if (kind == 0) {
            fits_write_key_dbl(file, "TSCAL4", 0.5, 3, "", &failed);
            fits_write_key_lng(file, "TNULL8", 0, "", &failed);
        }
        if (kind == 2)
            fits_write_col(file, TSTRING, 1, 1, 1, 1, (char **)(void *)words, &failed);
        fits_close_file(file, &failed);
        fuzz_require(failed == 0, "cfitsio writes a table");
        char name[20];
        snprintf(name, sizeof name, "table%d", kind);
        put_fits(folder, TABLES, name, scratch);
    }
}

/* What an output says of its run: few of the keywords, values that need to be escaped and to be continued. */
static void make_record(rx_record *dst, const rx_table *table)
{
    static const char *const keywords[][2] = {
        {"RECORD", RX_RECORD_VERSION},
        {"VERSION", "0.1.0"},
        {"MACHINE", "x86-64 avx2"},
        {"IMAGE", "night 1/a %.fits"},
        {"CATALOG_NAME", "\"a & b\\n.cat\""},
        {"DETECT_THRESH", "2.5"},
        {"PHOT_APERTURES", "3,5,7,9,11,13,15,17,19,21,23,25,27,29,31,33,35,37,39,41"},
        {"RESTORE_TYPE", "NONE,RL"},
        {"SET", "CATALOG_NAME DETECT_THRESH"},
        {"READ", "0123456789abcdef0123456789abcdef IMAGE night 1/a %.fits"}};
    rx_record run = {0}, products = {0};
    char digest[RX_HASH_TEXT];
    for (size_t i = 0; i < sizeof keywords / sizeof *keywords; i++)
        rx_record_add(&run, keywords[i][0], "", "%s", keywords[i][1]);
    rx_fits_digest_table(table, digest);
    rx_record_product(&products, digest, 1, "a.cat");
    fuzz_require(rx_record_of(&run, &products, "a.cat", dst, NULL) == RX_OK, "a record can be made");
    rx_record_free(&run);
    rx_record_free(&products);
}

/* Catalogues as rextract writes them: FITS, LDAC and the text types. */
static void own_catalogues(const char *folder, const char *scratch)
{
    static const struct {
        rx_catalog_type type;
        const char *name;
    } types[] = {{RX_CATALOG_FITS_1_0, "own-fits"},
                 {RX_CATALOG_FITS_LDAC, "own-ldac"},
                 {RX_CATALOG_ASCII_HEAD, "own-head"},
                 {RX_CATALOG_VOTABLE, "own-votable"}};
    rx_source list[2] = {{.number = 1, .x = 10, .y = 20, .flux_auto = 100, .alpha_j2000 = 150},
                         {.number = 2, .x = 30, .y = 5, .flux_auto = -1, .alpha_j2000 = 151}};
    const rx_sources sources = {.n = 2, .list = list, .naper = 1};
    char cards[3 * 80 + 1];
    snprintf(cards, sizeof cards, "%-80s%-80s%-80s", "EXPTIME =                  100", "FILTER  = 'r'",
             "CRVAL1  =                150.0");
    const rx_tile tile = {.name = "t.fits",
                          .extname = "",
                          .width = 64,
                          .height = 48,
                          .zeropoint = 25,
                          .cards = cards,
                          .ncards = 3};
    static const char columns_wanted[] = "NUMBER\nX_IMAGE\nY_IMAGE\nALPHA_J2000\nMAG_AUTO\nFLUX_APER(2)\n";
    rx_column_list *columns = NULL;
    rx_table *table = NULL;
    fuzz_require(rx_columns_read(fuzz_file(0, columns_wanted, sizeof columns_wanted - 1), NULL, &columns,
                                 NULL) == RX_OK,
                 "columns can be chosen");
    const rx_image image = rx_tile_image(&tile);
    fuzz_require(rx_catalog_table(columns, &image, &sources, &table, NULL) == RX_OK &&
                     rx_table_copy_cards(table, tile.cards, tile.ncards, NULL) == RX_OK,
                 "a table can be made");
    char *program[][3] = {{"RXVERS", "0.1.0", "program"}};
    const rx_record version = {.n = 1, .pairs = program};
    rx_record record = {0};
    make_record(&record, table);
    for (int i = 0; i < 8; i++) {
        static const char *const texts[] = {"catalog", NULL}, *const repeated[] = {"repeated", NULL};
        const int k = i % 4;
        remove(scratch);
        const rx_catalog catalog = {
            .type = types[k].type, .n = 1, .tables = &table, .record = i < 4 ? &version : &record};
        fuzz_require(rx_catalog_write(&catalog, scratch, scratch, NULL, NULL) == RX_OK,
                     "a catalogue can be written");
        put_fits(folder, i >= 4 ? repeated : k < 2 ? TABLES : texts, types[k].name, scratch);
    }
    rx_record_free(&record);
    rx_table_free(table);
    rx_columns_free(columns);
}

static rx_model *new_model(rx_mode mode, int width)
{
    const rx_psfnet_shape shape = {.width = width, .blocks = 1, .stem_kernel = width, .kernel = width};
    rx_model *model = rx_model_new();
    fuzz_require(model != NULL, "there is memory");
    model->front.mode = mode;
    model->front.rl_steps = mode == RX_MODE_INFORMED;
    snprintf(model->name, sizeof model->name, "seed");
    fuzz_require(rx_psfnet_new(&shape, rx_front_channels(mode), &model->restore, NULL) == RX_OK,
                 "a network can be made");
    rx_net_initialise(model->restore, 7, 0, 0.3, 0.05);
    return model;
}

static void model_seeds(const char *folder, const char *scratch)
{
    for (int i = 0; i < 2; i++) {
        rx_model *model = new_model(i == 0 ? RX_MODE_BLIND : RX_MODE_INFORMED, 1);
        const rx_psfnet_shape shape = {.width = 1, .blocks = 1, .stem_kernel = 1, .kernel = 1};
        if (i == 1) {
            fuzz_require(rx_psfnet_new(&shape, RX_PSF_CHANNELS, &model->psf, NULL) == RX_OK, "so can two");
            model->bins = calloc(2, sizeof *model->bins);
            fuzz_require(model->bins != NULL, "there is memory");
            model->nfwhm = 2, model->nsigma = 1;
            for (int b = 0; b < 2; b++)
                model->bins[b] = (rx_model_bin){.fwhm = {2 + b, 3 + b},
                                                .sigma = {1, 15},
                                                .loss = 1,
                                                .list = 0.5,
                                                .recall = 0.5,
                                                .images = 10};
            model->provenance = strdup("SEED 1\nWIDTH 4\n");
        }
        remove(scratch);
        fuzz_require(rx_model_write(model, scratch, scratch, NULL) == RX_OK, "a model can be written");
        put_fits(folder, MODELS, i == 0 ? "blind" : "informed", scratch);
        rx_model_free(model);
    }
}

static void checkpoint_seed(const char *folder, const char *scratch)
{
    static const char *const targets[] = {"checkpoint", NULL};
    const double fwhm[2] = {2, 8}, sigma[2] = {1, 15};
    rx_selection selection;
    rx_train_state *state = NULL;
    rx_model *model = new_model(RX_MODE_INFORMED, 1);
    fuzz_require(rx_selection_begin((const int[]){2, 1}, fwhm, sigma, 40, 1, &selection, NULL) == RX_OK,
                 "a grid");
    fuzz_require(rx_train_state_new(model, &selection, &state, NULL) == RX_OK, "a state");
    fuzz_require(rx_history_resize(&state->history, 1, NULL) == RX_OK, "a history");
    state->history.epoch[0] = (rx_epoch){.steps = 1};
    for (int b = 0; b < 2; b++)
        state->history.bin[b] = (rx_epoch_bin){.loss = 1 + b};
    remove(scratch);
    fuzz_require(rx_checkpoint_write(scratch, scratch, "SEED 1\nWIDTH 1\n", state, state, NULL) == RX_OK,
                 "a checkpoint can be written");
    put_fits(folder, targets, "within", scratch);
    rx_train_state_free(state);
    rx_model_free(model);
}

/* --- dictionaries --- */

static void word(FILE *file, const char *text)
{
    fputc('"', file);
    for (const char *c = text; *c != '\0'; c++)
        fprintf(file, *c == '"' || *c == '\\' ? "\\%c" : *c < ' ' ? "\\x%02x" : "%c", *c);
    fputs("\"\n", file);
}

/* Keywords, columns and names of metrics; what else stands in inputs is in fits.dict and text.dict. */
static void dictionary(const char *folder, const char *target)
{
    char path[600];
    snprintf(path, sizeof path, "%s/%s.dict", folder, target);
    FILE *file = fopen(path, "w");
    fuzz_require(file != NULL, "a dictionary can be written");
    if (strcmp(target, "config") == 0 || strcmp(target, "arguments") == 0 || strcmp(target, "tiles") == 0) {
        const rx_keytable *const tables[] = {rx_keytable_rextract(), rx_keytable_simulate(),
                                             rx_keytable_validate(), rx_keytable_train(),
                                             rx_keytable_survey()};
        for (size_t i = 0; i < sizeof tables / sizeof *tables; i++)
            for (int r = 0; r < tables[i]->nrows; r++)
                if (tables[i]->rows[r].kind != RX_KIND_SECTION) {
                    const char *const *words = tables[i]->rows[r].words;
                    word(file, tables[i]->rows[r].name);
                    for (; words != NULL && *words != NULL; words++)
                        word(file, *words);
                }
    }
    int ncolumns;
    const rx_column_def *columns = rx_column_defs(&ncolumns);
    for (int i = 0; strcmp(target, "param") == 0 && i < ncolumns; i++)
        word(file, columns[i].name);
#define METRIC(id, name, unit, digits, whole, help) word(file, name);
    if (strcmp(target, "qa") == 0) {
        RX_METRICS(METRIC)
    }
#undef METRIC
    fuzz_require(fclose(file) == 0, "a dictionary can be written");
}

int main(int argc, char **argv)
{
    char scratch[600];
    if (argc != 3) {
        fputs("usage: seeds FOLDER TEXTS\n", stderr);
        return 2;
    }
#define TARGET(name, most, what)                                                                             \
    snprintf(scratch, sizeof scratch, "%s/%s", argv[1], #name);                                              \
    mkdir(scratch, 0777);                                                                                    \
    dictionary(argv[1], #name);
#include "targets.def"
#undef TARGET
    snprintf(scratch, sizeof scratch, "%s/scratch.fits", argv[1]);
    text_seeds(argv[1]);
    written_seeds(argv[1], argv[2]);
    image_seeds(argv[1], scratch);
    psfex_seed(argv[1], scratch);
    cube_seed(argv[1], scratch);
    table_seeds(argv[1], scratch);
    own_catalogues(argv[1], scratch);
    model_seeds(argv[1], scratch);
    checkpoint_seed(argv[1], scratch);
    return 0;
}
