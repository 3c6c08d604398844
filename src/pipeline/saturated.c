/* Saturated stars beside a restored image. */
#include "pipeline/saturated.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/map.h"

/* What becomes of a source that was found on the restored image. */
enum { GONE, UNKNOWN, KNOWN };

/* How many pixels a source has, those of what CLEAN merged into it too; 0 unless one is saturated. */
static size_t count_pixels(const rx_image *detect, const rx_image *measure, const rx_sources *sources,
                           const rx_source *s)
{
    size_t n = 0;
    int saturated = 0;
    for (int y = s->ymin; y <= s->ymax; y++)
        for (int x = s->xmin; x <= s->xmax; x++) {
            const size_t k = (size_t)y * (size_t)sources->width + (size_t)x;
            if (sources->segments[k] != s->segment)
                continue;
            n++;
            saturated |= (detect->mask[k] | measure->mask[k]) & RX_MASK_CUT;
        }
    return saturated ? n : 0;
}

/* The pixels of the source, whose number in our list it is, or -1; room for them is there. */
static void add_pixels(const rx_sources *sources, const rx_source *s, int32_t number, rx_saturated *dst)
{
    for (int y = s->ymin; y <= s->ymax; y++)
        for (int x = s->xmin; x <= s->xmax; x++) {
            const size_t k = (size_t)y * (size_t)sources->width + (size_t)x;
            if (sources->segments[k] == s->segment)
                dst->pixels[dst->npixels++] = (rx_saturated_pixel){k, number, sources->fragments[k]};
        }
}

rx_status rx_saturated_choose(const rx_image *detect, const rx_image *measure, rx_sources *sources,
                              rx_saturated *dst, rx_error *err)
{
    int kept = 0;
    size_t n = 0;
    RX_TRY(RX_MAKE(dst->peaks, (size_t)sources->n, err));
    for (int i = 0; i < sources->n; i++) {
        const rx_source *s = &sources->list[i];
        const size_t own = count_pixels(detect, measure, sources, s);
        n += own;
        if (own > 0)
            sources->list[kept++] = *s;
        else
            dst->peaks[dst->npeaks++] = (rx_saturated_peak){s->xpeak, s->ypeak};
    }
    sources->n = kept;
    RX_TRY(RX_MAKE(dst->pixels, n, err));
    for (int i = 0; i < kept; i++)
        add_pixels(sources, &sources->list[i], i, dst);
    return RX_OK;
}

rx_status rx_saturated_keep(const rx_sources *sources, rx_saturated *dst, rx_error *err)
{
    RX_TRY(RX_MAKE(dst->list, (size_t)sources->n, err));
    dst->n = sources->n;
    for (int i = 0; i < dst->n; i++) {
        dst->list[i] = sources->list[i];
        dst->list[i].untouched = i + 1;
        dst->list[i].flags_measure |= RX_FLAGM_UNTOUCHED;
    }
    return RX_OK;
}

void rx_saturated_hide(const rx_saturated *saturated, rx_restored *restored)
{
    for (size_t i = 0; i < saturated->npixels; i++) {
        const size_t k = saturated->pixels[i].at;
        restored->pixels[k] = 0.0f;
        restored->mask[k] |= RX_MASK_UNTOUCHED;
    }
}

/* Which sources of the list hold a peak that the untouched image has, nearly. */
static void mark_known(const rx_saturated *saturated, const rx_sources *sources, unsigned char *keep)
{
    for (int i = 0; i < saturated->npeaks; i++)
        for (int y = saturated->peaks[i].y - 1; y <= saturated->peaks[i].y + 1; y++)
            for (int x = saturated->peaks[i].x - 1; x <= saturated->peaks[i].x + 1; x++) {
                const int inside = x >= 0 && x < sources->width && y >= 0 && y < sources->height;
                const int32_t segment =
                    inside ? sources->segments[(size_t)y * (size_t)sources->width + (size_t)x] : 0;
                if (segment > 0)
                    keep[segment - 1] = KNOWN;
            }
}

