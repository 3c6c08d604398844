/* From fields to samples: which field, which place, its noise, and what is known of it; made by which rank, for which one. */
#include "train/samples.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/random.h"
#include "base/threads.h"
#include "num/convolve.h"
#include "par/ranks.h"
#include "psf/psf.h"
#include "simulate/noise.h"
#include "simulate/sky_noise.h"

/* Independent sets of random numbers. */
#define FIELD_SEED 0x6669656c64000000u
#define SAMPLE_SEED 0x73616d706c650000u
#define NOISE_SEED 0x6e6f697365000000u
#define VALIDATION_SEED 0x76616c6964617465u

/* What is drawn for a sample: its slot; for a field beyond what sky_field.c draws: the turn of each place. */
enum { DRAW_SIGMA, DRAW_PHOTON, DRAW_X, DRAW_Y, DRAW_SKY, DRAW_NOISE, DRAW_GIVEN };
enum { DRAW_TURN = 1024 };

enum { STAR_MARGIN = 8 };           /* listed stars keep this distance from the patch's border */
static const double FARTHEST = 3.0; /* errors are cut at so many sigma */
static const double BETA_LEAST = 1.1;

/* What one thread makes samples with. */
typedef struct bench {
    rx_fft *fft;                         /* of the window */
    float *x, *half, *spectrum, *filter; /* planes of fft */
    float *normal;                       /* [window][window] */
} bench;

typedef struct kept_field {
    rx_sky_field sky;
    uint64_t number; /* rx_samples_field(); 0: none */
    uint32_t era;    /* the epochs that it serves: epoch / uses */
} kept_field;

struct rx_samples {
    rx_samples_params par;
    rx_selection grid;
    rx_simulation *simulation;
    int window; /* pixels: patch and frame */
    int nthreads;
    bench *benches;   /* [nthreads] */
    kept_field *kept; /* [nkept] fields for the next epoch, in [room] places */
    long nkept, room;
    long n, all;       /* training images of the epoch, all images */
    rx_sample **image; /* [all] by position; NULL where it is not here */
    long made;
    double seconds;
};

/* One sample in the making. */
typedef struct draft {
    const rx_samples *of;
    const bench *bench;
    const rx_sky_field *field;
    rx_random_stream key;
    int x0, y0;   /* of the window in the field */
    double scale; /* given noise units per unit of the field's flux */
    double given; /* noise as given / true */
    rx_survey survey;
} draft;

/* --- keys --- */

static int places(const rx_samples_params *par)
{
    return par->field_side / par->side * (par->field_side / par->side);
}

static uint64_t hash(uint64_t seed, uint64_t stream, uint64_t counter)
{
    uint32_t word[4];
    rx_random_block(seed, stream, counter, word);
    uint64_t value = (uint64_t)word[0] << 32 | word[1];
    return value != 0 ? value : 1;
}

static uint64_t stream_of(rx_sample_id id)
{
    return (uint64_t)id.set << 32 | id.bin;
}

/* Validation images have a seed of their own, so that trainings of the same sky and another SEED are compared on the same
 * images. */
static uint64_t seed_of(const rx_samples_params *par, rx_sample_id id)
{
    return id.epoch == RX_EPOCH_VALIDATION ? VALIDATION_SEED : par->seed;
}

static uint32_t era_of(const rx_samples_params *par, uint32_t epoch)
{
    return epoch / (uint32_t)par->uses;
}

uint64_t rx_samples_field(const rx_samples_params *par, rx_sample_id id)
{
    const uint64_t era = era_of(par, id.epoch), number = id.index / (uint32_t)places(par);
    return hash(seed_of(par, id) ^ FIELD_SEED, stream_of(id), era << 32 | number);
}

/* Fields of all bins are dealt out like cards, along the diagonal of the grid, so that no rank gets all the wide PSFs,
 * and from another one on whenever the fields change. */
static int owner_of(const rx_samples *s, rx_sample_id id)
{
    const unsigned n = (unsigned)rx_par_processes(), field = id.index / (unsigned)places(&s->par);
    return (int)((id.bin + id.bin / n + id.set + field + era_of(&s->par, id.epoch)) % n);
}

static double error_of(rx_random_stream key, uint64_t slot, double rms)
{
    return rms * fmin(fmax(rx_random_normal(key.seed, key.stream, slot), -FARTHEST), FARTHEST);
}

/* --- making and freeing --- */

