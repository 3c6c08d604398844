/* World coordinates by wcslib. */
#include "io/wcs.h"

#include <wcslib/wcs.h>
#include <wcslib/wcsfix.h>
#include <wcslib/wcshdr.h>
#include <wcslib/wcsmath.h>

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "io/cards.h"
#include "io/guard/wcs.h"

enum { CHUNK = 64 };

/* --- celestial frames ---
 *
 * From the frame of an image's world coordinates to J2000 and back.
 *
 * ICRS and FK5 at J2000 are taken as the same (they differ by 0.02 arcsec). Rotations:
 * precession IAU 1976 (Lieske 1979, A&A 73, 282) for FK5 of another equinox, FK4 by Newcomb's
 * precession to B1950, removal of the E-terms and the B1950-J2000 matrix of Murray
 * (1989, A&A 218, 325, eq. 28) for the epoch 1950 and no proper motion;
 * Galactic: pole and node at J2000 after Liu, Zhu and Zhang (2011, A&A 526, A16); ecliptic:
 * obliquity IAU 1976; supergalactic: pole at l = 47.37, b = 6.32 (RC3). Angles in degrees.
 */
typedef struct sky_frame {
    int known;           /* 0: a frame that cannot be taken to J2000 */
    int named;           /* 0: RADESYS is there and no reference system of the FITS standard */
    int eterms;          /* 1: FK4 positions hold the elliptic terms of aberration */
    double matrix[3][3]; /* to J2000; rotation */
} sky_frame;

static const double ARCSEC = RX_DEGREE / 3600;

/* E-terms of aberration at B1950 in radians (Explanatory Supplement 1992, 3.59). */
static const double ETERMS[3] = {-1.62557e-6, -0.31919e-6, -0.13843e-6};

