/* The whole report: files, verdicts, hostile names, same bytes, missing gnuplot, interruption. */
#include <signal.h>

#include "base/interrupt.h"
#include "base/random.h"
#include "data/sources.h"
#include "report/qa_page.h"

#include "../near.h"
#include "../scratch.h"

enum { N = 300, SIDE = 400, RUNS = 2, PICTURE = 24 };
#define HOSTILE "</td><script>alert('x')</script>\"\\\n\xff"

typedef struct scene {
    double x[N], y[N], mag[N];
    double rx[RUNS][N], ry[RUNS][N], rmag[RUNS][N], flux[RUNS][N], error[RUNS][N], magerr[RUNS][N],
        score[RUNS][N];
    float pixels[PICTURE * PICTURE];
    rx_qa_run run[RUNS];
    rx_qa_picture picture;
    rx_qa_input input;
} scene;

static const char *const record[][2] = {{"RESTORE_TYPE", "NONE,RL"}, {"CATALOG_NAME", HOSTILE}};

static void make_run(scene *s, int k)
{
    long n = 0;
    for (int i = 0; i < N; i++) {
        double f0 = pow(10, -0.4 * (s->mag[i] - 25)),
               f = f0 + 5 * rx_random_normal(1, (uint64_t)(10 + k), (uint64_t)i);
        if (f < 20 || rx_random_uniform(1, (uint64_t)(30 + k), (uint64_t)i) < 0.1)
            continue;
        s->rx[k][n] = s->x[i] + 0.1 * rx_random_normal(2, (uint64_t)k, (uint64_t)i);
        s->ry[k][n] = s->y[i] + 0.1 * rx_random_normal(3, (uint64_t)k, (uint64_t)i);
        s->rmag[k][n] = 25 - 2.5 * log10(f);
        s->flux[k][n] = f;
        s->error[k][n] = 5;
        s->magerr[k][n] = 1.0857 * 5 / f;
        s->score[k][n++] = f / 5;
    }
    s->run[k] =
        (rx_qa_run){.name = k == 0 ? "NONE" : HOSTILE, .settings = HOSTILE, .psf = "Moffat", .law_scale = 1};
    s->run[k].list =
        (rx_qa_list){.n = n, .x = s->rx[k], .y = s->ry[k], .mag = s->rmag[k], .flux = s->flux[k]};
    s->run[k].list.flux_error = s->error[k];
    s->run[k].list.mag_error = s->magerr[k];
    s->run[k].list.score = s->score[k];
    s->run[k].seconds = 1.5 * k;
}

static int make_scene(void **state)
{
    scene *s = calloc(1, sizeof *s);
    if (s == NULL)
        return -1;
    for (int i = 0; i < N; i++) {
        s->x[i] = SIDE * rx_random_uniform(1, 0, (uint64_t)i);
        s->y[i] = SIDE * rx_random_uniform(1, 1, (uint64_t)i);
        s->mag[i] = 18 + 4 * rx_random_uniform(1, 2, (uint64_t)i);
    }
    for (int k = 0; k < RUNS; k++)
        make_run(s, k);
    for (int i = 0; i < PICTURE * PICTURE; i++)
        s->pixels[i] = (float)rx_random_normal(4, 0, (uint64_t)i);
    s->pixels[7] = NAN;
    s->picture = (rx_qa_picture){HOSTILE, PICTURE, PICTURE, s->pixels, 1};
    s->input = (rx_qa_input){.tile = HOSTILE, .reference = HOSTILE, .width = SIDE, .height = SIDE};
    s->input.pixel_scale = 0.4;
    s->input.score_name = "S/N";
    s->input.truth = (rx_qa_list){.n = N, .x = s->x, .y = s->y, .mag = s->mag};
    s->input.nruns = RUNS;
    s->input.runs = s->run;
    s->input.npictures = 1;
    s->input.pictures = &s->picture;
    s->input.nrecord = 2;
    s->input.record = record;
    *state = s;
    return 0;
}

