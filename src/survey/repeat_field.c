/* Visits of a field: matched, put on one scale, compared. */
#include "survey/repeat_field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "io/output.h"
#include "quality/match.h"
#include "quality/sample.h"

static const double LEVEL = 0.95, CLEAR = 20, FAINT = 5, MARGIN = 3, SHIFT = 10, MAGS = 1.0857362047581296;

/* One visit against another one. */
typedef struct match {
    const rx_visit *a, *b;
    long *to_b, *to_a;
} match;

static bool is_star(const rx_repeat_field *f, const rx_visit *v, long i)
{
    return f->columns.star[0] == '\0' || v->star[i] >= f->config->repeat_star;
}

/* 1 and 0 where both visits agree. */
static int star_of(const rx_repeat_field *f, const match *m, long i)
{
    const int a = is_star(f, m->a, i), b = is_star(f, m->b, m->to_b[i]);
    return a == b ? a : 2;
}

static rx_status match_shifted(const rx_repeat_field *f, match *m, double dx, double dy, rx_error *err)
{
    double *x = RX_NEW(double, 2 * (size_t)m->b->n + 1), *y = x + m->b->n;
    if (x == NULL)
        return rx_error_memory(err, 0);
    for (long i = 0; i < m->b->n; i++) {
        x[i] = m->b->x[i] - dx;
        y[i] = m->b->y[i] - dy;
    }
    const rx_match_list a = {m->a->n, m->a->x, m->a->y, NULL}, b = {m->b->n, x, y, NULL};
    const rx_status status = rx_match(&a, &b, f->config->match_radius, m->to_b, m->to_a, err);
    free(x);
    return status;
}

static long count_matches(const match *m)
{
    long n = 0;
    for (long i = 0; i < m->a->n; i++)
        n += m->to_b[i] >= 0;
    return n;
}

/* The least S/N of both measurements; NAN where one has no magnitude. */
static double snr_of(const match *m, long i)
{
    const double a = m->a->error[i], b = m->b->error[m->to_b[i]];
    return isfinite(a) && isfinite(b) ? MAGS / fmax(a, b) : NAN;
}

/* Which matches show zero point and offset: point sources, the brightest of which there are enough. */
static bool shows(const rx_repeat_field *f, const match *m, long i, int attempt)
{
    const double least[] = {f->config->repeat_snr, CLEAR, CLEAR, 0};
    return m->to_b[i] >= 0 && m->a->flags[i] == 0 && m->b->flags[m->to_b[i]] == 0 &&
           snr_of(m, i) >= least[attempt] && (attempt > 1 || star_of(f, m, i) == 1);
}

static void find_offsets(const rx_repeat_field *f, const match *m, double *room, rx_repeat_couple *dst)
{
    double *const values[] = {room, room + m->a->n, room + 2 * m->a->n};
    double median[3], sigma[3];
    long n = 0;
    for (int attempt = 0; attempt < 4 && n < RX_REPEAT_FEW; attempt++) {
        n = 0;
        for (long i = 0; i < m->a->n; i++)
            if (shows(f, m, i, attempt)) {
                const long k = m->to_b[i];
                values[0][n] = m->b->mag[k] - m->a->mag[i];
                values[1][n] = m->b->x[k] - m->a->x[i];
                values[2][n++] = m->b->y[k] - m->a->y[i];
            }
    }
    for (int k = 0; k < 3 && n > 0; k++)
        sigma[k] = rx_sample_sigma(values[k], n, &median[k]);
    dst->zero_point = n > 0 ? median[0] : NAN;
    dst->zero_point_error = n > 1 ? 1.2533 * sigma[0] / sqrt((double)n) : NAN;
    dst->dx = n > 0 ? median[1] : 0;
    dst->dy = n > 0 ? median[2] : 0;
}