/* The sources that pixel i touches, unless they are known, and so on: pixels grows. */
static rx_status absorb_at(rx_saturated *saturated, size_t i, const rx_sources *sources, unsigned char *keep,
                           rx_error *err)
{
    const size_t width = (size_t)sources->width;
    const int cx = (int)(saturated->pixels[i].at % width), cy = (int)(saturated->pixels[i].at / width);
    for (int y = cy - 1; y <= cy + 1; y++)
        for (int x = cx - 1; x <= cx + 1; x++) {
            const int inside = x >= 0 && x < sources->width && y >= 0 && y < sources->height;
            const int32_t segment = inside ? sources->segments[(size_t)y * width + (size_t)x] : 0;
            if (segment == 0 || keep[segment - 1] != UNKNOWN)
                continue;
            const rx_source *s = &sources->list[segment - 1];
            const size_t area = (size_t)(s->xmax - s->xmin + 1) * (size_t)(s->ymax - s->ymin + 1);
            RX_TRY(RX_GROW(saturated->pixels, saturated->npixels + area, err));
            add_pixels(sources, s, -1, saturated);
            keep[segment - 1] = GONE;
        }
    return RX_OK;
}

rx_status rx_saturated_absorb(rx_saturated *saturated, rx_sources *sources, rx_error *err)
{
    const size_t own = saturated->npixels;
    rx_status status = RX_OK;
    if (own == 0)
        return RX_OK;
    unsigned char *keep;
    RX_TRY(RX_MAKE(keep, (size_t)sources->n, err));
    memset(keep, UNKNOWN, (size_t)sources->n);
    mark_known(saturated, sources, keep);
    for (size_t i = 0; i < saturated->npixels && status == RX_OK; i++)
        status = absorb_at(saturated, i, sources, keep, err);
    if (status == RX_OK && saturated->npixels > own)
        status = rx_sources_select(sources, keep, err);
    for (size_t i = own; i < saturated->npixels; i++)
        sources->fragments[saturated->pixels[i].at] = 0;
    free(keep);
    return status;
}

void rx_saturated_show(const rx_saturated *saturated, const rx_image *input, const rx_background *sky,
                       int masked, rx_restored *restored)
{
    const rx_map level = rx_background_level(sky);
    for (size_t i = 0; i < saturated->npixels; i++) {
        const size_t k = saturated->pixels[i].at, width = (size_t)input->width;
        restored->mask[k] &= (uint8_t) ~(RX_MASK_SATURATED | RX_MASK_UNTOUCHED);
        /* a gap may be open */
        restored->mask[k] |= input->mask[k] & (RX_MASK_BAD | RX_MASK_WEIGHT | RX_MASK_DEEP | masked);
        restored->pixels[k] = 0.0f;
        if (restored->mask[k] == 0)
            restored->pixels[k] = input->pixels[k] - rx_map_at(&level, (int)(k % width), (int)(k / width));
        if (restored->support != NULL)
            restored->support[k] = restored->mask[k] != 0;
        if (restored->reblurred != NULL && (input->mask[k] & RX_MASK_SATURATED) != 0)
            restored->reblurred[k] = NAN;
    }
}

rx_status rx_saturated_append(const rx_saturated *saturated, rx_sources *sources, rx_error *err)
{
    const int before = sources->n;
    const size_t all = (size_t)before + (size_t)saturated->n;
    if (saturated->n == 0)
        return RX_OK;
    RX_TRY(RX_GROW(sources->list, all, err));
    rx_source *list = sources->list;
    sources->n = (int)all;
    for (int i = 0; i < saturated->n; i++) {
        list[before + i] = saturated->list[i];
        list[before + i].number = list[before + i].segment = before + i + 1;
    }
    for (size_t i = 0; i < saturated->npixels; i++) {
        const rx_saturated_pixel *pixel = &saturated->pixels[i];
        if (pixel->source < 0)
            continue;
        sources->segments[pixel->at] = before + pixel->source + 1;
        sources->fragments[pixel->at] = pixel->fragment;
    }
    return RX_OK;
}

void rx_saturated_restate(const rx_saturated *saturated, rx_sources *sources)
{
    for (int i = 0; i < sources->n && saturated->n > 0; i++) {
        rx_source *s = &sources->list[i];
        if (s->untouched == 0)
            continue;
        const rx_source now = *s;
        *s = saturated->list[now.untouched - 1];
        s->number = now.number;
        s->segment = now.segment;
        s->fit = now.fit;
    }
}

void rx_saturated_free(rx_saturated *saturated)
{
    free(saturated->list);
    free(saturated->pixels);
    free(saturated->peaks);
    *saturated = (rx_saturated){0};
}
