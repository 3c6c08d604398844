/* Numbers of the detection report. */
#include "lab/detection_numbers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "quality/hypothesis.h"
#include "quality/pr.h"

static const double LEVEL = 0.95;

enum { SNR_BINS = 4, RING_BINS = 3, FAINT_BINS = 3 };
static const double SNR_EDGE[SNR_BINS + 1] = {0, 10, 20, 50, HUGE_VAL};
static const double RING_EDGE[RING_BINS + 1] = {0, 2, 4, 6};            /* FWHM */
static const double FAINT_EDGE[FAINT_BINS + 1] = {0, 10, 20, HUGE_VAL}; /* S/N of galaxies */
static const double CLOSE = 0.75;                                       /* FWHM, of pairs */
static const char *const GROWTH[] = {"r1", "r2", "r4", "r2_4"};

/* --- quantities --- */

int rx_quantity_count(const rx_lab *r, rx_scene_id scene)
{
    switch (scene) {
    case RX_SCENE_STARS:
    case RX_SCENE_GALAXIES:
        return 1 + r->nprecisions + 3 + SNR_BINS;
    case RX_SCENE_PAIRS:
        return 4;
    case RX_SCENE_BLANK:
        return 2;
    case RX_SCENE_RINGS:
        return RING_BINS + 2;
    case RX_SCENE_PLATEAU:
        return 3;
    case RX_SCENE_OUTSKIRTS:
        return 4 * FAINT_BINS;
    default:
        return 0;
    }
}

static void set_quantity(rx_quantity *dst, const char *name, const char *unit, int digits, int best,
                         const char *help)
{
    *dst = (rx_quantity){.unit = unit, .digits = digits, .best = best};
    snprintf(dst->name, sizeof dst->name, "%s", name);
    snprintf(dst->help, sizeof dst->help, "%s", help);
}

static void list_quantity(const rx_lab *r, int q, rx_quantity *dst)
{
    static const char *const whole[][3] = {
        {"recall_whole", "", "share of the objects found, whole list"},
        {"precision_whole", "", "right detections / all that count, whole list"},
        {"false_whole", "per Mpixel", "false detections, whole list"}};
    char name[32], help[160];
    if (q == 0) {
        set_quantity(dst, "ap", "", 3, 1, "average precision");
    } else if (q <= r->nprecisions) {
        snprintf(name, sizeof name, "recall_p%g", r->precision[q - 1]);
        snprintf(help, sizeof help,
                 "share of the objects found at the threshold of precision %g on this scene",
                 r->precision[q - 1]);
        set_quantity(dst, name, "", 3, 1, help);
    } else if (q <= r->nprecisions + 3) {
        const char *const *row = whole[q - r->nprecisions - 1];
        set_quantity(dst, row[0], row[1], 3, 0, row[2]);
    } else {
        const int b = q - r->nprecisions - 4;
        snprintf(name, sizeof name, "recall_snr%g", fmax(SNR_EDGE[b], r->truth_snr));
        snprintf(help, sizeof help, "recall at the first precision, objects of S/N %g to %g",
                 fmax(SNR_EDGE[b], r->truth_snr), SNR_EDGE[b + 1]);
        set_quantity(dst, name, "", 3, 1, help);
    }
}

static void growth_quantity(int q, rx_quantity *dst)
{
    static const char *const helps[] = {"within r50", "within 2 r50", "within 4 r50", "between 2 and 4 r50"};
    const int b = q / 4;
    char name[32], help[160];
    snprintf(name, sizeof name, "%s_snr%g", GROWTH[q % 4], FAINT_EDGE[b]);
    snprintf(help, sizeof help, "flux %s over the true one there, galaxies of S/N %g to %g, all together",
             helps[q % 4], FAINT_EDGE[b], FAINT_EDGE[b + 1]);
    set_quantity(dst, name, "", 3, 0, help);
}

