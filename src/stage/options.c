/* From keywords to params structs. */
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
#include "stage/inputs.h"

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

/* Words of keys.def and the values that a stage knows them by. */
typedef struct word_value {
    const char *word;
    int value;
} word_value;

static const word_value weight_types[] = {{"NONE", RX_WEIGHT_NONE},
                                          {"BACKGROUND", RX_WEIGHT_BACKGROUND},
                                          {"MAP_RMS", RX_WEIGHT_MAP_RMS},
                                          {"MAP_VAR", RX_WEIGHT_MAP_VAR},
                                          {"MAP_WEIGHT", RX_WEIGHT_MAP_WEIGHT}};
static const word_value psf_types[] = {
    {"MOFFAT", RX_PSF_MOFFAT}, {"FILE", RX_PSF_FILE}, {"PSFEX", RX_PSF_PSFEX}, {"AUTO", RX_PSF_AUTO}};
static const word_value out_of_domain[] = {
    {"WARN", RX_DOMAIN_WARN}, {"RL", RX_DOMAIN_RL}, {"FAIL", RX_DOMAIN_FAIL}};
static const word_value precisions[] = {{"AUTO", RX_F32}, {"F32", RX_F32}, {"BF16", RX_BF16}};
static const word_value mask_types[] = {
    {"NONE", RX_NEIGHBOURS_NONE}, {"BLANK", RX_NEIGHBOURS_BLANK}, {"CORRECT", RX_NEIGHBOURS_CORRECT}};
static const word_value catalog_types[] = {{"NONE", RX_CATALOG_NONE},
                                           {"ASCII", RX_CATALOG_ASCII},
                                           {"ASCII_HEAD", RX_CATALOG_ASCII_HEAD},
                                           {"ASCII_SKYCAT", RX_CATALOG_ASCII_SKYCAT},
                                           {"ASCII_VOTABLE", RX_CATALOG_VOTABLE},
                                           {"FITS_1.0", RX_CATALOG_FITS_1_0},
                                           {"FITS", RX_CATALOG_FITS_1_0},
                                           {"FITS_LDAC", RX_CATALOG_FITS_LDAC}};
static const word_value flag_types[] = {{"OR", 0}, {"AND", 1}, {"MIN", 2}, {"MAX", 3}, {"MOST", 4}};
static const word_value assoc_types[] = {{"FIRST", RX_ASSOC_FIRST}, {"NEAREST", RX_ASSOC_NEAREST},
                                         {"MEAN", RX_ASSOC_MEAN},   {"MAG_MEAN", RX_ASSOC_MAG_MEAN},
                                         {"SUM", RX_ASSOC_SUM},     {"MAG_SUM", RX_ASSOC_MAG_SUM},
                                         {"MIN", RX_ASSOC_MIN},     {"MAX", RX_ASSOC_MAX}};
static const word_value assoc_selections[] = {
    {"ALL", RX_ASSOC_ALL}, {"MATCHED", RX_ASSOC_MATCHED}, {"-MATCHED", RX_ASSOC_UNMATCHED}};
static const word_value quality_fluxes[] = {
    {"MAG_AUTO", RX_QUALITY_AUTO},        {"MAG_APER", RX_QUALITY_APER},   {"MAG_ISO", RX_QUALITY_ISO},
    {"MAG_ISOCOR", RX_QUALITY_ISOCOR},    {"MAG_PETRO", RX_QUALITY_PETRO}, {"MAG_WIN", RX_QUALITY_WIN},
    {"MAG_TEMPLATE", RX_QUALITY_TEMPLATE}};

/* The parser admits only words of keys.def, so the first entry is never a silent guess: tests hold the
 * two lists together. */
static int value_of(const word_value *list, size_t n, const char *word)
{
    for (size_t i = 0; i < n; i++)
        if (strcmp(list[i].word, word) == 0)
            return list[i].value;
    return list[0].value;
}
#define VALUE(list, word) value_of(list, COUNT(list), word)

