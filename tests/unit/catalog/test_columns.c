/* The column table, .param files and the values of the columns. */
#include "../near.h"
#include "scene.h"

#include <ctype.h>

static void every_column_is_sound(void **state)
{
    int n;
    const rx_column_def *defs = rx_column_defs(&n);
    static const char *const units[] = {"",    "count",  "mag",       "pixel",       "pixel**2",
                                        "deg", "deg**2", "deg**(-2)", "pixel**(-2)", "mag * arcsec**(-2)"};
    for (int i = 0; i < n; i++) {
        const char *format = defs[i].format;
        const bool integer = defs[i].type == RX_CELL_INT16 || defs[i].type == RX_CELL_INT32;
        bool known = false;
        assert_int_equal(rx_column_index(defs[i].name), i); /* also: no name twice */
        assert_int_equal(format[0], '%');
        assert_non_null(strchr(integer ? "du" : "feg", format[strlen(format) - 1]));
        assert_in_range(defs[i].naxis, 0, 2);
        for (size_t k = 0; k < sizeof units / sizeof *units; k++)
            known |= strcmp(units[k], defs[i].unit) == 0;
        assert_true(known);
        assert_in_range(strlen(defs[i].description), 5, 57);
        assert_in_range(strlen(defs[i].ucd), 3, 63);
        assert_true(islower((unsigned char)defs[i].ucd[0]));
        assert_null(strpbrk(defs[i].ucd, " \t,"));
    }
}

static rx_status read_param(const char *text, rx_log *log, rx_column_list **list, rx_error *err)
{
    write_text("my.param", text);
    rx_status status = rx_columns_read("my.param", log, list, err);
    return status;
}

static void param_files_as_users_have_them(void **state)
{
    rx_column_list *list = NULL;
    int dim[2];
    assert_int_equal(
        read_param("# comment\n\n  NUMBER\t\r\nFLUX_APER(3)  # three\n#MAG_AUTO\nVIGNET(35,31)\nFLUX_RADIUS\n"
                   "FLUXERR_APER[2]\nMAG_APER 2\nALPHA_J2000 Right ascension\nVECTOR_ASSOC( 3 )",
                   NULL, &list, NULL),
        RX_OK);
    assert_int_equal(list->n, 8);
    rx_columns_requested(list, "FLUX_APER", dim);
    assert_int_equal(dim[0], 3);
    rx_columns_requested(list, "VIGNET", dim);
    assert_int_equal(dim[0], 35);
    assert_int_equal(dim[1], 31);
    rx_columns_requested(list, "FLUX_RADIUS", dim);
    assert_int_equal(dim[0], 1);
    rx_columns_requested(list, "MAG_APER", dim);
    assert_int_equal(dim[0], 2);
    rx_columns_requested(list, "VECTOR_ASSOC", dim);
    assert_int_equal(dim[0], 3);
    rx_columns_requested(list, "MAG_AUTO", dim);
    assert_int_equal(dim[0], 0);
    assert_true(rx_columns_requested(list, "NUMBER", NULL));
    assert_false(rx_columns_requested(list, "MAG_AUTO", NULL));
    rx_columns_free(list);
}

static void warnings_are_said_once(void **state)
{
    char shown[2048] = "";
    rx_log log;
    rx_column_list *list = NULL;
    FILE *stream = fmemopen(shown, sizeof shown, "w");
    rx_log_init(&log, "test", stream, RX_NORMAL);
    assert_int_equal(read_param("NUMBER\nMAG_DISK\nCHI2_MODEL\nNUMBER\nFLUX_APER(9)\n", &log, &list, NULL),
                     RX_OK);
    assert_int_equal(list->n, 2);
    rx_columns_clip(list, "FLUX_APER", 4, "PHOT_APERTURES", &log);
    rx_columns_clip(list, "MAG_APER", 1, "PHOT_APERTURES", &log);
    assert_int_equal(list->choice[1].dim[0], 4);
    fclose(stream);
    assert_non_null(strstr(shown, "MAG_DISK, CHI2_MODEL"));
    assert_non_null(strstr(shown, "named twice are written once: NUMBER"));
    assert_non_null(strstr(shown, "FLUX_APER(9) is cut to 4"));
    int lines = 0;
    for (const char *c = shown; *c != '\0'; c++)
        lines += *c == '\n';
    assert_int_equal(lines, 3);
    rx_columns_free(list);
}

