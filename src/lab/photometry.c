/* The photometry campaign: settings, units and results. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/facts.h"
#include "lab/kind.h"
#include "lab/photometry_sky.h"
#include "lab/stage_options.h"
#include "restore/restore.h"

/* --- open --- */

/* Every restorer with each of FLUXES. */
static rx_status set_runs(rx_photometry_state *state, rx_error *err)
{
    const rx_words *words = &state->config->restore_type, *fluxes = &state->config->fluxes;
    for (int i = 0; i < words->n; i++) {
        const rx_restorer *restorer = rx_restorer_find(words->v[i]);
        if (restorer == NULL)
            return rx_error_set(err, RX_USAGE, "RESTORE_TYPE %s is not made here", words->v[i]);
        for (int r = 0; r < state->nruns; r++)
            if (state->run[r] == restorer)
                return rx_error_set(err, RX_USAGE, "RESTORE_TYPE names %s twice", words->v[i]);
        if (state->nruns + fluxes->n > RX_RUNS_MAX || state->nruns + fluxes->n > RX_METHODS_MAX)
            return rx_error_set(err, RX_USAGE, "RESTORE_TYPE and FLUXES give more than %d runs; name fewer",
                                RX_RUNS_MAX);
        for (int f = 0; f < fluxes->n; f++) {
            state->templates[state->nruns] = strcmp(fluxes->v[f], "TEMPLATE") == 0;
            state->options->pipeline.templates.wanted |= state->templates[state->nruns];
            state->run[state->nruns++] = restorer;
        }
    }
    return RX_OK;
}

static rx_status set_magnitudes(rx_photometry_state *state, rx_error *err)
{
    const double *range = state->config->magnitudes.v;
    const double steps = floor((range[1] - range[0]) / range[2] + 1e-6);
    if (!(range[2] > 0) || range[1] < range[0] || steps > 1000)
        return rx_error_set(err, RX_USAGE,
                            "MAGNITUDES are <from>,<to>,<step> from bright to faint, at most 1000 steps");
    state->nmags = (int)steps + 1;
    state->mags = RX_NEW(double, (size_t)state->nmags);
    if (state->mags == NULL)
        return rx_error_memory(err, (size_t)state->nmags * sizeof *state->mags);
    for (int i = 0; i < state->nmags; i++)
        state->mags[i] = range[0] + i * range[2];
    return RX_OK;
}

/* A sky for each condition of simulated fields, one of a real tile. */
static rx_status set_skies(rx_photometry_state *state, rx_log *log, rx_error *err)
{
    const rx_words *words = &state->config->fields;
    int n = 0;
    rx_condition *conditions = NULL;
    rx_status status = rx_conditions_make(state->config, &n, &conditions, err);
    for (int i = 0; status == RX_OK && i < words->n; i++) {
        const int injected = strcmp(words->v[i], "INJECTED") == 0;
        for (int k = 0; status == RX_OK && k < i; k++)
            if (strcmp(words->v[k], words->v[i]) == 0)
                status = rx_error_set(err, RX_USAGE, "FIELDS names %s twice", words->v[i]);
        if (status == RX_OK && injected && (n > 1 || conditions[0].fwhm > 0))
            status =
                rx_error_set(err, RX_USAGE,
                             "SEEING, PSF_ERROR, SKY_ERROR and NOISE_ERROR are of simulated fields; leave "
                             "them out, or INJECTED");
        for (int c = 0; status == RX_OK && c < (injected ? 1 : n); c++) {
            if (state->nskies == RX_SKIES_MAX)
                status = rx_error_set(err, RX_USAGE, "more than %d fields; give fewer numbers to SEEING",
                                      RX_SKIES_MAX);
            else
                status = rx_photometry_sky_open(state, injected, &conditions[c], log,
                                                &state->sky[state->nskies++], err);
        }
    }
    free(conditions);
    return status;
}

