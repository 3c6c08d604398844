/* Template photometry of one restorer's sources. */
#include "pipeline/template_fit.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/unit.h"
#include "fit/hits.h"
#include "fit/lines.h"
#include "fit/preal.h"
#include "pipeline/positions.h"
#include "pipeline/template_extra.h"

/* In a crowd sources down to that S/N are added: each that is left out is light that its neighbours take, and among so many
 * sources the few false ones are rare; below, peaks of noise would be added by the hundred. */
static const double ADDED_SNR = 5; /* on the residual, of a source to be added where it is not crowded */
static const double CROWD_SNR = 3.2;

/* Of the models' light in a crowd that counts as noise. Where neighbours are taken off the stars that a PSF is made of, what is
 * hidden in their wings would widen it. */
static const double CROWD_ERROR = 0.01, NEIGHBOUR_ERROR = 0.003;

/* Residuals above that many times a noise that is only a floor say that there is none to test sources against. */
static const double UNTESTABLE = 5.0;

/* What one call works on. */
typedef struct work {
    const rx_pipeline_params *params;
    rx_fields on;
    const rx_restored *restored;
    rx_log *log;
    rx_template_extra extra;
    rx_template_fit *dst;
} work;

/* The PSF that the restorer has found or was given is the one of its image. */
static const rx_psf *psf_of(const work *w, const rx_field *field)
{
    return field == w->on.detect && w->restored->blur != NULL ? w->restored->blur : field->psf;
}

/* What is fitted, and the restored image, each in the unit that is its own: weights are 1 / noise^2 in single precision. */
typedef struct fitted {
    rx_tphot_input input;
    rx_image_scaled own;
    rx_restored restored;
    rx_scaled_map noise; /* of the restored image */
    float *pixels;       /* of the restored image, owned; NULL: those of the tile */
} fitted;

static rx_status open_fitted(const work *w, const rx_field *field, const rx_sources *sources, fitted *dst,
                             rx_error *err)
{
    const rx_image image = rx_field_restorable(field);
    const double unit = rx_unit_of(rx_field_restorable(w->on.detect).global_noise);
    const size_t n = (size_t)image.width * (size_t)image.height;
    *dst = (fitted){.restored = *w->restored};
    if (!rx_image_in_unit(&image, &dst->own))
        return rx_error_memory(err, n * sizeof(float));
    dst->input = (rx_tphot_input){.restored = &dst->restored,
                                  .shape_mask = w->on.detect->image.mask,
                                  .shape_bits = RX_MASK_CUT,
                                  .sources = sources,
                                  .image = dst->own.image};
    dst->input.image.psf = psf_of(w, field);
    if (unit == 1.0)
        return RX_OK;
    dst->restored.pixels = dst->pixels = rx_unit_copy(w->restored->pixels, n, unit);
    dst->restored.noise = rx_map_scaled(&dst->noise, w->restored->noise, (float)(1.0 / unit));
    return dst->pixels != NULL ? RX_OK : rx_error_memory(err, n * sizeof(float));
}

static void close_fitted(fitted *f)
{
    rx_image_scaled_clear(&f->own);
    free(f->pixels);
}

static rx_status run(const rx_tphot_params *par, const fitted *f, rx_tphot **dst, rx_error *err)
{
    const rx_status status = rx_tphot_run(par, &f->input, dst, err);
    if (status == RX_OK && f->own.unit != 1.0)
        rx_tphot_multiply(*dst, f->own.unit);
    return status;
}

/* Positions of the sources that only the residual of the detection image showed. */
static rx_status extra_positions(const rx_tphot *tphot, double (**dst)[2], rx_error *err)
{
    const int n = tphot->n - tphot->nlisted;
    double(*at)[2] = rx_alloc((size_t)n, sizeof *at);
    if (at == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *at);
    for (int i = 0; i < n; i++) {
        at[i][0] = tphot->list[tphot->nlisted + i].x;
        at[i][1] = tphot->list[tphot->nlisted + i].y;
    }
    *dst = at;
    return RX_OK;
}