static void bad_param_files(void **state)
{
    static const struct {
        const char *text, *says;
        long line;
    } bad[] = {
        {"NUMBER\nX_IMAG\n", "did you mean X_IMAGE", 2},
        {"XYZZYXYZZY\n", "-dp lists", 1},
        {"MAG_AUTO(3)\n", "holds one value", 1},
        {"FLUX_APER(0)\n", "bad dimension", 1},
        {"FLUX_APER(-1)\n", "bad dimension", 1},
        {"FLUX_APER(a)\n", "bad dimension", 1},
        {"FLUX_APER(99999999999999999999)\n", "bad dimension", 1},
        {"FLUX_APER(2,3)\n", "bad dimension", 1},
        {"VIGNET(35,35,35)\n", "bad dimension", 1},
        {"VIGNET(35,5000)\n", "bad dimension", 1},
        {"(3)\n", "unknown column", 1},
        {"# nothing\n", "chooses no column", 0},
        {"", "chooses no column", 0},
        {"MAG_DISK\n", "chooses no column", 0},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        rx_error err = RX_ERROR_NONE;
        rx_column_list *list = NULL;
        assert_int_equal(read_param(bad[i].text, NULL, &list, &err), RX_USAGE);
        assert_int_equal(err.status, RX_USAGE);
        assert_non_null(strstr(err.text, bad[i].says));
        assert_int_equal(err.line, bad[i].line);
        assert_null(list);
    }
    rx_error err = RX_ERROR_NONE;
    rx_column_list other, *list = &other;
    assert_int_equal(rx_columns_read("/nowhere/at/all.param", NULL, &list, &err), RX_USAGE);
    assert_int_equal(err.status, RX_USAGE);
    assert_null(list);
    list = &other;
    assert_int_equal(rx_columns_of(&(const char *){"X_IMAGF"}, 1, &list, &err), RX_USAGE);
    assert_null(list);
}

static void default_columns_are_those_of_the_file(void **state)
{
    char path[1024];
    const char *root = getenv("srcdir");
    rx_column_list *built = NULL, *file = NULL;
    snprintf(path, sizeof path, "%s/config/default.param", root != NULL ? root : ".");
    assert_int_equal(rx_columns_read(path, NULL, &file, NULL), RX_OK);
    assert_int_equal(rx_columns_default(&built, NULL), RX_OK);
    assert_int_equal(built->n, file->n);
    for (int i = 0; i < built->n; i++)
        assert_memory_equal(&built->choice[i], &file->choice[i], sizeof *built->choice);
    rx_columns_free(built);
    rx_columns_free(file);
}

