"""The other programs that are Python: one job as an astronomer would write it, and the seconds that it took.

    peer.py skimage IMAGE ITERATIONS FWHM THREADS
    peer.py sep IMAGE CATALOGUE FILTER
    peer.py photutils IMAGE CATALOGUE FILTER
    peer.py allstar IMAGE FWHM SIGMA GAIN FOLDER

Seconds are of the job alone: the interpreter and its modules have been loaded, for skimage also the image. skimage's
transforms are scipy's, which use one thread unless told otherwise (THREADS above 1). ALLSTAR is IRAF's, run as allstar.py says.
"""
import os
import sys
import time
import warnings

import numpy as np
from astropy.io import fits


def read(name):
    with fits.open(name, memmap=False) as hdus:
        return hdus[0].data.astype(np.float32)


def moffat(fwhm, beta=4.765):
    """A stamp of ten FWHM, normalised."""
    half = int(5 * fwhm)
    y, x = np.mgrid[-half:half + 1, -half:half + 1]
    alpha = fwhm / (2 * np.sqrt(2 ** (1 / beta) - 1))
    psf = (1 + (x * x + y * y) / alpha ** 2) ** -beta
    return (psf / psf.sum()).astype(np.float32)


def skimage(name, iterations, fwhm, threads):
    import scipy.fft
    from skimage.restoration import richardson_lucy
    image = read(name)
    image /= image.max()
    psf = moffat(float(fwhm))
    with scipy.fft.set_workers(int(threads)):
        begun = time.perf_counter()
        richardson_lucy(image, psf, num_iter=int(iterations))
        return time.perf_counter() - begun


def kernel(name):
    """A filter of SExtractor's .conv format."""
    with open(name, encoding="ascii") as file:
        rows = [line.split() for line in file if line.strip() and not line.startswith(("#", "CONV"))]
    return np.array(rows, dtype=np.float32)


def sep(name, catalogue, convolution):
    """The numbers of plain.param, by the settings of plain.sex."""
    import sep as library
    from astropy.table import Table
    library.set_extract_pixstack(3_000_000)
    library.set_sub_object_limit(10_000)
    begun = time.perf_counter()
    image = read(name)
    sky = library.Background(image, bw=64, bh=64, fw=3, fh=3)
    sky.subfrom(image)
    objects, segments = library.extract(image, 1.5, err=sky.globalrms, minarea=5, filter_kernel=kernel(convolution),
                                        deblend_nthresh=32, deblend_cont=0.005, clean=True, clean_param=1.0,
                                        segmentation_map=True)
    ids = np.arange(1, len(objects) + 1, dtype=np.int32)
    place = objects["x"], objects["y"]
    shape = objects["a"], objects["b"], objects["theta"]
    own = {"seg_id": ids, "segmap": segments}
    kron, flag = library.kron_radius(image, *place, *shape, 6.0, **own)
    radius = np.maximum(2.5 * kron, 3.5 / np.sqrt(np.maximum(objects["a"] * objects["b"], 1e-6)))
    auto, error, auto_flag = library.sum_ellipse(image, *place, *shape, radius, err=sky.globalrms, subpix=5, **own)
    aperture, _, _ = library.sum_circle(image, *place, 2.5, err=sky.globalrms, subpix=5, **own)
    half, _ = library.flux_radius(image, *place, 6.0 * objects["a"], 0.5, normflux=auto, subpix=5, **own)
    with np.errstate(all="ignore"):
        magnitude = -2.5 * np.log10(auto)
    Table({"NUMBER": ids, "X_IMAGE": place[0] + 1, "Y_IMAGE": place[1] + 1, "FLUX_AUTO": auto, "FLUXERR_AUTO": error,
           "MAG_AUTO": magnitude, "FLUX_APER": aperture, "A_IMAGE": shape[0], "B_IMAGE": shape[1],
           "THETA_IMAGE": np.degrees(shape[2]), "FLAGS": objects["flag"] | flag | auto_flag,
           "ELONGATION": shape[0] / shape[1], "FLUX_RADIUS": half}).write(catalogue, format="fits", overwrite=True)
    return time.perf_counter() - begun


def photutils(name, catalogue, convolution):
    """Its segmentation, by the same settings; numbers of plain.param that it has."""
    from astropy.convolution import convolve
    from astropy.table import Table
    from photutils.background import Background2D, MedianBackground
    from photutils.segmentation import SourceCatalog, deblend_sources, detect_sources
    warnings.simplefilter("ignore")
    begun = time.perf_counter()
    image = read(name)
    sky = Background2D(image, (64, 64), filter_size=(3, 3), bkg_estimator=MedianBackground())
    image -= sky.background
    smooth = convolve(image, kernel(convolution), normalize_kernel=True)
    found = detect_sources(smooth, 1.5 * sky.background_rms, npixels=5)
    found = deblend_sources(smooth, found, npixels=5, nlevels=32, contrast=0.005, progress_bar=False)
    table = SourceCatalog(image, found, error=sky.background_rms, convolved_data=smooth)
    aperture, _ = table.circular_photometry(2.5)
    names = ("label", "xcentroid", "ycentroid", "kron_flux", "kron_fluxerr", "semimajor_sigma", "semiminor_sigma", "orientation",
             "elongation")
    columns = {name: np.asarray(getattr(table, name)) for name in names}
    Table(columns | {"aperture": aperture, "half": np.asarray(table.fluxfrac_radius(0.5))}).write(catalogue, format="fits",
                                                                                                  overwrite=True)
    return time.perf_counter() - begun


def allstar(name, fwhm, sigma, gain, folder):
    sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir))
    import allstar as daophot
    return daophot.run(os.path.abspath(folder), read(name), float(fwhm), 0, float(sigma), float(gain))[2]


JOBS = {"skimage": skimage, "sep": sep, "photutils": photutils, "allstar": allstar}

if __name__ == "__main__":
    print(f"seconds {JOBS[sys.argv[1]](*sys.argv[2:]):.6f}")
