/* Draws of single objects. */
#include "simulate/population.h"

#include <math.h>

#include "base/random.h"
#include "simulate/sersic.h"

#define PI 3.14159265358979323846
#define RADIAN (PI / 180.0)

enum { SLOTS = 64 };

/* What is drawn for an object: its slot. */
enum {
    DRAW_MAG,
    DRAW_SIZE,
    DRAW_INDEX,
    DRAW_RATIO,
    DRAW_ANGLE,
    DRAW_KIND,
    DRAW_ARMS,
    DRAW_PITCH,
    DRAW_CONTRAST,
    DRAW_BAR,
    DRAW_BAR_SHARE,
    DRAW_WHICH
};

/* --- numbers --- */

/* The noise of the scene is drawn with the same seed and stream: a set is a seed of its own. */
static uint64_t set_seed(const rx_scene_params *par, int set)
{
    return par->seed ^ (0x5343454e45000000u + (uint64_t)set) * 0x9E3779B97F4A7C15u;
}

static uint64_t counter_of(long number, int slot)
{
    return (uint64_t)number * SLOTS + (uint64_t)slot;
}

void rx_draw_two(const rx_scene_params *par, int set, long number, int slot, double dst[2])
{
    rx_random_two(set_seed(par, set), par->stream, counter_of(number, slot), dst);
}

double rx_draw(const rx_scene_params *par, int set, long number, int slot)
{
    return rx_random_uniform(set_seed(par, set), par->stream, counter_of(number, slot));
}

static double draw_normal(const rx_scene_params *par, int set, long number, int slot)
{
    return rx_random_normal(set_seed(par, set), par->stream, counter_of(number, slot));
}

/* --- distributions --- */

/* Deciles of the COSMOS sample named in scene.h: numpy.percentile(n or q, range(0, 101, 10)). */
static const double index_deciles[11] = {0.502, 0.702, 0.848, 0.941, 1.095, 1.286,
                                         1.482, 1.887, 2.535, 3.113, 4.048};
static const double ratio_deciles[11] = {0.159, 0.256, 0.346, 0.419, 0.514, 0.574,
                                         0.628, 0.701, 0.758, 0.864, 0.994};

static double by_deciles(const double *deciles, double uniform)
{
    int i = (int)(10.0 * uniform);
    double part = 10.0 * uniform - i;
    return i >= 10 ? deciles[10] : deciles[i] + part * (deciles[i + 1] - deciles[i]);
}

/* Magnitude of a population by inversion of its counts. */
static double population_mag(const rx_population *population, double uniform)
{
    double range = population->mag_high - population->mag_low, rise = population->slope * range * log(10.0);
    if (fabs(rise) < 1e-6)
        return population->mag_low + uniform * range;
    return population->mag_low + range * log1p(uniform * expm1(rise)) / rise;
}

double rx_population_radius(double mag, double deviate)
{
    const double slope = -0.11;
    mag = fmin(fmax(mag, 5.0), 35.0); /* 45 arcsec .. 0.02 arcsec: magnitudes that mean something else */
    deviate = fmin(fmax(deviate, -2.5), 2.5);
    return pow(10.0, slope * (mag - 20.0)) * exp(RX_POPULATION_SCATTER * deviate);
}

static void set_flux(const rx_scene_params *par, double mag, rx_object *dst)
{
    dst->mag = mag;
    dst->flux = pow(10.0, -0.4 * (mag - par->zeropoint));
}

/* --- stars --- */

void rx_population_star(const rx_scene_params *par, long number, rx_object *dst)
{
    *dst = (rx_object){.type = RX_OBJECT_STAR, .ratio = 1.0};
    set_flux(par, population_mag(&par->stars, rx_draw(par, RX_DRAW_STARS, number, DRAW_MAG)), dst);
}

/* --- galaxies --- */

/* Share of the light of bulge and disk within the ellipse of major axis `radius` (disk radii) and the disk's
 * ratio. In the plane where the bulge is round the ellipse is one of `squeeze` = disk's over bulge's ratio;
 * the mean over its directions by the midpoint rule. */
static double joint_within(const rx_sersic *inner, const rx_sersic *outer, double share, double bulge,
                           double squeeze, double radius)
{
    enum { DIRECTIONS = 12 };
    double sum = 0.0;
    for (int i = 0; i < DIRECTIONS; i++) {
        double angle = 0.5 * PI * (i + 0.5) / DIRECTIONS;
        double edge = radius / hypot(cos(angle), sin(angle) / squeeze);
        sum += rx_sersic_within(inner, edge / bulge) / DIRECTIONS;
    }
    return share * sum + (1.0 - share) * rx_sersic_within(outer, radius);
}

/* Half-light radius of both over that of the disk: false position (Illinois). */
static double joint_radius(double share, double index, double bulge, double squeeze)
{
    rx_sersic inner, outer;
    rx_sersic_set(index, &inner);
    rx_sersic_set(1.0, &outer);
    double low = 0.2, high = 1.2, below = joint_within(&inner, &outer, share, bulge, squeeze, low) - 0.5;
    double above = joint_within(&inner, &outer, share, bulge, squeeze, high) - 0.5, middle = 1.0;
    for (int i = 0, side = 0; i < 60; i++) {
        double last = middle;
        middle = (low * above - high * below) / (above - below);
        double value = joint_within(&inner, &outer, share, bulge, squeeze, middle) - 0.5;
        if (value < 0.0) {
            low = middle;
            below = value;
            above *= side < 0 ? 0.5 : 1.0;
            side = -1;
        } else {
            high = middle;
            above = value;
            below *= side > 0 ? 0.5 : 1.0;
            side = 1;
        }
        if (fabs(middle - last) < 1e-7)
            break;
    }
    return middle;
}

