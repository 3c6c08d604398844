/* World coordinates: against astropy on real headers, against formulas on small ones. */
#include "../near.h"
#include "io_test.h"

#include <math.h>
#include <pthread.h>

#include "io/tile.h"
#include "io/wcs.h"

static const double DEGREE = 0.017453292519943295769;

static double distance(double lon1, double lat1, double lon2, double lat2)
{
    double a = sin((lat2 - lat1) / 2 * DEGREE), b = sin((lon2 - lon1) / 2 * DEGREE);
    return 2 * asin(sqrt(a * a + cos(lat1 * DEGREE) * cos(lat2 * DEGREE) * b * b)) / DEGREE;
}

static rx_wcs *from_lines(const char *lines, int width, int height, char note[256])
{
    rx_text cards = {0};
    rx_wcs *wcs = NULL;
    rx_error err = RX_ERROR_NONE;
    cards_from(lines, &cards);
    rx_wcs_notes said = {0};
    assert_int_equal(rx_wcs_from_cards(cards.data, cards.length / 80, width, height, &wcs, &said, &err),
                     RX_OK);
    snprintf(note, 256, "%s%s%s", said.warnings.length > 0 ? "warning: " : "",
             said.warnings.length > 0 ? said.warnings.data : "",
             said.details.length > 0 ? said.details.data : "");
    rx_wcs_notes_free(&said);
    rx_text_free(&cards);
    return wcs;
}

/* --- real headers --- */

struct expected {
    const char *file;
    int hdu;
    double x, y, lon, lat, ra, dec;
};

static const struct expected EXPECTED[] = {
#include "wcs_expected.inc"
};

static void check_real(const char *folder, const struct expected *e)
{
    char path[1024];
    rx_tile *tile = NULL;
    rx_error err = RX_ERROR_NONE;
    const rx_tile_params par = {.weight_threshold = NAN};
    double lon, lat, ra, dec, x, y;
    snprintf(path, sizeof path, "%s/%s", folder, e->file);
    assert_int_equal(rx_tile_read(&par, path, e->hdu, 1, NULL, &tile, &err), RX_OK);
    assert_non_null(tile->wcs);
    rx_wcs_to_native(tile->wcs, 1, &e->x, &e->y, &lon, &lat);
    rx_wcs_native_to_j2000(tile->wcs, 1, &lon, &lat, &ra, &dec);
    if (distance(lon, lat, e->lon, e->lat) > 1e-9 || distance(ra, dec, e->ra, e->dec) > 1e-9)
        print_message("%s: off by %g deg, %g deg\n", e->file, distance(lon, lat, e->lon, e->lat),
                      distance(ra, dec, e->ra, e->dec));
    assert_true(distance(lon, lat, e->lon, e->lat) < 1e-9);
    assert_true(distance(ra, dec, e->ra, e->dec) < 1e-9);
    rx_wcs_to_pixel(tile->wcs, 1, &e->ra, &e->dec, &x, &y);
    assert_true(fabs(x - e->x) < 1e-5);
    assert_true(fabs(y - e->y) < 1e-5);
    rx_tile_free(tile);
}

static void test_real_headers(void **state)
{
    const char *folder = real_data();
    if (folder == NULL)
        skip();
    for (size_t i = 0; i < sizeof EXPECTED / sizeof EXPECTED[0]; i++)
        check_real(folder, &EXPECTED[i]);
}

/* A section of a tile shows the same sky. */
static void test_sections(void **state)
{
    static const char *const files[] = {"wcs/tpv.fits.gz", "wcs/sipsample.fits", "wcs/tnx.fits",
                                        "fields/M6707HH.fits", "fields/spitzer_example_image.fits"};
    const char *folder = real_data();
    if (folder == NULL)
        skip();
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        char path[1024], part[1100];
        rx_tile *whole = NULL, *cut = NULL;
        const rx_tile_params par = {.weight_threshold = NAN};
        double x = 130, y = 95, xc = x - 100, yc = y - 50, ra, dec, ra_cut, dec_cut;
        snprintf(path, sizeof path, "%s/%s", folder, files[i]);
        snprintf(part, sizeof part, "%s[0][101:160,51:120]", path);
        assert_int_equal(rx_tile_read(&par, path, 0, 1, NULL, &whole, NULL), RX_OK);
        assert_int_equal(rx_tile_read(&par, part, 0, 1, NULL, &cut, NULL), RX_OK);
        assert_int_equal(cut->width, 60);
        assert_int_equal(cut->height, 70);
        size_t at = (size_t)y * (size_t)whole->width + (size_t)x;
        assert_true(cut->pixels[(size_t)yc * 60 + (size_t)xc] == whole->pixels[at]);
        rx_wcs_to_sky(whole->wcs, 1, &x, &y, &ra, &dec);
        rx_wcs_to_sky(cut->wcs, 1, &xc, &yc, &ra_cut, &dec_cut);
        assert_true(distance(ra, dec, ra_cut, dec_cut) < 1e-9);
        rx_tile_free(whole);
        rx_tile_free(cut);
    }
}