/* Shapes on the detection image, fluxes there or, with these shapes, on the measurement image. */
static rx_status fit(work *w, const rx_sources *sources, rx_error *err)
{
    const int forced = w->on.measure != w->on.detect;
    rx_tphot_params par = w->params->templates.par;
    par.least = w->extra.crowd_threshold;
    fitted detect = {0}, measure = {0};
    rx_tphot *shapes = NULL;
    double(*at)[2] = NULL;
    rx_status status;
    RX_TRY_EXIT(open_fitted(w, w->on.detect, sources, &detect, err));
    w->extra.pixels = detect.input.image.pixels;
    w->extra.level = detect.input.image.level;
    w->extra.unit = detect.own.unit;
    detect.input.more = rx_template_extra_find;
    detect.input.user = &w->extra;
    par.keep_model = par.keep_model && !forced;
    par.covariance = par.covariance && !forced;
    par.point_fits = par.point_fits && !forced;
    RX_TRY_EXIT(run(&par, &detect, forced ? &shapes : &w->dst->tphot, err));
    if (!forced)
        goto exit;
    RX_TRY_EXIT(extra_positions(shapes, &at, err));
    RX_TRY_EXIT(open_fitted(w, w->on.measure, sources, &measure, err));
    measure.input.shapes = shapes;
    measure.input.extra = (const double(*)[2])at;
    measure.input.nextra = shapes->n - shapes->nlisted;
    RX_TRY_EXIT(run(&w->params->templates.par, &measure, &w->dst->tphot, err));
    for (int i = shapes->nlisted; i < shapes->n; i++) {
        w->dst->tphot->list[i].added = shapes->list[i].added;
        w->dst->tphot->list[i].star = shapes->list[i].star;
        w->dst->tphot->list[i].two = shapes->list[i].two;
    }
exit:
    close_fitted(&detect);
    close_fitted(&measure);
    free(at);
    rx_tphot_free(shapes);
    return status;
}

/* What a catalogue has of a fit; entry: of rx_tphot.list. */
static rx_source_template fit_of(const rx_tphot *tphot, int entry)
{
    const rx_tphot_source *t = &tphot->list[entry];
    return (rx_source_template){.flux = t->flux,
                                .fluxerr = t->fluxerr,
                                .snr = t->snr,
                                .chi2 = t->chi2,
                                .evidence = t->evidence,
                                .preal = NAN,
                                .injected = {NAN, NAN},
                                .blend = t->blend,
                                .x = t->x,
                                .y = t->y,
                                .alpha = NAN,
                                .delta = NAN,
                                .star = t->star,
                                .two = t->two,
                                .radius = t->radius,
                                .ratio = t->ratio,
                                .theta = t->angle,
                                .group = t->group + 1,
                                .entry = entry,
                                .flags = t->flags,
                                .restore = entry >= tphot->nlisted ? RX_RESTORE_ADDED : 0};
}

/* The same where nothing was fitted. */
static const rx_source_template NO_FIT = {.flux = NAN,
                                          .fluxerr = NAN,
                                          .snr = NAN,
                                          .chi2 = NAN,
                                          .evidence = NAN,
                                          .preal = NAN,
                                          .injected = {NAN, NAN},
                                          .blend = NAN,
                                          .x = NAN,
                                          .y = NAN,
                                          .alpha = NAN,
                                          .delta = NAN,
                                          .star = NAN,
                                          .two = NAN,
                                          .radius = NAN,
                                          .ratio = NAN,
                                          .theta = NAN,
                                          .restore = RX_RESTORE_UNTESTED};

