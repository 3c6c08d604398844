/* The .nnw reader and its forward pass, by a network small enough to do by hand. */
#include "../files.h"
#include "../near.h"

#include "measure/starclass.h"

static char path[512];

static void evaluates_by_hand(void **state)
{
    new_file(path, "NNW\n# a comment 1 2 3\n3 10 2 1\n"
                   "0 0 0 0 0 0 0 0 0 0.5\n"
                   "1 1 1 1 1 1 1 1 1 2\n"
                   "# first layer: the area and the seeing\n"
                   "1 0 0 0 0 0 0 0 0 0 0.25\n"
                   "0 0 0 0 0 0 0 0 0 1 -1\n"
                   "2 -3 0.5\n"
                   "0.1\n0.8\n");
    rx_starclass *net = NULL;
    assert_int_equal(rx_starclass_read(path, &net, NULL), RX_OK);
    rx_source s = {.peak = 100.0};
    for (int i = 0; i < RX_NISO; i++)
        s.iso[i] = 40 - 4 * i;
    double seeing = 1.2, scale = 0.4;
    double a = 1.0 / (1.0 + exp(-(log10(40.0 / 9.0) + 0.25)));
    double b = 1.0 / (1.0 + exp(-(2.0 * log10(1.2) + 0.5 - 1.0)));
    double c = 1.0 / (1.0 + exp(-(2.0 * a - 3.0 * b + 0.5)));
    assert_near(rx_starclass_evaluate(net, &s, seeing, scale, 10.0), (c - 0.1) / 0.8, 1e-12);
    rx_starclass_free(net);
    unlink(path);
}

/* Every area and the peak have a weight of their own here; the seeing has none. */
static void weighs_areas_and_peak(void **state)
{
    const double weight[] = {0.3, -0.2, 0.7, 0.11, -0.5, 0.23, 0.9, -0.13, 0.41, 0.0};
    char text[512];
    int length = snprintf(text, sizeof text, "NNW\n2 10 1\n0 0 0 0 0 0 0 0 0 0\n1 1 1 1 1 1 1 1 1 1\n");
    for (int i = 0; i < 10; i++)
        length += snprintf(text + length, sizeof text - (size_t)length, "%g ", weight[i]);
    snprintf(text + length, sizeof text - (size_t)length, "0.05\n0\n1\n");
    new_file(path, text);
    rx_starclass *net = NULL;
    assert_int_equal(rx_starclass_read(path, &net, NULL), RX_OK);
    rx_source s = {.peak = 100.0, .iso = {61, 50, 37, 29, 17, 11, 5, 0}};
    const double disc = 3.0 * 3.0;
    double sum = 0.05 + weight[0] * log10(61.0 / disc) + weight[1] * log10(100.0 / 7.0);
    for (int i = 1; i < 7; i++)
        sum += weight[1 + i] * log10(s.iso[i] / disc);
    sum += weight[8] * -2.0; /* a level without a pixel counts as 0.01 discs */
    assert_near(rx_starclass_evaluate(net, &s, 1.2, 0.4, 7.0), 1.0 / (1.0 + exp(-sum)), 1e-12);
    rx_starclass_free(net);
    unlink(path);
}

static void refuses_what_is_no_network(void **state)
{
    const char *bad[] = {"",
                         "NET\n3 10 2 1",
                         "NNW\n3 9 2 1\n",
                         "NNW\n3 10 2000 1\n",
                         "NNW\n3 10 2 1\n0 0 0 0 zero\n",
                         "NNW\n99999 10\n",
                         "NNW\n2 10 1\n1 1 1 1 1 1 1 1 1 1\n1 1 1 1 1 1 1 1 1 1\n"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        rx_starclass *net = NULL;
        rx_error err = RX_ERROR_NONE;
        new_file(path, bad[i]);
        assert_int_equal(rx_starclass_read(path, &net, &err), RX_USAGE);
        assert_null(net);
        assert_string_equal(err.where, path);
        assert_true(strlen(err.text) > 0);
        unlink(path);
    }
    rx_starclass *net = NULL;
    assert_int_equal(rx_starclass_read("/nonexistent/x.nnw", &net, NULL), RX_USAGE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(evaluates_by_hand),
                                       cmocka_unit_test(weighs_areas_and_peak),
                                       cmocka_unit_test(refuses_what_is_no_network)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
