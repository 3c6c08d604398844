/* From keywords to params structs. Plain values go by the rows of config/keys.def; here is what depends on more
 * than one keyword, on columns or on files. */
#include "stage/options.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/threads.h"
#include "config/config_fields.h"
#include "config/kernel.h"
#include "stage/checkimages.h"
#include "stage/pipeline.h"
#include "stage/positions.h"

#include "config/fill_rows.h"

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

/* The rows of config/keys.def that fill rx_options itself; those of its pipeline: rx_pipeline_fill(). */
/* clang-format off */
#define STAGE_WORDS RX_FILL_WORDS
#define STAGE(how, field) RX_FILL(rx_options, how, field)
#define TILES(how, field) STAGE(how, tile[0].field), STAGE(how, tile[1].field)
#define PIPELINE_WORDS(...) NULL
#define PIPELINE(how, field) RX_FILL_NOTHING
#define BACKGROUNDS(how, field) RX_FILL_NOTHING
static const rx_fill rows[] = {
#include "config/keys.def"
};
/* clang-format on */

void rx_options_model_path(const char *name, const char *installed, rx_text *dst)
{
    if (strchr(name, '/') == NULL) {
        rx_text_printf(dst, "%s/%s", installed, name);
        if (dst->failed || access(dst->data, F_OK) == 0)
            return;
        rx_text_free(dst);
    }
    rx_text_add(dst, name);
}

/* The network's model. One whose training has not ended is taken with a warning where NET_MODEL was set. Errors: RX_INPUT
 * (such a model where it was not), RX_SYSTEM. */
static rx_status read_model(rx_options *options, rx_log *log, rx_error *err)
{
    rx_text path = {0};
    rx_options_model_path(options->model_name, RX_DATA_FOLDER, &path);
    const int bare = strchr(options->model_name, '/') == NULL;
    rx_status status = RX_OK;
    if (path.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    if (bare && access(path.data, F_OK) != 0)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, options->model_name, -1, 0,
                                "is neither here nor in %s; name the network's model by NET_MODEL",
                                RX_DATA_FOLDER));
    RX_TRY_EXIT(rx_model_read(path.data, &options->model, err));
    if (bare)
        rx_log_hint(log, "NET_MODEL %s is %s", options->model_name,
                    strcmp(path.data, options->model_name) != 0 ? path.data : "that of the current folder");
    const rx_model *model = options->model;
    if (!model->ended) {
        if (options->model_set)
            rx_log_warning(log, "%s: its training has not ended, it is of epoch %ld after %ld", path.data,
                           model->best, model->epochs);
        else
            status = rx_error_at(err, RX_INPUT, path.data, -1, 0,
                                 "its training has not ended, it is of epoch %ld after %ld; let it end, or "
                                 "name the model by NET_MODEL to take it as it is",
                                 model->best, model->epochs);
    }
exit:
    rx_text_free(&path);
    options->pipeline.restore.model = options->model;
    return status;
}

/* <threshold>,<zero-point> is a surface brightness in mag/arcsec2: an absolute threshold in ADU/pixel once
 * the pixel scale is known (1 arcsec when it is not given). */
static void surface_brightness(const rx_config *cfg, const rx_reals *key, double *threshold, int *absolute)
{
    if (key->n < 2)
        return;
    const double scale = cfg->pixel_scale > 0.0 ? cfg->pixel_scale : 1.0;
    *threshold = pow(10.0, -0.4 * (key->v[0] - key->v[1])) * scale * scale;
    *absolute = 1;
}

/* The standard file, which is not there, stands for what is built in. */
static bool is_built_in(const char *name, const char *standard)
{
    return strcmp(name, standard) == 0 && access(name, F_OK) != 0;
}

static rx_status noise_options(const rx_config *cfg, rx_options *dst, rx_error *err)
{
    rx_correlation_params *noise = &dst->pipeline.noise;
    if (noise->origin != RX_NOISE_GIVEN)
        return RX_OK;
    if (cfg->noise_kernel_name[0] == '\0')
        return rx_error_set(
            err, RX_USAGE,
            "NOISE_CORRELATION FILE needs NOISE_KERNEL_NAME, a kernel as a .conv file; or take AUTO");
    RX_TRY(rx_kernel_read(cfg->noise_kernel_name, &dst->noise_kernel, err));
    noise->kernel = dst->noise_kernel->values;
    noise->kernel_width = dst->noise_kernel->width;
    noise->kernel_height = dst->noise_kernel->height;
    return RX_OK;
}

