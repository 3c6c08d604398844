/* The column table made from columns.def, and the arithmetic its values use. */
#include "catalog/columns.h"

#include <math.h>
#include <stddef.h>
#include <string.h>
#include <strings.h>

#include "base/constants.h"

#define DEGREES (1 / RX_DEGREE) /* per radian */

/* Second moments of a light distribution or of an error, in one frame. */
typedef struct moments {
    double xx, yy, xy;
} moments;

static moments object(const rx_source *s)
{
    return (moments){s->x2, s->y2, s->xy};
}

static moments object_error(const rx_source *s)
{
    return (moments){s->errx2, s->erry2, s->errxy};
}

static moments window(const rx_source *s)
{
    return (moments){s->x2win, s->y2win, s->xywin};
}

static moments window_error(const rx_source *s)
{
    return (moments){s->errx2win, s->erry2win, s->errxywin};
}

/* M C M^T with the local matrix M of d(east, north)/d(x, y): deg^2. */
static moments world(const rx_source *s, moments m)
{
    const double *w = s->world_matrix;
    return (moments){w[0] * w[0] * m.xx + w[1] * w[1] * m.yy + 2 * w[0] * w[1] * m.xy,
                     w[2] * w[2] * m.xx + w[3] * w[3] * m.yy + 2 * w[2] * w[3] * m.xy,
                     w[0] * w[2] * m.xx + w[1] * w[3] * m.yy + (w[0] * w[3] + w[1] * w[2]) * m.xy};
}

/* Half difference of the eigenvalues of the moments. */
static double spread(moments m)
{
    return hypot(0.5 * (m.xx - m.yy), m.xy);
}

static double major(moments m)
{
    return sqrt(0.5 * (m.xx + m.yy) + spread(m));
}

/* Rounding may leave a needle's minor axis just below 0; NAN stays NAN. */
static double minor(moments m)
{
    double square = 0.5 * (m.xx + m.yy) - spread(m);
    return square < 0 ? 0 : sqrt(square);
}

static double polarisation(moments m)
{
    return spread(m) / (0.5 * (m.xx + m.yy));
}

/* Position angle of the major axis in degrees, first axis towards the second, (-90, 90]. */
static double angle(moments m)
{
    return 0.5 * atan2(2 * m.xy, m.xx - m.yy) * DEGREES;
}

/* The ellipse cxx x^2 + cyy y^2 + cxy x y = 1 of the moments: their inverse. */
static double conic_xx(moments m)
{
    return m.yy / (m.xx * m.yy - m.xy * m.xy);
}

static double conic_yy(moments m)
{
    return m.xx / (m.xx * m.yy - m.xy * m.xy);
}

static double conic_xy(moments m)
{
    return -2 * m.xy / (m.xx * m.yy - m.xy * m.xy);
}

/* Degrees from north towards east, north turned by `turn` radians, [-90, 90]. */
static double north_angle(const rx_source *s, moments m, double turn)
{
    double theta = angle(world(s, m));
    double north = (theta > 0 ? 90 : -90) - theta + turn * DEGREES;
    return north - 180 * floor((north + 90) / 180);
}

/* Square degrees of a pixel. */
static double pixel_area(const rx_source *s)
{
    return fabs(s->world_matrix[0] * s->world_matrix[3] - s->world_matrix[1] * s->world_matrix[2]);
}

static double magnitude(const rx_cell_place *c, double flux)
{
    return flux > 0 ? c->image->zeropoint - 2.5 * log10(flux) : 99;
}

/* 1.086 for 2.5 / ln 10, as SExtractor has it. */
static double magnitude_error(double flux, double error)
{
    return flux > 0 ? 1.086 * error / flux : 99;
}

/* Of a flux that is not below 0, whatever noise has made of it: U with P(F > U, given F >= 0) = 0.05 of a Gaussian of that mean
 * and width. It is flux + 1.645 errors at least, so that the true flux, whatever it is, is below it in 95 % of all cases or more. */
static double upper_limit(double flux, double error)
{
    static const double BEYOND = 0.05, LOWEST = -30; /* errors below 0: erfc() is not 0 yet */
    const double mean = fmax(flux / error, LOWEST), share = 0.5 * BEYOND * erfc(-M_SQRT1_2 * mean);
    double above = sqrt(-2 * log(share)); /* Newton's method on the logarithm of the tail, which is concave */
    for (int i = 0; i < 6; i++) {
        const double tail = 0.5 * erfc(M_SQRT1_2 * above);
        above += log(tail / share) * tail * sqrt(2 * M_PI) * exp(0.5 * above * above);
    }
    return isfinite(flux) && error > 0 ? error * (mean + above) : NAN;
}

/* Magnitude per square arcsecond of a pixel value. */
static double surface_brightness(const rx_cell_place *c, double value)
{
    double scale = c->image->pixel_scale;
    return scale > 0 ? magnitude(c, value / (scale * scale)) : NAN;
}

static double best_flux(const rx_source *s)
{
    return (s->flags & RX_FLAG_CROWDED) ? s->flux_isocor : s->flux_auto;
}

static double best_error(const rx_source *s)
{
    return (s->flags & RX_FLAG_CROWDED) ? s->fluxerr_isocor : s->fluxerr_auto;
}

/* Element i of those that were measured. */
static double at(const double *values, int n, long i)
{
    return i < n ? values[i] : NAN;
}

/* All 32 bits kept: what is above 2^31 comes back as a negative cell. */
static double flag_at(const rx_source *s, const rx_cell_place *c, long i)
{
    return i < c->sources->nflagmaps ? (double)(int32_t)s->imaflags[i] : 0;
}

static double flag_count_at(const rx_source *s, const rx_cell_place *c, long i)
{
    return i < c->sources->nflagmaps ? s->nimaflags[i] : 0;
}

static double assoc_at(const rx_source *s, const rx_cell_place *c, long i)
{
    return s->vector_assoc != NULL && i < c->sources->nassoc ? s->vector_assoc[i] : 0;
}

/* The stored vignet, its centre on the centre of the one that was asked. */
static double vignet(const rx_cell_place *c, long i)
{
    const rx_sources *all = c->sources;
    long x = i % c->dim[0] - c->dim[0] / 2 + all->vignet_width / 2;
    long y = i / c->dim[0] - c->dim[1] / 2 + all->vignet_height / 2;
    if (all->vignets == NULL || x < 0 || y < 0 || x >= all->vignet_width || y >= all->vignet_height)
        return -1e30;
    return all->vignets[(c->row * all->vignet_height + y) * all->vignet_width + x];
}

#define COLUMN(name, type, unit, ucd, format, naxis, expression, description)                                \
    static double value_##name(const rx_source *s, const rx_cell_place *c, long i)                           \
    {                                                                                                        \
        (void)s, (void)c, (void)i;                                                                           \
        return expression;                                                                                   \
    }
#include "catalog/columns.def"
#undef COLUMN

#define COLUMN(name, type, unit, ucd, format, naxis, expression, description)                                \
    {#name, RX_CELL_##type, unit, ucd, format, naxis, description, value_##name},
static const rx_column_def columns[] = {
#include "catalog/columns.def"
};
#undef COLUMN

const rx_column_def *rx_column_defs(int *n)
{
    *n = (int)(sizeof columns / sizeof *columns);
    return columns;
}

int rx_column_index(const char *name)
{
    for (size_t i = 0; i < sizeof columns / sizeof *columns; i++)
        if (strcasecmp(columns[i].name, name) == 0)
            return (int)i;
    return -1;
}
