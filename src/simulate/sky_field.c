/* One field: what is in it, through two optics. */
#include "simulate/sky_field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/noise_level.h"
#include "psf/moffat.h"
#include "psf/psf.h"
#include "simulate/render.h"

/* What is drawn for a field: its slot. */
enum {
    DRAW_FWHM,
    DRAW_BETA,
    DRAW_ELLIPTICITY,
    DRAW_ANGLE,
    DRAW_KIND,
    DRAW_STARS,
    DRAW_GALAXIES,
    DRAW_TEMPLATES,
    DRAW_SLOPE,
    DRAW_CLUMPS,
    DRAW_NEBULOUS,
    DRAW_NEBULAE,
    DRAW_BRIGHT,
    DRAW_BRIGHTS,
    DRAW_NEBULA = 16, /* and the following ones: NEBULA_SLOTS for each */
    DRAW_STAR = 64,   /* STAR_SLOTS for each bright star */
    DRAW_HALO = 96,   /* whether, its share */
    DRAW_HALO_FWHM = 98,
    DRAW_HALO_BETA
};
enum { NEBULAE_MOST = 3, NEBULA_SLOTS = 8, BRIGHT_MOST = 3, STAR_SLOTS = 4 };

static const double STAR_FIELDS = 0.40, GALAXY_FIELDS = 0.25, MINORITY = 0.1, SLOPE = 0.1,
                    BRIGHT_FIELDS = 0.3;
/* FWHM beyond the border in which objects still lie: their light is part of the tile's background. */
static const double BORDER = 2.0;
static const double HALO_LEAST = 0.02, HALO_WIDTH[2] = {2.0, 6.0} /* FWHM */, HALO_BETA = 5.0;

/* What fields are made from. */
typedef struct sky_ground {
    const rx_simulation *simulation;
    const rx_sky_variety *variety;
    const double *fwhm; /* from, to */
} sky_ground;

/* --- population --- */

/* The base is for the whole field and a border of 4 pixels, as rx_simulation_from_config() makes it for a PSF
 * of 1 pixel. */
static double share(const rx_scene_params *base, double margin)
{
    double field = (base->width + 2.0 * base->margin) * (base->height + 2.0 * base->margin);
    return (base->width + 2.0 * margin) * (base->height + 2.0 * margin) / field;
}

static rx_scene_params population(const sky_ground *sky, rx_random_stream key, double fwhm)
{
    const double density = sky->variety->density, kind = rx_random_between(key, DRAW_KIND, 0.0, 1.0);
    rx_scene_params scene = sky->simulation->scene;
    const double margin = ceil(BORDER * fwhm), area = share(&scene, margin);
    const int stars = kind < STAR_FIELDS, galaxies = !stars && kind < STAR_FIELDS + GALAXY_FIELDS;
    scene.stars.count *=
        area * (galaxies ? MINORITY : 1.0) * pow(density, rx_random_between(key, DRAW_STARS, -1.0, 1.0));
    scene.galaxies.count *=
        area * (stars ? MINORITY : 1.0) * pow(density, rx_random_between(key, DRAW_GALAXIES, -1.0, 1.0));
    scene.templates.count *=
        area * (stars ? MINORITY : 1.0) * pow(density, rx_random_between(key, DRAW_TEMPLATES, -1.0, 1.0));
    scene.stars.slope += rx_random_between(key, DRAW_SLOPE, -SLOPE, SLOPE);
    scene.clustering = rx_random_between(key, DRAW_CLUMPS, 0.0, scene.clustering);
    scene.pair_low *= fwhm;
    scene.pair_high *= fwhm;
    scene.least_distance *= fwhm;
    scene.margin = margin;
    scene.seed = key.seed;
    scene.stream = key.stream;
    return scene;
}

static int brighter_first(const void *a, const void *b)
{
    const double *p = a, *q = b;
    for (int i = 2; i >= 0; i--) /* flux, then y and x: no two orders are possible */
        if (p[i] != q[i])
            return p[i] > q[i] ? -1 : 1;
    return 0;
}

/* Stars of one more scene into the field's list. */
static rx_status list_stars(const rx_scene *scene, rx_sky_field *dst, rx_error *err)
{
    RX_TRY(RX_GROW(dst->stars, (size_t)(dst->nstars + scene->n), err));
    for (long i = 0; i < scene->n; i++) {
        const rx_object *o = &scene->objects[i];
        if (o->type != RX_OBJECT_STAR)
            continue;
        double *star = dst->stars[dst->nstars++];
        star[0] = o->x;
        star[1] = o->y;
        star[2] = o->flux;
    }
    qsort(dst->stars, (size_t)dst->nstars, sizeof *dst->stars, brighter_first);
    return RX_OK;
}