static void close_state(void *pointer)
{
    rx_photometry_state *state = pointer;
    if (state == NULL)
        return;
    for (int s = 0; s < state->nskies; s++)
        rx_photometry_sky_close(&state->sky[s]);
    rx_options_free(state->options);
    rx_config_free(state->stage);
    free(state->mags);
    free(state);
}

static rx_status open_state(const rx_campaign_config *config, int nthreads, rx_log *log, void **dst,
                            rx_error *err)
{
    rx_photometry_state *state = RX_NEW(rx_photometry_state, 1);
    if (state == NULL)
        return rx_error_memory(err, sizeof *state);
    const rx_ints *tiles = &config->tiles;
    state->config = config;
    state->nthreads = nthreads;
    state->ntiles = strcmp(config->size, "PAPER") == 0 ? tiles->v[tiles->n - 1] : tiles->v[0];
    rx_status status = rx_campaign_options(config, log, &state->stage, &state->options, err);
    if (status == RX_OK)
        status = set_runs(state, err);
    if (status == RX_OK)
        status = set_magnitudes(state, err);
    if (status == RX_OK)
        status = set_skies(state, log, err);
    if (status == RX_OK)
        *dst = state;
    else
        close_state(state);
    return status;
}

/* --- facts, plan, units --- */

static rx_status facts(const void *pointer, rx_journal_facts *dst, rx_error *err)
{
    const rx_photometry_state *state = pointer;
    rx_status status = rx_facts_model(state->options->model, dst, err);
    for (int s = 0; status == RX_OK && s < state->nskies; s++)
        if (state->sky[s].simulation != NULL)
            status = rx_facts_templates(state->sky[s].simulation->templates, dst, err);
    return status;
}

static long units(const void *state)
{
    return rx_photometry_units(state);
}

static rx_status prepare(void *state, rx_log *log, rx_error *err)
{
    return rx_photometry_prepare(state, log, err);
}

static rx_status do_unit(const void *state, long unit, const rx_unit_values *done, rx_unit_values *dst,
                         rx_error *err)
{
    (void)done;
    return rx_photometry_unit(state, unit, dst, err);
}

/* --- results --- */

/* The values of a tile from v on are added to a set's lists, which have room. Returns the end. */
static const double *take_run(const double *v, long nstars, long first_star, rx_photometry_tally *dst)
{
    for (long i = 0; i < nstars; i++, v += 4)
        dst->stars[first_star + i] = (rx_star_result){(float)v[0], (float)v[1], (float)v[2], (float)v[3]};
    const long nfalse = (long)*v++;
    for (long i = 0; i < nfalse; i++, v += 2) {
        dst->false_scores[dst->nfalse] = (float)v[0];
        dst->false_mags[dst->nfalse++] = (float)v[1];
    }
    return v;
}

/* Room for all tiles of a set; the numbers of false detections are set back to 0. */
static rx_status size_set(const rx_photometry_state *state, const rx_unit_values *tiles,
                          rx_photometry_set *dst, rx_error *err)
{
    for (long t = 0; t < state->ntiles; t++) {
        const double *v = tiles[t].v;
        const long nstars = (long)v[0];
        dst->nstars += nstars;
        v += 3;
        for (int r = 0; r < state->nruns; r++) {
            v += 4 * nstars;
            dst->run[r].nfalse += (long)*v;
            v += 1 + 2 * (long)*v;
        }
    }
    int failed = 0;
    for (int r = 0; r < state->nruns; r++) {
        rx_photometry_tally *run = &dst->run[r];
        run->stars = RX_NEW(rx_star_result, (size_t)dst->nstars);
        run->false_scores = RX_NEW(float, (size_t)run->nfalse);
        run->false_mags = RX_NEW(float, (size_t)run->nfalse);
        failed |= run->stars == NULL || run->false_scores == NULL || run->false_mags == NULL;
        run->nfalse = 0;
    }
    return failed ? rx_error_memory(err, (size_t)dst->nstars * sizeof(rx_star_result)) : RX_OK;
}

