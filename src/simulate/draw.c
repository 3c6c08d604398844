/* Drawing galaxies and templates on a grid of cells.
 *
 * A galaxy is up to three components, each a profile in t = |M d|^2, d the distance from the centre and M a
 * 2 x 2 matrix that makes the component's outline the unit circle:
 *   bulge  Sersic n = bulge_n, half-light radius bulge_radius, ratio bulge_ratio;
 *   disk   Sersic n = 1, half-light radius disk_radius, ratio; spiral arms multiply it with
 *          1 + arm_contrast s(R) cos(arms (theta - ln(R / R0) / tan(arm_pitch)) - arm_phase), theta in the
 *          plane of the disk, s = R^2 / (R^2 + (0.5 disk_radius)^2), R0 = bar_radius or disk_radius: the mean
 *          around every circle is 1, so that arms move flux but add none;
 *   bar    bar_share of the galaxy's flux, Ferrers' bar (1 - t)^2, three times as long as wide, in the plane
 *          of the disk, its half length bar_radius, where the arms set out from its ends.
 * The disk has what bulge and bar leave of the flux. Profiles end where sersic.h says and are normalised over
 * what is left, analytically: the sum over all cells is the flux but for the error of the midpoint rule,
 * which is held down by quartering the cells near the centre (cusps) and those of components a few cells
 * wide.
 *
 * Accuracy of the sum on cells of 1/3 pixel, n <= 4, half-light radii of 0.1 to 10 pixels, ratios from 0.15:
 * 3e-4, at worst 1e-3; n = 8: 1e-3 for ratios from 0.5 (tests/unit/simulate/test_draw.c).
 *
 * The profile is read from a table over t, linear between 64 points per octave of t: chords of a convex
 * curve, too high by up to 2e-3 in the faint outskirts, below 3e-5 of the flux. Below t = 2^-32 (1/65536 of
 * the truncation radius) it is taken as constant. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "simulate/render.h"
#include "simulate/sersic.h"

enum {
    OCTAVES = 32,
    MANTISSA_BITS = 6,
    PER_OCTAVE = 1 << MANTISSA_BITS,
    TABLE = OCTAVES * PER_OCTAVE + 2,
    DEEPEST = 11, /* quarterings of a cell */
    FORCED = 6    /* at most so many of them because the component is narrow */
};

#define BAR_RATIO (1.0 / 3.0)
#define ARM_FADE 0.5 /* of disk_radius */
#define SMOOTH 0.7   /* largest change of ln I across a part of a quartered cell */
#define NEAR 0.5     /* largest size of such a part over its distance from the centre */
#define FEW 6.0
#define ERROR 2e-4
#define GAUSS 0.28867513459481288 /* nodes of the two-point rule, from the middle of a unit interval */
#define LEAST_RATIO 0.02          /* thinner is drawn as this */
#define LEAST_RADIUS 1e-3         /* cells; smaller is drawn as this */

typedef struct component {
    double x, y;    /* centre, cells of the grid */
    double m[2][2]; /* M, per cell */
    double a, b, c; /* t = a dx^2 + 2 b dx dy + c dy^2 */
    double widest;  /* square of the largest stretch of M: (size of a cell in units of the radius)^2 */
    int depth;      /* every cell is quartered so often at least */
    double split;   /* cells with a smaller t at their centre are quartered */
    int arms;
    float size[OCTAVES];                 /* largest square of a cell's size in that octave of t */
    float value[TABLE];                  /* brightness per cell */
    float real[TABLE], imaginary[TABLE]; /* arms: times z^arms, z = M d as a complex number */
} component;

/* --- tables --- */

static float table_t(int i)
{
    int octave = i >> MANTISSA_BITS, step = i & (PER_OCTAVE - 1);
    return ldexpf(1.0f + (float)step / PER_OCTAVE, octave - OCTAVES);
}

