/* From fields to samples: which field, which place, its noise, and what is known of it. */
#include "train/scenes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "num/convolve.h"
#include "psf/psf.h"
#include "simulate/noise.h"
#include "train/scenes_survey.h"

/* Independent sets of random numbers. */
#define SAMPLE_SEED 0x73616d706c650000u
#define NOISE_SEED 0x6e6f697365000000u

/* What is drawn for a sample: its slot; for a field beyond what scenes_field.c draws: the turn of each place.
 */
enum { DRAW_SIGMA, DRAW_PHOTON, DRAW_X, DRAW_Y, DRAW_SKY, DRAW_NOISE, DRAW_GIVEN };
enum { DRAW_TURN = 1024, TURNS = 8 };

enum { STAR_MARGIN = 8 };           /* listed stars keep this distance from the patch's border */
static const double FARTHEST = 3.0; /* errors are cut at so many sigma */
static const double BETA_LEAST = 1.1;

struct rx_scenes {
    rx_scenes_params par;
    rx_selection grid;
    rx_simulation *simulation;
    int window;                            /* pixels: patch and frame */
    rx_fft *fft;                           /* of the window */
    float *x, *half, *spectrum, *coloured; /* planes of fft */
    float *normal;                         /* [window][window] */
    rx_scenes_field_data *fields;          /* [capacity] */
    int capacity;
    long clock;
};

/* One sample in the making. */
typedef struct draft {
    const rx_scenes_field_data *field;
    rx_scenes_key key;
    int x0, y0;   /* of the window in the field */
    double scale; /* given noise units per unit of the field's flux */
    double given; /* noise as given / true */
    rx_survey survey;
} draft;

/* --- keys --- */

static int places(const rx_scenes_params *par)
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

uint64_t rx_scenes_field(const rx_scenes_params *par, rx_sample_id id)
{
    uint64_t era = id.epoch / (uint32_t)par->uses, number = id.index / (uint32_t)places(par);
    return hash(par->seed ^ RX_SCENES_FIELD_SEED, stream_of(id), era << 32 | number);
}

static rx_scenes_key sample_key(const rx_scenes_params *par, rx_sample_id id)
{
    uint64_t seed = par->seed ^ SAMPLE_SEED;
    return (rx_scenes_key){seed, hash(seed, stream_of(id), (uint64_t)id.epoch << 32 | id.index)};
}

static double error_of(rx_scenes_key key, uint64_t slot, double rms)
{
    return rms * fmin(fmax(rx_random_normal(key.seed, key.stream, slot), -FARTHEST), FARTHEST);
}

/* --- making and freeing --- */

static int is_range(const double range[2], double least, double most)
{
    return range[0] >= least && range[0] <= range[1] && range[1] <= most;
}

static int is_within(double value, double least, double most)
{
    return value >= least && value <= most;
}

static rx_status check_survey(const rx_scenes_survey *s, rx_error *err)
{
    const double shares[] = {s->smoothed, s->resampled, s->smoothed + s->resampled,
                             s->uneven,   s->offsets,   s->waves,
                             s->dark,     s->defects,   s->psf};
    for (size_t i = 0; i < sizeof shares / sizeof *shares; i++)
        if (!is_within(shares[i], 0.0, 1.0))
            return rx_error_set(
                err, RX_USAGE,
                "a share of %g of the images: 0 to 1 are possible, for smoothed and resampled "
                "noise together",
                shares[i]);
    if (!is_range(s->smoothed_fwhm, 0.0, 20.0) || !is_within(s->sky_offset, 0.0, 10.0))
        return rx_error_set(err, RX_USAGE,
                            "noise smoothed by %g to %g pixels, a sky off by %g: 0 to 20, the smaller first, "
                            "and 0 to 10 are possible",
                            s->smoothed_fwhm[0], s->smoothed_fwhm[1], s->sky_offset);
    return RX_OK;
}

