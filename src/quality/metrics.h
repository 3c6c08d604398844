/* THE table of metrics, and their measurement over a range of magnitudes.
 *
 * Intervals: shares (recall, precision) Clopper-Pearson; medians and sigma_MAD by order statistics; MagErr,
 * AP and the completeness magnitudes by bootstrap, unbounded below RX_BOOTSTRAP_FEWEST sources; flux_scale from
 * its 1 sigma error (rx_qa_flux) by Student's t, as those of the PSF.
 */
#ifndef RX_QUALITY_METRICS_H
#define RX_QUALITY_METRICS_H

#include "quality/evaluate.h"
#include "quality/statistics.h"

/* METRIC(id, name, unit, digits, whole, help): digits after the point on pages; `whole` metrics exist for "all" only. Precision goes by measured
 * magnitude, everything else by reference magnitude. */
#define RX_METRICS(METRIC)                                                                                   \
    METRIC(RECALL, "recall", "", 3, 0, "share of references found")                                          \
    METRIC(PRECISION, "precision", "", 3, 0,                                                                 \
           "share of detections that are references, by measured magnitude")                                 \
    METRIC(AP, "ap", "", 3, 1, "average precision, area under the precision-recall steps")                   \
    METRIC(MAG50, "mag50", "mag", 2, 1, "magnitude of 50 % completeness")                                    \
    METRIC(MAG90, "mag90", "mag", 2, 1, "magnitude of 90 % completeness")                                    \
    METRIC(MAGERR, "magerr", "%", 2, 0, "mean of 100 |F - F0| / F0")                                         \
    METRIC(MAGERR_SHIFTED, "magerr_shifted", "%", 2, 0, "magerr once zp_offset is taken out")                \
    METRIC(BIAS_MAG, "bias_mag", "mag", 3, 0, "median of m - m0")                                            \
    METRIC(SCATTER_MAG, "scatter_mag", "mag", 3, 0, "sigma_MAD of m - m0")                                   \
    METRIC(BIAS_PERCENT, "bias_percent", "%", 2, 0, "median of 100 (F - F0) / F0")                           \
    METRIC(SCATTER_PERCENT, "scatter_percent", "%", 2, 0, "sigma_MAD of 100 (F - F0) / F0")                  \
    METRIC(ZP_OFFSET, "zp_offset", "mag", 3, 1, "median of m - m0 of bright unsaturated matches")            \
    METRIC(DX, "dx", "pix", 3, 0, "median of x - x0")                                                        \
    METRIC(DY, "dy", "pix", 3, 0, "median of y - y0")                                                        \
    METRIC(SCATTER_X, "scatter_x", "pix", 3, 0, "sigma_MAD of x - x0")                                       \
    METRIC(SCATTER_Y, "scatter_y", "pix", 3, 0, "sigma_MAD of y - y0")                                       \
    METRIC(DX_ARCSEC, "dx_arcsec", "arcsec", 3, 0, "median of x - x0")                                       \
    METRIC(DY_ARCSEC, "dy_arcsec", "arcsec", 3, 0, "median of y - y0")                                       \
    METRIC(SCATTER_X_ARCSEC, "scatter_x_arcsec", "arcsec", 3, 0, "sigma_MAD of x - x0")                      \
    METRIC(SCATTER_Y_ARCSEC, "scatter_y_arcsec", "arcsec", 3, 0, "sigma_MAD of y - y0")                      \
    METRIC(PULL_MEDIAN, "pull_median", "", 2, 0, "median of (F - F0) / error, 0 when unbiased")              \
    METRIC(PULL_WIDTH, "pull_width", "", 2, 0, "sigma_MAD of (F - F0) / error, 1 when errors are true")      \
    METRIC(FLUX_SCALE, "flux_scale", "", 4, 1,                                                               \
           "restored / untouched flux of isolated sources, no reference needed")                             \
    METRIC(PSF_DT, "psf_dt", "", 4, 1, "mean (T - T of PSF) / T of reserved stars, no reference needed")     \
    METRIC(PSF_DE1, "psf_de1", "", 4, 1, "mean e1 - e1 of PSF of reserved stars, no reference needed")       \
    METRIC(PSF_DE2, "psf_de2", "", 4, 1, "mean e2 - e2 of PSF of reserved stars, no reference needed")       \
    METRIC(PSF_GROWTH, "psf_growth", "", 4, 1,                                                               \
           "curve of growth to 20 FWHM, largest stars - PSF, no reference needed")

#define RX_METRIC_ID(id, name, unit, digits, whole, help) RX_METRIC_##id,
typedef enum rx_metric { RX_METRICS(RX_METRIC_ID) RX_METRIC_COUNT } rx_metric;
#undef RX_METRIC_ID

typedef struct rx_metric_row {
    const char *name, *unit, *help;
    int digits, whole;
} rx_metric_row;

const rx_metric_row *rx_metric_get(rx_metric metric);

/* low <= magnitude < high, or everything (sources of unknown magnitude too) when `whole`. */
typedef struct rx_mag_range {
    int whole;
    double low, high;
} rx_mag_range;

/* Metrics of a range; `only` one of them, or all with RX_METRIC_COUNT (bootstraps cost time). estimate[RX_METRIC_COUNT]; what was
 * not asked or does not exist there has value NAN, n 0. */
rx_status rx_metrics_measure(const rx_evaluation *evaluation, rx_mag_range mags, double level,
                             rx_resampling by, rx_metric only, rx_estimate *estimate, rx_error *err);

#endif
