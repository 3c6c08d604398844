/* The report of a campaign of any kind. */
#include "lab/findings.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "report/page.h"

RX_COLUMNS(CELLS, RX_TEXT("scene", "what was on the tiles"),
           RX_TEXT("condition", "seeing, magnitude, or what restorers were given wrong"),
           RX_TEXT("run", "restorer or method"), RX_TEXT("quantity", "what was measured"),
           RX_ESTIMATE("value", 0, "", "of the quantity"),
           RX_TEXT("setting", "the best of several settings: which one it is"));

RX_COLUMNS(CONTESTS, RX_TEXT("scene", ""), RX_TEXT("condition", ""), RX_TEXT("quantity", "what is compared"),
           RX_TEXT("first", "run"), RX_TEXT("second", "run"), RX_TEXT("test", ""),
           RX_ESTIMATE("difference", 3, "", "first - second"), RX_NUMBER("statistic", 2, "", ""),
           RX_NUMBER("dof", 0, "", "degrees of freedom"), RX_P("p", "two-sided"),
           RX_P("holm", "p adjusted for the conditions"),
           RX_TEXT("winner", "where the adjusted p is below 0.05"),
           RX_NUMBER("effect", 2, "", "size of the effect: d_z of paired t, Cohen's d of two samples"),
           RX_NUMBER("only_first", 0, "", "things that only the first found"),
           RX_NUMBER("only_second", 0, "", "things that only the second found"));

RX_COLUMNS(CLAIMS, RX_TEXT("claim", ""),
           {.name = "words", .help = "what is claimed", .heading = "claim or goal"},
           RX_TEXT("place", "where in the paper"), RX_TEXT("reproduced_when", ""),
           {.name = "run", .help = "whose numbers are judged, where it is one", .heading = "restorer"},
           {.name = "verdict", .kind = RX_REPORT_VERDICT},
           {.name = "found", .help = "what was found", .heading = "what was found"});

static rx_status begin(rx_findings *dst, const rx_lab *lab, const rx_lab_output *output, rx_error *err)
{
    const rx_campaign_record *record = output->record;
    char seed[32], type[16] = "", title[128];
    const int named = record->name[0] != '\0' && strcmp(record->name, "default") != 0;
    snprintf(title, sizeof title, "%s%s%s", record->title, named ? ", " : "", named ? record->name : "");
    rx_report *r = rx_report_new("Validation: ", title);
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
    dst->claims = RX_REPORT_TABLE(r, "claims", CLAIMS, RX_REPORT_IN_JSON);
    if (!lab->kind->fluxes) {
        dst->cells = RX_REPORT_TABLE(r, "cells", CELLS, RX_REPORT_EVERYWHERE);
        dst->contests = RX_REPORT_TABLE(r, "contests", CONTESTS, RX_REPORT_EVERYWHERE);
    }
    return RX_OK;
}

/* Returns whether each is of one restorer, as goals are. */
static int add_verdicts(rx_findings *f, const rx_claim_verdicts *verdicts, const rx_lab_run *runs)
{
    const int each = verdicts->n > 0 && verdicts->list[0].run >= 0;
    int count[RX_CLAIM_STATES] = {0};
    char word[32], sentence[160];
    for (int i = 0; i < verdicts->n; i++) {
        const rx_claim_verdict *v = &verdicts->list[i];
        const rx_claim *claim = rx_claim_get(v->claim);
        const char *run = v->run >= 0 ? runs[v->run].name : "", *state = rx_claim_state_name(v->state);
        count[v->state]++;
        rx_report_put(f->claims, claim->name, claim->words, claim->place, claim->test, run, state,
                      v->said.data);
        rx_text_printf(&f->brief, "%-24s %-8s %-18s %s\n", claim->name, run, state,
                       each && v->said.data != NULL ? v->said.data : "");
    }
    const int broken = count[RX_NOT_REPRODUCED] + count[RX_GOAL_NOT_HELD];
    const int good = count[RX_REPRODUCED] + count[RX_GOAL_HELD];
    snprintf(word, sizeof word, "%d %s", good, each ? "held" : "reproduced");
    snprintf(sentence, sizeof sentence, "of %d %s; %d are not, %d could not be tested.", verdicts->n,
             each ? "goals, each for each restorer" : "claims and goals", broken,
             count[RX_NOT_YET_TESTABLE] + count[RX_NOT_TESTED] + count[RX_GOAL_NOT_MEASURED]);
    rx_report_verdict(f->report,
                      broken > 0 ? RX_MARK_OPEN
                      : good > 0 ? RX_MARK_GOOD
                                 : RX_MARK_PALE,
                      word, sentence);
    return each;
}

static void show_claims(rx_findings *f, int each)
{
    static const char *const claimed[] = {"words", "verdict"}, *const found[] = {"claim", "verdict", "found",
                                                                                 "run"};
    rx_report_section(f->report, each ? "goals" : "claims",
                      each ? "Goals" : "The paper's claims, and our goals");
    if (each)
        rx_report_show(f->report, f->claims,
                       RX_VIEW(.rows = {"words"}, .across = {"run"}, .value = "verdict"));
    else
        rx_report_show(f->report, f->claims, RX_VIEW(.ncolumns = 2, .columns = claimed));
    rx_report_fold(f->report, "What was found");
    rx_report_show(f->report, f->claims, RX_VIEW(.ncolumns = 3 + each, .columns = found));
    rx_report_unfold(f->report);
    if (!each)
        rx_report_note(
            f->report,
            "The paper: Jia et al. 2023, MNRAS 527, 6581 (arXiv:2311.00186); when a claim counts as "
            "reproduced is in summary.json.");
}

