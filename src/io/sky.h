/* Celestial frames: from the frame of an image's world coordinates to J2000 and back.
 *
 * ICRS and FK5 at J2000 are taken as the same (they differ by 0.02 arcsec). Rotations:
 * precession IAU 1976 (Lieske 1979, A&A 73, 282) for FK5 of another equinox, FK4 by Newcomb's
 * precession to B1950, removal of the E-terms and the B1950-J2000 matrix of Murray
 * (1989, A&A 218, 325, eq. 28) for the epoch 1950 and no proper motion;
 * Galactic: pole and node at J2000 after Liu, Zhu and Zhang (2011, A&A 526, A16); ecliptic:
 * obliquity IAU 1976; supergalactic: pole at l = 47.37, b = 6.32 (RC3). Angles in degrees.
 */
#ifndef RX_IO_SKY_H
#define RX_IO_SKY_H

typedef struct rx_sky_frame {
    int known;           /* 0: a frame that cannot be taken to J2000 */
    int named;           /* 0: RADESYS is there and no reference system of the FITS standard */
    int eterms;          /* 1: FK4 positions hold the elliptic terms of aberration */
    double matrix[3][3]; /* to J2000; rotation */
} rx_sky_frame;

/* type: first letters of CTYPE ("RA", "GLON", "ELON", "SLON"); radesys may be ""; equinox in years, 0 = none.
 * Without RADESYS an equinox before 1984 means FK4 (FITS standard). */
rx_sky_frame rx_sky_frame_of(const char *type, const char *radesys, double equinox);

void rx_sky_to_j2000(const rx_sky_frame *frame, double lon, double lat, double *alpha, double *delta);
void rx_sky_from_j2000(const rx_sky_frame *frame, double alpha, double delta, double *lon, double *lat);

#endif
