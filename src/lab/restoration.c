/* The restoration campaign: its runs, bins, scenes, tuning and scores.
 *
 * The population of a scene is that of the SIM. keywords. The brightest galaxy (or template) takes the place of the
 * galaxy images of the paper: it is moved to the middle and drawn so large that it fills the scene, at its
 * own surface brightness; all others stay as they are, small and fainter than the main one.
 *
 * A run has one image of a scene, and all qualities are measured on it. Tuned are iterations, filter and threshold per bin, in the
 * method's own favour, on scenes that are not in the test: for PSNR, and of RL_SSIM for SSIM. */
#include "lab/restoration.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "nn/noise_level.h"
#include "num/convolve.h"
#include "psf/psf.h"
#include "quality/image_metrics.h"
#include "simulate/noise.h"
#include "simulate/optics.h"
#include "simulate/render.h"
#include "simulate/scene.h"

/* Half-light radius of the main galaxy, in sides of the scene; its place, sides from the middle. */
static const double FILL_LOW = 0.07, FILL_HIGH = 0.15, PLACE = 0.08;
/* Mean surface brightness of any other object, at most so many of the main galaxy's. */
static const double OTHERS = 0.5;

/* What random numbers are for. */
enum { DRAW_SCENE = 1, DRAW_QUANTITIES, DRAW_NOISE };

/* How a run is tuned; none: its restorer as it is. Those of SMOOTHED are filters of the blurred image, of RL iterations and
 * filters, of the flat ones thresholds, too, below which all is sky. RL_SSIM has the candidates of RL. */
enum { UNTUNED, SMOOTHED, RL, RL_SSIM, RL_FLAT, NET_FLAT };

/* One scene: planes [side][side], 0 = sky. */
typedef struct trial {
    int bin;
    const rx_unit_values *done; /* values of earlier units, of which the tuning is made; lent */
    double fwhm, sigma;
    double level;                  /* noise level: nn/noise_level.h */
    float *image;                  /* blurred and noisy */
    float *sharp;                  /* the scene through the target PSF, its brightest pixel SCENE_PEAK */
    rx_psf *psf;                   /* that blurred it */
    rx_image_reference *reference; /* of `sharp`, for PSNR and SSIM */
} trial;

