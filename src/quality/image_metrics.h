/* How near an image comes to its reference.
 *
 *   MSE  = 1/(N M) sum (img - ref)^2            (the paper prints no square; see Wang et al. 2004)
 *   PSNR = 20 log10(max(ref) / sqrt(MSE)) dB
 *   SSIM = mean of (2 mu_a mu_b + C1)(2 cov + C2) / ((mu_a^2 + mu_b^2 + C1)(var_a + var_b + C2)), 11 x 11
 * Gaussian window of sigma 1.5, population moments, C1 = (K1 L)^2, C2 = (K2 L)^2, L = max(ref) - min(ref); only
 * windows wholly inside count (Wang, Bovik, Sheikh, Simoncelli 2004, IEEE Trans. Image Proc. 13, 600). The same as
 * skimage's structural_similarity with gaussian_weights, sigma 1.5, use_sample_covariance=False on doubles, which
 * leaves the same border out; agrees to 1e-9.
 *
 * Three kinds: K1 = K2 = 0.001 as in the paper, where the noise of an empty sky outweighs the object; K1 = 0.01 and K2 = 0.03 as
 * Wang et al. have them; and the paper's on the pixels of the object, the mean over windows centred on the brightest pixels of
 * the reference that hold 90 % of its light, where the flatness of the sky does not count.
 *
 * All [height][width], row by row. Pixels that are not finite make the answer NAN.
 */
#ifndef RX_QUALITY_IMAGE_METRICS_H
#define RX_QUALITY_IMAGE_METRICS_H

#include "base/error.h"

/* A reference that many images are compared with: its own part is worked out once. `pixels` is not copied and
 * has to outlive it. Any number of threads may use one. PSNR is +infinity for equal images, NAN when max(ref)
 * <= 0. Errors of _new: RX_USAGE below 11 x 11 pixels, RX_INPUT a reference without contrast, RX_SYSTEM memory;
 * of _ssim, dst NAN: RX_SYSTEM memory. The object's SSIM is NAN where no such pixel is the centre of a window. */
enum { RX_SSIM_PAPER, RX_SSIM_WANG, RX_SSIM_OBJECT, RX_SSIM_KINDS };
typedef struct rx_image_reference rx_image_reference;
rx_status rx_image_reference_new(int width, int height, const float *pixels, rx_image_reference **dst,
                                 rx_error *err);
void rx_image_reference_free(rx_image_reference *reference); /* NULL is fine */
double rx_reference_psnr(const rx_image_reference *reference, const float *image);
rx_status rx_reference_ssim(const rx_image_reference *reference, const float *image,
                            double dst[RX_SSIM_KINDS], rx_error *err);

#endif
