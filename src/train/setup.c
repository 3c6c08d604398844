/* From keywords to structs. */
#include "train/setup.h"

#include <stdio.h>
#include <string.h>

#include "base/memory.h"
#include "nn/psfnet.h"

/* Streams of the seed's random numbers that the networks start from. */
enum { STREAM_RESTORE = 0x7e570001, STREAM_PSF, STREAM_SECOND };
/* Ends of residual blocks and the last layer start small: the network begins close to doing nothing. */
static const double DAMPED = 0.3, LAST = 0.1;

static int is(const char *word, const char *other)
{
    return strcmp(word, other) == 0;
}

static rx_psfnet_shape shape_of(const rx_train_config *config)
{
    return (rx_psfnet_shape){
        .stem = is(config->stem, "CONV") ? RX_STEM_CONV : RX_STEM_UNSHUFFLE,
        .decoder = is(config->decoder, "TRANSPOSED") ? RX_DECODER_TRANSPOSED
                   : is(config->decoder, "SUBPIXEL") ? RX_DECODER_SUBPIXEL
                                                     : RX_DECODER_BILINEAR,
        .width = config->width,
        .blocks = config->blocks,
        .stem_kernel = config->kernels.v[0],
        .kernel = config->kernels.v[1],
    };
}

static rx_front front_of(const rx_train_config *config)
{
    const rx_mode mode = is(config->mode, "BLIND") ? RX_MODE_BLIND : RX_MODE_INFORMED;
    return (rx_front){
        .mode = mode,
        .target_fwhm = config->target_fwhm,
        .tikhonov = config->tikhonov,
        .rl_steps = mode == RX_MODE_INFORMED ? config->rl_steps : 0,
        .pedestal = config->rl_step_pedestal,
    };
}

static rx_status make_net(const rx_psfnet_shape *shape, int inputs, uint64_t seed, uint64_t stream,
                          rx_net **dst, rx_error *err)
{
    RX_TRY(rx_psfnet_new(shape, inputs, dst, err));
    rx_net_initialise(*dst, seed, stream, DAMPED, LAST);
    return RX_OK;
}

static rx_survey_params survey_of(const rx_train_config *config)
{
    return (rx_survey_params){
        .smoothed = config->smoothed_noise,
        .resampled = config->resampled_noise,
        .smoothed_fwhm = {config->smoothed_fwhm.v[0], config->smoothed_fwhm.v[1]},
        .uneven = config->uneven_noise,
        .offsets = config->sky_offsets,
        .sky_offset = config->sky_offset,
        .waves = config->sky_waves,
        .dark = config->dark_sky,
        .defects = config->defects,
        .psf = config->psf_errors,
    };
}

static int same_networks(const rx_net *a, const rx_net *b)
{
    if (a->nnodes != b->nnodes || a->nparams != b->nparams)
        return 0;
    for (int i = 0; i < a->nnodes; i++) {
        const rx_node *p = &a->node[i], *q = &b->node[i];
        if (p->op != q->op || p->src != q->src || p->add != q->add || p->relu != q->relu ||
            p->channels != q->channels || p->kernel != q->kernel || p->stride != q->stride)
            return 0;
    }
    return 1;
}

