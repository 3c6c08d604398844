/* What a run will need and write, said before it. */
#include "stage/plan.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/names.h"
#include "config/config_fields.h"
#include "data/restorers.h"
#include "data/table.h"
#include "io/tile.h"
#include "nn/stream.h"
#include "psf/psf.h"
#include "stage/inputs.h"
#include "stage/options.h"
#include "stage/provenance.h"

typedef struct rx_plan_job {
    const rx_options *options;
    int n;                        /* images of the tile */
    const rx_tile_shape *detect;  /* [n] */
    const rx_tile_shape *measure; /* [n], NULL without dual-image mode */
    const rx_table *row;          /* the catalogue's columns, without rows */
    size_t record_cards;          /* of the run's record */
    double reference_bytes;       /* of the reference catalogue's file, 0 = none */
    const char *xml_name;         /* NULL: none */
    const int *terms; /* [n] of the PSF; 1: it is the same everywhere, or not known before the run */
} rx_plan_job;

/* --- outputs, and how large they may become --- */

/* Cards of an HDU beyond those of the tile and of the record: what FITS and its checksums need, and facts of
 * the extension at most; and of a column. */
enum { OWN_CARDS = 20, FACT_CARDS = 170, COLUMN_CARDS = 8, CARD = 80, BLOCK = 2880 };

/* Bytes at most of pages and tables with their figures: always, per source, per injected object, per byte of
 * the reference catalogue. */
static const double PAGE = 4e6, PAGE_SOURCE = 600, PAGE_REFERENCE = 12;
static const double COVARIANCE = 2500;                  /* of a source with those of its group */
static const double TEXT_CELL = 26, TEXT_COLUMN = 1200; /* a number as text, a column's description */
enum { CELL_MARKUP = 9, ROW_MARKUP = 12 };              /* of a VOTable */
enum { PSF_PIXELS = 101 * 101 };                        /* of a term of a PSF */
static const double XML = 2e4, XML_RUN = 1e4; /* facts of a run: always, per restorer with its warnings */

static double plan_pixels(const rx_tile_shape *shape)
{
    return (double)shape->width * shape->height;
}

static double plan_sources(const rx_plan_job *job, const rx_tile_shape *shape)
{
    return ceil(1e-6 * plan_pixels(shape) * job->options->plan_density);
}

static double plan_row_bytes(const rx_table *row)
{
    double bytes = 0;
    for (int i = 0; i < row->ncolumns; i++)
        bytes +=
            (double)rx_column_elements(&row->columns[i]) * (double)rx_column_element_size(&row->columns[i]);
    return bytes;
}

static double blocks(double bytes)
{
    return BLOCK * ceil(bytes / BLOCK);
}

static double header(const rx_plan_job *job, const rx_tile_shape *shape, int columns)
{
    return blocks(CARD * ((double)shape->ncards + (double)job->record_cards + OWN_CARDS + FACT_CARDS +
                          COLUMN_CARDS * (double)columns));
}

/* --- images --- */

static double image_bytes(const rx_plan_job *job, const char *type)
{
    const rx_background_params *par = &job->options->pipeline.background[0];
    double sum = 0;
    for (int i = 0; i < job->n; i++) {
        const rx_tile_shape *shape = &job->detect[i];
        double pixels = plan_pixels(shape);
        if (strncmp(type, "MINIBACK", 8) == 0)
            pixels =
                ceil((double)shape->width / par->mesh_width) * ceil((double)shape->height / par->mesh_height);
        if (strcmp(type, "PSF") == 0)
            pixels = job->terms[i] * PSF_PIXELS;
        sum += header(job, shape, 0) + blocks(sizeof(float) * pixels);
    }
    return sum;
}

/* --- catalogues --- */

static double fits_table(const rx_plan_job *job, double row, int columns)
{
    double sum = blocks(CARD * (OWN_CARDS + FACT_CARDS + (double)job->record_cards));
    for (int i = 0; i < job->n; i++)
        sum += header(job, &job->detect[i], columns) + blocks(row * plan_sources(job, &job->detect[i]));
    return sum;
}

