#!/usr/bin/python3
"""What to take where the PSF is not given: methods that measure it or do without, beside Richardson-Lucy that is given it.

    unknown_psf.py OUTPUT [SEED[,SEED...]]

Simulated tiles of 512 x 512 pixels, stars and galaxies of S/N up to some hundreds, Moffat PSFs of FWHM 3 to 8 pixels, one of each
for every seed (801,802,803 to choose by; ledger.py); the sharp image is known. PSNR and SSIM as in the restoration campaign (SSIM: K1 = K2 = 0.001), means:

    RL        given the PSF, the best of nine per tile and quality: 6, 18 and 60 iterations, three filters
    RL_BLIND  of the image alone, the best of three filters per tile and quality
    INFORMED  config/psfnet.fits, given the PSF
    AUTO      the same, with the PSF that PSF_TYPE AUTO, the default, measures on the tile's own stars
    BLIND     config/psfnet-blind.fits, of the image alone
    PAPER     config/psfnet-paper.fits, likewise

The networks are made for the PSF of the sharp image, Richardson-Lucy leaves stars as they become: most of PSNR is in their
cores. Exit status 1 where AUTO is below RL somewhere. Into OUTPUT: unknown_psf.md, summary.json.
"""
import json
import shutil
import sys
from pathlib import Path

import numpy as np
from astropy.io import fits
from scipy import ndimage

import ledger
import tiles

SEEING, BETA = (3, 4, 5, 6, 7, 8), 4.765
NITER, FILTERS = (6, 18, 60), (0, 0.8, 2)
METHODS = ("RL", "RL_BLIND", "INFORMED", "AUTO", "BLIND", "PAPER")


def qualities(image, sharp):
    """PSNR (dB) and SSIM, the sky taken off both."""
    image, sharp = image - np.median(image), sharp - np.median(sharp)

    def mean(a):
        return ndimage.gaussian_filter(a, 1.5, radius=5)
    reach, ma, mb = sharp.max() - sharp.min(), mean(image), mean(sharp)
    c = (0.001 * reach) ** 2
    ssim = ((2 * ma * mb + c) * (2 * (mean(image * sharp) - ma * mb) + c) /
            ((ma ** 2 + mb ** 2 + c) * (mean(image ** 2) - ma ** 2 + mean(sharp ** 2) - mb ** 2 + c)))
    return np.array([20 * np.log10(sharp.max() / np.sqrt(np.mean((image - sharp) ** 2))), ssim.mean()])


def restored(program, tile, sharp, restorer, **keywords):
    run = program.run(tile, (restorer,), ("RESTORED",), PARAMETERS_NAME="few.param", BLANK_CHECK=0, **keywords)[restorer]
    return qualities(run.images["RESTORED"], sharp)


def measured(program, fwhm, seed):
    """PSNR and SSIM of each method on one tile."""
    tile = program.simulate(f"FWHM {fwhm}", IMAGE_SIZE=512, PSF_FWHM=fwhm, PSF_BETA=BETA, SEED=seed, SHARP_NAME="sharp.fits",
                            STAR_COUNT=300, STAR_MAG="17.5,23", GALAXY_COUNT=300, GALAXY_MAG="17.5,23")
    sharp = fits.getdata(program.folder / "sharp.fits").astype(float)
    given = {"PSF_TYPE": "MOFFAT", "PSF_FWHM": fwhm, "PSF_BETA": BETA}
    tried = [restored(program, tile, sharp, "RL", RL_NITER=n, RL_DENOISE=f, **given) for n in NITER for f in FILTERS]
    blind = [restored(program, tile, sharp, "RL_BLIND", RL_DENOISE=f) for f in FILTERS]
    return np.array([np.max(tried, axis=0), np.max(blind, axis=0), restored(program, tile, sharp, "NET", **given),
                     restored(program, tile, sharp, "NET"), restored(program, tile, sharp, "NET", NET_MODEL="./psfnet-blind.fits"),
                     restored(program, tile, sharp, "NET", NET_MODEL="./psfnet-paper.fits")])


def main(output, seeds="801,802,803"):
    seeds = [int(s) for s in seeds.split(",")]
    ledger.claim("unknown_psf", output, seeds)
    program = tiles.Program(output)
    for name in ("blind", "paper"):
        shutil.copy(tiles.TOP / f"config/psfnet-{name}.fits", program.folder)
    head = ["FWHM"] + [f"{quality}, {method}" for quality in ("PSNR", "SSIM") for method in METHODS]
    text = ["| " + " | ".join(head) + " |", "| --- " * len(head) + "|"]
    found, holds = {}, True
    for fwhm in SEEING:
        psnr, ssim = np.mean([measured(program, fwhm, seed) for seed in seeds], axis=0).T
        found[fwhm] = {"psnr": dict(zip(METHODS, psnr)), "ssim": dict(zip(METHODS, ssim))}
        text.append(f"| {fwhm} | " + " | ".join([f"{v:.2f}" for v in psnr] + [f"{v:.3f}" for v in ssim]) + " |")
        print(text[-1], flush=True)
        auto, rl = METHODS.index("AUTO"), METHODS.index("RL")
        holds &= psnr[auto] >= psnr[rl] and ssim[auto] >= ssim[rl]
    (Path(output) / "unknown_psf.md").write_text(f"`{program.version()}`\n\n" + "\n".join(text) + "\n")
    (Path(output) / "summary.json").write_text(json.dumps({"version": program.version(), "seeds": seeds, "seeing": found}, indent=1) + "\n")
    return not holds


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
