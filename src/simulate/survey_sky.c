/* What surveys deliver: what a sample has of it, and what that is pixel by pixel. */
#include "simulate/survey_sky.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/convolve.h"
#include "simulate/coadd.h"
#include "simulate/noise.h"

/* Slots of a sample's key, beyond those of scenes.c. */
enum {
    DRAW_NOISE = 32,
    DRAW_KIND,
    DRAW_SIZE,
    DRAW_OFFSET = DRAW_SIZE + 2,
    DRAW_OFF,
    DRAW_PSF,
    DRAW_FWHM,
    DRAW_RATIO,
    DRAW_BETA,
    DRAW_DEFECTS,
    DRAW_RAYS,
    DRAW_GAIN,
    DRAW_COLUMNS,
    DRAW_UNEVEN,
    DRAW_SLOPE,
    DRAW_SLOPED,
    DRAW_EDGES,
    DRAW_WAVY,
    DRAW_WAVES,
    DRAW_DARK,
    DRAW_HOLES,
    DRAW_EDGE = 64, /* SLOTS for each, and so on */
    DRAW_WAVE = 96,
    DRAW_HOLE = 128,
    DRAW_COLUMN = 160,
    DRAW_NO_HALO = 192
};
enum { SLOTS = 8, EDGES = 2, WAVES = 3, HOLES = 3, COLUMNS = 2 };
#define COSMIC_SEED 0x636f736d69630000u

static const double SLOPE = 0.5;              /* of ln g, over a patch from its centre */
static const double STEP[2] = {0.15, 0.7};    /* of ln g */
static const double SMOOTHING = 32.0;         /* of s, restore/network_data.h */
static const double WAVE[2] = {16.0, 1024.0}; /* FWHM, pixels */
static const double HEIGHT[2] = {0.05, 1.0};  /* noise units */
static const double HOLE[2] = {3.0, 60.0};    /* sigma: FWHM, pixels */
static const double DEPTH[2] = {0.3, 10.0};   /* noise units */
static const double RAYS = 3.0, GAIN[2] = {5.0, 100.0}, COLUMN[2] = {1.0, 30.0};
static const double PSF_FARTHEST = 3.0;

static int happens(rx_random_stream key, uint64_t slot, double share)
{
    return rx_random_between(key, slot, 0.0, 1.0) < share;
}

/* first .. last, all alike */
static int number(rx_random_stream key, uint64_t slot, int first, int last)
{
    return first + (int)rx_random_between(key, slot, 0.0, last - first + 1);
}

/* --- drawing --- */

/* By a Gaussian, as far as RX_NOISE_REACH. */
static rx_noise_correlation smoothed_noise(double fwhm)
{
    rx_noise_correlation noise = rx_noise_white(RX_NOISE_GIVEN);
    const double variance = fwhm * fwhm / (8.0 * M_LN2);
    noise.correlated = variance > 0.0;
    for (int y = 0; y < RX_NOISE_SIDE && noise.correlated; y++)
        for (int x = 0; x < RX_NOISE_SIDE; x++) {
            const double dx = x - RX_NOISE_REACH, dy = y - RX_NOISE_REACH;
            noise.at[y][x] = exp(-(dx * dx + dy * dy) / (4.0 * variance));
        }
    return noise;
}

static rx_noise_correlation draw_correlation(const rx_survey_params *par, rx_random_stream key)
{
    const double which = rx_random_between(key, DRAW_NOISE, 0.0, 1.0);
    double size[2], from = 0.0, to = 1.0;
    if (which < par->smoothed)
        return smoothed_noise(
            rx_random_between(key, DRAW_SIZE, par->smoothed_fwhm[0], par->smoothed_fwhm[1]));
    if (which >= par->smoothed + par->resampled)
        return rx_noise_white(RX_NOISE_GIVEN);
    const rx_resampler kind = (rx_resampler)number(key, DRAW_KIND, RX_RESAMPLER_LINEAR, RX_RESAMPLER_DRIZZLE);
    if (kind == RX_RESAMPLER_DRIZZLE) {
        from = 0.5;
        to = RX_SURVEY_DROP;
    }
    for (int i = 0; i < 2; i++)
        size[i] = rx_random_between(key, DRAW_SIZE + (uint64_t)i, from, to);
    if (kind == RX_RESAMPLER_DRIZZLE)
        size[1] = size[0];
    return rx_resampled_noise(kind, size);
}