/* Item i of a list, its last one when it is shorter: "64" is "64,64", one weight type serves two images. */
#define ITEM(list, i) ((list).v[(i) < (list).n ? (i) : (list).n - 1])

static void tile_options(const rx_config *cfg, int role, int nthreads, rx_tile_params *dst)
{
    *dst = (rx_tile_params){.weight_threshold = NAN,
                            .gain = cfg->gain,
                            .gain_key = cfg->gain_key,
                            .saturation = cfg->satur_level,
                            .saturation_key = cfg->satur_key,
                            .zeropoint = cfg->mag_zeropoint,
                            .zeropoint_key = cfg->mag_zeropoint_key,
                            .pixel_scale = cfg->pixel_scale,
                            .nthreads = nthreads};
    if (cfg->weight_type.n > 0)
        dst->weight_type = (rx_weight_type)VALUE(weight_types, ITEM(cfg->weight_type, role));
    if (dst->weight_type > RX_WEIGHT_BACKGROUND && cfg->weight_image.n > 0)
        dst->weight_name = ITEM(cfg->weight_image, role);
    if (cfg->weight_thresh.n > 0)
        dst->weight_threshold = ITEM(cfg->weight_thresh, role);
}

/* Flag maps are read when a column asks for them, as SExtractor does. */
static void flag_options(const rx_config *cfg, const rx_column_list *columns, rx_options *dst)
{
    if (!rx_columns_has(columns, "IMAFLAGS_ISO") && !rx_columns_has(columns, "NIMAFLAGS_ISO"))
        return;
    rx_tile_params *tile = &dst->tile[0];
    for (int i = 0; i < cfg->flag_image.n && i < RX_MAX_FLAGMAPS; i++)
        tile->flag_names[tile->nflags++] = cfg->flag_image.v[i];
    /* a map without a type of its own is combined by OR, as in SExtractor */
    for (int i = 0; i < cfg->flag_type.n && i < RX_MAX_FLAGMAPS; i++)
        dst->flag_types[i] = VALUE(flag_types, cfg->flag_type.v[i]);
}

static void background_options(const rx_config *cfg, int role, int nthreads, rx_background_params *dst)
{
    *dst = (rx_background_params){.mesh_width = cfg->back_size.v[0],
                                  .mesh_height = ITEM(cfg->back_size, 1),
                                  .filter_width = cfg->back_filtersize.v[0],
                                  .filter_height = ITEM(cfg->back_filtersize, 1),
                                  .filter_threshold = cfg->back_filtthresh,
                                  .manual = strcmp(ITEM(cfg->back_type, role), "MANUAL") == 0,
                                  .manual_value = ITEM(cfg->back_value, role),
                                  .weight_gain = cfg->weight_gain,
                                  .no_rescale = !ITEM(cfg->rescale_weights, role),
                                  .nthreads = nthreads};
}

