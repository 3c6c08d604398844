/* A scene: populations at places. */
#include "simulate/scene.h"

#include <math.h>
#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "simulate/places.h"
#include "simulate/population.h"

#define MOST_OBJECTS 1e8
#define MOST_FLUX 1e25 /* ADU: sums over all objects stay far below what single precision holds */

/* Numbers of what else is drawn for a star, beyond those of population.c. */
enum { DRAW_PAIR = 32, DRAW_COMPANION_MAG, DRAW_COUNT = 48 };

/* --- memory --- */

rx_status rx_scene_new(int width, int height, long n, rx_scene **dst, rx_error *err)
{
    *dst = NULL;
    rx_scene *scene = RX_NEW(rx_scene, 1);
    rx_object *objects = RX_NEW(rx_object, (size_t)(n > 0 ? n : 0));
    if (scene == NULL || objects == NULL) {
        free(scene);
        free(objects);
        return rx_error_memory(err, sizeof(rx_object) * (size_t)n);
    }
    *scene = (rx_scene){.width = width, .height = height, .n = n, .objects = objects};
    *dst = scene;
    return RX_OK;
}

void rx_scene_free(rx_scene *scene)
{
    if (scene == NULL)
        return;
    free(scene->objects);
    free(scene);
}

/* --- checks --- */

static rx_status check_population(const rx_population *population, double zeropoint, const char *what,
                                  rx_error *err)
{
    if (!(population->count >= 0.0 && population->count <= MOST_OBJECTS))
        return rx_error_set(err, RX_USAGE, "%g %s in a field: between 0 and %g are possible",
                            population->count, what, MOST_OBJECTS);
    if (population->count > 0.0 &&
        !(population->mag_low <= population->mag_high && isfinite(population->mag_low) &&
          isfinite(population->mag_high) && isfinite(population->slope)))
        return rx_error_set(err, RX_USAGE, "magnitudes of %s from %g to %g: the brighter end comes first",
                            what, population->mag_low, population->mag_high);
    double flux = pow(10.0, -0.4 * (population->mag_low - zeropoint));
    if (population->count > 0.0 && !(flux <= MOST_FLUX))
        return rx_error_set(err, RX_USAGE,
                            "%s of magnitude %g have %.3g ADU at a zero point of %g, and no pixel holds more "
                            "than %g; make them fainter",
                            what, population->mag_low, flux, zeropoint, MOST_FLUX);
    return RX_OK;
}

static int is_share(double value)
{
    return value >= 0.0 && value <= 1.0;
}

static rx_status check(const rx_scene_params *par, const rx_templates *templates, rx_error *err)
{
    if (!isfinite(par->zeropoint) || !isfinite(par->margin))
        return rx_error_set(err, RX_USAGE, "zero point %g and margin %g must be numbers", par->zeropoint,
                            par->margin);
    RX_TRY(check_population(&par->stars, par->zeropoint, "stars", err));
    RX_TRY(check_population(&par->galaxies, par->zeropoint, "galaxies", err));
    RX_TRY(check_population(&par->templates, par->zeropoint, "templates", err));
    if (par->width < 1 || par->height < 1)
        return rx_error_set(err, RX_USAGE, "a field of %d x %d pixels holds nothing", par->width,
                            par->height);
    int sized = par->galaxies.count > 0.0 || par->templates.count > 0.0;
    if (sized && !(par->pixel_scale > 0.0 && isfinite(par->pixel_scale) && par->galaxy_scale > 0.0 &&
                   isfinite(par->galaxy_scale)))
        return rx_error_set(err, RX_USAGE, "galaxies need a pixel scale (%g arcsec) and a size (%g) above 0",
                            par->pixel_scale, par->galaxy_scale);
    if (!is_share(par->pair_share) || !is_share(par->clustering))
        return rx_error_set(err, RX_USAGE, "shares of pairs (%g) and of clumped objects (%g) are from 0 to 1",
                            par->pair_share, par->clustering);
    if (par->pair_share > 0.0 &&
        !(par->pair_low >= 0.0 && par->pair_low <= par->pair_high && isfinite(par->pair_high)))
        return rx_error_set(err, RX_USAGE,
                            "separations of pairs from %g to %g pixels: the smaller comes first",
                            par->pair_low, par->pair_high);
    if (!(par->least_distance >= 0.0 && isfinite(par->least_distance)))
        return rx_error_set(err, RX_USAGE, "a least distance of %g pixels: 0 or more is possible",
                            par->least_distance);
    if (par->templates.count > 0.0 && (templates == NULL || templates->n < 1))
        return rx_error_set(err, RX_USAGE, "template objects are asked for, but there is no template");
    return RX_OK;
}

