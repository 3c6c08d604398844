/* The restorer of a tile, by what each finds of the same injected sources. */
#include "check/choice.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "check/blankcheck.h"
#include "check/checks.h"
#include "check/quality.h"
#include "check/selfcheck.h"
#include "data/facts.h"
#include "io/tile.h"
#include "pipeline/domain.h"
#include "pipeline/pipeline.h"
#include "pipeline/residual.h"
#include "quality/evaluate.h"
#include "quality/statistics.h"

enum { SIDE = 512, WINDOWS = 4 };    /* a Mpixel at most */
enum { COUNT = 500 };                /* objects in all, or SELF_CHECK_COUNT where that is less */
static const double DENSITY = 500.0; /* of them at once, per Mpixel: so a Mpixel is gone through once */
static const double ERRORS = 2.0;    /* that a score must be ahead */
static const double MOST_BIAS = 0.05;
static const double BRIGHT = 0.75; /* S/N 10 is so many magnitudes brighter than the limit at S/N 5 */

enum { NONE, RL, NET };
_Static_assert(NET + 1 == RX_CHOICE_CANDIDATES, "a name for each");

/* What a candidate has found so far. */
typedef struct trial {
    rx_pipeline_params params;
    unsigned char *found; /* [choice->injected] */
    double *dmag;         /* [ndmag] */
    long ndmag;
} trial;

typedef struct work {
    const rx_pipeline_params *params;
    const rx_check_params *par;
    const rx_field *field;
    rx_choice *choice;
    trial of[RX_CHOICE_CANDIDATES];
    double model_noise;
    char skipped[200]; /* why nothing could be injected into a window */
} work;

/* The windows of a tile, one of which is all of it where it is small; returns how many. */
static int place_windows(const rx_tile *tile, rx_replica_part dst[WINDOWS])
{
    const long most = (long)WINDOWS * SIDE * SIDE;
    const int halves[2] = {tile->width / 2, tile->height / 2};
    dst[0] = (rx_replica_part){.width = tile->width, .height = tile->height};
    if ((long)tile->width * tile->height <= most)
        return 1;
    for (int k = 0; k < WINDOWS; k++) {
        const int right = k % 2, upper = k / 2;
        const rx_replica_part quarter = {.x = right ? halves[0] : 0,
                                         .y = upper ? halves[1] : 0,
                                         .width = right ? tile->width - halves[0] : halves[0],
                                         .height = upper ? tile->height - halves[1] : halves[1]};
        dst[k] = rx_replica_window(tile, &quarter, SIDE);
    }
    return WINDOWS;
}

/* The caller's, with what the choice needs measured and no more: templates are not fitted. */
static rx_pipeline_params own_params(const rx_pipeline_params *params)
{
    rx_pipeline_params own = rx_replica_params(params);
    own.examine_residual = params->examine_residual;
    own.restore.verify_seams = 0;
    own.measure.skip &= ~RX_SKIP_AUTO; /* whatever the columns are */
    return own;
}

/* What is known before anything is tried. */
static rx_status decline(const work *w, rx_error *err)
{
    rx_choice_candidate *net = &w->choice->of[NET];
    const rx_restorer *kind = net->kind;
    rx_restore_params par = w->params->restore;
    rx_domain domain;
    const char *unknown = w->field->psf == NULL ? "PSF" : w->field->plain->constant ? "noise" : NULL;
    for (int i = RL; i < RX_CHOICE_CANDIDATES && unknown != NULL; i++)
        snprintf(w->choice->of[i].out, sizeof w->choice->of[i].out, "the %s is not known", unknown);
    if (unknown != NULL)
        return RX_OK;
    par.out_of_domain = RX_DOMAIN_RL;
    RX_TRY(rx_domain_obey(&par, w->field, NULL, &kind, &domain, err));
    if (par.model == NULL)
        snprintf(net->out, sizeof net->out, "there is no model");
    else if (kind != net->kind)
        snprintf(net->out, sizeof net->out, "%s", domain.why);
    else if (rx_noise_is_structure(&w->field->noise))
        snprintf(net->out, sizeof net->out,
                 "noise is %.1f times as wide as that of independent pixels, more than resampling explains",
                 rx_noise_factor_wide(&w->field->noise));
    return RX_OK;
}

