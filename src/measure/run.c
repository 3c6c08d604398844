/* Measurement of all sources: per source a view, then one kernel after the other. */
#include "measure/measure.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>

#include <sep.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "data/unit.h"
#include "measure/starclass.h"
#include "measure/view.h"

static const float OUTSIDE = -1e30f; /* VIGNET pixels that are hidden or beyond the border */

/* The background below the centroid. */
static double level_at(const rx_image *image, const rx_source *s)
{
    int x = (int)(s->x + 0.5), y = (int)(s->y + 0.5);
    if (!rx_map_given(&image->level) || x < 0 || y < 0 || x >= image->width || y >= image->height)
        return 0.0;
    return (double)rx_map_at(&image->level, x, y);
}

static void measure_apertures(const rx_view *view, const rx_measure_params *par, rx_source *s)
{
    for (int i = 0; i < par->naper; i++) {
        rx_sum sum;
        rx_sum_circle(view, s->x, s->y, par->aperture_diameter[i] / 2.0, &sum);
        s->flux_aper[i] = sum.flux;
        s->fluxerr_aper[i] = sum.error;
        if (sum.truncated)
            s->flags |= RX_FLAG_APERTURE;
    }
}

static void measure_star(const rx_measure_params *par, const rx_image *image, rx_source *s)
{
    double scale = par->pixel_scale > 0.0 ? par->pixel_scale : 1.0;
    double threshold = s->analysis_threshold;
    if (par->analysis_threshold > 0.0) /* that of the image, not of the source */
        threshold = par->analysis_threshold * (par->analysis_absolute ? 1.0 : image->global_noise);
    if (par->star_net != NULL && par->seeing_fwhm > 0.0)
        s->class_star = rx_starclass_evaluate(par->star_net, s, par->seeing_fwhm * scale, scale, threshold);
}

static void cut_vignet(const rx_view *view, const rx_measure_params *par, const rx_source *s, float *dst)
{
    const rx_image *image = view->image;
    int x0 = (int)(s->x + 0.49999) - par->vignet_width / 2,
        y0 = (int)(s->y + 0.49999) - par->vignet_height / 2;
    for (int j = 0; j < par->vignet_height; j++)
        for (int i = 0; i < par->vignet_width; i++) {
            int x = x0 + i, y = y0 + j;
            bool seen = x >= 0 && y >= 0 && x < image->width && y < image->height &&
                        rx_view_state(view, x, y) == RX_SEEN_GOOD;
            dst[j * par->vignet_width + i] =
                seen ? rx_view_value(image, (size_t)y * (size_t)image->width + (size_t)x) : OUTSIDE;
        }
}

/* --- local sky --- */

static bool inside(const rx_box *box, int x, int y)
{
    return x >= box->x0 && x < box->x1 && y >= box->y0 && y < box->y1;
}

static int gap(int size, int full)
{
    return size < full / 2 ? size / 4 : (full - size) / 4;
}

/* BACKPHOTO_TYPE LOCAL, by sep's mesh estimator on the annulus' pixels as an image of one mesh: clipped mode of the good pixels in an annulus `thickness` wide, a quarter of the source's size away
 * from its footprint (SExtractor's geometry, the mesh estimator of the global background). 0 where the
 * annulus leaves the image or holds no pixel. */
static rx_status local_sky(const rx_view *view, const rx_source *s, int thickness, double *sky, rx_error *err)
{
    const rx_image *image = view->image;
    int gx = gap(s->xmax - s->xmin + 1, image->width), gy = gap(s->ymax - s->ymin + 1, image->height);
    rx_box inner = {s->xmin - gx, s->xmax + 1 + gx, s->ymin - gy, s->ymax + 1 + gy};
    rx_box outer = {inner.x0 - thickness, inner.x1 + thickness, inner.y0 - thickness, inner.y1 + thickness};
    *sky = 0.0;
    if (thickness < 1 || outer.x0 < 0 || outer.y0 < 0 || outer.x1 >= image->width ||
        outer.y1 >= image->height)
        return RX_OK;
    size_t room = (size_t)(outer.x1 - outer.x0) * (size_t)(outer.y1 - outer.y0);
    float *values;
    rx_status status = RX_OK;
    RX_TRY(RX_MAKE(values, room, err));
    int n = 0;
    for (int y = outer.y0; y < outer.y1; y++)
        for (int x = outer.x0; x < outer.x1; x++)
            if (!inside(&inner, x, y) && rx_view_state(view, x, y) == RX_SEEN_GOOD)
                values[n++] = rx_view_value(image, (size_t)y * (size_t)image->width + (size_t)x);
    if (n > 0) {
        const double unit = rx_unit_of(image->global_noise); /* sep takes nothing beyond 1e30 */
        rx_unit_divide(values, unit != 1.0 ? (size_t)n : 0, unit);
        sep_bkg *mesh = NULL;
        sep_image list = {.data = values, .dtype = SEP_TFLOAT, .w = n, .h = 1, .noise_type = SEP_NOISE_NONE};
        if (sep_background(&list, n, 1, 1, 1, 0.0, &mesh) == 0)
            *sky = sep_bkg_global(mesh) * unit;
        else
            status = rx_error_memory(err, (size_t)n * sizeof *values);
        sep_bkg_free(mesh);
    }
    free(values);
    return status;
}