/* Before each table another one that holds a header in a cell. */
static double ldac_headers(const rx_plan_job *job)
{
    double sum = 0;
    for (int i = 0; i < job->n; i++)
        sum += blocks(CARD * (2 * OWN_CARDS)) + header(job, &job->detect[i], 0);
    return sum;
}

static double all_sources(const rx_plan_job *job)
{
    double sum = 0;
    for (int i = 0; i < job->n; i++)
        sum += plan_sources(job, &job->detect[i]);
    return sum;
}

static double catalog_bytes(const rx_plan_job *job)
{
    const rx_table *row = job->row;
    const rx_catalog_type type = job->options->catalog_type;
    double cells = 0;
    for (int i = 0; i < row->ncolumns; i++)
        cells += (double)rx_column_elements(&row->columns[i]);
    if (type == RX_CATALOG_FITS_1_0 || type == RX_CATALOG_FITS_LDAC)
        return fits_table(job, plan_row_bytes(row), row->ncolumns) +
               (type == RX_CATALOG_FITS_LDAC ? ldac_headers(job) : 0);
    const int markup = type == RX_CATALOG_VOTABLE;
    double sum = TEXT_COLUMN * (2 + row->ncolumns) * (markup ? job->n : 1);
    if (markup)
        sum += job->n * 4 * CARD * ((double)job->record_cards + FACT_CARDS + OWN_CARDS);
    return sum +
           all_sources(job) * (cells * (TEXT_CELL + (markup ? CELL_MARKUP : 0)) + (markup ? ROW_MARKUP : 1));
}

/* The keywords take what they take in a catalogue's. */
static double xml_bytes(const rx_plan_job *job)
{
    return XML + 4 * CARD * (double)job->record_cards + XML_RUN * job->n * job->options->nrestorers;
}

/* --- all of them --- */

static rx_status add_tagged(rx_plan *plan, const char *name, const char *tag, double bytes, rx_error *err)
{
    char *whole = rx_name_with_tag(name, tag);
    if (whole == NULL)
        return rx_error_memory(err, 0);
    const rx_status status = RX_GROW(plan->outputs, (size_t)plan->noutputs + 1, err);
    if (status == RX_OK)
        plan->outputs[plan->noutputs++] = (rx_plan_output){whole, (uint64_t)ceil(bytes)};
    else
        free(whole);
    return status;
}

static rx_status add_run(const rx_plan_job *job, const char *tag, rx_plan *plan, rx_error *err)
{
    const rx_options *options = job->options;
    const char *covariances = options->covariance_name;
    rx_status status = RX_OK;
    if (options->catalog_type != RX_CATALOG_NONE && strcmp(options->catalog_name, "STDOUT") != 0)
        status = add_tagged(plan, options->catalog_name, tag, catalog_bytes(job), err);
    for (int i = 0; i < options->nchecks && status == RX_OK; i++)
        status =
            add_tagged(plan, options->check_names[i], tag, image_bytes(job, options->check_types[i]), err);
    if (status == RX_OK && covariances[0] != '\0')
        status = add_tagged(plan, covariances, tag,
                            fits_table(job, 0, 8) + ldac_headers(job) + COVARIANCE * all_sources(job), err);
    return status;
}

/* A folder for each image of the tile. */
static rx_status add_folders(const rx_plan_job *job, const char *name, double rows, double more,
                             rx_plan *plan, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < job->n && status == RX_OK; i++) {
        char tag[16] = "";
        if (job->n > 1)
            snprintf(tag, sizeof tag, "%d", i + 1);
        const double sources = rows > 0 ? rows : plan_sources(job, &job->detect[i]);
        const double each = PAGE + more + PAGE_SOURCE * sources;
        status = add_tagged(plan, name, tag, job->options->nrestorers * each, err);
    }
    return status;
}