static rx_status kernel_options(const rx_config *cfg, rx_options *dst, rx_error *err)
{
    RX_TRY(noise_options(cfg, dst, err));
    if (!cfg->filter)
        return RX_OK;
    rx_detect_params *detect = &dst->pipeline.detect;
    if (is_built_in(cfg->filter_name, "default.conv")) {
        detect->filter = rx_kernel_built_in;
        detect->filter_width = detect->filter_height = 3;
        detect->filter_normalise = true;
        return RX_OK;
    }
    RX_TRY(rx_kernel_read(cfg->filter_name, &dst->kernel, err));
    detect->filter = dst->kernel->values;
    detect->filter_width = dst->kernel->width;
    detect->filter_height = dst->kernel->height;
    detect->filter_normalise = dst->kernel->normalise;
    return RX_OK;
}

/* Maps by what the other keywords of weights say, one item serving two images; flag maps are read when a column
 * asks for them, as SExtractor does. */
static void tile_options(const rx_config *cfg, rx_options *dst)
{
    const rx_strings *weights = &cfg->weight_image;
    for (int role = 0; role < 2; role++) {
        rx_tile_params *tile = &dst->tile[role];
        tile->nthreads = dst->pipeline.nthreads;
        tile->own_maps =
            tile->weight_type == RX_WEIGHT_NONE && !rx_settings_states(&cfg->settings, "WEIGHT_TYPE");
        if (tile->weight_type > RX_WEIGHT_BACKGROUND && weights->n > 0)
            tile->weight_name = weights->v[role < weights->n ? role : weights->n - 1];
    }
    if (!rx_columns_requested(dst->columns, "IMAFLAGS_ISO", NULL) &&
        !rx_columns_requested(dst->columns, "NIMAFLAGS_ISO", NULL))
        return;
    for (int i = 0; i < cfg->flag_image.n && i < RX_MAX_FLAGMAPS; i++)
        dst->tile[0].flag_names[dst->tile[0].nflags++] = cfg->flag_image.v[i];
}

/* What no column, check-image or report asks for; matters for FLAGS too, as in SExtractor. */
static unsigned skipped_measurements(const rx_config *cfg, const rx_options *options)
{
    const rx_column_list *columns = options->columns;
    const int report = cfg->reference_name[0] != '\0' ? options->check.quality.flux : -1;
    int radius = options->tile_page || rx_columns_mention(columns, "FLUX_RADIUS");
    int window = rx_columns_mention(columns, "WIN") || report == RX_QUALITY_WIN;
    /* windows are as wide as the half-light radius says, a share of FLUX_AUTO */
    int automatic = radius || window || rx_columns_mention(columns, "_AUTO") ||
                    rx_columns_mention(columns, "_BEST") || rx_columns_mention(columns, "KRON") ||
                    rx_columns_mention(columns, "MASKED_FRACTION") || report == RX_QUALITY_AUTO;
    for (int i = 0; i < cfg->checkimage_type.n; i++)
        automatic |= strcmp(cfg->checkimage_type.v[i], "APERTURES") == 0;
    unsigned skip = 0;
    if (!rx_columns_mention(columns, "_APER") && report != RX_QUALITY_APER)
        skip |= RX_SKIP_APER;
    if (!automatic)
        skip |= RX_SKIP_AUTO;
    if (!rx_columns_mention(columns, "PETRO") && report != RX_QUALITY_PETRO)
        skip |= RX_SKIP_PETRO;
    if (!window)
        skip |= RX_SKIP_WIN;
    return radius ? skip : skip | RX_SKIP_RADIUS;
}

static rx_status measure_options(const rx_config *cfg, rx_log *log, rx_options *dst, rx_error *err)
{
    rx_measure_params *par = &dst->pipeline.measure;
    int vignet[2];
    par->skip = skipped_measurements(cfg, dst);
    if (rx_columns_requested(dst->columns, "CLASS_STAR", NULL))
        RX_TRY(rx_starclass_read(cfg->starnnw_name, &dst->star_net, err));
    par->star_net = dst->star_net;
    static const char *const aper[] = {"FLUX_APER", "FLUXERR_APER", "MAG_APER", "MAGERR_APER"};
    for (size_t i = 0; i < COUNT(aper); i++)
        rx_columns_clip(dst->columns, aper[i], par->naper, "PHOT_APERTURES", log);
    rx_columns_clip(dst->columns, "FLUX_RADIUS", par->nradii, "PHOT_FLUXFRAC", log);
    rx_columns_clip(dst->columns, "IMAFLAGS_ISO", dst->tile[0].nflags, "FLAG_IMAGE", log);
    rx_columns_clip(dst->columns, "NIMAFLAGS_ISO", dst->tile[0].nflags, "FLAG_IMAGE", log);
    rx_columns_requested(dst->columns, "VIGNET", vignet);
    par->vignet_width = vignet[0];
    par->vignet_height = vignet[1];
    return RX_OK;
}