/* Networks of an earlier training. */
static rx_status begin_with(const char *path, rx_model *model, rx_error *err)
{
    rx_net *from[RX_MODEL_NETS], *to[RX_MODEL_NETS];
    rx_model *first = NULL;
    rx_status status;
    RX_TRY(rx_model_read(path, &first, err));
    if (first->front.mode != model->front.mode)
        RX_TRY_EXIT(rx_error_at(err, RX_USAGE, path, -1, 0,
                                "a model of MODE %s cannot begin a training of MODE %s",
                                rx_mode_name(first->front.mode), rx_mode_name(model->front.mode)));
    if (first->front.target_fwhm != model->front.target_fwhm)
        RX_TRY_EXIT(rx_error_at(err, RX_USAGE, path, -1, 0,
                                "its output has a FWHM of %g pixels, TARGET_FWHM is %g; make them the same",
                                first->front.target_fwhm, model->front.target_fwhm));
    if (first->second != NULL && model->second == NULL)
        RX_TRY_EXIT(rx_error_at(err, RX_USAGE, path, -1, 0,
                                "its network has two stages, made for each other; set STAGES 2"));
    rx_model_nets(first, from);
    rx_model_nets(model, to);
    for (int k = 0; k < RX_MODEL_NETS; k++) {
        if (from[k] == NULL || to[k] == NULL)
            continue;
        if (!same_networks(from[k], to[k]))
            RX_TRY_EXIT(rx_error_at(err, RX_USAGE, path, -1, 0,
                                    "its network has another shape; set WIDTH, BLOCKS, STEM, DECODER and "
                                    "KERNELS as rextract-train -INFO shows them"));
        memcpy(to[k]->params, from[k]->params, (size_t)from[k]->nparams * sizeof *to[k]->params);
    }
exit:
    rx_model_free(first);
    return status;
}

rx_status rx_setup_model(const rx_train_config *config, rx_model **dst, rx_error *err)
{
    const rx_psfnet_shape shape = shape_of(config);
    const rx_survey_params survey = survey_of(config);
    const double psf_terms = config->loss_idt_psf + config->loss_rec + config->loss_rec_psf;
    rx_text record = {0};
    rx_status status;
    if (config->target_fwhm >= config->fwhm_range.v[1])
        return rx_error_set(err, RX_USAGE,
                            "TARGET_FWHM %g: no PSF of FWHM_RANGE %g,%g is wider, nothing would be restored; "
                            "give a smaller one",
                            config->target_fwhm, config->fwhm_range.v[0], config->fwhm_range.v[1]);
    rx_model *model = rx_model_new();
    if (model == NULL)
        return rx_error_memory(err, sizeof *model);
    model->front = front_of(config);
    model->seed = (uint64_t)config->seed;
    model->dark = config->dark_sky;
    /* file name without folders and extension: a model says nothing of the machine that made it */
    const char *slash = strrchr(config->model_name, '/'),
               *name = slash != NULL ? slash + 1 : config->model_name, *dot = strrchr(name, '.');
    const int length = dot != NULL && dot != name ? (int)(dot - name) : (int)strlen(name);
    snprintf(model->name, sizeof model->name, "%.*s", length, name);
    RX_TRY_EXIT(make_net(&shape, rx_front_channels(model->front.mode), model->seed, STREAM_RESTORE,
                         &model->restore, err));
    if (config->stages == 2 && model->front.mode == RX_MODE_INFORMED)
        RX_TRY_EXIT(make_net(&shape, RX_SECOND_CHANNELS, model->seed, STREAM_SECOND, &model->second, err));
    if (psf_terms > 0)
        RX_TRY_EXIT(make_net(&shape, RX_PSF_CHANNELS, model->seed, STREAM_PSF, &model->psf, err));
    if (config->init_model[0] != '\0')
        RX_TRY_EXIT(begin_with(config->init_model, model, err));
    RX_TRY_EXIT(rx_setup_text(config, RX_SETUP_RECORD, &record, err));
    RX_TRY_EXIT(rx_survey_factor(&survey, config->fwhm_range.v[1], &model->factor, err));
    model->provenance = record.data;
    *dst = model;
    return RX_OK;
exit:
    rx_text_free(&record);
    rx_model_free(model);
    return status;
}

