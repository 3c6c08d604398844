#!/bin/sh
# rextract-simulate from end to end: what it writes is held against theory by astropy and numpy, and against
# what rextract measures on it; the same bytes for any number of threads; injection into tiles, real ones too.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
rextract=$programs/rextract simulate=$programs/rextract-simulate
data=${RX_SHARED_DATA:-}
need rextract rextract-simulate
enter

python=/usr/bin/python3
$python -c 'import astropy, numpy' 2>/dev/null || python=

# theory TITLE <<PYTHON: checks of written files; `table` reads a FITS table, `image` an image.
theory() {
    cat >check.py
    if [ -z "$python" ]; then
        skip "$1" "python3 with astropy is absent"
        return
    fi
    $python - >check.log 2>&1 <<'END'
import numpy as np
from astropy.io import fits
from astropy.table import Table
image = lambda name, hdu=0: fits.getdata(name, hdu).astype(float)
table = lambda name: Table.read(name, hdu=1)
exec(open('check.py').read())
END
    result "$1" $? check.log
}

# --- a run with nothing but defaults ---

mkdir plain && cd plain || exit 2
"$simulate" -SEED 1 >../plain.log 2>&1
code=$?
cd ..
[ $code -eq 0 ] && [ "$(find plain -type f | sort | tr "\n" " ")" = "plain/sim.fits plain/sim_truth.fits " ]
result "defaults make a tile and its truth" $? plain.log

theory "headers say what made the files" <<'END'
for name, hdu in (('plain/sim.fits', 0), ('plain/sim_truth.fits', 1)):
    header = fits.getheader(name, hdu)
    history = ''.join(str(h) for h in header['HISTORY'])
    assert 'rextract-simulate' in history, history
    assert header['RXSEED'] == 1 and header['RXFWHM'] == 4, header
    assert header['RXSIGMA'] == 10 and header['RXZP'] == 25 and 'Moffat' in header['RXPSF'], header
    assert 'STAR_COUNT' in history and 'NTHREADS' not in history, history
assert len(table('plain/sim_truth.fits')) > 300
END

# --- theory ---

# Stars far apart on nothing at all.
"$simulate" -IMAGE_NAME stars.fits -TRUTH_NAME stars_truth.fits -SHARP_NAME stars_sharp.fits -GALAXY_COUNT 0 \
    -STAR_COUNT 500 -STAR_MAG 12,18 -LEAST_DISTANCE 20 -PSF_FWHM 2.7 -NOISE_TYPE NONE -SKY_LEVEL 0 \
    -IMAGE_SIZE 600,500 -SEED 3 >stars.log 2>&1
result "a field of isolated stars" $? stars.log

theory "positions, fluxes and encircled energy of stars are those of a Moffat" <<'END'
alpha = 2.7 / 2 / np.sqrt(2**(1 / 4.765) - 1)
stars, img, sharp = table('stars_truth.fits'), image('stars.fits'), image('stars_sharp.fits')
y, x = np.mgrid[:img.shape[0], :img.shape[1]]
inside = [s for s in stars if 30 < s['X_IMAGE'] < 570 and 30 < s['Y_IMAGE'] < 470]
assert len(inside) > 40, len(inside)
for s in inside:
    x0, y0 = s['X_IMAGE'] - 1, s['Y_IMAGE'] - 1
    box = np.s_[int(y0) - 25:int(y0) + 26, int(x0) - 25:int(x0) + 26]
    # centroid under a round window, iterated (as XWIN_IMAGE)
    for plane in (img, sharp):
        p, u, v = plane[box], x0 + 0.3, y0 - 0.2
        for _ in range(40):
            w = p * np.exp(-((x[box] - u)**2 + (y[box] - v)**2) / (2 * 2.0**2))
            u += 2 * (np.sum(w * (x[box] - u)) / np.sum(w))
            v += 2 * (np.sum(w * (y[box] - v)) / np.sum(w))
        assert abs(u - x0) < 0.003 and abs(v - y0) < 0.003, (s['NUMBER'], u - x0, v - y0)
    r = np.hypot(x[box] - x0, y[box] - y0)
    # beyond 25 pixels: 5e-6 of the flux, and the neighbours' wings
    assert abs(img[box].sum() / s['FLUX'] - 1) < 2e-3, img[box].sum() / s['FLUX']
