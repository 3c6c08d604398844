/* Measurement of all sources: per source a view, then one kernel after the other. */
#include "measure/measure.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "measure/aperture.h"
#include "measure/growth.h"
#include "measure/imaflags.h"
#include "measure/isophote.h"
#include "measure/localsky.h"
#include "measure/starclass.h"
#include "measure/view.h"
#include "measure/window.h"

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
        rx_status status = rx_local_sky(&view, s, par->local_thickness, &view.sky, err);
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
    return rx_measure_imaflags(&view, par->flag_types, s, err);
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