/* Place of t < 1 in the table: exponent and first bits of the mantissa of a float are its index. */
static inline int table_index(float t, float *fraction)
{
    const uint32_t first = (uint32_t)(127 - OCTAVES) << 23;
    uint32_t bits;
    memcpy(&bits, &t, sizeof bits);
    if (bits < first) {
        *fraction = 0.0f;
        return 0;
    }
    bits -= first;
    *fraction = (float)(bits & ((1u << (23 - MANTISSA_BITS)) - 1)) * (1.0f / (1 << (23 - MANTISSA_BITS)));
    return (int)(bits >> (23 - MANTISSA_BITS));
}

static inline float table_at(const float *table, int i, float fraction)
{
    return table[i] + fraction * (table[i + 1] - table[i]);
}

static inline float brightness(const component *c, double dx, double dy)
{
    float u = (float)(c->m[0][0] * dx + c->m[0][1] * dy), w = (float)(c->m[1][0] * dx + c->m[1][1] * dy);
    float t = u * u + w * w, fraction;
    if (!(t < 1.0f))
        return 0.0f;
    int i = table_index(t, &fraction);
    float value = table_at(c->value, i, fraction);
    if (c->arms > 0) {
        float re = u, im = w;
        for (int k = 1; k < c->arms; k++) {
            float next = re * u - im * w;
            im = re * w + im * u;
            re = next;
        }
        value += table_at(c->real, i, fraction) * re + table_at(c->imaginary, i, fraction) * im;
    }
    return value > 0.0f ? value : 0.0f; /* fmaxf() is a call */
}

/* --- geometry --- */

/* M from the outline: half axes (radius, radius * ratio) in cells at `angle`, and inside the plane that this
 * makes an ellipse again of half axes 1, plane_ratio at plane_angle. */
static void set_outline(component *c, double radius, double ratio, double angle, double plane_angle,
                        double plane_ratio)
{
    ratio = fmax(ratio, LEAST_RATIO);
    double ca = cos(angle), sa = sin(angle), cp = cos(plane_angle), sp = sin(plane_angle);
    double disk[2][2] = {{ca / radius, sa / radius}, {-sa / (radius * ratio), ca / (radius * ratio)}};
    for (int k = 0; k < 2; k++) {
        c->m[0][k] = cp * disk[0][k] + sp * disk[1][k];
        c->m[1][k] = (-sp * disk[0][k] + cp * disk[1][k]) / plane_ratio;
    }
    c->a = c->m[0][0] * c->m[0][0] + c->m[1][0] * c->m[1][0];
    c->b = c->m[0][0] * c->m[0][1] + c->m[1][0] * c->m[1][1];
    c->c = c->m[0][1] * c->m[0][1] + c->m[1][1] * c->m[1][1];
    double half = 0.5 * (c->a + c->c), det = c->a * c->c - c->b * c->b;
    c->widest = half + sqrt(fmax(half * half - det, 0.0));
    c->depth = 0;
    for (double size = 8.0 * sqrt(c->widest); size > 1.0 && c->depth < FORCED; size *= 0.5)
        c->depth++;
}

static double outline_area(const component *c)
{
    return sqrt(c->a * c->c - c->b * c->b); /* |det M|: unit areas per cell */
}

/* Where whole cells will not do. The midpoint rule outside a radius R errs by h^2 / 24 times the integral of
 * the Laplacian there, -2 pi R dI/dR at R: h^2 / 24 2 pi I |dlnI/dlnR|. That is held below ERROR of the flux,
 * but no more than FEW cells around the centre are quartered for it. What is left is known, and is added. */