/* --- IMAFLAGS_ISO: the user's flag maps under a source --- */

enum { FLAGS_OR, FLAGS_AND, FLAGS_MIN, FLAGS_MAX, FLAGS_MOST };

static int compare_values(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Longest run in sorted values. */
static uint32_t most_frequent(const uint32_t *values, int n, int *count)
{
    uint32_t best = 0;
    *count = 0;
    for (int i = 0, run = 0; i < n; i++) {
        run = i > 0 && values[i] == values[i - 1] ? run + 1 : 1;
        if (run > *count) {
            *count = run;
            best = values[i];
        }
    }
    return best;
}

static int count_equal(const uint32_t *values, int n, uint32_t value)
{
    int count = 0;
    for (int i = 0; i < n; i++)
        count += values[i] == value;
    return count;
}

/* One value for all; `zeros` pixels had no flag. values is sorted, without zeros. */
static uint32_t combine(const uint32_t *values, int n, int zeros, int type, int *count)
{
    uint32_t result = type == FLAGS_AND ? UINT32_MAX : 0;
    *count = n;
    if (n == 0 || (type == FLAGS_AND && zeros > 0))
        return 0;
    switch (type) {
    case FLAGS_OR:
        for (int i = 0; i < n; i++)
            result |= values[i];
        return result;
    case FLAGS_AND:
        for (int i = 0; i < n; i++)
            result &= values[i];
        return result;
    case FLAGS_MOST:
        return most_frequent(values, n, count);
    default:
        result = type == FLAGS_MIN ? values[0] : values[n - 1];
        *count = count_equal(values, n, result);
        return result;
    }
}

/* types: as rx_measure_params.flag_types. Fills imaflags and nimaflags. Only non-zero values count, except for AND;
 * nimaflags is the number of pixels that had a say (OR, AND) or that hold the value given (MIN, MAX, MOST; the
 * smallest of equally frequent ones). SExtractor's AND is always 0 (it starts from 0); this one is what its name
 * says. */
static rx_status measure_imaflags(const rx_view *view, const int *types, rx_source *s, rx_error *err)
{
    const rx_image *image = view->image;
    if (image->nflagmaps == 0)
        return RX_OK;
    size_t area = (size_t)(s->xmax - s->xmin + 1) * (size_t)(s->ymax - s->ymin + 1);
    uint32_t *values;
    RX_TRY(RX_MAKE(values, area, err));
    for (int map = 0; map < image->nflagmaps && map < RX_MAX_FLAGMAPS; map++) {
        int n = 0, zeros = 0;
        for (int y = s->ymin; y <= s->ymax; y++)
            for (int x = s->xmin; x <= s->xmax; x++) {
                size_t k = (size_t)y * (size_t)image->width + (size_t)x;
                if (view->sources->segments[k] != view->segment)
                    continue;
                if (image->flagmaps[map][k] != 0)
                    values[n++] = image->flagmaps[map][k];
                else
                    zeros++;
            }
        qsort(values, (size_t)n, sizeof *values, compare_values);
        s->imaflags[map] = combine(values, n, zeros, types != NULL ? types[map] : 0, &s->nimaflags[map]);
    }
    free(values);
    return RX_OK;
}

/* --- all of it --- */

static rx_status measure_source(const rx_measure_params *par, const rx_image *image, const rx_image *radii,
                                rx_sources *sources, int i, rx_error *err)
{
    rx_source *s = &sources->list[i];
    rx_view view = {.image = image,
                    .radii = radii != NULL ? radii : image,
                    .sources = sources,
                    .neighbours = par->neighbours,
                    .weight_gain = par->weight_gain,
                    .segment = s->segment};
    if (par->local_background) {
        rx_status status = local_sky(&view, s, par->local_thickness, &view.sky, err);
        if (status != RX_OK)
            return status;
    }
    s->background = level_at(image, s) + view.sky;
    rx_measure_isophote(&view, par, s);
    if ((par->skip & RX_SKIP_APER) == 0)
        measure_apertures(&view, par, s);
    if ((par->skip & RX_SKIP_AUTO) == 0)
        rx_measure_auto(&view, par, s);
    if ((par->skip & RX_SKIP_PETRO) == 0)
        rx_measure_petro(&view, par, s);
    /* windows start from the half-light radius, which needs AUTO */
    if ((par->skip & RX_SKIP_RADIUS) == 0 || (par->skip & RX_SKIP_WIN) == 0) {
        double half_light = rx_measure_radii(&view, par, s);
        if ((par->skip & RX_SKIP_WIN) == 0)
            rx_measure_window(&view, half_light, s);
    }
    measure_star(par, image, s);
    if (sources->vignets != NULL)
        cut_vignet(&view, par, s,
                   sources->vignets + (size_t)i * (size_t)par->vignet_width * (size_t)par->vignet_height);
    return measure_imaflags(&view, par->flag_types, s, err);
}

/* What all rows share: list lengths, vignets, noise law. */
static rx_status prepare(const rx_measure_params *par, const rx_image *image, rx_sources *sources,
                         rx_error *err)
{
    if (par->naper < 0 || par->naper > RX_MAX_APERTURES || par->nradii < 0 || par->nradii > RX_MAX_RADII)
        return rx_error_set(err, RX_USAGE, "at most %d PHOT_APERTURES and %d PHOT_FLUXFRAC", RX_MAX_APERTURES,
                            RX_MAX_RADII);
    sources->naper = par->naper;
    for (int i = 0; i < par->naper; i++)
        sources->aperture_diameter[i] = par->aperture_diameter[i];
    sources->nradii = par->nradii;
    for (int i = 0; i < par->nradii; i++)
        sources->flux_fraction[i] = par->flux_fraction[i];
    sources->nflagmaps = image->nflagmaps;
    sources->law_scale = image->law != NULL ? image->law->scale : 1.0;
    sources->law_power = image->law != NULL ? image->law->power : 0.5;
    free(sources->vignets);
    sources->vignets = NULL;
    sources->vignet_width = par->vignet_width;
    sources->vignet_height = par->vignet_height;
    if (par->vignet_width <= 0 || par->vignet_height <= 0)
        return RX_OK;
    size_t size = (size_t)par->vignet_width * (size_t)par->vignet_height;
    sources->vignets = sources->n > 0 && size > SIZE_MAX / (size_t)sources->n
                           ? NULL
                           : RX_NEW(float, size *(size_t)sources->n);
    return sources->vignets == NULL ? rx_error_memory(err, size * sizeof(float)) : RX_OK;
}

rx_status rx_measure_run(const rx_measure_params *par, const rx_image *image, const rx_image *radii,
                         rx_log *log, rx_sources *sources, rx_error *err)
{
    rx_status status = RX_OK;
    RX_TRY(prepare(par, image, sources, err));
    rx_log_progress_begin(log);
    enum { BATCH = 256 };
    for (int first = 0; first < sources->n && status == RX_OK; first += BATCH) {
        int last = first + BATCH < sources->n ? first + BATCH : sources->n;
#pragma omp parallel for schedule(dynamic, 4) num_threads(par->nthreads > 0 ? par->nthreads : 1)
        for (int i = first; i < last; i++) {
            rx_error trouble = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
            rx_status one = measure_source(par, image, radii, sources, i, &trouble);
            if (one != RX_OK) {
#pragma omp critical(rx_measure_status)
                {
                    status = one;
                    rx_error_take(err, &trouble);
                }
            }
        }
        rx_log_progress(log, "measuring", (double)last / sources->n);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
    }
    rx_log_progress_end(log);
    return status;
}
