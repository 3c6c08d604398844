#!/usr/bin/env python3
"""A tile as observed, restored by each restorer, and what is left over: NAME.png.

usage: picture.py NAME RESTORERS OUT.png      (NAME_<restorer>.fits, NAME_residual_ and NAME_sky_<restorer>.fits of run.sh)

Grey scale: asinh of the value above the sky in units of twice the pixel noise of the observed image, the same in all
panels; residuals (observed - reblurred, in sigmas) from -5 to 5. The 300 x 300 pixels with the most light.
"""
import os
import sys

import numpy as np
from astropy.io import fits
from scipy import ndimage

try:
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
except ImportError:
    plt = None  # numbers, no pictures


def above_sky(name, run):
    """The restored image of a run, its sky subtracted."""
    image = fits.getdata(f"{name}_{run}.fits").astype(float) - fits.getdata(f"{name}_sky_{run}.fits")
    return np.nan_to_num(image)


def window(image, side):
    if side is None or min(image.shape) <= side:
        return slice(None), slice(None)
    noise = 1.4826 * np.median(np.abs(image - np.median(image)))
    light = ndimage.uniform_filter(np.arcsinh(np.clip(image / noise, 0, None)), side, mode="constant")
    half = side // 2
    inner = light[half:light.shape[0] - half, half:light.shape[1] - half]
    y, x = np.unravel_index(np.argmax(inner), inner.shape)
    return slice(y, y + side), slice(x, x + side)


def draw(name, restorers, out, side=300):
    if not plt:
        return
    observed = above_sky(name, "NONE")
    noise = 1.4826 * np.median(np.abs(observed - np.median(observed)))
    cut = window(observed, side)
    panels = [("observed", observed, 0)]
    for run in restorers:
        if run != "NONE" and os.path.exists(f"{name}_{run}.fits"):
            panels.append((run, above_sky(name, run), 0))
            left = f"{name}_residual_{run}.fits"
            if os.path.exists(left):
                panels.append((f"residual {run}", fits.getdata(left).astype(float), 1))
    figure, axes = plt.subplots(1, len(panels), figsize=(3.6 * len(panels), 3.9), squeeze=False)
    for axis, (title, image, linear) in zip(axes[0], panels):
        if linear:
            axis.imshow(image[cut], origin="lower", cmap="gray", vmin=-5, vmax=5, interpolation="nearest")
        else:
            axis.imshow(np.arcsinh(image[cut] / (2 * noise)), origin="lower", cmap="gray", vmin=-0.5, vmax=5,
                        interpolation="nearest")
        axis.set_title(title, fontsize=10)
        axis.set_axis_off()
    plt.tight_layout()
    plt.savefig(out, dpi=80, metadata={"Software": None})
    plt.close(figure)


if __name__ == "__main__":
    draw(sys.argv[1], sys.argv[2].split(","), sys.argv[3])