/* The widest PSF that may be given has to fit the window. */
static rx_status check_psf(const rx_samples *s, rx_error *err)
{
    const rx_samples_params *par = &s->par;
    rx_psf *psf = NULL;
    const int wrong = par->survey.psf > 0.0;
    const double widest = s->grid.fwhm[1] * exp(FARTHEST * (par->psf_error + (wrong ? RX_SURVEY_FWHM : 0.0)));
    const double beta = par->sky.beta[0] * (wrong ? exp(-FARTHEST * RX_SURVEY_BETA) : 1.0);
    const rx_sky_field worst = {.fwhm = widest,
                                .beta = fmax(beta, BETA_LEAST),
                                .ratio =
                                    1.0 - par->sky.ellipticity - (wrong ? FARTHEST * RX_SURVEY_RATIO : 0.0),
                                .halo = par->sky.halos > 0.0 ? RX_SKY_HALO : 0.0,
                                .halo_fwhm = fmax(RX_SKY_HALO_FWHM, s->grid.fwhm[1]),
                                .halo_beta = RX_SKY_HALO_BETA};
    rx_status status = rx_sky_field_psf(&worst, &psf, err);
    if (status == RX_OK && psf->size > s->window)
        status = rx_error_set(err, RX_USAGE,
                              "a PSF of FWHM %.3g has %d pixels and does not fit a patch and its frame, %d "
                              "pixels; make patches larger or the range of FWHM smaller",
                              widest, psf->size, s->window);
    rx_psf_free(psf);
    return status;
}

static rx_status open_simulation(rx_samples *s, const rx_simulate_config *config, int side, rx_log *log,
                                 rx_error *err)
{
    rx_simulate_config *own = NULL;
    RX_TRY(rx_simulate_config_copy(config, &own, err));
    own->image_size = (rx_ints){.n = 1, .v = {side}};
    own->inject_image[0] = '\0';
    own->psf_type = "MOFFAT";
    own->psf_fwhm = 1.0; /* lengths in FWHM are in pixels then */
    own->psf_variation = 0.0;
    own->sharp_fwhm = s->par.front.target_fwhm;
    rx_status status = rx_simulation_from_config(own, log, &s->simulation, err);
    rx_simulate_config_free(own);
    return status;
}

static rx_status open_bench(const rx_samples *s, bench *b, rx_error *err)
{
    RX_TRY(rx_fft_new(s->window, s->window, 1, &b->fft, err));
    b->x = rx_fft_real(b->fft);
    b->half = rx_fft_complex(b->fft);
    b->spectrum = rx_fft_complex(b->fft);
    b->filter = rx_fft_complex(b->fft);
    b->normal = RX_NEW(float, (size_t)s->window *(size_t)s->window);
    if (b->x == NULL || b->half == NULL || b->spectrum == NULL || b->filter == NULL || b->normal == NULL)
        return rx_error_memory(err, 0);
    return RX_OK;
}

/* Pixels on a side of a field with its frame. */
static int field_side(const rx_samples *s)
{
    return s->par.field_side + s->window - s->par.side;
}

rx_status rx_samples_new(const rx_samples_params *par, const rx_selection *grid,
                         const rx_simulate_config *config, int nthreads, rx_log *log, rx_samples **dst,
                         rx_error *err)
{
    rx_samples *s;
    rx_status status;
    *dst = NULL;
    RX_TRY(RX_MAKE(s, 1, err));
    s->par = *par;
    s->grid = *grid;
    s->window = rx_fft_good_size(par->side + 2 * RX_SAMPLES_FRAME);
    s->nthreads = nthreads;
    RX_TRY_EXIT(check_psf(s, err));
    RX_TRY_EXIT(open_simulation(s, config, field_side(s), log, err));
    RX_TRY_EXIT(RX_MAKE(s->benches, (size_t)nthreads, err));
    for (int t = 0; t < nthreads; t++)
        RX_TRY_EXIT(open_bench(s, &s->benches[t], err));
    *dst = s;
    return RX_OK;
exit:
    rx_samples_free(s);
    return status;
}

static void drop_images(rx_samples *s)
{
    for (long at = 0; at < s->all && s->image != NULL; at++)
        free(s->image[at]);
    free(s->image);
    s->image = NULL;
    s->n = s->all = 0;
}

