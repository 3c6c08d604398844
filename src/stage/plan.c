/* What a scheduler has to know of a tile before it runs: memory and disk. */
#include "stage/plan.h"

#include <math.h>
#include <stdlib.h>
#include <sys/stat.h>

#include "base/interrupt.h"
#include "base/min_max.h"
#include "base/names.h"
#include "config/config_fields.h"
#include "config/tiles.h"
#include "data/restorers.h"
#include "io/tile.h"
#include "nn/stream.h"
#include "report/formats.h"
#include "stage/options.h"

/* Of one tile, or of all. */
typedef struct need {
    long tiles, failed, images;
    double pixels, sources, threads, memory, outputs;
} need;

/* Bytes at most while an image goes through restorer k. Steps that take memory one after the other share it; a row is what
 * its step adds to the peak: always, per pixel up to 2^20 and beyond, per source up to 2^14 and beyond, per further thread;
 * and how often it counts. The least table that is above runs of all kinds by a tenth (validation/bench/plan.py fit). */
static double image_memory(const rx_options *o, int k, const rx_tile_shape *shape, int roles, double sources)
{
    const rx_pipeline_params *par = &o->pipeline;
    const rx_restore_params *restore = &par->restore;
    const double pixels = (double)shape->width * shape->height;
    const int width = rx_min_int(shape->width, restore->net_block), threads = par->nthreads;
    const bool file = par->psf.type == RX_PSF_PSFEX || par->psf.type == RX_PSF_FILE;
    const bool check = o->check.self_check || o->check.blank_check > 0 || o->restored_rms, dual = roles > 1;
    const bool stars = par->detect.filter_auto || o->check.self_check || par->templates.wanted ||
                       o->write_psf || o->tile_page || o->nrestorers > 1;
    const bool rl = restore->out_of_domain == RX_DOMAIN_RL;
    const bool maps = o->tile[0].weight_type != RX_WEIGHT_NONE || (o->tile[0].own_maps && shape->own_maps);
    const int images = restore->keep_reblurred + restore->keep_support + par->keep_filtered +
                       (o->nchecks > 0) + o->restored_rms;
    const int reports = o->reference.name != NULL || o->tile_page ? o->nrestorers : 0;
    /* clang-format off */
    enum { NONE, RL, RL_BLIND, NET };
#define RESTORER(name, run, traits, cost, help) cost,
    static const int kinds[] = {RX_RESTORERS(RESTORER)};
#undef RESTORER
    int n;
    const int kind = kinds[o->restorers[k] - rx_restorers(&n)], plain = kind == NONE;
    const double rows[][7] = {
        {0.01e6,  0,     0,     82.9,    8.008,   0,      roles},              /* TILE */
        {1.0e6,   2,     2,     0,       0,       0,      roles * shape->compressed},                /* COMPRESSED */
        {26.99e6, 12.98, 15.4,  5828,    2605,    2.26e6, plain},              /* NONE */
        {41.00e6, 24,    24.25, 6597,    2598,    2.41e6, kind == RL},         /* RL */
        {47.00e6, 45.77, 49.33, 6330,    1762,    1.62e6, kind == RL_BLIND},   /* RL_BLIND */
        {51.48e6, 51.39, 31.42, 5108,    2712,    0,      kind == NET},        /* NET, with its look at noise and two stages */
        {3.70e6,  5.007, 4.303, 0,       0,       0.79e6, kind == NET && (rl || restore->verify_seams)}, /* NET_AGAIN */
        {39.97e6, 0,     0,     0,       0,       0,      (kind == NET) * threads * width / 2048.0}, /* NET_BLOCK */
        {0.5e6,   5,     4.5,   0,       0,       0,      restore->rl_accelerate && !plain && (rl || kind != NET)}, /* RL_ACCELERATE */
        {4.5e6,   0,     0,     0,       0,       0,      file && !plain ? 14 + 2 * threads : 0},    /* PSF_TERM, of 15 */
        {7.02e6,  12.14, 2.384, 0,       0,       0,      plain && stars && par->psf.type == RX_PSF_AUTO}, /* PSF_AUTO */
        {0.01e6,  11.78, 22.92, 1.844e4, 1.421e4, 3.55e6, par->templates.wanted},                    /* TEMPLATES */
        {0.31e6,  4.199, 4.918, 0,       0,       0,      images},             /* CHECKIMAGE */
        {1.01e6,  25.94, 25.79, 0,       0,       0.57e6, dual},               /* SECOND */
        {46.19e6, 100.86, 64.42, 1.181e4, 2796,   1.01e6, check},              /* CHECK */
        {0.01e6,  6.551, 0,     1.46e4,  1.382e4, 3.71e6, check && o->check.templates},              /* CHECK_TEMPLATES */
        {0.01e6,  11.01, 10.79, 2813,    2799,    0,      o->nrestorers - 1},  /* FURTHER */
        {0.01e6,  0,     0,     11.25,   563.4,   0,      reports},            /* REPORT */
        {0.01e6,  12.51, 12.51, 0,       0,       0,      roles * maps},       /* WEIGHT */
        {0.02e6,  3.67,  4.426, 0,       0,       0,      o->tile[0].nflags},  /* FLAG_MAP */
    };
    /* clang-format on */
    const double size[] = {1,
                           fmin(pixels, 1 << 20),
                           fmax(pixels - (1 << 20), 0),
                           fmin(sources, 1 << 14),
                           fmax(sources - (1 << 14), 0),
                           threads - 1};
    const rx_background_params *back = &par->background[0];
    double bytes = roles * ((double)shape->held + 160 * (double)shape->ncards +
                            64 * pixels / ((double)back->mesh_width * back->mesh_height)) +
                   8 * sources * par->measure.vignet_width * par->measure.vignet_height;
    for (size_t r = 0; r < sizeof rows / sizeof *rows; r++)
        for (int i = 0; i < 6; i++)
            bytes += rows[r][6] * rows[r][i] * size[i];
    const rx_net *nets[] = {restore->model != NULL ? restore->model->restore : NULL,
                            restore->model != NULL ? restore->model->second : NULL};
    double larger = 0; /* than config/psfnet.fits, which the table is of */
    for (int i = 0; i < 2 && kind == NET; i++)
        if (nets[i] != NULL)
            larger = fmax(larger, rx_stream_bytes(nets[i], width, restore->precision) - 4e3 * width);
    return bytes + threads * larger;
}