static void restore_options(const rx_config *cfg, rx_options *dst)
{
    dst->restore =
        (rx_restore_params){.rl_niter = cfg->rl_niter,
                            .rl_stop_discrepancy = strcmp(cfg->rl_stop, "DISCREPANCY") == 0,
                            .rl_damping = cfg->rl_damping,
                            .rl_denoise = cfg->rl_denoise,
                            .rl_denoise_by_psf = strcmp(cfg->rl_denoise_unit, "PSF") == 0,
                            .rl_pedestal = cfg->rl_pedestal,
                            .blind_cycles = cfg->rl_blind_cycles,
                            .blind_psf_niter = cfg->rl_blind_niter,
                            .net_block = cfg->net_block,
                            .precision = (rx_precision)VALUE(precisions, cfg->net_precision),
                            .verify_seams = cfg->verify_seams,
                            .out_of_domain = (rx_out_of_domain)VALUE(out_of_domain, cfg->out_of_domain),
                            .fallback = cfg->restore_fallback,
                            .mask_saturated = strcmp(cfg->mask_saturated, "N") != 0,
                            .nthreads = dst->nthreads};
    dst->psf = (rx_psf_params){.type = (rx_psf_type)VALUE(psf_types, cfg->psf_type),
                               .fwhm = cfg->psf_fwhm,
                               .beta = cfg->psf_beta,
                               .size = cfg->psf_size,
                               .min_stars = cfg->psf_minstars,
                               .min_snr = cfg->psf_minsnr};
    dst->psf_files[0] = cfg->psf_name.v[0];
    dst->psf_files[1] = ITEM(cfg->psf_name, 1);
    dst->seeing_arcsec = cfg->seeing_fwhm;
    dst->seeing_stated = rx_config_states(cfg, "SEEING_FWHM");
    dst->model_name = cfg->net_model;
    dst->model_set = rx_config_states(cfg, "NET_MODEL");
    dst->stated_scale = rx_config_states(cfg, "PIXEL_SCALE") ? cfg->pixel_scale : 0.0;
    dst->saturated_in_none = strcmp(cfg->mask_saturated, "Y") == 0;
    for (int i = 0; i < cfg->restore_type.n; i++)
        dst->restorers[dst->nrestorers++] = rx_restorer_find(cfg->restore_type.v[i]);
}

rx_status rx_options_need_model(rx_options *options, rx_log *log, rx_error *err)
{
    rx_text path = {0};
    if (options->model != NULL)
        return RX_OK;
    rx_input_model(options->model_name, RX_DATA_FOLDER, &path);
    const int bare = strchr(options->model_name, '/') == NULL;
    rx_status status = path.failed ? rx_error_memory(err, 0) : RX_OK;
    if (status == RX_OK && bare && access(path.data, F_OK) != 0)
        status =
            rx_error_at(err, RX_INPUT, options->model_name, -1, 0,
                        "is neither here nor in %s; name the network's model by NET_MODEL", RX_DATA_FOLDER);
    if (status == RX_OK)
        status = rx_model_read(path.data, &options->model, err);
    if (status == RX_OK && bare)
        rx_log_info(log, "NET_MODEL %s is %s", options->model_name,
                    strcmp(path.data, options->model_name) != 0 ? path.data : "that of the current folder");
    if (status == RX_OK && !options->model->ended) {
        const rx_model *model = options->model;
        if (options->model_set)
            rx_log_warning(log, "%s: its training has not ended, it is of epoch %ld after %ld", path.data,
                           model->best, model->epochs);
        else
            status = rx_error_at(
                err, RX_INPUT, path.data, -1, 0,
                "its training has not ended, it is of epoch %ld after %ld; let it end, or name the "
                "model by NET_MODEL to take it as it is",
                model->best, model->epochs);
    }
    rx_text_free(&path);
    options->restore.model = options->model;
    return status;
}

static int wants_network(const rx_options *options)
{
    for (int i = 0; i < options->nrestorers; i++)
        if (strcmp(options->restorers[i]->name, "NET") == 0)
            return 1;
    return 0;
}

/* <threshold>,<zero-point> is a surface brightness in mag/arcsec2: an absolute threshold in ADU/pixel once
 * the pixel scale is known (1 arcsec when it is not given). */
static double threshold_of(const rx_config *cfg, const rx_reals *key, int *absolute)
{
    if (key->n < 2)
        return key->v[0];
    double scale = cfg->pixel_scale > 0.0 ? cfg->pixel_scale : 1.0;
    *absolute = 1;
    return pow(10.0, -0.4 * (key->v[0] - key->v[1])) * scale * scale;
}

/* The usual file, which is not there, stands for what is built in. */
static bool is_built_in(const char *name, const char *usual)
{
    return strcmp(name, usual) == 0 && access(name, F_OK) != 0;
}

