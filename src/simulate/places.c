/* Positions of objects. */
#include "simulate/places.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "simulate/population.h"

#define PI 3.14159265358979323846

enum { TRIALS = 1000, CLUMP_AREA = 65536, MOST_SQUARES = 1 << 24 };
#define CLUMP_SIGMA 20.0

/* Slots of a trial in the numbers for positions; trial t of object i is number i * TRIALS + t. */
enum { DRAW_CLUMPED, DRAW_PLACE, DRAW_CLUMP, DRAW_SCATTER, DRAW_BESIDE };

/* Squares along an axis, none narrower than the side that it was divided by. */
static int whole_squares(double sides)
{
    return (int)fmin(fmax(floor(sides), 1.0), MOST_SQUARES);
}

rx_status rx_places_set(const rx_scene_params *par, const rx_object *objects, long room, rx_places *dst,
                        rx_error *err)
{
    *dst = (rx_places){.par = par, .objects = objects};
    dst->low_x = -0.5 - par->margin;
    dst->low_y = -0.5 - par->margin;
    dst->range_x = par->width + 2.0 * par->margin;
    dst->range_y = par->height + 2.0 * par->margin;
    if (!(dst->range_x > 0.0 && dst->range_y > 0.0))
        return rx_error_set(err, RX_USAGE, "a margin of %g pixels inside a field of %d x %d leaves no room",
                            -par->margin, par->width, par->height);
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
        rx_places_clear(dst);
        return rx_error_memory(err, (squares + (size_t)room) * sizeof(long));
    }
    for (size_t i = 0; i < squares; i++)
        dst->first[i] = -1;
    return RX_OK;
}

void rx_places_clear(rx_places *places)
{
    free(places->first);
    free(places->next);
    places->first = places->next = NULL;
}

/* Square of a position, no matter how far outside. */
static void square_of(const rx_places *places, double x, double y, int *column, int *row)
{
    double i = floor((x - places->low_x) / places->range_x * places->columns);
    double j = floor((y - places->low_y) / places->range_y * places->rows);
    *column = (int)fmin(fmax(i, 0.0), places->columns - 1);
    *row = (int)fmin(fmax(j, 0.0), places->rows - 1);
}

void rx_places_take(rx_places *places, long index)
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
static int is_crowded(const rx_places *places, double x, double y, long except)
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

static int is_allowed(const rx_places *places, double x, double y)
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

static void clump_place(const rx_places *places, int set, long trial, double *x, double *y)
{
    double centre[2], scatter[2];
    long clump = (long)(rx_draw(places->par, set, trial, DRAW_CLUMP) * (double)places->nclumps);
    rx_draw_two(places->par, RX_DRAW_CLUMPS, clump, 0, centre);
    rx_draw_two(places->par, set, trial, DRAW_SCATTER, scatter);
    double distance = CLUMP_SIGMA * sqrt(-2.0 * log(scatter[0])), angle = 2.0 * PI * scatter[1];
    *x = places->low_x + centre[0] * places->range_x + distance * cos(angle);
    *y = places->low_y + centre[1] * places->range_y + distance * sin(angle);
}

int rx_places_find(const rx_places *places, int set, long number, double *x, double *y)
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

int rx_places_beside(const rx_places *places, long number, long primary, double *x, double *y)
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