/* What was fitted, but for the sources that listed positions stand for; behind it these positions, as points that stay. */
static rx_status with_positions(const work *w, const rx_sources *found, const rx_position_match *match,
                                rx_sources *sources, rx_tphot *shapes, rx_error *err)
{
    const rx_tphot *tphot = w->dst->tphot;
    const size_t most = (size_t)tphot->n + (size_t)match->n;
    *sources = *found;
    *shapes = *tphot;
    sources->n = 0;
    sources->list = NULL;
    shapes->list = NULL;
    RX_TRY(RX_MAKE(sources->list, most, err));
    RX_TRY(RX_MAKE(shapes->list, most, err));
    for (int i = 0; i < tphot->n; i++) {
        if (!match->keep[i])
            continue;
        sources->list[sources->n] = found->list[i];
        shapes->list[sources->n] = tphot->list[i];
        shapes->list[sources->n++].movable = w->on.measure == w->on.detect;
    }
    for (int i = 0; i < match->n; i++) {
        const double *at = w->params->templates.positions->at[match->row[i]];
        const int nearest = match->nearest[i];
        sources->list[sources->n] = (rx_source){
            .x = at[0], .y = at[1], .xmax = -1, .segment = nearest >= 0 ? found->list[nearest].segment : 0};
        shapes->list[sources->n++] = (rx_tphot_source){.kind = RX_TPHOT_POINT,
                                                       .x = at[0],
                                                       .y = at[1],
                                                       .star = 1,
                                                       .two = NAN,
                                                       .point = 1,
                                                       .ratio = 1,
                                                       .index = 0.5,
                                                       .shape_error = 1,
                                                       .lift = 1};
    }
    shapes->n = shapes->nlisted = sources->n;
    return RX_OK;
}

static rx_status make_rows(work *w, rx_error *err)
{
    const rx_positions *positions = w->params->templates.positions;
    if (positions == NULL)
        return RX_OK;
    RX_TRY(RX_MAKE(w->dst->forced, 1, err));
    rx_sources *rows = w->dst->forced;
    RX_TRY(RX_MAKE(rows->list, (size_t)positions->n + 1, err));
    for (rows->n = 0; rows->n < positions->n; rows->n++) {
        const double *at = positions->at[rows->n];
        rows->list[rows->n] = (rx_source){.number = rows->n + 1, .x = at[0], .y = at[1], .fit = NO_FIT};
        rx_source_without_fits(&rows->list[rows->n].point_fit, &rows->list[rows->n].sersic_fit);
        rows->list[rows->n].fit.flags = RX_TPHOT_NO_DATA;
    }
    return RX_OK;
}

/* The same pixels once more, with a point at each listed position. */
static rx_status fit_positions(work *w, const rx_sources *found, rx_error *err)
{
    rx_sources *rows = w->dst->forced, sources = {0};
    rx_tphot_params par = w->params->templates.par;
    rx_tphot shapes = {0}, *tphot = NULL;
    rx_position_match match = {0};
    fitted measure = {0};
    rx_status status = RX_OK;
    if (rows == NULL || rows->n == 0)
        return RX_OK;
    par.keep_model = par.covariance = par.substructure = 0;
    RX_TRY_EXIT(rx_positions_match(w->params->templates.positions, w->dst->tphot,
                                   fmax(psf_of(w, w->on.measure)->fwhm, 1.0), &match, err));
    RX_TRY_EXIT(with_positions(w, found, &match, &sources, &shapes, err));
    RX_TRY_EXIT(open_fitted(w, w->on.measure, &sources, &measure, err));
    measure.input.shapes = &shapes;
    RX_TRY_EXIT(run(&par, &measure, &tphot, err));
    for (int i = 0; i < rows->n; i++) {
        const int k = match.of[i];
        if (k < 0)
            continue;
        rows->list[i].fit = fit_of(tphot, sources.n - match.n + k);
        rows->list[i].point_fit = tphot->list[sources.n - match.n + k].point_fit;
        rows->list[i].sersic_fit = tphot->list[sources.n - match.n + k].sersic_fit;
        rows->list[i].fit.flux += tphot->list[rows->list[i].fit.entry].unseen; /* whatever is there */
        rows->list[i].number_assoc = match.replaced[k];
    }
exit:
    close_fitted(&measure);
    rx_position_match_clear(&match);
    rx_tphot_free(tphot);
    free(sources.list);
    free(shapes.list);
    return status;
}