static void set_split(component *c, double flux, double power, double steepness)
{
    double most = fmin(FEW * FEW * c->widest, 1.0), error = 0.0;
    c->split = c->depth > 0 ? HUGE_VAL : 0.0;
    for (int i = TABLE - 2; i >= 0 && c->split == 0.0; i -= PER_OCTAVE / 4) {
        double t = (double)table_t(i), slope = 2.0 * power * steepness * pow(t, power);
        double value = (double)c->value[i] / (flux * outline_area(c));
        error = 0.5 * (c->a + c->c) / 24.0 * 2.0 * M_PI * value * slope;
        if (error > ERROR && t <= most)
            c->split = t;
    }
    if (c->split > 0.0 && c->split < 1.0)
        for (int i = 0; i < TABLE; i++)
            c->value[i] /= (float)(1.0 - error);
}

/* --- the components --- */

/* scale: flux per cell; Sersic of index n whose truncation radius is the unit. */
static void fill_sersic(component *c, const rx_sersic *profile, double flux)
{
    double n = profile->n, power = 0.5 / n, cut = profile->truncation;
    double centre = flux * outline_area(c) * profile->centre * cut * cut;
    double steepness = profile->b * pow(cut, 1.0 / n), mantissa[PER_OCTAVE];
    for (int j = 0; j < PER_OCTAVE; j++)
        mantissa[j] = pow(1.0 + (double)j / PER_OCTAVE, power);
    for (int k = 0; k < OCTAVES; k++) {
        double scale = steepness * exp2((k - OCTAVES) * power), t = exp2(k - OCTAVES);
        for (int j = 0; j < PER_OCTAVE; j++)
            c->value[k * PER_OCTAVE + j] = (float)(centre * exp(-scale * mantissa[j]));
        double length =
            n / (scale * (n < 1.0 ? exp2((OCTAVES - k) * (power - 0.5)) : 1.0)); /* R / dlnI/dlnR */
        c->size[k] = (float)(t * fmin(SMOOTH * SMOOTH * length * length, NEAR * NEAR));
    }
    c->value[TABLE - 2] = c->value[TABLE - 1] = (float)(centre * exp(-steepness));
    set_split(c, flux, power, steepness);
}

/* Amplitude and phase of the arms; both are products of a factor of the octave and one of the mantissa. */
static void fill_arms(component *c, const rx_object *o, double cut)
{
    double contrast = fmin(fmax(o->arm_contrast, 0.0), 1.0),
           pitch = fmin(fmax(fabs(o->arm_pitch), 0.05), 1.5);
    double fade = ARM_FADE / cut, turn = 0.5 * o->arms / tan(pitch) * (o->arm_pitch < 0.0 ? -1.0 : 1.0);
    double start = (o->bar_share > 0.0 && o->bar_radius > 0.0 ? o->bar_radius / o->disk_radius : 1.0) / cut;
    double re[PER_OCTAVE], im[PER_OCTAVE];
    c->arms = o->arms;
    for (int j = 0; j < PER_OCTAVE; j++) {
        double t = 1.0 + (double)j / PER_OCTAVE, size = contrast * pow(t, -0.5 * o->arms);
        re[j] = size * cos(turn * log(t));
        im[j] = size * sin(turn * log(t));
    }
    for (int k = 0; k <= OCTAVES; k++) {
        double t = exp2(k - OCTAVES), size = pow(t, -0.5 * o->arms);
        double phase = turn * log(t / (start * start)) + o->arm_phase;
        double octave_re = size * cos(phase), octave_im = size * sin(phase);
        for (int j = 0; j < PER_OCTAVE && k * PER_OCTAVE + j < TABLE; j++) {
            int i = k * PER_OCTAVE + j;
            double here = (double)table_t(i), value = (double)c->value[i] * here / (here + fade * fade);
            c->real[i] = (float)(value * (octave_re * re[j] - octave_im * im[j]));
            c->imaginary[i] = (float)(value * (octave_re * im[j] + octave_im * re[j]));
        }
    }
}

static void fill_bar(component *c, double flux)
{
    double centre = 3.0 / M_PI * flux * outline_area(c);
    for (int i = 0; i < TABLE; i++) {
        double t = i < TABLE - 2 ? (double)table_t(i) : 1.0;
        c->value[i] = (float)(centre * (1.0 - t) * (1.0 - t));
    }
    for (int k = 0; k < OCTAVES; k++)
        c->size[k] = 0.05f;
    c->split = c->depth > 0 ? HUGE_VAL : 0.0;
}