static rx_status plan_outputs(const rx_plan_job *job, rx_plan *plan, rx_error *err)
{
    const rx_options *options = job->options;
    rx_status status = RX_OK;
    for (int i = 0; i < options->nrestorers && status == RX_OK; i++)
        status = add_run(job, options->nrestorers > 1 ? options->restorers[i]->name : NULL, plan, err);
    const int report = options->reference.name != NULL, page = options->tile_page;
    if (status == RX_OK && (report || page))
        status = add_folders(job, options->qa_name, 0,
                             PAGE_REFERENCE * job->reference_bytes + (report && page ? PAGE : 0), plan, err);
    if (status == RX_OK && job->xml_name != NULL)
        status = add_tagged(plan, job->xml_name, NULL, xml_bytes(job), err);
    if (status == RX_OK && options->check.self_check && options->self_check_name[0] != '\0')
        status = add_folders(job, options->self_check_name, 3.0 * (double)options->check.count, 0, plan, err);
    return status;
}

/* --- memory and time, by the table of what steps take (plan_costs.def) --- */

#define COST(name, ...) RX_COST_##name,
typedef enum rx_cost_name {
#include "stage/plan_costs.def"
    RX_NCOSTS
} rx_cost_name;
#undef COST

typedef struct rx_cost {
    double fixed, pixel, large, source, many, thread; /* bytes */
    double mpixel_seconds, source_seconds;
} rx_cost;

#define COST(name, ...) [RX_COST_##name] = {__VA_ARGS__},
static const rx_cost costs[RX_NCOSTS] = {
#include "stage/plan_costs.def"
};
#undef COST

static rx_cost_name cost_of_kind(const rx_restorer *kind)
{
/* clang-format off */
#define RESTORER(name, run, psf, cost, help) RX_COST_##cost,
    static const rx_cost_name names[] = {RX_RESTORERS(RESTORER)};
#undef RESTORER
    /* clang-format on */
    int n;
    return names[kind - rx_restorers(&n)];
}

/* A PSF will be measured from stars. */
static int measures_psf(const rx_options *options)
{
    int needed = options->check.self_check || options->pipeline.templates.wanted || options->write_psf ||
                 options->tile_page;
    for (int i = 0; i < options->nrestorers; i++)
        needed |= options->restorers[i]->needs_psf;
    return needed && rx_psf_type_measured(options->pipeline.psf.type);
}

static int has_second_stage(const rx_restore_params *par)
{
    return par->model != NULL && par->model->second != NULL;
}

/* What networks take that are larger than those of config/psfnet.fits, which the table is of: bytes of a thread in
 * blocks of that width, seconds per Mpixel. */
static double larger_bytes(const rx_restore_params *par, int width)
{
    static const double column = 4e3;
    const rx_model *model = par->model;
    double most = rx_stream_bytes(model->restore, width, par->precision);
    if (has_second_stage(par))
        most = fmax(most, rx_stream_bytes(model->second, width, par->precision));
    return fmax(most - column * width, 0);
}

static double larger_seconds(const rx_restore_params *par)
{
    static const double multiplications = 4640, of_one = 3e-5; /* per pixel */
    const rx_model *model = par->model;
    double more = fmax(rx_net_macs(model->restore) - multiplications, 0);
    if (has_second_stage(par))
        more += fmax(rx_net_macs(model->second) - multiplications, 0);
    return of_one * more;
}