static int free_scene(void **state)
{
    free(*state);
    return 0;
}

static const rx_qa_params params = {.match_radius = 1, .figures = 1, .by = {.seed = 5, .nthreads = 2}};
static const char *const files[] = {"report.html",       "summary.json", "bins.ecsv",
                                    "matches_NONE.ecsv", "pr_NONE.ecsv", "regions_NONE.reg"};
enum { FILES = 3 + 3 * RUNS };

static const rx_qa_params bare = {.match_radius = 1, .by = {.seed = 5, .nthreads = 2}}; /* without figures */

static void report_into(char folder[512], const rx_qa_params *par, const scene *s, rx_text *brief)
{
    new_folder(folder);
    assert_int_equal(rx_qa_report(par, &s->input, folder, "the report", NULL, brief, NULL), RX_OK);
}

static int occurrences(const char *text, const char *what)
{
    int n = 0;
    for (; (text = strstr(text, what)) != NULL; text += strlen(what))
        n++;
    return n;
}

/* In python, where that is there: d is summary.json, f the folder. */
static void assert_python(const char *folder, const char *imports, const char *code)
{
    char command[4096];
    snprintf(command, sizeof command, "/usr/bin/python3 -c 'import %s' 2>/dev/null", imports);
    if (!works(command)) {
        print_message("%s is absent: the files not opened\n", imports);
        return;
    }
    snprintf(command, sizeof command,
             "/usr/bin/python3 -c \"import %s, json; f = '%s/'; d = json.load(open(f + 'summary.json'));%s\"",
             imports, folder, code);
    assert_int_equal(system(command), 0);
}

static void writes_all_files(void **state)
{
    scene *s = *state;
    char folder[512];
    rx_text brief = {0};
    report_into(folder, &params, s, &brief);
    assert_int_equal(count_files(folder), FILES);
    assert_non_null(strstr(brief.data, "NONE"));
    assert_null(strchr(brief.data, '\xff'));
    char *page = slurp(folder, "report.html");
    assert_null(strstr(page, "<script"));
    assert_non_null(strstr(page, "&lt;script&gt;alert(&#39;x&#39;)"));
    assert_non_null(strstr(page, "</html>"));
    if (works("gnuplot --version >/dev/null 2>&1")) {
        assert_non_null(strstr(page, "<svg"));
        assert_null(strstr(page, "not drawn"));
    } else {
        print_message("gnuplot is absent: figures not looked at\n");
    }
    free(page);
    rx_text_free(&brief);
    clear_folder(folder);
}

static void same_input_same_bytes(void **state)
{
    scene *s = *state;
    char first[512], second[512];
    report_into(first, &params, s, NULL);
    s->run[1].seconds = 77; /* timings are not part of the files */
    report_into(second, &params, s, NULL);
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        char *a = slurp(first, files[i]), *b = slurp(second, files[i]);
        assert_string_equal(a, b);
        assert_null(strstr(a, first)); /* nor is the path */
        free(a);
        free(b);
    }
    clear_folder(first);
    clear_folder(second);
}

/* Opened by what users open them with. */
static void other_programs_read_it(void **state)
{
    char folder[512];
    report_into(folder, &bare, *state, NULL);
    assert_python(folder, "json",
                  "r = d['runs'][0];assert d['format'] == 'rextract-qa 2' and r['run'] == 'NONE' and "
                  "d['metrics'][0]['metric'] == 'recall';assert r['references'] + r['references_ignored'] == "
                  "300;assert 0.7 < r['recall']['value'] < 1 and r['recall']['low'] < "
                  "r['recall']['value'];assert len([b for b in d['bins'] if b['run'] == 'NONE' and "
                  "b['mag_low'] is not None]) == 8;assert [b['recall'] for b in d['bins'] if b['mag_low'] is "
                  "None][0] == r['recall'];assert d['verdict'] == 'NONE' and len(d['runs']) == 2;assert "
                  "d['record'][0]['value'] == 'NONE,RL'");
    assert_python(folder, "astropy.table",
                  "read = astropy.table.Table.read; b = read(f + 'bins.ecsv'); m = read(f + "
                  "'matches_NONE.ecsv');assert len(b) == 2 * 9 and b['bias_mag'].unit == 'mag'; k = "
                  "m['state'] == 'matched';assert m.meta['run'] == 'NONE' and (m['reference'] > 0).sum() == "
                  "300;assert abs(m['x'][k] - m['x_ref'][k] - m['dx'][k]).max() < 1e-5;p = read(f + "
                  "'pr_NONE.ecsv'); assert p['matched'][-1] == k.sum()");
    clear_folder(folder);
}