static bool is_artefact(const rx_sources *sources, int i)
{
    return i < sources->n && (sources->list[i].fit.restore & RX_RESTORE_SHARP) != 0;
}

/* How well the models explain the image; what is an artefact says nothing of sources. */
static rx_status describe_tile(const work *w, const rx_sources *sources, rx_error *err)
{
    rx_template_fit *dst = w->dst;
    const rx_tphot *tphot = dst->tphot;
    double *evidence;
    int ncrowded = 0, n = 0;
    RX_TRY(RX_MAKE(evidence, (size_t)tphot->n, err));
    dst->added = tphot->n - tphot->nlisted;
    dst->chi2 = tphot->visible > 0 ? tphot->chi2 / tphot->visible : NAN;
    dst->fwhm = psf_of(w, w->on.measure)->fwhm;
    for (int i = 0; i < tphot->n; i++)
        if (tphot->list[i].crowded && !is_artefact(sources, i))
            evidence[ncrowded++] = tphot->list[i].evidence;
    dst->preal[1] = rx_preal_crowd(evidence, ncrowded, tphot->crowded * tphot->visible, dst->fwhm);
    for (int i = 0; i < tphot->n; i++)
        if (!is_artefact(sources, i))
            evidence[n++] = tphot->list[i].evidence;
    dst->preal[0] = rx_preal_default(evidence, n, tphot->visible, dst->fwhm);
    free(evidence);
    return RX_OK;
}

/* P_REAL and the marks of FLAGS_RESTORE, and those sources removed that PRECISION_TARGET has no room for. A source is marked where it
 * is more probably not there than there: SHRED where a neighbour takes more than half of its S/N squared, else SPURIOUS. */
static rx_status mark_doubtful(const rx_template_params *par, rx_template_fit *fit, rx_sources *sources,
                               rx_error *err)
{
    unsigned char *keep = RX_NEW(unsigned char, (size_t)sources->n);
    double *preal = RX_NEW(double, (size_t)sources->n);
    rx_status status = RX_OK;
    int marked = 0, kept = 0;
    if (keep == NULL || preal == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)sources->n * (sizeof *keep + sizeof *preal)));
    for (int i = 0; i < sources->n; i++) {
        rx_source_template *t = &sources->list[i].fit;
        if ((t->flags & (RX_TPHOT_NO_DATA | RX_TPHOT_SINGULAR)) != 0 || !isfinite(t->snr) ||
            fit->unknown_noise) {
            t->restore |= RX_RESTORE_UNTESTED;
            t->preal = NAN;
        } else {
            const rx_preal *preal = &fit->preal[fit->tphot->list[t->entry].crowded];
            const double real = rx_preal_of(preal, t->evidence);
            t->preal = real * (1 - t->artefact);
            /* without a neighbour the evidence is the square of the S/N */
            if (real < 0.5)
                t->restore |= t->snr > 0.0 && t->evidence < 0.5 * t->snr * t->snr ? RX_RESTORE_SHRED
                                                                                  : RX_RESTORE_SPURIOUS;
        }
        preal[i] = t->preal;
        marked += rx_source_is_spurious(&sources->list[i]);
    }
    fit->invented = marked;
    fit->per_mpixel = fit->tphot->visible > 0 ? 1e6 * fit->invented / fit->tphot->visible : NAN;
    if (par->precision > 0.0) {
        RX_TRY_EXIT(rx_preal_least(preal, sources->n, par->precision, &fit->least, err));
        for (int i = 0; i < sources->n; i++)
            kept += keep[i] = !(preal[i] < fit->least);
        fit->dropped = sources->n - kept;
        status = rx_sources_select(sources, keep, err);
    }
exit:
    free(keep);
    free(preal);
    return status;
}