static rx_status kernel_options(const rx_config *cfg, rx_options *dst, rx_error *err)
{
    if (!cfg->filter)
        return RX_OK;
    rx_status status = is_built_in(cfg->filter_name, "default.conv")
                           ? rx_kernel_default(&dst->kernel, err)
                           : rx_kernel_read(cfg->filter_name, &dst->kernel, err);
    if (status != RX_OK)
        return status;
    dst->detect.filter = dst->kernel->values;
    dst->detect.filter_width = dst->kernel->width;
    dst->detect.filter_height = dst->kernel->height;
    dst->detect.filter_normalise = dst->kernel->normalise;
    return RX_OK;
}

static void detect_options(const rx_config *cfg, rx_options *dst)
{
    rx_detect_params *par = &dst->detect;
    *par = (rx_detect_params){.absolute = strcmp(cfg->thresh_type.v[0], "ABSOLUTE") == 0,
                              .min_area = cfg->detect_minarea,
                              .max_area = cfg->detect_maxarea,
                              .matched = strcmp(cfg->filter_type, "MATCHED") == 0,
                              .deblend_levels = cfg->deblend_nthresh,
                              .deblend_contrast = cfg->deblend_mincont,
                              .clean = cfg->clean,
                              .clean_param = cfg->clean_param,
                              .pixstack = cfg->memory_pixstack,
                              .pixstack_max = cfg->memory_pixstack_max,
                              .subobjects = cfg->deblend_maxobj,
                              .subobjects_max = cfg->deblend_maxobj_max,
                              .nthreads = dst->nthreads};
    dst->detect_noise = strcmp(cfg->detect_noise, "INPUT") == 0      ? RX_DETECT_NOISE_INPUT
                        : strcmp(cfg->detect_noise, "MEASURED") == 0 ? RX_DETECT_NOISE_MEASURED
                                                                     : RX_DETECT_NOISE_AUTO;
    dst->filter_restored = cfg->filter_restored;
    par->threshold = threshold_of(cfg, &cfg->detect_thresh, &par->absolute);
    par->analysis_absolute = strcmp(ITEM(cfg->thresh_type, 1), "ABSOLUTE") == 0;
    par->analysis_threshold = threshold_of(cfg, &cfg->analysis_thresh, &par->analysis_absolute);
}

/* What no column, check-image or report asks for; matters for FLAGS too, as in SExtractor. */
static unsigned skipped_measurements(const rx_config *cfg, const rx_column_list *columns)
{
    const char *report = cfg->reference_name[0] != '\0' ? cfg->qa_mag : "";
    int radius = rx_columns_mention(columns, "FLUX_RADIUS");
    int window = rx_columns_mention(columns, "WIN") || strcmp(report, "MAG_WIN") == 0;
    /* windows are as wide as the half-light radius says, a share of FLUX_AUTO */
    int automatic = radius || window || rx_columns_mention(columns, "_AUTO") ||
                    rx_columns_mention(columns, "_BEST") || rx_columns_mention(columns, "KRON") ||
                    rx_columns_mention(columns, "MASKED_FRACTION") || strcmp(report, "MAG_AUTO") == 0;
    for (int i = 0; i < cfg->checkimage_type.n; i++)
        automatic |= strcmp(cfg->checkimage_type.v[i], "APERTURES") == 0;
    unsigned skip = 0;
    if (!rx_columns_mention(columns, "_APER") && strcmp(report, "MAG_APER") != 0)
        skip |= RX_SKIP_APER;
    if (!automatic)
        skip |= RX_SKIP_AUTO;
    if (!rx_columns_mention(columns, "PETRO") && strcmp(report, "MAG_PETRO") != 0)
        skip |= RX_SKIP_PETRO;
    if (!window)
        skip |= RX_SKIP_WIN;
    return radius ? skip : skip | RX_SKIP_RADIUS;
}

