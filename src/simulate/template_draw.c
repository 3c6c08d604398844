/* Drawing a template: flipped, turned, stretched, onto the grid of cells.
 *
 * The template is a surface brightness by cubic B-splines around its pixels (not by interpolation: the spline
 * is smooth and nowhere negative, and its blur, 1/3 pixel^2 per axis, is given by rx_template_blur()). Splines
 * of a whole grid sum to 1 everywhere, so nothing is lost between pixels, however far they are stretched. A
 * cell larger than 0.9 template pixels is the mean of equal parts that are not: no pixel falls between the
 * cells. The sum over all cells is the flux to 1e-3, the rest being what the lattice of cells does not see of
 * the spline (tests/unit/simulate/test_template_draw.c). */
#include <math.h>

#include "simulate/render.h"

#define FINEST 0.9 /* largest distance of samples, template pixels */

enum { MOST_PARTS = 64 };

double rx_template_blur(const rx_template *source)
{
    double own = source->fwhm > 0.0 && source->pixel_scale > 0.0 ? source->fwhm / source->pixel_scale : 2.0;
    return sqrt(own * own + 8.0 * log(2.0) / 3.0);
}

/* From cells of the grid, counted from the object's centre, to template pixels. */
typedef struct mapping {
    double m[2][2];
    double centre[2]; /* template pixel at the object's position */
    double flux;      /* per template pixel, as brightness per cell */
    int parts;        /* per cell and axis */
} mapping;

static void set_mapping(const rx_object *object, const rx_template *source, double step, mapping *dst)
{
    /* flipped (x to -x) the major axis is at -angle; what is missing to the object's angle is the turn */
    double turn = object->angle - (object->flip ? -source->angle : source->angle),
           side = object->flip ? -1.0 : 1.0;
    double scale = step / object->stretch, c = cos(turn), s = sin(turn);
    dst->m[0][0] = side * scale * c;
    dst->m[0][1] = side * scale * s;
    dst->m[1][0] = -scale * s;
    dst->m[1][1] = scale * c;
    dst->centre[0] = source->x;
    dst->centre[1] = source->y;
    dst->flux = object->flux * scale * scale;
    dst->parts = (int)fmin(fmax(ceil(scale / FINEST), 1.0), MOST_PARTS);
}

/* Weights of pixels floor(x) - 1 .. floor(x) + 2 at x. */
static inline void spline(float part, float weight[4])
{
    float other = 1.0f - part, p2 = part * part, o2 = other * other;
    weight[0] = other * o2 * (1.0f / 6.0f);
    weight[1] = 2.0f / 3.0f - 0.5f * p2 * (1.0f + other);
    weight[2] = 2.0f / 3.0f - 0.5f * o2 * (1.0f + part);
    weight[3] = part * p2 * (1.0f / 6.0f);
}

static float brightness(const rx_template *source, double p, double q)
{
    double fp = floor(p), fq = floor(q);
    int i0 = (int)fp - 1, j0 = (int)fq - 1;
    float x[4], y[4], sum = 0.0f;
    spline((float)(p - fp), x);
    spline((float)(q - fq), y);
    if (i0 >= 0 && j0 >= 0 && i0 + 3 < source->width && j0 + 3 < source->height) {
        const float *at = source->pixels + (size_t)j0 * (size_t)source->width + i0;
        for (int j = 0; j < 4; j++, at += source->width)
            sum += y[j] * (x[0] * at[0] + x[1] * at[1] + x[2] * at[2] + x[3] * at[3]);
        return sum;
    }
    for (int j = 0; j < 4; j++) {
        if (j0 + j < 0 || j0 + j >= source->height)
            continue;
        const float *row = source->pixels + (size_t)(j0 + j) * (size_t)source->width;
        float line = 0.0f;
        for (int i = 0; i < 4; i++)
            if (i0 + i >= 0 && i0 + i < source->width)
                line += x[i] * row[i0 + i];
        sum += y[j] * line;
    }
    return sum;
}

static float cell_mean(const mapping *map, const rx_template *source, double dx, double dy)
{
    double sum = 0.0, part = 1.0 / map->parts;
    for (int j = 0; j < map->parts; j++)
        for (int i = 0; i < map->parts; i++) {
            double x = dx + (i + 0.5) * part - 0.5, y = dy + (j + 0.5) * part - 0.5;
            double p = map->centre[0] + map->m[0][0] * x + map->m[0][1] * y;
            double q = map->centre[1] + map->m[1][0] * x + map->m[1][1] * y;
            if (p > -2.0 && q > -2.0 && p < source->width + 1.0 && q < source->height + 1.0)
                sum += (double)brightness(source, p, q);
        }
    return (float)(sum * part * part * map->flux);
}

static int clamp_cell(double value, int most)
{
    return value < 0.0 ? 0 : value > most ? most : (int)value;
}

/* From the centroid to the farther end, with the reach of the spline. */
static double half_side(double centre, int n)
{
    return fmax(centre, n - 1 - centre) + 2.0;
}

void rx_template_draw(const rx_object *object, const rx_template *source, rx_fine_grid *grid)
{
    mapping map;
    if (!(object->stretch > 0.0))
        return;
    set_mapping(object, source, grid->step, &map);
    double x = (object->x - grid->x0) / grid->step, y = (object->y - grid->y0) / grid->step;
    /* half sides of the frame that holds the turned one, plus a cell */
    double det = fabs(map.m[0][0] * map.m[1][1] - map.m[0][1] * map.m[1][0]);
    double half_p = half_side(source->x, source->width), half_q = half_side(source->y, source->height);
    double half_x = (fabs(map.m[1][1]) * half_p + fabs(map.m[0][1]) * half_q) / det + 1.0;
    double half_y = (fabs(map.m[1][0]) * half_p + fabs(map.m[0][0]) * half_q) / det + 1.0;
    if (!(x + half_x >= 0.0 && x - half_x <= grid->width - 1 && y + half_y >= 0.0 &&
          y - half_y <= grid->height - 1))
        return;
    int left = clamp_cell(floor(x - half_x), grid->width - 1),
        right = clamp_cell(ceil(x + half_x), grid->width - 1);
    int bottom = clamp_cell(floor(y - half_y), grid->height - 1);
    int top = clamp_cell(ceil(y + half_y), grid->height - 1);
    for (int j = bottom; j <= top; j++)
        for (int i = left; i <= right; i++)
            grid->cells[(size_t)j * grid->stride + (size_t)i] += cell_mean(&map, source, i - x, j - y);
}