/* 20 detections stand where nothing is, every second of them is marked, and so are 5 others. */
static void spurious_sources_have_their_section(void **state)
{
    scene *s = *state;
    char folder[512];
    static unsigned char made_up[N];
    for (int i = 0; i < 20; i++) {
        s->rx[0][i] = s->ry[0][i] = 1 + 0.01 * i;
        made_up[i] = i % 2 == 0;
    }
    memset(made_up + 20, 1, 5);
    for (int tested = 0; tested < 2; tested++) {
        s->run[0].list.made_up = tested ? made_up : NULL;
        s->run[0].tested = tested;
        s->run[0].made_up_per_mpixel = 123.4;
        report_into(folder, &bare, s, NULL);
        char *page = slurp(folder, "report.html"), *json = slurp(folder, "summary.json");
        assert_int_equal(occurrences(page, "<h2 id=\"spurious\">Spurious or real</h2>"), tested);
        assert_int_equal(occurrences(page, "href=\"#spurious\""), tested);
        assert_int_equal(occurrences(json, "\"spurious\": null"),
                         RUNS - tested); /* of the other run nothing is known */
        assert_int_equal(occurrences(page, "<td>123.4</td><td>"), tested);
        free(page);
        free(json);
        if (tested)
            assert_python(
                folder, "json",
                "r = d['runs'][0]; p = (r['matched'] - 5) / (r['detections'] - 15);assert r['spurious'] == "
                "15 and r['spurious_matched'] == 5 and r['spurious_per_mpixel'] == 123.4;assert "
                "abs(r['precision_without'] - p) < 1e-9 and p > r['precision']['value'] + 0.01");
        clear_folder(folder);
    }
}

/* 20 detections stand where nothing is; they and 5 others are saturated. */
static void flags_and_regions_are_those_of_the_matches(void **state)
{
    scene *s = *state;
    char folder[512];
    static int flags[N];
    for (int i = 0; i < 25; i++)
        flags[i] = RX_FLAG_SATURATED;
    for (int i = 0; i < 20; i++)
        s->rx[0][i] = s->ry[0][i] = 1 + 0.01 * i;
    s->run[0].list.flags = flags;
    report_into(folder, &bare, s, NULL);
    char *page = slurp(folder, "report.html"), *table = slurp(folder, "matches_NONE.ecsv");
    char *regions = slurp(folder, "regions_NONE.reg");
    assert_int_equal(occurrences(page, "<h2 id=\"flags\">With and without each flag</h2>"), 1);
    assert_true(occurrences(table, "\n\"missed\",") > 0);
    assert_int_equal(occurrences(regions, "tag={missed}"), occurrences(table, "\n\"missed\","));
    assert_int_equal(occurrences(regions, "tag={false}"), 20);
    assert_int_equal(occurrences(regions, "\nimage;circle("),
                     20 + occurrences(table, "\n\"missed\",")); /* the scene has no sky */
    assert_non_null(strstr(regions, "\nimage;circle(2.000,2.000,1.000) # color=red text={1} tag={false}\n"));
    assert_python(
        folder, "json",
        "[f] = d['flags']; r = d['runs'][0];assert f['name'] == 'SATURATED' and f['bit'] == 4 and f['run'] "
        "== 'NONE';assert f['detections'] == 25 and f['matched'] == 5;assert f['recall'] == r['recall'] and "
        "f['precision'] == r['precision'];a = (r['matched'] - 5) / r['references']; b = (r['matched'] - 5) / "
        "(r['detections'] - 25);assert abs(f['recall_without']['value'] - a) < 1e-8;assert "
        "abs(f['precision_without']['value'] - b) < 1e-8");
    free(page);
    free(table);
    free(regions);
    clear_folder(folder);
}