/* --- formulas --- */

#define TAN_HEADER(type)                                                                                     \
    "NAXIS   =                    2\nNAXIS1  =                 1000\nNAXIS2  =                  800\n"       \
    "CTYPE1  = 'RA---" type "'\nCTYPE2  = 'DEC--" type "'\nCRVAL1  =  150.25\nCRVAL2  =  2.5\n"              \
    "CRPIX1  =  500.5\nCRPIX2  =  400.5\nCD1_1   =  -5.5E-5\nCD1_2   =  1.0D-6\nCD2_1   =  1.2E-6\n"         \
    "CD2_2   =  5.4E-5\nRADESYS = 'ICRS'\n"

/* Gnomonic projection by hand (Calabretta and Greisen 2002, 5.1.3): xi, eta in degrees. */
static void gnomonic(double xi, double eta, double *ra, double *dec)
{
    double a0 = 150.25 * DEGREE, d0 = 2.5 * DEGREE, x = xi * DEGREE, y = eta * DEGREE;
    double w = cos(d0) - y * sin(d0);
    *ra = (a0 + atan2(x, w)) / DEGREE;
    *dec = atan2(sin(d0) + y * cos(d0), hypot(w, x)) / DEGREE;
}

static void linear(double x, double y, double *xi, double *eta)
{
    double u = x + 1 - 500.5, v = y + 1 - 400.5;
    *xi = -5.5e-5 * u + 1e-6 * v;
    *eta = 1.2e-6 * u + 5.4e-5 * v;
}

static void check_against(rx_wcs *wcs, void (*model)(double, double, double *, double *))
{
    for (int i = 0; i < 30; i++) {
        double x = -50 + 37.7 * i, y = 820 - 29.3 * i, xi, eta, ra0, dec0, ra, dec, back_x, back_y;
        model(x, y, &xi, &eta);
        gnomonic(xi, eta, &ra0, &dec0);
        rx_wcs_to_sky(wcs, 1, &x, &y, &ra, &dec);
        assert_true(distance(ra, dec, ra0, dec0) < 1e-11);
        rx_wcs_to_pixel(wcs, 1, &ra, &dec, &back_x, &back_y);
        assert_true(hypot(back_x - x, back_y - y) < 1e-6);
    }
}

static void test_tan(void **state)
{
    char note[256];
    double m[4];
    rx_wcs *wcs = from_lines(TAN_HEADER("TAN"), 1000, 800, note);
    assert_non_null(wcs);
    assert_string_equal(note, "");
    check_against(wcs, linear);
    rx_wcs_matrix(wcs, 499.5, 399.5, m); /* at the reference pixel: CD itself */
    assert_true(fabs(m[0] + 5.5e-5) < 1e-12);
    assert_true(fabs(m[1] - 1e-6) < 1e-12);
    assert_true(fabs(m[2] - 1.2e-6) < 1e-12);
    assert_true(fabs(m[3] - 5.4e-5) < 1e-12);
    assert_true(fabs(rx_wcs_pixel_scale(wcs, 499.5, 399.5) - 3600 * sqrt(5.5e-5 * 5.4e-5 + 1.2e-12)) < 1e-6);
    rx_wcs_free(wcs);
}

#define PV_CARDS                                                                                             \
    "PV1_0   =  1.0E-5\nPV1_1   =  1.001\nPV1_2   = -2.0E-4\nPV1_4   =  0.03\nPV1_7   =  1.5\n"              \
    "PV2_0   = -2.0E-5\nPV2_1   =  0.999\nPV2_2   =  1.0E-4\nPV2_6   =  0.02\nPV2_7   =  -0.5\n"

/* TPV: xi' = PV1_0 + PV1_1 xi + PV1_2 eta + PV1_4 xi^2 + PV1_7 xi^3; eta' with the roles exchanged. */
static void tpv(double x, double y, double *xi, double *eta)
{
    double a, b;
    linear(x, y, &a, &b);
    *xi = 1e-5 + 1.001 * a - 2e-4 * b + 0.03 * a * a + 1.5 * a * a * a;
    *eta = -2e-5 + 0.999 * b + 1e-4 * a + 0.02 * a * a - 0.5 * b * b * b;
}

#define SIP_CARDS                                                                                            \
    "A_ORDER =  2\nB_ORDER =  2\nA_2_0   =  2.0E-6\nA_1_1   = -1.0E-6\nB_0_2   =  3.0E-6\nB_2_0   =  "       \
    "1.0E-6\n"

static void sip(double x, double y, double *xi, double *eta)
{
    double u = x + 1 - 500.5, v = y + 1 - 400.5;
    double f = u + 2e-6 * u * u - 1e-6 * u * v, g = v + 3e-6 * v * v + 1e-6 * u * u;
    *xi = -5.5e-5 * f + 1e-6 * g;
    *eta = 1.2e-6 * f + 5.4e-5 * g;
}

/* --- numbers and contradictions --- */