/* How often each row counts for the way of image i through that restorer. */
static void count_rows(const rx_plan_job *job, int i, const rx_restorer *kind, double times[RX_NCOSTS])
{
    const rx_options *options = job->options;
    const rx_pipeline_params *par = &options->pipeline;
    const rx_cost_name name = cost_of_kind(kind);
    const int net = name == RX_COST_NET, plain = name == RX_COST_NONE, dual = job->measure != NULL;
    memset(times, 0, RX_NCOSTS * sizeof *times);
    times[name] = 1;
    if (net)
        times[RX_COST_NET_BLOCK] =
            (double)par->nthreads * rx_min_int(job->detect[i].width, par->restore.net_block) / 2048;
    times[RX_COST_NET_STAGE] = net && has_second_stage(&par->restore);
    times[RX_COST_RL_INSTEAD] = net && par->restore.out_of_domain == RX_DOMAIN_RL;
    times[RX_COST_RL_ACCELERATE] =
        par->restore.rl_accelerate &&
        (name == RX_COST_RL || name == RX_COST_RL_BLIND || times[RX_COST_RL_INSTEAD] > 0);
    times[RX_COST_SEAMS] = net && par->restore.verify_seams;
    times[RX_COST_GUARD] = net && options->check.blank_check != 0; /* noise goes the same way first */
    if (!plain && job->terms[i] > 1) /* spectra of the terms, and the planes that they are summed in */
        times[RX_COST_PSF_TERM] = job->terms[i] - 1 + 2 * par->nthreads;
    times[RX_COST_PSF_AUTO] = plain && measures_psf(options);
    times[RX_COST_TEMPLATES] = par->templates.wanted;
    times[RX_COST_MATCHED] = par->detect.matched && (plain || par->filter_restored);
    times[RX_COST_CHECKIMAGE] =
        par->restore.keep_reblurred + par->restore.keep_support + par->keep_filtered + (options->nchecks > 0);
    times[RX_COST_SECOND] = dual && plain;
    times[RX_COST_SECOND_RESTORED] = dual && !plain;
    times[RX_COST_AUTO] = rx_restorer_is_auto(kind);
    times[RX_COST_SELF_CHECK] = options->check.self_check;
    times[RX_COST_CHECK] = options->check.self_check || options->check.blank_check > 0;
    times[RX_COST_CHECK_TEMPLATES] = times[RX_COST_CHECK] > 0 && options->check.templates;
    times[RX_COST_FURTHER] = options->nrestorers - 1;
    times[RX_COST_REPORT] = options->reference.name != NULL || options->tile_page ? options->nrestorers : 0;
    for (int role = 0; role <= dual; role++) {
        const rx_tile_shape *shape = &(role == 0 ? job->detect : job->measure)[i];
        times[RX_COST_TILE]++;
        /* of own maps, too; the mask's bits and a second copy of a file in gzip go before the peak */
        times[RX_COST_WEIGHT] += options->tile[role].weight_type != RX_WEIGHT_NONE ||
                                 (options->tile[role].own_maps && shape->own_maps);
        times[RX_COST_FLAG_MAP] += options->tile[role].nflags;
        times[RX_COST_COMPRESSED] += shape->compressed;
    }
}

/* What one image takes while it is worked on: rows of the table, and what headers and keywords say to the byte: pixels held
 * in memory, meshes, vignets. */
static double image_memory(const rx_plan_job *job, int i)
{
    enum { PIXELS = 1 << 20, SOURCES = 1 << 14, MESH = 64 };
    const rx_options *options = job->options;
    const rx_measure_params *measure = &options->pipeline.measure;
    const rx_restore_params *restore = &options->pipeline.restore;
    const double pixels = plan_pixels(&job->detect[i]), sources = plan_sources(job, &job->detect[i]);
    double times[RX_NCOSTS], most = 0, open = 0;
    for (int role = 0; role <= (job->measure != NULL); role++) {
        const rx_background_params *back = &options->pipeline.background[role];
        const rx_tile_shape *shape = &(role == 0 ? job->detect : job->measure)[i];
        open += (double)shape->held + 2.0 * CARD * (double)shape->ncards +
                MESH * pixels / ((double)back->mesh_width * back->mesh_height);
    }
    for (int k = 0; k < options->nrestorers; k++) {
        double bytes = 0;
        count_rows(job, i, options->restorers[k], times);
        if (restore->model != NULL && times[RX_COST_NET] > 0)
            bytes = options->pipeline.nthreads *
                    larger_bytes(restore, rx_min_int(job->detect[i].width, restore->net_block));
        for (int r = 0; r < RX_NCOSTS; r++)
            bytes += times[r] *
                     (costs[r].fixed + costs[r].pixel * fmin(pixels, PIXELS) +
                      costs[r].large * fmax(pixels - PIXELS, 0) + costs[r].source * fmin(sources, SOURCES) +
                      costs[r].many * fmax(sources - SOURCES, 0) +
                      costs[r].thread * (options->pipeline.nthreads - 1));
        most = fmax(most, bytes);
    }
    return open + most + 2 * sizeof(float) * sources * (double)measure->vignet_width * measure->vignet_height;
}