static rx_status make_bright_stars(const rx_sky_field *field, rx_random_stream key, rx_scene **dst,
                                   rx_error *err)
{
    int n = 1 + (int)rx_random_between(key, DRAW_BRIGHTS, 0.0, BRIGHT_MOST);
    RX_TRY(rx_scene_new(field->side, field->side, n, dst, err));
    for (int i = 0; i < n; i++) {
        const uint64_t slot = DRAW_STAR + (uint64_t)i * STAR_SLOTS;
        double peak = field->level * rx_random_log_between(key, slot + 2, 2.0, RX_NOISE_LEVEL_PEAK);
        (*dst)->objects[i] = (rx_object){.type = RX_OBJECT_STAR,
                                         .ratio = 1.0,
                                         .x = rx_random_between(key, slot, 0.0, field->side - 1.0),
                                         .y = rx_random_between(key, slot + 1, 0.0, field->side - 1.0),
                                         .flux = peak / field->peak};
    }
    return RX_OK;
}

/* Gaussians (Sersic index 1/2): the brightness in the centre is flux ln 2 / (pi r^2 b/a). */
static rx_status make_nebulae(const rx_sky_field *field, rx_random_stream key, rx_scene **dst, rx_error *err)
{
    int n = 1 + (int)rx_random_between(key, DRAW_NEBULAE, 0.0, NEBULAE_MOST);
    RX_TRY(rx_scene_new(field->side, field->side, n, dst, err));
    for (int i = 0; i < n; i++) {
        const uint64_t slot = DRAW_NEBULA + (uint64_t)i * NEBULA_SLOTS;
        double radius = rx_random_log_between(key, slot, 12.0, 80.0);
        double ratio = rx_random_between(key, slot + 1, 0.3, 1.0);
        double centre = field->level * rx_random_log_between(key, slot + 2, 0.01, 3.0);
        (*dst)->objects[i] = (rx_object){.type = RX_OBJECT_GALAXY,
                                         .x = rx_random_between(key, slot + 3, 0.0, field->side - 1.0),
                                         .y = rx_random_between(key, slot + 4, 0.0, field->side - 1.0),
                                         .flux = centre * M_PI * radius * radius * ratio / M_LN2,
                                         .radius = radius,
                                         .ratio = ratio,
                                         .angle = rx_random_between(key, slot + 5, 0.0, M_PI),
                                         .bulge_share = 1.0,
                                         .bulge_n = 0.5,
                                         .bulge_radius = radius,
                                         .bulge_ratio = ratio};
    }
    return RX_OK;
}

/* --- pixels --- */

static rx_status set_level(rx_sky_field *field, rx_error *err)
{
    const size_t n = (size_t)field->side * (size_t)field->side;
    float *light;
    RX_TRY(RX_MAKE(light, n, err));
    memcpy(light, field->blurred, n * sizeof *light);
    field->level = rx_brightness(light, n, 0);
    free(light);
    return RX_OK;
}

/* Single precision leaves values a little below 0 where there is no light. */
static void cut_negative(size_t n, float *pixels)
{
    for (size_t i = 0; i < n; i++)
        pixels[i] = pixels[i] > 0.0f ? pixels[i] : 0.0f;
}

/* What a field is seen through: core and halo, NULL without one. */
typedef struct two_optics {
    rx_optics *core, *halo;
} two_optics;

static rx_status render(const sky_ground *sky, const rx_scene *scene, const two_optics *optics,
                        rx_sky_field *field, rx_error *err)
{
    const size_t n = (size_t)field->side * (size_t)field->side;
    if (optics->halo == NULL) {
        const rx_optics *both[2] = {optics->core, sky->simulation->target};
        float *images[2] = {field->blurred, field->sharp};
        RX_TRY(rx_render(scene, 2, both, images, 1, err));
    } else {
        float *core, *halo;
        RX_TRY(RX_MAKE(core, 2 * n, err));
        halo = core + n;
        const rx_optics *all[3] = {optics->core, optics->halo, sky->simulation->target};
        float *images[3] = {core, halo, field->sharp};
        const rx_status status = rx_render(scene, 3, all, images, 1, err);
        for (size_t i = 0; i < n; i++)
            field->blurred[i] += (float)(1.0 - field->halo) * core[i] + (float)field->halo * halo[i];
        free(core);
        RX_TRY(status);
    }
    cut_negative(n, field->blurred);
    cut_negative(n, field->sharp);
    return RX_OK;
}

rx_status rx_sky_field_psf(const rx_sky_field *field, rx_psf **dst, rx_error *err)
{
    rx_psf *halo = NULL;
    *dst = NULL;
    RX_TRY(rx_psf_moffat(field->fwhm, field->beta, field->ratio, field->angle, 0, dst, err));
    if (!(field->halo > 0.0))
        return RX_OK;
    /* As much of the halo as rx_psf_moffat() keeps of a PSF, 1e-3 of all light being cut off. */
    const double radius =
        0.5 * field->halo_fwhm * rx_moffat_radius_flux(field->halo_beta, fmin(1e-3 / field->halo, 0.5));
    const int least = (*dst)->size, size = 2 * (int)ceil(radius) + 1;
    rx_psf_free(*dst);
    *dst = NULL;
    RX_TRY(
        rx_psf_moffat(field->halo_fwhm, field->halo_beta, 1.0, 0.0, size > least ? size : least, &halo, err));
    const rx_status status =
        rx_psf_moffat(field->fwhm, field->beta, field->ratio, field->angle, halo->size, dst, err);
    if (status == RX_OK)
        for (int i = 0; i < halo->size * halo->size; i++)
            (*dst)->basis[i] = (float)((1.0 - field->halo) * (double)(*dst)->basis[i] +
                                       field->halo * (double)halo->basis[i]);
    rx_psf_free(halo);
    return status;
}