/* Bytes of all outputs of an image: headers of 900 cards at most (4 times as long in a VOTable), rows, pixels, pages. */
static double image_outputs(const rx_config *config, const rx_options *o, const rx_table *row,
                            const rx_tile_shape *shape, double sources, double reference)
{
    const bool text = o->catalog_type != RX_CATALOG_FITS_1_0 && o->catalog_type != RX_CATALOG_FITS_LDAC;
    const bool covariance = o->covariance_name[0] != '\0';
    const double pixels = (double)shape->width * shape->height, header = 80 * (900 + (double)shape->ncards);
    const double page = 4e6 + 600 * sources, report = page + 4e6 + 12 * reference;
    double each = 0, bytes = 0;
    for (int i = 0; i < row->ncolumns; i++)
        bytes += (double)rx_column_elements(&row->columns[i]) *
                 (text ? 35.0 : (double)rx_column_element_size(&row->columns[i]));
    if (o->catalog_type != RX_CATALOG_NONE)
        each += 4 * header + 1200 * row->ncolumns + sources * (bytes + 12);
    each +=
        o->nchecks * (header + 4 * fmax(pixels, 16 * 101 * 101)) + covariance * (2 * header + 2500 * sources);
    each += o->positions != NULL ? 4 * header + 600 * (double)o->positions->nrows : 0;
    each += o->reference.name != NULL ? report : o->tile_page ? page : 0;
    each += config->write_xml ? 4 * header : 0;
    if (o->check.self_check && o->self_check_name[0] != '\0')
        each += 4e6 + 1800 * (double)o->check.count;
    return o->nrestorers * each;
}

static rx_status plan_tile(const rx_config *config, const char *image, rx_log *log, need *dst, rx_error *err)
{
    const rx_sources none = {0};
    rx_options *options = NULL;
    rx_tile_shape *shapes[2] = {NULL, NULL};
    rx_table *row = NULL;
    char *names[2] = {NULL, NULL};
    struct stat file = {0};
    int n[2] = {0, 0};
    rx_status status;
    *dst = (need){.tiles = 1, .outputs = config->record_name[0] != '\0' ? 65536 : 0};
    RX_TRY_EXIT(rx_options_from_config(config, log, &options, err));
    if (!rx_name_split_images(image, &names[0], &names[1]))
        RX_TRY_EXIT(rx_error_memory(err, 0));
    for (int role = 0; role < 2 && names[role] != NULL; role++)
        RX_TRY_EXIT(rx_tile_shapes(names[role], log, &shapes[role], &n[role], err));
    RX_TRY_EXIT(rx_catalog_table(options->columns, &(rx_image){0}, &none, &row, err));
    if (options->reference.name != NULL && stat(options->reference.name, &file) != 0)
        file.st_size = 1 << 28; /* name[n] */
    dst->images = n[0];
    dst->threads = options->pipeline.nthreads;
    for (int i = 0; i < n[0]; i++) {
        const double pixels = (double)shapes[0][i].width * shapes[0][i].height;
        const double sources = ceil(1e-6 * pixels * options->plan_density),
                     listed = options->positions != NULL ? (double)options->positions->nrows : 0;
        for (int k = 0; k < options->nrestorers; k++)
            dst->memory = fmax(dst->memory, image_memory(options, k, &shapes[0][i], 1 + (names[1] != NULL),
                                                         sources + listed));
        dst->pixels += pixels;
        dst->sources += sources;
        dst->outputs += image_outputs(config, options, row, &shapes[0][i], sources, (double)file.st_size);
    }
    for (int i = 0; i < row->ncolumns; i++) /* rows that wait to be written */
        dst->memory += options->nrestorers * dst->sources * (double)rx_column_elements(&row->columns[i]) *
                       (double)rx_column_element_size(&row->columns[i]);
    dst->memory = ceil(dst->memory + 2.5 * (double)file.st_size);
exit:
    rx_table_free(row);
    free(shapes[0]);
    free(shapes[1]);
    free(names[0]);
    free(names[1]);
    rx_options_free(options);
    return status;
}