static rx_status add_pairs(rx_repeat_field *f, const match *m, rx_repeat_couple *c, rx_error *err)
{
    c->from = f->npairs;
    RX_TRY(RX_GROW(f->pair, (size_t)(f->npairs + c->matched) + 1, err));
    for (long i = 0; i < m->a->n; i++) {
        const long k = m->to_b[i];
        if (k < 0 || m->a->flags[i] != 0 || m->b->flags[k] != 0)
            continue;
        const double mag[] = {m->a->mag[i], m->b->mag[k]}, error[] = {m->a->error[i], m->b->error[k]};
        rx_repeat_pair p = {.x = m->a->x[i],
                            .y = m->a->y[i],
                            .dx = m->b->x[k] - m->a->x[i] - c->dx,
                            .dy = m->b->y[k] - m->a->y[i] - c->dy,
                            .star = star_of(f, m, i)};
        if (rx_repeat_photometry(mag, error, c->zero_point, &p))
            f->pair[f->npairs++] = p;
    }
    c->used = f->npairs - c->from;
    return RX_OK;
}

/* Sources of `v` that another visit sees: one with a magnitude, not saturated and not cut by the border. */
static rx_status add_trials(rx_repeat_field *f, const rx_visit *v, const unsigned char *seen,
                            const long *partner, double zero_point, rx_repeat_couple *c, rx_error *err)
{
    for (int k = 0; k < RX_REPEAT_POPULATIONS; k++) {
        RX_TRY(RX_GROW(f->trials[k].mag, (size_t)(f->trials[k].n + v->n) + 1, err));
        RX_TRY(RX_GROW(f->trials[k].found, (size_t)(f->trials[k].n + v->n) + 1, err));
    }
    for (long i = 0; i < v->n; i++) {
        if (!seen[i] || v->flags[i] >= 4 || !isfinite(v->mag[i]))
            continue;
        rx_repeat_trials *t = &f->trials[!is_star(f, v, i)];
        t->mag[t->n] = v->mag[i] - zero_point;
        t->found[t->n++] = partner[i] >= 0;
        c->seen++;
        c->found += partner[i] >= 0;
    }
    return RX_OK;
}

/* zero_points[]: of each visit on the scale of the first. */
static rx_status compare(rx_repeat_field *f, int first, int second, double *zero_points, rx_log *log,
                         rx_error *err)
{
    match m = {.a = &f->visit[first], .b = &f->visit[second]};
    rx_repeat_couple c = {.first = first, .second = second};
    unsigned char *seen[2] = {NULL, NULL};
    double *room = NULL;
    long seen_any = 0;
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(m.to_b, (size_t)m.a->n + 1, err));
    RX_TRY_EXIT(RX_MAKE(m.to_a, (size_t)m.b->n + 1, err));
    RX_TRY_EXIT(RX_MAKE(seen[0], (size_t)m.a->n + 1, err));
    RX_TRY_EXIT(RX_MAKE(seen[1], (size_t)m.b->n + 1, err));
    RX_TRY_EXIT(RX_MAKE(room, 3 * (size_t)m.a->n + 1, err));
    RX_TRY_EXIT(rx_visit_sees(m.b, m.a, MARGIN * f->config->match_radius, seen[0], err));
    RX_TRY_EXIT(rx_visit_sees(m.a, m.b, MARGIN * f->config->match_radius, seen[1], err));
    for (long i = 0; i < m.a->n; i++)
        seen_any += seen[0][i];
    for (long i = 0; i < m.b->n; i++)
        seen_any += seen[1][i];
    if (seen_any == 0)
        goto exit;
    RX_TRY_EXIT(match_shifted(f, &m, SHIFT * f->config->match_radius, 0, err));
    c.chance = count_matches(&m);
    /* what lies farther off than the radius is not seen; what is nearer is taken off, and all is matched again */
    RX_TRY_EXIT(match_shifted(f, &m, 0, 0, err));
    find_offsets(f, &m, room, &c);
    RX_TRY_EXIT(match_shifted(f, &m, c.dx, c.dy, err));
    find_offsets(f, &m, room, &c);
    c.matched = count_matches(&m);
    if (first == 0 && isfinite(c.zero_point))
        zero_points[second] = c.zero_point;
    RX_TRY_EXIT(add_pairs(f, &m, &c, err));
    RX_TRY_EXIT(add_trials(f, m.a, seen[0], m.to_b, zero_points[first], &c, err));
    RX_TRY_EXIT(add_trials(f, m.b, seen[1], m.to_a, zero_points[second], &c, err));
    RX_TRY_EXIT(RX_GROW(f->couple, (size_t)f->ncouples + 1, err));
    f->couple[f->ncouples++] = c;
    rx_log_info(log,
                "%s against %s: %ld matches within %g arcsec; zero point %+.4f +- %.4f mag and positions "
                "%+.1f, %+.1f mas (east, north) are taken off",
                m.b->name, m.a->name, c.matched, f->config->match_radius, c.zero_point, c.zero_point_error,
                1e3 * c.dx, 1e3 * c.dy);