static void values_leave_in_catalogue_conventions(void **state)
{
    rx_sources *sources = scene_sources(2);
    sources->list[1].flux_auto = -3;
    sources->list[1].flags = RX_FLAG_CROWDED;
    sources->list[1].flux_isocor = 42;
    rx_table *t = scene_table(
        "NUMBER\nX_IMAGE\nY_IMAGE_DBL\nXMIN_IMAGE\nXPEAK_IMAGE\nMAG_AUTO\nMAGERR_AUTO\nFLUX_BEST\n"
        "THETA_IMAGE\nMU_MAX\nMU_THRESHOLD\nISOAREA_WORLD\nFWHM_WORLD\nIMAFLAGS_ISO\nMAG_APER(4)\n"
        "ELONGATION\nELLIPTICITY\nPOLAR_IMAGE\nCXX_WORLD\nA_WORLD\nTHETA_SKY\nVIGNET(3,3)\n",
        sources);
    assert_int_equal(t->nrows, 2);
    assert_near(scene_value(t, "X_IMAGE", 0, 0), 11.25, 0);
    assert_near(scene_value(t, "Y_IMAGE_DBL", 1, 0), 23.5, 0);
    assert_near(scene_value(t, "XMIN_IMAGE", 0, 0), 8, 0);
    assert_near(scene_value(t, "XPEAK_IMAGE", 0, 0), 11, 0);
    assert_near(scene_value(t, "MAG_AUTO", 0, 0), 17.5, 1e-6);
    assert_near(scene_value(t, "MAGERR_AUTO", 0, 0), 0.01086, 1e-8);
    assert_near(scene_value(t, "MAG_AUTO", 1, 0), 99, 0);
    assert_near(scene_value(t, "MAGERR_AUTO", 1, 0), 99, 0);
    assert_near(scene_value(t, "FLUX_BEST", 0, 0), 1000, 0);
    assert_near(scene_value(t, "FLUX_BEST", 1, 0), 42, 0);
    assert_near(scene_value(t, "THETA_IMAGE", 0, 0), 22.5, 1e-5);
    assert_near(scene_value(t, "MU_MAX", 0, 0), 25 - 2.5 * log10(100 / (0.36 * 0.36)), 1e-5);
    assert_near(scene_value(t, "MU_THRESHOLD", 0, 0), 25 - 2.5 * log10(5 / (0.36 * 0.36)), 1e-5);
    assert_near(scene_value(t, "ISOAREA_WORLD", 0, 0), 30e-8, 2e-14); /* half a step of float */
    assert_near(scene_value(t, "FWHM_WORLD", 0, 0), 3e-4, 1e-10);
    assert_int_equal(((int32_t *)t->columns[rx_table_find(t, "IMAFLAGS_ISO")].data)[0], (int32_t)0x80000001u);
    assert_near(scene_value(t, "MAG_APER", 1, 2), 25 - 2.5 * log10(301), 1e-5);
    assert_true(isnan(scene_value(t, "MAG_APER", 1, 3)) || scene_value(t, "MAG_APER", 1, 3) == 99);
    assert_near(scene_value(t, "ELONGATION", 0, 0), 1.6 / 1.4, 1e-6);
    assert_near(scene_value(t, "ELLIPTICITY", 0, 0), 0.125, 1e-6);
    assert_near(scene_value(t, "POLAR_IMAGE", 0, 0), hypot(0.5, 0.5) / 4.5, 1e-6);
    /* x grows westwards: east = -x, so the axis at 22.5 deg from x stands 67.5 deg from north, on the west
     * side */
    assert_near(scene_value(t, "THETA_SKY", 0, 0), -67.5, 1e-4);
    assert_near(scene_value(t, "A_WORLD", 0, 0), 1e-4 * sqrt(2.25 + 0.5 * hypot(0.5, 0.5)), 1e-9);
    assert_near(scene_value(t, "CXX_WORLD", 0, 0) / (2 / (2.5 * 2 - 0.0625) * 1e8), 1, 1e-6);
    assert_near(scene_value(t, "VIGNET", 0, 4), (float)-1e30, 0); /* none was measured */
    rx_table_free(t);
    rx_sources_free(sources);
}

/* As scipy.stats.truncnorm has them: the 95 % quantiles of a Gaussian that is cut off below 0. */
static void upper_limits_of_fluxes_that_are_not_negative(void **state)
{
    static const double flux[] = {-120, -30, 0, 20, 80, NAN, -1e30},
                        limit[] = {2.454685215939456, 8.171724833937013, 19.59963984540055, 36.55984356713827,
                                   96.44853626951472};
    enum { N = sizeof flux / sizeof *flux };
    rx_sources *sources = scene_sources(N);
    for (int i = 0; i < N; i++) {
        sources->list[i].fit.flux = flux[i];
        sources->list[i].fit.fluxerr = 10;
    }
    rx_table *t = scene_table("FLUXLIM_TEMPLATE\nMAGLIM_TEMPLATE\n", sources);
    for (int i = 0; i < 5; i++) {
        assert_near(scene_value(t, "FLUXLIM_TEMPLATE", i, 0), limit[i], 2e-7 * limit[i]);
        assert_near(scene_value(t, "MAGLIM_TEMPLATE", i, 0), 25 - 2.5 * log10(limit[i]), 2e-6);
    }
    assert_true(isnan(scene_value(t, "FLUXLIM_TEMPLATE", 5, 0)));
    assert_near(scene_value(t, "MAGLIM_TEMPLATE", 5, 0), 99, 0);
    assert_between(scene_value(t, "FLUXLIM_TEMPLATE", 6, 0), 0.1, 1); /* never 0 or below */
    rx_table_free(t);
    rx_sources_free(sources);
}