static rx_status check(const rx_scenes_params *par, rx_error *err)
{
    if (par->side < 16 || par->side % 4 != 0 || par->field_side < par->side ||
        par->field_side % par->side != 0 || par->field_side > 1 << 14)
        return rx_error_set(err, RX_USAGE,
                            "patches of %d pixels in fields of %d: multiples of 4 from 16, and of the patch, "
                            "are possible",
                            par->side, par->field_side);
    if (par->set != RX_SET_TRAIN && par->set != RX_SET_TEST)
        return rx_error_set(err, RX_USAGE, "set %d: training images are %d, test images %d", par->set,
                            (int)RX_SET_TRAIN, (int)RX_SET_TEST);
    if (par->uses < 1)
        return rx_error_set(err, RX_USAGE, "%d uses of each place: 1 or more are possible", par->uses);
    if (!is_range(par->beta, 1.1, 1000.0) || !is_within(par->ellipticity, 0.0, 0.8))
        return rx_error_set(
            err, RX_USAGE,
            "Moffat exponents from %g to %g and ellipticities to %g: 1.1 to 1000, the smaller "
            "first, and 0 to 0.8 are possible",
            par->beta[0], par->beta[1], par->ellipticity);
    if (!is_within(par->density, 1.0, 1e6) || !is_within(par->nebulae, 0.0, 1.0) ||
        !is_within(par->halos, 0.0, 1.0))
        return rx_error_set(
            err, RX_USAGE,
            "a spread of densities of %g and shares of nebulae and halos of %g and %g: 1 or more, and "
            "0 to 1 are possible",
            par->density, par->nebulae, par->halos);
    if (!is_range(par->photon, 0.0, 1e6) || !is_within(par->sky_error, 0.0, 1e6) ||
        !is_within(par->noise_error, 0.0, 10.0) || !is_within(par->psf_error, 0.0, 1.0))
        return rx_error_set(err, RX_USAGE,
                            "photon noise from %g to %g, errors of sky, noise and PSF of %g, %g and %g: none "
                            "is negative, and the smaller comes first",
                            par->photon[0], par->photon[1], par->sky_error, par->noise_error, par->psf_error);
    return check_survey(&par->survey, err);
}

/* The widest PSF that may be given has to fit the window. */
static rx_status check_psf(const rx_scenes *s, rx_error *err)
{
    const rx_scenes_params *par = &s->par;
    rx_psf *psf = NULL;
    const int wrong = par->survey.psf > 0.0;
    const double widest = s->grid.fwhm[1] * exp(FARTHEST * (par->psf_error + (wrong ? RX_SURVEY_FWHM : 0.0)));
    const double beta = par->beta[0] * (wrong ? exp(-FARTHEST * RX_SURVEY_BETA) : 1.0);
    const rx_scenes_field_data worst = {.fwhm = widest,
                                        .beta = fmax(beta, BETA_LEAST),
                                        .ratio = 1.0 - par->ellipticity -
                                                 (wrong ? FARTHEST * RX_SURVEY_RATIO : 0.0),
                                        .halo = par->halos > 0.0 ? RX_SCENES_HALO : 0.0,
                                        .halo_fwhm = fmax(RX_SCENES_HALO_FWHM, s->grid.fwhm[1]),
                                        .halo_beta = RX_SCENES_HALO_BETA};
    rx_status status = rx_scenes_psf(&worst, &psf, err);
    if (status == RX_OK && psf->size > s->window)
        status = rx_error_set(err, RX_USAGE,
                              "a PSF of FWHM %.3g has %d pixels and does not fit a patch and its frame, %d "
                              "pixels; make patches larger or the range of FWHM smaller",
                              widest, psf->size, s->window);
    rx_psf_free(psf);
    return status;
}