static rx_status collect_set(const rx_photometry_state *state, double mag, const rx_unit_values *tiles,
                             rx_photometry_set *dst, rx_error *err)
{
    dst->mag = mag;
    dst->ntiles = state->ntiles;
    rx_status status = size_set(state, tiles, dst, err);
    long star = 0;
    for (long t = 0; status == RX_OK && t < state->ntiles; t++) {
        const double *v = tiles[t].v;
        const long nstars = (long)v[0];
        dst->mpixels += v[1];
        dst->snr += v[2] / (double)state->ntiles;
        v += 3;
        for (int r = 0; r < state->nruns; r++)
            v = take_run(v, nstars, star, &dst->run[r]);
        star += nstars;
    }
    return status;
}

/* File name without folder and endings. */
static void base_name(const char *path, char *dst, size_t size)
{
    const char *slash = strrchr(path, '/');
    snprintf(dst, size, "%s", slash != NULL ? slash + 1 : path);
    dst[strcspn(dst, "[")] = '\0';
    static const char *const endings[] = {".fz", ".gz", ".fits", ".fit", ".fts"};
    for (size_t i = 0; i < sizeof endings / sizeof endings[0]; i++) {
        const size_t n = strlen(dst), m = strlen(endings[i]);
        if (n > m && strcmp(dst + n - m, endings[i]) == 0)
            dst[n - m] = '\0';
    }
}

static void describe_sky(const rx_photometry_state *state, const rx_photometry_sky *sky,
                         rx_photometry_field *dst)
{
    const rx_campaign_config *config = state->config;
    if (sky->injected) {
        const rx_tile *tile = sky->field->tile;
        base_name(config->tile_name, dst->name, sizeof dst->name);
        snprintf(
            dst->about, sizeof dst->about,
            "%d stars added to %d x %d real pixels, among the tile's own sources, again and again; PSF "
            "%s; noise %.4g, gain %g; what was found before the injection counts neither as right nor as "
            "false; false detections are those that the injection brings, and all on as many blank tiles: "
            "realisations of the tile's own noise without sources",
            (int)fmax(floor(config->stars_per_tile * (double)tile->width * tile->height / 1048576.0 + 0.5),
                      1),
            tile->width, tile->height, sky->psf->description, sky->field->plain->global_sigma, tile->gain);
        return;
    }
    const rx_simulate_config *sim = config->sim;
    rx_condition_name(&sky->condition, dst->name, sizeof dst->name);
    if (dst->name[0] == '\0')
        snprintf(dst->name, sizeof dst->name, "simulated");
    dst->misled = !rx_condition_true(&sky->condition);
    snprintf(
        dst->about, sizeof dst->about,
        "%d x %d pixels, PSF %s, %s%s; noise %s (sky %g ADU, sigma %g), per Mpixel %g stars of %g to %g mag "
        "and %g galaxies of %g to %g mag besides the test stars, another sky on each tile",
        sky->width, sky->height, sky->simulation->optics->description,
        sky->told != NULL ? "known to the restorers" : "found by the stage",
        dst->misled ? " (or what is given of PSF, sky and noise, with the error named)" : "", sim->noise_type,
        sim->sky_level, sim->noise_sigma, sim->star_count, sim->star_mag.v[0], sim->star_mag.v[1],
        sim->galaxy_count, sim->galaxy_mag.v[0], sim->galaxy_mag.v[1]);
}

/* Settings of a restorer: the keywords that begin with its name, or with the first part of it. */
typedef struct settings {
    const char *name;
    char *text;
    size_t size;
} settings;

static int begins(const char *keyword, const char *name, size_t n)
{
    return strncmp(keyword, name, n) == 0 && keyword[n] == '_';
}

