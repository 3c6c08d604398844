/* The pipeline on an image in memory, and its rows of config/keys.def. */
#include "stage/pipeline.h"

#include <strings.h>

#include "base/threads.h"
#include "catalog/catalog.h"
#include "config/config_fields.h"
#include "config/kernel.h"
#include "config/settings.h"
#include "pipeline/proposals.h"
#include "psf/psf_model.h"
#include "stage/coordinates.h"
#include "stage/psf_hints.h"

#include "config/fill_rows.h"

/* clang-format off */
#define PIPELINE_WORDS RX_FILL_WORDS
#define PIPELINE(how, field) RX_FILL(rx_pipeline_params, how, field)
#define BACKGROUNDS(how, field) PIPELINE(how, background[0].field), PIPELINE(how, background[1].field)
#define STAGE_WORDS(...) NULL
#define STAGE(how, field) RX_FILL_NOTHING
#define TILES(how, field) RX_FILL_NOTHING
static const rx_fill rows[] = {
#include "config/keys.def"
};
/* clang-format on */

enum { ROWS = sizeof rows / sizeof rows[0] };

/* The second item of THRESH_TYPE knows RELATIVE and ABSOLUTE. */
static void settle(rx_pipeline_params *params)
{
    params->detect.analysis_absolute = (params->detect.analysis_absolute & RX_THRESH_ABSOLUTE) != 0;
    params->detect.filter_auto &= !params->detect.absolute; /* ADU are of pixels */
}

static void set_threads(rx_pipeline_params *params, int nthreads)
{
    params->nthreads = nthreads;
    params->background[0].nthreads = params->background[1].nthreads = nthreads;
    params->restore.nthreads = nthreads;
    params->detect.nthreads = nthreads;
    params->measure.nthreads = nthreads;
    params->templates.par.nthreads = nthreads;
    params->psf.nthreads = nthreads;
}

void rx_pipeline_fill(rx_pipeline_params *dst, const rx_settings *settings, int nthreads)
{
    dst->templates.par = rx_tphot_defaults();
    dst->examine_residual = 1;
    dst->restore.rl_denoise_by_psf = 1;
    dst->restore.rl_pedestal = RX_RL_PEDESTAL;
    dst->psf_hints = &rx_stage_psf_hints;
    dst->psf.min_stars = 1;
    dst->psf.max_degree = RX_PSF_DEGREE; /* stars that are held out choose a lower one */
    dst->detect.pixstack_max = RX_DETECT_PIXSTACK_MAX;
    dst->detect.subobjects = RX_DETECT_PARTS;
    dst->detect.subobjects_max = RX_DETECT_PARTS_MAX;
    rx_fill_all(rows, ROWS, settings, dst);
    set_threads(dst, nthreads);
    settle(dst);
}

static void set_filter(rx_pipeline_params *params, bool wanted)
{
    rx_detect_params *detect = &params->detect;
    detect->filter = wanted ? rx_kernel_built_in : NULL;
    detect->filter_width = detect->filter_height = wanted ? 3 : 0;
    detect->filter_normalise = wanted;
}

rx_status rx_pipeline_defaults(rx_pipeline_params *dst, rx_error *err)
{
    rx_config *config = NULL;
    RX_TRY(rx_config_new(&config, err));
    *dst = (rx_pipeline_params){.restorer = rx_restorer_find(config->restore_type.v[0])};
    rx_pipeline_fill(dst, &config->settings, rx_threads_count(config->nthreads));
    set_filter(dst, config->filter);
    rx_config_free(config);
    return RX_OK;
}

rx_status rx_pipeline_set(rx_pipeline_params *params, const char *name, const char *value, rx_error *err)
{
    rx_config *config = NULL;
    rx_status status;
    const int before = params->detect.filter_auto;
    RX_TRY(rx_config_new(&config, err));
    RX_TRY_EXIT(rx_settings_set(&config->settings, name, value, NULL, err));
    if (strcasecmp(name, "RESTORE_TYPE") == 0 && config->restore_type.n == 1)
        params->restorer = rx_restorer_find(config->restore_type.v[0]);
    else if (strcasecmp(name, "RESTORE_TYPE") == 0)
        status = rx_error_set(err, RX_USAGE, "RESTORE_TYPE: %d are named; give one, and run once for each",
                              config->restore_type.n);
    else if (strcasecmp(name, "FILTER") == 0)
        set_filter(params, config->filter);
    else if (strcasecmp(name, "NTHREADS") == 0)
        set_threads(params, rx_threads_count(config->nthreads));
    else if (strcasecmp(name, "PIXEL_SCALE") == 0)
        params->stated_scale = config->pixel_scale;
    else
        status = rx_fill_one(rows, ROWS, &config->settings, name, params, err);
    if (status == RX_OK && strcasecmp(name, "SEEING_FWHM") == 0)
        params->seeing_stated = true;
    static const char *const sextractors[] = {"FILTER", "DETECT_THRESH", "THRESH_TYPE"};
    for (size_t i = 0; i < sizeof sextractors / sizeof *sextractors; i++)
        if (strcasecmp(name, sextractors[i]) == 0)
            params->detect.filter_auto = 0;
    if (before && !params->detect.filter_auto && strcasecmp(name, "DETECT_THRESH") != 0)
        rx_proposals_without_psf(&params->detect);
    settle(params);
exit:
    rx_config_free(config);
    return status;
}

rx_status rx_pipeline_run(const rx_pipeline_params *params, const rx_image *image, rx_log *log,
                          rx_result *dst, rx_error *err)
{
    const rx_restorer *kind = params->restorer != NULL ? params->restorer : rx_restorer_find("RL");
    rx_field *field = NULL;
    *dst = (rx_result){0};
    rx_log_part(log, "sky and PSF", 0.0, 0.1);
    rx_status status = rx_field_new(params, rx_pipeline_psf(params, kind), image, log, &field, err);
    if (status == RX_OK)
        status = rx_field_extract(params, kind, field, NULL, log, dst, err);
    if (status == RX_OK)
        status = rx_coordinates_fill(&field->image, dst->sources, err);
    dst->own = field;
    if (status != RX_OK)
        rx_result_free(dst);
    else
        rx_log_part(log, "done", 1.0, 1.0);
    return status;
}

rx_status rx_result_table(const rx_result *result, const char *const *columns, int n, rx_table **dst,
                          rx_error *err)
{
    rx_column_list *list = NULL;
    *dst = NULL;
    rx_status status = rx_columns_of(columns, n, &list, err);
    if (status == RX_OK)
        status = rx_catalog_table(list, &result->measure->image, result->sources, dst, err);
    rx_columns_free(list);
    return status;
}