/* An error of one candidate, or window, is its own, but where memory is out or the user stops. */
static rx_status fails(rx_status status, const rx_error *why, char out[200], rx_error *err)
{
    if (status == RX_OK)
        return RX_OK;
    if (status == RX_SYSTEM || status == RX_INTERRUPTED)
        return rx_error_take(err, why);
    snprintf(out, 200, "%.199s", why->text);
    return RX_OK;
}

static rx_status set_threshold(work *w, int i, rx_error *err)
{
    rx_choice_candidate *c = &w->choice->of[i];
    rx_error why = rx_error_part(err);
    rx_blankcheck blank;
    const rx_status status =
        rx_blankcheck_guard(&w->of[i].params, c->kind, w->field, w->par->false_max, &blank, &why);
    c->raised = blank.raised;
    c->false_rate = blank.realisations > 0 ? blank.rate.value : NAN;
    rx_blankcheck_free(&blank);
    return fails(status, &why, c->out, err);
}

/* A window of the tile by itself, with the tile's PSF. */
static rx_status open_window(const work *w, const rx_replica_part *part, rx_field **dst, rx_error *err)
{
    const rx_field *field = w->field;
    rx_tile *tile = NULL;
    rx_psf *psf = rx_replica_psf(field->psf, part);
    rx_status status;
    if (psf == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(rx_replica_new(field->tile, part, &tile, err));
    tile->pixel_scale = rx_quality_scale(field->tile);
    RX_TRY_EXIT(rx_field_prepare(w->params, RX_FIELD_DETECTED, tile, psf, NULL, dst, err));
    (*dst)->model_noise = w->model_noise; /* restored as the tile is */
    (*dst)->model_factor = field->noise_factor;
exit:
    rx_psf_free(psf);
    return status;
}

/* What the untouched window says against it. */
static void judge(const rx_result *result, rx_choice_candidate *c)
{
    const rx_fluxcheck *flux = &result->photometry.check;
    if (rx_fluxcheck_is_off(flux))
        snprintf(c->out, sizeof c->out,
                 "its flux scale is off: restored/untouched %.4f +- %.4f, FLUX_AUTO %.3f +- %.3f", flux->wide,
                 flux->wide_error, flux->automatic, flux->automatic_error);
    else if (rx_residual_is_large(result->residual.share) && result->residual.cause == RX_MISFIT_NOISE)
        snprintf(c->out, sizeof c->out, "the noise is not known");
    else if (rx_residual_is_large(result->residual.share) && (c->kind->traits & RX_TRAIT_INVENTS) != 0)
        snprintf(c->out, sizeof c->out, "the restored image does not explain %.0f %% of the pixels",
                 100.0 * result->residual.share);
    else if (rx_result_is_dark(result))
        snprintf(c->out, sizeof c->out,
                 "%.0f %% of the tile lies below the sky, which it was not trained for",
                 100.0 * result->residual.dark);
}

/* `first`: objects of the windows before. */
static rx_status keep(const rx_selfcheck_plan *plan, const rx_selfcheck *check, long first, trial *t,
                      rx_choice_candidate *c, rx_error *err)
{
    const rx_qa_list *truth = &check->truth, *list = &check->found_list;
    RX_TRY(RX_GROW(t->found, (size_t)(first + truth->n), err));
    RX_TRY(RX_GROW(t->dmag, (size_t)(t->ndmag + truth->n), err));
    c->spurious += list->n;
    for (long i = 0; i < truth->n; i++) {
        const long j = check->partner[i];
        t->found[first + i] = j >= 0;
        c->found += j >= 0;
        c->spurious -= j >= 0;
        if (j >= 0 && list->flags[j] == 0 && isfinite(list->mag[j]) && truth->mag[i] < plan->limit - BRIGHT)
            t->dmag[t->ndmag++] = list->mag[j] - truth->mag[i];
    }
    return RX_OK;
}

static rx_status try_one(work *w, int i, const rx_selfcheck_plan *plan, long *injected, rx_error *err)
{
    rx_choice_candidate *c = &w->choice->of[i];
    rx_selfcheck_plan own = *plan;
    rx_selfcheck check = {0};
    rx_result before;
    own.params.detect = w->of[i].params.detect;
    RX_TRY(rx_field_extract(&w->of[i].params, c->kind, plan->field, NULL, NULL, &before, err));
    if (before.by == NULL && !before.plain)
        judge(&before, c);
    rx_status status;
    RX_TRY_EXIT(rx_selfcheck_run(&own, c->kind, &before, NULL, &check, err));
    RX_TRY_EXIT(keep(plan, &check, w->choice->injected, &w->of[i], c, err));
    *injected = check.truth.n;
exit:
    rx_selfcheck_free(&check);
    rx_result_free(&before);
    return status;
}

static rx_status try_window(work *w, const rx_check_params *par, const rx_replica_part *part, rx_error *err)
{
    rx_error why = rx_error_part(err);
    rx_pipeline_params params = own_params(w->params);
    rx_field *field = NULL;
    rx_sources *sources = NULL;
    rx_selfcheck_plan *plan = NULL;
    rx_choice *choice = w->choice;
    long injected = 0;
    rx_status status;
    params.stated_scale = rx_quality_scale(w->field->tile);
    status = open_window(w, part, &field, &why);
    if (status == RX_OK)
        status = rx_checks_sources(&params, 1, field, &sources, &why);
    if (status == RX_OK)
        status = rx_selfcheck_plan_new(&params, par, field, sources, &plan, &why);
    if (status != RX_OK) { /* another window may do */
        status = fails(status, &why, w->skipped, err);
        goto exit;
    }
    for (int i = NONE; i < RX_CHOICE_CANDIDATES; i++) {
        rx_choice_candidate *c = &choice->of[i];
        RX_TRY_EXIT(rx_interrupt_check(err));
        if (c->out[0] != '\0')
            continue;
        why = rx_error_part(err);
        RX_TRY_EXIT(fails(try_one(w, i, plan, &injected, &why), &why, c->out, err));
    }
    choice->injected += injected;
    choice->mpixels += 1e-6 * part->width * part->height;
exit:
    rx_selfcheck_plan_free(plan);
    rx_sources_free(sources);
    rx_field_free(field);
    return status;
}

/* By how many errors a is ahead of b. */
static double ahead(const work *w, int a, int b)
{
    const rx_choice_candidate *ca = &w->choice->of[a], *cb = &w->choice->of[b];
    long differ = ca->spurious + cb->spurious;
    for (long k = 0; k < w->choice->injected; k++)
        differ += w->of[a].found[k] != w->of[b].found[k];
    return (double)((ca->found - ca->spurious) - (cb->found - cb->spurious)) /
           sqrt(fmax(1.0, (double)differ));
}

/* "NONE 640 (12 spurious), RL out, ..." */
static void explain(rx_choice *choice, const char *skipped)
{
    const int none = choice->taken == choice->of[NONE].kind;
    size_t used = 0;
    if (choice->injected == 0)
        snprintf(choice->why, sizeof choice->why, "%s", skipped[0] != '\0' ? skipped : choice->of[RL].out);
    else
        used = (size_t)snprintf(choice->why, sizeof choice->why, "%s of %ld injected sources",
                                none ? "no other finds clearly more" : "finds most", choice->injected);
    for (int i = NONE; i < RX_CHOICE_CANDIDATES && choice->injected > 0; i++) {
        const rx_choice_candidate *c = &choice->of[i];
        char text[240];
        if (c->out[0] != '\0')
            snprintf(text, sizeof text, "out, %s", c->out);
        else
            snprintf(text, sizeof text, "%ld (%ld spurious)", c->found, c->spurious);
        if (used < sizeof choice->why)
            used += (size_t)snprintf(choice->why + used, sizeof choice->why - used, "%s%s %s",
                                     i == NONE ? ": " : ", ", c->kind->name, text);
    }
}

static void decide(work *w)
{
    rx_choice *choice = w->choice;
    const rx_estimate *of_none = &choice->of[NONE].bias;
    int best = NONE;
    for (int i = NONE; i < RX_CHOICE_CANDIDATES; i++) {
        rx_choice_candidate *c = &choice->of[i];
        c->tried = choice->injected > 0 && c->out[0] == '\0';
        rx_robust_estimates(w->of[i].dmag, w->of[i].ndmag, RX_LEVEL, &c->bias, &c->scatter);
        if (i == NONE || !c->tried || !choice->of[NONE].tried)
            continue;
        const double most = fabs(of_none->value) + MOST_BIAS;
        if (c->bias.low > most || c->bias.high < -most)
            snprintf(c->out, sizeof c->out,
                     "its magnitudes are off by %.3f mag (%.3f..%.3f), those of NONE by %.3f", c->bias.value,
                     c->bias.low, c->bias.high, of_none->value);
        if (c->out[0] == '\0' && ahead(w, i, best) > ERRORS)
            best = i;
    }
    choice->taken = choice->of[best].kind;
    explain(choice, w->skipped);
}

rx_status rx_choice_make(const rx_pipeline_params *params, const rx_check_params *par, const rx_field *field,
                         rx_log *log, rx_choice *dst, rx_error *err)
{
    static const char *const names[] = {"NONE", "RL", "NET"};
    rx_replica_part windows[WINDOWS];
    rx_check_params own = *par;
    work w = {.params = params, .par = par, .field = field, .choice = dst};
    rx_status status = RX_OK;
    const int n = place_windows(field->tile, windows);
    own.count = ((par->count < COUNT ? par->count : COUNT) + n - 1) / n;
    own.density = DENSITY;
    own.templates = 0;
    if (own.quality.flux == RX_QUALITY_TEMPLATE)
        own.quality.flux = RX_QUALITY_AUTO;
    *dst = (rx_choice){0};
    for (int i = NONE; i < RX_CHOICE_CANDIDATES; i++) {
        dst->of[i] =
            (rx_choice_candidate){.kind = rx_restorer_find(names[i]), .raised = 1.0, .false_rate = NAN};
        w.of[i].params = own_params(params);
    }
    RX_TRY_EXIT(decline(&w, err));
    RX_TRY_EXIT(rx_domain_noise(field, params->nthreads, &w.model_noise, err));
    int alone = 1;
    for (int i = RL; i < RX_CHOICE_CANDIDATES; i++)
        alone &= dst->of[i].out[0] != '\0';
    for (int i = NONE; i < RX_CHOICE_CANDIDATES && !alone; i++)
        if (dst->of[i].out[0] == '\0')
            RX_TRY_EXIT(set_threshold(&w, i, err));
    rx_log_progress_begin(log);
    for (int k = 0; k < n && !alone; k++) {
        RX_TRY_EXIT(try_window(&w, &own, &windows[k], err));
        rx_log_progress(log, "choice of the restorer", (double)(k + 1) / n);
    }
    decide(&w);
exit:
    rx_log_progress_end(log);
    for (int i = NONE; i < RX_CHOICE_CANDIDATES; i++) {
        free(w.of[i].found);
        free(w.of[i].dmag);
    }
    return status;
}

void rx_choice_facts(const rx_choice *choice, rx_record *facts)
{
    if (choice->taken == NULL)
        return;
    rx_fact_number(facts, RX_FACT_AUN, choice->injected);
    rx_fact_number(facts, RX_FACT_AUA, choice->mpixels);
    for (int i = NONE; i < RX_CHOICE_CANDIDATES; i++) {
        const rx_choice_candidate *c = &choice->of[i];
        const rx_fact first = RX_FACT_AU1 + (i - NONE) * (RX_FACT_AU2 - RX_FACT_AU1);
        rx_fact_text(facts, first, c->kind->name);
        if (c->out[0] != '\0')
            rx_fact_text(facts, first + RX_FACT_AU1O - RX_FACT_AU1, c->out);
        if (!c->tried)
            continue;
        rx_fact_number(facts, first + RX_FACT_AU1F - RX_FACT_AU1, c->found);
        rx_fact_number(facts, first + RX_FACT_AU1S - RX_FACT_AU1, c->spurious);
        rx_fact_number(facts, first + RX_FACT_AU1T - RX_FACT_AU1, c->raised);
        rx_fact_number(facts, first + RX_FACT_AU1R - RX_FACT_AU1, c->false_rate);
        rx_fact_number(facts, first + RX_FACT_AU1B - RX_FACT_AU1, c->bias.value);
        rx_fact_number(facts, first + RX_FACT_AU1D - RX_FACT_AU1, c->scatter.value);
    }
}