/* As SExtractor measures what the columns ask for, templates are fitted where something asks for them. */
static rx_status template_options(rx_options *dst, rx_error *err)
{
    rx_template_params *par = &dst->pipeline.templates;
    const int compared = dst->check.quality.flux == RX_QUALITY_TEMPLATE;
    par->par.covariance = dst->covariance_name[0] != '\0';
    const int injected = rx_columns_mention(dst->columns, "_INJECTED");
    if (injected && !dst->check.self_check)
        return rx_error_set(err, RX_USAGE,
                            "MAGERR_INJECTED and MAGERR95_INJECTED come from objects that SELF_CHECK "
                            "injects; give SELF_CHECK Y, or leave out these columns");
    /* checks inject objects and look at their fluxes without a reference catalogue, too */
    dst->check.templates = par->precision > 0.0 || compared || injected;
    for (int i = 0; i < dst->nchecks; i++)
        par->par.keep_model |= strncmp(dst->check_types[i], "TEMPLATE_", 9) == 0;
    par->par.sersic_fits = rx_columns_mention(dst->columns, "SPHEROID");
    par->par.point_fits = par->par.sersic_fits || rx_columns_mention(dst->columns, "PSF") ||
                          rx_columns_mention(dst->columns, "SPREAD");
    par->wanted = injected || par->precision > 0.0 || dst->positions != NULL || par->par.covariance ||
                  par->par.keep_model || par->par.point_fits || (compared && dst->reference.name != NULL) ||
                  rx_columns_mention(dst->columns, "TEMPLATE") ||
                  rx_columns_mention(dst->columns, "_MODEL") ||
                  rx_columns_requested(dst->columns, "FLAGS_RESTORE", NULL) ||
                  rx_columns_requested(dst->columns, "P_REAL", NULL) ||
                  rx_columns_requested(dst->columns, "P_BLEND", NULL);
    par->par.keep_model |= par->wanted && dst->tile_page;
    return RX_OK;
}

/* RESTORE_TYPE FILE: one image with its PSF, which nothing can be injected into. */
static rx_status file_options(const rx_config *cfg, rx_options *dst, rx_error *err)
{
    rx_restore_params *par = &dst->pipeline.restore;
    bool wanted = false;
    char *end = NULL;
    for (int i = 0; i < dst->nrestorers; i++)
        wanted |= strcmp(dst->restorers[i]->name, "FILE") == 0;
    if (!wanted) {
        dst->tile[0].restored_name = dst->tile[0].restored_noise_name = NULL;
        return RX_OK;
    }
    if (cfg->restored_name[0] == '\0')
        return rx_error_set(err, RX_USAGE,
                            "RESTORE_TYPE FILE needs the restored pixels; name their file by RESTORED_NAME");
    if (dst->check.self_check)
        return rx_error_set(
            err, RX_USAGE,
            "SELF_CHECK injects objects, which FILE would have to restore; leave out one of the two");
    if (dst->restored_rms)
        return rx_error_set(
            err, RX_USAGE,
            "CHECKIMAGE_TYPE RESTORED_RMS has the tile restored again, which FILE cannot do; leave "
            "out one of the two");
    par->file_fwhm = strtod(cfg->restored_psf, &end);
    if (*end != '\0' || cfg->restored_psf[0] == '\0') {
        par->file_fwhm = 0;
        par->file_psf = cfg->restored_psf;
    }
    if (par->file_fwhm < 0 || (par->file_fwhm == 0 && (par->file_psf == NULL || par->file_psf[0] == '\0')))
        return rx_error_set(err, RX_USAGE,
                            "RESTORE_TYPE FILE needs the PSF of the restored pixels; give RESTORED_PSF its "
                            "FWHM in pixels, or the file of its image");
    return RX_OK;
}

static rx_status position_options(const rx_config *cfg, rx_options *dst, rx_error *err)
{
    dst->positions_name = cfg->positions_name;
    if (cfg->positions_name[0] == '\0')
        return RX_OK;
    if (dst->catalog_type == RX_CATALOG_NONE || strcmp(dst->catalog_name, "STDOUT") == 0)
        return rx_error_set(err, RX_USAGE,
                            "fluxes at the positions of POSITIONS_NAME go into a file beside the catalogue; "
                            "give CATALOG_NAME a file's name, and CATALOG_TYPE not NONE");
    return rx_position_list_read(cfg->positions_name, &dst->positions, err);
}