/* A source of an SDSS frame as source-extractor 2.25 has it; the matrix is the frame's CD matrix. */
static void world_shapes_as_in_sextractor(void **state)
{
    rx_sources *sources = scene_sources(1);
    rx_source *s = &sources->list[0];
    s->x2 = 6.8081199830e-01, s->y2 = 4.9320764884e-01, s->xy = -2.7193280914e-03;
    s->errx2 = 8.0300902280e-01, s->erry2 = 5.8002972892e-01, s->errxy = -3.0899724158e-03;
    s->x2win = 1.3866999327, s->y2win = 2.0225014424, s->xywin = -2.9726960226e-01;
    const double matrix[4] = {-5.38649993335e-08, 0.000109953068982, 0.000109986838864, 6.39997095994e-09};
    memcpy(s->world_matrix, matrix, sizeof matrix);
    rx_table *t =
        scene_table("A_WORLD\nB_WORLD\nTHETA_WORLD\nTHETA_SKY\nERRA_IMAGE\nERRB_IMAGE\nERRTHETA_IMAGE\n"
                    "ERRA_WORLD\nERRTHETA_SKY\nERRCXX_IMAGE\nERRCXY_IMAGE\nX2_WORLD\nXY_WORLD\nPOLAR_WORLD\n"
                    "THETAWIN_WORLD\nTHETAWIN_SKY\nAWIN_WORLD\nBWIN_WORLD\nPOLARWIN_IMAGE\n",
                    sources);
    static const struct {
        const char *name;
        double value, tolerance;
    } expected[] = {
        {"A_WORLD", 9.075455e-05, 2e-8},        {"B_WORLD", 7.721474e-05, 2e-8},
        {"THETA_WORLD", -89.08, 0.02},          {"THETA_SKY", -0.92, 0.02},
        {"ERRA_IMAGE", 0.89613, 6e-6},          {"ERRB_IMAGE", 0.76157, 6e-6},
        {"ERRTHETA_IMAGE", -0.79, 0.006},       {"ERRA_WORLD", 9.8563e-05, 2e-8},
        {"ERRTHETA_SKY", -0.88, 0.02},          {"ERRCXX_IMAGE", 1.245342, 1e-6},
        {"ERRCXY_IMAGE", 0.01326853, 1e-8},     {"X2_WORLD", 5.9627026915e-09, 3e-12},
        {"XY_WORLD", -3.6532432119e-11, 2e-12}, {"POLAR_WORLD", 0.16018, 2e-4},
        {"THETAWIN_WORLD", -21.59, 0.02},       {"THETAWIN_SKY", -68.41, 0.02},
        {"AWIN_WORLD", 0.0001608669, 4e-8},     {"BWIN_WORLD", 0.0001238935, 4e-8},
        {"POLARWIN_IMAGE", 0.25533, 6e-6},
    };
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
        assert_near(scene_value(t, expected[i].name, 0, 0), expected[i].value, expected[i].tolerance);
    rx_table_free(t);
    rx_sources_free(sources);
}

static void vignets_are_cut_around_their_centre(void **state)
{
    rx_sources *sources = scene_sources(2);
    sources->vignet_width = 5, sources->vignet_height = 3;
    sources->vignets = RX_NEW(float, 2 * 15);
    assert_non_null(sources->vignets);
    for (int i = 0; i < 30; i++)
        sources->vignets[i] = (float)i;
    rx_table *t = scene_table("VIGNET(3,5)\n", sources);
    assert_int_equal(t->columns[0].ndim, 2);
    assert_near(scene_value(t, "VIGNET", 0, 7), 7, 0);            /* the centre */
    assert_near(scene_value(t, "VIGNET", 1, 6), 21, 0);           /* left of it, second source */
    assert_near(scene_value(t, "VIGNET", 0, 1), (float)-1e30, 0); /* no such row was measured */
    rx_table_free(t);
    rx_sources_free(sources);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_column_is_sound),
        cmocka_unit_test(param_files_as_users_have_them),
        cmocka_unit_test(warnings_are_said_once),
        cmocka_unit_test(bad_param_files),
        cmocka_unit_test(default_columns_are_those_of_the_file),
        cmocka_unit_test(values_leave_in_catalogue_conventions),
        cmocka_unit_test(upper_limits_of_fluxes_that_are_not_negative),
        cmocka_unit_test(world_shapes_as_in_sextractor),
        cmocka_unit_test(vignets_are_cut_around_their_centre),
    };
    return cmocka_run_group_tests(tests, enter_scratch, leave_scratch);
}