# encircled energy, over pixels cut 11 x 11 by the circle, pixel response in it: mean over the brightest
bright = sorted(inside, key=lambda s: -s['FLUX'])[:20]
for radius in (1.35, 2.7, 5.4):
    share = []
    for s in bright:
        x0, y0 = s['X_IMAGE'] - 1, s['Y_IMAGE'] - 1
        k = (np.arange(11) - 5) / 11
        total = 0
        for j in range(int(y0) - 9, int(y0) + 10):
            for i in range(int(x0) - 9, int(x0) + 10):
                total += img[j, i] * np.mean(np.hypot(i + k[None] - x0, j + k[:, None] - y0) < radius)
        share.append(total / s['FLUX'])
    # the same aperture over a Moffat, integrated over pixels by 21 x 21 points, at the same places
    expected = []
    k = (np.arange(21) - 10) / 21
    for s in bright[:20]:
        x0, y0 = s['X_IMAGE'] - 1, s['Y_IMAGE'] - 1
        kk = (np.arange(11) - 5) / 11
        total = 0
        for j in range(int(y0) - 9, int(y0) + 10):
            for i in range(int(x0) - 9, int(x0) + 10):
                q = (i + k[None] - x0)**2 + (j + k[:, None] - y0)**2
                value = np.mean((1 + q / alpha**2)**-4.765) * 3.765 / (np.pi * alpha**2)
                total += value * np.mean(np.hypot(i + kk[None] - x0, j + kk[:, None] - y0) < radius)
        expected.append(total)
    ratio = np.mean(share) / np.mean(expected)
    print('encircled energy, measured / Moffat', radius, ratio)
    assert abs(ratio - 1) < 1e-3, (radius, ratio)
END

theory "a PSF image" <<'END'
y, x = np.mgrid[-15:16, -15:16]
psf = np.exp(-(x**2 / 2.2**2 + y**2 / 1.6**2 + 0.3 * x * y / 2) / 2)
fits.writeto('psf.fits', (psf / psf.sum()).astype('f4'))
END
if [ -f psf.fits ]; then
    "$simulate" -IMAGE_NAME shaped.fits -TRUTH_NAME shaped_truth.fits -GALAXY_COUNT 0 -STAR_COUNT 200 -STAR_MAG 15,16 \
        -LEAST_DISTANCE 15 -PSF_TYPE FILE -PSF_NAME psf.fits -NOISE_TYPE NONE -SKY_LEVEL 0 -IMAGE_SIZE 500 >psf.log 2>&1
    result "stars through a PSF image" $? psf.log
    theory "stars have the moments of the PSF image" <<'END'
psf, img, stars = image('psf.fits'), image('shaped.fits'), table('shaped_truth.fits')
v, u = np.mgrid[-15:16, -15:16]
n = 0
for s in stars:
    x0, y0 = s['X_IMAGE'] - 1, s['Y_IMAGE'] - 1
    i, j = int(round(x0)), int(round(y0))
    if not (20 < i < 479 and 20 < j < 479):
        continue
    p = img[j - 15:j + 16, i - 15:i + 16] / s['FLUX']
    x, y = u + i - x0, v + j - y0
    assert abs(p.sum() - 1) < 1e-3 and abs((p * x).sum()) < 5e-3 and abs((p * y).sum()) < 5e-3, p.sum()
    for a, b in (((p * x * x).sum(), (psf * u * u).sum()), ((p * y * y).sum(), (psf * v * v).sum()),
                 ((p * x * y).sum(), (psf * u * v).sum())):
        assert abs(a - b) < 0.02, (a, b)
    n += 1