rx_step_params rx_setup_step(const rx_train_config *config)
{
    return (rx_step_params){
        .kind = is(config->loss_type, "PLAIN")       ? RX_LOSS_PLAIN
                : is(config->loss_type, "STRETCHED") ? RX_LOSS_STRETCHED
                                                     : RX_LOSS_LINEAR,
        .idt_restore = config->loss_idt,
        .idt_psf = config->loss_idt_psf,
        .rec_restore = config->loss_rec,
        .rec_psf = config->loss_rec_psf,
        .light = config->loss_light,
        .ffl = config->loss_ffl,
        .floor = config->loss_floor,
        .margin = config->patch_margin,
        .clip = config->clip_image,
    };
}

rx_samples_params rx_setup_samples(const rx_train_config *config)
{
    return (rx_samples_params){
        .side = config->patch,
        .field_side = config->patch * config->field_patches,
        .uses = config->field_uses,
        .sky = {.beta = {config->beta_range.v[0], config->beta_range.v[1]},
                .ellipticity = config->psf_ellipticity,
                .density = config->density_spread,
                .nebulae = config->nebulae,
                .halos = config->psf_halos},
        .photon = {config->photon_range.v[0], config->photon_range.v[1]},
        .sky_error = config->sky_error,
        .noise_error = config->noise_error,
        .psf_error = config->psf_error,
        .survey = survey_of(config),
        .seed = (uint64_t)config->seed,
        .front = front_of(config),
        .batch = config->batch,
    };
}

typedef struct lines {
    rx_setup_lines which;
    rx_text *dst;
    rx_text normal;   /* "KEYWORD value" of every default, a line each */
    const char *next; /* line of `normal` of the keyword visited next */
} lines;

/* Does the keyword decide what the model's bytes are? */
static int decides(const char *name, rx_setup_lines which)
{
    static const char *const never[] = {"MODEL_NAME", "OUTPUT_NAME",  "CHECKPOINT_NAME", "QA_FIGURES",
                                        "NTHREADS",   "VERBOSE_TYPE", "SIM.NTHREADS",    "SIM.VERBOSE_TYPE"};
    static const char *const may_change[] = {"EPOCHS", "PATIENCE", "CLIP_IMAGE"};
    for (size_t i = 0; i < sizeof never / sizeof *never; i++)
        if (is(name, never[i]))
            return 0;
    for (size_t i = 0; i < sizeof may_change / sizeof *may_change; i++)
        if (which == RX_SETUP_ALL && is(name, may_change[i]))
            return 0;
    return 1;
}

static void add_normal(void *user, const char *name, const char *value, const char *help)
{
    (void)help;
    rx_text_printf(user, "%s %s\n", name, value);
}

static void add_line(void *user, const char *name, const char *value, const char *help)
{
    lines *l = user;
    const size_t before = l->dst->length;
    const char *slash = is(name, "INIT_MODEL") ? strrchr(value, '/') : NULL; /* not where on which machine */
    (void)help;
    rx_text_printf(l->dst, "%s %s\n", name, slash != NULL ? slash + 1 : value);
    if (l->dst->failed || l->next == NULL)
        return;
    const size_t length = strcspn(l->next, "\n") + 1, ours = l->dst->length - before;
    const int normal = ours == length && memcmp(l->dst->data + before, l->next, length) == 0;
    l->next += length;
    if (!decides(name, l->which) || (l->which == RX_SETUP_RECORD && normal)) {
        l->dst->length = before;
        l->dst->data[before] = '\0';
    }
}

rx_status rx_setup_text(const rx_train_config *config, rx_setup_lines which, rx_text *dst, rx_error *err)
{
    rx_train_config *defaults = NULL;
    lines l = {.which = which, .dst = dst};
    rx_text_add(dst, "");
    RX_TRY(rx_train_config_new(&defaults, err));
    rx_settings_visit(&defaults->settings, false, add_normal, &l.normal);
    l.next = l.normal.data;
    rx_settings_visit(&config->settings, false, add_line, &l);
    const bool failed = l.normal.failed || dst->failed;
    rx_text_free(&l.normal);
    rx_train_config_free(defaults);
    return failed ? rx_error_memory(err, 0) : RX_OK;
}