static double plan_memory(const rx_plan_job *job)
{
    const double reference = 2.5; /* bytes of memory for one of its file */
    double most = 0, sources = 0;
    for (int i = 0; i < job->n; i++) {
        most = fmax(most, image_memory(job, i));
        sources += plan_sources(job, &job->detect[i]);
    }
    return costs[RX_COST_PROGRAM].fixed +
           costs[RX_COST_PROGRAM].thread * (job->options->pipeline.nthreads - 1) + most +
           job->options->nrestorers * plan_row_bytes(job->row) * sources + reference * job->reference_bytes;
}

/* Of so many Mpixels with a PSF of so many terms, without detection and measurement. */
static double restoration_seconds(const rx_restore_params *par, rx_cost_name name, double mpixels, int terms)
{
    const int varies = terms > 1;
    if (name == RX_COST_RL) /* of 4 transforms 2 are made for each term */
        return mpixels * costs[RX_COST_RL_ITERATION].mpixel_seconds * par->rl_niter * (terms + 1) / 2;
    if (name == RX_COST_RL_BLIND)
        return mpixels * costs[RX_COST_BLIND_ITERATION].mpixel_seconds * par->blind_cycles *
               par->blind_psf_niter * (1 + 0.7 * varies);
    if (name == RX_COST_NET)
        return mpixels *
               (costs[RX_COST_NET_FORWARD].mpixel_seconds + (par->model != NULL ? larger_seconds(par) : 0) +
                has_second_stage(par) * costs[RX_COST_NET_STAGE].mpixel_seconds +
                varies * (terms + 6) * costs[RX_COST_PSF_TERM].mpixel_seconds) *
               (1 + par->verify_seams);
    return 0;
}

/* Of what AUTO chooses by: each candidate goes twice or a little more through each window (check/choice.h). */
static double choice_seconds(const rx_restore_params *par, double mpixels, double sources, int terms)
{
    static const rx_cost_name candidates[] = {RX_COST_NONE, RX_COST_RL, RX_COST_NET};
    const double tried = fmin(mpixels, 1.05), often = 2.5;
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += often * (restoration_seconds(par, candidates[k], tried, terms) +
                        tried * costs[candidates[k]].mpixel_seconds +
                        sources * tried / fmax(mpixels, 1e-6) * costs[candidates[k]].source_seconds);
    return sum;
}

static double image_seconds(const rx_plan_job *job, int i)
{
    enum { CROWDED = 5000, WINDOW = 512 }; /* sources per Mpixel at which templates take twice as long */
    const rx_options *options = job->options;
    const rx_restore_params *par = &options->pipeline.restore;
    const double mpixels = 1e-6 * plan_pixels(&job->detect[i]), sources = plan_sources(job, &job->detect[i]);
    const int terms = job->terms[i], varies = terms > 1, dual = job->measure != NULL;
    double times[RX_NCOSTS], sum = 0;
#define SECONDS(name) (mpixels * costs[name].mpixel_seconds + sources * costs[name].source_seconds)
    if (measures_psf(options))
        sum += (1 + dual) * SECONDS(RX_COST_PSF_AUTO);
    for (int k = 0; k < options->nrestorers; k++) {
        const rx_cost_name name = cost_of_kind(options->restorers[k]);
        count_rows(job, i, options->restorers[k], times);
        const double restoration = restoration_seconds(par, name, mpixels, terms);
        if (rx_restorer_is_auto(options->restorers[k]))
            sum += choice_seconds(par, mpixels, sources, terms);
        const double templates =
            SECONDS(RX_COST_TEMPLATES) * (1 + sources / fmax(mpixels, 1e-6) / CROWDED) * (varies ? 1.8 : 1);
        /* how often the checks send a copy the same way; the guard's windows, 512 pixels wide and at worst 1024 too */
        double rounds = rx_max_int(options->check.blank_check, 0);
        if (times[RX_COST_GUARD] > 0)
            rounds += fmin(5e-6 * WINDOW * WINDOW / fmax(mpixels, 1e-6), 2);
        if (options->check.self_check)
            rounds += ceil((double)options->check.count / ceil(options->check.density * fmax(mpixels, 1e-6)));
        sum += (restoration + SECONDS(name)) * (1 + rounds) +
               templates * (options->pipeline.templates.wanted + rounds * options->check.templates);
        if (times[RX_COST_SECOND_RESTORED] > 0 && !options->pipeline.measure_original)
            sum += restoration;
        sum += options->nchecks * SECONDS(RX_COST_CHECKIMAGE) +
               SECONDS(RX_COST_REPORT) * (options->reference.name != NULL);
    }
    return sum + (1 + dual) * SECONDS(RX_COST_TILE);
#undef SECONDS
}