static void without_gnuplot(void **state)
{
    static const char *const programs[] = {"no-such-gnuplot", "/no/such/gnuplot", "false"};
    for (size_t i = 0; i < sizeof programs / sizeof *programs; i++) {
        char folder[512], said[4096] = "";
        rx_qa_params par = params;
        rx_log log;
        FILE *stream = fmemopen(said, sizeof said, "w");
        par.gnuplot = programs[i];
        rx_log_init(&log, "test", stream, RX_NORMAL);
        par.log = &log;
        report_into(folder, &par, *state, NULL);
        fclose(stream);
        assert_non_null(strstr(said, "without figures"));
        assert_non_null(strstr(said, programs[i]));
        assert_int_equal(count_files(folder), FILES);
        char *page = slurp(folder, "report.html");
        assert_int_equal(occurrences(page, "No figures"), 1);
        assert_null(strstr(page, "<svg"));
        free(page);
        clear_folder(folder);
    }
}

static rx_verdict verdict_of(scene *s, const char *gates_text, char **json)
{
    char folder[512], path[600];
    rx_qa_params par = bare;
    rx_gates *gates = NULL;
    rx_verdict verdict = RX_VERDICT_NONE;
    new_folder(folder);
    snprintf(path, sizeof path, "%s/x.qa", folder);
    write_text(path, gates_text);
    assert_int_equal(rx_gates_read(path, &gates, NULL), RX_OK);
    par.gates = gates;
    assert_int_equal(rx_qa_report(&par, &s->input, folder, "the report", &verdict, NULL, NULL), RX_OK);
    if (json != NULL)
        *json = slurp(folder, "summary.json");
    rx_gates_free(gates);
    clear_folder(folder);
    return verdict;
}

static void gates_reach_the_verdict(void **state)
{
    scene *s = *state;
    char *json;
    assert_int_equal(verdict_of(s, "recall 18:20 >= 0.7\ndx all in -0.1:0.1", &json), RX_VERDICT_PASS);
    assert_non_null(strstr(json, "\"verdict\": \"PASS\""));
    free(json);
    assert_int_equal(verdict_of(s, "recall all >= 0.7\nrecall all >= 0.99 0.95 NONE", NULL), RX_VERDICT_FAIL);
    assert_int_equal(verdict_of(s, "mag50 all > 15\nrecall 18:18.1 >= 0.9", NULL), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(verdict_of(s, "recall 30:31 >= 0.1", NULL), RX_VERDICT_INSUFFICIENT);
    assert_int_equal(verdict_of(s, "recall all >= 0.1 0.95 NETWORK", &json), RX_VERDICT_INSUFFICIENT);
    assert_non_null(strstr(json, "\"run\": null"));
    free(json);
}

/* Names that differ in case alone have files of their own; then nothing to compare. */
static void every_run_has_its_files(void **state)
{
    scene *s = *state;
    char folder[512];
    s->run[1].name = "none";
    report_into(folder, &bare, s, NULL);
    assert_int_equal(clear_folder(folder), FILES);
    s->input.truth.n = 0;
    s->run[0].list.n = 0;
    report_into(folder, &params, s, NULL);
    assert_int_equal(clear_folder(folder), FILES);
}

static void folder_that_is_not_there(void **state)
{
    scene *s = *state;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_qa_report(&params, &s->input, "/no/such/folder", "the report", NULL, NULL, &err),
                     RX_SYSTEM);
    assert_string_equal(err.where, "the report"); /* the name that the user knows, and only that */
    assert_null(strstr(err.text, "/no/such"));
    assert_int_equal(rx_qa_report(&bare, &s->input, "/no/such/folder", "the report", NULL, NULL, &err),
                     RX_SYSTEM);
    assert_string_equal(err.where, "the report/summary.json");
}

