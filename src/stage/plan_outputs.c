/* Outputs of a run, and how large they may become. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/names.h"
#include "stage/plan_parts.h"

/* Cards of an HDU beyond those of the tile and of the record: what FITS and its checksums need, and facts of
 * the extension at most; and of a column. */
enum { OWN_CARDS = 20, FACT_CARDS = 140, COLUMN_CARDS = 8, CARD = 80, BLOCK = 2880 };

/* Bytes at most of pages and tables with their figures: always, per source, per injected object, per byte of
 * the reference catalogue. */
static const double PAGE = 4e6, PAGE_SOURCE = 600, PAGE_REFERENCE = 12;
static const double COVARIANCE = 2500;                  /* of a source with those of its group */
static const double TEXT_CELL = 26, TEXT_COLUMN = 1200; /* a number as text, a column's description */
enum { CELL_MARKUP = 9, ROW_MARKUP = 12 };              /* of a VOTable */

double rx_plan_pixels(const rx_tile_shape *shape)
{
    return (double)shape->width * shape->height;
}

double rx_plan_sources(const rx_plan_job *job, const rx_tile_shape *shape)
{
    return ceil(1e-6 * rx_plan_pixels(shape) * job->options->plan_density);
}

double rx_plan_row_bytes(const rx_table *row)
{
    double bytes = 0;
    for (int i = 0; i < row->ncolumns; i++)
        bytes +=
            (double)rx_column_elements(&row->columns[i]) * (double)rx_column_element_size(&row->columns[i]);
    return bytes;
}

rx_status rx_plan_add(rx_plan *plan, const char *name, double bytes, rx_error *err)
{
    rx_plan_output *outputs = rx_regrow(plan->outputs, (size_t)plan->noutputs + 1, sizeof *outputs);
    if (outputs == NULL)
        return rx_error_memory(err, 0);
    plan->outputs = outputs;
    outputs[plan->noutputs] = (rx_plan_output){rx_strdup(name), (uint64_t)ceil(bytes)};
    return outputs[plan->noutputs++].name != NULL ? RX_OK : rx_error_memory(err, 0);
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
    const rx_background_params *par = &job->options->background[0];
    double sum = 0;
    for (int i = 0; i < job->n; i++) {
        const rx_tile_shape *shape = &job->detect[i];
        double pixels = rx_plan_pixels(shape);
        if (strncmp(type, "MINIBACK", 8) == 0)
            pixels =
                ceil((double)shape->width / par->mesh_width) * ceil((double)shape->height / par->mesh_height);
        sum += header(job, shape, 0) + blocks(sizeof(float) * pixels);
    }
    return sum;
}

/* --- catalogues --- */

static double fits_table(const rx_plan_job *job, double row, int columns)
{
    double sum = blocks(CARD * (OWN_CARDS + FACT_CARDS + (double)job->record_cards));
    for (int i = 0; i < job->n; i++)
        sum += header(job, &job->detect[i], columns) + blocks(row * rx_plan_sources(job, &job->detect[i]));
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
        sum += rx_plan_sources(job, &job->detect[i]);
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
        return fits_table(job, rx_plan_row_bytes(row), row->ncolumns) +
               (type == RX_CATALOG_FITS_LDAC ? ldac_headers(job) : 0);
    const int markup = type == RX_CATALOG_VOTABLE;
    double sum = TEXT_COLUMN * (2 + row->ncolumns) * (markup ? job->n : 1);
    if (markup)
        sum += job->n * 4 * CARD * ((double)job->record_cards + FACT_CARDS + OWN_CARDS);
    return sum +
           all_sources(job) * (cells * (TEXT_CELL + (markup ? CELL_MARKUP : 0)) + (markup ? ROW_MARKUP : 1));
}

/* --- all of them --- */

static rx_status add_tagged(rx_plan *plan, const char *name, const char *tag, double bytes, rx_error *err)
{
    char *whole = rx_name_with_tag(name, tag);
    rx_status status = whole != NULL ? rx_plan_add(plan, whole, bytes, err) : rx_error_memory(err, 0);
    free(whole);
    return status;
}

static rx_status add_run(const rx_plan_job *job, const char *tag, rx_plan *plan, rx_error *err)
{
    const rx_options *options = job->options;
    const char *covariances = options->templates.covariances;
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
        const double sources = rows > 0 ? rows : rx_plan_sources(job, &job->detect[i]);
        const double each = PAGE + more + PAGE_SOURCE * sources;
        status = add_tagged(plan, name, tag, job->options->nrestorers * each, err);
    }
    return status;
}

rx_status rx_plan_outputs(const rx_plan_job *job, rx_plan *plan, rx_error *err)
{
    const rx_options *options = job->options;
    rx_status status = RX_OK;
    for (int i = 0; i < options->nrestorers && status == RX_OK; i++)
        status = add_run(job, options->nrestorers > 1 ? options->restorers[i]->name : NULL, plan, err);
    if (status == RX_OK && options->reference.name != NULL)
        status = add_folders(job, options->qa_name, 0, PAGE_REFERENCE * job->reference_bytes, plan, err);
    if (status == RX_OK && options->self_check && options->self_check_name[0] != '\0')
        status =
            add_folders(job, options->self_check_name, 3.0 * (double)options->self_check_count, 0, plan, err);
    return status;
}