void rx_quantity_get(const rx_lab *r, rx_scene_id scene, int q, rx_quantity *dst)
{
    static const char *const pairs[][2] = {
        {"resolved", "share of the pairs resolved, at the first precision's cut"},
        {"resolved_close", "the same, separations below 0.75 FWHM"},
        {"resolved_wide", "the same, separations from 0.75 FWHM"},
        {"resolved_whole", "share of the pairs resolved, whole list"}};
    static const char *const blank[][2] = {{"false_cut", "false detections at the last precision's cut"},
                                           {"false_whole", "false detections, whole list"}};
    static const char *const rings[][2] = {
        {"false_0_2", "false detections within 2 FWHM of a bright star, at the last precision's cut"},
        {"false_2_4", "the same between 2 and 4 FWHM"},
        {"false_4_6", "the same between 4 and 6 FWHM"},
        {"false_whole", "within 6 FWHM, whole list"},
        {"recall", "share of the bright stars found"}};
    static const char *const plateau[][2] = {
        {"phases2", "rms of the means of the 2 x 2 phases, the worst tile"},
        {"phases4", "rms of the means of the 4 x 4 phases, the worst tile"},
        {"range4", "range of the means of the 4 x 4 phases, the worst tile"}};
    if (rx_scene_is_list(scene))
        list_quantity(r, q, dst);
    else if (scene == RX_SCENE_PAIRS)
        set_quantity(dst, pairs[q][0], "", 3, 1, pairs[q][1]);
    else if (scene == RX_SCENE_BLANK)
        set_quantity(dst, blank[q][0], "per Mpixel", 2, 0, blank[q][1]);
    else if (scene == RX_SCENE_RINGS)
        set_quantity(dst, rings[q][0], q < RING_BINS + 1 ? "per Mpixel" : "", q < RING_BINS + 1 ? 1 : 3, 0,
                     rings[q][1]);
    else if (scene == RX_SCENE_PLATEAU)
        set_quantity(dst, plateau[q][0], "sigma", 4, 0, plateau[q][1]);
    else
        growth_quantity(q, dst);
}

/* --- where things are --- */

/* The tiles of one scene under one condition. */
typedef struct set {
    rx_scene_id scene;
    double fwhm, mpixels;
    long n; /* objects */
    const rx_lab_table *object, *wrong;
} set;

static set set_of(const rx_lab *r, int condition, int scene)
{
    const rx_lab_table *table = rx_lab_set_of(r, condition, scene)->table;
    const rx_scene_id id = r->scene[scene].id;
    set s = {.scene = id,
             .fwhm = r->sky[condition].fwhm,
             .n = table[rx_detection_table(id)].n,
             .object = &table[rx_detection_table(id)],
             .wrong = &table[RX_DETECTION_FALSE]};
    for (long t = 0; t < table[RX_DETECTION_TILE].n; t++)
        s.mpixels += rx_lab_own(&table[RX_DETECTION_TILE], t)[RX_TILE_MPIXELS];
    return s;
}

/* Of a detection of an object; NAN, not found, is below every score. */
static double score_of(const set *s, long i, int run)
{
    return rx_lab_each(s->object, i, run)[RX_FOUND_SCORE];
}

/* False detections of a run with at least that score, and so far from an object. */
static long false_in(const set *s, int run, double score, double low, double high)
{
    long n = 0;
    for (long i = 0; i < s->wrong->n; i++) {
        const double *v = rx_lab_own(s->wrong, i);
        n += v[RX_FALSE_RUN] == run && v[RX_FALSE_SCORE] >= score && v[RX_FALSE_DISTANCE] >= low &&
             v[RX_FALSE_DISTANCE] < high;
    }
    return n;
}

static long nfalse_of(const set *s, int run)
{
    return false_in(s, run, -HUGE_VAL, -HUGE_VAL, HUGE_VAL);
}

static rx_detection_cell *cell_at(const rx_detection_numbers *m, int condition, int scene, int column)
{
    return &m->cell[((size_t)condition * (size_t)m->lab->nscenes + (size_t)scene) * (size_t)m->ncolumns +
                    (size_t)column];
}

const rx_detection_cell *rx_detection_cell_of(const rx_detection_numbers *m, int condition, int scene,
                                              int column)
{
    return cell_at(m, condition, scene, column);
}

