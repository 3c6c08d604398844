/* The report of a campaign of any kind. */
#include "lab/findings.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "report/page.h"

static const rx_report_column CELLS[] = {
    {.name = "scene", .help = "what was on the tiles"},
    {.name = "condition", .help = "seeing, magnitude, or what restorers were given wrong"},
    {.name = "run", .help = "restorer or method"},
    {.name = "quantity", .help = "what was measured"},
    {.name = "value", .kind = RX_REPORT_ESTIMATE, .help = "of the quantity"},
    {.name = "setting", .help = "the best of several settings: which one it is"},
};

static const rx_report_column CONTESTS[] = {
    {.name = "scene"},
    {.name = "condition"},
    {.name = "quantity", .help = "what is compared"},
    {.name = "first", .help = "run"},
    {.name = "second", .help = "run"},
    {.name = "test"},
    {"difference", RX_REPORT_ESTIMATE, 3, "", "first - second", NULL},
    {"statistic", RX_REPORT_NUMBER, 2, "", "", NULL},
    {"dof", RX_REPORT_NUMBER, 0, "", "degrees of freedom", NULL},
    {"p", RX_REPORT_P, 0, "", "two-sided", NULL},
    {"holm", RX_REPORT_P, 0, "", "p adjusted for the conditions", NULL},
    {.name = "winner", .help = "where the adjusted p is below 0.05"},
    {"effect", RX_REPORT_NUMBER, 2, "", "size of the effect: d_z of paired t, Cohen's d of two samples",
     NULL},
    {"only_first", RX_REPORT_NUMBER, 0, "", "things that only the first found", NULL},
    {"only_second", RX_REPORT_NUMBER, 0, "", "things that only the second found", NULL},
};

static const rx_report_column CLAIMS[] = {
    {.name = "claim"},
    {.name = "words", .help = "what is claimed", .heading = "claim or goal"},
    {.name = "place", .help = "where in the paper"},
    {.name = "reproduced_when"},
    {.name = "run", .help = "whose numbers are judged, where it is one", .heading = "restorer"},
    {.name = "verdict", .kind = RX_REPORT_VERDICT},
    {.name = "found", .help = "what was found", .heading = "what was found"},
};

enum {
    NCELLS = sizeof CELLS / sizeof *CELLS,
    NCONTESTS = sizeof CONTESTS / sizeof *CONTESTS,
    NCLAIMS = sizeof CLAIMS / sizeof *CLAIMS
};

static rx_status begin(rx_findings *dst, const rx_lab *lab, const rx_lab_output *output, rx_error *err)
{
    const rx_campaign_record *record = output->record;
    char seed[32], type[16] = "";
    rx_report *r = rx_report_new("Validation: ", record->title);
    *dst = (rx_findings){.output = output, .report = r};
    if (r == NULL)
        return rx_error_memory(err, 0);
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)record->seed);
    for (int i = 0; lab->kind->name[i] != '\0'; i++)
        type[i] = (char)tolower((unsigned char)lab->kind->name[i]);
    rx_report_fact(r, "format", "rextract-campaign 2");
    rx_report_fact(r, "type", type);
    rx_report_fact(r, "title", record->title);
    rx_report_fact(r, "command", record->command.data);
    rx_report_fact(r, "seed", seed);
    rx_report_fact_number(r, "interval_level", 0.95);
    rx_report_fact(r, "about", lab->about[0] != '\0' ? lab->about : NULL);
    dst->claims = rx_report_table_add(r, "claims", NCLAIMS, CLAIMS, RX_REPORT_IN_JSON);
    if (!lab->kind->fluxes) {
        dst->cells = rx_report_table_add(r, "cells", NCELLS, CELLS, RX_REPORT_EVERYWHERE);
        dst->contests = rx_report_table_add(r, "contests", NCONTESTS, CONTESTS, RX_REPORT_EVERYWHERE);
    }
    return RX_OK;
}

static void show_claims(rx_findings *f, int ncolumns, const char *const *columns)
{
    rx_report_show(
        f->report, f->claims,
        &(rx_report_view){.to = rx_report_rows(f->claims), .ncolumns = ncolumns, .columns = columns});
}