exit:
    free(room);
    free(seen[0]);
    free(seen[1]);
    free(m.to_b);
    free(m.to_a);
    return status;
}

static rx_status measure(const rx_repeat_field *f, int visits, rx_repeat_couple *c, rx_error *err)
{
    rx_repeat_cut cut = {.snr_low = f->config->repeat_snr,
                         .snr_high = INFINITY,
                         .star = 1,
                         .outlier = 1e-3 * f->config->repeat_outlier,
                         .visits = visits};
    RX_TRY(rx_repeat_measure(&cut, c->used, f->pair + c->from, &c->bright, err));
    if (c != &f->all) /* separations are those of one and the same pair of visits */
        RX_TRY(rx_repeat_separations(&cut, c->used, f->pair + c->from, &c->bright, err));
    cut.snr_low = FAINT;
    return rx_repeat_measure(&cut, c->used, f->pair + c->from, &c->points, err);
}

static rx_status measure_all(rx_repeat_field *f, rx_error *err)
{
    double *am1 = RX_NEW(double, (size_t)f->ncouples + 1);
    long n = 0;
    if (am1 == NULL)
        return rx_error_memory(err, 0);
    rx_status status = RX_OK;
    f->all = (rx_repeat_couple){
        .used = f->npairs, .zero_point = NAN, .zero_point_error = NAN, .dx = NAN, .dy = NAN};
    for (int i = 0; i < f->ncouples && status == RX_OK; i++) {
        rx_repeat_couple *c = &f->couple[i];
        status = measure(f, 2, c, err);
        f->all.matched += c->matched;
        f->all.chance += c->chance;
        f->all.seen += c->seen;
        f->all.found += c->found;
        if (isfinite(c->bright.separation))
            am1[n++] = c->bright.separation;
    }
    if (status == RX_OK)
        status = measure(f, f->nvisits, &f->all, err);
    for (int i = 0; i < f->ncouples && status == RX_OK; i++)
        f->all.bright.separations += f->couple[i].bright.separations;
    f->all.bright.separation = n > 0 ? rx_sample_quantile(am1, n, 0.5) : NAN;
    free(am1);
    return status;
}

static rx_status find_completeness(rx_repeat_field *f, rx_error *err)
{
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < RX_REPEAT_POPULATIONS; k++)
        for (long i = 0; i < f->trials[k].n; i++) {
            low = fmin(low, floor(2 * f->trials[k].mag[i]) / 2);
            high = fmax(high, floor(2 * f->trials[k].mag[i]) / 2 + 0.5);
        }
    if (!(low < high))
        return RX_OK;
    const double width = 0.5 * ceil(2 * (high - low) / RX_MAX_BINS);
    while (f->bins.edge[0] = low, low + f->bins.n * width < high)
        f->bins.n++;
    for (int i = 0; i <= f->bins.n; i++)
        f->bins.edge[i] = low + i * width;
    for (int k = 0; k < RX_REPEAT_POPULATIONS; k++) {
        const rx_found list = {f->trials[k].n, f->trials[k].mag, f->trials[k].found};
        for (int half = 0; half < 2; half++)
            RX_TRY(
                rx_completeness(&f->bins, &list, half ? 0.5 : 0.9, LEVEL,
                                (rx_resampling){.seed = 1, .nthreads = 1, .stream = (uint64_t)(2 * k + half)},
                                half ? &f->mag50[k] : &f->mag90[k], err));
    }
    return RX_OK;
}

