/* A scene: objects by the distributions of scene.h, at places. */
#include "simulate/scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/random.h"
#include "simulate/sersic.h"

/* Independent sets of numbers of one (seed, stream). */
typedef enum draw_set {
    STARS,
    GALAXIES,
    TEMPLATES,
    CLUMPS,
    PLACES /* + the set of the population: its positions */
} draw_set;

#define RADIAN (M_PI / 180.0)

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

/* Uniform in (0, 1), draw number `slot` < 64 of that object; two at once. */
static void draw_two(const rx_scene_params *par, int set, long number, int slot, double dst[2])
{
    rx_random_two(set_seed(par, set), par->stream, counter_of(number, slot), dst);
}

static double draw(const rx_scene_params *par, int set, long number, int slot)
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
        double angle = 0.5 * M_PI * (i + 0.5) / DIRECTIONS;
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
    double which = draw(par, GALAXIES, number, DRAW_ARMS), pitch[2], contrast[2], bar[2], share[2];
    draw_two(par, GALAXIES, number, DRAW_PITCH, pitch);
    draw_two(par, GALAXIES, number, DRAW_CONTRAST, contrast);
    dst->arms = which < 0.6 ? 2 : which < 0.8 ? 3 : 4;
    dst->arm_pitch = RADIAN * (10.0 + 25.0 * pitch[0]) * (pitch[1] < 0.5 ? -1.0 : 1.0);
    dst->arm_contrast = 0.3 + 0.5 * contrast[0];
    dst->arm_phase = 2.0 * M_PI * contrast[1];
    draw_two(par, GALAXIES, number, DRAW_BAR, bar);
    draw_two(par, GALAXIES, number, DRAW_BAR_SHARE, share);
    if (bar[0] < 1.0 / 3.0) {
        dst->bar_share = 0.05 + 0.10 * share[0];
        dst->bar_radius = dst->disk_radius * (0.4 + 0.4 * share[1]);
    }
}