static void show_verdicts(rx_findings *f, const rx_claim_verdicts *verdicts, const rx_lab_run *runs)
{
    static const char *const claimed[] = {"words", "verdict"}, *const found[] = {"claim", "verdict", "found"};
    static const char *const goals[] = {"words", "run", "verdict", "found"};
    int count[RX_CLAIM_STATES] = {0};
    char word[32], sentence[160];
    for (int i = 0; i < verdicts->n; i++) {
        const rx_claim_verdict *v = &verdicts->list[i];
        const rx_claim *claim = rx_claim_get(v->claim);
        const char *run = v->run >= 0 ? runs[v->run].name : NULL, *state = rx_claim_state_name(v->state);
        count[v->state]++;
        rx_report_row(f->claims,
                      (rx_cell[]){rx_cell_words(claim->name), rx_cell_words(claim->words),
                                  rx_cell_words(claim->place), rx_cell_words(claim->test), rx_cell_words(run),
                                  rx_cell_words(state), rx_cell_words(v->said.data)});
        rx_text_printf(&f->brief, "%-24s %-8s %-18s %s\n", claim->name, run != NULL ? run : "", state,
                       run != NULL && v->said.data != NULL ? v->said.data : "");
    }
    const int each = verdicts->n > 0 && verdicts->list[0].run >= 0;
    const int broken = count[RX_NOT_REPRODUCED] + count[RX_GOAL_NOT_HELD];
    if (each) {
        snprintf(word, sizeof word, "%d held", count[RX_GOAL_HELD]);
        snprintf(sentence, sizeof sentence, "of %d goals, each for each restorer; %d are not.", verdicts->n,
                 broken);
    } else {
        snprintf(word, sizeof word, "%d reproduced", count[RX_REPRODUCED]);
        snprintf(sentence, sizeof sentence, "of %d claims and goals; %d are not, %d could not be tested.",
                 verdicts->n, broken, count[RX_NOT_YET_TESTABLE] + count[RX_NOT_TESTED]);
    }
    rx_report_verdict(f->report, broken > 0 ? RX_MARK_OPEN : RX_MARK_GOOD, word, sentence);
    rx_report_section(f->report, each ? "goals" : "claims",
                      each ? "Goals" : "The paper's claims, and our goals");
    show_claims(f, each ? 3 : 2, each ? goals : claimed);
    rx_report_fold(f->report, "What was found");
    show_claims(f, each ? 4 : 3, each ? goals : found);
    rx_report_unfold(f->report);
    if (!each)
        rx_report_note(
            f->report,
            "The paper: Jia et al. 2023, MNRAS 527, 6581 (arXiv:2311.00186). NET is its network, RL is "
            "Richardson-Lucy with a Gaussian filter. When a claim counts as reproduced is in summary.json.");
}

void rx_findings_quantities(rx_findings *f, const rx_store *s, int group, int open)
{
    const rx_store_group *g = &s->group[group];
    for (int q = 0; q < g->nquantities; q++) {
        const rx_quantity *quantity = &g->quantity[q];
        const long from = rx_report_rows(f->cells);
        if (q == open)
            rx_report_fold(f->report, "More tables");
        for (int hidden = 0; hidden < 2; hidden++) {
            for (int i = 0; i < g->nconditions * s->ncolumns; i++) {
                const int c = i / s->ncolumns, k = i % s->ncolumns;
                const rx_finding *one = rx_store_at(s, group, q, c, k);
                if (s->hidden[k] == hidden)
                    rx_report_row(f->cells,
                                  (rx_cell[]){rx_cell_words(g->name), rx_cell_words(g->condition[c]),
                                              rx_cell_words(s->column[k]), rx_cell_words(quantity->name),
                                              rx_cell_estimate(one->value), rx_cell_words(one->setting)});
            }
            if (!hidden)
                rx_report_show(f->report, f->cells,
                               &(rx_report_view){.from = from,
                                                 .to = rx_report_rows(f->cells),
                                                 .title = quantity->name,
                                                 .unit = quantity->unit,
                                                 .note = quantity->help,
                                                 .rows = {"condition"},
                                                 .across = {"run"},
                                                 .value = "value",
                                                 .digits = quantity->digits,
                                                 .in_brief = q < open});
        }
    }
    if (g->nquantities > open)
        rx_report_unfold(f->report);
}

