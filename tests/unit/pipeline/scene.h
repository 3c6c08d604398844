/* A small simulated tile for the tests of the whole stage, written as FITS. */
#ifndef RX_TESTS_SCENE_H
#define RX_TESTS_SCENE_H

#include <stdint.h>

typedef struct scene {
    int width, height;
    float *pixels;  /* sky 1000, noise 5, stars of Moffat FWHM 3.5 px, beta 4.765 */
    float *weights; /* 1, or 0 where a pixel is to be ignored */
    int nstars;
    double (*stars)[3]; /* x, y from 0; flux */
} scene;

/* nstars stars of flux 10^2.8 .. 10^4.8 ADU at random places, noise drawn with `seed`. */
void scene_make(scene *dst, int width, int height, int nstars, uint64_t seed);
void scene_free(scene *scene);

/* One more star, of a Moffat of this FWHM and beta 4.765, into the pixels; not into `stars`. */
void scene_star(scene *scene, double x, double y, double flux, double fwhm);

/* Write a plane as a float image with SATURATE, GAIN and a TAN WCS in its header. */
void scene_write(const char *path, const float *pixels, int width, int height);

/* The stars as a FITS table X_IMAGE, Y_IMAGE (from 1), MAG (zero point 25). */
void scene_write_truth(const char *path, const scene *scene);

#endif