static void make_galaxy(const rx_scene_params *par, long number, rx_object *dst)
{
    const double bulge_index = 2.5, bulge_radius = 0.2;
    const int set = GALAXIES;
    *dst = (rx_object){.type = RX_OBJECT_GALAXY};
    set_flux(par, population_mag(&par->galaxies, draw(par, set, number, DRAW_MAG)), dst);
    dst->radius = rx_population_radius(dst->mag, draw_normal(par, set, number, DRAW_SIZE)) *
                  par->galaxy_scale / par->pixel_scale;
    dst->ratio = by_deciles(ratio_deciles, draw(par, set, number, DRAW_RATIO));
    dst->angle = M_PI * (draw(par, set, number, DRAW_ANGLE) - 0.5);
    double n = by_deciles(index_deciles, draw(par, set, number, DRAW_INDEX));
    if (par->galaxy_kind == RX_GALAXY_SPIRAL)
        n = fmin(n, 2.49);
    int spiral = n < 2.5 && par->galaxy_kind != RX_GALAXY_SMOOTH &&
                 (par->galaxy_kind == RX_GALAXY_SPIRAL || draw(par, set, number, DRAW_KIND) < 0.6);
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

static void make_template(const rx_scene_params *par, const rx_templates *templates, long number,
                          rx_object *dst, long *shrunk)
{
    const int set = TEMPLATES;
    double turn[2];
    *dst = (rx_object){.type = RX_OBJECT_TEMPLATE};
    set_flux(par, population_mag(&par->templates, draw(par, set, number, DRAW_MAG)), dst);
    int which = (int)(draw(par, set, number, DRAW_WHICH) * templates->n);
    const rx_template *source = &templates->list[which < templates->n ? which : templates->n - 1];
    draw_two(par, set, number, DRAW_ANGLE, turn);
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
    dst->angle = 2.0 * M_PI * (turn[0] - 0.5);
}

#define MOST_OBJECTS 1e8
#define MOST_FLUX 1e25 /* ADU: sums over all objects stay far below what single precision holds */

/* Numbers of what else is drawn for a star. */
enum { DRAW_PAIR = 32, DRAW_COMPANION_MAG, DRAW_COUNT = 48 };

/* --- memory --- */

rx_status rx_scene_new(int width, int height, long n, rx_scene **dst, rx_error *err)
{
    rx_scene *scene;
    *dst = NULL;
    RX_TRY(RX_MAKE(scene, 1, err));
    *scene = (rx_scene){.width = width, .height = height, .n = n};
    const rx_status status = RX_MAKE(scene->objects, (size_t)(n > 0 ? n : 0), err);
    if (status == RX_OK)
        *dst = scene;
    else
        free(scene);
    return status;
}

void rx_scene_free(rx_scene *scene)
{
    if (scene == NULL)
        return;
    free(scene->objects);
    free(scene);
}

/* --- checks --- */

/* Single numbers are as the keywords' tables say; the area and the zero point make others of them. */
static rx_status check_population(const rx_population *population, double zeropoint, const char *what,
                                  rx_error *err)
{
    const double flux = pow(10.0, -0.4 * (population->mag_low - zeropoint));
    if (!(population->count <= MOST_OBJECTS))
        return rx_error_set(err, RX_USAGE, "%g %s in a field: between 0 and %g are possible",
                            population->count, what, MOST_OBJECTS);
    if (population->count > 0.0 && !(flux <= MOST_FLUX))
        return rx_error_set(err, RX_USAGE,
                            "%s of magnitude %g have %.3g ADU at a zero point of %g, and no pixel holds more "
                            "than %g; make them fainter",
                            what, population->mag_low, flux, zeropoint, MOST_FLUX);
    return RX_OK;
}

/* --- places: border, map, clumps, distance to the objects that are there already --- */

enum { TRIALS = 1000, CLUMP_AREA = 65536, MOST_SQUARES = 1 << 24 };
#define CLUMP_SIGMA 20.0

/* Slots of a trial in the numbers for positions; trial t of object i is number i * TRIALS + t. */
enum { DRAW_CLUMPED, DRAW_PLACE, DRAW_CLUMP, DRAW_SCATTER, DRAW_BESIDE };

typedef struct places {
    const rx_scene_params *par;
    double low_x, low_y, range_x, range_y; /* the area, pixels */
    long nclumps;
    /* taken positions by squares of least_distance: first of each square, then along next[] */
    int columns, rows;
    long *first; /* [rows][columns], -1 none */
    long *next;  /* [room] */
    const rx_object *objects;
} places;

/* Squares along an axis, none narrower than the side that it was divided by. */
static int whole_squares(double sides)
{
    return (int)fmin(fmax(floor(sides), 1.0), MOST_SQUARES);
}

static void places_clear(places *places)
{
    free(places->first);
    free(places->next);
    places->first = places->next = NULL;
}

/* For at most `room` objects. */
static rx_status places_set(const rx_scene_params *par, const rx_object *objects, long room, places *dst,
                            rx_error *err)
{
    *dst = (places){.par = par, .objects = objects};
    dst->low_x = -0.5 - par->margin;
    dst->low_y = -0.5 - par->margin;
    dst->range_x = par->width + 2.0 * par->margin;
    dst->range_y = par->height + 2.0 * par->margin;
    dst->nclumps = (long)fmax(1.0, floor(dst->range_x * dst->range_y / CLUMP_AREA));
    if (!(par->least_distance > 0.0))
        return RX_OK;
    double side = par->least_distance;
    while (dst->range_x / side * (dst->range_y / side) > MOST_SQUARES)
        side *= 2.0;
    dst->columns = whole_squares(dst->range_x / side);
    dst->rows = whole_squares(dst->range_y / side);
    size_t squares = (size_t)dst->columns * (size_t)dst->rows;
    dst->first = RX_NEW(long, squares);
    dst->next = RX_NEW(long, (size_t)room);
    if (dst->first == NULL || dst->next == NULL) {
        places_clear(dst);
        return rx_error_memory(err, (squares + (size_t)room) * sizeof(long));
    }
    for (size_t i = 0; i < squares; i++)
        dst->first[i] = -1;
    return RX_OK;
}

/* Square of a position, no matter how far outside. */
static void square_of(const places *places, double x, double y, int *column, int *row)
{
    double i = floor((x - places->low_x) / places->range_x * places->columns);
    double j = floor((y - places->low_y) / places->range_y * places->rows);
    *column = (int)fmin(fmax(i, 0.0), places->columns - 1);
    *row = (int)fmin(fmax(j, 0.0), places->rows - 1);
}

/* 1 when an object other than `except` is nearer than least_distance. Squares are at least that wide. */
static int is_crowded(const places *places, double x, double y, long except)
{
    int column, row;
    if (places->first == NULL)
        return 0;
    double distance = places->par->least_distance;
    square_of(places, x, y, &column, &row);
    for (int j = row > 0 ? row - 1 : 0; j <= row + 1 && j < places->rows; j++)
        for (int i = column > 0 ? column - 1 : 0; i <= column + 1 && i < places->columns; i++) {
            size_t square = (size_t)j * (size_t)places->columns + (size_t)i;
            for (long k = places->first[square]; k >= 0; k = places->next[k]) {
                const rx_object *other = &places->objects[k];
                if (k != except && hypot(other->x - x, other->y - y) < distance)
                    return 1;
            }
        }
    return 0;
}

static int is_allowed(const places *places, double x, double y)
{
    const rx_scene_params *par = places->par;
    if (!(x >= places->low_x && x < places->low_x + places->range_x && y >= places->low_y &&
          y < places->low_y + places->range_y))
        return 0;
    if (par->allowed == NULL)
        return 1;
    double i = floor(x + 0.5), j = floor(y + 0.5);
    if (!(i >= 0.0 && i < par->width && j >= 0.0 && j < par->height))
        return 0;
    return par->allowed[(size_t)j * (size_t)par->width + (size_t)i] != 0;
}

static void clump_place(const places *places, int set, long trial, double *x, double *y)
{
    double centre[2], scatter[2];
    long clump = (long)(draw(places->par, set, trial, DRAW_CLUMP) * (double)places->nclumps);
    draw_two(places->par, CLUMPS, clump, 0, centre);
    draw_two(places->par, set, trial, DRAW_SCATTER, scatter);
    double distance = CLUMP_SIGMA * sqrt(-2.0 * log(scatter[0])), angle = 2.0 * M_PI * scatter[1];
    *x = places->low_x + centre[0] * places->range_x + distance * cos(angle);
    *y = places->low_y + centre[1] * places->range_y + distance * sin(angle);
}

/* A place for object `number` of the population `set`, beside objects[primary] where that is not -1; 0 when none was found in
 * many trials. */
static int places_find(const places *places, int set, long number, long primary, double *x, double *y)
{
    const rx_scene_params *par = places->par;
    int own = PLACES + set;
    int clumped = draw(par, own, number * TRIALS, DRAW_CLUMPED) < par->clustering;
    for (int k = 0; k < TRIALS; k++) {
        double at[2];
        long trial = number * TRIALS + k;
        if (primary >= 0) {
            draw_two(par, own, trial, DRAW_BESIDE, at);
            double distance = par->pair_low + at[0] * (par->pair_high - par->pair_low);
            *x = places->objects[primary].x + distance * cos(2.0 * M_PI * at[1]);
            *y = places->objects[primary].y + distance * sin(2.0 * M_PI * at[1]);
        } else if (clumped) {
            clump_place(places, own, trial, x, y);
        } else {
            draw_two(par, own, trial, DRAW_PLACE, at);
            *x = places->low_x + at[0] * places->range_x;
            *y = places->low_y + at[1] * places->range_y;
        }
        if (is_allowed(places, *x, *y) && !is_crowded(places, *x, *y, primary))
            return 1;
    }
    return 0;
}

/* --- filling --- */

static long count_of(const rx_scene_params *par, const rx_population *population, int set)
{
    double whole = floor(population->count);
    return (long)whole + (draw(par, set, 0, DRAW_COUNT) < population->count - whole);
}

/* objects[n] is made; its place is looked for. */
static int settle(rx_scene *scene, places *places, int found)
{
    const long index = scene->n;
    int column, row;
    scene->n += found;
    scene->left_out += !found;
    if (!found || places->first == NULL)
        return found;
    square_of(places, scene->objects[index].x, scene->objects[index].y, &column, &row);
    long *first = &places->first[(size_t)row * (size_t)places->columns + (size_t)column];
    places->next[index] = *first;
    *first = index;
    return 1;
}

/* Crowded fields take their time to fill: now and then somebody may want to stop. */
static rx_status may_go_on(long number, rx_error *err)
{
    return number % 256 == 0 ? rx_interrupt_check(err) : RX_OK;
}

static rx_status add_stars(const rx_scene_params *par, long count, rx_scene *scene, places *places,
                           rx_error *err)
{
    for (long i = 0; i < count; i++) {
        rx_object *star = &scene->objects[scene->n];
        RX_TRY(may_go_on(i, err));
        *star = (rx_object){.type = RX_OBJECT_STAR, .ratio = 1.0};
        set_flux(par, population_mag(&par->stars, draw(par, STARS, i, DRAW_MAG)), star);
        if (!settle(scene, places, places_find(places, STARS, i, -1, &star->x, &star->y)))
            continue;
        if (!(draw(par, STARS, i, DRAW_PAIR) < par->pair_share))
            continue;
        long primary = scene->n - 1;
        rx_object *other = &scene->objects[scene->n];
        *other = *star;
        set_flux(par, star->mag + (draw(par, STARS, i, DRAW_COMPANION_MAG) - 0.5), other);
        settle(scene, places, places_find(places, STARS, i, primary, &other->x, &other->y));
    }
    return RX_OK;
}

/* Galaxies or templates. */
static rx_status add_extended(const rx_scene_params *par, const rx_templates *templates, int set, long count,
                              rx_scene *scene, places *places, rx_error *err)
{
    for (long i = 0; i < count; i++) {
        rx_object *object = &scene->objects[scene->n];
        const long before = scene->shrunk;
        RX_TRY(may_go_on(i, err));
        if (set == GALAXIES)
            make_galaxy(par, i, object);
        else
            make_template(par, templates, i, object, &scene->shrunk);
        if (!settle(scene, places, places_find(places, set, i, -1, &object->x, &object->y)))
            scene->shrunk = before;
    }
    return RX_OK;
}

rx_status rx_scene_make(const rx_scene_params *par, const rx_templates *templates, rx_scene **dst,
                        rx_error *err)
{
    rx_scene *scene = NULL;
    places places = {0};
    *dst = NULL;
    rx_status status = RX_OK;
    if (par->listed != NULL) {
        RX_TRY(rx_scene_new(par->width, par->height, par->nlisted, dst, err));
        memcpy((*dst)->objects, par->listed, (size_t)par->nlisted * sizeof *par->listed);
        return RX_OK;
    }
    RX_TRY(check_population(&par->stars, par->zeropoint, "stars", err));
    RX_TRY(check_population(&par->galaxies, par->zeropoint, "galaxies", err));
    RX_TRY(check_population(&par->templates, par->zeropoint, "templates", err));
    long stars = count_of(par, &par->stars, STARS);
    long galaxies = count_of(par, &par->galaxies, GALAXIES);
    long others = count_of(par, &par->templates, TEMPLATES);
    long room = (par->pair_share > 0.0 ? 2 : 1) * stars + galaxies + others;
    /* one more than needed: an object is made where it will be, before there is a place for it */
    RX_TRY_EXIT(rx_scene_new(par->width, par->height, room + 1, &scene, err));
    scene->n = 0;
    scene->templates = others > 0 ? templates : NULL;
    RX_TRY_EXIT(places_set(par, scene->objects, room, &places, err));
    RX_TRY_EXIT(add_stars(par, stars, scene, &places, err));
    RX_TRY_EXIT(add_extended(par, NULL, GALAXIES, galaxies, scene, &places, err));
    RX_TRY_EXIT(add_extended(par, templates, TEMPLATES, others, scene, &places, err));
    *dst = scene;
    scene = NULL;
exit:
    places_clear(&places);
    rx_scene_free(scene);
    return status;
}