void rx_samples_free(rx_samples *s)
{
    if (s == NULL)
        return;
    drop_images(s);
    for (long i = 0; i < s->nkept; i++)
        rx_sky_field_clear(&s->kept[i].sky);
    free(s->kept);
    for (bench *b = s->benches; b != NULL && b < s->benches + s->nthreads; b++) {
        free(b->x);
        free(b->half);
        free(b->spectrum);
        free(b->filter);
        free(b->normal);
        rx_fft_free(b->fft);
    }
    free(s->benches);
    rx_simulation_free(s->simulation);
    free(s);
}

/* --- fields --- */

/* *dst is one of those kept, or is made; then it is to be cleared or kept. */
static rx_status get_field(const rx_samples *s, long nkept, rx_sample_id id, kept_field *dst, rx_error *err)
{
    double fwhm[2], sigma[2];
    dst->number = rx_samples_field(&s->par, id);
    dst->era = era_of(&s->par, id.epoch);
    for (long i = 0; i < nkept; i++)
        if (s->kept[i].number == dst->number) {
            *dst = s->kept[i];
            return RX_OK;
        }
    rx_selection_bin(&s->grid, (int)id.bin, fwhm, sigma);
    return rx_sky_field_make(s->simulation, &s->par.sky, fwhm,
                             (rx_random_stream){seed_of(&s->par, id) ^ FIELD_SEED, dst->number}, &dst->sky,
                             err);
}

/* --- samples --- */

static void choose_place(const rx_samples *s, rx_sample_id id, draft *d)
{
    const int side = s->par.side, row = s->par.field_side / side, room = s->par.field_side - side + 1;
    const int place = (int)(id.index % (uint32_t)places(&s->par));
    d->x0 = place % row * side;
    d->y0 = place / row * side;
    if (id.epoch % (uint32_t)s->par.uses != 0) {
        d->x0 = (int)rx_random_between(d->key, DRAW_X, 0.0, room);
        d->y0 = (int)rx_random_between(d->key, DRAW_Y, 0.0, room);
    }
}

/* b->normal becomes correlated, of the same noise behind a filter matched to the PSF, which hardly any light is further
 * from the centre of than `MIDDLE` pixels. b->x is overwritten. */
static rx_status correlate(const draft *d, rx_error *err)
{
    enum { MIDDLE = 20, SIDE = 2 * MIDDLE + 1 };
    const bench *b = d->bench;
    const size_t stride = (size_t)rx_fft_stride_real(b->fft), w = (size_t)d->of->window;
    float middle[SIDE * SIDE] = {0};
    rx_psf *psf = NULL;
    RX_TRY(rx_sky_noise_filter(&d->survey.correlation, b->fft, b->x, b->filter, err));
    RX_TRY(rx_sky_field_psf(d->field, &psf, err));
    const int half = psf->size / 2 < MIDDLE ? psf->size / 2 : MIDDLE;
    for (int y = -half; y <= half; y++)
        memcpy(&middle[(MIDDLE + y) * SIDE + MIDDLE - half],
               &psf->basis[(psf->size / 2 + y) * psf->size + psf->size / 2 - half],
               (size_t)(2 * half + 1) * sizeof *middle);
    rx_psf_free(psf);
    const float scale = (float)(1.0 / rx_noise_factor(&d->survey.correlation, middle, SIDE, SIDE));
    for (size_t y = 0; y < w; y++)
        memcpy(b->x + y * stride, b->normal + y * w, w * sizeof *b->x);
    rx_fft_filter(b->fft, b->x, b->filter, false, b->half, b->x);
    for (size_t y = 0; y < w; y++)
        for (size_t x = 0; x < w; x++)
            b->normal[y * w + x] = scale * b->x[y * stride + x];
    return RX_OK;
}

/* b->normal: the noise of the sample, in true noise units. */
static rx_status draw_noise(const draft *d, uint64_t seed, rx_error *err)
{
    const bench *b = d->bench;
    const int w = d->of->window;
    rx_noise_normals(seed ^ NOISE_SEED, d->key.stream, 0, (long)w * w, b->normal);
    if (d->survey.correlation.correlated)
        RX_TRY(correlate(d, err));
    for (int y = 0; d->survey.uneven && y < w; y++)
        for (int x = 0; x < w; x++)
            b->normal[y * w + x] *= (float)exp(rx_survey_noise(&d->survey, x, y));
    return RX_OK;
}

