/* The restoration campaign: scenes of galaxies, blurred and noisy, through every method, and how near each
 * comes to the sharp scene. The paper's box plots (Jia et al. 2023, MNRAS 527, 6581, Figure 5).
 *
 * A bin is 1 wide in FWHM (pixels) or in sigma of the noise, on the paper's scale, on which the brightest pixel of the
 * sharp scene is SCENE_PEAK; the other quantity is uniform over its training range. Of every scene the noise level of
 * nn/noise_level.h is kept too, which is the scale of the network's training: it is of the blurred scene, and some three
 * times sigma. Scene i of a bin is the same for every SIZE, and for every method. */
#ifndef RX_LAB_RESTORATION_H
#define RX_LAB_RESTORATION_H

#include "lab/lab.h"

enum { RX_RESTORATION_SCENE, RX_RESTORATION_TUNING, RX_RESTORATION_TABLES };

/* A scene of the test. */
#define RX_RESTORATION_SCENE_COLUMNS(X)                                                                      \
    X(RX_SCENE_FWHM, "fwhm", "pixel", "of the PSF, as drawn")                                                \
    X(RX_SCENE_SIGMA, "sigma", "", "of the noise, as drawn")                                                 \
    X(RX_SCENE_LEVEL, "level", "", "noise level on the scale of models")
#define RX_RESTORATION_SCORE_COLUMNS(X)                                                                      \
    X(RX_SCORE_PSNR, "psnr", "dB", "")                                                                       \
    X(RX_SCORE_SSIM, "ssim", "", "K1 = K2 = 0.001, as the paper (quality/image_metrics.h; so is the rest)")  \
    X(RX_SCORE_SSIM_WANG, "ssim_wang", "", "K1 = 0.01, K2 = 0.03")                                           \
    X(RX_SCORE_SSIM_OBJECT, "ssim_object", "", "on the pixels of the object")

/* A candidate of the tuning. */
#define RX_RESTORATION_TUNING_COLUMNS(X)                                                                     \
    X(RX_TUNING_NITER, "niter", "", "iterations of RL; 0: none")                                             \
    X(RX_TUNING_FILTER, "filter", "pixel", "FWHM of the Gaussian")                                           \
    X(RX_TUNING_THRESHOLD, "threshold", "", "in sigmas of the noise: what is below is sky; negative: none")  \
    X(RX_TUNING_PSNR, "psnr", "dB", "on one scene")                                                          \
    X(RX_TUNING_SSIM, "ssim", "", "on one scene; of RL only")

enum { RX_RESTORATION_SCENE_COLUMNS(RX_LAB_ID) RX_RESTORATION_SCENE_WIDTH };
enum { RX_RESTORATION_SCORE_COLUMNS(RX_LAB_ID) RX_RESTORATION_SCORE_WIDTH };
enum { RX_RESTORATION_TUNING_COLUMNS(RX_LAB_ID) RX_RESTORATION_TUNING_WIDTH };

/* The first test scene of a bin through all runs: a line that describes it, without a plane, then each picture
 * [side][side] with its name, blurred first and sharp last. */
typedef void (*rx_restoration_show)(void *user, const char *name, const float *plane);
rx_status rx_restoration_example(const rx_lab *lab, int bin, rx_restoration_show show, void *user,
                                 rx_error *err);

/* --- report --- */

void rx_restoration_name_set(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96]);
rx_status rx_restoration_report(struct rx_lab_page *page, rx_error *err);
extern const char rx_restoration_reading[];

#endif