const rx_detection_duel *rx_detection_duel_of(const rx_detection_numbers *m, int condition, int scene,
                                              int rival)
{
    return &m->duel[(condition * m->lab->nscenes + scene) * 4 + rival];
}

const char *rx_detection_column_name(const rx_detection_numbers *m, int column)
{
    return column < 0 ? "" : column < m->lab->nruns ? m->lab->run[column].name : "RL";
}

/* --- precision and recall --- */

/* The curve of a scene of a condition, or (scene -1) of all that are lists; *objects of them. */
static rx_status curve_of(const rx_lab *r, int condition, int scene, int method, long *objects, rx_pr *dst,
                          rx_error *err)
{
    const int first = scene < 0 ? 0 : scene, last = scene < 0 ? r->nscenes - 1 : scene;
    size_t room = 1;
    long n = 0;
    *objects = 0;
    for (int s = first; s <= last; s++) {
        const set one = set_of(r, condition, s);
        if (rx_scene_is_list(one.scene)) {
            room += (size_t)(one.n + one.wrong->n);
            *objects += one.n;
        }
    }
    double *score = RX_NEW(double, room);
    unsigned char *right = RX_NEW(unsigned char, room);
    rx_status status = score == NULL || right == NULL ? rx_error_memory(err, room * sizeof *score) : RX_OK;
    for (int s = first; s <= last && status == RX_OK; s++) {
        const set one = set_of(r, condition, s);
        if (!rx_scene_is_list(one.scene))
            continue;
        for (long i = 0; i < one.n; i++)
            if (!isnan(score_of(&one, i, method))) {
                right[n] = 1;
                score[n++] = score_of(&one, i, method);
            }
        for (long i = 0; i < one.wrong->n; i++)
            if (rx_lab_own(one.wrong, i)[RX_FALSE_RUN] == method)
                score[n++] = rx_lab_own(one.wrong, i)[RX_FALSE_SCORE]; /* right: 0 */
    }
    if (status == RX_OK)
        status = rx_pr_make(n, score, right, *objects, dst, err);
    free(score);
    free(right);
    return status;
}

/* The lowest score at which precision is at least the wanted one. */
static double cut_of(const rx_pr *pr, double wanted)
{
    for (long k = pr->n - 1; k >= 0; k--)
        if (pr->point[k].precision >= wanted)
            return pr->point[k].score;
    return HUGE_VAL;
}

/* Objects of an S/N found with that score. */
static rx_estimate recall_of(const set *set, int method, double score, double low, double high)
{
    long n = 0, found = 0;
    for (long i = 0; i < set->n; i++) {
        const double snr = rx_lab_own(set->object, i)[RX_OBJECT_SNR];
        if (snr < low || snr >= high)
            continue;
        n++;
        found += score_of(set, i, method) >= score;
    }
    return rx_binomial_interval(found, n, LEVEL);
}

static rx_status measure_list(const rx_lab *r, int condition, int scene, int method, uint64_t seed,
                              rx_estimate *dst, rx_error *err)
{
    const set own = set_of(r, condition, scene), *set = &own;
    rx_pr pr = {0};
    long objects = 0;
    rx_status status = curve_of(r, condition, scene, method, &objects, &pr, err);
    if (status == RX_OK)
        status = rx_pr_interval(&pr, objects, LEVEL, (rx_resampling){seed, 1}, dst++, err);
    double first = -HUGE_VAL;
    for (int p = 0; p < r->nprecisions && status == RX_OK; p++) {
        const double cut = cut_of(&pr, r->precision[p]);
        first = p == 0 ? cut : first;
        *dst++ = recall_of(set, method, cut, 0, HUGE_VAL);
    }
    if (status == RX_OK) {
        *dst = recall_of(set, method, -HUGE_VAL, 0, HUGE_VAL);
        const long found = (long)floor(dst->value * (double)dst->n + 0.5), nfalse = nfalse_of(set, method);
        *++dst = rx_binomial_interval(found, found + nfalse, LEVEL);
        *++dst = rx_poisson_rate(nfalse, set->mpixels, LEVEL);
        for (int b = 0; b < SNR_BINS; b++)
            *++dst = recall_of(set, method, first, SNR_EDGE[b], SNR_EDGE[b + 1]);
    }
    rx_pr_free(&pr);
    return status;
}

