/* From settings and headers to a plan. */
#include "stage/plan.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/memory.h"
#include "base/names.h"
#include "psf/psf.h"
#include "stage/inputs.h"
#include "stage/plan_parts.h"

/* A digest as long as any. */
static const char digest[] = "00000000000000000000000000000000";
_Static_assert(sizeof digest == RX_HASH_TEXT, "as many digits as a digest has");

static void add_input(void *user, const char *key, const char *name, const char *none)
{
    (void)none;
    rx_record_add(user, "READ", "", "%s %s %s", digest, key, name);
}

/* What the run will tell of its outputs: the catalogue, check-images and covariances of each restorer. */
static void add_products(rx_record *record, const rx_options *options, int images)
{
    for (int part = 1; part <= images; part++)
        for (int r = 0; r < options->nrestorers; r++) {
            rx_record_product(record, digest, part, options->catalog_name);
            rx_record_product(record, digest, part, options->templates.covariances);
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
    rx_status status = rx_inputs_visit(config, job->options, names[0], names[1], 0, add_input, &record, err);
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
        return rx_error_at(err, RX_INPUT, options->reference.name, -1, 0, "cannot be read: %s",
                           strerror(errno));
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
    rx_psf *psf = NULL;
    int terms = 1;
    if (options->psf.type == RX_PSF_PSFEX && options->psf_files[0] != NULL &&
        rx_psf_psfex(options->psf_files[0], i + 1, options->psf.size, shape->width, shape->height, NULL, &psf,
                     NULL) == RX_OK)
        terms = matter(psf);
    rx_psf_free(psf);
    return terms;
}

static rx_status fill(const rx_plan_job *job, rx_plan *plan, rx_error *err)
{
    plan->images = job->n;
    plan->threads = job->options->nthreads;
    for (int i = 0; i < job->n; i++) {
        plan->pixels += rx_plan_pixels(&job->detect[i]);
        plan->sources += rx_plan_sources(job, &job->detect[i]);
    }
    plan->memory = ceil(rx_plan_memory(job));
    plan->cpu_seconds = rx_plan_seconds(job);
    return rx_plan_outputs(job, plan, err);
}

rx_status rx_plan_make(const rx_config *config, const char *image, rx_log *log, rx_plan **dst, rx_error *err)
{
    const rx_tile nothing = {0};
    const rx_sources none = {0};
    rx_options *options = NULL;
    rx_tile_shape *detect = NULL, *measure = NULL;
    rx_table *row = NULL;
    rx_plan *plan = NULL;
    int *terms = NULL;
    char *names[2] = {NULL, NULL};
    rx_plan_job job = {0};
    int nmeasure = 0;
    rx_status status = rx_options_from_config(config, log, &options, err);
    if (status != RX_OK)
        return status;
    plan = RX_NEW(rx_plan, 1);
    if (plan == NULL || !rx_name_split_images(image, &names[0], &names[1]))
        status = rx_error_memory(err, 0);
    if (status == RX_OK)
        status = rx_tile_shapes(names[0], log, &detect, &job.n, err);
    if (status == RX_OK && names[1] != NULL)
        status = rx_tile_shapes(names[1], log, &measure, &nmeasure, err);
    if (status == RX_OK && names[1] != NULL)
        status = same_shapes(names[1], detect, job.n, measure, nmeasure, err);
    job.options = options;
    if (status == RX_OK)
        status = count_cards(config, &job, image, (const char *const *)names, &job.record_cards, err);
    if (status == RX_OK)
        status = rx_catalog_table(options->columns, &nothing, &none, &row, err);
    if (status == RX_OK)
        status = reference_size(options, &job.reference_bytes, err);
    if (status != RX_OK)
        goto exit;
    terms = RX_NEW(int, (size_t)job.n);
    if (terms == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    for (int i = 0; i < job.n; i++)
        terms[i] = count_terms(options, &detect[i], i);
    job.terms = terms;
    job.detect = detect;
    job.measure = measure;
    job.row = row;
    status = fill(&job, plan, err);
    if (status == RX_OK) {
        *dst = plan;
        plan = NULL;
    }
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
