/* The checks of a run. */
#include "check/checks.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "check/quality.h"
#include "data/facts.h"
#include "report/qa_page.h"

struct rx_checks {
    const rx_pipeline_params *params;
    const rx_check_params *par;
    const rx_field *field;
    rx_sources *sources;     /* of the untouched tile as it is */
    rx_selfcheck_plan *plan; /* NULL: no self check */
    rx_noise_correlation noise;
    int blank;                                            /* noise is known */
    char no_self[RX_ERROR_TEXT], no_blank[RX_ERROR_TEXT]; /* why a check is left out, "" it is not */
};

/* Where the sources of the untouched tile are; `sizes`: and how large, for rx_selfcheck_plan_new(). */
static rx_status find_sources(const rx_pipeline_params *params, int sizes, const rx_field *field,
                              rx_sources **dst, rx_error *err)
{
    rx_result result;
    rx_pipeline_params own = *params;
    own.measure.skip = RX_SKIP_APER | RX_SKIP_PETRO | RX_SKIP_WIN;
    if (sizes) { /* of galaxies */
        own.measure.nradii = 1;
        own.measure.flux_fraction[0] = 0.5;
    } else {
        own.measure.skip |= RX_SKIP_AUTO | RX_SKIP_RADIUS;
    }
    own.measure.star_net = NULL;
    own.measure.vignet_width = own.measure.vignet_height = 0;
    own.calibrate_none = 0;
    own.templates.wanted = 0;
    RX_TRY(rx_field_extract(&own, rx_restorer_find("NONE"), field, NULL, NULL, &result, err));
    *dst = result.sources;
    result.sources = NULL;
    rx_result_free(&result);
    return RX_OK;
}

static rx_status prepare_selfcheck(rx_checks *checks, rx_log *log, rx_error *err)
{
    const rx_field *field = checks->field;
    const rx_tile *tile = field->tile;
    rx_error why = rx_error_part(err);
    if (field->psf == NULL) {
        snprintf(checks->no_self, sizeof checks->no_self, "the PSF is not known");
        rx_log_warning(log,
                       "%s[%d]: the PSF is not known, so nothing can be injected: SELF_CHECK is left out; "
                       "give PSF_TYPE and PSF_FWHM or PSF_NAME",
                       tile->name, tile->hdu);
        return RX_OK;
    }
    if (checks->params->psf.type == RX_PSF_AUTO && field->psf->type != RX_PSF_AUTO)
        rx_log_warning(log,
                       "%s[%d]: SELF_CHECK injects objects of a PSF that was not measured on the tile: %s",
                       tile->name, tile->hdu, field->psf->description);
    rx_status status =
        rx_selfcheck_plan_new(checks->params, checks->par, field, checks->sources, &checks->plan, &why);
    if (status == RX_INPUT) {
        snprintf(checks->no_self, sizeof checks->no_self, "%s", why.text);
        rx_log_warning(log, "%s[%d]: %s", tile->name, tile->hdu, why.text);
        return RX_OK;
    }
    if (status != RX_OK)
        rx_error_take(err, &why);
    return status;
}

static rx_status prepare_blankcheck(rx_checks *checks, rx_log *log, rx_error *err)
{
    const rx_tile *tile = checks->field->tile;
    rx_error why = rx_error_part(err);
    rx_status status = rx_blankcheck_noise(checks->field, checks->sources->segments, checks->params->nthreads,
                                           &checks->noise, &why);
    if (status == RX_INPUT) {
        snprintf(checks->no_blank, sizeof checks->no_blank, "%s", why.text);
        rx_log_warning(log, "%s[%d]: BLANK_CHECK is left out: %s", tile->name, tile->hdu, why.text);
    } else if (status != RX_OK) {
        rx_error_take(err, &why);
    }
    checks->blank = status == RX_OK;
    return status == RX_INPUT ? RX_OK : status;
}