#define TYPES "CTYPE1  = 'RA---TAN'\nCTYPE2  = 'DEC--TAN'\n"
#define CENTRE "CRVAL1  = 150.25\nCRVAL2  = 2.5\n"
#define PIXEL "CRPIX1  = 500.5\nCRPIX2  = 400.5\n"
#define MATRIX "CD1_1   = -5.5E-5\nCD1_2   = 1.0E-6\nCD2_1   = 1.2E-6\nCD2_2   = 5.4E-5\n"

/* A type that only looks like one is no silent want of coordinates. */
static void test_types_of_another_spelling(void **state)
{
    static const char *const headers[] = {
        "CTYPE1  = 'ra---tan'\nCTYPE2  = 'dec--tan'\n" CENTRE PIXEL MATRIX,
        "CTYPE1  = ' RA---TAN'\nCTYPE2  = ' DEC--TAN'\n" CENTRE PIXEL MATRIX,
        "CTYPE1  = RA---TAN\nCTYPE2  = DEC--TAN\n" CENTRE PIXEL MATRIX};
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++) {
        char note[256];
        rx_wcs *wcs = from_lines(headers[i], 1000, 800, note);
        assert_true(wcs != NULL || strstr(note, "warning: no world coordinates") != NULL);
        rx_wcs_free(wcs);
    }
}

/* A frame that is none is warned of, and takes no position away. */
static void test_unknown_frame(void **state)
{
    static const char *const frames[] = {"ICRS", "FK5", "J2000"};
    double x = 10, y = 20, alpha[3], delta[3];
    for (int i = 0; i < 3; i++) {
        char note[256], lines[1024];
        snprintf(lines, sizeof lines, "RADESYS = '%s'\n%s", frames[i], TYPES CENTRE PIXEL MATRIX);
        rx_wcs *wcs = from_lines(lines, 1000, 800, note);
        assert_non_null(wcs);
        assert_int_equal(strstr(note, "warning: RADESYS = 'J2000' is no reference system") != NULL, i == 2);
        rx_wcs_to_sky(wcs, 1, &x, &y, &alpha[i], &delta[i]);
        assert_near(alpha[i], alpha[0], 1e-9);
        assert_near(delta[i], delta[0], 1e-9);
        rx_wcs_free(wcs);
    }
}

/* The same sky, however it is written; what contradicts it is warned of, and what only repeats it is not. */
static void test_numbers(void **state)
{
    static const struct {
        const char *lines, *said;
        int warns;
        void (*model)(double x, double y, double *xi, double *eta);
    } cases[] = {
        {TAN_HEADER("TPV") PV_CARDS, "", 0, tpv},
        {TAN_HEADER("TAN") PV_CARDS, "TPV", 0, tpv},
        {TAN_HEADER("TAN-SIP") SIP_CARDS, "", 0, sip},
        {TAN_HEADER("TAN-SIP") SIP_CARDS PV_CARDS, "PV coefficients beside SIP", 0, sip},
        /* SExtractor takes TAN for half of SIP */
        {TAN_HEADER("TAN") SIP_CARDS, "SIP coefficients are not used", 1, linear},
        {TAN_HEADER("TAN-SIP") "A_ORDER = 2\nA_2_0   = 2E-6", "SIP coefficients are not used", 1, linear},
        {TAN_HEADER("TAN") "A_2_0   = 'x'", "SIP coefficients are not used", 1, linear},
        {"CTYPE1  = 'RA---TAN-SIP'\n" TAN_HEADER("TAN") SIP_CARDS, "SIP coefficients are not used", 1,
         linear},
        /* TPV without coefficients, or with some, of which a linear one is 1 */
        {TAN_HEADER("TPV"), "", 0, linear},
        {TAN_HEADER("TPV") "PV1_1   = 1.0", "", 0, linear},
        {TAN_HEADER("TAN") "PV2_1   = 1.0", "", 0, linear},
        {TYPES "CRVAL1  = '150.25  '\nCRVAL2  = '2.5 deg'\n" PIXEL MATRIX, "", 0, linear},
        {TYPES CENTRE "CRPIX1  = '500.5 pix'\nCRPIX2  = 400.5 [pixel] / centre\n" MATRIX, "", 0, linear},
        {TYPES CENTRE PIXEL
         "CD1_1   = '-5.5D-5'\nCD1_2   =1.0E-6\nCD2_1   = 1.2E-6 deg/pix\nCD2_2   = '5.4d-05 deg'",
         "", 0, linear},
        {TYPES CENTRE PIXEL MATRIX "EQUINOX = 'J2000.0'", "", 0, linear},
        {TYPES CENTRE PIXEL MATRIX "EQUINOX = 'now'", "EQUINOX = 'now' is no number and counts as absent", 1,
         linear},
        {TYPES CENTRE PIXEL MATRIX "CRVAL1  = 30", "CRVAL1 = '30': there is one before it, which is taken", 1,
         linear},
        {TYPES CENTRE PIXEL MATRIX "CRVAL1  = 150.25", "", 0, linear},
        {TYPES CENTRE PIXEL MATRIX "CTYPE1  = 'RA---SIN'", "CTYPE1 = 'RA---SIN': there is one before it", 1,
         linear},
        {TYPES CENTRE PIXEL MATRIX "PC1_1   = 1\nPC2_2   = 1\nCDELT1  = 1\nCDELT2  = 1", "contradict", 1,
         linear},
        {"PC1_1   = 1\nPC2_2   = 1\nCDELT1  = -2E-4\nCDELT2  = 2E-4\n" TYPES CENTRE PIXEL MATRIX,
         "contradict", 1, linear},
        {TYPES CENTRE PIXEL MATRIX "CDELT1  = -1E-4\nCDELT2  = 1E-4", "CDi_j and CDELTi contradict", 1,
         linear},
        {TYPES CENTRE PIXEL MATRIX "CDELT1  = -5.5E-5\nCDELT2  = 5.4E-5\nCROTA2  = 30", "contradict", 1,
         linear},
        {TYPES CENTRE PIXEL MATRIX "CDELT1  = -5.5E-5\nCDELT2  = 5.4E-5", "", 0, linear},
        {TYPES CENTRE PIXEL MATRIX "CDELT1  = 1.0\nCDELT2  = 1.0", "", 0, linear},
        {TYPES CENTRE PIXEL MATRIX "PC1_1   = -5.5E-5\nPC1_2   = 1E-6\nPC2_1   = 1.2E-6\nPC2_2   = 5.4E-5",
         "", 0, linear},
        {TYPES CENTRE PIXEL "PC1_1   = 1\nPC2_2   = 1\nPC1_2   = -1.818181818181818E-02\n"
                            "PC2_1   = 2.222222222222222E-02\nCDELT1  = '-5.5E-5'\nCDELT2  = 5.4E-5",
         "", 0, linear},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char note[256];
        rx_wcs *wcs = from_lines(cases[i].lines, 1000, 800, note);
        if (wcs == NULL || strstr(note, cases[i].said) == NULL)
            print_message("%zu: %s\n", i, note);
        assert_non_null(wcs);
        assert_non_null(strstr(note, cases[i].said));
        assert_int_equal(strncmp(note, "warning: ", 9) == 0, cases[i].warns);
        check_against(wcs, cases[i].model);
        rx_wcs_free(wcs);
    }
}