/* A tile in the array, and in the totals; of a list a failure goes there too. */
static rx_status add_tile(rx_json *json, const rx_settings *settings, const char *image, bool listed,
                          rx_log *log, need *all, rx_error *err)
{
    char line[RX_ERROR_WHERE + RX_ERROR_TEXT + 128];
    rx_error why = rx_error_part(err);
    need of;
    rx_status status = plan_tile((const rx_config *)settings, image, log, &of, &why);
    all->tiles++;
    if (status != RX_OK && !listed) {
        rx_error_take(err, &why);
        return status;
    }
    rx_json_object(json, NULL, false);
    rx_json_string(json, "image", image);
    if (status != RX_OK) {
        all->failed++;
        rx_error_format(&why, "rextract", line, sizeof line);
        rx_json_string(json, "error", line);
        rx_json_end(json);
        return RX_OK;
    }
    rx_json_count(json, "images", (uint64_t)of.images);
    rx_json_count(json, "pixels", (uint64_t)of.pixels);
    rx_json_count(json, "sources", (uint64_t)of.sources);
    rx_json_count(json, "threads", (uint64_t)of.threads);
    rx_json_count(json, "memory_bytes", (uint64_t)of.memory);
    rx_json_count(json, "output_bytes", (uint64_t)of.outputs);
    rx_json_end(json);
    all->memory = fmax(all->memory, of.memory);
    all->outputs += of.outputs;
    return RX_OK;
}

rx_status rx_plan_run(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                      rx_error *err)
{
    rx_text text = {0};
    rx_json json = rx_json_on(&text);
    rx_tiles *tiles = NULL;
    need all = {0};
    rx_status status;
    rx_json_object(&json, NULL, false);
    rx_json_string(&json, "version", RX_VERSION);
    rx_json_array(&json, "tiles", false);
    if (image[0] != '@')
        RX_TRY_EXIT(add_tile(&json, settings, image, false, log, &all, err));
    if (image[0] == '@') {
        RX_TRY_EXIT(rx_tiles_read(image + 1, &tiles, err));
        RX_TRY_EXIT(rx_tiles_check(tiles, settings, NULL, log, err));
    }
    for (int i = 0; tiles != NULL && i < tiles->n; i++) {
        rx_settings *own = NULL;
        RX_TRY_EXIT(rx_interrupt_check(err));
        RX_TRY_EXIT(rx_tiles_settings(tiles, i, settings, log, &own, err));
        status = add_tile(&json, own, rx_tiles_image(tiles, i), true, log, &all, err);
        rx_settings_free(own);
    }
    rx_json_end(&json);
    rx_json_object(&json, "all", false);
    rx_json_count(&json, "tiles", (uint64_t)all.tiles);
    rx_json_count(&json, "failed", (uint64_t)all.failed);
    rx_json_count(&json, "memory_bytes", (uint64_t)all.memory);
    rx_json_count(&json, "output_bytes", (uint64_t)all.outputs);
    rx_json_end(&json);
    rx_json_end(&json);
    status = text.failed ? rx_error_memory(err, text.capacity) : RX_OK;
    if (status == RX_OK && (fputs(text.data, standard_out), !rx_stream_end(standard_out)))
        status = rx_error_set(err, RX_SYSTEM, "standard output cannot be written");
    if (status == RX_OK && all.failed > 0)
        status = rx_error_set(err, RX_SOME_FAILED, "%s: %ld of %ld tiles cannot be planned", image + 1,
                              all.failed, all.tiles);
exit:
    rx_tiles_free(tiles);
    rx_text_free(&text);
    return status;
}
