#!/usr/bin/env python3
"""SDSS images, restored, against KiDS images of the same galaxies: a table on standard output, pictures pair_<G>.png.

usage: pairs.py PAIRS_FOLDER RESTORERS GALAXY...     in the folder of run.sh

Each SDSS image is resampled to KiDS's pixels (cubic spline, flux per area kept; both frames are centred on the galaxy,
a common shift is fitted on the unrestored image) and convolved with the Gaussian that brings it nearest to KiDS (width
0 if it is broader already): chosen for every image by itself, in its own favour. PSNR: peak of KiDS over the rms
difference; SSIM: of Wang et al. (2004), means over squares of 7 pixels. Sources: what KiDS's segmentation map holds at S/N 10 and more; found when a
detection lies within 1 arcsec. Fluxes: sums over KiDS's segments, 1.5 arcsec wider.
"""
import sys

import numpy as np
from astropy.io import fits
from scipy import ndimage, optimize

import picture

SDSS, KIDS = 0.339, 0.2  # arcsec per pixel


def to_kids(image, shape, shift):
    """SDSS pixels at KiDS's pixels, flux per KiDS pixel."""
    y, x = np.indices(shape, dtype=float)
    y = (y - (shape[0] - 1) / 2 + shift[0]) * KIDS / SDSS + (image.shape[0] - 1) / 2
    x = (x - (shape[1] - 1) / 2 + shift[1]) * KIDS / SDSS + (image.shape[1] - 1) / 2
    return ndimage.map_coordinates(image, [y, x], order=3, mode="constant") * (KIDS / SDSS) ** 2, \
        (y >= 0) & (y <= image.shape[0] - 1) & (x >= 0) & (x <= image.shape[1] - 1)


def nearest(image, kids, inside):
    """The image through the best Gaussian, and its FWHM in arcsec."""
    def difference(sigma):
        return np.mean((ndimage.gaussian_filter(image, sigma) - kids)[inside] ** 2)
    widths = np.arange(0, 4.01, 0.1)
    best = widths[np.argmin([difference(s) for s in widths])]
    return ndimage.gaussian_filter(image, best), 2.3548 * best * KIDS


def structural_similarity(a, b, span, side=7):
    """Mean SSIM, constants 0.01 and 0.03, away from the edges by half a square."""
    mean = lambda image: ndimage.uniform_filter(image, side)
    sample = side * side / (side * side - 1)
    a0, b0 = mean(a), mean(b)
    spread = sample * (mean(a * a) - a0 * a0 + mean(b * b) - b0 * b0)
    both = sample * (mean(a * b) - a0 * b0)
    c1, c2 = (0.01 * span) ** 2, (0.03 * span) ** 2
    ssim = (2 * a0 * b0 + c1) * (2 * both + c2) / ((a0 * a0 + b0 * b0 + c1) * (spread + c2))
    return ssim[side // 2:-(side // 2), side // 2:-(side // 2)].mean()


def sources_of(kids, segments, sigma):
    """KiDS's own sources: segment, centre, flux."""
    found = []
    for k in np.unique(segments[segments > 0]):
        here = segments == k
        flux = kids[here].sum()
        if flux > 10 * np.sqrt((sigma[here] ** 2).sum()):
            y, x = ndimage.center_of_mass(np.clip(kids, 0, None) * here)
            found.append((k, y, x, flux))
    return found


def main():
    folder, restorers, galaxies = sys.argv[1], sys.argv[2].split(","), sys.argv[3:]
    print("| galaxy | run | filter (arcsec) | PSNR (dB) | SSIM | KiDS sources found | flux ratio, galaxy | median flux ratio, "
          "others |\n| --- | --- | --- | --- | --- | --- | --- | --- |")
    for galaxy in galaxies:
        kids = fits.getdata(f"{folder}/KiDS/{galaxy}fitim.fits").astype(float)
        segments = fits.getdata(f"{folder}/KiDS/{galaxy}segim.fits").astype(int)
        sigma = fits.getdata(f"{folder}/KiDS/{galaxy}sigma.fits").astype(float)
        none = fits.getdata(f"pair_{galaxy}_NONE.fits").astype(float)

        def offset(shift):
            image, inside = to_kids(none, kids.shape, shift)
            broad = ndimage.gaussian_filter(kids, 2.0)
            return np.mean((image - broad)[inside] ** 2) / np.mean(broad ** 2)
        shift = optimize.minimize(offset, [0.0, 0.0], method="Nelder-Mead").x
        truth = sources_of(kids, segments, sigma)
        center = segments[kids.shape[0] // 2, kids.shape[1] // 2]
        panels = [("KiDS", kids)]
        for run in restorers:
            image, inside = to_kids(fits.getdata(f"pair_{galaxy}_{run}.fits").astype(float), kids.shape, shift)
            match, fwhm = nearest(image, kids, inside)
            panels.append((f"SDSS {run}", image))
            rms = np.sqrt(np.mean((match - kids)[inside] ** 2))
            span = kids[inside].max()
            ssim = structural_similarity(match * inside, kids * inside, span)
            table = fits.getdata(f"pair_{galaxy}_{run}.cat", 1)
            size = none.shape
            x = (table["X_IMAGE"] - 1 - (size[1] - 1) / 2) * SDSS / KIDS + (kids.shape[1] - 1) / 2 - shift[1]
            y = (table["Y_IMAGE"] - 1 - (size[0] - 1) / 2) * SDSS / KIDS + (kids.shape[0] - 1) / 2 - shift[0]
            ratios, own, found, n = [], float("nan"), 0, 0
            for k, v, u, _ in truth:
                if not inside[int(v), int(u)]:
                    continue
                n += 1
                found += len(x) > 0 and np.hypot(x - u, y - v).min() <= 1 / KIDS
                wide = ndimage.binary_dilation(segments == k, iterations=int(1.5 / KIDS))
                wide &= inside & ((segments == k) | (segments == 0))
                ratio = image[wide].sum() / kids[wide].sum()
                if k == center:
                    own = ratio
                else:
                    ratios.append(ratio)
            print(f"| {galaxy} | {run} | {fwhm:.2f} | {20 * np.log10(span / rms):.2f} | {ssim:.4f} | {found} of {n} | "
                  f"{own:.3f} | {np.median(ratios) if ratios else float('nan'):.3f} |")
        if not picture.plt:
            continue
        figure, axes = picture.plt.subplots(1, len(panels), figsize=(3.2 * len(panels), 3.4))
        noise = 1.4826 * np.median(np.abs(kids - np.median(kids)))
        for axis, (title, image) in zip(axes, panels):
            axis.imshow(np.arcsinh(image / (2 * noise)), origin="lower", cmap="gray", vmin=-0.5, vmax=5,
                        interpolation="nearest")
            axis.set_title(title, fontsize=10)
            axis.set_axis_off()
        picture.plt.tight_layout()
        picture.plt.savefig(f"pair_{galaxy}.png", dpi=80, metadata={"Software": None})
        picture.plt.close(figure)


main()
