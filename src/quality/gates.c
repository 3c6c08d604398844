/* Reading .qa files and deciding. */
#include "quality/gates.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/lines.h"
#include "base/memory.h"
#include "base/text.h"

enum { MAX_WORDS = 7 };
static const char *const operators[] = {">=", ">", "<=", "<", "in"};
static const char *const verdicts[] = {"NONE", "PASS", "FAIL", "INSUFFICIENT"};
static const double LEVEL_LOW = 0.5, LEVEL_HIGH = 0.995;

const char *rx_verdict_name(rx_verdict verdict)
{
    return verdicts[verdict];
}

rx_verdict rx_verdict_worse(rx_verdict a, rx_verdict b)
{
    static const int rank[] = {0, 1, 3, 2};
    return rank[a] >= rank[b] ? a : b;
}

static int satisfies(const rx_gate *gate, double value)
{
    switch (gate->op) {
    case RX_GATE_GE:
        return value >= gate->value;
    case RX_GATE_GT:
        return value > gate->value;
    case RX_GATE_LE:
        return value <= gate->value;
    case RX_GATE_LT:
        return value < gate->value;
    case RX_GATE_IN:
        break;
    }
    return value >= gate->value && value <= gate->value_high;
}

rx_verdict rx_gate_judge(const rx_gate *gate, const rx_estimate *e)
{
    if (e->n == 0 || isnan(e->value) || isnan(e->low) || isnan(e->high))
        return RX_VERDICT_INSUFFICIENT;
    int low = satisfies(gate, e->low), high = satisfies(gate, e->high);
    if (low && high) /* what satisfies is one piece, so all between does too */
        return RX_VERDICT_PASS;
    int around = gate->op == RX_GATE_IN && e->low < gate->value && e->high > gate->value_high;
    return low || high || around ? RX_VERDICT_INSUFFICIENT : RX_VERDICT_FAIL;
}

static int read_number(const char *word, double *dst)
{
    char *end;
    *dst = strtod(word, &end);
    return end != word && *end == '\0' && isfinite(*dst);
}

/* "LOW:HIGH" with LOW < HIGH. */
static int read_range(const char *word, double *low, double *high)
{
    char text[64];
    const char *colon = strchr(word, ':');
    if (colon == NULL || strlen(word) >= sizeof text)
        return 0;
    memcpy(text, word, strlen(word) + 1);
    text[colon - word] = '\0';
    return read_number(text, low) && read_number(text + (colon - word) + 1, high) && *low < *high;
}

static rx_status read_metric(const char *path, long line, const char *word, rx_gate *dst, rx_error *err)
{
    const char *names[RX_METRIC_COUNT];
    for (int i = 0; i < RX_METRIC_COUNT; i++) {
        names[i] = rx_metric_get((rx_metric)i)->name;
        if (strcasecmp(names[i], word) == 0) {
            dst->metric = (rx_metric)i;
            return RX_OK;
        }
    }
    const char *near = rx_text_nearest(word, names, RX_METRIC_COUNT);
    return rx_error_at(err, RX_USAGE, path, -1, line, "unknown metric '%s'; %s%s%s", word,
                       near != NULL ? "did you mean '" : "see config/default.qa for the list",
                       near != NULL ? near : "", near != NULL ? "'" : "");
}

static rx_status read_bin(const char *path, long line, const char *word, rx_gate *dst, rx_error *err)
{
    const rx_metric_row *row = rx_metric_get(dst->metric);
    dst->whole = strcasecmp(word, "all") == 0;
    if (!dst->whole && row->whole)
        return rx_error_at(err, RX_USAGE, path, -1, line, "'%s' exists for the bin 'all' only, not for '%s'",
                           row->name, word);
    if (!dst->whole && !read_range(word, &dst->low, &dst->high))
        return rx_error_at(err, RX_USAGE, path, -1, line,
                           "bin '%s' is neither 'all' nor LOW:HIGH in magnitudes with LOW below HIGH", word);
    return RX_OK;
}

