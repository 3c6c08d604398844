/* What the readers of PSF files have in common; for src/psf alone. */
#ifndef RX_PSF_PSF_FILES_H
#define RX_PSF_PSF_FILES_H

#include "data/table.h"
#include "io/fits_read.h"
#include "psf/psf.h"

/* A PSF as a file has it. draw() makes its stamp at place number k, 0-based position (x, y) of the tile, on `fine` samples
 * a pixel, [fine (size - 1) + 1] a side: pixel response included, of any sum. */
typedef struct rx_psf_source {
    const char *file, *what; /* "PSFEx model", for messages */
    rx_psf_type type;
    int size; /* odd */
    rx_status (*draw)(const void *model, int k, double x, double y, int fine, double *stamp, rx_error *err);
    int finest; /* samples a pixel that the file knows */
    const void *model;
    int degree[2]; /* in x and y, at least, of the polynomial to be fitted; below 0: it does not vary there */
    int n;         /* places where alone it is known; 0: it can be drawn anywhere */
    const double (
        *at)[2]; /* these; the degree is then the one that predicts each place best from the others */
} rx_psf_source;

/* The least-squares polynomial through the stamps, each divided by its sum: at Chebyshev points of the tile, of the
 * lowest degree that is good to 1e-4 of the peak there, or at the places. It reproduces the constant 1 exactly, so that basis 0 sums to 1 and the others to 0. fwhm and
 * ellipticity are set; where the PSF is narrow (RX_PSF_NARROW) it has samples, as far as the file knows them. *degree: of the polynomial; *misfit: largest difference from a stamp, of its peak. */
rx_status rx_psf_project(const rx_psf_source *src, int width, int height, rx_psf **dst, int *degree,
                         double *misfit, rx_error *err);

/* A polynomial that misses what the file says by more than 1 % of the peak is a warning. */
void rx_psf_warn_misfit(const rx_psf_source *src, double misfit, rx_log *log);

/* How far a tile reaches out of low..high of an axis, in units of that range; 0 without a range. */
double rx_psf_beyond(double low, double high, int length);
void rx_psf_warn_beyond(const char *file, const char *what, double beyond, rx_log *log);

enum { RX_PSF_MAX_DEGREE = 8 };

/* The file's name without its folder: outputs hold no paths. */
const char *rx_psf_base_name(const char *file);

/* Side that is left of a square stamp of odd side `from` when `size` (0 = all) is asked for. */
int rx_psf_cut_size(int from, int size);

rx_status rx_psf_images(const rx_psf_params *par, const rx_fits_cube *cube, int width, int height,
                        rx_log *log, rx_psf **dst, rx_error *err);

#endif