rx_status rx_template_fit_run(const rx_pipeline_params *params, rx_fields fields, const rx_restored *restored,
                              rx_sources *sources, rx_log *log, rx_template_fit *dst, rx_error *err)
{
    const rx_field *detect = fields.detect;
    work w = {.params = params, .on = fields, .restored = restored, .log = log, .dst = dst};
    *dst = (rx_template_fit){0};
    rx_status status = make_rows(&w, err);
    const rx_field *without = psf_of(&w, detect) == NULL ? detect : fields.measure;
    if (status != RX_OK) {
        rx_template_fit_free(dst);
        return status;
    }
    if (psf_of(&w, without) == NULL) {
        for (int i = 0; i < sources->n; i++) {
            sources->list[i].fit = NO_FIT;
            rx_source_without_fits(&sources->list[i].point_fit, &sources->list[i].sersic_fit);
        }
        rx_log_warning(log,
                       "%s[%d]: the PSF is not known, so no templates are fitted; give PSF_TYPE and PSF_FWHM "
                       "or PSF_NAME",
                       without->image.name, without->image.hdu);
        return RX_OK;
    }
    const rx_image measured = rx_field_restorable(fields.measure);
    w.extra =
        (rx_template_extra){.detect = &params->detect,
                            .threshold = ADDED_SNR,
                            .crowd_threshold = CROWD_SNR,
                            .crowd_error = params->templates.par.isolate > 0 ? NEIGHBOUR_ERROR : CROWD_ERROR,
                            .psf = psf_of(&w, detect),
                            .mask = detect->image.mask,
                            .sources = sources,
                            .nthreads = params->nthreads,
                            .log = log};
    const rx_image observed = rx_field_restorable(detect);
    const int listed = sources->n,
              listable = !(params->templates.par.isolate > 0); /* or only taken off the stars of the PSF */
    RX_TRY_EXIT(rx_hits_mark(&observed, params->nthreads, 0, sources, err));
    if (listable)
        RX_TRY_EXIT(rx_lines_mark(&observed, params->nthreads, sources, err));
    status = rx_error_where(err, fit(&w, sources, err), measured.name, measured.hdu, 0);
    const int noiseless = status == RX_OK && dst->tphot->least > measured.global_noise;
    if (noiseless)
        rx_log_warning(
            log,
            "%s[%d]: its noise, %.3g ADU a pixel, is less than its rounding or two millionths of its "
            "brightest light; templates take %.3g",
            measured.name, measured.hdu, measured.global_noise, dst->tphot->least);
    RX_TRY_EXIT(status);
    RX_TRY_EXIT(rx_template_extra_append(&w.extra, dst->tphot, sources, err));
    for (int i = 0; i < sources->n; i++) {
        const double artefact = sources->list[i].fit.artefact;
        sources->list[i].fit = fit_of(dst->tphot, i);
        rx_source_doubt(&sources->list[i], artefact);
        sources->list[i].point_fit = dst->tphot->list[i].point_fit;
        sources->list[i].sersic_fit = dst->tphot->list[i].sersic_fit;
    }
    if (listable) {
        RX_TRY_EXIT(rx_hits_mark(&observed, params->nthreads, listed, sources, err));
        RX_TRY_EXIT(rx_lines_mark(&observed, params->nthreads, sources, err));
    }
    RX_TRY_EXIT(describe_tile(&w, sources, err));
    RX_TRY_EXIT(fit_positions(&w, sources, err));
    dst->unknown_noise = noiseless && !(dst->chi2 < UNTESTABLE * UNTESTABLE);
    if (dst->unknown_noise)
        rx_log_warning(
            log,
            "%s[%d]: templates leave %.3g times that noise, so fluxes may be far off and no source can be "
            "tested: P_REAL is not known, FLAGS_RESTORE 4",
            measured.name, measured.hdu, sqrt(dst->chi2));
    status = mark_doubtful(&params->templates, dst, sources, err);
exit:
    rx_template_extra_clear(&w.extra);
    if (status != RX_OK)
        rx_template_fit_free(dst);
    return status;
}

void rx_template_fit_free(rx_template_fit *fit)
{
    rx_tphot_free(fit->tphot);
    rx_sources_free(fit->forced);
    *fit = (rx_template_fit){0};
}