/* A digest as long as any. */
static const char digest[] = "00000000000000000000000000000000";
_Static_assert(sizeof digest == RX_HASH_TEXT, "as many digits as a digest has");

static void add_input(void *user, const char *key, const char *name, const char *none)
{
    (void)none;
    rx_record_add(user, "READ", "", "%s %s %s", digest, key, name);
}

/* What the run will say of its outputs: the catalogue, check-images and covariances of each restorer. */
static void add_products(rx_record *record, const rx_options *options, int images)
{
    for (int part = 1; part <= images; part++)
        for (int r = 0; r < options->nrestorers; r++) {
            rx_record_product(record, digest, part, options->catalog_name);
            rx_record_product(record, digest, part, options->covariance_name);
            for (int i = 0; i < options->nchecks; i++)
                rx_record_product(record, digest, part, options->check_names[i]);
        }
    rx_record_add(record, "OUTPUT", "", "%s", options->catalog_name);
    rx_record_add(record, "END", "", "%s", digest);
}

/* The cards of the record. */
static rx_status count_cards(const rx_config *config, const rx_plan_job *job, const char *image,
                             const char *const names[2], size_t *cards, rx_error *err)
{
    rx_record record = {0};
    rx_text text = {0};
    rx_record_run(&record, config, image);
    rx_status status = rx_inputs_visit(config, job->options, names, 0, add_input, &record, err);
    add_products(&record, job->options, job->n);
    rx_record_cards(&record, &text);
    *cards = text.length / 80;
    if (status == RX_OK && (record.failed || text.failed))
        status = rx_error_memory(err, 0);
    rx_record_free(&record);
    rx_text_free(&text);
    return status;
}

static rx_status reference_size(const rx_options *options, double *bytes, rx_error *err)
{
    struct stat file;
    *bytes = 0;
    if (options->reference.name == NULL)
        return RX_OK;
    char *path = rx_strdup(options->reference.name);
    if (path == NULL)
        return rx_error_memory(err, 0);
    if (stat(path, &file) != 0)
        path[strcspn(path, "[")] = '\0'; /* of name[n] */
    const int missing = stat(path, &file) != 0;
    free(path);
    if (missing)
        return rx_error_file(err, options->reference.name, "cannot be read");
    *bytes = (double)file.st_size;
    return RX_OK;
}

static rx_status same_shapes(const char *name, const rx_tile_shape *detect, int n,
                             const rx_tile_shape *measure, int nmeasure, rx_error *err)
{
    if (n != nmeasure)
        return rx_error_at(err, RX_INPUT, name, -1, 0, "has %d images, the detection file %d; name the HDUs",
                           nmeasure, n);
    for (int i = 0; i < n; i++)
        if (detect[i].width != measure[i].width || detect[i].height != measure[i].height)
            return rx_error_at(err, RX_INPUT, name, measure[i].hdu, 0,
                               "has %d x %d pixels, the detection image %d x %d; dual-image mode needs the "
                               "same grid",
                               measure[i].width, measure[i].height, detect[i].width, detect[i].height);
    return RX_OK;
}

/* Terms whose image is not negligible beside the first; a restorer may leave out more, where the tile has a
 * term's coefficient near 0. */