assert n > 20, n
END
else
    skip "stars through a PSF image" "python3 with astropy is absent"
fi

"$simulate" -IMAGE_NAME gauss.fits -TRUTH_NAME '' -STAR_COUNT 0 -GALAXY_COUNT 0 -SKY_LEVEL 200 \
    -NOISE_SIGMA 7 >noise.log 2>&1 &&
    "$simulate" -IMAGE_NAME ccd.fits -TRUTH_NAME '' -STAR_COUNT 0 -GALAXY_COUNT 0 -SKY_LEVEL 200 \
        -NOISE_TYPE CCD -GAIN 2.5 -READ_NOISE 6 -SEED 2 >>noise.log 2>&1
result "empty fields" $? noise.log

theory "noise has the moments asked for, pixels are independent" <<'END'
for name, variance, third in (('gauss.fits', 49, 0), ('ccd.fits', 200 / 2.5 + (6 / 2.5)**2, 200 / 2.5**2)):
    d = image(name) - 200
    n = d.size
    assert abs(d.mean()) < 4.5 * np.sqrt(variance / n), (name, d.mean())
    assert abs(d.var() / variance - 1) < 4.5 * np.sqrt(2 / n), (name, d.var())
    assert abs(np.mean(d**3) - third) < 4.5 * np.sqrt(15 / n) * variance**1.5, (name, np.mean(d**3))
    assert abs(np.mean(d**4) / variance**2 - 3) < 0.05, (name, np.mean(d**4))
    for a, b in ((d[1:], d[:-1]), (d[:, 1:], d[:, :-1]), (d[1:, 1:], d[:-1, :-1])):
        assert abs(np.mean(a * b)) / variance < 4.5 / np.sqrt(n), name
END

# --- what the main program measures on it ---

# With the sky as it is, not as it is estimated: estimates are off by 0.01 of the noise of a pixel, upwards for
# the wings of stars, downwards for the skewness of photon noise, which shows in such wide apertures.
"$simulate" -IMAGE_NAME field.fits -TRUTH_NAME field_truth.fits -GALAXY_COUNT 0 -STAR_COUNT 500 -STAR_MAG 14,19 \
    -LEAST_DISTANCE 12 -PSF_FWHM 3 -SKY_LEVEL 100 -NOISE_TYPE CCD -GAIN 2 -READ_NOISE 4 -SEED 8 >field.log 2>&1 &&
    printf 'XWIN_IMAGE\nYWIN_IMAGE\nFLUX_APER(1)\nFLUXERR_APER(1)\nFLAGS\nALPHA_J2000\nDELTA_J2000\n' >wide.param &&
    "$rextract" field.fits -c "$top/config/default.sex" -PARAMETERS_NAME wide.param -RESTORE_TYPE NONE \
        -FILTER_NAME "$top/config/default.conv" -CATALOG_TYPE FITS_1.0 -CATALOG_NAME field.cat \
        -BACK_TYPE MANUAL -BACK_VALUE 100 -PHOT_APERTURES 24 -MAG_ZEROPOINT_KEY MAGZERO >>field.log 2>&1
result "rextract reads a simulated tile" $? field.log

theory "measured positions and wide fluxes have no offset from the truth" <<'END'
truth, found = table('field_truth.fits'), table('field.cat')
alpha = 3 / 2 / np.sqrt(2**(1 / 4.765) - 1)
held = 1 - (1 + (12 / alpha)**2)**-3.765  # of a Moffat within 12 pixels
dx, dy, pull, sky = [], [], [], []
for s in truth:
    if not (20 < s['X_IMAGE'] < 1004 and 20 < s['Y_IMAGE'] < 1004 and s['MAG'] < 18):
        continue
    d = np.hypot(found['XWIN_IMAGE'] - s['X_IMAGE'], found['YWIN_IMAGE'] - s['Y_IMAGE'])
    f = found[np.argmin(d)]
    assert d.min() < 1, (s['NUMBER'], s['MAG'], d.min())
    dx.append(f['XWIN_IMAGE'] - s['X_IMAGE'])
    dy.append(f['YWIN_IMAGE'] - s['Y_IMAGE'])
    pull.append((f['FLUX_APER'] - held * s['FLUX']) / f['FLUXERR_APER'])
    sky.append(np.hypot((f['ALPHA_J2000'] - s['ALPHA_J2000']) * np.cos(np.radians(2.2)),
                        f['DELTA_J2000'] - s['DELTA_J2000']) * 3600)