rx_status rx_checks_new(const rx_pipeline_params *params, const rx_check_params *par, const rx_field *field,
                        rx_log *log, rx_checks **dst, rx_error *err)
{
    *dst = NULL;
    if (!par->self_check && par->blank_check <= 0)
        return RX_OK;
    rx_checks *checks;
    RX_TRY(RX_MAKE(checks, 1, err));
    checks->params = params;
    checks->par = par;
    checks->field = field;
    rx_status status;
    RX_TRY_EXIT(find_sources(params, par->self_check, field, &checks->sources, err));
    if (par->self_check)
        RX_TRY_EXIT(prepare_selfcheck(checks, log, err));
    if (par->blank_check > 0)
        RX_TRY_EXIT(prepare_blankcheck(checks, log, err));
    *dst = checks;
    return RX_OK;
exit:
    rx_checks_free(checks);
    return status;
}

void rx_checks_free(rx_checks *checks)
{
    if (checks == NULL)
        return;
    rx_selfcheck_plan_free(checks->plan);
    rx_sources_free(checks->sources);
    free(checks);
}

/* "22.31 (22.25..22.38)"; a side without a bound stays open. */
/* A magnitude that was not reached is a limit. */
static void add_depth(rx_text *dst, int percent, const rx_estimate *e)
{
    if (isfinite(e->value) && isfinite(e->low) && isfinite(e->high)) {
        rx_text_printf(dst, ", %d %% complete at %.2f (%.2f..%.2f)", percent, e->value, e->low, e->high);
        return;
    }
    rx_text_printf(dst, ", %d %% complete at ", percent);
    if (!isfinite(e->value))
        rx_text_add(dst, "not known");
    else if (isfinite(e->low))
        rx_text_printf(dst, "%.2f or fainter (beyond %.2f)", e->value, e->low);
    else if (isfinite(e->high))
        rx_text_printf(dst, "%.2f or brighter (before %.2f)", e->value, e->high);
    else
        rx_text_printf(dst, "%.2f (no interval)", e->value);
}

static void add_estimate(rx_text *dst, const char *what, int decimals, const rx_estimate *e)
{
    rx_text_printf(dst, ", %s ", what);
    if (!isfinite(e->value)) {
        rx_text_add(dst, "not known");
        return;
    }
    rx_text_printf(dst, "%.*f (", decimals, e->value);
    if (isfinite(e->low))
        rx_text_printf(dst, "%.*f", decimals, e->low);
    rx_text_add(dst, "..");
    if (isfinite(e->high))
        rx_text_printf(dst, "%.*f", decimals, e->high);
    rx_text_add(dst, ")");
}

void rx_checks_text(const rx_checks *checks, const rx_check_results *results, rx_text *dst)
{
    const rx_selfcheck *self = &results->self;
    const rx_blankcheck *blank = &results->blank;
    if (self->injected > 0) {
        rx_text_printf(
            dst, "self check: %ld of %ld injected objects (%.0f %% galaxies) of magnitude %.2f to %.2f found",
            self->found, self->injected, 100.0 * self->galaxies, checks->plan->mag_low,
            checks->plan->mag_high);
        add_depth(dst, 50, &self->mag50);
        add_depth(dst, 90, &self->mag90);
        add_estimate(dst, "of new detections injected", 3, &self->injected_share);
        add_estimate(dst, "magnitude bias", 3, &self->bias);
        add_estimate(dst, "of isolated ones in wide apertures", 4, &self->wide_bias);
        add_estimate(dst, "of these without the sky's error", 4, &self->aperture_bias);
    }
    if (self->injected > 0 && blank->realisations > 0)
        rx_text_add(dst, "; ");
    if (blank->realisations > 0)
        rx_text_printf(dst,
                       "blank check: %ld false detections in %.3g Mpixels of this tile's noise, %.3g per "
                       "Mpixel (%.3g..%.3g), below %.3g at 95 %%",
                       blank->false_detections, blank->mpixels, blank->rate.value, blank->rate.low,
                       blank->rate.high, blank->upper);
    if (blank->realisations > 0 && blank->raised > 1.0)
        rx_text_printf(dst, ", with DETECT_THRESH raised %.3g times (%.3g per Mpixel without)", blank->raised,
                       blank->asked);
    if (blank->real.n > 0)
        add_estimate(dst, "of this tile's detections no noise peak", 3, &blank->real);
}

