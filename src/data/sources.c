/* The source list: choosing among its sources, freeing. */
#include "data/sources.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

int rx_spurious_are_many(long marked, long all)
{
    return (double)marked - 2.0 * sqrt((double)marked) > 0.2 * (double)all;
}

int rx_source_is_spurious(const rx_source *source)
{
    return (source->fit.restore & (RX_RESTORE_SPURIOUS | RX_RESTORE_SHRED)) != 0;
}

void rx_source_doubt(rx_source *source, double artefact)
{
    source->fit.artefact = fmax(source->fit.artefact, artefact);
    source->fit.restore |= source->fit.artefact > 0.5 ? RX_RESTORE_SHARP : 0;
}

void rx_source_without_fits(rx_source_point *point, rx_source_sersic *sersic)
{
    *point = (rx_source_point){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
    *sersic = (rx_source_sersic){NAN, NAN, {NAN, NAN}, {NAN, NAN}, {NAN, NAN}, {NAN, NAN}};
}

/* Row `from` of the planes and tables that go with the list to row `to`. */
static void move_row(rx_sources *sources, int from, int to)
{
    const size_t vignet = (size_t)sources->vignet_width * (size_t)sources->vignet_height;
    const size_t nassoc = (size_t)sources->nassoc;
    sources->list[to] = sources->list[from];
    if (sources->assoc != NULL)
        memcpy(sources->assoc + (size_t)to * nassoc, sources->assoc + (size_t)from * nassoc,
               nassoc * sizeof(double));
    if (sources->vignets != NULL)
        memcpy(sources->vignets + (size_t)to * vignet, sources->vignets + (size_t)from * vignet,
               vignet * sizeof(float));
}

rx_status rx_sources_select(rx_sources *sources, const unsigned char *keep, rx_error *err)
{
    int32_t highest = 0;
    int kept = 0;
    for (int i = 0; i < sources->n; i++)
        highest = sources->list[i].segment > highest ? sources->list[i].segment : highest;
    int32_t *renumber;
    RX_TRY(RX_MAKE(renumber, (size_t)highest + 1, err));
    for (int i = 0; i < sources->n; i++) {
        if (!keep[i])
            continue;
        if (sources->list[i].segment > 0)
            renumber[sources->list[i].segment] = kept + 1;
        if (kept < i)
            move_row(sources, i, kept);
        rx_source *s = &sources->list[kept];
        s->number = s->segment = ++kept;
        if (sources->assoc != NULL)
            s->vector_assoc = sources->assoc + (size_t)(kept - 1) * (size_t)sources->nassoc;
    }
    sources->n = kept;
    const size_t npixels = sources->segments != NULL ? (size_t)sources->width * (size_t)sources->height : 0;
    for (size_t i = 0; i < npixels; i++) {
        const int32_t segment = sources->segments[i];
        if (segment > 0)
            sources->segments[i] = segment <= highest ? renumber[segment] : 0;
    }
    free(renumber);
    return RX_OK;
}

void rx_sources_free(rx_sources *sources)
{
    if (sources == NULL)
        return;
    free(sources->list);
    free(sources->segments);
    free(sources->fragments);
    free(sources->assoc);
    free(sources->vignets);
    free(sources);
}
