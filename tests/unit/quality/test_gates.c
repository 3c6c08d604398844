/* The grammar of .qa files and the three verdicts. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../files.h"
#include "../near.h"
#include "base/text.h"
#include "quality/gates.h"

/* Reads `content` as a gates file. */
static rx_status read_text(const char *content, rx_gates **gates, rx_error *err)
{
    char path[512];
    new_file(path, content);
    rx_status status = rx_gates_read(path, gates, err);
    unlink(path);
    return status;
}

static void grammar(void **state)
{
    rx_gates *gates = NULL;
    assert_int_equal(read_text("# comment\n\n  Recall 18:20.5 >= 0.9 0.99 RL # why\r\nbias_mag all in "
                               "-0.02:0.02\nmag50 ALL > 21.5 0.9\nmagerr 17:18 <= 5\npull_width all < 1.1",
                               &gates, NULL),
                     RX_OK);
    assert_int_equal(gates->n, 5);
    const rx_gate *g = gates->gate;
    assert_int_equal(g[0].line, 3);
    assert_string_equal(g[0].text, "Recall 18:20.5 >= 0.9 0.99 RL");
    assert_int_equal(g[0].metric, RX_METRIC_RECALL);
    assert_false(g[0].whole);
    assert_near(g[0].low, 18, 0);
    assert_near(g[0].high, 20.5, 0);
    assert_near(g[0].value, 0.9, 0);
    assert_near(g[0].level, 0.99, 0);
    assert_string_equal(g[0].run, "RL");
    assert_int_equal(g[1].op, RX_GATE_IN);
    assert_near(g[1].value, -0.02, 0);
    assert_near(g[1].value_high, 0.02, 0);
    assert_near(g[1].level, 0.95, 0);
    assert_string_equal(g[1].run, "*");
    assert_true(g[2].whole);
    assert_int_equal(g[2].op, RX_GATE_GT);
    assert_int_equal(g[3].op, RX_GATE_LE);
    assert_int_equal(g[4].op, RX_GATE_LT);
    rx_gates_free(gates);
}

static void malformed(void **state)
{
    static const struct {
        const char *content;
        long line;
        const char *says;
    } bad[] = {
        {"recal all >= 0.9", 1, "did you mean 'recall'"},
        {"# ok\n\nbias all >= 1\nxyzzyplugh all > 1", 3, "unknown metric 'bias'"},
        {"xyzzyplugh all > 1", 1, "default.qa"},
        {"recall all >= 0.9\nrecall all", 2, "4 to 6 words"},
        {"recall all >= 0.9 0.95 RL extra more words", 1, "4 to 6 words"},
        {"recall 20:18 >= 0.9", 1, "LOW below HIGH"},
        {"recall 18-20 >= 0.9", 1, "bin '18-20'"},
        {"recall 18:nan >= 0.9", 1, "bin"},
        {"mag50 18:20 >= 20", 1, "'all' only"},
        {"recall all => 0.9", 1, "operator '=>'"},
        {"recall all >= lots", 1, "not a number"},
        {"recall all >= 95", 1, "share from 0 to 1"},
        {"bias_mag all in 0.02", 1, "LOW:HIGH"},
        {"bias_mag all in 0.02:-0.02", 1, "LOW:HIGH"},
        {"recall all >= 0.9 95", 1, "confidence level '95'"},
        {"recall all >= 0.9 0.9999", 1, "confidence level"},
        {"", 0, "holds no gate"},
        {"# only a comment\n", 0, "holds no gate"},
    };
    rx_gates *none = NULL;
    assert_int_equal(rx_gates_read("/nowhere/x.qa", &none, NULL), RX_USAGE);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        rx_gates *gates = NULL;
        rx_error err = RX_ERROR_NONE;
        assert_int_equal(read_text(bad[i].content, &gates, &err), RX_USAGE);
        assert_null(gates);
        assert_int_equal(err.status, RX_USAGE);
        assert_int_equal(err.line, bad[i].line);
        assert_non_null(strstr(err.where, "rextract-test-"));
        if (strstr(err.text, bad[i].says) == NULL)
            fail_msg("'%s' gave: %s", bad[i].content, err.text);
    }
}

