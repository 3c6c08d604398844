/* What sep finds, on the pixels of the tile. */
#ifndef RX_DETECT_DETECTIONS_H
#define RX_DETECT_DETECTIONS_H

/* Numbers as sep_catalog has them; isophotal ones are of the filtered image, flux and peak of the other. */
typedef struct rx_detection {
    int group; /* index in the list of groups */
    int npix, xmin, xmax, ymin, ymax, xpeak, ypeak;
    int npix_raw; /* above the threshold before the filter */
    double x, y, x2, y2, xy, errx2, erry2, errxy;
    float threshold, a, b, theta, cxx, cyy, cxy;
    float filtered_flux, flux, peak;
    int flags; /* RX_FLAG_MERGED, RX_FLAG_TRUNCATED, RX_FLAG_DEBLEND_OVER */
    int singular;
    const int *pixels; /* [npix] places in the tile, y * width + x */
} rx_detection;

/* In the order in which a scan of the tile completes the groups, each's as sep numbers them. */
typedef struct rx_detections {
    int n;
    rx_detection *list;
    int nblocks;
    int **blocks; /* owners of the pixels */
} rx_detections;

/* The places of pixels alone. */
void rx_detections_drop_pixels(rx_detections *detections);
void rx_detections_free(rx_detections *detections);

#endif