void rx_findings_section(rx_findings *f, const char *id, const char *title, const char *prefix)
{
    char begin[RX_FIGURE_ID];
    rx_report_section(f->report, id, title);
    snprintf(begin, sizeof begin, "%s-", prefix != NULL ? prefix : "");
    if (prefix != NULL)
        rx_report_place(f->report, begin);
}

void rx_findings_quantities(rx_findings *f, const rx_store *s, int group, int open)
{
    const rx_store_group *g = &s->group[group];
    for (int q = 0; q < g->nquantities; q++) {
        const rx_quantity *quantity = &g->quantity[q];
        const rx_report_view view = {.from = rx_report_rows(f->cells),
                                     .title = quantity->name,
                                     .unit = quantity->unit,
                                     .note = quantity->help,
                                     .rows = {"condition"},
                                     .across = {"run"},
                                     .value = "value",
                                     .digits = quantity->digits,
                                     .in_brief = q < open};
        if (q == open)
            rx_report_fold(f->report, "More tables");
        for (int hidden = 0; hidden < 2; hidden++) {
            for (int i = 0; i < g->nconditions * s->ncolumns; i++) {
                const int c = i / s->ncolumns, k = i % s->ncolumns;
                const rx_finding *one = rx_store_at(s, group, q, c, k);
                if (s->hidden[k] == hidden)
                    rx_report_put(f->cells, g->name, g->condition[c], s->column[k], quantity->name,
                                  one->value, one->setting);
            }
            if (!hidden)
                rx_report_show(f->report, f->cells, &view);
        }
    }
    if (g->nquantities > open)
        rx_report_unfold(f->report);
}

static void add_contest(rx_findings *f, const rx_store *s, int group, int pair, int subject, int condition)
{
    const rx_store_group *g = &s->group[group];
    const rx_about *about = &s->about[subject];
    const rx_contest *c = rx_contest_of(s, group, pair, subject, condition);
    const char *first = s->column[s->pair[pair][0]], *second = s->column[s->pair[pair][1]];
    const double ln_holm = c->holm == 0.0 ? c->test.ln_p + log(g->nconditions) : log(c->holm);
    rx_report_put(f->contests, g->name, g->condition[condition], about->quantity, first, second, about->test,
                  c->test.difference, c->test.statistic, c->test.dof, rx_cell_p(c->test.p, c->test.ln_p),
                  rx_cell_p(c->holm, ln_holm),
                  c->winner > 0   ? first
                  : c->winner < 0 ? second
                                  : "",
                  c->test.effect, c->only_first, c->only_second);
}

void rx_findings_contests(rx_findings *f, const rx_store *s, int group, const char *things)
{
    static const char *const columns[] = {"condition", "quantity", "test",       "difference",
                                          "statistic", "effect",   "only_first", "only_second",
                                          "p",         "holm",     "winner"};
    for (int pair = 0; pair < s->npairs; pair++) {
        const int *of = s->pair[pair];
        const rx_report_view view = {.from = rx_report_rows(f->contests),
                                     .without_empty = 1,
                                     .ncolumns = sizeof columns / sizeof *columns,
                                     .columns = columns};
        char title[128];
        rx_text words = {0};
        for (int a = 0, b; a < s->nabouts; a = b) { /* all tests of one quantity side by side */
            for (b = a + 1; b < s->nabouts && strcmp(s->about[b].quantity, s->about[a].quantity) == 0;)
                b++;
            for (int i = 0; i < s->group[group].nconditions * (b - a); i++)
                add_contest(f, s, group, pair, a + i % (b - a), i / (b - a));
        }
        rx_contests_won(s, &(rx_contest_place){group, 0, s->nabouts - 1, NULL, 0}, of[0], of[1], 0, &words);
        snprintf(title, sizeof title, "%.40s against %.40s, on the same %s", s->column[of[0]],
                 s->column[of[1]], things);
        rx_report_fold(f->report, title);
        rx_report_sentence(f->report, words.data);
        rx_report_show(f->report, f->contests, &view);
        rx_report_unfold(f->report);
        if (pair < 2 && words.data != NULL)
            rx_text_printf(rx_report_brief_of(f->report), "%s\n", words.data);
        f->brief.failed |= words.failed;
        rx_text_free(&words);
    }
}

/* Record and files; frees what findings hold, whatever comes out. */
static rx_status finish(rx_findings *f, const char *reading, rx_status status, rx_error *err)
{
    const rx_campaign_record *record = f->output->record;
    const rx_report_files files = {.folder = f->output->folder,
                                   .shown = f->output->shown,
                                   .figures = record->figures,
                                   .log = f->output->log};
    const char *(*pairs)[2] = NULL;
    rx_text command = {0};
    rx_report_section(f->report, "reading", "How to read this");
    rx_report_paragraph(f->report, reading);
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
        const int each = add_verdicts(&f, &verdicts, lab->run);
        rx_claim_verdicts_free(&verdicts);
        if (lab->about[0] != '\0')
            rx_report_sentence(f.report, lab->about);
        status = kind->page(store, &f, err);
        show_claims(&f, each);
        status = finish(&f, kind->reading, status, err);
    }
    rx_store_free(store);
    return status;
}