static void measure_options(const rx_config *cfg, rx_log *log, rx_options *dst)
{
    rx_measure_params *par = &dst->measure;
    int vignet[2];
    *par = (rx_measure_params){.auto_factor = cfg->phot_autoparams.v[0],
                               .auto_min_radius = cfg->phot_autoparams.v[1],
                               .auto_aper_min = cfg->phot_autoapers.v[0],
                               .auto_aper_max = cfg->phot_autoapers.v[1],
                               .petro_factor = cfg->phot_petroparams.v[0],
                               .petro_min_radius = cfg->phot_petroparams.v[1],
                               .neighbours = (rx_mask_type)VALUE(mask_types, cfg->mask_type),
                               .local_background = strcmp(cfg->backphoto_type, "LOCAL") == 0,
                               .local_thickness = cfg->backphoto_thick,
                               .nthreads = dst->nthreads};
    for (int i = 0; i < cfg->phot_apertures.n; i++)
        par->aperture_diameter[par->naper++] = cfg->phot_apertures.v[i];
    for (int i = 0; i < cfg->phot_fluxfrac.n; i++)
        par->flux_fraction[par->nradii++] = cfg->phot_fluxfrac.v[i];
    par->skip = skipped_measurements(cfg, dst->columns);
    if (rx_columns_has(dst->columns, "CLASS_STAR"))
        par->nnw_file = cfg->starnnw_name;
    static const char *const aper[] = {"FLUX_APER", "FLUXERR_APER", "MAG_APER", "MAGERR_APER"};
    for (size_t i = 0; i < COUNT(aper); i++)
        rx_columns_clip(dst->columns, aper[i], par->naper, "PHOT_APERTURES", log);
    rx_columns_clip(dst->columns, "FLUX_RADIUS", par->nradii, "PHOT_FLUXFRAC", log);
    rx_columns_clip(dst->columns, "IMAFLAGS_ISO", dst->tile[0].nflags, "FLAG_IMAGE", log);
    rx_columns_clip(dst->columns, "NIMAFLAGS_ISO", dst->tile[0].nflags, "FLAG_IMAGE", log);
    rx_columns_wanted(dst->columns, "VIGNET", vignet);
    par->vignet_width = vignet[0];
    par->vignet_height = vignet[1];
    dst->measure_original = strcmp(cfg->measure_on, "ORIGINAL") == 0;
    dst->calibrate_none = strcmp(cfg->error_calibration, "Y") == 0;
    dst->calibrate_restored = strcmp(cfg->error_calibration, "N") != 0;
    dst->error_apertures = cfg->error_apertures;
    dst->seed = (uint64_t)cfg->seed;
}

/* As SExtractor measures what the columns ask for, templates are fitted where something asks for them. */
static void template_options(const rx_config *cfg, rx_options *dst)
{
    rx_template_options *par = &dst->templates;
    const int pixels = strcmp(cfg->template_type, "AUTO") == 0;
    par->par = rx_tphot_defaults();
    par->par.extended = strcmp(cfg->template_type, "POINT") != 0;
    par->par.substructure = pixels;
    par->par.group_limit = cfg->template_groupmax;
    par->par.sky_cell = cfg->template_backsize;
    par->par.psf_error = cfg->template_psferr;
    par->par.non_negative = cfg->template_nonneg;
    par->par.covariance = cfg->template_covar_name[0] != '\0';
    par->par.nthreads = dst->nthreads;
    par->passes = cfg->template_passes;
    par->threshold = cfg->template_thresh;
    par->invented = cfg->invented_snr;
    par->evidence = cfg->invented_evidence;
    par->drop = strcmp(cfg->invented_type, "DROP") == 0;
    par->covariances = cfg->template_covar_name;
    /* checks inject objects and look at their fluxes without a reference catalogue, too */
    par->wanted_by_lists = par->drop || dst->quality_flux == RX_QUALITY_TEMPLATE;
    par->wanted = par->drop || par->par.covariance ||
                  (cfg->reference_name[0] != '\0' && dst->quality_flux == RX_QUALITY_TEMPLATE) ||
                  rx_columns_mention(dst->columns, "TEMPLATE") ||
                  rx_columns_has(dst->columns, "FLAGS_RESTORE");
    for (int i = 0; i < dst->nchecks; i++)
        par->wanted |= strncmp(dst->check_types[i], "TEMPLATE_", 9) == 0;
}