rx_status rx_checks_guard(const rx_check_params *par, const rx_restorer *kind, const rx_field *field,
                          rx_pipeline_params *params, rx_log *log, rx_blankcheck *dst, rx_error *err)
{
    const rx_tile *tile = field->tile;
    const double asked = params->detect.threshold;
    *dst = (rx_blankcheck){.raised = 1.0};
    if ((kind->traits & RX_TRAIT_INVENTS) == 0 || par->blank_check == 0)
        return RX_OK;
    RX_TRY(rx_blankcheck_guard(params, kind, field, par->false_max, dst, err));
    if (dst->raised > 1.0)
        rx_log_warning(log,
                       "%s[%d]: %s makes %.3g false detections per Mpixel of this tile's noise, above "
                       "NOISE_FALSE_MAX %g: DETECT_THRESH is raised from %g to %.3g, which leaves %.3g",
                       tile->name, tile->hdu, kind->name, dst->asked, par->false_max, asked,
                       params->detect.threshold, dst->rate.value);
    return RX_OK;
}

rx_status rx_checks_run(const rx_checks *checks, const rx_pipeline_params *params, const rx_restorer *kind,
                        rx_result *tile, rx_log *log, rx_check_results *dst, rx_error *err)
{
    rx_status status = RX_OK;
    if (checks != NULL && checks->plan != NULL) {
        rx_selfcheck_plan plan = *checks->plan;
        plan.params.detect = params->detect;
        if (checks->par->galaxies < 0.0 && rx_blankcheck_is_crowd(tile))
            plan.galaxies = 0.0;
        status = rx_selfcheck_run(&plan, kind, tile, log, &dst->self, err);
    }
    if (status == RX_OK && checks != NULL && checks->blank) {
        const rx_blankcheck quick = dst->blank;
        status = rx_blankcheck_run(
            params,
            &(rx_blank_input){kind, checks->field, &checks->noise, NULL, checks->par->blank_check, tile}, log,
            &dst->blank, err);
        dst->blank.raised = quick.raised;
        dst->blank.asked = quick.asked;
    }
    if (status == RX_OK && dst->blank.realisations > 0)
        rx_blankcheck_finish(params, tile, &dst->blank);
    return status;
}

void rx_checks_apply(const rx_check_results *results, rx_result *tile)
{
    for (int i = 0; i < tile->sources->n; i++) {
        rx_source_template *fit = &tile->sources->list[i].fit;
        rx_conformal_at(&results->self.errors, fit->flux / fit->fluxerr, fit->blend, fit->injected);
        for (int level = 0; level < RX_CONFORMAL_LEVELS; level++)
            fit->injected[level] *= fit->fluxerr;
    }
}

void rx_check_results_free(rx_check_results *results)
{
    rx_selfcheck_free(&results->self);
    rx_blankcheck_free(&results->blank);
}

static void estimate_facts(rx_record *facts, rx_fact fact, const rx_estimate *e)
{
    if (!isfinite(e->value))
        return;
    rx_fact_number(facts, fact, e->value);
    rx_fact_number(facts, fact + 1, e->low);
    rx_fact_number(facts, fact + 2, e->high);
}

static void selfcheck_facts(const rx_checks *checks, const rx_selfcheck *self, rx_record *facts)
{
    const rx_selfcheck_plan *plan = checks->plan;
    rx_fact_number(facts, RX_FACT_SCN, self->injected);
    rx_fact_number(facts, RX_FACT_SCFND, self->found);
    rx_fact_number(facts, RX_FACT_SCGAL, self->galaxies);
    rx_fact_number(facts, RX_FACT_SCGSZ, plan->galaxy_scale);
    rx_fact_number(facts, RX_FACT_SCGN, plan->resolved);
    rx_fact_number(facts, RX_FACT_SCM1, plan->mag_low);
    rx_fact_number(facts, RX_FACT_SCM2, plan->mag_high);
    rx_fact_number(facts, RX_FACT_SCLIM, plan->limit);
    rx_fact_text(facts, RX_FACT_SCPSF, plan->field->psf->description);
    estimate_facts(facts, RX_FACT_SC90, &self->mag90);
    estimate_facts(facts, RX_FACT_SC50, &self->mag50);
    estimate_facts(facts, RX_FACT_SCNEW, &self->injected_share);
    estimate_facts(facts, RX_FACT_SCBIA, &self->bias);
    estimate_facts(facts, RX_FACT_SCSCA, &self->scatter);
    estimate_facts(facts, RX_FACT_SCWID, &self->wide_bias);
    if (plan->params.templates.wanted) {
        rx_fact_number(facts, RX_FACT_SCERN, self->errors.n);
        rx_fact_number(facts, RX_FACT_SCERG, self->errors.places[0].n + self->errors.places[1].n);
    }
    estimate_facts(facts, RX_FACT_SCSKY, &self->sky);
    estimate_facts(facts, RX_FACT_SCAP, &self->aperture_bias);
    rx_fact_number(facts, RX_FACT_SCAPN, self->aperture_bias.n);
    rx_fact_number(facts, RX_FACT_SCAPD, plan->diameter);
}