static void interruption_leaves_nothing(void **state)
{
    scene *s = *state;
    char folder[512];
    sigset_t term;
    sigemptyset(&term);
    sigaddset(&term, SIGTERM);
    new_folder(folder);
    rx_interrupt_block();
    raise(SIGTERM);
    assert_int_equal(rx_qa_report(&params, &s->input, folder, "the report", NULL, NULL, NULL),
                     RX_INTERRUPTED);
    assert_int_equal(sigtimedwait(&term, NULL, &(struct timespec){0}), SIGTERM);
    assert_int_equal(clear_folder(folder), 0);
}

/* The text of the terminal for two lists, of one reference each with these magnitudes. */
static void brief_of_two(double shift, rx_text *brief)
{
    double x[4] = {50, 150, 250, 350}, y[4] = {50, 50, 50, 50}, mag[4] = {18, 19, 20, 21};
    const double ratio[2][4] = {{1.1, 1.1, 0, 0}, {1.0, 1.1, 2.0, 2.0}};
    double measured[2][4];
    char folder[512];
    rx_qa_run run[2] = {{.name = "SHORT", .seconds = 1}, {.name = "DEEP", .seconds = 2}};
    rx_qa_input input = {
        .tile = "t", .reference = "r", .width = SIDE, .height = SIDE, .nruns = 2, .runs = run};
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 4; i++)
            measured[k][i] = mag[i] + shift - 2.5 * log10(ratio[k][i]);
        run[k].list = (rx_qa_list){.n = k == 0 ? 2 : 4, .x = x, .y = y, .mag = measured[k]};
    }
    input.truth = (rx_qa_list){.n = 4, .x = x, .y = y, .mag = mag};
    new_folder(folder);
    assert_int_equal(rx_qa_report(&bare, &input, folder, "the report", NULL, brief, NULL), RX_OK);
    clear_folder(folder);
}

static void errors_are_compared_on_common_sources(void **state)
{
    const char *const names[] = {"SHORT", "DEEP"};
    const double own[] = {10.0, 52.5}, common[] = {10.0, 5.0};
    rx_text brief = {0};
    brief_of_two(0.0, &brief);
    for (int k = 0; k < 2; k++) {
        double errors[2] = {NAN, NAN};
        const char *line = strstr(brief.data, names[k]);
        assert_non_null(line);
        assert_int_equal(sscanf(line, "%*s %*s %*s %*s %*s %*s %lf %lf", &errors[1], &errors[0]), 2);
        assert_near(errors[0], own[k], 0.006);
        assert_near(errors[1], common[k], 0.006);
    }
    assert_non_null(strstr(brief.data, "of the 2 sources"));
    assert_null(strstr(brief.data, "zero point"));
    rx_text_free(&brief);
    brief_of_two(-25.0, &brief); /* errors that mean nothing are not shown */
    assert_non_null(strstr(brief.data, "give MAG_ZEROPOINT"));
    assert_null(strstr(brief.data, "00000"));
    rx_text_free(&brief);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, make_scene, free_scene)
    const struct CMUnitTest tests[] = {
        TEST(errors_are_compared_on_common_sources),
        TEST(writes_all_files),
        TEST(same_input_same_bytes),
        TEST(other_programs_read_it),
        TEST(without_gnuplot),
        TEST(gates_reach_the_verdict),
        TEST(every_run_has_its_files),
        TEST(spurious_sources_have_their_section),
        TEST(flags_and_regions_are_those_of_the_matches),
        TEST(folder_that_is_not_there),
        TEST(interruption_leaves_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