static void multiply(double a[3][3], double b[3][3], double dst[3][3])
{
    double product[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            product[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
    memcpy(dst, product, sizeof product);
}

static void transpose(double m[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < i; j++) {
            double keep = m[i][j];
            m[i][j] = m[j][i];
            m[j][i] = keep;
        }
}

/* Rotation of the coordinate axes by `angle` (radians) about axis 0, 1 or 2. */
static void rotation(int axis, double angle, double dst[3][3])
{
    int j = (axis + 1) % 3, k = (axis + 2) % 3;
    double c = cos(angle), s = sin(angle);
    memset(dst, 0, 9 * sizeof(double));
    dst[axis][axis] = 1;
    dst[j][j] = dst[k][k] = c;
    dst[j][k] = s;
    dst[k][j] = -s;
}

/* Angles of precession zeta, z and theta in arcsec, as polynomials of centuries without a constant, the highest first. From
 * J2000 to the mean equator and equinox of a Julian year, IAU 1976; from B1950 to a Besselian year, Newcomb's angles for
 * the start epoch 1950 (Kinoshita 1975). */
static const double FROM_J2000[3][3] = {{0.017998, 0.30188, 2306.2181},
                                        {0.018203, 1.09468, 2306.2181},
                                        {-0.041833, -0.42665, 2004.3109}},
                    FROM_B1950[3][3] = {
                        {0.0179, 0.3022, 2304.948}, {0.0183, 1.0950, 2304.948}, {-0.0416, -0.4266, 2004.255}};

/* R3(-z) R2(theta) R3(-zeta). */
static void precession(const double angles[3][3], double years, double dst[3][3])
{
    double t = years / 100, angle[3], a[3][3], b[3][3];
    for (int k = 0; k < 3; k++)
        angle[k] = ((angles[k][0] * t + angles[k][1]) * t + angles[k][2]) * t * ARCSEC;
    rotation(2, -angle[0], a);
    rotation(1, angle[2], b);
    multiply(b, a, a);
    rotation(2, -angle[1], b);
    multiply(b, a, dst);
}

/* From a frame whose pole lies at (lon, lat) of the target and whose origin of longitude is
 * such that the target's pole has longitude `node` in the frame. Degrees. */
static void from_pole(double lon, double lat, double node, double dst[3][3])
{
    double a[3][3], b[3][3];
    rotation(2, lon * RX_DEGREE, a);
    rotation(1, (90 - lat) * RX_DEGREE, b);
    multiply(b, a, a);
    rotation(2, (180 - node) * RX_DEGREE, b);
    multiply(b, a, dst); /* target to frame */
    transpose(dst);
}

static void galactic(double dst[3][3])
{
    from_pole(192.8594812065348, 27.12825118085622, 122.9319185680026, dst);
}

/* type: first letters of CTYPE ("RA", "GLON", "ELON", "SLON"); radesys may be ""; equinox in years, 0 = none.
 * Without RADESYS an equinox before 1984 means FK4 (FITS standard). */
static sky_frame frame_of(const char *type, const char *radesys, double equinox)
{
    static const char *const systems[] = {"", "ICRS", "FK5", "FK4", "FK4-NO-E", "GAPPT"};
    sky_frame frame = {.known = 1};
    double b1950_to_j2000[3][3] = {{0.9999256794956877, -0.0111814832204662, -0.0048590038153592},
                                   {0.0111814832391717, 0.9999374848933135, -0.0000271625947142},
                                   {0.0048590037723143, -0.0000271702937440, 0.9999881946023742}};
    int fk4 = strncmp(radesys, "FK4", 3) == 0 || (radesys[0] == '\0' && equinox > 0 && equinox < 1984);
    int icrs = strcmp(radesys, "ICRS") == 0 || strcmp(radesys, "GAPPT") == 0;
    for (size_t i = 0; i < sizeof systems / sizeof *systems; i++)
        frame.named |= strcmp(radesys, systems[i]) == 0;
    rotation(0, 0, frame.matrix);
    if (strncmp(type, "RA", 2) == 0 && fk4) {
        precession(FROM_B1950, equinox > 0 ? equinox - 1950 : 0, frame.matrix);
        transpose(frame.matrix);
        multiply(b1950_to_j2000, frame.matrix, frame.matrix);
        frame.eterms = strcmp(radesys, "FK4-NO-E") != 0;
    } else if (strncmp(type, "RA", 2) == 0) {
        if (!icrs && equinox > 0) {
            precession(FROM_J2000, equinox - 2000, frame.matrix);
            transpose(frame.matrix);
        }
    } else if (strncmp(type, "GLON", 4) == 0) {
        galactic(frame.matrix);
    } else if (strncmp(type, "ELON", 4) == 0) {
        double year = equinox > 0 ? equinox : 2000, t = (year - 2000) / 100, tilt[3][3];
        precession(FROM_J2000, year - 2000, frame.matrix);
        rotation(0, (84381.448 + ((0.001813 * t - 0.00059) * t - 46.8150) * t) * ARCSEC, tilt);
        multiply(tilt, frame.matrix, frame.matrix);
        transpose(frame.matrix);
    } else if (strncmp(type, "SLON", 4) == 0) {
        double to_equator[3][3];
        from_pole(47.37, 6.32, 90, frame.matrix);
        galactic(to_equator);
        multiply(to_equator, frame.matrix, frame.matrix);
    } else {
        frame.known = 0;
    }
    return frame;
}

static void to_vector(double lon, double lat, double v[3])
{
    v[0] = cos(lat * RX_DEGREE) * cos(lon * RX_DEGREE);
    v[1] = cos(lat * RX_DEGREE) * sin(lon * RX_DEGREE);
    v[2] = sin(lat * RX_DEGREE);
}

static void from_vector(const double v[3], double *lon, double *lat)
{
    *lon = atan2(v[1], v[0]) / RX_DEGREE;
    if (*lon < 0)
        *lon += 360;
    if (*lon >= 360)
        *lon -= 360;
    *lat = atan2(v[2], hypot(v[0], v[1])) / RX_DEGREE;
}

static void normalise(double v[3])
{
    double norm = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] /= norm;
}

static void apply(const sky_frame *frame, const double src[3], double dst[3])
{
    double v[3] = {src[0], src[1], src[2]};
    if (frame->eterms) {
        double dot = v[0] * ETERMS[0] + v[1] * ETERMS[1] + v[2] * ETERMS[2];
        for (int i = 0; i < 3; i++)
            v[i] += dot * src[i] - ETERMS[i];
        normalise(v);
    }
    for (int i = 0; i < 3; i++)
        dst[i] = frame->matrix[i][0] * v[0] + frame->matrix[i][1] * v[1] + frame->matrix[i][2] * v[2];
    normalise(dst);
}

/* The E-terms have no closed inverse: fixed-point steps, each gains five digits or more. */
static void frame_from_j2000(const sky_frame *frame, double alpha, double delta, double *lon, double *lat)
{
    double v[3], w[3], guess[3] = {0, 0, 0};
    if (!frame->known) {
        *lon = *lat = NAN;
        return;
    }
    to_vector(alpha, delta, v);
    for (int step = 0; step < 4; step++) {
        double rest[3] = {v[0], v[1], v[2]};
        if (step > 0) {
            apply(frame, guess, w);
            for (int i = 0; i < 3; i++)
                rest[i] -= w[i];
        }
        for (int i = 0; i < 3; i++)
            guess[i] +=
                frame->matrix[0][i] * rest[0] + frame->matrix[1][i] * rest[1] + frame->matrix[2][i] * rest[2];
        normalise(guess);
    }
    from_vector(guess, lon, lat);
}

struct rx_wcs {
    struct wcsprm prm; /* two axes, set up */
    sky_frame frame;
};

/* --- making --- */

/* The first two axes of the primary description into dst->prm; 0, or -1 when they are not celestial. */
static int take_axes(struct wcsprm *list, int n, rx_wcs *dst)
{
    int axes[2] = {1, 2}, nsub = 2;
    for (int i = 0; i < n; i++) {
        if (list[i].alt[0] != ' ')
            continue;
        if (wcssub(1, &list[i], &nsub, axes, &dst->prm) != 0)
            return -1;
        return nsub == 2 ? 0 : -1;
    }
    return -1;
}

/* Determinant of the linear part is no usable number; asked first, because wcslib 7.12 leaks memory
 * when it meets a singular matrix more than once. */
static int is_singular(struct wcsprm *prm)
{
    cdfix(prm);
    int is_cd = (prm->altlin & 2) && !(prm->altlin & 1);
    const double *m = is_cd ? prm->cd : prm->pc;
    double det = m[0] * m[3] - m[1] * m[2];
    if (!is_cd)
        det *= prm->cdelt[0] * prm->cdelt[1];
    return !isfinite(det) || det == 0;
}

/* At least one of centre and corners must have sky coordinates. */
static int is_usable(rx_wcs *wcs, int width, int height)
{
    double x[5] = {(width - 1) / 2., 0, width - 1., 0, width - 1.};
    double y[5] = {(height - 1) / 2., 0, 0, height - 1., height - 1.}, alpha[5], delta[5];
    rx_wcs_to_native(wcs, 5, x, y, alpha, delta);
    for (int i = 0; i < 5; i++)
        if (isfinite(alpha[i]) && isfinite(delta[i]))
            return 1;
    return 0;
}

static void take_frame(rx_wcs *wcs, rx_wcs_notes *notes)
{
    struct wcsprm *prm = &wcs->prm;
    rx_text *details = &notes->details;
    const bool stated = isfinite(prm->equinox) && !undefined(prm->equinox) && prm->equinox > 1000;
    wcs->frame = frame_of(prm->lngtyp, prm->radesys, stated ? prm->equinox : 0);
    if (!wcs->frame.named) {
        rx_wcs_note(&notes->warnings, "RADESYS = '");
        rx_text_printf(&notes->warnings, "%s' is no reference system; positions are taken for %s",
                       prm->radesys, stated ? "FK5 of EQUINOX" : "ICRS");
    }
    if (!wcs->frame.known)
        rx_wcs_note(details, "longitudes of this type cannot be taken to J2000");
    else if (wcs->frame.eterms)
        rx_wcs_note(details, "FK4 positions are taken to J2000 for the epoch 1950, without proper motions");
}

/* Parse, repair and set up for an image of that size; *why says what is missing when there is nothing to be used. */
static rx_status set_up(char *cards, size_t ncards, const int size[2], rx_wcs **dst, const char **why,
                        rx_error *err)
{
    rx_status status = RX_OK;
    struct wcsprm *list = NULL;
    int rejected = 0, n = 0, naxis[2] = {size[0], size[1]}, stat[NWCSFIX], failed;
    rx_wcs *wcs;
    RX_TRY(RX_MAKE(wcs, 1, err));
    wcs->prm.flag = -1;
    /* reentrant since wcslib 5.18; configure asks for 7 */
    failed = wcspih(cards, (int)ncards, WCSHDR_all, 0, &rejected, &n, &list);
    if (failed == 2) {
        status = rx_error_memory(err, 0);
    } else if (failed || n == 0 || take_axes(list, n, wcs) != 0) {
        *why = rx_wcs_means_sky(cards, ncards) == 2 ? "wcslib cannot read them"
                                                    : "no celestial coordinates in the header";
    } else if (is_singular(&wcs->prm)) {
        *why = "the matrix of the linear transformation is singular";
    } else {
        wcsfix(0, naxis, &wcs->prm, stat);
        failed = wcsset(&wcs->prm);
        if (failed == WCSERR_MEMORY)
            status = rx_error_memory(err, 0);
        else if (failed)
            *why = wcs_errmsg[failed];
        else if (wcs->prm.lng < 0 || wcs->prm.lat < 0)
            *why = "no celestial coordinates in the header";
    }
    wcsvfree(&n, &list);
    if (status == RX_OK && *why == NULL)
        *dst = wcs;
    else
        rx_wcs_free(wcs);
    return status;
}

void rx_wcs_notes_free(rx_wcs_notes *notes)
{
    rx_text_free(&notes->warnings);
    rx_text_free(&notes->details);
    rx_text_free(&notes->why);
}

static rx_status make(char *cards, size_t ncards, const int size[2], rx_wcs **dst, rx_wcs_notes *notes,
                      rx_error *err)
{
    const char *why = NULL;
    const bool guarded = rx_wcs_guard(cards, ncards, notes);
    if (guarded)
        RX_TRY(set_up(cards, ncards, size, dst, &why, err));
    if (*dst != NULL) {
        take_frame(*dst, notes);
        if (!is_usable(*dst, size[0], size[1])) {
            why = "neither the centre nor a corner has sky coordinates";
            rx_wcs_free(*dst);
            *dst = NULL;
        }
    }
    if (*dst == NULL) {
        rx_text *said = !guarded || rx_wcs_means_sky(cards, ncards) > 0 ? &notes->warnings : &notes->details;
        rx_wcs_note(said, "no world coordinates: ");
        rx_text_add(said, guarded ? why : notes->why.data);
    }
    return notes->warnings.failed || notes->details.failed || notes->why.failed ? rx_error_memory(err, ncards)
                                                                                : RX_OK;
}

rx_status rx_wcs_from_cards(const char *cards, size_t ncards, int width, int height, rx_wcs **dst,
                            rx_wcs_notes *notes, rx_error *err)
{
    rx_wcs_notes own = {0};
    *dst = NULL;
    if (cards == NULL || ncards == 0)
        return RX_OK;
    char *copy;
    RX_TRY(RX_MAKE(copy, (ncards + RX_WCS_OWN) * RX_CARD + 1, err));
    memset(copy, ' ', RX_WCS_OWN * RX_CARD);
    memcpy(copy + RX_WCS_OWN * RX_CARD, cards, ncards * RX_CARD);
    const rx_status status =
        make(copy, ncards + RX_WCS_OWN, (int[2]){width, height}, dst, notes != NULL ? notes : &own, err);
    if (status != RX_OK) {
        rx_wcs_free(*dst);
        *dst = NULL;
    }
    rx_wcs_notes_free(&own);
    free(copy);
    return status;
}

void rx_wcs_free(rx_wcs *wcs)
{
    if (wcs == NULL)
        return;
    wcsfree(&wcs->prm);
    free(wcs);
}

/* --- using --- */

/* n <= CHUNK positions, pairs in axis order; failed ones become NAN. wcslib may give up a whole
 * batch for one position (inverse distortion), hence the second try one by one. */
static void convert(struct wcsprm *prm, int inverse, int n, const double *src, double *dst)
{
    double image[2 * CHUNK], phi[CHUNK], theta[CHUNK];
    int stat[CHUNK] = {0};
    int failed = inverse ? wcss2p(prm, n, 2, src, phi, theta, image, dst, stat)
                         : wcsp2s(prm, n, 2, src, image, phi, theta, dst, stat);
    if (failed && n > 1) {
        for (int i = 0; i < n; i++)
            convert(prm, inverse, 1, src + 2 * i, dst + 2 * i);
    } else if (failed) {
        dst[0] = dst[1] = NAN;
    }
}

/* wcslib keeps scratch for distortions in the description: one at a time. */
static void convert_alone(struct wcsprm *prm, int inverse, int n, const double *src, double *dst)
{
#pragma omp critical(rx_wcs)
    convert(prm, inverse, n, src, dst);
}

static void to_sky_chunk(rx_wcs *wcs, int n, const double *x, const double *y, double *lon, double *lat)
{
    double pixel[2 * CHUNK] = {0}, world[2 * CHUNK];
    for (int i = 0; i < n; i++) {
        pixel[2 * i] = x[i] + 1;
        pixel[2 * i + 1] = y[i] + 1;
    }
    convert_alone(&wcs->prm, 0, n, pixel, world);
    for (int i = 0; i < n; i++) {
        double value = world[2 * i + wcs->prm.lng];
        lon[i] = value < 0 ? value + 360 : value >= 360 ? value - 360 : value;
        lat[i] = world[2 * i + wcs->prm.lat];
    }
}

void rx_wcs_to_native(rx_wcs *wcs, int n, const double *x, const double *y, double *alpha, double *delta)
{
    double lon[CHUNK], lat[CHUNK]; /* the outputs may be the inputs */
    for (int begin = 0; begin < n; begin += CHUNK) {
        int count = n - begin < CHUNK ? n - begin : CHUNK;
        to_sky_chunk(wcs, count, x + begin, y + begin, lon, lat);
        memcpy(alpha + begin, lon, (size_t)count * sizeof *lon);
        memcpy(delta + begin, lat, (size_t)count * sizeof *lat);
    }
}

void rx_wcs_native_to_j2000(const rx_wcs *wcs, int n, const double *alpha, const double *delta,
                            double *alpha_j2000, double *delta_j2000)
{
    for (int i = 0; i < n; i++) {
        double ra = NAN, dec = NAN, v[3], w[3];
        if (wcs->frame.known && isfinite(alpha[i]) && isfinite(delta[i])) {
            to_vector(alpha[i], delta[i], v);
            apply(&wcs->frame, v, w);
            from_vector(w, &ra, &dec);
        }
        alpha_j2000[i] = ra;
        delta_j2000[i] = dec;
    }
}

void rx_wcs_to_sky(rx_wcs *wcs, int n, const double *x, const double *y, double *alpha_j2000,
                   double *delta_j2000)
{
    rx_wcs_to_native(wcs, n, x, y, alpha_j2000, delta_j2000);
    rx_wcs_native_to_j2000(wcs, n, alpha_j2000, delta_j2000, alpha_j2000, delta_j2000);
}

/* Angle between two directions, deg. */
static double separation(double lon1, double lat1, double lon2, double lat2)
{
    double a = sin((lat2 - lat1) / 2 * RX_DEGREE), b = sin((lon2 - lon1) / 2 * RX_DEGREE);
    double h = a * a + cos(lat1 * RX_DEGREE) * cos(lat2 * RX_DEGREE) * b * b;
    return 2 * asin(sqrt(h < 1 ? h : 1)) / RX_DEGREE;
}

/* Far from the image a polynomial may lead back into it: what does not return to the same
 * place on the sky within 0.001 pixel is no solution. */
static void check_solutions(rx_wcs *wcs, int n, const double *lon, const double *lat, double *x, double *y)
{
    double back_lon[CHUNK], back_lat[CHUNK], near_lon[CHUNK], near_lat[CHUNK], near_x[CHUNK];
    to_sky_chunk(wcs, n, x, y, back_lon, back_lat);
    for (int i = 0; i < n; i++)
        near_x[i] = x[i] + 1;
    to_sky_chunk(wcs, n, near_x, y, near_lon, near_lat);
    for (int i = 0; i < n; i++) {
        double pixel = separation(back_lon[i], back_lat[i], near_lon[i], near_lat[i]);
        double miss = separation(back_lon[i], back_lat[i], lon[i], lat[i]);
        if (!(miss <= 1e-3 * pixel || miss < 1e-9))
            x[i] = y[i] = NAN;
    }
}

void rx_wcs_to_pixel(rx_wcs *wcs, int n, const double *alpha_j2000, const double *delta_j2000, double *x,
                     double *y)
{
    double lon[CHUNK], lat[CHUNK], world[2 * CHUNK], pixel[2 * CHUNK];
    for (int begin = 0; begin < n; begin += CHUNK) {
        int count = n - begin < CHUNK ? n - begin : CHUNK;
        for (int i = 0; i < count; i++) {
            frame_from_j2000(&wcs->frame, alpha_j2000[begin + i], delta_j2000[begin + i], &lon[i], &lat[i]);
            world[2 * i + wcs->prm.lng] = lon[i];
            world[2 * i + wcs->prm.lat] = lat[i];
        }
        convert_alone(&wcs->prm, 1, count, world, pixel);
        for (int i = 0; i < count; i++) {
            x[begin + i] = pixel[2 * i] - 1;
            y[begin + i] = pixel[2 * i + 1] - 1;
        }
        check_solutions(wcs, count, lon, lat, x + begin, y + begin);
    }
}

void rx_wcs_matrix(rx_wcs *wcs, double x, double y, double m[4])
{
    double px[5] = {x, x + 0.5, x - 0.5, x, x}, py[5] = {y, y, y, y + 0.5, y - 0.5}, lon[5], lat[5], v[5][3];
    rx_wcs_to_native(wcs, 5, px, py, lon, lat);
    double sa = sin(lon[0] * RX_DEGREE), ca = cos(lon[0] * RX_DEGREE), sd = sin(lat[0] * RX_DEGREE),
           cd = cos(lat[0] * RX_DEGREE);
    double east[3] = {-sa, ca, 0}, north[3] = {-sd * ca, -sd * sa, cd};
    for (int i = 1; i < 5; i++)
        to_vector(lon[i], lat[i], v[i]);
    memset(m, 0, 4 * sizeof *m);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 2; j++) {
            double step = (v[1 + 2 * j][i] - v[2 + 2 * j][i]) / RX_DEGREE;
            m[j] += east[i] * step;
            m[2 + j] += north[i] * step;
        }
}