n = len(dx)
assert n > 100, n
assert abs(np.median(dx)) < 0.01 and abs(np.median(dy)) < 0.01, (np.median(dx), np.median(dy))
print('flux pull', np.mean(pull), np.std(pull), n)
assert abs(np.mean(pull)) < 4 / np.sqrt(n) and 0.85 < np.std(pull) < 1.15, (np.mean(pull), np.std(pull))
assert np.median(sky) < 0.1, np.median(sky)
END

# --- coadds ---

# coadd NAME ARGUMENT...
coadd() {
    name=$1
    shift
    "$simulate" -IMAGE_NAME "$name.fits" -TRUTH_NAME "${name}_truth.fits" -WEIGHT_NAME "${name}_weight.fits" \
        -IMAGE_SIZE 600 -GALAXY_COUNT 0 -SEED 12 "$@" >"$name.log" 2>&1
    result "a coadd: $name" $? "$name.log"
}
for type in DRIZZLE LANCZOS; do
    coadd "${type}_stars" -COADD_TYPE $type -STAR_COUNT 400 -STAR_MAG 14,15 -LEAST_DISTANCE 10 -NOISE_TYPE NONE -SKY_LEVEL 0
    coadd "${type}_sky" -COADD_TYPE $type -COADD_FRAMES 3 -COADD_UNEVEN 1 -STAR_COUNT 0 -NOISE_TYPE CCD -GAIN 2 -SKY_LEVEL 300
done

theory "coadds keep the zero point and the places, weights tell the depth, headers the correlation" <<'END'
for kind, scale in (('DRIZZLE', 0.6), ('LANCZOS', 1.0)):
    img, stars = image(kind + '_stars.fits'), table(kind + '_stars_truth.fits')
    y, x = np.mgrid[:600, :600]
    share, dx, dy = [], [], []
    for s in stars:
        x0, y0 = s['X_IMAGE'] - 1, s['Y_IMAGE'] - 1
        if not (30 < x0 < 570 and 30 < y0 < 570):
            continue
        box = np.s_[int(y0) - 17:int(y0) + 18, int(x0) - 17:int(x0) + 18]
        share.append(img[box].sum() / s['FLUX'])
        w = img[box] * (np.hypot(x[box] - x0, y[box] - y0) < 12)
        dx.append(np.sum(w * (x[box] - x0)) / w.sum())
        dy.append(np.sum(w * (y[box] - y0)) / w.sum())
    print(kind, len(share), np.mean(share), np.std(share), np.median(dx), np.median(dy))
    assert len(share) > 60 and abs(np.median(share) - 1) < 1e-3, np.median(share)
    assert abs(np.median(dx)) < 0.01 and abs(np.median(dy)) < 0.01, (np.median(dx), np.median(dy))
    header = fits.getheader(kind + '_sky.fits')
    weight, d = image(kind + '_sky_weight.fits'), image(kind + '_sky.fits') - 300 * scale**2
    assert header['RXCOADD'] == kind and abs(header['RXBACK'] - 300 * scale**2) < 1e-3, header
    assert 4 < header['RXCFWHM'] < 4.5 and header['RXCNUM'] == 3, header
    assert weight.max() / weight.min() > 2 and weight.min() > 0, (weight.min(), weight.max())
    assert abs(d.std() / header['RXSIGMA'] - 1) < 0.02, (d.std(), header['RXSIGMA'])
    z = d * np.sqrt(weight)
    blocks = z.reshape(20, 30, 20, 30).sum((1, 3)) / 30  # of 30 x 30 pixels: as noisy as one without covariance
    print(kind, z.std(), blocks.std(), header['RXCWIDE'])
    if kind == 'LANCZOS':
        assert abs(z.std() - 1) < 0.02 and 1 < header['RXCWIDE'] < 1.3, (z.std(), header['RXCWIDE'])
    else:
        assert 1.6 < header['RXCWIDE'] < 2.1 and abs(blocks.std() - 1) < 0.15, (header['RXCWIDE'], blocks.std())