static void add_contest(rx_findings *f, const rx_store *s, const rx_contest_place *p, int condition)
{
    const rx_store_group *g = &s->group[p->group];
    const rx_about *about = &s->about[p->about];
    const rx_contest *c = rx_contest_of(s, p->group, p->pair, p->about, condition);
    const char *const names[] = {s->column[s->pair[p->pair][0]], s->column[s->pair[p->pair][1]]};
    const double ln_holm = c->holm == 0.0 ? c->test.ln_p + log(g->nconditions) : log(c->holm);
    rx_report_row(f->contests, (rx_cell[]){rx_cell_words(g->name), rx_cell_words(g->condition[condition]),
                                           rx_cell_words(about->quantity), rx_cell_words(names[0]),
                                           rx_cell_words(names[1]), rx_cell_words(about->test),
                                           rx_cell_estimate(c->test.difference),
                                           rx_cell_number(c->test.statistic), rx_cell_number(c->test.dof),
                                           rx_cell_p(c->test.p, c->test.ln_p), rx_cell_p(c->holm, ln_holm),
                                           rx_cell_words(c->winner == 0 ? NULL : names[c->winner < 0]),
                                           rx_cell_number(c->test.effect), rx_cell_number(c->only_first),
                                           rx_cell_number(c->only_second)});
}

void rx_findings_contests(rx_findings *f, const rx_store *s, int group, const char *things)
{
    static const char *const columns[] = {"condition", "quantity", "test",       "difference",
                                          "statistic", "effect",   "only_first", "only_second",
                                          "p",         "holm",     "winner"};
    for (int pair = 0; pair < s->npairs; pair++) {
        const long from = rx_report_rows(f->contests);
        char title[128];
        for (int a = 0, b; a < s->nabouts; a = b) { /* all tests of one quantity side by side */
            for (b = a + 1; b < s->nabouts && strcmp(s->about[b].quantity, s->about[a].quantity) == 0;)
                b++;
            for (int i = 0; i < s->group[group].nconditions * (b - a); i++)
                add_contest(f, s, &(rx_contest_place){group, pair, a + i % (b - a), NULL, 0}, i / (b - a));
        }
        snprintf(title, sizeof title, "%.40s against %.40s, on the same %s", s->column[s->pair[pair][0]],
                 s->column[s->pair[pair][1]], things);
        rx_report_fold(f->report, title);
        rx_report_show(f->report, f->contests,
                       &(rx_report_view){.from = from,
                                         .to = rx_report_rows(f->contests),
                                         .without_empty = 1,
                                         .ncolumns = sizeof columns / sizeof *columns,
                                         .columns = columns});
        rx_report_unfold(f->report);
    }
}

/* Record and files; frees what findings hold, whatever comes out. */
static rx_status finish(rx_findings *f, rx_status status, rx_error *err)
{
    const rx_campaign_record *record = f->output->record;
    const rx_report_files files = {.folder = f->output->folder,
                                   .shown = f->output->shown,
                                   .figures = record->figures,
                                   .log = f->output->log};
    const char *(*pairs)[2] = NULL;
    rx_text command = {0};
    rx_report_section(f->report, "record", "What made this page");
    rx_text_printf(&command, "Seed %llu; %s", (unsigned long long)record->seed, record->command.data);
    rx_report_sentence(f->report, command.data);
    rx_text_free(&command);
    if (status == RX_OK)
        status = rx_record_list(&record->keywords, &pairs, err);
    if (status == RX_OK)
        rx_report_record(f->report, record->keywords.n, (const char *const(*)[2])pairs);
    rx_text_add(rx_report_brief_of(f->report), f->brief.data != NULL ? f->brief.data : "");
    rx_report_brief_of(f->report)->failed |= f->brief.failed;
    if (status == RX_OK)
        status = rx_report_write(f->report, &files, f->output->brief, err);
    rx_report_free(f->report);
    rx_text_free(&f->brief);
    free(pairs);
    *f = (rx_findings){0};
    return status;
}

rx_status rx_lab_report(const rx_lab *lab, const rx_lab_output *output, rx_error *err)
{
    const rx_lab_results *kind = lab->kind->results;
    rx_store *store = NULL;
    rx_claim_verdicts verdicts;
    rx_findings f;
    RX_TRY(rx_store_make(lab, output->record->seed, &store, err));
    rx_status status = begin(&f, lab, output, err);
    if (status == RX_OK) {
        if (kind->facts != NULL)
            kind->facts(store, f.report);
        rx_claims_judge(store, &verdicts);
        show_verdicts(&f, &verdicts, lab->run);
        rx_claim_verdicts_free(&verdicts);
        if (lab->about[0] != '\0')
            rx_report_sentence(f.report, lab->about);
        status = finish(&f, kind->page(store, &f, err), err);
    }
    rx_store_free(store);
    return status;
}