/* --- the other scenes --- */

static rx_estimate resolved(const set *set, int method, double score, double low, double high)
{
    long n = 0, found = 0;
    for (long i = 0; i < set->n; i++) {
        const double apart = rx_lab_own(set->object, i)[RX_OBJECT_APART];
        if (apart < low || apart >= high)
            continue;
        n++;
        found += score_of(set, i, method) >= score;
    }
    return rx_binomial_interval(found, n, LEVEL);
}

static void measure_rings(const set *set, int method, double cut, rx_estimate *dst)
{
    const double unit = 1e-6 * M_PI * set->fwhm * set->fwhm * (double)set->n;
    for (int b = 0; b < RING_BINS; b++)
        *dst++ = rx_poisson_rate(false_in(set, method, cut, RING_EDGE[b], RING_EDGE[b + 1]),
                                 unit * (RING_EDGE[b + 1] * RING_EDGE[b + 1] - RING_EDGE[b] * RING_EDGE[b]),
                                 LEVEL);
    *dst++ = rx_poisson_rate(false_in(set, method, -HUGE_VAL, 0, RING_EDGE[RING_BINS]),
                             unit * RING_EDGE[RING_BINS] * RING_EDGE[RING_BINS], LEVEL);
    *dst = recall_of(set, method, -HUGE_VAL, 0, HUGE_VAL);
}

static void measure_plateau(const set *set, int method, rx_estimate *dst)
{
    for (int q = 0; q < 3; q++) {
        dst[q] = (rx_estimate){-HUGE_VAL, HUGE_VAL, -HUGE_VAL, set->n};
        for (long i = 0; i < set->n; i++) {
            const double v = rx_lab_each(set->object, i, method)[q];
            dst[q].low = fmin(dst[q].low, v);
            dst[q].value = dst[q].high = fmax(dst[q].high, v);
        }
    }
}

/* Mean of the measured over the mean of the true flux, bootstrap over galaxies. */
static rx_status stacked(const set *set, int method, int q, uint64_t seed, double *work, rx_estimate *dst,
                         rx_error *err)
{
    const int part = q % 4;
    const double low = FAINT_EDGE[q / 4], high = FAINT_EDGE[q / 4 + 1];
    double truth = 0, *zero = work + set->n;
    long n = 0;
    *dst = (rx_estimate){NAN, NAN, NAN, 0};
    for (long i = 0; i < set->n; i++) {
        const double *v = rx_lab_each(set->object, i, method), *t = v + RX_OUTSKIRT_RADII;
        const double snr = rx_lab_own(set->object, i)[RX_OBJECT_SNR];
        if (snr < low || snr >= high)
            continue;
        zero[n] = 0;
        work[n++] = part < RX_OUTSKIRT_RADII ? v[part] : (double)((float)v[2] - (float)v[1]);
        truth += part < RX_OUTSKIRT_RADII ? t[part] : (double)((float)t[2] - (float)t[1]);
    }
    if (n == 0)
        return RX_OK;
    for (long i = 0; i < n; i++)
        work[i] *= (double)n / truth;
    return rx_paired_bootstrap(n, work, zero, LEVEL, seed, dst, err);
}

static rx_status measure_outskirts(const set *set, int method, uint64_t seed, rx_estimate *dst, rx_error *err)
{
    double *work = RX_NEW(double, 2 * (size_t)set->n + 1);
    rx_status status = work == NULL ? rx_error_memory(err, (size_t)set->n * sizeof *work) : RX_OK;
    for (int q = 0; q < 4 * FAINT_BINS && status == RX_OK; q++)
        status = stacked(set, method, q, seed, work, &dst[q], err);
    free(work);
    return status;
}

/* --- all of it --- */