static rx_status draw_psf(const sky_ground *sky, rx_random_stream key, rx_sky_field *field,
                          two_optics *optics, rx_error *err)
{
    const rx_sky_variety *par = sky->variety;
    rx_psf *psf = NULL;
    field->fwhm = rx_random_between(key, DRAW_FWHM, sky->fwhm[0], sky->fwhm[1]);
    field->beta = rx_random_between(key, DRAW_BETA, par->beta[0], par->beta[1]);
    field->ratio = 1.0 - rx_random_between(key, DRAW_ELLIPTICITY, 0.0, par->ellipticity);
    field->angle = rx_random_between(key, DRAW_ANGLE, 0.0, M_PI);
    if (rx_random_between(key, DRAW_HALO, 0.0, 1.0) < par->halos) {
        field->halo = rx_random_between(key, DRAW_HALO + 1, HALO_LEAST, RX_SKY_HALO);
        field->halo_fwhm =
            fmin(field->fwhm * rx_random_log_between(key, DRAW_HALO_FWHM, HALO_WIDTH[0], HALO_WIDTH[1]),
                 fmax(RX_SKY_HALO_FWHM, field->fwhm));
        field->halo_beta = rx_random_between(key, DRAW_HALO_BETA, RX_SKY_HALO_BETA, HALO_BETA);
        RX_TRY(rx_optics_moffat(
            &(rx_moffat_profile){.fwhm = field->halo_fwhm, .beta = field->halo_beta, .ratio = 1.0},
            field->side, field->side, &optics->halo, err));
    }
    RX_TRY(rx_optics_moffat(
        &(rx_moffat_profile){
            .fwhm = field->fwhm, .beta = field->beta, .ratio = field->ratio, .angle = field->angle},
        field->side, field->side, &optics->core, err));
    RX_TRY(rx_sky_field_psf(field, &psf, err));
    double sum = 0.0;
    for (int i = 0; i < psf->size * psf->size; i++)
        sum += (double)psf->basis[i] * (double)psf->basis[i];
    field->norm = sqrt(sum);
    field->peak = (double)psf->basis[psf->size / 2 * (psf->size + 1)];
    rx_psf_free(psf);
    return RX_OK;
}

/* *scene joins the field, and is freed. */
static rx_status add(const sky_ground *sky, rx_scene *scene, const two_optics *optics, rx_sky_field *field,
                     rx_error *err)
{
    rx_status status = list_stars(scene, field, err);
    if (status == RX_OK)
        status = render(sky, scene, optics, field, err);
    rx_scene_free(scene);
    return status;
}

static rx_status fill(const sky_ground *sky, rx_random_stream key, const two_optics *optics,
                      rx_sky_field *field, rx_error *err)
{
    rx_scene *scene = NULL;
    rx_scene_params par = population(sky, key, field->fwhm);
    RX_TRY(rx_scene_make(&par, sky->simulation->templates, &scene, err));
    RX_TRY(add(sky, scene, optics, field, err));
    RX_TRY(set_level(field, err));
    if (!(field->level > 0.0))
        return RX_OK;
    if (rx_random_between(key, DRAW_NEBULOUS, 0.0, 1.0) < sky->variety->nebulae) {
        RX_TRY(make_nebulae(field, key, &scene, err));
        RX_TRY(add(sky, scene, optics, field, err));
        RX_TRY(set_level(field, err));
    }
    if (rx_random_between(key, DRAW_BRIGHT, 0.0, 1.0) < BRIGHT_FIELDS) {
        RX_TRY(make_bright_stars(field, key, &scene, err));
        RX_TRY(add(sky, scene, optics, field, err));
    }
    return RX_OK;
}

rx_status rx_sky_field_make(const rx_simulation *simulation, const rx_sky_variety *variety,
                            const double fwhm[2], rx_random_stream from, rx_sky_field *dst, rx_error *err)
{
    const sky_ground sky = {simulation, variety, fwhm};
    const int side = simulation->scene.width;
    const size_t n = (size_t)side * (size_t)side;
    two_optics optics = {NULL, NULL};
    rx_status status;
    *dst = (rx_sky_field){.side = side};
    RX_TRY_EXIT(RX_MAKE(dst->sharp, n, err));
    RX_TRY_EXIT(RX_MAKE(dst->blurred, n, err));
    RX_TRY_EXIT(draw_psf(&sky, from, dst, &optics, err));
    status = fill(&sky, from, &optics, dst, err);
exit:
    rx_optics_free(optics.core);
    rx_optics_free(optics.halo);
    if (status != RX_OK)
        rx_sky_field_clear(dst);
    return status;
}

void rx_sky_field_clear(rx_sky_field *field)
{
    free(field->sharp);
    free(field->blurred);
    free(field->stars);
    *field = (rx_sky_field){0};
}