static void draw_uneven(rx_random_stream key, rx_survey *dst)
{
    const double angle = rx_random_between(key, DRAW_SLOPED, 0.0, 2.0 * M_PI);
    const double slope = 2.0 * rx_random_between(key, DRAW_SLOPE, 0.0, SLOPE) / dst->side;
    dst->uneven = 1;
    dst->slope[0] = slope * cos(angle);
    dst->slope[1] = slope * sin(angle);
    dst->nedges = number(key, DRAW_EDGES, 0, EDGES);
    for (int i = 0; i < dst->nedges; i++) {
        const uint64_t slot = DRAW_EDGE + (uint64_t)i * SLOTS;
        const double turn = rx_random_between(key, slot, 0.0, 2.0 * M_PI), a = cos(turn), b = sin(turn);
        const double x = dst->centre + rx_random_between(key, slot + 1, -0.5, 0.5) * dst->side;
        const double y = dst->centre + rx_random_between(key, slot + 2, -0.5, 0.5) * dst->side;
        dst->edge[i].a = a;
        dst->edge[i].b = b;
        dst->edge[i].c = -a * x - b * y;
        dst->edge[i].step = rx_random_between(key, slot + 3, STEP[0], STEP[1]);
    }
}

static void draw_waves(rx_random_stream key, double fwhm, rx_survey *dst)
{
    dst->nwaves = number(key, DRAW_WAVES, 1, WAVES);
    for (int i = 0; i < dst->nwaves; i++) {
        const uint64_t slot = DRAW_WAVE + (uint64_t)i * SLOTS;
        const double angle = rx_random_between(key, slot, 0.0, 2.0 * M_PI), least = WAVE[0] * fwhm;
        const double length = rx_random_log_between(key, slot + 1, least, fmax(WAVE[1], least));
        dst->wave[i].u = 2.0 * M_PI * cos(angle) / length;
        dst->wave[i].v = 2.0 * M_PI * sin(angle) / length;
        dst->wave[i].phase = rx_random_between(key, slot + 2, 0.0, 2.0 * M_PI);
        dst->wave[i].height = rx_random_log_between(key, slot + 3, HEIGHT[0], HEIGHT[1]);
    }
}

static void draw_holes(rx_random_stream key, double fwhm, rx_survey *dst)
{
    const double least = HOLE[0] * fwhm, most = fmax(HOLE[1], least);
    dst->nholes = number(key, DRAW_HOLES, 1, HOLES);
    for (int i = 0; i < dst->nholes; i++) {
        const uint64_t slot = DRAW_HOLE + (uint64_t)i * SLOTS;
        const double major = rx_random_log_between(key, slot, least, most);
        const double minor = rx_random_log_between(key, slot + 1, least, major);
        const double angle = rx_random_between(key, slot + 2, 0.0, M_PI), c = cos(angle), d = sin(angle);
        const double p = 0.5 / (major * major), q = 0.5 / (minor * minor);
        dst->hole[i].xx = p * c * c + q * d * d;
        dst->hole[i].yy = p * d * d + q * c * c;
        dst->hole[i].xy = (p - q) * c * d;
        dst->hole[i].depth = rx_random_log_between(key, slot + 3, DEPTH[0], DEPTH[1]);
        dst->hole[i].x = rx_random_between(key, slot + 4, 0.0, dst->window);
        dst->hole[i].y = rx_random_between(key, slot + 5, 0.0, dst->window);
    }
}

static double deviate(rx_random_stream key, uint64_t slot, double rms)
{
    return rms * fmin(fmax(rx_random_normal(key.seed, key.stream, slot), -PSF_FARTHEST), PSF_FARTHEST);
}

void rx_survey_draw(const rx_survey_params *par, rx_random_stream key, int window, int side, double fwhm,
                    rx_survey *dst)
{
    *dst = (rx_survey){.window = window, .side = side, .centre = 0.5 * (window - 1), .key = key};
    dst->correlation = draw_correlation(par, key);
    dst->fwhm = dst->beta = 1.0;
    if (happens(key, DRAW_UNEVEN, par->uneven))
        draw_uneven(key, dst);
    if (happens(key, DRAW_OFFSET, par->offsets))
        dst->sky = rx_random_between(key, DRAW_OFF, -par->sky_offset, par->sky_offset);
    if (happens(key, DRAW_WAVY, par->waves))
        draw_waves(key, fwhm, dst);
    if (happens(key, DRAW_DARK, par->dark))
        draw_holes(key, fwhm, dst);
    dst->defects = happens(key, DRAW_DEFECTS, par->defects);
    if (happens(key, DRAW_PSF, par->psf)) {
        dst->fwhm = exp(deviate(key, DRAW_FWHM, RX_SURVEY_FWHM));
        dst->ratio = deviate(key, DRAW_RATIO, RX_SURVEY_RATIO);
        dst->beta = exp(deviate(key, DRAW_BETA, RX_SURVEY_BETA));
        dst->no_halo = happens(key, DRAW_NO_HALO, 0.5);
    }
}

