#!/usr/bin/env python3
"""The picture of docs/validation.md: a piece of the SDSS frame as observed and restored by Richardson-Lucy.

usage: picture.py OBSERVED.fits RESTORED.fits OUT.png      (AUTO_NONE.fits and AUTO_RL.fits of run.sh)
Grey scale: asinh of the value above the sky in units of twice the pixel noise, the same in both panels.
"""
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from astropy.io import fits

x0, x1, y0, y1 = 440, 900, 400, 580
observed, restored = (fits.getdata(name)[y0:y1, x0:x1] for name in sys.argv[1:3])
sigma = 1.4826 * np.median(np.abs(observed - np.median(observed)))
figure, axes = plt.subplots(2, 1, figsize=(9.2, 7.6))
for axis, image, title in zip(axes, (observed, restored), ("observed", "restored (RL)")):
    axis.imshow(np.arcsinh(image / (2 * sigma)), origin="lower", cmap="gray", vmin=-0.5, vmax=4, interpolation="nearest")
    axis.set_title(title, fontsize=11)
    axis.set_axis_off()
plt.tight_layout()
plt.savefig(sys.argv[3], dpi=80, metadata={"Software": None})