static int is_setting(const char *keyword, const char *restorer)
{
    int n;
    const rx_restorer *all = rx_restorers(&n);
    const size_t length = strlen(restorer);
    if (!begins(keyword, restorer, strcspn(restorer, "_")))
        return 0;
    for (int i = 0; i < n; i++) /* RL_BLIND_... is not for RL */
        if (strlen(all[i].name) > length && begins(keyword, all[i].name, strlen(all[i].name)))
            return 0;
    return 1;
}

static void add_setting(void *user, const char *name, const char *value, const char *help)
{
    settings *s = user;
    const char *keyword = strrchr(name, '.') != NULL ? strrchr(name, '.') + 1 : name; /* without STAGE. */
    (void)help;
    if (!is_setting(keyword, s->name))
        return;
    const size_t used = strlen(s->text);
    snprintf(s->text + used, s->size - used, "%s%s %s", used > 0 ? ", " : "", keyword, value);
}

static rx_status collect_field(const rx_photometry_state *state, int s, const rx_unit_values *all,
                               rx_photometry_field *dst, rx_error *err)
{
    describe_sky(state, &state->sky[s], dst);
    dst->sets = RX_NEW(rx_photometry_set, (size_t)state->nmags);
    if (dst->sets == NULL)
        return rx_error_memory(err, (size_t)state->nmags * sizeof *dst->sets);
    rx_status status = RX_OK;
    for (int m = 0; status == RX_OK && m < state->nmags; m++) {
        dst->nsets = m + 1;
        status = collect_set(state, state->mags[m], all + (s * state->nmags + m) * state->ntiles,
                             &dst->sets[m], err);
    }
    return status;
}

static rx_status collect(const rx_photometry_state *state, const rx_unit_values *all,
                         rx_photometry_results *dst, rx_error *err)
{
    const rx_campaign_config *config = state->config;
    rx_status status = RX_OK;
    dst->nruns = state->nruns;
    for (int r = 0; r < state->nruns; r++) {
        snprintf(dst->run[r], sizeof dst->run[r], "%s%s", state->run[r]->name,
                 state->templates[r] ? " TEMPLATE" : "");
        dst->templates[r] = state->templates[r];
        settings s = {state->run[r]->name, dst->settings[r], sizeof dst->settings[r]};
        if (!rx_settings_visit(&config->stage->settings, add_setting, &s))
            return rx_error_memory(err, 0);
        if (strcmp(s.name, "NET") == 0) {
            const size_t used = strlen(s.text);
            rx_campaign_model_words(state->options, s.text + used, s.size - used);
        }
    }
    for (int i = 0; i < config->precisions.n && i < RX_PRECISIONS_MAX; i++)
        dst->precision[dst->nprecisions++] = config->precisions.v[i];
    dst->fields = RX_NEW(rx_photometry_field, (size_t)state->nskies);
    if (dst->fields == NULL)
        return rx_error_memory(err, (size_t)state->nskies * sizeof *dst->fields);
    for (int s = 0; status == RX_OK && s < state->nskies; s++) {
        dst->nfields = s + 1;
        status = collect_field(state, s, all, &dst->fields[s], err);
    }
    return status;
}

static rx_status report(const void *state, const rx_unit_values *all, const rx_campaign_record *record,
                        const char *folder, const char *shown, rx_log *log, rx_text *brief, rx_error *err)
{
    rx_photometry_results *results = RX_NEW(rx_photometry_results, 1);
    if (results == NULL)
        return rx_error_memory(err, sizeof *results);
    rx_status status = collect(state, all, results, err);
    if (status == RX_OK)
        status = rx_photometry_report(results, record, folder, shown, log, brief, err);
    rx_photometry_results_free(results);
    return status;
}

const rx_campaign_kind rx_kind_photometry = {.name = "PHOTOMETRY",
                                             .title = "Photometry campaign",
                                             .open = open_state,
                                             .close = close_state,
                                             .facts = facts,
                                             .units = units,
                                             .prepare = prepare,
                                             .unit = do_unit,
                                             .report = report};