END

# --- the same bytes ---

for threads in 1 2; do
    mkdir "threads$threads"
    (cd "threads$threads" && MALLOC_PERTURB_=$((threads * 80)) "$simulate" -NTHREADS $threads -SHARP_NAME sharp.fits \
        -FLAG_NAME flags.fits -NOISE_TYPE CCD -GAIN 2 -SATUR_LEVEL 5000 -BAD_COLUMNS 0.01 -COSMIC_RAYS 100 \
        -PSF_VARIATION 0.2 -CLUSTERING 0.2 -IMAGE_SIZE 700,650) >"threads$threads.log" 2>&1
    result "a CCD on $threads thread(s)" $? "threads$threads.log"
done
diff -r threads1 threads2 >difference 2>&1
result "two threads give the bytes of one" $? difference

for threads in 1 2; do
    mkdir "coadds$threads"
    (cd "coadds$threads" && MALLOC_PERTURB_=$((threads * 80)) "$simulate" -NTHREADS $threads -SHARP_NAME sharp.fits \
        -FLAG_NAME flags.fits -WEIGHT_NAME weight.fits -NOISE_TYPE CCD -GAIN 2 -SATUR_LEVEL 5000 -BAD_COLUMNS 0.01 \
        -COSMIC_RAYS 100 -PSF_VARIATION 0.2 -IMAGE_SIZE 300,250 -COADD_TYPE DRIZZLE -COADD_UNEVEN 0.5) \
        >"coadds$threads.log" 2>&1
    result "a coadd of CCD frames on $threads thread(s)" $? "coadds$threads.log"
done
diff -r coadds1 coadds2 >difference 2>&1
result "two threads give the bytes of one coadd" $? difference

# --- the truth in every format ---

for type in ASCII_HEAD ASCII_VOTABLE FITS_1.0 FITS_LDAC; do
    "$simulate" -IMAGE_SIZE 300 -IMAGE_NAME type.fits -TRUTH_TYPE $type -TRUTH_NAME "truth.$type" >type.log 2>&1
    result "a truth catalogue as $type" $? type.log
done
theory "every format holds the same truth" <<'END'
tables = [table('truth.FITS_1.0'), Table.read('truth.FITS_LDAC', hdu=2),
          Table.read('truth.ASCII_VOTABLE', format='votable'), Table.read('truth.ASCII_HEAD', format='ascii.sextractor')]
assert len(tables[0]) > 20
for other in tables[1:]:
    assert len(other) == len(tables[0])
    for name, tolerance in (('X_IMAGE', 1e-3), ('Y_IMAGE', 1e-3), ('ALPHA_J2000', 1e-6), ('MAG', 1e-3)):
        assert np.allclose(tables[0][name], other[name], rtol=0, atol=tolerance), name
    assert list(map(str.strip, map(str, other['TYPE']))) == list(map(str.strip, map(str, tables[0]['TYPE'])))
END

# --- injection ---

"$simulate" -INJECT_IMAGE field.fits -IMAGE_NAME injected.fits -TRUTH_NAME injected_truth.fits -PSF_TYPE AUTO \
    -STAR_COUNT 60 -GALAXY_COUNT 0 -STAR_MAG 15,16 -MAG_ZEROPOINT 25 -SEED 9 >injected.log 2>&1
result "injection into a tile with the PSF measured on it" $? injected.log