/* --- pixels --- */

static double slope(const rx_survey *s, double x, double y)
{
    return s->slope[0] * (x - s->centre) + s->slope[1] * (y - s->centre);
}

double rx_survey_noise(const rx_survey *s, double x, double y)
{
    double value = slope(s, x, y);
    for (int i = 0; i < s->nedges; i++)
        value += copysign(0.5, s->edge[i].a * x + s->edge[i].b * y + s->edge[i].c) * s->edge[i].step;
    return value;
}

double rx_survey_scale(const rx_survey *s, double x, double y)
{
    double value = slope(s, x, y);
    for (int i = 0; i < s->nedges; i++) {
        const double beyond = s->edge[i].a * x + s->edge[i].b * y + s->edge[i].c;
        value += 0.5 * erf(beyond / (SMOOTHING * M_SQRT2)) * s->edge[i].step;
    }
    return value;
}

double rx_survey_light(const rx_survey *s, double x, double y)
{
    double value = 0.0;
    for (int i = 0; i < s->nwaves; i++)
        value += s->wave[i].height * sin(s->wave[i].u * x + s->wave[i].v * y + s->wave[i].phase);
    for (int i = 0; i < s->nholes; i++) {
        const double dx = x - s->hole[i].x, dy = y - s->hole[i].y;
        const double q = s->hole[i].xx * dx * dx + s->hole[i].yy * dy * dy + 2.0 * s->hole[i].xy * dx * dy;
        value -= s->hole[i].depth * exp(-q);
    }
    return value;
}

/* From its first row to its last one, or a part that begins or ends inside. */
static void add_column(const rx_survey *s, uint64_t slot, float *pixels)
{
    const double height = (happens(s->key, slot, 0.5) ? -1.0 : 1.0) *
                          rx_random_log_between(s->key, slot + 1, COLUMN[0], COLUMN[1]);
    const int x = (s->window - s->side) / 2 + number(s->key, slot + 2, 0, s->side - 1);
    const int half = happens(s->key, slot + 3, 0.5), from = number(s->key, slot + 4, 0, s->window - 1);
    for (int y = half ? from : 0; y < s->window; y++)
        pixels[(size_t)y * (size_t)s->window + (size_t)x] += (float)height;
}

void rx_survey_defects(const rx_survey *s, float *pixels)
{
    const uint64_t seed = s->key.seed ^ COSMIC_SEED;
    const double gain = rx_random_log_between(s->key, DRAW_GAIN, GAIN[0], GAIN[1]);
    const double area = (double)s->window * s->window / ((double)s->side * s->side);
    const uint64_t rays = (uint64_t)rx_noise_poisson(RAYS * area, s->key.seed, s->key.stream, DRAW_RAYS);
    const int columns = number(s->key, DRAW_COLUMNS, 0, COLUMNS);
    for (uint64_t k = 0; k < rays; k++) {
        rx_cosmic_ray ray;
        rx_cosmic_ray_make(seed, s->key.stream, k, s->window, s->window, &ray);
        rx_cosmic_ray_add(&ray, gain, s->window, s->window, pixels, NULL, 0);
    }
    for (int i = 0; i < columns; i++)
        add_column(s, DRAW_COLUMN + (uint64_t)i * SLOTS, pixels);
}

/* --- the most of it --- */

rx_status rx_survey_factor(const rx_survey_params *par, double fwhm, double *factor, rx_error *err)
{
    const int radius = rx_gauss_radius(fwhm), side = 2 * radius + 1;
    float *psf, *along;
    RX_TRY(RX_MAKE(psf, (size_t)side * (size_t)(side + 1), err));
    along = psf + (size_t)side * (size_t)side;
    rx_gauss_weights(fwhm, radius, along);
    for (int i = 0; i < side * side; i++)
        psf[i] = along[i % side] * along[i / side];
    const rx_noise_correlation smoothed = smoothed_noise(par->smoothed_fwhm[1]);
    *factor = 1.0;
    if (par->smoothed > 0.0)
        *factor = fmax(*factor, rx_noise_factor(&smoothed, psf, side, side));
    for (int kind = RX_RESAMPLER_LINEAR; par->resampled > 0.0 && kind <= RX_RESAMPLER_DRIZZLE; kind++) {
        const double worst = kind == RX_RESAMPLER_DRIZZLE ? RX_SURVEY_DROP : 0.5;
        const rx_noise_correlation noise =
            rx_resampled_noise((rx_resampler)kind, (const double[]){worst, worst});
        *factor = fmax(*factor, rx_noise_factor(&noise, psf, side, side));
    }
    free(psf);
    return RX_OK;
}