/* The window's light with its noise, b->normal, into b->x, and what is known of it into dst. */
static void expose(draft *d, rx_sample *dst)
{
    const rx_samples *s = d->of;
    const bench *b = d->bench;
    const rx_sky_field *field = d->field;
    const rx_samples_params *par = &s->par;
    double fwhm[2], sigma[2];
    rx_selection_bin(&s->grid, (int)dst->id.bin, fwhm, sigma);
    const double bin_sigma = rx_random_between(d->key, DRAW_SIGMA, sigma[0], sigma[1]);
    const double photon = rx_random_log_between(d->key, DRAW_PHOTON, par->photon[0], par->photon[1]);
    const double sky = error_of(d->key, DRAW_SKY, par->sky_error) + d->survey.sky;
    const double scale = field->level > 0.0 ? RX_NOISE_LEVEL_SCALE / (bin_sigma * field->level) : 0.0;
    const size_t stride = (size_t)rx_fft_stride_real(b->fft), w = (size_t)s->window;
    d->given = exp(error_of(d->key, DRAW_NOISE, par->noise_error));
    d->scale = scale / d->given;
    dst->sigma = (float)bin_sigma;
    dst->true_fwhm = (float)field->fwhm;
    for (size_t y = 0; y < w; y++) {
        const float *light = field->blurred + ((size_t)d->y0 + y) * (size_t)field->side + (size_t)d->x0;
        const float *normal = b->normal + y * w;
        float *x = b->x + y * stride;
        for (size_t i = 0; i < w; i++) {
            float v = (float)scale * light[i];
            x[i] = (v + sqrtf(1.0f + (float)photon * v) * normal[i] + (float)sky) / (float)d->given;
        }
    }
}

/* dst [side][side] = scale times what `frame` pixels into the window of a plane is. */
static void cut(const float *plane, size_t stride, int x0, int y0, int side, double scale, float *dst)
{
    for (int y = 0; y < side; y++) {
        const float *row = plane + (size_t)(y0 + y) * stride + (size_t)x0;
        for (int x = 0; x < side; x++)
            *dst++ = (float)scale * row[x];
    }
}

static void list_stars(const draft *d, rx_sample *dst)
{
    const rx_sky_field *field = d->field;
    const double frame = 0.5 * (d->of->window - dst->side), last = dst->side - 1.0;
    dst->nstars = 0;
    memset(dst->star, 0, sizeof dst->star);
    for (long i = 0; i < field->nstars && dst->nstars < RX_SAMPLE_STARS; i++) {
        double x = field->stars[i][0] - d->x0 - frame, y = field->stars[i][1] - d->y0 - frame;
        if (fmin(x, y) < STAR_MARGIN || fmax(x, y) > last - STAR_MARGIN)
            continue;
        float *star = dst->star[dst->nstars++];
        double flux = field->stars[i][2] * d->scale;
        star[0] = (float)x;
        star[1] = (float)y;
        star[2] = (float)flux;
        star[3] = (float)(flux * d->given * field->norm);
    }
}

/* K' and the filter of w, from the PSF as it is given. */
static rx_status give_psf(const draft *d, rx_sample *dst, rx_error *err)
{
    const rx_samples *s = d->of;
    const bench *b = d->bench;
    const rx_front *front = &s->par.front;
    rx_psf *psf = NULL;
    const rx_survey *survey = &d->survey;
    rx_sky_field given = *d->field; /* its numbers */
    given.fwhm *= exp(error_of(d->key, DRAW_GIVEN, s->par.psf_error)) * survey->fwhm;
    given.beta = fmax(given.beta * survey->beta, BETA_LEAST);
    given.ratio = fmin(given.ratio + survey->ratio, 1.0);
    given.halo = survey->no_halo ? 0.0 : given.halo;
    rx_status status;
    RX_TRY_EXIT(rx_sky_field_psf(&given, &psf, err));
    RX_TRY_EXIT(
        rx_deblur_relative(psf->basis, psf->size, front->target_fwhm, RX_SAMPLE_KERNEL, 1, dst->kernel, err));
    status = rx_deblur_tikhonov(b->fft, psf->basis, psf->size,
                                &(rx_tikhonov){front->target_fwhm, front->tikhonov, 0}, b->spectrum, err);
exit:
    dst->fwhm = (float)given.fwhm;
    rx_psf_free(psf);
    return status;
}