static int matter(const rx_psf *psf)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    double peak = 0;
    int terms = 0;
    for (int i = 0; i < psf->nbasis; i++) {
        double most = 0;
        for (size_t k = 0; k < n; k++)
            most = fmax(most, fabs(psf->basis[n * (size_t)i + k]));
        peak = i == 0 ? most : peak;
        terms += i == 0 || most > 1e-6 * peak;
    }
    return terms;
}

/* Terms of the PSF of image i; the run refuses a file that cannot be used. */
static int count_terms(const rx_options *options, const rx_tile_shape *shape, int i)
{
    const rx_image image = {.width = shape->width, .height = shape->height};
    rx_psf_params par = options->pipeline.psf;
    rx_psf *psf = NULL;
    int terms = 1;
    par.file = options->pipeline.psf_files[0];
    par.extension = i + 1;
    if ((par.type == RX_PSF_PSFEX || par.type == RX_PSF_FILE) && par.file != NULL &&
        rx_psf_make(&par, &image, NULL, NULL, &psf, NULL) == RX_OK)
        terms = matter(psf);
    rx_psf_free(psf);
    return terms;
}

static rx_status fill(const rx_plan_job *job, rx_plan *plan, rx_error *err)
{
    plan->images = job->n;
    plan->threads = job->options->pipeline.nthreads;
    for (int i = 0; i < job->n; i++) {
        plan->pixels += plan_pixels(&job->detect[i]);
        plan->sources += plan_sources(job, &job->detect[i]);
    }
    plan->memory = ceil(plan_memory(job));
    plan->cpu_seconds = costs[RX_COST_PROGRAM].mpixel_seconds; /* its start */
    for (int i = 0; i < job->n; i++)
        plan->cpu_seconds += image_seconds(job, i);
    return plan_outputs(job, plan, err);
}

rx_status rx_plan_make(const rx_config *config, const char *image, rx_log *log, rx_plan **dst, rx_error *err)
{
    const rx_sources none = {0};
    rx_options *options = NULL;
    rx_tile_shape *detect = NULL, *measure = NULL;
    rx_table *row = NULL;
    rx_plan *plan = NULL;
    int *terms = NULL;
    char *names[2] = {NULL, NULL};
    rx_plan_job job = {0};
    int nmeasure = 0;
    rx_status status = RX_OK;
    RX_TRY(rx_options_from_config(config, log, &options, err));
    RX_TRY_EXIT(RX_MAKE(plan, 1, err));
    if (!rx_name_split_images(image, &names[0], &names[1]))
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(rx_tile_shapes(names[0], log, &detect, &job.n, err));
    if (names[1] != NULL)
        RX_TRY_EXIT(rx_tile_shapes(names[1], log, &measure, &nmeasure, err));
    if (names[1] != NULL)
        RX_TRY_EXIT(same_shapes(names[1], detect, job.n, measure, nmeasure, err));
    job.options = options;
    job.xml_name = config->write_xml ? config->xml_name : NULL;
    RX_TRY_EXIT(count_cards(config, &job, image, (const char *const *)names, &job.record_cards, err));
    RX_TRY_EXIT(rx_catalog_table(options->columns, &(rx_image){0}, &none, &row, err));
    RX_TRY_EXIT(reference_size(options, &job.reference_bytes, err));
    RX_TRY_EXIT(RX_MAKE(terms, (size_t)job.n, err));
    for (int i = 0; i < job.n; i++)
        terms[i] = count_terms(options, &detect[i], i);
    job.terms = terms;
    job.detect = detect;
    job.measure = measure;
    job.row = row;
    RX_TRY_EXIT(fill(&job, plan, err));
    *dst = plan;
    plan = NULL;
exit:
    rx_plan_free(plan);
    rx_table_free(row);
    free(terms);
    free(detect);
    free(measure);
    free(names[0]);
    free(names[1]);
    rx_options_free(options);
    return status;
}

void rx_plan_free(rx_plan *plan)
{
    if (plan == NULL)
        return;
    for (int i = 0; i < plan->noutputs; i++)
        free(plan->outputs[i].name);
    free(plan->outputs);
    free(plan);
}
