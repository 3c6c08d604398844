/* A scene: populations at places. */
#include "simulate/scene.h"

#include <math.h>
#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"
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

#define PI 3.14159265358979323846

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

/* objects[index] has its position now. */
static void places_take(places *places, long index)
{
    int column, row;
    if (places->first == NULL)
        return;
    square_of(places, places->objects[index].x, places->objects[index].y, &column, &row);
    long *first = &places->first[(size_t)row * (size_t)places->columns + (size_t)column];
    places->next[index] = *first;
    *first = index;
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
    long clump = (long)(rx_draw(places->par, set, trial, DRAW_CLUMP) * (double)places->nclumps);
    rx_draw_two(places->par, RX_DRAW_CLUMPS, clump, 0, centre);
    rx_draw_two(places->par, set, trial, DRAW_SCATTER, scatter);
    double distance = CLUMP_SIGMA * sqrt(-2.0 * log(scatter[0])), angle = 2.0 * PI * scatter[1];
    *x = places->low_x + centre[0] * places->range_x + distance * cos(angle);
    *y = places->low_y + centre[1] * places->range_y + distance * sin(angle);
}

/* A place for object `number` of the population `set`; 0 when none was found in many trials. */
static int places_find(const places *places, int set, long number, double *x, double *y)
{
    const rx_scene_params *par = places->par;
    int own = RX_DRAW_PLACES + set;
    int clumped = rx_draw(par, own, number * TRIALS, DRAW_CLUMPED) < par->clustering;
    for (int k = 0; k < TRIALS; k++) {
        double at[2];
        long trial = number * TRIALS + k;
        if (clumped)
            clump_place(places, own, trial, x, y);
        else {
            rx_draw_two(par, own, trial, DRAW_PLACE, at);
            *x = places->low_x + at[0] * places->range_x;
            *y = places->low_y + at[1] * places->range_y;
        }
        if (is_allowed(places, *x, *y) && !is_crowded(places, *x, *y, -1))
            return 1;
    }
    return 0;
}

/* A place for the companion of star `number`, which is objects[primary]. */
static int places_beside(const places *places, long number, long primary, double *x, double *y)
{
    const rx_scene_params *par = places->par;
    for (int k = 0; k < TRIALS; k++) {
        double at[2];
        rx_draw_two(par, RX_DRAW_PLACES + RX_DRAW_STARS, number * TRIALS + k, DRAW_BESIDE, at);
        double distance = par->pair_low + at[0] * (par->pair_high - par->pair_low);
        *x = places->objects[primary].x + distance * cos(2.0 * PI * at[1]);
        *y = places->objects[primary].y + distance * sin(2.0 * PI * at[1]);
        if (is_allowed(places, *x, *y) && !is_crowded(places, *x, *y, primary))
            return 1;
    }
    return 0;
}

/* --- filling --- */

static long count_of(const rx_scene_params *par, const rx_population *population, int set)
{
    double whole = floor(population->count);
    return (long)whole + (rx_draw(par, set, 0, DRAW_COUNT) < population->count - whole);
}

/* objects[n] is made; its place is looked for. */
static int settle(rx_scene *scene, places *places, int found)
{
    if (!found) {
        scene->left_out++;
        return 0;
    }
    places_take(places, scene->n++);
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
    rx_status status = RX_OK;
    for (long i = 0; i < count && (status = may_go_on(i, err)) == RX_OK; i++) {
        rx_object *star = &scene->objects[scene->n];
        rx_population_star(par, i, star);
        if (!settle(scene, places, places_find(places, RX_DRAW_STARS, i, &star->x, &star->y)))
            continue;
        if (!(rx_draw(par, RX_DRAW_STARS, i, DRAW_PAIR) < par->pair_share))
            continue;
        long primary = scene->n - 1;
        rx_object *other = &scene->objects[scene->n];
        *other = *star;
        other->mag += rx_draw(par, RX_DRAW_STARS, i, DRAW_COMPANION_MAG) - 0.5;
        other->flux = pow(10.0, -0.4 * (other->mag - par->zeropoint));
        settle(scene, places, places_beside(places, i, primary, &other->x, &other->y));
    }
    return status;
}

static rx_status add_galaxies(const rx_scene_params *par, long count, rx_scene *scene, places *places,
                              rx_error *err)
{
    rx_status status = RX_OK;
    for (long i = 0; i < count && (status = may_go_on(i, err)) == RX_OK; i++) {
        rx_object *galaxy = &scene->objects[scene->n];
        rx_population_galaxy(par, i, galaxy);
        settle(scene, places, places_find(places, RX_DRAW_GALAXIES, i, &galaxy->x, &galaxy->y));
    }
    return status;
}

static rx_status add_templates(const rx_scene_params *par, const rx_templates *templates, long count,
                               rx_scene *scene, places *places, rx_error *err)
{
    rx_status status = RX_OK;
    for (long i = 0; i < count && (status = may_go_on(i, err)) == RX_OK; i++) {
        rx_object *object = &scene->objects[scene->n];
        long before = scene->shrunk;
        rx_population_template(par, templates, i, object, &scene->shrunk);
        if (!settle(scene, places, places_find(places, RX_DRAW_TEMPLATES, i, &object->x, &object->y)))
            scene->shrunk = before;
    }
    return status;
}

rx_status rx_scene_make(const rx_scene_params *par, const rx_templates *templates, rx_scene **dst,
                        rx_error *err)
{
    rx_scene *scene = NULL;
    places places = {0};
    *dst = NULL;
    rx_status status = RX_OK;
    RX_TRY(check_population(&par->stars, par->zeropoint, "stars", err));
    RX_TRY(check_population(&par->galaxies, par->zeropoint, "galaxies", err));
    RX_TRY(check_population(&par->templates, par->zeropoint, "templates", err));
    long stars = count_of(par, &par->stars, RX_DRAW_STARS);
    long galaxies = count_of(par, &par->galaxies, RX_DRAW_GALAXIES);
    long others = count_of(par, &par->templates, RX_DRAW_TEMPLATES);
    long room = (par->pair_share > 0.0 ? 2 : 1) * stars + galaxies + others;
    /* one more than needed: an object is made where it will be, before there is a place for it */
    RX_TRY_EXIT(rx_scene_new(par->width, par->height, room + 1, &scene, err));
    scene->n = 0;
    scene->templates = others > 0 ? templates : NULL;
    RX_TRY_EXIT(places_set(par, scene->objects, room, &places, err));
    RX_TRY_EXIT(add_stars(par, stars, scene, &places, err));
    RX_TRY_EXIT(add_galaxies(par, galaxies, scene, &places, err));
    RX_TRY_EXIT(add_templates(par, templates, others, scene, &places, err));
    *dst = scene;
    scene = NULL;
exit:
    places_clear(&places);
    rx_scene_free(scene);
    return status;
}