/* Cuts for every precision over the lists of a condition, and ap; no list: the whole. */
static rx_status cuts_of(const rx_lab *r, int condition, int method, double *cuts, double *ap, rx_error *err)
{
    rx_pr pr = {0};
    long objects = 0;
    rx_status status = curve_of(r, condition, -1, method, &objects, &pr, err);
    for (int p = 0; p < r->nprecisions && status == RX_OK; p++)
        cuts[p] = objects > 0 ? cut_of(&pr, r->precision[p]) : -HUGE_VAL;
    *ap = objects > 0 ? pr.ap.value : NAN;
    rx_pr_free(&pr);
    return status;
}

static rx_status measure_cell(rx_detection_numbers *m, int condition, int scene, int method,
                              const double *cuts, uint64_t seed, rx_error *err)
{
    const rx_lab *r = m->lab;
    const set own = set_of(r, condition, scene), *set = &own;
    rx_estimate *dst = cell_at(m, condition, scene, method)->value;
    const double first = r->nprecisions > 0 ? cuts[0] : -HUGE_VAL;
    const double last = r->nprecisions > 0 ? cuts[r->nprecisions - 1] : -HUGE_VAL;
    if (rx_scene_is_list(set->scene))
        return measure_list(r, condition, scene, method, seed, dst, err);
    if (set->scene == RX_SCENE_OUTSKIRTS)
        return measure_outskirts(set, method, seed, dst, err);
    if (set->scene == RX_SCENE_PAIRS) {
        dst[0] = resolved(set, method, first, 0, HUGE_VAL);
        dst[1] = resolved(set, method, first, 0, CLOSE);
        dst[2] = resolved(set, method, first, CLOSE, HUGE_VAL);
        dst[3] = resolved(set, method, -HUGE_VAL, 0, HUGE_VAL);
    } else if (set->scene == RX_SCENE_BLANK) {
        dst[0] = rx_poisson_rate(false_in(set, method, last, -HUGE_VAL, HUGE_VAL), set->mpixels, LEVEL);
        dst[1] = rx_poisson_rate(nfalse_of(set, method), set->mpixels, LEVEL);
    } else if (set->scene == RX_SCENE_RINGS) {
        measure_rings(set, method, last, dst);
    } else {
        measure_plateau(set, method, dst);
    }
    return RX_OK;
}

/* The column of RL at its best; `chosen`: the setting of the highest ap over the condition's lists. */
static void fill_best(rx_detection_numbers *m, int condition, int chosen)
{
    const rx_lab *r = m->lab;
    for (int s = 0; s < r->nscenes; s++) {
        rx_detection_cell *best = cell_at(m, condition, s, m->best);
        const rx_scene_id scene = r->scene[s].id;
        for (int q = 0; q < rx_quantity_count(r, scene); q++) {
            rx_quantity quantity;
            int from = chosen;
            rx_quantity_get(r, scene, q, &quantity);
            for (int k = 0; k < r->nruns && quantity.best; k++)
                if (r->run[k].tuned && cell_at(m, condition, s, k)->value[q].value >
                                           cell_at(m, condition, s, from)->value[q].value)
                    from = k;
            best->value[q] = cell_at(m, condition, s, from)->value[q];
            snprintf(best->chosen[q], sizeof best->chosen[q], "%s", r->run[from].name);
        }
    }
}

static rx_status measure_condition(rx_detection_numbers *m, int condition, uint64_t seed, rx_error *err)
{
    const rx_lab *r = m->lab;
    double highest = -1;
    int chosen = -1;
    rx_status status = RX_OK;
    for (int k = 0; k < r->nruns && status == RX_OK; k++) {
        double cuts[RX_PRECISIONS_MAX], ap;
        status = cuts_of(r, condition, k, cuts, &ap, err);
        if (r->run[k].tuned && (chosen < 0 || ap > highest)) {
            chosen = k;
            highest = ap;
        }
        for (int s = 0; s < r->nscenes && status == RX_OK; s++)
            status = measure_cell(m, condition, s, k, cuts, seed, err);
    }
    if (status == RX_OK && m->best >= 0)
        fill_best(m, condition, chosen);
    return status;
}

