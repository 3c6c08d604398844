/* Celestial frames to J2000 and back. */
#include "io/sky.h"

#include <math.h>
#include <string.h>

static const double DEGREE = 0.017453292519943295769;
static const double ARCSEC = 0.017453292519943295769 / 3600;

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

/* R3(-z) R2(theta) R3(-zeta): the usual product of precession angles. */
static void precession(double zeta, double z, double theta, double dst[3][3])
{
    double a[3][3], b[3][3];
    rotation(2, -zeta, a);
    rotation(1, theta, b);
    multiply(b, a, a);
    rotation(2, -z, b);
    multiply(b, a, dst);
}

/* From J2000 to the mean equator and equinox of a Julian year, IAU 1976. */
static void from_j2000(double equinox, double dst[3][3])
{
    double t = (equinox - 2000) / 100;
    double zeta = ((0.017998 * t + 0.30188) * t + 2306.2181) * t;
    double z = ((0.018203 * t + 1.09468) * t + 2306.2181) * t;
    double theta = ((-0.041833 * t - 0.42665) * t + 2004.3109) * t;
    precession(zeta * ARCSEC, z * ARCSEC, theta * ARCSEC, dst);
}

/* From B1950 to a Besselian year, Newcomb's angles for the start epoch 1950 (Kinoshita 1975). */
static void from_b1950(double equinox, double dst[3][3])
{
    double t = (equinox - 1950) / 100;
    double zeta = ((0.0179 * t + 0.3022) * t + 2304.948) * t;
    double z = ((0.0183 * t + 1.0950) * t + 2304.948) * t;
    double theta = ((-0.0416 * t - 0.4266) * t + 2004.255) * t;
    precession(zeta * ARCSEC, z * ARCSEC, theta * ARCSEC, dst);
}

/* From a frame whose pole lies at (lon, lat) of the target and whose origin of longitude is
 * such that the target's pole has longitude `node` in the frame. Degrees. */
static void from_pole(double lon, double lat, double node, double dst[3][3])
{
    double a[3][3], b[3][3];
    rotation(2, lon * DEGREE, a);
    rotation(1, (90 - lat) * DEGREE, b);
    multiply(b, a, a);
    rotation(2, (180 - node) * DEGREE, b);
    multiply(b, a, dst); /* target to frame */
    transpose(dst);
}

static void galactic(double dst[3][3])
{
    from_pole(192.8594812065348, 27.12825118085622, 122.9319185680026, dst);
}

rx_sky_frame rx_sky_frame_of(const char *type, const char *radesys, double equinox)
{
    static const char *const systems[] = {"", "ICRS", "FK5", "FK4", "FK4-NO-E", "GAPPT"};
    rx_sky_frame frame = {.known = 1};
    double b1950_to_j2000[3][3] = {{0.9999256794956877, -0.0111814832204662, -0.0048590038153592},
                                   {0.0111814832391717, 0.9999374848933135, -0.0000271625947142},
                                   {0.0048590037723143, -0.0000271702937440, 0.9999881946023742}};
    int fk4 = strncmp(radesys, "FK4", 3) == 0 || (radesys[0] == '\0' && equinox > 0 && equinox < 1984);
    int icrs = strcmp(radesys, "ICRS") == 0 || strcmp(radesys, "GAPPT") == 0;
    for (size_t i = 0; i < sizeof systems / sizeof *systems; i++)
        frame.named |= strcmp(radesys, systems[i]) == 0;
    rotation(0, 0, frame.matrix);
    if (strncmp(type, "RA", 2) == 0 && fk4) {
        from_b1950(equinox > 0 ? equinox : 1950, frame.matrix);
        transpose(frame.matrix);
        multiply(b1950_to_j2000, frame.matrix, frame.matrix);
        frame.eterms = strcmp(radesys, "FK4-NO-E") != 0;
    } else if (strncmp(type, "RA", 2) == 0) {
        if (!icrs && equinox > 0) {
            from_j2000(equinox, frame.matrix);
            transpose(frame.matrix);
        }
    } else if (strncmp(type, "GLON", 4) == 0) {
        galactic(frame.matrix);
    } else if (strncmp(type, "ELON", 4) == 0) {
        double year = equinox > 0 ? equinox : 2000, t = (year - 2000) / 100, tilt[3][3];
        from_j2000(year, frame.matrix);
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
    v[0] = cos(lat * DEGREE) * cos(lon * DEGREE);
    v[1] = cos(lat * DEGREE) * sin(lon * DEGREE);
    v[2] = sin(lat * DEGREE);
}

static void from_vector(const double v[3], double *lon, double *lat)
{
    *lon = atan2(v[1], v[0]) / DEGREE;
    if (*lon < 0)
        *lon += 360;
    if (*lon >= 360)
        *lon -= 360;
    *lat = atan2(v[2], hypot(v[0], v[1])) / DEGREE;
}

static void normalise(double v[3])
{
    double norm = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] /= norm;
}

static void apply(const rx_sky_frame *frame, const double src[3], double dst[3])
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

void rx_sky_to_j2000(const rx_sky_frame *frame, double lon, double lat, double *alpha, double *delta)
{
    double v[3], w[3];
    if (!frame->known) {
        *alpha = *delta = NAN;
        return;
    }
    to_vector(lon, lat, v);
    apply(frame, v, w);
    from_vector(w, alpha, delta);
}

/* The E-terms have no closed inverse: fixed-point steps, each gains five digits or more. */
void rx_sky_from_j2000(const rx_sky_frame *frame, double alpha, double delta, double *lon, double *lat)
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