static rx_status checkimage_options(const rx_config *cfg, rx_log *log, rx_options *dst, rx_error *err)
{
    dst->pipeline.restore.keep_reblurred |= dst->tile_page;
    for (int i = 0; i < cfg->checkimage_type.n; i++) {
        const char *type = cfg->checkimage_type.v[i];
        if (strcmp(type, "NONE") == 0)
            continue;
        if (!rx_checkimage_offered(type)) {
            rx_log_warning(log, "CHECKIMAGE_TYPE %s is not made here and left out", type);
            continue;
        }
        if (i >= cfg->checkimage_name.n)
            return rx_error_set(err, RX_USAGE,
                                "CHECKIMAGE_TYPE has more items than CHECKIMAGE_NAME; name a file for %s",
                                type);
        dst->restored_rms |= strcmp(type, "RESTORED_RMS") == 0;
        dst->pipeline.restore.keep_reblurred |= dst->restored_rms || strcmp(type, "RESIDUAL") == 0;
        dst->pipeline.keep_filtered |= strcmp(type, "FILTERED") == 0;
        dst->pipeline.restore.keep_support |= strcmp(type, "SUPPORT") == 0;
        dst->write_psf |= strcmp(type, "PSF") == 0;
        dst->check_types[dst->nchecks] = type;
        dst->check_names[dst->nchecks++] = cfg->checkimage_name.v[i];
    }
    return RX_OK;
}

static rx_status reference_options(const rx_config *cfg, rx_options *dst, rx_error *err)
{
    if (cfg->reference_name[0] == '\0') {
        dst->reference.name = NULL;
        return cfg->qa_gates[0] == '\0'
                   ? RX_OK
                   : rx_error_set(err, RX_USAGE, "QA_GATES needs a reference catalogue; give REFERENCE_NAME");
    }
    dst->reference.ncolumns = cfg->reference_columns.n;
    dst->reference.columns = (const char *const *)cfg->reference_columns.v;
    if (cfg->reference_color_term.n > 0) {
        char *end = NULL;
        const rx_strings *term = &cfg->reference_color_term;
        dst->reference.colour_term = strtod(term->v[0], &end);
        if (term->n != 3 || *end != '\0' || !isfinite(dst->reference.colour_term))
            return rx_error_set(err, RX_USAGE,
                                "REFERENCE_COLOR_TERM is <coefficient>,<first>,<second>, such as 0.05,g,r");
        dst->reference.ncolour = term->n;
        dst->reference.colour = (const char *const *)term->v;
    }
    dst->qa.by.seed = dst->pipeline.seed;
    dst->qa.by.nthreads = dst->pipeline.nthreads;
    if (cfg->qa_gates[0] == '\0')
        return RX_OK;
    rx_status status = rx_gates_read(cfg->qa_gates, &dst->gates, err);
    dst->qa.gates = dst->gates;
    return status;
}

static rx_status assoc_options(const rx_config *cfg, rx_options *dst, rx_error *err)
{
    if (!rx_columns_requested(dst->columns, "VECTOR_ASSOC", NULL) &&
        !rx_columns_requested(dst->columns, "NUMBER_ASSOC", NULL))
        return RX_OK;
    rx_status status = rx_assoc_read(cfg->assoc_name, &dst->assoc_list, err);
    if (status == RX_OK)
        return rx_assoc_check(&dst->assoc, dst->assoc_list, err);
    if (status == RX_INPUT && err != NULL) {
        size_t used = strlen(err->text);
        snprintf(err->text + used, sizeof err->text - used,
                 "; give ASSOC_NAME, or leave VECTOR_ASSOC and NUMBER_ASSOC out of the columns");
    }
    return status;
}

