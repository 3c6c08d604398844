/* psfex and scamp read our FITS_LDAC: a field of synthetic stars, its PSF and its astrometry. */
#include "../near.h"
#include "scene.h"

#include "base/random.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "io/output.h"

enum { STARS = 144, SIDE = 12, STEP = 80, VIGNET = 35 };
static const double FWHM = 3.2, CRVAL[2] = {150.1, 2.2}, SCALE = 1e-4; /* px, deg, deg per px */

static void add_cards(rx_text *cards)
{
    rx_card_integer(cards, "BITPIX", -32, "");
    rx_card_integer(cards, "NAXIS", 2, "");
    rx_card_integer(cards, "NAXIS1", SIDE * STEP, "");
    rx_card_integer(cards, "NAXIS2", SIDE * STEP, "");
    rx_card_text(cards, "CTYPE1", "RA---TAN", "");
    rx_card_text(cards, "CTYPE2", "DEC--TAN", "");
    rx_card_text(cards, "CUNIT1", "deg", "");
    rx_card_text(cards, "CUNIT2", "deg", "");
    rx_card_text(cards, "RADESYS", "ICRS", "");
    rx_card_number(cards, "EQUINOX", 2000, "");
    for (int i = 0; i < 2; i++) {
        char key[9];
        snprintf(key, sizeof key, "CRVAL%d", i + 1);
        rx_card_number(cards, key, CRVAL[i], "");
        snprintf(key, sizeof key, "CRPIX%d", i + 1);
        rx_card_number(cards, key, 0.5 * SIDE * STEP, "");
        snprintf(key, sizeof key, "CD%d_%d", i + 1, i + 1);
        rx_card_number(cards, key, i == 0 ? -SCALE : SCALE, "");
    }
    rx_card_number(cards, "EXPTIME", 1, "");
    rx_card_text(cards, "FILTER", "r", "");
}

/* Pixels of star i: a Gaussian of its flux in noise of 5 ADU. */
static void draw(const rx_source *s, int i, float *vignet)
{
    double sigma = FWHM / 2.3548;
    for (int y = 0; y < VIGNET; y++)
        for (int x = 0; x < VIGNET; x++) {
            double dx = floor(s->x + 0.5) + x - VIGNET / 2 - s->x,
                   dy = floor(s->y + 0.5) + y - VIGNET / 2 - s->y;
            double star =
                s->flux_auto / (2 * M_PI * sigma * sigma) * exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma));
            uint64_t counter = (uint64_t)((i * VIGNET + y) * VIGNET + x);
            vignet[y * VIGNET + x] = (float)(star + 5 * rx_random_normal(7, 1, counter));
        }
}

/* Stars on a jittered grid, far enough from each other; seen again with `shift` pixels of error. */
static rx_sources *stars(double shift)
{
    rx_sources *all = scene_sources(STARS);
    all->vignet_width = all->vignet_height = VIGNET;
    all->vignets = RX_NEW(float, (size_t)STARS *VIGNET *VIGNET);
    assert_non_null(all->vignets);
    for (int i = 0; i < STARS; i++) {
        rx_source *s = &all->list[i];
        double jx = rx_random_uniform(3, 1, (uint64_t)i), jy = rx_random_uniform(3, 2, (uint64_t)i);
        s->x = (i % SIDE + 0.3 + 0.4 * jx) * STEP + shift;
        s->y = (i / SIDE + 0.3 + 0.4 * jy) * STEP - shift;
        s->xwin = s->x, s->ywin = s->y;
        s->flux_auto = 2e4 * pow(10, 0.6 * rx_random_uniform(3, 3, (uint64_t)i));
        s->fluxerr_auto = 100;
        s->flux_aper[0] = s->flux_auto, s->fluxerr_aper[0] = 100;
        s->snr_win = s->flux_auto / 100;
        s->flux_radius[0] = 0.5 * FWHM * (1 + 0.01 * (jx - 0.5));
        s->a = 1.4, s->b = 1.35;
        s->errx2win = s->erry2win = 1e-4, s->errxywin = 0;
        s->alpha_j2000 = CRVAL[0] - SCALE * (s->x + 1 - 0.5 * SIDE * STEP) / cos(CRVAL[1] / 57.29578);
        s->delta_j2000 = CRVAL[1] + SCALE * (s->y + 1 - 0.5 * SIDE * STEP);
        s->alpha = s->x_world = s->alpha_j2000, s->delta = s->y_world = s->delta_j2000;
        s->world_matrix[0] = -SCALE, s->world_matrix[3] = SCALE;
        draw(s, i, all->vignets + (size_t)i * VIGNET * VIGNET);
    }
    return all;
}