static rx_status open_simulation(rx_scenes *s, const rx_simulate_config *config, int side, rx_log *log,
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

static rx_status open_scenes(rx_scenes *s, const rx_simulate_config *config, rx_log *log, rx_error *err)
{
    const int side = s->par.field_side + s->window - s->par.side;
    const size_t bytes = 2 * sizeof(float) * (size_t)side * (size_t)side;
    RX_TRY(check_psf(s, err));
    RX_TRY(open_simulation(s, config, side, log, err));
    RX_TRY(rx_fft_new(s->window, s->window, 1, &s->fft, err));
    s->capacity = RX_SCENES_MEMORY > 2 * bytes ? (int)(RX_SCENES_MEMORY / bytes) : 2;
    s->fields = RX_NEW(rx_scenes_field_data, s->capacity);
    s->x = rx_fft_real(s->fft);
    s->half = rx_fft_complex(s->fft);
    s->spectrum = rx_fft_complex(s->fft);
    s->coloured = rx_fft_complex(s->fft);
    s->normal = RX_NEW(float, (size_t)s->window *(size_t)s->window);
    if (s->fields == NULL || s->x == NULL || s->half == NULL || s->spectrum == NULL || s->coloured == NULL ||
        s->normal == NULL)
        return rx_error_memory(err, 0);
    return RX_OK;
}

rx_status rx_scenes_new(const rx_scenes_params *par, const rx_selection *grid,
                        const rx_simulate_config *config, rx_log *log, rx_scenes **dst, rx_error *err)
{
    *dst = NULL;
    RX_TRY(check(par, err));
    rx_scenes *s = RX_NEW(rx_scenes, 1);
    if (s == NULL)
        return rx_error_memory(err, sizeof *s);
    s->par = *par;
    s->grid = *grid;
    s->window = rx_fft_good_size(par->side + 2 * RX_SCENES_FRAME);
    rx_status status = open_scenes(s, config, log, err);
    if (status == RX_OK)
        *dst = s;
    else
        rx_scenes_free(s);
    return status;
}

void rx_scenes_free(rx_scenes *s)
{
    if (s == NULL)
        return;
    for (int i = 0; i < s->capacity && s->fields != NULL; i++)
        rx_scenes_field_clear(&s->fields[i]);
    free(s->fields);
    free(s->x);
    free(s->half);
    free(s->spectrum);
    free(s->coloured);
    free(s->normal);
    rx_fft_free(s->fft);
    rx_simulation_free(s->simulation);
    free(s);
}

/* --- fields --- */

/* The field if it is kept, else an empty place or that of the one not used for longest. */
static rx_scenes_field_data *find_field(rx_scenes *s, uint64_t number)
{
    rx_scenes_field_data *oldest = &s->fields[0];
    for (int i = 0; i < s->capacity; i++) {
        if (s->fields[i].number == number)
            return &s->fields[i];
        if (s->fields[i].used < oldest->used)
            oldest = &s->fields[i];
    }
    return oldest;
}

int rx_scenes_kept(const rx_scenes *s)
{
    int n = 0;
    for (int i = 0; i < s->capacity; i++)
        n += s->fields[i].number != 0;
    return n;
}

/* Epochs only rise: fields of those that are over serve no more. */
static void drop_past(rx_scenes *s, uint32_t era)
{
    for (int i = 0; i < s->capacity; i++)
        if (s->fields[i].number != 0 && s->fields[i].era < era)
            rx_scenes_field_clear(&s->fields[i]);
}

static rx_status get_field(rx_scenes *s, rx_sample_id id, const rx_scenes_field_data **dst, rx_error *err)
{
    const uint64_t number = rx_scenes_field(&s->par, id);
    const uint32_t era = id.epoch / (uint32_t)s->par.uses;
    drop_past(s, era);
    rx_scenes_field_data *field = find_field(s, number);
    *dst = field;
    if (field->number != number) {
        rx_scenes_sky sky = {
            .par = &s->par, .simulation = s->simulation, .side = s->par.field_side + s->window - s->par.side};
        double sigma[2];
        rx_selection_bin(&s->grid, (int)id.bin, sky.fwhm, sigma);
        rx_scenes_field_clear(field);
        rx_status status = rx_scenes_field_make(
            &sky, (rx_scenes_key){s->par.seed ^ RX_SCENES_FIELD_SEED, number}, field, err);
        if (status != RX_OK)
            return status;
        field->number = number;
        field->era = era;
    }
    field->used = ++s->clock;
    return RX_OK;
}

/* --- samples --- */

static void choose_place(const rx_scenes *s, rx_sample_id id, draft *d)
{
    const int side = s->par.side, row = s->par.field_side / side, room = s->par.field_side - side + 1;
    const int place = (int)(id.index % (uint32_t)places(&s->par));
    d->x0 = place % row * side;
    d->y0 = place / row * side;
    if (id.epoch % (uint32_t)s->par.uses != 0) {
        d->x0 = (int)rx_scenes_uniform(d->key, DRAW_X, 0.0, room);
        d->y0 = (int)rx_scenes_uniform(d->key, DRAW_Y, 0.0, room);
    }
}

/* s->normal becomes correlated, of the same noise behind a filter matched to the PSF. s->x is overwritten. */
static rx_status colour(rx_scenes *s, const draft *d, rx_error *err)
{
    const rx_scenes_field_data *field = d->field;
    const size_t stride = (size_t)rx_fft_stride_real(s->fft), w = (size_t)s->window;
    rx_psf *psf = NULL;
    RX_TRY(rx_scenes_psf(field, &psf, err));
    rx_convolve_spectrum(s->fft, psf->basis, psf->size, s->coloured);
    rx_psf_free(psf);
    RX_TRY(rx_correlation_filter(&d->survey.correlation, s->fft, s->coloured, s->coloured, err));
    for (size_t y = 0; y < w; y++)
        memcpy(s->x + y * stride, s->normal + y * w, w * sizeof *s->x);
    rx_fft_filter(s->fft, s->x, s->coloured, false, s->half, s->x);
    for (size_t y = 0; y < w; y++)
        memcpy(s->normal + y * w, s->x + y * stride, w * sizeof *s->x);
    return RX_OK;
}

/* s->normal: the noise of the sample, in true noise units. */
static rx_status draw_noise(rx_scenes *s, const draft *d, rx_error *err)
{
    const int w = s->window;
    rx_noise_normals(s->par.seed ^ NOISE_SEED, d->key.stream, 0, (long)w * w, s->normal);
    if (d->survey.correlation.kind != RX_CORRELATION_NONE)
        RX_TRY(colour(s, d, err));
    for (int y = 0; d->survey.uneven && y < w; y++)
        for (int x = 0; x < w; x++)
            s->normal[y * w + x] *= (float)exp(rx_survey_noise(&d->survey, x, y));
    return RX_OK;
}

/* The window's light with its noise, s->normal, into s->x, and what is known of it into dst. */
static void expose(rx_scenes *s, draft *d, rx_sample *dst)
{
    const rx_scenes_field_data *field = d->field;
    const rx_scenes_params *par = &s->par;
    double fwhm[2], sigma[2];
    rx_selection_bin(&s->grid, (int)dst->id.bin, fwhm, sigma);
    const double bin_sigma = rx_scenes_uniform(d->key, DRAW_SIGMA, sigma[0], sigma[1]);
    const double photon = rx_scenes_log_uniform(d->key, DRAW_PHOTON, par->photon[0], par->photon[1]);
    const double sky = error_of(d->key, DRAW_SKY, par->sky_error) + d->survey.sky;
    const double scale = field->level > 0.0 ? RX_NOISE_LEVEL_SCALE / (bin_sigma * field->level) : 0.0;
    const size_t stride = (size_t)rx_fft_stride_real(s->fft), w = (size_t)s->window;
    d->given = exp(error_of(d->key, DRAW_NOISE, par->noise_error));
    d->scale = scale / d->given;
    dst->sigma = (float)bin_sigma;
    dst->true_fwhm = (float)field->fwhm;
    for (size_t y = 0; y < w; y++) {
        const float *light = field->blurred + ((size_t)d->y0 + y) * (size_t)field->side + (size_t)d->x0;
        const float *normal = s->normal + y * w;
        float *x = s->x + y * stride;
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

static void list_stars(const rx_scenes *s, const draft *d, rx_sample *dst)
{
    const rx_scenes_field_data *field = d->field;
    const double frame = 0.5 * (s->window - dst->side), last = dst->side - 1.0;
    dst->nstars = 0;
    memset(dst->star, 0, sizeof dst->star);
    for (long i = 0; i < field->nstars && dst->nstars < RX_SAMPLE_STARS; i++) {
        double x = field->stars[i][0] - d->x0 - frame, y = field->stars[i][1] - d->y0 - frame;
        if (!is_within(x, STAR_MARGIN, last - STAR_MARGIN) || !is_within(y, STAR_MARGIN, last - STAR_MARGIN))
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
static rx_status give_psf(rx_scenes *s, const draft *d, rx_sample *dst, rx_error *err)
{
    const rx_front *front = &s->par.front;
    rx_psf *psf = NULL;
    const rx_survey *survey = &d->survey;
    rx_scenes_field_data given = *d->field; /* its numbers */
    given.fwhm *= exp(error_of(d->key, DRAW_GIVEN, s->par.psf_error)) * survey->fwhm;
    given.beta = fmax(given.beta * survey->beta, BETA_LEAST);
    given.ratio = fmin(given.ratio + survey->ratio, 1.0);
    given.halo = survey->no_halo ? 0.0 : given.halo;
    rx_status status;
    RX_TRY_EXIT(rx_scenes_psf(&given, &psf, err));
    RX_TRY_EXIT(
        rx_deblur_relative(psf->basis, psf->size, front->target_fwhm, RX_SAMPLE_KERNEL, 1, dst->kernel, err));
    status = rx_deblur_tikhonov(s->fft, psf->basis, psf->size,
                                &(rx_tikhonov){front->target_fwhm, front->tikhonov, 0}, s->spectrum, err);
exit:
    dst->fwhm = (float)given.fwhm;
    rx_psf_free(psf);
    return status;
}

/* s->x += what is in s->normal, true noise units; and the light of the sample where it is true. */
static void add(rx_scenes *s, const draft *d, int true_light, rx_sample *dst)
{
    const int w = s->window, side = dst->side, frame = (w - side) / 2, stride = rx_fft_stride_real(s->fft);
    for (int y = 0; y < w; y++)
        for (int x = 0; x < w; x++)
            s->x[y * stride + x] += s->normal[y * w + x] / (float)d->given;
    for (int y = 0; true_light && y < side; y++)
        for (int x = 0; x < side; x++) {
            const float light = s->normal[(y + frame) * w + x + frame] / (float)d->given;
            dst->y[y * side + x] += light;
            dst->blurred[y * side + x] += light;
        }
}

/* From units of the patch's noise to those of the noise that is given at each place. */
static void divide(rx_scenes *s, const draft *d, rx_sample *dst)
{
    const int w = s->window, side = dst->side, frame = (w - side) / 2, stride = rx_fft_stride_real(s->fft);
    for (int y = 0; y < w; y++)
        for (int x = 0; x < w; x++)
            s->x[y * stride + x] *= (float)exp(-rx_survey_scale(&d->survey, x, y));
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

/* What surveys deliver beyond noise and PSF, to the window in s->x and the planes cut from the field. */
static void deliver(rx_scenes *s, const draft *d, rx_sample *dst)
{
    const int w = s->window;
    if (d->survey.nwaves + d->survey.nholes > 0) {
        for (int y = 0; y < w; y++)
            for (int x = 0; x < w; x++)
                s->normal[y * w + x] = (float)rx_survey_light(&d->survey, x, y);
        add(s, d, 1, dst);
    }
    if (d->survey.defects) {
        memset(s->normal, 0, (size_t)w * (size_t)w * sizeof *s->normal);
        rx_survey_defects(&d->survey, s->normal);
        add(s, d, 0, dst);
    }
    if (d->survey.uneven)
        divide(s, d, dst);
}

static rx_status develop(rx_scenes *s, draft *d, rx_sample *dst, rx_error *err)
{
    const rx_scenes_field_data *field = d->field;
    const int frame = (s->window - dst->side) / 2, side = dst->side, x0 = d->x0 + frame, y0 = d->y0 + frame;
    const size_t stride = (size_t)rx_fft_stride_real(s->fft);
    rx_survey_draw(&s->par.survey, d->key, s->window, side, field->fwhm, &d->survey);
    RX_TRY(give_psf(s, d, dst, err));
    RX_TRY(draw_noise(s, d, err));
    expose(s, d, dst);
    cut(field->sharp, (size_t)field->side, x0, y0, side, d->scale, dst->y);
    cut(field->blurred, (size_t)field->side, x0, y0, side, d->scale, dst->blurred);
    list_stars(s, d, dst);
    deliver(s, d, dst);
    cut(s->x, stride, frame, frame, side, 1.0, dst->x);
    rx_convolve(s->fft, s->spectrum, s->x, s->half, s->x);
    cut(s->x, stride, frame, frame, side, 1.0, dst->w);
    rx_scenes_key turns = {s->par.seed ^ RX_SCENES_FIELD_SEED, field->number};
    const uint64_t place = dst->id.index % (uint32_t)places(&s->par);
    const int first = (int)rx_scenes_uniform(turns, DRAW_TURN + place, 0.0, TURNS);
    return rx_sample_turn(dst, (int)((uint32_t)first + dst->id.epoch % (uint32_t)s->par.uses) % TURNS, err);
}

rx_status rx_scenes_make(rx_scenes *s, rx_sample_id id, rx_sample *dst, rx_error *err)
{
    if (id.set != (uint32_t)s->par.set || id.bin >= (uint32_t)s->grid.nbins ||
        id.index >= (uint32_t)s->grid.total)
        return rx_error_set(
            err, RX_USAGE, "image %u of bin %u, set %u: there are %d bins of %d images, set %d",
            (unsigned)id.index, (unsigned)id.bin, (unsigned)id.set, s->grid.nbins, s->grid.total, s->par.set);
    if (dst->side != s->par.side)
        return rx_error_set(err, RX_USAGE, "a sample of %d pixels for patches of %d", dst->side, s->par.side);
    draft d = {.key = sample_key(&s->par, id)};
    RX_TRY(get_field(s, id, &d.field, err));
    dst->id = id;
    choose_place(s, id, &d);
    return develop(s, &d, dst, err);
}
