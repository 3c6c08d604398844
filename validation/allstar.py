"""IRAF's DAOPHOT and ALLSTAR (Stetson 1987; Debian: iraf, iraf-noao), run without a terminal, as its guide says (Davis 1994).

The PSF: stars of S/N above 10 are found (daofind, phot), 30 for the PSF chosen (pstselect), each the brightest within 4 FWHM
or, where that leaves fewer than 15, within 2, 1 or half a FWHM; the function is the best of all (auto), with a table of what
it leaves. Twice all stars are fitted and all but those of the PSF subtracted (allstar, substar), and the PSF made anew, in the
end varying over the tile where one wants. Then daofind at S/N `faint`, allstar, daofind again on what is left, pfmerge, allstar.
"""
import os
import shutil
import subprocess
import time

import numpy as np
from astropy.io import fits

HEAD = """noao
digiphot
daophot
daophot.verify=no
daophot.update=no
daophot.verbose=no
datapars.fwhmpsf={fwhm}
datapars.sigma={sigma}
datapars.datamin=INDEF
datapars.datamax=INDEF
datapars.noise="poisson"
datapars.readnoise=0.
datapars.epadu={gain}
findpars.threshold={bright}
findpars.sharplo=0.2
findpars.sharphi=1.0
centerpars.calgorithm="none"
fitskypars.salgorithm="mode"
fitskypars.annulus={annulus}
fitskypars.dannulus=16.
photpars.apertures="{fwhm}"
photpars.zmag=25.
daopars.function="auto"
daopars.varorder=0
daopars.psfrad={radius}
daopars.fitrad={fwhm}
daopars.matchrad={match}
daopars.flaterr=0.1
daopars.proferr=1.
daopars.recenter=yes
daopars.fitsky=no
daopars.groupsky=yes
daopars.maxiter=50
daopars.maxgroup=100
"""
STARS = """daofind i i.coo0 interactive-
phot i i.coo0 i.mag0 interactive-
"""
SELECT = """daopars.psfrad={0}
pstselect i i.mag0 i.pst{1} 30 interactive-
"""
ANEW = """allstar i i.mag0 i_pm{0} i.als0{0} i.arj0{0} i_sub0{0}
substar i i.als0{0} i.used{0} i_pm{0} i_alone{0}
daopars.varorder={2}
psf i_alone{0} i.als0{0} i.used{0} i_pm{1} i.used{1} i.group{1} interactive-
"""
FIT = """findpars.threshold={faint}
daofind i i.coo1 interactive-
phot i i.coo1 i.mag1 interactive-
allstar i i.mag1 i_pm2 i.als1 i.arj1 i_sub1
daofind i_sub1 i.coo2 interactive-
phot i_sub1 i.coo2 i.mag2 interactive-
pfmerge i.als1,i.mag2 i.mrg
allstar i i.mrg i_pm2 i.als2 i.arj2 i_sub2
pdump i.als2 XCENTER,YCENTER,MAG,MERR yes > i.als2.txt
"""


def here():
    return shutil.which("irafcl") is not None


def run(work, image, fwhm, order, sigma, gain=1.0, faint=4.0):
    """x, y, magnitude (zero point 25) and its error; what is left of the image; seconds. The PSF varies by this order."""
    shutil.rmtree(work, ignore_errors=True)  # IRAF writes over nothing
    os.makedirs(f"{work}/uparm")
    fits.writeto(f"{work}/i.fits", image)
    with open(f"{work}/login.cl", "w") as login:
        login.write(f'set home = "{work}/"\nset imdir = "HDR$"\nset uparm = "{work}/uparm/"\nset cache = "{work}/"\n'
                    'set userid = "me"\nset imtype = "fits"\npackage user\nclpackage\nkeep\n')
    # a star of S/N 1 is about 1.12 / FWHM sigmas of a pixel high; daofind's own filter, of 1.5 sigma radius, is no better than a pixel
    head = HEAD.format(fwhm=fwhm, sigma=sigma, gain=gain, bright=11.2 / fwhm, annulus=2 * fwhm, radius=4 * fwhm,
                       match=max(1.0, fwhm / 2))

    def irafcl(script):
        with open(f"{work}/log", "a") as log:
            subprocess.run(["irafcl"], input=head + script + "logout\n", cwd=work, env={**os.environ, "HOME": work, "TERM": "dumb"},
                           stdout=log, stderr=log, text=True, check=False)

    begin = time.time()
    radii = [r * fwhm for r in (4, 2, 1, 0.5)]
    irafcl(STARS + "".join(SELECT.format(r, n) for n, r in enumerate(radii)))
    stars = [sum(line[0] != "#" for line in open(f"{work}/i.pst{n}")) for n in range(len(radii))]
    best = next((n for n, count in enumerate(stars) if count >= 15), int(np.argmax(stars)))
    irafcl(f"psf i i.mag0 i.pst{best} i_pm0 i.used0 i.group0 interactive-\n" + "".join(ANEW.format(n, n + 1, order) for n in range(2)) +
           FIT.format(faint=1.12 * faint / fwhm))
    if not os.path.exists(f"{work}/i_sub2.fits"):
        raise SystemExit(f"allstar.py: ALLSTAR wrote no list; see {work}/log")
    seconds = time.time() - begin
    with open(f"{work}/i.als2.txt") as file:
        rows = np.array([[np.nan if v == "INDEF" else float(v) for v in line.split()] for line in file]).T
    left = fits.getdata(f"{work}/i_sub2.fits").astype(np.float32)
    for name in os.listdir(work):
        if name != "log":
            shutil.rmtree(f"{work}/{name}") if os.path.isdir(f"{work}/{name}") else os.remove(f"{work}/{name}")
    return rows, left, seconds