static void write_ldac(const char *name, const char *param, double shift)
{
    rx_text cards = {0}, facts = {0};
    rx_outputs *outputs = NULL;
    rx_sources *sources = stars(shift);
    rx_table *table = scene_table(param, sources);
    add_cards(&cards);
    table->cards = cards.data;
    table->ncards = (long)(cards.length / 80);
    rx_card_text(&facts, "RXSIGMA", "5", "");
    rx_card_text(&facts, "RXGAIN", "2.5", "");
    table->facts = facts.data;
    table->nfacts = 2;
    assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
    const char *temporary = NULL;
    assert_int_equal(rx_outputs_file(outputs, name, &temporary, NULL), RX_OK);
    const rx_catalog catalog = {.type = RX_CATALOG_FITS_LDAC, .n = 1, .tables = &table};
    assert_int_equal(rx_catalog_write(&catalog, name, temporary, NULL, NULL), RX_OK);
    assert_int_equal(rx_outputs_commit(outputs, NULL), RX_OK);
    rx_outputs_free(outputs);
    rx_table_free(table);
    rx_sources_free(sources);
}

static int run(const char *command)
{
    char line[2000];
    snprintf(line, sizeof line, "%s >log 2>&1 || { cat log; false; }", command);
    return system(line);
}

static void psfex_models_our_stars(void **state)
{
    (void)state;
    if (!works("command -v psfex >/dev/null 2>&1")) {
        print_message("psfex is not installed\n");
        skip();
    }
    rx_table *model = NULL;
    double fwhm = 0, used = 0;
    write_ldac("stars.cat",
               "VIGNET(35,35)\nX_IMAGE\nY_IMAGE\nFLUX_RADIUS\nSNR_WIN\nFLUX_APER(1)\nFLUXERR_APER(1)"
               "\nELONGATION\nFLAGS\n",
               0);
    assert_int_equal(
        run("psfex stars.cat -c /dev/null -WRITE_XML N -CHECKPLOT_TYPE NONE -CHECKIMAGE_TYPE NONE "
            "-NTHREADS 1 -PSFVAR_DEGREES 1"),
        0);
    assert_int_equal(rx_fits_read_table("stars.psf", 0, &model, NULL), RX_OK);
    assert_true(rx_cards_number(model->cards, model->ncards, "PSF_FWHM", &fwhm));
    assert_true(rx_cards_number(model->cards, model->ncards, "ACCEPTED", &used));
    assert_near(fwhm, FWHM, 0.02);
    assert_true(used > 100);
    rx_table_free(model);
}

static void scamp_solves_our_field(void **state)
{
    (void)state;
    if (!works("command -v scamp >/dev/null 2>&1")) {
        print_message("scamp is not installed\n");
        skip();
    }
    char *head = NULL;
    write_ldac("field.cat",
               "XWIN_IMAGE\nYWIN_IMAGE\nERRAWIN_IMAGE\nERRBWIN_IMAGE\nERRTHETAWIN_IMAGE\nFLUX_AUTO\nFLUXERR_"
               "AUTO\nFLAGS\n",
               2.5);
    write_ldac("sky.cat",
               "X_WORLD\nY_WORLD\nERRAWIN_WORLD\nERRBWIN_WORLD\nERRTHETAWIN_WORLD\nMAG_AUTO\nMAGERR_AUTO\n",
               0);
    assert_int_equal(
        run("scamp field.cat -c /dev/null -ASTREF_CATALOG FILE -ASTREFCAT_NAME sky.cat -ASTREFCENT_KEYS "
            "X_WORLD,Y_WORLD -ASTREFERR_KEYS ERRAWIN_WORLD,ERRBWIN_WORLD,ERRTHETAWIN_WORLD -ASTREFMAG_KEY "
            "MAG_AUTO "
            "-ASTREFMAGERR_KEY MAGERR_AUTO -DISTORT_DEGREES 1 -SOLVE_PHOTOM N -CHECKPLOT_TYPE NONE "
            "-WRITE_XML N "
            "-NTHREADS 1 -PIXSCALE_MAXERR 1.1 -POSANGLE_MAXERR 1 -POSITION_MAXERR 0.2"),
        0);
    assert_int_equal(rx_text_read_file("field.head", 1 << 20, &head, NULL, NULL), RX_OK);
    char *pixel = strstr(head, "CRPIX1"), *sky = strstr(head, "CRVAL1");
    assert_true(pixel != NULL);
    assert_true(sky != NULL);
    double x = strtod(strchr(pixel, '=') + 1, NULL), alpha = strtod(strchr(sky, '=') + 1, NULL);
    /* the sky at pixel 0.5 * SIDE * STEP + 2.5 is CRVAL, to 0.1 px */
    double at = x + (CRVAL[0] - alpha) * cos(CRVAL[1] / 57.29578) / -SCALE;
    assert_near(at, 0.5 * SIDE * STEP + 2.5, 0.1);
    free(head);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(psfex_models_our_stars),
        cmocka_unit_test(scamp_solves_our_field),
    };
    return cmocka_run_group_tests(tests, enter_scratch, leave_scratch);
}