/* The method behind a column, where it is RL at its best: its setting for the recall at the first precision.
 */
static int method_behind(const rx_detection_numbers *m, int condition, int scene, int column)
{
    if (column != m->best)
        return column;
    for (int k = 0; k < m->lab->nruns; k++)
        if (strcmp(m->lab->run[k].name, cell_at(m, condition, scene, column)->chosen[1]) == 0)
            return k;
    return -1;
}

static rx_status fight(rx_detection_numbers *m, int condition, int scene, int rival, rx_error *err)
{
    const rx_lab *r = m->lab;
    const set own = set_of(r, condition, scene), *set = &own;
    rx_detection_duel *dst = &m->duel[(condition * r->nscenes + scene) * 4 + rival];
    const int method[2] = {method_behind(m, condition, scene, m->hero),
                           method_behind(m, condition, scene, m->rival[rival])};
    double cut[2] = {0};
    rx_status status = RX_OK;
    for (int k = 0; k < 2 && status == RX_OK; k++) {
        rx_pr pr = {0};
        long objects;
        status = curve_of(r, condition, scene, method[k], &objects, &pr, err);
        cut[k] = cut_of(&pr, r->precision[0]);
        rx_pr_free(&pr);
    }
    for (long i = 0; i < set->n && status == RX_OK; i++) {
        const int first = score_of(set, i, method[0]) >= cut[0],
                  second = score_of(set, i, method[1]) >= cut[1];
        dst->only_first += first && !second;
        dst->only_second += second && !first;
    }
    dst->p = rx_mcnemar(dst->only_first, dst->only_second);
    return status;
}

static void choose_columns(rx_detection_numbers *m)
{
    const rx_lab *r = m->lab;
    m->best = m->net = m->matched = m->none = -1;
    for (int k = 0; k < r->nruns; k++) {
        m->best = r->run[k].tuned ? r->nruns : m->best;
        m->net = strcmp(r->run[k].name, "NET") == 0 ? k : m->net;
        m->matched = strcmp(r->run[k].name, "MATCHED") == 0 ? k : m->matched;
        m->none = strcmp(r->run[k].name, "NONE") == 0 ? k : m->none;
    }
    m->ncolumns = r->nruns + (m->best >= 0);
    m->hero = m->net >= 0 ? m->net : m->best;
    const int rivals[] = {m->none, m->matched, m->best};
    for (int i = 0; i < 3 && m->hero >= 0; i++)
        if (rivals[i] >= 0 && rivals[i] != m->hero)
            m->rival[m->nrivals++] = rivals[i];
}

rx_status rx_detection_numbers_make(const rx_lab *lab, uint64_t seed, rx_detection_numbers *dst,
                                    rx_error *err)
{
    const size_t sets = (size_t)lab->nconditions * (size_t)lab->nscenes;
    *dst = (rx_detection_numbers){.lab = lab};
    choose_columns(dst);
    dst->cell = RX_NEW(rx_detection_cell, sets * (size_t)dst->ncolumns);
    dst->duel = RX_NEW(rx_detection_duel, sets * 4);
    rx_status status = RX_OK;
    if (dst->cell == NULL || dst->duel == NULL)
        status = rx_error_memory(err, sets * (size_t)dst->ncolumns * sizeof *dst->cell);
    for (int c = 0; c < lab->nconditions && status == RX_OK; c++) {
        status = measure_condition(dst, c, seed, err);
        for (int s = 0; s < lab->nscenes; s++)
            for (int k = 0; k < dst->nrivals && status == RX_OK; k++)
                if (lab->nprecisions > 0 && rx_scene_is_list(lab->scene[s].id))
                    status = fight(dst, c, s, k, err);
    }
    if (status != RX_OK)
        rx_detection_numbers_free(dst);
    return status;
}

void rx_detection_numbers_free(rx_detection_numbers *m)
{
    free(m->cell);
    free(m->duel);
    *m = (rx_detection_numbers){0};
}
