# The PSF of stars.fits (make_daophot.py) as IRAF's DAOPHOT has it, and its image at two places: irafcl <make_daophot.cl
set imtype=fits
noao
digiphot
daophot
datapars.fwhmpsf=3.4
datapars.sigma=1.0
datapars.datamax=60000
datapars.epadu=1
datapars.readnoise=1
centerpars.calgorithm="none"
fitskypars.salgorithm="constant"
fitskypars.skyvalue=100.
photpars.apertures="6"
daopars.psfrad=5
daopars.fitrad=3.4
daopars.function="penny2"
daopars.varorder=2
phot ("stars.fits", skyfile="", coords="stars.coo", output="stars.mag", plotfile="", interactive=no, verify=no, verbose=no)
pstselect ("stars.fits", "stars.mag", "stars.pst", 12, interactive=no, verify=no, verbose=no)
psf ("stars.fits", "stars.mag", "stars.pst", "daophot.psf.fits", "stars.opst", "stars.psg", matchbyid=yes, interactive=no, verify=no, verbose=no)
seepsf ("daophot.psf.fits", "daophot_30_50.fits", xpsf=30, ypsf=50)
seepsf ("daophot.psf.fits", "daophot_350_380.fits", xpsf=350, ypsf=380)
logout