/* Half of a solution gives no positions, and says what is missing. */
static void test_half_read(void **state)
{
    static const struct {
        const char *lines, *said;
    } cases[] = {
        {TYPES "CRVAL1  = 150,25\nCRVAL2  = 2.5\n" PIXEL MATRIX, "CRVAL1 = '150,25': no number"},
        {TYPES "CRVAL1  = '10:01:00'\nCRVAL2  = '02:30:00'\n" PIXEL MATRIX, "CRVAL1 = '10:01:00', CRVAL2 = "},
        {TYPES "CRVAL1  = '10h01m'\nCRVAL2  = 2.5\n" PIXEL MATRIX, "no number"},
        {TYPES "CRVAL1  = NaN\nCRVAL2  = 2.5\n" PIXEL MATRIX, "CRVAL1 = 'NaN': no number"},
        {TYPES "CRVAL1  =           / deg\nCRVAL2  = 2.5\n" PIXEL MATRIX, "CRVAL1: no number"},
        {TYPES CENTRE "CRPIX1  = 'centre'\nCRPIX2  = 400.5\n" MATRIX, "CRPIX1 = 'centre': no number"},
        {TYPES CENTRE PIXEL "CDELT1  = '0.2 arcsec'\nCDELT2  = '0.2 arcsec'", "CDELT1 = '0.2 arcsec'"},
        {TYPES CENTRE PIXEL MATRIX "PV1_1   = 'it''s'", "PV1_1 = "},
        {TYPES "CRVAL2  = 2.5\n" PIXEL MATRIX, "CRVAL1 is missing"},
        {TYPES CENTRE "CRPIX1  = 500.5\n" MATRIX, "CRPIX2 is missing"},
        {TYPES CENTRE PIXEL, "CDi_j and CDELTi are missing"},
        {TYPES CENTRE PIXEL "CD1_1   = 0\nCD2_2   = 0", "singular"},
        {TYPES CENTRE PIXEL "CD1_1   = 0\nCD2_2   = 0\nCDELT1  = -1E-4\nCDELT2  = 1E-4", "singular"},
        {TYPES CENTRE PIXEL "CDELT1  = 0\nCDELT2  = 0", "singular"},
        {TYPES CENTRE PIXEL "CDELT1  = 1E-4", "singular"},
        {TYPES CENTRE PIXEL "CD1_1   = 1E-4\nCD1_2   = 1E-4\nCD2_1   = 1E-4\nCD2_2   = 1E-4", "singular"},
        {"CTYPE1  = 'RA---TAN'\n" CENTRE PIXEL MATRIX, "no world coordinates"},
        {TAN_HEADER("TNX"), "WAT1_ and WAT2_ do not hold"},
        {TAN_HEADER("TNX") "WAT1_001= 'wtype=tnx axtype=ra lngcor = \"3. 1. 1. 2. -1 1 -1 1 0.\"'\n"
                           "WAT2_001= 'wtype=tnx axtype=dec'",
         "WAT1_ and WAT2_ do not hold"},
        {"CRVAL1  = '1,5'\nCRVAL2  = 2", "CRVAL1 = '1,5': no number"},
        {TAN_HEADER("TAN-SIP") "A_ORDER = 2\nB_ORDER = 'two'\nA_2_0   = 2E-6", "B_ORDER = 'two': no number"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char note[256];
        rx_wcs *wcs = from_lines(cases[i].lines, 1000, 800, note);
        if (wcs != NULL || strstr(note, cases[i].said) == NULL)
            print_message("%zu: %s\n", i, note);
        assert_null(wcs);
        assert_int_equal(strncmp(note, "warning: ", 9), 0);
        assert_non_null(strstr(note, cases[i].said));
    }
}

/* A place far away must not fold back into the image by its polynomial. */
static void test_far_away(void **state)
{
    char note[256];
    rx_wcs *wcs = from_lines(TAN_HEADER("TPV") PV_CARDS, 1000, 800, note);
    double ra[4] = {330.25, 151.25, 150.25, 149.0}, dec[4] = {-2.5, 2.5, 3.9, 80}, x[4], y[4];
    assert_non_null(wcs);
    rx_wcs_to_pixel(wcs, 4, ra, dec, x, y);
    for (int i = 0; i < 4; i++)
        assert_false(x[i] > -1 && x[i] < 1000 && y[i] > -1 && y[i] < 800);
    assert_true(isnan(x[0]));
    rx_wcs_free(wcs);
}

/* --- frames: numbers by astropy 5.2 (SkyCoord.transform_to(FK5("J2000"))) --- */

static void check_frame(const char *lon_type, const char *lat_type, const char *more, double lon, double lat,
                        double ra0, double dec0)
{
    char lines[1024], note[256];
    double x = 49.5, y = 49.5, native[2], ra, dec, back_x, back_y;
    snprintf(
        lines, sizeof lines,
        "CTYPE1  = '%s'\nCTYPE2  = '%s'\nCRVAL1  = %.1f\nCRVAL2  = %.1f\nCRPIX1  = 50.5\nCRPIX2  = 50.5\n"
        "CDELT1  = -0.0001\nCDELT2  = 0.0001\n%s",
        lon_type, lat_type, lon, lat, more);
    rx_wcs *wcs = from_lines(lines, 100, 100, note);
    assert_non_null(wcs);
    rx_wcs_to_native(wcs, 1, &x, &y, &native[0], &native[1]);
    rx_wcs_native_to_j2000(wcs, 1, &native[0], &native[1], &ra, &dec);
    assert_true(distance(native[0], native[1], lon, lat) < 1e-12);
    if (distance(ra, dec, ra0, dec0) > 1e-8)
        print_message("%s %s: off by %g arcsec\n", lon_type, more, 3600 * distance(ra, dec, ra0, dec0));
    assert_true(distance(ra, dec, ra0, dec0) < 1e-8);
    rx_wcs_to_pixel(wcs, 1, &ra, &dec, &back_x, &back_y);
    assert_true(hypot(back_x - x, back_y - y) < 1e-5);
    rx_wcs_free(wcs);
}

static void test_frames(void **state)
{
    check_frame("RA---TAN", "DEC--TAN", "", 45, -60, 45, -60);
    check_frame("RA---TAN", "DEC--TAN", "RADESYS = 'FK5'\nEQUINOX = 2000.0", 45, -60, 45, -60);
    check_frame("RA---TAN", "DEC--TAN", "EQUINOX = 1991.25", 45, -60, 45.05245331, -59.96556779);
    check_frame("RA---TAN", "DEC--TAN", "EQUINOX = 1950.0", 120, 35, 120.808253156211, 34.859123751486);
    check_frame("RA---TAN", "DEC--TAN", "EPOCH   = 1950.0", 120, 35, 120.808253156211, 34.859123751486);
    check_frame("RA---TAN", "DEC--TAN", "RADESYS = 'FK4-NO-E'\nEQUINOX = 1950.0", 120, 35, 120.808362451603,
                34.859099165582);
    check_frame("GLON-TAN", "GLAT-TAN", "", 10, 20, 254.284950622924, -9.782224135720);
    check_frame("SLON-TAN", "SLAT-TAN", "", 10, 20, 355.993033977111, 73.774158971708);
}

/* By definition of the frame: ecliptic pole and equinox; FK4 of an equinox other than B1950
 * against astropy within its slightly different precession. */
static void test_frames_loosely(void **state)
{
    char note[256];
    double x = 49.5, y = 49.5, ra, dec;
    rx_wcs *wcs =
        from_lines("CTYPE1  = 'ELON-CAR'\nCTYPE2  = 'ELAT-CAR'\nCRVAL1  = 90\nCRVAL2  = 0\nCRPIX1  = 50.5\n"
                   "CRPIX2  = 50.5\nCDELT1  = -0.0001\nCDELT2  = 0.0001\nEQUINOX = 2000",
                   100, 100, note);
    assert_non_null(wcs);
    rx_wcs_to_sky(wcs, 1, &x, &y, &ra, &dec);
    assert_true(distance(ra, dec, 90, 84381.448 / 3600) < 1e-9);
    rx_wcs_free(wcs);
    wcs = from_lines(
        "CTYPE1  = 'RA---TAN'\nCTYPE2  = 'DEC--TAN'\nCRVAL1  = 300\nCRVAL2  = -75\nCRPIX1  = 50.5\n"
        "CRPIX2  = 50.5\nCDELT1  = -0.0001\nCDELT2  = 0.0001\nEQUINOX = 1975\nRADESYS = 'FK4'",
        100, 100, note);
    assert_non_null(wcs);
    assert_non_null(strstr(note, "FK4"));
    rx_wcs_to_sky(wcs, 1, &x, &y, &ra, &dec);
    assert_true(distance(ra, dec, 300.768004866626, -74.929545948449) < 0.02 / 3600);
    rx_wcs_free(wcs);
}

/* --- what cannot be used --- */

static void test_unusable(void **state)
{
    static const char *const headers[] = {
        "NAXIS   = 2\nEXPTIME = 3.0",
        "CTYPE1  = 'LINEAR'\nCTYPE2  = 'LINEAR'\nCRVAL1  = 1.0\nCRVAL2  = 1.0",
        "AP_1_0  = 1E-5",
        "CTYPE1  = 'RA---TAN'\nBP_0_1  = 1E-6",
        "CTYPE1  = 'RA---TAN'\nCTYPE2  = 'DEC--TAN'\nCRVAL1  = 10.0\nCRVAL2  = 10.0\nCD1_1   = 0.0\nCD1_2   "
        "= 0.0\n"
        "CD2_1   = 1.0\nCD2_2   = 1.0",
        "CTYPE1  = 'RA---TAN'\nCTYPE2  = 'DEC--SIN'\nCRVAL1  = 10.0\nCRVAL2  = 10.0",
        "CTYPE1  = 'RA---TAN'\nCTYPE2  = 'FREQ'\nCRVAL1  = 10.0\nCRVAL2  = 10.0",
        "CTYPE1  = 'RA---XYZ'\nCTYPE2  = 'DEC--XYZ'\nCRVAL1  = 10.0\nCRVAL2  = 10.0",
        "CTYPE1  = 'RA---TAN'\nCTYPE2  = 'DEC--TAN'\nCRVAL1  = 10.0\nCRVAL2  = 1000.0",
    };
    for (size_t i = 0; i < sizeof headers / sizeof headers[0]; i++) {
        char note[256];
        rx_wcs *wcs = from_lines(headers[i], 100, 100, note);
        assert_null(wcs);
        assert_non_null(strstr(note, "no world coordinates"));
    }
    rx_wcs *wcs = NULL;
    assert_int_equal(rx_wcs_from_cards(NULL, 0, 10, 10, &wcs, NULL, NULL), RX_OK);
    assert_null(wcs);
}

/* Cards that wcslib does not survive; without them the header is as good as it was. */
static void test_hostile_cards(void **state)
{
    static const char *const cards[] = {
        "WAT1_001= 'wtype=tan lngcor = and no quote at the end of the card",
        "WAT1_000= 'wtype=tnx axtype=ra lngcor = \"3. 4. 4. 2. -0.1 0.1\"'",
        "WCSAXES \xff\xff\xff\xff\xff\xff= 2",
        "A_2_0   =E1LINEAR'",
        "WAT1_001= 'wtype=tnxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx axtype=ra'",
        "WAT1_001= 'axtype=ra wtype = tnxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx q'",
        "WAT1_001= 'wtype= t'\nWAT1_002= 'nxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx'",
        "WAT1_002= 'wtype=tnx axtype=ra'",
        "A_2_0   = .",
        "AP_1_1  = 'text'",
        "B_0_2   = 1.5.2",
        "CPDIS1  = 'LOOKUP'\nDP1     = 'NAXES: 2'\nDP1     = 'NAXES'",
        "EQUINOX = 2000.0 and then something that is no comment",
        "NAXIS   = 177500.0",
        "NAXIS   = 100000",
        "WCSAXES = 2E5",
    };
    for (size_t i = 0; i < sizeof cards / sizeof cards[0]; i++) {
        char lines[600], note[256];
        double ra, dec, x = 49, y = 49;
        snprintf(lines, sizeof lines,
                 "CTYPE1  = 'RA---TAN'\nCTYPE2  = 'DEC--TAN'\nCRVAL1  = 1.0D1\nCRVAL2  = +20. / north\n"
                 "CRPIX1  = 50\nCRPIX2  = 50\nCD1_1   = -1e-4\nCD2_2   = .0001\n%s\nCOMMENT \xb5",
                 cards[i]);
        rx_wcs *wcs = from_lines(lines, 100, 100, note);
        assert_non_null(wcs);
        rx_wcs_to_native(wcs, 1, &x, &y, &ra, &dec);
        assert_near(ra, 10, 1e-9);
        assert_near(dec, 20, 1e-9);
        rx_wcs_free(wcs);
    }
    char note[256];
    assert_null(from_lines("CTYPE1  = 'RA---TAN'\nCTYPE2  = 'DEC--TAN'\nCRVAL1  = 10\nCRVAL2  = 20\n"
                           "CRPIX1  = 50\nCRPIX2  = 50\nCD1_1   = -1e-4\nCD2_2   = 1e-4\nCQDIS1  = 'TPD'",
                           100, 100, note));
    assert_non_null(strstr(note, "CQDIS"));
    /* the solution of a plate beside one axis, in whatever order */
    assert_null(from_lines("CTYPE1  = 'RA---TAN'\nCRVAL1  = 10\nCRPIX1  = 5\nCNPIX2  = 24\nAMDX1   = 67", 100,
                           100, note));
    assert_null(
        from_lines("NAXIS   = 2\nNAXIS   = 1\nCNPIX2  = 24\nAMDX1   = 67\nCRPIX1  = 5", 100, 100, note));
    /* and one that is no number */
    assert_null(from_lines("NAXIS   = 2\nCNPIX1  = 'wt'", 100, 100, note));
}

/* wcslib takes one card of the solution of a plate for all of it, and WAT at its word. Beside good coordinates such
 * halves change nothing; what could have been a solution is said to be ignored. */
static void test_halves_of_distortions(void **state)
{
    static const struct {
        const char *cards, *note;
    } cases[] = {
        {"XPIXELSZ= 9.0\nYPIXELSZ= 9.0", ""},
        {"CNPIX1  = 100\nCNPIX2  = 200\nPLTRAH  = 10", ""},
        {"AMDX2   = .1", "not complete"},
        {"AMDX1   = 67.2\nPLATEID = 'twenty characters and forty more, which eight numbers cannot hold'",
         "not complete"},
        {"PLATEID = 'twenty characters and forty more, which eight numbers cannot hold ' / name", ""},
        {"WAT1_001= 'wtype=tnx axtype=ra lngcor = \"1. 9. 9. 7. 0 1 0 1 1 2 3 \"'\n"
         "WAT2_001= 'wtype=tnx axtype=dec latcor = \"1. 9. 9. 7. 0 1 0 1 1 2 3 \"'",
         ""},
        {"WAT1_001= 'wtype=tnx'\nWAT2_001= 'wtype=tnx'", ""},
        {"A_0_2   = 0.\nAMDX1   = 67.2\nWAT1_001= 'wtype=tnx'", "not complete"},
        {"CTYPE1  = 'RA---TAN-SIP'\nCTYPE2  = 'DEC--TAN-SIP'\nA_ORDER = 2\nB_ORDER = 2\nA_0_2   = 0.\nB_0_2  "
         " = 0.\n"
         "AMDX1   = 67.2\nWAT1_001= 'wtype=tnx'",
         "beside another"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char lines[1000], note[256];
        double ra, dec, x = 49, y = 49;
        snprintf(lines, sizeof lines,
                 "%s\nCTYPE1  = 'RA---TAN'\nCTYPE2  = 'DEC--TAN'\nCRVAL1  = 10\nCRVAL2  = 20\nCRPIX1  = 50\n"
                 "CRPIX2  = 50\nCD1_1   = -1E-4\nCD2_2   = 1E-4",
                 cases[i].cards);
        rx_wcs *wcs = from_lines(lines, 100, 100, note);
        assert_non_null(wcs);
        assert_non_null(strstr(note, cases[i].note));
        assert_true(cases[i].note[0] != '\0' || strstr(note, "plate") == NULL);
        rx_wcs_to_native(wcs, 1, &x, &y, &ra, &dec);
        assert_near(ra, 10, 1e-9);
        assert_near(dec, 20, 1e-9);
        rx_wcs_free(wcs);
    }
    char note[256];
    assert_null(from_lines("CTYPE1  = 'DEC--ZEA'\nCTYPE2  = 4096\nAMDX2   = .1", 100, 100, note));
    assert_non_null(strstr(note, "not complete"));
}

/* The solution of a plate is used when every card of it is there, PLATEID behind it or not. */
static void test_plate(void **state)
{
    static const char *const cards[] = {
        "CNPIX1  = 6000",  "CNPIX2  = 7000", "PPO3    = 177500", "PPO6    = 177500", "XPIXELSZ= 25.0",
        "YPIXELSZ= 25.0",  "PLTRAH  = 10",   "PLTRAM  = 20",     "PLTRAS  = 3.5",    "PLTDECSN= '-'",
        "PLTDECD = 30",    "PLTDECM = 1",    "PLTDECS = 2.0",    "AMDX1   = 67.2",   "AMDX2   = 0.1",
        "AMDX3   = -20.5", "AMDY1   = 67.2", "AMDY2   = -0.1",   "AMDY3   = 30.5",   "PLATEID = '06S2'"};
    enum { N = sizeof cards / sizeof *cards };
    for (int missing = 0; missing < N; missing++) {
        char lines[1600] = "NAXIS   = 2", note[256];
        for (int i = 0; i < N; i++)
            if (i != missing)
                snprintf(lines + strlen(lines), sizeof lines - strlen(lines), "\n%s", cards[i]);
        rx_wcs *wcs = from_lines(lines, 100, 100, note);
        if (missing < N - 1) {
            assert_null(wcs);
            assert_non_null(strstr(note, "not complete"));
            continue;
        }
        double ra, dec, x = 1099.5, y = 99.5; /* the centre of the plate, up to its offsets */
        assert_non_null(wcs);
        rx_wcs_to_native(wcs, 1, &x, &y, &ra, &dec);
        assert_near(ra, (10 + (20 + 3.5 / 60) / 60) * 15, 0.02);
        assert_near(dec, -(30 + (1 + 2.0 / 60) / 60), 0.02);
        rx_wcs_free(wcs);
        strcat(lines, "\nPLATEID = '06S2'");
        double again[2];
        wcs = from_lines(lines, 100, 100, note);
        assert_non_null(wcs);
        rx_wcs_to_native(wcs, 1, &x, &y, &again[0], &again[1]);
        assert_near(again[0], ra, 1e-12);
        assert_near(again[1], dec, 1e-12);
        rx_wcs_free(wcs);
    }
}

static void test_linear(void **state)
{
    rx_text cards = {0};
    double map[6];
    cards_from("CRVAL1  = 10.0\nCRVAL2  = 20.0\nCRPIX1  = 3.0\nCRPIX2  = 1.0\nCDELT1  = 0.5\nCDELT2  = 2.0",
               &cards);
    assert_int_equal(rx_wcs_linear(cards.data, cards.length / 80, map), 1);
    assert_true(map[0] == 9);
    assert_true(map[1] == 0.5);
    assert_true(map[2] == 0);
    assert_true(map[3] == 20);
    assert_true(map[4] == 0);
    assert_true(map[5] == 2);
    assert_int_equal(rx_wcs_linear(cards.data, 1, map), 0);
    rx_text_free(&cards);
}

/* --- one description, two threads --- */

enum { SHARED = 6400, ROUNDS = 100 };

typedef struct converter {
    rx_wcs *wcs;
    const double *x, *y, *alpha, *delta; /* [SHARED] what comes out of one thread */
    int wrong;
} converter;

static void *convert_all(void *user)
{
    converter *c = user;
    static _Thread_local double alpha[SHARED], delta[SHARED];
    for (int round = 0; round < ROUNDS; round++) {
        rx_wcs_to_native(c->wcs, SHARED, c->x, c->y, alpha, delta);
        c->wrong += memcmp(alpha, c->alpha, sizeof alpha) != 0 || memcmp(delta, c->delta, sizeof delta) != 0;
    }
    return NULL;
}

static void test_shared_by_threads(void **state)
{
    static double x[SHARED], y[SHARED], alpha[SHARED], delta[SHARED];
    char note[256];
    pthread_t threads[2];
    converter of[2];
    rx_wcs *wcs =
        from_lines("CTYPE1  = 'RA---TAN-SIP'\nCTYPE2  = 'DEC--TAN-SIP'\nCRVAL1  = 150.\nCRVAL2  = 2.\n"
                   "CRPIX1  = 1000.\nCRPIX2  = 1000.\nCD1_1   = -5.5E-5\nCD1_2   = 1E-6\n"
                   "CD2_1   = 1E-6\nCD2_2   = 5.5E-5\nA_ORDER = 2\nB_ORDER = 2\n"
                   "A_2_0   = 1E-6\nA_1_1   = 2E-6\nB_0_2   = 3E-6\nB_1_1   = 2E-6\n",
                   2000, 2000, note);
    assert_non_null(wcs);
    for (int i = 0; i < SHARED; i++) {
        x[i] = i * 37 % 2000;
        y[i] = i * 91 % 2000;
    }
    rx_wcs_to_native(wcs, SHARED, x, y, alpha, delta);
    for (int i = 0; i < 2; i++) {
        of[i] = (converter){wcs, x, y, alpha, delta, 0};
        assert_int_equal(pthread_create(&threads[i], NULL, convert_all, &of[i]), 0);
    }
    for (int i = 0; i < 2; i++) {
        assert_int_equal(pthread_join(threads[i], NULL), 0);
        assert_int_equal(of[i].wrong, 0);
    }
    rx_wcs_free(wcs);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_real_headers),
        cmocka_unit_test(test_sections),
        cmocka_unit_test(test_tan),
        cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_half_read),
        cmocka_unit_test(test_far_away),
        cmocka_unit_test(test_frames),
        cmocka_unit_test(test_frames_loosely),
        cmocka_unit_test(test_unusable),
        cmocka_unit_test(test_hostile_cards),
        cmocka_unit_test(test_halves_of_distortions),
        cmocka_unit_test(test_plate),
        cmocka_unit_test(test_unknown_frame),
        cmocka_unit_test(test_types_of_another_spelling),
        cmocka_unit_test(test_linear),
        cmocka_unit_test(test_shared_by_threads),
    };
    return cmocka_run_group_tests_name("world coordinates", tests, NULL, NULL);
}