/* --- filling --- */

static long count_of(const rx_scene_params *par, const rx_population *population, int set)
{
    double whole = floor(population->count);
    return (long)whole + (rx_draw(par, set, 0, DRAW_COUNT) < population->count - whole);
}

/* objects[n] is made; its place is looked for. */
static int settle(rx_scene *scene, rx_places *places, int found)
{
    if (!found) {
        scene->left_out++;
        return 0;
    }
    rx_places_take(places, scene->n++);
    return 1;
}

/* Crowded fields take their time to fill: now and then somebody may want to stop. */
static rx_status may_go_on(long number, rx_error *err)
{
    return number % 256 == 0 ? rx_interrupt_check(err) : RX_OK;
}

static rx_status add_stars(const rx_scene_params *par, long count, rx_scene *scene, rx_places *places,
                           rx_error *err)
{
    rx_status status = RX_OK;
    for (long i = 0; i < count && (status = may_go_on(i, err)) == RX_OK; i++) {
        rx_object *star = &scene->objects[scene->n];
        rx_population_star(par, i, star);
        if (!settle(scene, places, rx_places_find(places, RX_DRAW_STARS, i, &star->x, &star->y)))
            continue;
        if (!(rx_draw(par, RX_DRAW_STARS, i, DRAW_PAIR) < par->pair_share))
            continue;
        long primary = scene->n - 1;
        rx_object *other = &scene->objects[scene->n];
        *other = *star;
        other->mag += rx_draw(par, RX_DRAW_STARS, i, DRAW_COMPANION_MAG) - 0.5;
        other->flux = pow(10.0, -0.4 * (other->mag - par->zeropoint));
        settle(scene, places, rx_places_beside(places, i, primary, &other->x, &other->y));
    }
    return status;
}

static rx_status add_galaxies(const rx_scene_params *par, long count, rx_scene *scene, rx_places *places,
                              rx_error *err)
{
    rx_status status = RX_OK;
    for (long i = 0; i < count && (status = may_go_on(i, err)) == RX_OK; i++) {
        rx_object *galaxy = &scene->objects[scene->n];
        rx_population_galaxy(par, i, galaxy);
        settle(scene, places, rx_places_find(places, RX_DRAW_GALAXIES, i, &galaxy->x, &galaxy->y));
    }
    return status;
}

static rx_status add_templates(const rx_scene_params *par, const rx_templates *templates, long count,
                               rx_scene *scene, rx_places *places, rx_error *err)
{
    rx_status status = RX_OK;
    for (long i = 0; i < count && (status = may_go_on(i, err)) == RX_OK; i++) {
        rx_object *object = &scene->objects[scene->n];
        long before = scene->shrunk;
        rx_population_template(par, templates, i, object, &scene->shrunk);
        if (!settle(scene, places, rx_places_find(places, RX_DRAW_TEMPLATES, i, &object->x, &object->y)))
            scene->shrunk = before;
    }
    return status;
}

rx_status rx_scene_make(const rx_scene_params *par, const rx_templates *templates, rx_scene **dst,
                        rx_error *err)
{
    rx_scene *scene = NULL;
    rx_places places = {0};
    *dst = NULL;
    rx_status status = RX_OK;
    RX_TRY(check(par, templates, err));
    long stars = count_of(par, &par->stars, RX_DRAW_STARS);
    long galaxies = count_of(par, &par->galaxies, RX_DRAW_GALAXIES);
    long others = count_of(par, &par->templates, RX_DRAW_TEMPLATES);
    long room = (par->pair_share > 0.0 ? 2 : 1) * stars + galaxies + others;
    /* one more than needed: an object is made where it will be, before there is a place for it */
    RX_TRY_EXIT(rx_scene_new(par->width, par->height, room + 1, &scene, err));
    scene->n = 0;
    scene->templates = others > 0 ? templates : NULL;
    RX_TRY_EXIT(rx_places_set(par, scene->objects, room, &places, err));
    RX_TRY_EXIT(add_stars(par, stars, scene, &places, err));
    RX_TRY_EXIT(add_galaxies(par, galaxies, scene, &places, err));
    RX_TRY_EXIT(add_templates(par, templates, others, scene, &places, err));
    *dst = scene;
    scene = NULL;
exit:
    rx_places_clear(&places);
    rx_scene_free(scene);
    return status;
}