static rx_status check(const rx_survey_config *config, const rx_file_names *names, rx_error *err)
{
    if (names->n < 2)
        return rx_error_set(err, RX_USAGE,
                            "REPEAT compares visits of one field, %d %s named; give two catalogues or more",
                            names->n, names->n == 1 ? "catalogue is" : "catalogues are");
    for (int i = 0; i < names->n; i++)
        for (int k = 0; k < i; k++)
            if (strcmp(names->of[i], names->of[k]) == 0)
                return rx_error_set(err, RX_USAGE, "%s is named twice; give each visit once", names->of[i]);
    if (config->weight_image.n > 0 && config->weight_image.n != names->n)
        return rx_error_set(
            err, RX_USAGE,
            "WEIGHT_IMAGE has %d of %d names; give a map, or NONE, for each catalogue, in their order",
            config->weight_image.n, names->n);
    return RX_OK;
}

rx_status rx_repeat_field_make(const rx_survey_config *config, const rx_file_names *names, rx_log *log,
                               rx_repeat_field *f, rx_error *err)
{
    double *zero_points = NULL;
    *f = (rx_repeat_field){.config = config};
    RX_TRY(check(config, names, err));
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(f->visit, (size_t)names->n, err));
    RX_TRY_EXIT(RX_MAKE(zero_points, (size_t)names->n, err));
    RX_TRY_EXIT(rx_visit_columns_find(config, names->of[0], &f->columns, err));
    for (int i = 0; i < names->n; i++) {
        const char *weight = config->weight_image.n > 0 ? config->weight_image.v[i] : "NONE";
        f->nvisits = i + 1;
        RX_TRY_EXIT(rx_visit_read(names->of[i], strcmp(weight, "NONE") == 0 ? NULL : weight, &f->columns,
                                  &f->visit[i], err));
        RX_TRY_EXIT(rx_visit_project(&f->visit[0], &f->visit[i], err));
        RX_TRY_EXIT(rx_interrupt_check(err));
    }
    if (f->columns.star[0] == '\0')
        rx_log_warning(
            log, "no column distinguishes point sources (CLASS_TEMPLATE, CLASS_STAR): all sources count as "
                 "point sources");
    for (int i = 0; i < f->nvisits; i++)
        for (int k = i + 1; k < f->nvisits; k++) {
            RX_TRY_EXIT(compare(f, i, k, zero_points, log, err));
            RX_TRY_EXIT(rx_interrupt_check(err));
        }
    if (f->ncouples == 0)
        RX_TRY_EXIT(rx_error_set(
            err, RX_INPUT, "none of the %d visits sees a source of another one; give visits that overlap",
            f->nvisits));
    if (f->npairs == 0)
        RX_TRY_EXIT(
            rx_error_set(err, RX_INPUT,
                         "the visits overlap, but no source with FLAGS 0 and a magnitude is within %g "
                         "arcsec of one in another visit; give a larger MATCH_RADIUS, or visits whose "
                         "positions agree",
                         config->match_radius));
    RX_TRY_EXIT(measure_all(f, err));
    status = find_completeness(f, err);
exit:
    free(zero_points);
    return status;
}

void rx_repeat_field_free(rx_repeat_field *f)
{
    for (int i = 0; i < f->nvisits; i++)
        rx_visit_free(&f->visit[i]);
    for (int k = 0; k < RX_REPEAT_POPULATIONS; k++) {
        free(f->trials[k].mag);
        free(f->trials[k].found);
    }
    free(f->visit);
    free(f->couple);
    free(f->pair);
    *f = (rx_repeat_field){0};
}

rx_status rx_repeat_files(const rx_survey_config *config, const char *given, rx_log *log, rx_error *err)
{
    rx_file_names names;
    rx_repeat_field field = {0};
    rx_outputs *outputs = NULL;
    const char *folder = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_file_names_read(given, &names, err));
    RX_TRY_EXIT(rx_outputs_new(&outputs, err));
    RX_TRY_EXIT(rx_outputs_folder(outputs, config->output_name, &folder, err));
    RX_TRY_EXIT(rx_repeat_field_make(config, &names, log, &field, err));
    RX_TRY_EXIT(rx_repeat_report(&field, folder, log, err));
    RX_TRY_EXIT(rx_outputs_commit(outputs, err));
    rx_outputs_log(outputs, NULL, log);
exit:
    rx_outputs_free(outputs);
    rx_repeat_field_free(&field);
    rx_file_names_free(&names);
    return status;
}
