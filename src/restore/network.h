/* The restorer NET: a trained network (nn/model.h) on a tile.
 *
 *   x = (pixel - level) / scale      noise units; scale: the tile's noise, smoothed (network_data.h)
 *   v = network(x)                   INFORMED: and w = Tikhonov(x), the FWHM (nn/front.h)
 *   f = Richardson-Lucy step(v, x)   INFORMED, as often as the model says (nn/rl_step.h)
 *       of models with a second stage v = second network(x, w, f, x - K' max(f, 0)), and the steps again
 *   restored = scale (max(f, -1/2) + L)   L: what the data have at low frequency and f has not
 *
 * L (network_sky.h) is the low-pass of x - K' max(f, -1/2), so that no light and no dark sky broader than some
 * FWHM is lost, below the mesh of the background or above it. Without a PSF (BLIND) a Gaussian blurs f to a FWHM
 * of 5 pixels instead of K'.
 *
 * rx_restored.sigma, which DETECT_THRESH counts in, is 0.6 times the noise map of restore/noise_map.h, as
 * faint sources come out fainter than they are. Six simulated frames (7.8 Mpixel, FWHM 2.6 to 4.5, stars and
 * galaxies down to S/N 2, seeds 501 and 502) and six of noise alone (511 and 512), DETECT_THRESH 1.5, BLANK_CHECK 0:
 *
 *   factor                  0.4    0.5    0.6    0.7    0.8    unrestored
 *   found                   2549   2427   2306   2193   2106   1689
 *   purity                  0.903  0.947  0.968  0.982  0.986  0.997
 *   false / Mpixel, noise   18.5   8.5    4.2    2.0    1.0
 *
 * Masked pixels are filled from good neighbours before anything looks at them, and have no weight in the
 * step; beyond the border x = 0 (sky), w = 0 and f = 0, and the step has no weight. No value under the mask
 * reaches any output, to the bit.
 *
 * A PSF that varies: w by Tikhonov filters at nodes of a grid anchored at the tile, between them by bilinear
 * weights of the output position, and so is the FWHM; the step by the polynomials of the PSF, exactly
 * (network_optics.h). Without a PSF a BLIND model still works; then `blur`, `reblurred` and `chi2` stay
 * empty. `reblurred` and chi2 are of the restored image, with L. INFORMED without one is RX_INPUT.
 *
 * Blocks: the network runs down blocks of NET_BLOCK columns at most (smaller ones where that keeps more
 * threads busy), all of one size (a multiple of twice the network's stride), the FFTs work on 1024 x 512
 * pixels (1024 x 1024 on tiles of more than 2048 rows), both anchored at the tile's first pixel and read with
 * the halo that a result depends on: the same bits for any NET_BLOCK and any number of threads. VERIFY_SEAMS
 * restores once more, both grids shifted and of other sizes, and takes the largest difference into
 * rx_restored.seam, in sigmas of the pixels: that of the sky and 1/500 of the restored value added, less than
 * which the photons of no detector leave. BLIND models without a PSF show none, others the rounding of FFTs, some
 * 1e-6 of the brightest pixels (5e-4 on an SDSS frame with stars up to saturation: 0.017 sigmas of the sky at
 * a restored pixel of 15,600). More than 0 or 1e-3 is RX_SYSTEM. With BF16 the limit of INFORMED models is
 * 0.5: there a rounding of 1e-7 may tip over one of 0.4 % inside the network, and beside the brightest stars
 * of that frame a trained model exceeds it (1.5).
 *
 * Overhead of the halos for a network that looks 60 pixels far and FFTs with a halo of 48: 1.06 (4096 x 4096
 * pixels, NET_BLOCK 4096) to 1.2 (1024 x 1024) times the pixels in the network, 1.2 to 1.35 times in the
 * FFTs of Tikhonov's filter; those of K' are on domains of their own, whose side follows from its size.
 *
 * Memory: a mask and three planes, 13 bytes a pixel; one becomes pixels, another, where that is asked for,
 * `reblurred` (`support`, where it is, too, has one of its own then), of tall tiles less: what the network or a
 * step has read goes as its result comes (down to two planes and a part), per thread some rows of a network (22
 * MB for NET_BLOCK 2048) and six FFT planes of 1024 x 1024 pixels at most, and 40 kB per node of a varying PSF
 * (every 512 pixels). A second stage takes two planes more. Networks together stay below 1 GiB: beyond that blocks are smaller, or fewer threads are
 * used. VERIFY_SEAMS takes three planes of the tile's size more.
 *
 * Errors: RX_INPUT, also where the network's values are not finite; RX_USAGE: BF16 on a processor that has
 * none; RX_SYSTEM; RX_INTERRUPTED. */
#ifndef RX_RESTORE_NETWORK_H
#define RX_RESTORE_NETWORK_H

#include "restore/runs.h"

#endif