/* b->x += what is in b->normal, true noise units; and the light of the sample where it is true. */
static void add(const draft *d, int true_light, rx_sample *dst)
{
    const bench *b = d->bench;
    const int w = d->of->window, side = dst->side, frame = (w - side) / 2,
              stride = rx_fft_stride_real(b->fft);
    for (int y = 0; y < w; y++)
        for (int x = 0; x < w; x++)
            b->x[y * stride + x] += b->normal[y * w + x] / (float)d->given;
    for (int y = 0; true_light && y < side; y++)
        for (int x = 0; x < side; x++) {
            const float light = b->normal[(y + frame) * w + x + frame] / (float)d->given;
            dst->y[y * side + x] += light;
            dst->blurred[y * side + x] += light;
        }
}

/* From units of the patch's noise to those of the noise that is given at each place. */
static void divide(const draft *d, rx_sample *dst)
{
    const bench *b = d->bench;
    const int w = d->of->window, side = dst->side, frame = (w - side) / 2,
              stride = rx_fft_stride_real(b->fft);
    for (int y = 0; y < w; y++)
        for (int x = 0; x < w; x++)
            b->x[y * stride + x] *= (float)exp(-rx_survey_scale(&d->survey, x, y));
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++) {
            const float unit = (float)exp(-rx_survey_scale(&d->survey, x + frame, y + frame));
            dst->y[y * side + x] *= unit;
            dst->blurred[y * side + x] *= unit;
        }
    for (int i = 0; i < dst->nstars; i++) {
        const double x = (double)dst->star[i][0] + frame, y = (double)dst->star[i][1] + frame;
        dst->star[i][2] *= (float)exp(-rx_survey_scale(&d->survey, x, y));
        dst->star[i][3] *= (float)exp(-rx_survey_noise(&d->survey, x, y));
    }
}

/* What surveys deliver beyond noise and PSF, to the window in b->x and the planes cut from the field. */
static void deliver(const draft *d, rx_sample *dst)
{
    const bench *b = d->bench;
    const int w = d->of->window;
    if (d->survey.nwaves + d->survey.nholes > 0) {
        for (int y = 0; y < w; y++)
            for (int x = 0; x < w; x++)
                b->normal[y * w + x] = (float)rx_survey_light(&d->survey, x, y);
        add(d, 1, dst);
    }
    if (d->survey.defects) {
        memset(b->normal, 0, (size_t)w * (size_t)w * sizeof *b->normal);
        rx_survey_defects(&d->survey, b->normal);
        add(d, 0, dst);
    }
    if (d->survey.uneven)
        divide(d, dst);
}

static rx_status develop(draft *d, rx_sample *dst, rx_error *err)
{
    const rx_samples *s = d->of;
    const bench *b = d->bench;
    const rx_sky_field *field = d->field;
    const int frame = (s->window - dst->side) / 2, side = dst->side, x0 = d->x0 + frame, y0 = d->y0 + frame;
    const size_t stride = (size_t)rx_fft_stride_real(b->fft);
    rx_survey_draw(&s->par.survey, d->key, s->window, side, field->fwhm, &d->survey);
    RX_TRY(give_psf(d, dst, err));
    RX_TRY(draw_noise(d, seed_of(&s->par, dst->id), err));
    expose(d, dst);
    cut(field->sharp, (size_t)field->side, x0, y0, side, d->scale, dst->y);
    cut(field->blurred, (size_t)field->side, x0, y0, side, d->scale, dst->blurred);
    list_stars(d, dst);
    deliver(d, dst);
    cut(b->x, stride, frame, frame, side, 1.0, dst->x);
    rx_convolve(b->fft, b->spectrum, b->x, b->half, b->x);
    cut(b->x, stride, frame, frame, side, 1.0, dst->w);
    rx_random_stream turns = {seed_of(&s->par, dst->id) ^ FIELD_SEED, rx_samples_field(&s->par, dst->id)};
    const uint64_t place = dst->id.index % (uint32_t)places(&s->par);
    const int first = (int)rx_random_between(turns, DRAW_TURN + place, 0.0, RX_SAMPLE_TURNS);
    return rx_sample_turn(
        dst, (int)((uint32_t)first + dst->id.epoch % (uint32_t)s->par.uses) % RX_SAMPLE_TURNS, err);
}