/* Without a configuration and without the file, the columns of the shipped default.param. */
static rx_status column_options(const rx_config *cfg, rx_log *log, rx_options *dst, rx_error *err)
{
    return is_built_in(cfg->parameters_name, "default.param")
               ? rx_columns_default(&dst->columns, err)
               : rx_columns_read(cfg->parameters_name, log, &dst->columns, err);
}

static rx_status checkimage_options(const rx_config *cfg, rx_log *log, rx_options *dst, rx_error *err)
{
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
        dst->restore.keep_reblurred |= strcmp(type, "RESIDUAL") == 0;
        dst->keep_filtered |= strcmp(type, "FILTERED") == 0;
        dst->restore.keep_support |= strcmp(type, "SUPPORT") == 0;
        dst->check_types[dst->nchecks] = type;
        dst->check_names[dst->nchecks++] = cfg->checkimage_name.v[i];
    }
    return RX_OK;
}

static rx_status quality_options(const rx_config *cfg, rx_options *dst, rx_error *err)
{
    dst->match_radius = cfg->match_radius;
    dst->match_arcsec = strcmp(cfg->match_unit, "ARCSEC") == 0;
    dst->quality_flux = VALUE(quality_fluxes, cfg->qa_mag);
    dst->qa_name = cfg->qa_name;
    if (cfg->reference_name[0] == '\0') {
        if (cfg->qa_gates[0] != '\0')
            return rx_error_set(err, RX_USAGE, "QA_GATES needs a reference catalogue; give REFERENCE_NAME");
        return RX_OK;
    }
    dst->reference = (rx_reference_params){
        .name = cfg->reference_name,
        .coords = cfg->reference_coords,
        .ncolumns = cfg->reference_columns.n,
        .columns = (const char *const *)cfg->reference_columns.v,
        .photometry = cfg->reference_photometry,
        .flux_zeropoint = cfg->reference_flux_zeropoint.n > 0 ? cfg->reference_flux_zeropoint.v[0] : NAN};
    dst->qa = (rx_qa_params){.mag_low = cfg->qa_mag_range.v[0],
                             .mag_high = cfg->qa_mag_range.v[1],
                             .mag_step = cfg->qa_mag_range.v[2],
                             .figures = cfg->qa_figures,
                             .by = {(uint64_t)cfg->seed, dst->nthreads}};
    if (cfg->qa_gates[0] == '\0')
        return RX_OK;
    rx_status status = rx_gates_read(cfg->qa_gates, &dst->gates, err);
    dst->qa.gates = dst->gates;
    return status;
}

static void check_options(const rx_config *cfg, rx_options *dst)
{
    dst->self_check = cfg->self_check;
    dst->blank_check = cfg->blank_check;
    dst->self_check_count = cfg->self_check_count;
    dst->self_check_density = cfg->self_check_density;
    dst->self_check_galaxies = cfg->self_check_galaxies;
    dst->self_check_away = strcmp(cfg->self_check_place, "AWAY") == 0;
    dst->self_check_name = cfg->self_check_name;
    dst->qa_figures = cfg->qa_figures;
    for (int i = 0; i < 2 && cfg->self_check_mag.n == 2; i++)
        dst->self_check_mag[i] = cfg->self_check_mag.v[i];
}