static rx_status read_value(const char *path, long line, char *const *word, rx_gate *dst, rx_error *err)
{
    int op = 0;
    while (op <= RX_GATE_IN && strcasecmp(word[2], operators[op]) != 0)
        op++;
    if (op > RX_GATE_IN)
        return rx_error_at(err, RX_USAGE, path, -1, line, "operator '%s' is none of >= > <= < in", word[2]);
    dst->op = (rx_gate_operator)op;
    dst->op_name = operators[op];
    if (op == RX_GATE_IN && !read_range(word[3], &dst->value, &dst->value_high))
        return rx_error_at(err, RX_USAGE, path, -1, line, "'in' wants LOW:HIGH with LOW below HIGH, not '%s'",
                           word[3]);
    if (op != RX_GATE_IN && !read_number(word[3], &dst->value))
        return rx_error_at(err, RX_USAGE, path, -1, line, "value '%s' is not a number", word[3]);
    int share =
        dst->metric == RX_METRIC_RECALL || dst->metric == RX_METRIC_PRECISION || dst->metric == RX_METRIC_AP;
    double most = op == RX_GATE_IN ? dst->value_high : dst->value;
    if (share && (dst->value < 0 || most > 1))
        return rx_error_at(err, RX_USAGE, path, -1, line, "%s is a share from 0 to 1, '%s' is outside",
                           rx_metric_get(dst->metric)->name, word[3]);
    return RX_OK;
}

/* One line, already cut into words. */
static rx_status read_gate(const char *path, int nwords, char *const *word, rx_gate *dst, rx_error *err)
{
    const long line = dst->line;
    if (nwords < 4 || nwords > 6)
        return rx_error_at(err, RX_USAGE, path, -1, line,
                           "a gate has 4 to 6 words, METRIC BIN OPERATOR VALUE [LEVEL [RUN]], here are %s%d",
                           nwords > 6 ? "more than " : "", nwords > 6 ? 6 : nwords);
    RX_TRY(read_metric(path, line, word[0], dst, err));
    RX_TRY(read_bin(path, line, word[1], dst, err));
    RX_TRY(read_value(path, line, word, dst, err));
    if (nwords > 4 &&
        (!read_number(word[4], &dst->level) || dst->level < LEVEL_LOW || dst->level > LEVEL_HIGH))
        return rx_error_at(err, RX_USAGE, path, -1, line,
                           "confidence level '%s' is not a number from %g to %g", word[4], LEVEL_LOW,
                           LEVEL_HIGH);
    dst->run = rx_strdup(nwords > 5 ? word[5] : "*");
    return dst->run != NULL ? RX_OK : rx_error_memory(err, 0);
}

/* A line without its comment; one without words holds no gate. */
static rx_status add_line(rx_gates *gates, const char *path, long number, char *line, rx_error *err)
{
    char *word[MAX_WORDS], *rest = NULL;
    rx_text text = {0};
    int nwords = 0;
    line[strcspn(line, "#")] = '\0';
    for (char *w = strtok_r(line, " \t\r", &rest); w != NULL && nwords < MAX_WORDS;
         w = strtok_r(NULL, " \t\r", &rest)) {
        rx_text_printf(&text, nwords > 0 ? " %s" : "%s", w);
        word[nwords++] = w;
    }
    if (nwords == 0)
        return RX_OK;
    rx_status status = RX_GROW(gates->gate, (size_t)gates->n + 1, err);
    if (status != RX_OK) {
        rx_text_free(&text);
        return status;
    }
    rx_gate *gate = &gates->gate[gates->n++];
    *gate = (rx_gate){.line = number, .level = RX_LEVEL, .text = text.data};
    return text.failed ? rx_error_memory(err, 0) : read_gate(path, nwords, word, gate, err);
}

rx_status rx_gates_read(const char *path, rx_gates **dst, rx_error *err)
{
    rx_lines lines;
    char *line = NULL;
    rx_gates *gates = RX_NEW(rx_gates, 1);
    rx_status status = rx_lines_open(&lines, path, 0, err);
    if (status == RX_OK && (gates == NULL || (gates->path = rx_strdup(path)) == NULL))
        status = rx_error_memory(err, 0);
    while (status == RX_OK && (status = rx_lines_next(&lines, &line, err)) == RX_OK && line != NULL)
        status = add_line(gates, path, lines.number, line, err);
    rx_lines_close(&lines);
    if (status == RX_INPUT) { /* a configuration file, not data */
        status = RX_USAGE;
        if (err != NULL)
            err->status = RX_USAGE;
    }
    if (status == RX_OK && gates->n == 0)
        status =
            rx_error_at(err, RX_USAGE, path, -1, 0, "holds no gate; write one like 'recall 18:20 >= 0.9'");
    if (status == RX_OK)
        *dst = gates;
    else
        rx_gates_free(gates);
    return status;
}

void rx_gates_free(rx_gates *gates)
{
    if (gates == NULL)
        return;
    for (long i = 0; i < gates->n; i++) {
        free(gates->gate[i].text);
        free(gates->gate[i].run);
    }
    free(gates->gate);
    free(gates->path);
    free(gates);
}