/* The samples of one field, ids[n]. */
static rx_status make_run(const rx_samples *s, const bench *b, const rx_sky_field *field,
                          const rx_sample_id *ids, long n, rx_sample **samples, rx_error *err)
{
    for (long i = 0; i < n; i++) {
        RX_TRY(rx_interrupt_check(err));
        RX_TRY(rx_sample_new(s->par.side, &samples[i], err));
        const uint64_t seed = seed_of(&s->par, ids[i]) ^ SAMPLE_SEED,
                       stream = hash(seed, stream_of(ids[i]), (uint64_t)ids[i].epoch << 32 | ids[i].index);
        draft d = {.of = s, .bench = b, .field = field, .key = {seed, stream}};
        samples[i]->id = ids[i];
        choose_place(s, ids[i], &d);
        RX_TRY(develop(&d, samples[i], err));
    }
    return RX_OK;
}

/* begin[runs + 1]: where the ids of another field begin. */
static rx_status find_runs(const rx_samples *s, const rx_sample_id *ids, long n, long **begin, long *runs,
                           rx_error *err)
{
    RX_TRY(RX_MAKE(*begin, (size_t)n + 1, err));
    *runs = 0;
    for (long i = 0; i < n; i++) {
        const rx_sample_id id = ids[i];
        if (id.set > RX_SET_TEST || id.bin >= (uint32_t)s->grid.nbins || id.index >= (uint32_t)s->grid.total)
            return rx_error_set(
                err, RX_USAGE, "image %u of bin %u, set %u: there are %d bins of %d images, and two sets",
                (unsigned)id.index, (unsigned)id.bin, (unsigned)id.set, s->grid.nbins, s->grid.total);
        if (i == 0 || rx_samples_field(&s->par, id) != rx_samples_field(&s->par, ids[i - 1]))
            (*begin)[(*runs)++] = i;
    }
    (*begin)[*runs] = n;
    return RX_OK;
}

static rx_status prepare_room(rx_samples *s, uint32_t epoch, long runs, rx_error *err)
{
    const size_t bytes = 2 * sizeof(float) * (size_t)field_side(s) * (size_t)field_side(s);
    const long most = (long)(RX_SAMPLES_MEMORY / bytes);
    long n = 0;
    if (epoch == RX_EPOCH_VALIDATION)
        return RX_OK;
    for (long i = 0; i < s->nkept; i++) /* epochs only rise: fields of those that are over serve no more */
        if (s->kept[i].era < era_of(&s->par, epoch))
            rx_sky_field_clear(&s->kept[i].sky);
        else
            s->kept[n++] = s->kept[i];
    s->nkept = n;
    s->room = s->nkept + runs < most ? s->nkept + runs : most;
    return RX_GROW(s->kept, (size_t)s->room + 1, err);
}

/* Runs are shared among threads; of several errors that of the first run is reported. */
rx_status rx_samples_make(rx_samples *s, const rx_sample_id *ids, long n, rx_sample **samples, rx_error *err)
{
    long *begin = NULL, runs = 0, first = n;
    rx_status status;
    RX_TRY_EXIT(find_runs(s, ids, n, &begin, &runs, err));
    if (n > 0)
        RX_TRY_EXIT(prepare_room(s, ids[0].epoch, runs, err));
    const long nkept = s->nkept;
#pragma omp parallel num_threads(s->nthreads)
    {
        const int thread = omp_get_thread_num();
        omp_set_num_threads(1); /* what is called from here, and has threads of its own, keeps to this one */
#pragma omp for schedule(dynamic, 1)
        for (long r = 0; r < runs; r++) {
            rx_error own = rx_error_part(thread == 0 ? err : NULL);
            kept_field field = {0};
            const rx_sample_id *run = ids + begin[r];
            rx_status made = get_field(s, nkept, *run, &field, &own);
            if (made == RX_OK)
                made = make_run(s, &s->benches[thread], &field.sky, run, begin[r + 1] - begin[r],
                                samples + begin[r], &own);
#pragma omp critical(rx_samples_run)
            {
                bool kept = false;
                for (long i = 0; i < nkept; i++)
                    kept |= s->kept[i].number == field.number;
                /* kept for the next epoch, if that has the same fields and there is room */
                const bool again =
                    run->epoch != RX_EPOCH_VALIDATION && era_of(&s->par, run->epoch + 1) == field.era;
                if (!kept && made == RX_OK && again && s->nkept < s->room)
                    s->kept[s->nkept++] = field;
                else if (!kept)
                    rx_sky_field_clear(&field.sky);
                if (made != RX_OK && r < first) {
                    first = r;
                    status = made;
                    rx_error_take(err, &own);
                }
            }
        }
    }
exit:
    free(begin);
    return status;
}

