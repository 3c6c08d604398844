/* The plan of a self check, and what comes of it. */
#ifndef RX_CHECK_SELFCHECK_PLAN_H
#define RX_CHECK_SELFCHECK_PLAN_H

#include "base/error.h"
#include "base/log.h"
#include "check/conformal.h"
#include "check/params.h"
#include "data/sources.h"
#include "pipeline/field.h"
#include "pipeline/params.h"
#include "pipeline/pipeline.h"
#include "quality/qa.h"
#include "quality/statistics.h"
#include "simulate/optics.h"

/* What all restorers of a field share, so that they meet the same pixels. */
typedef struct rx_selfcheck_plan {
    const rx_field *field;
    const int32_t *segments; /* sources of the untouched tile, 0 = sky; the caller's */
    const rx_check_params *par;
    rx_pipeline_params params;    /* the run's, with what the check needs measured; points into those */
    rx_pipeline_params apertures; /* the run's, with nothing but the wide aperture */
    rx_optics *optics;
    unsigned char *allowed;             /* [height][width] where objects may go */
    double limit;                       /* magnitude of a point source at 5 sigma, PSF-weighted */
    double mag_low, mag_high, mag_step; /* of the objects; bins */
    double galaxies;                    /* share of the objects */
    double galaxy_scale;   /* their sizes over those of the stated law (simulate/scene.h) at pixel_scale */
    long resolved;         /* sources of the tile behind both; 0: too few, the share is 0 and the law holds */
    double model_noise;    /* rx_domain_noise() of the field: copies are restored as it was */
    double pixel_scale;    /* arcsec, for the sizes of galaxies; 1 when not known */
    double match_radius;   /* pixels */
    double distance;       /* least one between injected objects, pixels */
    double diameter;       /* of the wide aperture, pixels: 5 FWHM, at least 10 */
    long count, per_round; /* objects wanted, at most so many at once */
} rx_selfcheck_plan;

/* Of a new detection, ADU. */
typedef struct rx_selfcheck_found {
    double wide, empty; /* wide aperture: flux, and what it would hold without the object, */
    double light;       /* and the light injected into it, NAN where fluxes are of a restored image */
    double flux, fluxerr, blend; /* of its template, NAN without one */
} rx_selfcheck_found;

/* Completeness and bias of one restorer on this tile. Intervals at 95 %. */
typedef struct rx_selfcheck {
    long injected, found;
    double galaxies;            /* share of the injected */
    rx_estimate mag90, mag50;   /* magnitude of 90 and 50 % completeness */
    rx_estimate injected_share; /* of detections that are new after the injection: share that was injected */
    rx_estimate bias, scatter;  /* median and sigma_MAD of measured - true magnitude (QA_MAG), FLAGS 0 */
    /* The same in a wide aperture corrected for what the PSF has outside, of objects of S/N 20 and more by
     * their true flux, FLAGS 0, without a source of the untouched tile in the aperture: as measured, against
     * the light that was injected into that very aperture (of a restored image: that its PSF puts there), */
    rx_estimate wide_bias;
    /* and less what that very aperture would hold without the object, which is `sky`, per pixel, in ADU:
     * light of sources too faint to be detected, and the error of the background (the object itself moves the
     * mode of its mesh). This bias is 0 when the flux scale is right. */
    rx_estimate aperture_bias, sky;
    int rounds;
    /* every round beside the one before: x counts on by `pitch` pixels from round to round */
    int width, height, pitch;
    rx_qa_list truth, found_list; /* injected objects; new detections */
    unsigned char *is_galaxy;     /* [truth.n] */
    long *partner;                /* [truth.n] in found_list; -1: not found */
    rx_selfcheck_found *measured; /* [found_list.n] */
    rx_conformal errors;          /* of template fluxes, where templates were fitted */
    rx_psf *psf;                  /* of the image that fluxes are measured on */
    rx_qa_picture picture;        /* middle of the first round, restored; pixels owned */
} rx_selfcheck;

/* `sources` of the untouched tile must outlive the plan, as must params, par and field. The field has a PSF. From
 * those of FLAGS 0 or 1, 2.5 mag and more above the limit, follow size and share of galaxies, where
 * SELF_CHECK_GALAXIES leaves it to the tile: a source is resolved when its half-light radius r (FLUX_RADIUS) is more
 * than 1.2 times that of the PSF, r0; sqrt(r^2 - r0^2) over the law of simulate/scene.h is taken as log-normal with
 * the law's scatter, cut off where sources cannot be resolved, and its median is found by maximum likelihood.
 * Unresolved galaxies are added as that distribution says (each resolved one counts 1 over its chance to be
 * resolved). Fewer than 10 resolved sources: no galaxies, or those asked for with the sizes of the law. In a crowd,
 * where blends look resolved, rx_checks_run() injects none. Errors: RX_USAGE (MATCH_UNIT), RX_INPUT (no place left),
 * RX_SYSTEM. */
rx_status rx_selfcheck_plan_new(const rx_pipeline_params *params, const rx_check_params *par,
                                const rx_field *field, const rx_sources *sources, rx_selfcheck_plan **dst,
                                rx_error *err);
void rx_selfcheck_plan_free(rx_selfcheck_plan *plan);

/* Share of a PSF's light within a circle of that diameter (pixels) about its centre, at 0-based tile position
 * (x, y); stamp: room for size * size floats. */
double rx_selfcheck_enclosed(const rx_psf *psf, double x, double y, double diameter, float *stamp);

#endif
