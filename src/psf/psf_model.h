/* A PSF as PSF_TYPE AUTO measures it: cubic B-splines on nodes finer than the pixel, whose coefficients are polynomials
 * of the position, and a round profile beyond.
 *
 *   P(u; x, y) = sum_k L_k(X, Y) sum_ab c_k[b][a] B(m u_x + N - a) B(m u_y + N - b)   |u_x|, |u_y| <= half
 *              = wing(|u|)                                                            elsewhere
 *
 * u: pixels from the star, at the centre of a pixel; P holds the pixel's integral (the "effective PSF" of Anderson
 * and King 2000, PASP 112, 1360). L_k: products of Legendre polynomials of X, Y in -1..1 over the tile.
 */
#ifndef RX_PSF_MODEL_H
#define RX_PSF_MODEL_H

#include "base/error.h"

enum { RX_PSF_HALF = 64 }; /* pixels, at most */
enum { RX_PSF_DEGREE = 6, RX_PSF_TERMS = (RX_PSF_DEGREE + 1) * (RX_PSF_DEGREE + 2) / 2 };

typedef struct rx_psf_model {
    int m;                 /* nodes a pixel */
    int half;              /* pixels */
    int middle, side;      /* N, and 2 N + 1 nodes a side */
    int degree, nterms;    /* of L */
    double x0, y0, xs, ys; /* X = (x - x0) / xs */
    float *c;              /* [RX_PSF_TERMS][side][side], those from nterms on 0 */
    int nwing;             /* values of the wing, RX_PSF_WING_STEP pixels apart from r = 0 on; 0 beyond */
    float *wing;
} rx_psf_model;

#define RX_PSF_WING_STEP 0.25

rx_status rx_psf_model_new(int m, int half, int reach, int width, int height, rx_psf_model *dst,
                           rx_error *err);
void rx_psf_model_free(rx_psf_model *model);

/* Powers px, py of the Legendre polynomials of the terms of a degree; returns how many terms. */
int rx_psf_model_powers(int degree, int px[RX_PSF_TERMS], int py[RX_PSF_TERMS]);
void rx_psf_model_terms(const rx_psf_model *model, double x, double y, double terms[RX_PSF_TERMS]);

/* Of the first nterms: sum_k terms_k planes_k; dst, planes of [side][side]. */
void rx_psf_model_mix(const rx_psf_model *model, const float *planes, const double terms[RX_PSF_TERMS],
                      int nterms, float *dst);

/* [2 half + 1]^2 pixels of a star, and their derivatives by dx, dy (both or NULL); work: rx_psf_model_work() floats. */
typedef struct rx_psf_stamp {
    float *value, *gx, *gy, *work;
} rx_psf_stamp;

/* Of a star (dx, dy) off the middle pixel, |dx|, |dy| <= 0.5, from nodes [side][side]; half at most the model's. */
void rx_psf_model_stamp(const rx_psf_model *model, const float *nodes, double dx, double dy, int half,
                        const rx_psf_stamp *dst);
size_t rx_psf_model_work(const rx_psf_model *model);

float rx_psf_model_wing(const rx_psf_model *model, double r);

/* Coefficients of the spline through nodes [side][side], in place. */
void rx_psf_model_interpolate(const rx_psf_model *model, double *nodes);

#endif