/* --- cells --- */

static double cell_mean(const component *c, double dx, double dy, double size, int depth)
{
    double t = c->a * dx * dx + 2.0 * c->b * dx * dy + c->c * dy * dy, sum = 0.0;
    int split = depth < c->depth || depth == 0;
    if (!split && depth < DEEPEST && t < 1.0) {
        float fraction;
        int octave = table_index((float)t, &fraction) >> MANTISSA_BITS;
        split = (double)c->size[octave] < size * size * c->widest;
    }
    double part = split ? 0.25 * size : GAUSS * size;
    for (int j = -1; j <= 1; j += 2)
        for (int i = -1; i <= 1; i += 2)
            sum += split ? cell_mean(c, dx + i * part, dy + j * part, 0.5 * size, depth + 1)
                         : (double)brightness(c, dx + i * part, dy + j * part);
    return 0.25 * sum;
}

/* Right end of the outline where low <= dy <= high: at its rightmost point, or as near to it as may be. */
static double outline_right(double a, double b, double c, double low, double high)
{
    double det = a * c - b * b, tall = sqrt(a / det), y = -b / c * sqrt(c / det);
    y = fmin(fmax(fmin(fmax(y, low), high), -tall), tall);
    double middle = -b * y / a;
    return middle + sqrt(fmax(middle * middle - (c * y * y - 1.0) / a, 0.0));
}

static int clamp_cell(double value, int most)
{
    return value < 0.0 ? 0 : value > most ? most : (int)value;
}

/* Cells whose centre is inside the outline; of narrow components all that it touches. */
static void draw_component(const component *c, const rx_fine_grid *grid)
{
    double det = c->a * c->c - c->b * c->b, tall = sqrt(c->a / det), touch = c->depth > 0 ? 0.5 : 0.0;
    int last = grid->height - 1, end = grid->width - 1;
    double low = ceil(c->y - tall - touch), high = floor(c->y + tall + touch);
    if (!(high >= 0.0 && low <= last))
        return;
    int bottom = clamp_cell(low, last), top = clamp_cell(high, last);
    for (int j = bottom; j <= top; j++) {
        double dy = j - c->y;
        double left = c->x - touch - outline_right(c->a, -c->b, c->c, dy - touch, dy + touch);
        double right = c->x + touch + outline_right(c->a, c->b, c->c, dy - touch, dy + touch);
        if (!(right >= 0.0 && left <= end))
            continue;
        int from = clamp_cell(ceil(left), end), to = clamp_cell(floor(right), end);
        float *row = grid->cells + (size_t)j * grid->stride;
        for (int i = from; i <= to; i++) {
            double dx = i - c->x, t = c->a * dx * dx + 2.0 * c->b * dx * dy + c->c * dy * dy;
            row[i] += t < c->split ? (float)cell_mean(c, dx, dy, 1.0, 0) : brightness(c, dx, dy);
        }
    }
}