theory "the tile grows by the flux that was injected" <<'END'
truth = table('injected_truth.fits')
added = image('injected.fits') - image('field.fits')
light = truth['FLUX'].sum()
# borders cut a little; photon noise is sqrt(light / gain)
assert len(truth) > 40 and abs(added.sum() / light - 1) < 0.02, (len(truth), added.sum() / light)
before, after = fits.getheader('field.fits'), fits.getheader('injected.fits')
for key in ('CRVAL1', 'CRPIX2', 'CD1_1', 'GAIN', 'SATURATE', 'MAGZERO'):
    assert before[key] == after[key], key
y, x = np.mgrid[:added.shape[0], :added.shape[1]]
ratios = []
for s in truth:
    r = np.hypot(x + 1 - s['X_IMAGE'], y + 1 - s['Y_IMAGE'])
    others = np.hypot(truth['X_IMAGE'] - s['X_IMAGE'], truth['Y_IMAGE'] - s['Y_IMAGE'])
    if np.sort(others)[1] > 40 and r[0].min() > 20 and r[-1].min() > 20 and r[:, 0].min() > 20 and r[:, -1].min() > 20:
        ratios.append(added[r < 15].sum() / s['FLUX'])
assert len(ratios) > 20 and abs(np.median(ratios) - 1) < 5e-3, (len(ratios), np.median(ratios))
assert np.sum(added != 0) > 1000 and np.median(np.abs(added)) < 0.5
END

packed=$data/sdss/94-1-12/frame-r-000094-1-0012.fits.bz2
if [ -n "$data" ] && [ -f "$packed" ] && command -v bunzip2 >/dev/null; then
    bunzip2 -c "$packed" >frame.fits
    "$simulate" -INJECT_IMAGE frame.fits -IMAGE_NAME frame_out.fits -TRUTH_NAME frame_truth.fits -PSF_TYPE AUTO \
        -INJECT_PLACE AWAY -MAG_ZEROPOINT 22.5 -STAR_COUNT 60 -STAR_MAG 16,18 -GALAXY_COUNT 20 -GALAXY_MAG 17,18 \
        -NTHREADS 2 >frame.log 2>&1
    result "injection into an SDSS frame" $? frame.log
    theory "the SDSS frame keeps its sky and its world, and grows by what was injected" <<'END'
from astropy.wcs import WCS
truth = table('frame_truth.fits')
before = image('frame.fits')
added = image('frame_out.fits') - before
light = truth['FLUX'].sum()
assert len(truth) > 200 and abs(added.sum() / light - 1) < 0.02, (len(truth), added.sum() / light)
# most pixels are touched by nothing but wings, below a fifth of the noise
assert np.median(np.abs(added)) < 0.006 and np.isfinite(added).all()
wcs = WCS(fits.getheader('frame_out.fits'))
alpha, delta = wcs.all_pix2world(truth['X_IMAGE'], truth['Y_IMAGE'], 1)
assert np.allclose(alpha, truth['ALPHA_J2000'], rtol=0, atol=1e-6)
assert np.allclose(delta, truth['DELTA_J2000'], rtol=0, atol=1e-6)
END
else
    skip "injection into an SDSS frame" "the real data are absent"
fi

# --- a list of objects ---

cat >list.txt <<'END'
# X_IMAGE Y_IMAGE MAG FLUX_RADIUS SERSIC_N ELONGATION THETA_IMAGE
40 50 16 0 0 1 0
100.25 120.5 15 6 4 2 30
170 70 15 6 1 1.5 -40
9000 70 15 6 1 1.5 -40
END
run() { "$simulate" -IMAGE_SIZE 200 -PSF_FWHM 3 -NOISE_TYPE NONE -SKY_LEVEL 0 -MAG_ZEROPOINT 25 "$@" >list.log 2>&1; }
run -CATALOG_NAME list.txt -IMAGE_NAME listed.fits -TRUTH_NAME listed_truth.fits &&
    run -CATALOG_NAME listed_truth.fits -IMAGE_NAME again.fits -TRUTH_NAME again_truth.fits