/* --- an epoch --- */

typedef struct job {
    rx_sample_id id;
    long at;
} job;

/* Images, by set, bin and index. */
static int compare_jobs(const void *a, const void *b)
{
    const rx_sample_id *p = &((const job *)a)->id, *q = &((const job *)b)->id;
    if (p->set != q->set)
        return p->set < q->set ? -1 : 1;
    if (p->bin != q->bin)
        return p->bin < q->bin ? -1 : 1;
    return (p->index > q->index) - (p->index < q->index);
}

/* This rank's share; images of one field are made together. */
static rx_status make_share(rx_samples *s, const job *jobs, long from, rx_error *err)
{
    job *mine = NULL;
    rx_sample_id *ids = NULL;
    rx_sample **samples = NULL;
    long n = 0;
    const double begun = rx_seconds();
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(mine, (size_t)s->all, err));
    RX_TRY_EXIT(RX_MAKE(ids, (size_t)s->all, err));
    RX_TRY_EXIT(RX_MAKE(samples, (size_t)s->all, err));
    for (long at = from; at < s->all; at++)
        if (owner_of(s, jobs[at].id) == rx_par_rank())
            mine[n++] = jobs[at];
    qsort(mine, (size_t)n, sizeof *mine, compare_jobs);
    for (long i = 0; i < n; i++)
        ids[i] = mine[i].id;
    status = rx_samples_make(s, ids, n, samples, err);
    for (long i = 0; i < n; i++)
        s->image[mine[i].at] = samples[i];
    s->made += n;
    s->seconds += rx_seconds() - begun;
exit:
    free(mine);
    free(ids);
    free(samples);
    return status;
}

/* Every image to the rank that needs it, in the same order everywhere: no two ranks wait for each other. */
static rx_status hand_over(rx_samples *s, const job *jobs, long from, rx_error *err)
{
    const int side = s->par.side;
    for (long at = from; at < s->all; at++) {
        const long within = (at < s->n ? at : at - s->n) % s->par.batch;
        const int maker = owner_of(s, jobs[at].id), user = (int)(within * rx_par_processes() / s->par.batch);
        if (maker == user)
            continue;
        if (rx_par_rank() == maker) {
            RX_TRY(rx_par_send(user, s->image[at], rx_sample_bytes(side), err));
            free(s->image[at]);
            s->image[at] = NULL;
        } else if (rx_par_rank() == user) {
            RX_TRY(rx_sample_new(side, &s->image[at], err));
            RX_TRY(rx_par_receive(maker, s->image[at], rx_sample_bytes(side), NULL, err));
            rx_sample_attach(s->image[at]);
        }
    }
    return RX_OK;
}

rx_status rx_samples_epoch(rx_samples *s, uint32_t epoch, const rx_selection *selection, const rx_pick *order,
                           long n, long from, rx_error *err)
{
    job *jobs = NULL; /* [all] in the order of positions */
    long at = 0;
    rx_status status;
    drop_images(s);
    s->all = s->n = n;
    for (int bin = 0; bin < selection->nbins; bin++)
        s->all += selection->test[bin];
    RX_TRY_EXIT(RX_MAKE(s->image, (size_t)s->all, err));
    RX_TRY_EXIT(RX_MAKE(jobs, (size_t)s->all, err));
    for (; at < n; at++)
        jobs[at] = (job){{epoch, RX_SET_TRAIN, order[at].bin, order[at].index}, at};
    for (int bin = 0; bin < selection->nbins; bin++)
        for (int i = 0; i < selection->test[bin]; i++, at++)
            jobs[at] = (job){{epoch, RX_SET_TEST, (uint32_t)bin, (uint32_t)i}, at};
    status = make_share(s, jobs, from, err);
exit:
    status = rx_par_agree(status, err);
    if (status == RX_OK)
        status = hand_over(s, jobs, from, err);
    free(jobs);
    return status;
}

rx_sample *rx_samples_take(rx_samples *s, long at)
{
    rx_sample *sample = s->image[at];
    s->image[at] = NULL;
    return sample;
}

void rx_samples_made(const rx_samples *s, long *images, double *seconds)
{
    *images = s->made;
    *seconds = s->seconds;
}