static const rx_lab_column SCENE[] = {RX_RESTORATION_SCENE_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column SCORE[] = {RX_RESTORATION_SCORE_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column TUNING[] = {RX_RESTORATION_TUNING_COLUMNS(RX_LAB_COLUMN)};

static const rx_lab_schema TABLES[RX_RESTORATION_TABLES] = {
    [RX_RESTORATION_SCENE] = {"scene", RX_RESTORATION_SCENE_WIDTH, RX_RESTORATION_SCORE_WIDTH, SCENE, SCORE,
                              1},
    [RX_RESTORATION_TUNING] = {"tuning", RX_RESTORATION_TUNING_WIDTH, 0, TUNING, NULL, 1},
};

/* --- open --- */

/* NONE is the blurred image. RL, whose result depends on a number of iterations, is tuned per bin; beside it NONE is also
 * the blurred image through a filter, tuned as RL's is: what is gained without any deconvolution. Where RL has a flat sky, too, so
 * has NET: both are treated alike. */
static rx_status add_runs(rx_lab *lab, rx_error *err)
{
    const rx_words *words = &lab->config->restore_type;
    for (int i = 0; i < words->n; i++)
        lab->tunes |= strcmp(words->v[i], "RL") == 0;
    for (int i = 0; i < words->n; i++) {
        const int none = strcmp(words->v[i], "NONE") == 0, rl = strcmp(words->v[i], "RL") == 0;
        const int net = strcmp(words->v[i], "NET") == 0;
        rx_lab_run run = {.tuned = rl, .method = rl ? RL : UNTUNED};
        snprintf(run.name, sizeof run.name, "%s", none ? "BLURRED" : "");
        RX_TRY(rx_lab_add_run(lab, words->v[i], run, err));
        if (none && lab->tunes)
            RX_TRY(rx_lab_add_run(lab, "RL", (rx_lab_run){.name = "SMOOTHED", .tuned = 1, .method = SMOOTHED},
                                  err));
        if (rl) {
            const rx_lab_run ssim = {.name = "RL_SSIM", .tuned = 1, .method = RL_SSIM},
                             flat = {.name = "RL_FLAT", .tuned = 1, .method = RL_FLAT};
            RX_TRY(rx_lab_add_run(lab, "RL", ssim, err));
            RX_TRY(rx_lab_add_run(lab, "RL", flat, err));
        }
        if (net && lab->tunes)
            RX_TRY(rx_lab_add_run(lab, "NET",
                                  (rx_lab_run){.name = "NET_FLAT", .tuned = 1, .method = NET_FLAT}, err));
    }
    return RX_OK;
}

/* Bins of one quantity, 1 wide, one centre per unit from the first to the last. */
static rx_status add_bins(rx_lab *lab, int by_sigma, const rx_reals *range, const rx_reals *other,
                          const rx_ints *scenes, rx_error *err)
{
    const int n = (int)floor(range->v[1] - range->v[0] + 1e-6) + 1;
    RX_TRY(RX_GROW(lab->bin, (size_t)(lab->nconditions + n), err));
    for (int i = 0; i < n; i++)
        lab->bin[lab->nconditions++] = (rx_lab_bin){.by_sigma = by_sigma,
                                                    .low = fmax(range->v[0] + i - 0.5, 0),
                                                    .high = range->v[0] + i + 0.5,
                                                    .other_low = other->v[0],
                                                    .other_high = other->v[1],
                                                    .nscenes = rx_lab_size(lab, scenes)};
    return RX_OK;
}

/* The population on a scene: without stars unless they were asked for, and with one galaxy at least. */
static rx_status open_bins(rx_lab *lab, rx_log *log, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    rx_lab_sky *sky;
    RX_TRY(rx_lab_sky_add(lab, "IMAGE_SIZE", config->scene_side, log, &sky, err));
    rx_scene_params *scene = &sky->simulation->scene;
    if (rx_settings_was_set(&config->settings, "SIM.STAR_COUNT") == RX_FROM_DEFAULT)
        scene->stars.count = 0;
    if (scene->galaxies.count + scene->templates.count < 1)
        *(sky->simulation->templates != NULL && scene->templates.count > 0 ? &scene->templates.count
                                                                           : &scene->galaxies.count) = 1;
    RX_TRY(add_runs(lab, err));
    lab->nconditions = 0;
    RX_TRY(add_bins(lab, 0, &config->fwhm_range, &config->sigma_trained, &config->scenes_fwhm, err));
    RX_TRY(add_bins(lab, 1, &config->sigma_range, &config->fwhm_trained, &config->scenes_sigma, err));
    RX_TRY(rx_lab_add_scene(lab, (rx_lab_scene){.id = RX_SCENE_TUNING}, err));
    return rx_lab_add_scene(lab, (rx_lab_scene){.id = RX_SCENE_TEST}, err);
}

/* --- scenes --- */

static size_t pixels_of(const rx_lab *lab)
{
    return (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
}

static double brightness(const rx_object *object, double least_radius)
{
    const double radius = fmax(object->radius, least_radius);
    return object->flux / (radius * radius);
}

/* See the head of this file. */
static void compose(const rx_lab *lab, uint64_t seed, uint64_t stream, rx_scene *scene)
{
    const double side = lab->config->scene_side;
    rx_object *main = NULL;
    for (long i = 0; i < scene->n; i++)
        if (scene->objects[i].type != RX_OBJECT_STAR && (main == NULL || scene->objects[i].flux > main->flux))
            main = &scene->objects[i];
    if (main == NULL || !(main->radius > 0))
        return;
    const double radius =
        side * (FILL_LOW + (FILL_HIGH - FILL_LOW) * rx_random_uniform(seed, stream, UINT64_C(1) << 62));
    const double factor = radius / main->radius;
    main->radius *= factor;
    main->bulge_radius *= factor;
    main->disk_radius *= factor;
    main->bar_radius *= factor;
    main->stretch *= factor;
    main->flux *= factor * factor;
    main->x =
        0.5 * (side - 1) + PLACE * side * (2 * rx_random_uniform(seed, stream, (UINT64_C(1) << 62) + 1) - 1);
    main->y =
        0.5 * (side - 1) + PLACE * side * (2 * rx_random_uniform(seed, stream, (UINT64_C(1) << 62) + 2) - 1);
    const double limit = OTHERS * brightness(main, 0);
    for (long i = 0; i < scene->n; i++) {
        rx_object *other = &scene->objects[i];
        const double bright = brightness(other, lab->sky[0].simulation->sharp_fwhm);
        if (other != main && bright > limit)
            other->flux *= limit / bright;
    }
}

/* The PSF as a restorer is given it; one that is larger than the scene is cut to it. */
static rx_status known_psf(const rx_lab *lab, const rx_optics *optics, rx_psf **dst, rx_error *err)
{
    rx_status status = rx_optics_on_pixels(optics, dst, err);
    if (status != RX_OK || (*dst)->size <= lab->config->scene_side)
        return status;
    const rx_simulate_config *sim = lab->config->sim;
    rx_psf_free(*dst);
    *dst = NULL;
    return rx_psf_moffat(optics->fwhm, sim->psf_beta, sim->psf_ratio, sim->psf_angle * M_PI / 180.0,
                         lab->config->scene_side - 1 + lab->config->scene_side % 2, dst, err);
}

static rx_status expose(const rx_lab *lab, uint64_t stream, const rx_scene *scene, trial *dst, rx_error *err)
{
    const rx_simulate_config *sim = lab->config->sim;
    const int side = lab->config->scene_side;
    const size_t n = pixels_of(lab);
    const rx_moffat_profile profile = {.fwhm = dst->fwhm,
                                       .beta = sim->psf_beta,
                                       .ratio = sim->psf_ratio,
                                       .angle = sim->psf_angle * M_PI / 180.0};
    rx_optics *optics = NULL;
    float *noise = NULL;
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(noise, n, err));
    RX_TRY_EXIT(rx_optics_moffat(&profile, side, side, &optics, err));
    RX_TRY_EXIT(rx_render(scene, 2, (const rx_optics *const[]){optics, lab->sky[0].simulation->target},
                          (float *const[]){dst->image, dst->sharp}, 1, err));
    RX_TRY_EXIT(known_psf(lab, optics, &dst->psf, err));
    double peak = 0;
    for (size_t i = 0; i < n; i++)
        peak = fmax(peak, dst->sharp[i]);
    const double factor = peak > 0 ? lab->config->scene_peak / peak : 0;
    for (size_t i = 0; i < n; i++) {
        dst->sharp[i] = (float)(dst->sharp[i] * factor);
        dst->image[i] = (float)(dst->image[i] * factor);
    }
    memcpy(noise, dst->image, n * sizeof *noise);
    dst->level = rx_noise_level(rx_brightness(noise, n, 0) / dst->sigma);
    rx_noise_normals(rx_lab_seed(lab, DRAW_NOISE), stream, 0, (long)n, noise);
    for (size_t i = 0; i < n; i++)
        dst->image[i] += (float)(dst->sigma * noise[i]);
exit:
    rx_optics_free(optics);
    free(noise);
    return status;
}

static void free_trial(trial *t)
{
    free(t->image);
    free(t->sharp);
    rx_image_reference_free(t->reference);
    rx_psf_free(t->psf);
    *t = (trial){0};
}

static rx_status make_trial(const rx_lab *lab, const rx_lab_unit *unit, const rx_unit_values *done,
                            trial *dst, rx_error *err)
{
    const int side = lab->config->scene_side;
    const rx_lab_bin *bin = &lab->bin[unit->condition];
    /* number of the scene: the same whatever the number of scenes per bin */
    const uint64_t which = (uint64_t)lround(8.0 * bin->low) << 1 | (uint64_t)bin->by_sigma,
                   tunes = lab->scene[unit->scene].id == RX_SCENE_TUNING,
                   stream = which << 40 | tunes << 36 | (uint64_t)unit->number,
                   seed = rx_lab_seed(lab, DRAW_QUANTITIES);
    const double u = rx_random_uniform(seed, stream, 0), v = rx_random_uniform(seed, stream, 1);
    const double binned = bin->low + (bin->high - bin->low) * u,
                 other = bin->other_low + (bin->other_high - bin->other_low) * v;
    rx_scene_params par = lab->sky[0].simulation->scene;
    rx_scene *scene = NULL;
    par.seed = rx_lab_seed(lab, DRAW_SCENE);
    par.stream = stream;
    *dst = (trial){.bin = unit->condition,
                   .done = done,
                   .fwhm = bin->by_sigma ? other : binned,
                   .sigma = bin->by_sigma ? binned : other};
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(dst->image, pixels_of(lab), err));
    RX_TRY_EXIT(RX_MAKE(dst->sharp, pixels_of(lab), err));
    RX_TRY_EXIT(rx_scene_make(&par, lab->sky[0].simulation->templates, &scene, err));
    compose(lab, par.seed, stream, scene);
    RX_TRY_EXIT(expose(lab, stream, scene, dst, err));
    status = rx_image_reference_new(side, side, dst->sharp, &dst->reference, err);
exit:
    rx_scene_free(scene);
    if (status != RX_OK)
        free_trial(dst);
    return status;
}

/* dst = the scene restored. niter > 0: so many iterations and no filter; 0: as STAGE. has it. */
static rx_status restore(const rx_lab *lab, const trial *t, const rx_restorer *restorer, int niter,
                         float *dst, rx_error *err)
{
    rx_restored *restored = NULL;
    rx_restore_params par = lab->options->pipeline.restore;
    if (niter > 0) {
        par.rl_niter = niter;
        par.rl_stop_discrepancy = 0;
        par.rl_denoise = 0;
        par.rl_denoise_by_psf = 0;
    }
    rx_background sky = {.width = lab->config->scene_side, .height = lab->config->scene_side};
    rx_background_flatten(&sky, 0, t->sigma);
    const rx_image image = {.name = "scene",
                            .width = lab->config->scene_side,
                            .height = lab->config->scene_side,
                            .pixels = t->image,
                            .noise = rx_background_noise(&sky),
                            .saturation = HUGE_VAL,
                            .psf = t->psf};
    rx_status status = restorer->run(&par, &image, NULL, &restored, err);
    if (status == RX_OK)
        memcpy(dst, restored->pixels, pixels_of(lab) * sizeof *dst);
    rx_restored_free(restored);
    return status;
}

/* --- tuning --- */

/* Below so many sigmas of the input's noise all is set to the sky; 0 = negative values only. The first one is
 * no threshold. */
static const double THRESHOLDS[] = {-1.0, 0.0, 0.25, 0.5, 1.0, 2.0};
enum { NTHRESHOLDS = sizeof THRESHOLDS / sizeof *THRESHOLDS };

/* One candidate. */
typedef struct tuning {
    int method;       /* whose it is; UNTUNED: of none */
    int niter;        /* 0: the image as it is */
    double filter;    /* FWHM of the Gaussian, pixels; 0 = none */
    double threshold; /* in sigmas of the input's noise: what is below becomes sky; negative = none */
    char text[120];   /* for the report: filters in units of the PSF's FWHM */
} tuning;

static const rx_restorer *network_of(const rx_lab *lab)
{
    for (int m = 0; m < lab->nruns; m++)
        if (lab->run[m].method == NET_FLAT)
            return lab->run[m].restorer;
    return NULL;
}

/* Candidates: (0 and TUNE_NITER) x (TUNE_FILTER and, last, the target PSF) x thresholds, and behind `without` the network's
 * image with every threshold. */
static long count_candidates(const rx_lab *lab, long *without)
{
    *without = (long)(lab->config->tune_niter.n + 1) * (lab->config->tune_filter.n + 1) * NTHRESHOLDS;
    return *without + (network_of(lab) != NULL ? NTHRESHOLDS : 0);
}

static tuning get_tuning(const rx_lab *lab, double fwhm, long candidate)
{
    const rx_reals *filters = &lab->config->tune_filter;
    const int cut = (int)(candidate % NTHRESHOLDS),
              filter = (int)(candidate / NTHRESHOLDS % (filters->n + 1)),
              niter = (int)(candidate / NTHRESHOLDS / (filters->n + 1));
    long without;
    char width[48], iterations[32] = "", flat[40] = "";
    tuning t = {.threshold = THRESHOLDS[cut]};
    count_candidates(lab, &without);
    if (t.threshold >= 0)
        snprintf(flat, sizeof flat, ", sky below %g sigma", t.threshold);
    if (candidate >= without) {
        t.method = cut > 0 ? NET_FLAT : UNTUNED;
        snprintf(t.text, sizeof t.text, "sky below %g sigma", t.threshold);
        return t;
    }
    t.method = niter > 0 ? (cut > 0 ? RL_FLAT : RL) : cut > 0 ? UNTUNED : SMOOTHED;
    t.niter = niter > 0 ? lab->config->tune_niter.v[niter - 1] : 0;
    t.filter = filter < filters->n ? filters->v[filter] * fwhm : lab->sky[0].simulation->sharp_fwhm;
    if (filter < filters->n)
        snprintf(width, sizeof width, "filter %g FWHM", filters->v[filter]);
    else
        snprintf(width, sizeof width, "filter %g pixels", t.filter);
    if (niter > 0)
        snprintf(iterations, sizeof iterations, "RL_NITER %d, ", t.niter);
    snprintf(t.text, sizeof t.text, "%s%s%s", iterations, width, flat);
    return t;
}

/* The candidate of a run of the highest mean over the tuning scenes of a bin. done: values of all units. */
static long choose(const rx_lab *lab, int bin, const rx_lab_run *run, const rx_unit_values *done)
{
    const int by_ssim = run->method == RL_SSIM, method = by_ssim ? RL : run->method;
    long without, best = -1;
    double highest = 0;
    const long n = count_candidates(lab, &without);
    for (long c = 0; c < n; c++) {
        double sum = 0;
        if (get_tuning(lab, 1.0, c).method != method)
            continue;
        for (long u = 0; u < lab->nunits; u++)
            if (lab->unit[u].condition == bin && lab->scene[lab->unit[u].scene].id == RX_SCENE_TUNING) {
                const rx_lab_table table = rx_lab_unit_table(lab, &done[u], RX_RESTORATION_TUNING);
                sum += c < table.n ? rx_lab_own(&table, c)[by_ssim ? RX_TUNING_SSIM : RX_TUNING_PSNR] : NAN;
            }
        if (best < 0 || sum > highest) {
            best = c;
            highest = sum;
        }
    }
    return best;
}

/* Is the candidate's number of iterations the lowest (above 1) or highest tried, or its filter the widest (but for the target
 * PSF) or its threshold the highest: a longer list may hold a better one. */
static int is_at_end(const rx_lab *lab, long candidate)
{
    const rx_ints *niter = &lab->config->tune_niter;
    const rx_reals *filter = &lab->config->tune_filter;
    const tuning t = get_tuning(lab, 1.0, candidate);
    int lower = t.niter == 1, higher = 0, wider = candidate / NTHRESHOLDS % (filter->n + 1) == filter->n;
    for (int i = 0; i < niter->n; i++) {
        lower |= niter->v[i] < t.niter;
        higher |= niter->v[i] > t.niter;
    }
    for (int i = 0; i < filter->n; i++)
        wider |= filter->v[i] > t.filter;
    return (t.niter > 0 && (!lower || !higher)) || t.threshold >= THRESHOLDS[NTHRESHOLDS - 1] || !wider;
}

/* Below the candidate's threshold all is sky. */
static void flatten(size_t n, double sigma, const tuning *what, float *plane)
{
    for (size_t i = 0; i < n && what->threshold >= 0; i++)
        plane[i] = plane[i] < what->threshold * sigma ? 0.0f : plane[i];
}

/* plane = filtered and cut as the candidate says, from what so many iterations gave. */
static rx_status apply(const rx_lab *lab, double sigma, const tuning *what, const float *restored,
                       float *plane, rx_error *err)
{
    const int side = lab->config->scene_side;
    memcpy(plane, restored, pixels_of(lab) * sizeof *plane);
    RX_TRY(rx_gauss_masked(side, side, what->filter, NULL, 1, plane, err));
    flatten(pixels_of(lab), sigma, what, plane);
    return RX_OK;
}

/* Every candidate that is somebody's. */
static rx_status tune(const rx_lab *lab, const trial *t, rx_lab_table *table, rx_error *err)
{
    const size_t n = pixels_of(lab);
    double *row = NULL;
    long without;
    const long candidates = count_candidates(lab, &without),
               of_image = NTHRESHOLDS * (lab->config->tune_filter.n + 1);
    float *restored, *plane;
    rx_status status;
    RX_TRY(RX_MAKE(restored, 2 * n, err));
    plane = restored + n;
    RX_TRY_EXIT(rx_lab_rows_add(table, candidates, &row, err));
    for (long c = 0; c < candidates; c++, row += RX_RESTORATION_TUNING_WIDTH) {
        const tuning one = get_tuning(lab, t->fwhm, c);
        row[RX_TUNING_NITER] = one.niter;
        row[RX_TUNING_FILTER] = one.filter;
        row[RX_TUNING_THRESHOLD] = one.threshold;
        row[RX_TUNING_PSNR] = row[RX_TUNING_SSIM] = NAN;
        if (one.method == UNTUNED && c != without)
            continue;
        if (c == 0)
            memcpy(restored, t->image, n * sizeof *restored);
        else if (c == without)
            RX_TRY_EXIT(restore(lab, t, network_of(lab), 0, restored, err));
        else if (c % of_image == 0)
            RX_TRY_EXIT(restore(lab, t, rx_restorer_find("RL"), one.niter, restored, err));
        if (c % NTHRESHOLDS > 0) /* of the plane before, whose threshold is lower */
            flatten(n, t->sigma, &one, plane);
        else
            RX_TRY_EXIT(apply(lab, t->sigma, &one, restored, plane, err));
        row[RX_TUNING_PSNR] = rx_reference_psnr(t->reference, plane);
        double ssim[RX_SSIM_KINDS] = {NAN};
        if (one.method == RL) /* by which RL_SSIM is chosen */
            RX_TRY_EXIT(rx_reference_ssim(t->reference, plane, ssim, err));
        row[RX_TUNING_SSIM] = ssim[RX_SSIM_PAPER];
    }
exit:
    free(restored);
    return status;
}

/* --- test scenes --- */

/* What a restorer gave for a number of iterations, kept for the next method that asks for the same. */
typedef struct memory {
    const rx_restorer *restorer;
    int niter;
    float *plane;
} memory;

/* A run's picture of a scene. */
static rx_status picture(const rx_lab *lab, const trial *t, const rx_lab_run *run, memory *last, float *plane,
                         rx_error *err)
{
    tuning one = {.threshold = -1.0};
    if (run->tuned)
        one = get_tuning(lab, t->fwhm, choose(lab, t->bin, run, t->done));
    if (last->restorer != run->restorer || last->niter != one.niter) {
        last->restorer = NULL;
        if (run->method == SMOOTHED)
            memcpy(last->plane, t->image, pixels_of(lab) * sizeof *plane);
        else
            RX_TRY(restore(lab, t, run->restorer, one.niter, last->plane, err));
    }
    last->restorer = run->restorer;
    last->niter = one.niter;
    return apply(lab, t->sigma, &one, last->plane, plane, err);
}

static rx_status score(const rx_lab *lab, const trial *t, rx_lab_table *scene, rx_error *err)
{
    const size_t n = pixels_of(lab);
    double *row = NULL;
    float *planes;
    rx_status status;
    RX_TRY(RX_MAKE(planes, 2 * n, err));
    memory last = {.plane = planes};
    RX_TRY_EXIT(rx_lab_rows_add(scene, 1, &row, err));
    row[RX_SCENE_FWHM] = t->fwhm;
    row[RX_SCENE_SIGMA] = t->sigma;
    row[RX_SCENE_LEVEL] = t->level;
    for (int m = 0; m < lab->nruns; m++) {
        double *scores = rx_lab_each(scene, 0, m); /* RX_SCORE_PSNR and what follows */
        RX_TRY_EXIT(picture(lab, t, &lab->run[m], &last, planes + n, err));
        scores[RX_SCORE_PSNR] = rx_reference_psnr(t->reference, planes + n);
        RX_TRY_EXIT(rx_reference_ssim(t->reference, planes + n, &scores[RX_SCORE_SSIM], err));
    }
exit:
    free(planes);
    return status;
}

rx_status rx_restoration_example(const rx_lab *lab, int bin, rx_restoration_show show, void *user,
                                 rx_error *err)
{
    const size_t n = pixels_of(lab);
    trial t;
    RX_TRY(make_trial(lab, &(rx_lab_unit){bin, 1, 0}, lab->values, &t, err));
    float *planes = RX_NEW(float, 2 * n);
    rx_status status = planes == NULL ? rx_error_memory(err, 2 * n * sizeof *planes) : RX_OK;
    char text[96];
    snprintf(text, sizeof text, "FWHM %.2f pixels, noise %.1f", t.fwhm, t.sigma);
    show(user, text, NULL);
    show(user, "BLURRED", t.image);
    for (int m = 0; status == RX_OK && m < lab->nruns; m++) {
        if (strcmp(lab->run[m].name, "BLURRED") == 0)
            continue;
        status = picture(lab, &t, &lab->run[m], &(memory){.plane = planes}, planes + n, err);
        if (status == RX_OK)
            show(user, lab->run[m].name, planes + n);
    }
    show(user, "SHARP", t.sharp);
    free(planes);
    free_trial(&t);
    return status;
}

/* --- the kind --- */

static rx_status unit(const rx_lab *lab, const rx_lab_unit *unit, const rx_unit_values *done,
                      rx_lab_table *dst, rx_error *err)
{
    trial t;
    RX_TRY(make_trial(lab, unit, done, &t, err));
    rx_status status = lab->scene[unit->scene].id == RX_SCENE_TUNING
                           ? tune(lab, &t, &dst[RX_RESTORATION_TUNING], err)
                           : score(lab, &t, &dst[RX_RESTORATION_SCENE], err);
    free_trial(&t);
    return status;
}

static rx_status describe(rx_lab *lab, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    const rx_simulate_config *sim = config->sim;
    const size_t n = (size_t)lab->nconditions * (size_t)lab->nruns;
    const rx_model *model = lab->options->model;
    const int known = model != NULL && model->bins != NULL;
    char templates[48] = "";
    RX_TRY(RX_MAKE(lab->tuned, n, err));
    for (size_t i = 0; i < n; i++) {
        const int run = (int)i % lab->nruns, bin = (int)i / lab->nruns;
        rx_lab_tuned *dst = &lab->tuned[i];
        if (!lab->run[run].tuned)
            continue;
        const long chosen = choose(lab, bin, &lab->run[run], lab->values);
        dst->at_end = is_at_end(lab, chosen);
        snprintf(dst->setting, sizeof dst->setting, "%s%s", get_tuning(lab, 1.0, chosen).text,
                 dst->at_end ? " (at an end of what was tried)" : "");
    }
    for (int i = 0; i < 2; i++) {
        const size_t last = known && i > 0 ? (size_t)model->nfwhm * (size_t)model->nsigma - 1 : 0;
        lab->fwhm_trained[i] = known ? model->bins[last].fwhm[i] : config->fwhm_trained.v[i];
        lab->level_trained[i] = known ? model->bins[last].sigma[i] : 0;
    }
    if (lab->sky[0].simulation->templates != NULL)
        snprintf(templates, sizeof templates, ", %d templates", lab->sky[0].simulation->templates->n);
    snprintf(lab->about, sizeof lab->about,
             "simulated galaxies (%s%s), the brightest one drawn to fill the scene, its companions at their "
             "own size; Moffat PSF of beta %g, %g arcsec per pixel; the brightest pixel of the sharp "
             "reference (Gaussian PSF of FWHM %g pixels) is %g, the sky 0",
             sim->galaxy_type, templates, sim->psf_beta, sim->pixel_scale, lab->sky[0].simulation->sharp_fwhm,
             config->scene_peak);
    return RX_OK;
}

RX_LAB_KIND(rx_kind_restoration, .name = "RESTORATION", .title = "Restoration campaign",
            .tag = 0x726573746f7265, .most = RX_METHODS_MAX, .ntables = RX_RESTORATION_TABLES,
            .tables = TABLES, .in_turns = 1, .open = open_bins, .unit = unit, .describe = describe,
            .name_set = rx_restoration_name_set, .report = rx_restoration_report,
            .reading = rx_restoration_reading);