rx_status rx_galaxy_draw(const rx_object *object, rx_fine_grid *grid, rx_error *err)
{
    const rx_object *o = object;
    double bar = o->bar_radius > 0.0 ? fmin(o->bar_share, 1.0 - o->bulge_share) : 0.0,
           disk = 1.0 - o->bulge_share - bar;
    rx_sersic profile;
    component *c; /* its tables are larger than what a stack should bear */
    RX_TRY(RX_MAKE(c, 1, err));
    c->x = (o->x - grid->x0) / grid->step;
    c->y = (o->y - grid->y0) / grid->step;
    c->arms = 0;
    if (o->bulge_share > 0.0) {
        rx_sersic_set(o->bulge_n, &profile);
        set_outline(c, fmax(o->bulge_radius / grid->step, LEAST_RADIUS) * profile.truncation, o->bulge_ratio,
                    o->angle, 0.0, 1.0);
        fill_sersic(c, &profile, o->flux * o->bulge_share);
        draw_component(c, grid);
    }
    if (bar > 0.0) {
        set_outline(c, fmax(o->bar_radius / grid->step, LEAST_RADIUS), o->ratio, o->angle,
                    o->arms > 0 ? o->arm_phase / o->arms : o->arm_phase, BAR_RATIO);
        fill_bar(c, o->flux * bar);
        draw_component(c, grid);
    }
    if (disk > 1e-9) {
        rx_sersic_set(1.0, &profile);
        set_outline(c, fmax(o->disk_radius / grid->step, LEAST_RADIUS) * profile.truncation, o->ratio,
                    o->angle, 0.0, 1.0);
        fill_sersic(c, &profile, o->flux * disk);
        if (o->arms > 0)
            fill_arms(c, o, profile.truncation);
        draw_component(c, grid);
    }
    free(c);
    return RX_OK;
}

/* --- templates: flipped, turned, stretched ---
 *
 * The template is a surface brightness by cubic B-splines around its pixels (not by interpolation: the spline
 * is smooth and nowhere negative, and its blur, 1/3 pixel^2 per axis, is given by rx_template_blur()). Splines
 * of a whole grid sum to 1 everywhere, so nothing is lost between pixels, however far they are stretched. A
 * cell larger than 0.9 template pixels is the mean of equal parts that are not: no pixel falls between the
 * cells. The sum over all cells is the flux to 1e-3, the rest being what the lattice of cells does not see of
 * the spline (tests/unit/simulate/test_draw.c). */
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

static float template_brightness(const rx_template *source, double p, double q)
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

static float template_mean(const mapping *map, const rx_template *source, double dx, double dy)
{
    double sum = 0.0, part = 1.0 / map->parts;
    for (int j = 0; j < map->parts; j++)
        for (int i = 0; i < map->parts; i++) {
            double x = dx + (i + 0.5) * part - 0.5, y = dy + (j + 0.5) * part - 0.5;
            double p = map->centre[0] + map->m[0][0] * x + map->m[0][1] * y;
            double q = map->centre[1] + map->m[1][0] * x + map->m[1][1] * y;
            if (p > -2.0 && q > -2.0 && p < source->width + 1.0 && q < source->height + 1.0)
                sum += (double)template_brightness(source, p, q);
        }
    return (float)(sum * part * part * map->flux);
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
            grid->cells[(size_t)j * grid->stride + (size_t)i] += template_mean(&map, source, i - x, j - y);
}

/* --- reach --- */

static double outline_reach(double radius, double ratio, double angle)
{
    double c = cos(angle), s = sin(angle), x = hypot(c, s * ratio), y = hypot(s, c * ratio);
    return radius * fmax(x, y);
}

double rx_object_reach(const rx_object *object, const rx_templates *templates)
{
    const rx_object *o = object;
    rx_sersic profile;
    double reach = 0.0;
    if (o->type == RX_OBJECT_TEMPLATE && templates != NULL) { /* however it is turned */
        const rx_template *source = &templates->list[o->template_index];
        return o->stretch * hypot(half_side(source->x, source->width), half_side(source->y, source->height));
    }
    if (o->type != RX_OBJECT_GALAXY)
        return 0.0;
    if (o->bulge_share > 0.0) {
        rx_sersic_set(o->bulge_n, &profile);
        reach = outline_reach(o->bulge_radius * profile.truncation, o->bulge_ratio, o->angle);
    }
    if (o->bulge_share < 1.0) {
        rx_sersic_set(1.0, &profile);
        reach = fmax(reach, outline_reach(o->disk_radius * profile.truncation, o->ratio, o->angle));
        if (o->bar_share > 0.0)
            reach = fmax(reach, o->bar_radius);
    }
    return reach;
}