static void add_arms(const rx_scene_params *par, long number, rx_object *dst)
{
    double which = rx_draw(par, RX_DRAW_GALAXIES, number, DRAW_ARMS), pitch[2], contrast[2], bar[2], share[2];
    rx_draw_two(par, RX_DRAW_GALAXIES, number, DRAW_PITCH, pitch);
    rx_draw_two(par, RX_DRAW_GALAXIES, number, DRAW_CONTRAST, contrast);
    dst->arms = which < 0.6 ? 2 : which < 0.8 ? 3 : 4;
    dst->arm_pitch = RADIAN * (10.0 + 25.0 * pitch[0]) * (pitch[1] < 0.5 ? -1.0 : 1.0);
    dst->arm_contrast = 0.3 + 0.5 * contrast[0];
    dst->arm_phase = 2.0 * PI * contrast[1];
    rx_draw_two(par, RX_DRAW_GALAXIES, number, DRAW_BAR, bar);
    rx_draw_two(par, RX_DRAW_GALAXIES, number, DRAW_BAR_SHARE, share);
    if (bar[0] < 1.0 / 3.0) {
        dst->bar_share = 0.05 + 0.10 * share[0];
        dst->bar_radius = dst->disk_radius * (0.4 + 0.4 * share[1]);
    }
}

void rx_population_galaxy(const rx_scene_params *par, long number, rx_object *dst)
{
    const double bulge_index = 2.5, bulge_radius = 0.2;
    const int set = RX_DRAW_GALAXIES;
    *dst = (rx_object){.type = RX_OBJECT_GALAXY};
    set_flux(par, population_mag(&par->galaxies, rx_draw(par, set, number, DRAW_MAG)), dst);
    dst->radius = rx_population_radius(dst->mag, draw_normal(par, set, number, DRAW_SIZE)) *
                  par->galaxy_scale / par->pixel_scale;
    dst->ratio = by_deciles(ratio_deciles, rx_draw(par, set, number, DRAW_RATIO));
    dst->angle = PI * (rx_draw(par, set, number, DRAW_ANGLE) - 0.5);
    double n = by_deciles(index_deciles, rx_draw(par, set, number, DRAW_INDEX));
    if (par->galaxy_kind == RX_GALAXY_SPIRAL)
        n = fmin(n, 2.49);
    int spiral = n < 2.5 && par->galaxy_kind != RX_GALAXY_SMOOTH &&
                 (par->galaxy_kind == RX_GALAXY_SPIRAL || rx_draw(par, set, number, DRAW_KIND) < 0.6);
    if (n >= 2.5 || (n < 1.0 && !spiral)) {
        dst->bulge_share = 1.0;
        dst->bulge_n = n;
        dst->bulge_radius = dst->radius;
        dst->bulge_ratio = dst->ratio;
        return;
    }
    if (n > 1.0) {
        dst->bulge_share = 0.31 * (n - 1.0) / (1.0 + 0.34 * (n - 1.0));
        dst->bulge_n = bulge_index;
        dst->bulge_ratio = 0.5 * (1.0 + dst->ratio);
    }
    dst->disk_radius = dst->radius / joint_radius(dst->bulge_share, bulge_index, bulge_radius,
                                                  dst->ratio / fmax(dst->bulge_ratio, dst->ratio));
    dst->bulge_radius = n > 1.0 ? bulge_radius * dst->disk_radius : 0.0;
    if (spiral)
        add_arms(par, number, dst);
}

/* --- templates --- */

void rx_population_template(const rx_scene_params *par, const rx_templates *templates, long number,
                            rx_object *dst, long *shrunk)
{
    const int set = RX_DRAW_TEMPLATES;
    double turn[2];
    *dst = (rx_object){.type = RX_OBJECT_TEMPLATE};
    set_flux(par, population_mag(&par->templates, rx_draw(par, set, number, DRAW_MAG)), dst);
    int which = (int)(rx_draw(par, set, number, DRAW_WHICH) * templates->n);
    const rx_template *source = &templates->list[which < templates->n ? which : templates->n - 1];
    rx_draw_two(par, set, number, DRAW_ANGLE, turn);
    dst->template_index = (int)(source - templates->list);
    dst->flip = turn[1] < 0.5;
    dst->stretch = rx_population_radius(dst->mag, draw_normal(par, set, number, DRAW_SIZE)) *
                   par->galaxy_scale / par->pixel_scale * sqrt(source->ratio) / source->radius;
    double blur = rx_template_blur(source);
    if (par->template_blur > 0.0 && dst->stretch * blur > par->template_blur) {
        dst->stretch = par->template_blur / blur;
        (*shrunk)++;
    }
    dst->radius = source->radius * dst->stretch / sqrt(source->ratio);
    dst->ratio = source->ratio;
    /* the template is flipped (x to -x), then turned until its major axis lies at `angle` */
    dst->angle = 2.0 * PI * (turn[0] - 0.5);
}