double rx_wcs_pixel_scale(rx_wcs *wcs, double x, double y)
{
    double m[4];
    rx_wcs_matrix(wcs, x, y, m);
    return 3600 * sqrt(fabs(m[0] * m[3] - m[1] * m[2]));
}

/* false: the card is there, but no number. */
static bool read_linear(const char *cards, size_t ncards, const char *key, const char *unit, double *value)
{
    return rx_cards_quantity(cards, (long)ncards, key, unit, value) || rx_cards_find(cards, ncards, key) < 0;
}

int rx_wcs_linear(const char *cards, size_t ncards, double linear[6])
{
    double crval[2] = {NAN, NAN}, crpix[2] = {0, 0}, cdelt[2] = {1, 1}, cd[4] = {0, 0, 0, 0};
    int has_cd = 0;
    bool good = true;
    for (int i = 0; i < 4; i++) {
        char key[16];
        snprintf(key, sizeof key, "CD%d_%d", i / 2 + 1, i % 2 + 1);
        has_cd += rx_cards_find(cards, ncards, key) >= 0;
        good = good && read_linear(cards, ncards, key, "deg/pix", &cd[i]);
    }
    for (int i = 0; i < 2; i++)
        good = good && read_linear(cards, ncards, i == 0 ? "CRVAL1" : "CRVAL2", "deg", &crval[i]) &&
               read_linear(cards, ncards, i == 0 ? "CRPIX1" : "CRPIX2", "pix", &crpix[i]) &&
               read_linear(cards, ncards, i == 0 ? "CDELT1" : "CDELT2", "deg/pix", &cdelt[i]);
    if (!has_cd) {
        cd[0] = cdelt[0];
        cd[3] = cdelt[1];
    }
    for (int i = 0; i < 2; i++) {
        linear[3 * i] = crval[i] + cd[2 * i] * (1 - crpix[0]) + cd[2 * i + 1] * (1 - crpix[1]);
        linear[3 * i + 1] = cd[2 * i];
        linear[3 * i + 2] = cd[2 * i + 1];
    }
    return good && isfinite(crval[0]) && isfinite(crval[1]);
}

const char *rx_wcs_library(void)
{
    return wcslib_version(NULL);
}