/* What the rows of keys.def say, and what follows from several of them without a file being read. */
static void plain_options(const rx_config *cfg, rx_log *log, rx_options *dst)
{
    rx_pipeline_params *pipeline = &dst->pipeline;
    rx_detect_params *detect = &pipeline->detect;
    dst->tile[0].weight_threshold = dst->tile[1].weight_threshold = NAN; /* where it is not given */
    dst->reference.flux_zeropoint = NAN;
    rx_fill_all(rows, (int)COUNT(rows), &cfg->settings, dst);
    rx_pipeline_fill(pipeline, &cfg->settings,
                     cfg->plan ? rx_threads_count(cfg->nthreads) /* the run may be elsewhere */
                               : rx_threads_had(cfg->nthreads, log));
    surface_brightness(cfg, &cfg->detect_thresh, &detect->threshold, &detect->absolute);
    detect->filter_auto &= !detect->absolute;
    surface_brightness(cfg, &cfg->analysis_thresh, &detect->analysis_threshold, &detect->analysis_absolute);
    pipeline->seeing_stated = rx_settings_states(&cfg->settings, "SEEING_FWHM");
    pipeline->stated_scale = rx_settings_states(&cfg->settings, "PIXEL_SCALE") ? cfg->pixel_scale : 0.0;
    dst->model_set = rx_settings_states(&cfg->settings, "NET_MODEL");
    for (int i = 0; i < cfg->restore_type.n; i++)
        dst->restorers[dst->nrestorers++] = rx_restorer_find(cfg->restore_type.v[i]);
    /* readers of tables go by the name: they will not open a text that is called cat.fits */
    const char *end = strrchr(cfg->catalog_name, '.');
    if (strncmp(cfg->catalog_type, "ASCII", 5) == 0 && end != NULL &&
        (strcasecmp(end, ".fits") == 0 || strcasecmp(end, ".fit") == 0))
        rx_log_warning(log, "%s is no FITS file but %s; give CATALOG_TYPE FITS, or another CATALOG_NAME",
                       cfg->catalog_name, cfg->catalog_type);
    if (strcasecmp(cfg->catalog_name, "NONE") == 0 && strcmp(cfg->catalog_type, "NONE") != 0)
        rx_log_warning(log,
                       "CATALOG_NAME %s is the name of a file, as in SExtractor; give CATALOG_TYPE NONE for "
                       "no catalogue",
                       cfg->catalog_name);
}

/* Without a configuration and without the file, those of the shipped default.param. */
rx_status rx_options_columns(const rx_config *cfg, rx_log *log, rx_column_list **dst, rx_error *err)
{
    return is_built_in(cfg->parameters_name, "default.param")
               ? rx_columns_default(dst, err)
               : rx_columns_read(cfg->parameters_name, log, dst, err);
}

static int has_column(const void *columns, const char *part)
{
    return rx_columns_mention(columns, part);
}

rx_idle rx_options_idle(const rx_column_list *columns)
{
    return (rx_idle){.has_column = columns != NULL ? has_column : NULL, .columns = columns};
}

rx_status rx_options_from_config(const rx_config *cfg, rx_log *log, rx_options **dst, rx_error *err)
{
    return rx_options_with_columns(cfg, NULL, log, dst, err);
}

rx_status rx_options_with_columns(const rx_config *cfg, rx_column_list *columns, rx_log *log,
                                  rx_options **dst, rx_error *err)
{
    rx_options *options = RX_NEW(rx_options, 1);
    if (options == NULL) {
        rx_columns_free(columns);
        return rx_error_memory(err, sizeof *options);
    }
    options->columns = columns;
    plain_options(cfg, log, options);
    rx_status status;
    RX_TRY_EXIT(kernel_options(cfg, options, err));
    for (int i = 0; i < options->nrestorers && options->model == NULL; i++)
        if ((options->restorers[i]->traits & RX_TRAIT_TRAINED) != 0 ||
            rx_restorer_is_auto(options->restorers[i]))
            RX_TRY_EXIT(read_model(options, log, err));
    options->columns_built_in = columns == NULL && is_built_in(cfg->parameters_name, "default.param");
    if (columns == NULL)
        RX_TRY_EXIT(rx_options_columns(cfg, log, &options->columns, err));
    RX_TRY_EXIT(rx_columns_need(options->columns, options->catalog_type, err));
    tile_options(cfg, options);
    RX_TRY_EXIT(measure_options(cfg, log, options, err));
    RX_TRY_EXIT(checkimage_options(cfg, log, options, err));
    RX_TRY_EXIT(assoc_options(cfg, options, err));
    RX_TRY_EXIT(reference_options(cfg, options, err));
    RX_TRY_EXIT(file_options(cfg, options, err));
    RX_TRY_EXIT(position_options(cfg, options, err));
    RX_TRY_EXIT(template_options(options, err));
    *dst = options;
    options = NULL;
exit:
    rx_options_free(options);
    return status;
}

void rx_options_free(rx_options *options)
{
    if (options == NULL)
        return;
    rx_columns_free(options->columns);
    rx_assoc_free(options->assoc_list);
    rx_table_free(options->positions);
    rx_kernel_free(options->kernel);
    rx_kernel_free(options->noise_kernel);
    rx_gates_free(options->gates);
    rx_starclass_free(options->star_net);
    rx_model_free(options->model);
    free(options);
}