static void blankcheck_facts(const rx_pipeline_params *params, const rx_blankcheck *blank, rx_record *facts)
{
    rx_fact_number(facts, RX_FACT_BLKN, blank->realisations);
    rx_fact_flag(facts, RX_FACT_BLKQ, blank->quick);
    rx_fact_flag(facts, RX_FACT_BLKC, blank->correlated);
    rx_fact_number(facts, RX_FACT_BLKT, blank->raised);
    if (blank->raised > 1.0) {
        rx_fact_number(facts, RX_FACT_BLKD, params->detect.threshold);
        rx_fact_number(facts, RX_FACT_BLKRA, blank->asked);
    }
    rx_fact_number(facts, RX_FACT_BLKA, blank->mpixels);
    rx_fact_number(facts, RX_FACT_BLKF, blank->false_detections);
    rx_fact_number(facts, RX_FACT_BLKR, blank->rate.value);
    rx_fact_number(facts, RX_FACT_BLKRL, blank->rate.low);
    rx_fact_number(facts, RX_FACT_BLKRH, blank->rate.high);
    rx_fact_number(facts, RX_FACT_BLKU, blank->upper);
    rx_fact_number(facts, RX_FACT_BLKS, blank->sky);
    estimate_facts(facts, RX_FACT_BLKP, &blank->real);
}

void rx_checks_facts(const rx_checks *checks, const rx_pipeline_params *params,
                     const rx_check_results *results, rx_record *facts)
{
    if (checks != NULL && checks->no_self[0] != '\0')
        rx_fact_text(facts, RX_FACT_SCWHY, checks->no_self);
    if (checks != NULL && checks->no_blank[0] != '\0')
        rx_fact_text(facts, RX_FACT_BLKWHY, checks->no_blank);
    if (results->self.injected > 0)
        selfcheck_facts(checks, &results->self, facts);
    if (results->blank.realisations > 0)
        blankcheck_facts(params, &results->blank, facts);
}

int rx_checks_injected(const rx_checks *checks)
{
    return checks != NULL && checks->plan != NULL;
}

rx_status rx_checks_report(const rx_checks *checks, const rx_checks_page *page, rx_log *log, rx_error *err)
{
    rx_qa_run runs[RX_MAX_RUNS];
    rx_qa_picture pictures[RX_MAX_RUNS];
    rx_qa_input input = {0};
    rx_verdict verdict;
    rx_qa_params par = rx_selfcheck_qa(checks->plan);
    const char *(*pairs)[2] = NULL;
    RX_TRY(rx_record_list(page->record, &pairs, err));
    for (int i = 0; i < page->n; i++) {
        rx_qa_run injected;
        rx_selfcheck_input(checks->plan, &page->results[i]->self, page->about[i].name, &input, &injected);
        runs[i] = page->about[i];
        runs[i].list = injected.list;
        runs[i].law_scale = injected.law_scale;
        runs[i].law_power = injected.law_power;
        runs[i].psf = checks->field->psf->description;
        pictures[i] = page->results[i]->self.picture;
    }
    input.precision_is =
        "share of the new detections that was injected, by measured magnitude; not the purity "
        "of the tile's catalogue";
    input.nruns = page->n;
    input.runs = runs;
    input.npictures = page->n;
    input.pictures = pictures;
    input.nrecord = page->record->n;
    input.record = (const char *const(*)[2])pairs;
    par.log = log;
    rx_status status = rx_qa_report(&par, &input, page->folder, page->shown, &verdict, NULL, err);
    free(pairs);
    return status;
}