static rx_status assoc_options(const rx_config *cfg, rx_options *dst, rx_error *err)
{
    if (!rx_columns_has(dst->columns, "VECTOR_ASSOC") && !rx_columns_has(dst->columns, "NUMBER_ASSOC"))
        return RX_OK;
    rx_assoc_params *par = &dst->assoc;
    *par = (rx_assoc_params){.x = cfg->assoc_params.v[0],
                             .y = cfg->assoc_params.v[1],
                             .weight = cfg->assoc_params.n > 2 ? cfg->assoc_params.v[2] : 0,
                             .world = strcmp(cfg->assoccoord_type, "WORLD") == 0,
                             .radius = cfg->assoc_radius,
                             .type = (rx_assoc_type)VALUE(assoc_types, cfg->assoc_type),
                             .select = (rx_assoc_select)VALUE(assoc_selections, cfg->assocselec_type)};
    for (int i = 0; i < cfg->assoc_data.n; i++)
        par->data[par->ndata++] = cfg->assoc_data.v[i];
    rx_status status = rx_assoc_read(cfg->assoc_name, &dst->assoc_list, err);
    if (status == RX_OK)
        return rx_assoc_check(par, dst->assoc_list, err);
    if (status == RX_INPUT && err != NULL) {
        size_t used = strlen(err->text);
        snprintf(err->text + used, sizeof err->text - used,
                 "; give ASSOC_NAME, or leave VECTOR_ASSOC and NUMBER_ASSOC out of the columns");
    }
    return status;
}

/* Readers of tables go by the name: they will not open a text that is called cat.fits. */
static void catalog_options(const rx_config *cfg, rx_log *log, rx_options *dst)
{
    const char *end = strrchr(cfg->catalog_name, '.');
    dst->catalog_name = cfg->catalog_name;
    dst->catalog_type = (rx_catalog_type)VALUE(catalog_types, cfg->catalog_type);
    if (strncmp(cfg->catalog_type, "ASCII", 5) == 0 && end != NULL &&
        (strcasecmp(end, ".fits") == 0 || strcasecmp(end, ".fit") == 0))
        rx_log_warning(log, "%s is no FITS file but %s; give CATALOG_TYPE FITS, or another CATALOG_NAME",
                       cfg->catalog_name, cfg->catalog_type);
}

rx_status rx_options_from_config(const rx_config *cfg, rx_log *log, rx_options **dst, rx_error *err)
{
    rx_options *options = RX_NEW(rx_options, 1);
    if (options == NULL)
        return rx_error_memory(err, sizeof *options);
    options->nthreads = cfg->plan ? rx_threads_wanted(cfg->nthreads) /* of a run that may be elsewhere */
                                  : rx_threads_had(cfg->nthreads, log);
    options->plan_density = cfg->plan_density;
    catalog_options(cfg, log, options);
    for (int role = 0; role < 2; role++)
        background_options(cfg, role, options->nthreads, &options->background[role]);
    restore_options(cfg, options);
    detect_options(cfg, options);
    rx_status status = kernel_options(cfg, options, err);
    if (status == RX_OK && wants_network(options))
        status = rx_options_need_model(options, log, err);
    if (status == RX_OK)
        status = column_options(cfg, log, options, err);
    if (status == RX_OK) {
        tile_options(cfg, 0, options->nthreads, &options->tile[0]);
        tile_options(cfg, 1, options->nthreads, &options->tile[1]);
        flag_options(cfg, options->columns, options);
        measure_options(cfg, log, options);
        status = checkimage_options(cfg, log, options, err);
    }
    if (status == RX_OK)
        status = assoc_options(cfg, options, err);
    check_options(cfg, options);
    if (status == RX_OK)
        status = quality_options(cfg, options, err);
    if (status == RX_OK)
        template_options(cfg, options);
    if (status == RX_OK)
        *dst = options;
    else
        rx_options_free(options);
    return status;
}

void rx_options_free(rx_options *options)
{
    if (options == NULL)
        return;
    rx_columns_free(options->columns);
    rx_assoc_free(options->assoc_list);
    rx_kernel_free(options->kernel);
    rx_gates_free(options->gates);
    rx_model_free(options->model);
    free(options);
}