static rx_verdict judge(rx_gate_operator op, double value, double value_high, double low, double high)
{
    rx_gate gate = {.op = op, .value = value, .value_high = value_high};
    rx_estimate e = {0.5 * (low + high), low, high, 100};
    if (isinf(low) || isinf(high))
        e.value = 0;
    return rx_gate_judge(&gate, &e);
}

static void verdicts(void **state)
{
    assert_int_equal(judge(RX_GATE_GE, 0.9, 0, 0.9, 0.95), RX_VERDICT_PASS);
    assert_int_equal(judge(RX_GATE_GT, 0.9, 0, 0.9, 0.95), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(judge(RX_GATE_GE, 0.9, 0, 0.89, 0.95), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(judge(RX_GATE_GE, 0.9, 0, 0.8, 0.89), RX_VERDICT_FAIL);
    assert_int_equal(judge(RX_GATE_LE, 5, 0, 3, 5), RX_VERDICT_PASS);
    assert_int_equal(judge(RX_GATE_LT, 5, 0, 3, 5), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(judge(RX_GATE_LE, 5, 0, 5.1, 6), RX_VERDICT_FAIL);
    assert_int_equal(judge(RX_GATE_IN, -1, 1, -0.5, 1), RX_VERDICT_PASS);
    assert_int_equal(judge(RX_GATE_IN, -1, 1, -0.5, 1.1), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(judge(RX_GATE_IN, -1, 1, -2, 2), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(judge(RX_GATE_IN, -1, 1, 1.5, 2), RX_VERDICT_FAIL);
    assert_int_equal(judge(RX_GATE_IN, -1, 1, -3, -2), RX_VERDICT_FAIL);
    assert_int_equal(judge(RX_GATE_GE, 0, 0, -INFINITY, INFINITY), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(judge(RX_GATE_IN, -1, 1, -INFINITY, INFINITY), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(judge(RX_GATE_GE, 21, 0, 22, INFINITY), RX_VERDICT_PASS);
    assert_int_equal(judge(RX_GATE_GE, 0, 0, NAN, NAN), RX_VERDICT_INSUFFICIENT); /* nothing was measured */
    assert_int_equal(rx_verdict_worse(RX_VERDICT_PASS, RX_VERDICT_INSUFFICIENT), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(rx_verdict_worse(RX_VERDICT_FAIL, RX_VERDICT_INSUFFICIENT), RX_VERDICT_FAIL);
    assert_int_equal(rx_verdict_worse(RX_VERDICT_NONE, RX_VERDICT_PASS), RX_VERDICT_PASS);
}

/* The file that is shipped is itself well formed and names every metric. */
static void shipped_file(void **state)
{
    char path[1024];
    rx_gates *gates = NULL;
    char *content = NULL;
    const char *root = getenv("srcdir") != NULL ? getenv("srcdir") : ".";
    snprintf(path, sizeof path, "%s/config/default.qa", root);
    assert_int_equal(rx_gates_read(path, &gates, NULL), RX_OK);
    assert_true(gates->n >= 3);
    rx_gates_free(gates);
    assert_int_equal(rx_text_read_file(path, 1 << 20, &content, NULL, NULL), RX_OK);
    for (int m = 0; m < RX_METRIC_COUNT; m++)
        if (strstr(rx_metric_get((rx_metric)m)->name, "_arcsec") == NULL)
            assert_non_null(strstr(content, rx_metric_get((rx_metric)m)->name));
    free(content);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(grammar),
        cmocka_unit_test(malformed),
        cmocka_unit_test(verdicts),
        cmocka_unit_test(shipped_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