result "a list of objects, and the truth that comes of it as a list" $? list.log
theory "objects of a list lie where it says, as bright and as large, and those of a truth catalogue are the same to the bit" <<'END'
a, t = image('listed.fits'), table('listed_truth.fits')
assert len(t) == 3 and [name.strip() for name in t['TYPE']] == ['STAR', 'GALAXY', 'GALAXY']
assert np.all(a == image('again.fits'))
y, x = np.indices(a.shape)
for X, Y, mag, radius in ((40, 50, 16, 0), (170, 70, 15, 6)):
    r = np.hypot(x + 1 - X, y + 1 - Y)
    near = a * (r < 30)
    flux = 10 ** (-0.4 * (mag - 25))
    assert abs(near.sum() / flux - 1) < 0.02, near.sum()
    assert np.hypot((near * (x + 1)).sum() / near.sum() - X, (near * (y + 1)).sum() / near.sum() - Y) < 0.02
v = a[49:90, 149:190] # the exponential disk: its axes and angle by second moments, the PSF taken off
y, x = np.indices(v.shape) - 20.0
f = v.sum()
xx, yy, xy = ((v * p).sum() / f - q for p, q in ((x * x, 2), (y * y, 2), (x * y, 0)))
angle = np.degrees(0.5 * np.arctan2(2 * xy, xx - yy))
assert abs(angle + 40) < 1, angle
END

# --- bad input ---

# refused TITLE CODE TEXT ARGUMENT...: ends with CODE, says TEXT, leaves nothing behind.
refused() {
    title=$1 code=$2 text=$3
    shift 3
    mkdir refused
    (cd refused && "$simulate" "$@") >refused.log 2>&1
    [ $? -eq "$code" ] && grep -q "$text" refused.log && [ -z "$(ls refused)" ]
    result "$title" $? refused.log
    rm -rf refused
}

printf 'no image\n' >text.fits
refused "a tile that is none" 3 text.fits -INJECT_IMAGE ../text.fits
refused "a tile that is not there" 3 absent.fits -INJECT_IMAGE absent.fits
refused "a CCD without gain" 2 GAIN -NOISE_TYPE CCD
refused "PSF_TYPE AUTO without a tile" 2 INJECT_IMAGE -PSF_TYPE AUTO
refused "a PSF file that is not there" 3 absent.psf -PSF_TYPE PSFEX -PSF_NAME absent.psf
refused "a folder that cannot be made" 4 nowhere -TRUTH_NAME /proc/nowhere/truth.fits
refused "templates that are not there" 3 nowhere -TEMPLATE_NAME nowhere -TEMPLATE_COUNT 10
refused "a coadd through a PSF of the image's pixels" 2 PSF_TYPE -COADD_TYPE DRIZZLE -PSF_TYPE FILE -PSF_NAME p.fits
refused "a coadd of a real tile" 2 COADD_TYPE -COADD_TYPE LANCZOS -INJECT_IMAGE ../field.fits
refused "pixels far finer than those of the frames" 2 COADD_SCALE -COADD_TYPE DRIZZLE -COADD_SCALE 0.2
printf '# X_IMAGE Y_IMAGE MAG ELONGATION\n1 1 16 0.5\n' >flat.list
refused "a listed object that cannot be" 3 'flat.list: row 1: ELONGATION is 0.5; give 1 to 20' -CATALOG_NAME ../flat.list
printf '# X_IMAGE Y_IMAGE SIZE\n1 1 16\n' >dark.list
refused "a list that says not how bright" 3 'give it MAG or FLUX' -CATALOG_NAME ../dark.list
printf '# A B MAG\n1 1 16\n' >lost.list
refused "a list that says not where" 3 'X_IMAGE and Y_IMAGE' -CATALOG_NAME ../lost.list
refused "magnitudes the wrong way round" 2 STAR_MAG -STAR_MAG 22,14

finish
