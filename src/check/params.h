/* Parameters of the checks of a tile, besides the pipeline's own parameters. */
#ifndef RX_CHECK_PARAMS_H
#define RX_CHECK_PARAMS_H

typedef enum rx_quality_flux {
    RX_QUALITY_AUTO,
    RX_QUALITY_APER,
    RX_QUALITY_ISO,
    RX_QUALITY_ISOCOR,
    RX_QUALITY_PETRO,
    RX_QUALITY_WIN,
    RX_QUALITY_TEMPLATE
} rx_quality_flux;

/* How lists of sources are compared with others. */
typedef struct rx_quality_params {
    double match_radius; /* MATCH_RADIUS */
    int match_arcsec;    /* MATCH_UNIT ARCSEC, else pixels */
    int flux;            /* QA_MAG, an rx_quality_flux */
} rx_quality_params;

typedef struct rx_check_params {
    int self_check;   /* SELF_CHECK */
    int blank_check;  /* BLANK_CHECK, realisations; below 0: the quick one with the network */
    double false_max; /* NOISE_FALSE_MAX, per Mpixel; 0: no limit */
    long count;       /* SELF_CHECK_COUNT */
    double density;   /* SELF_CHECK_DENSITY, per Mpixel */
    double mag[2];    /* SELF_CHECK_MAG; from >= to: around the tile's limit */
    double galaxies;  /* SELF_CHECK_GALAXIES, share */
    int templates; /* source lists or errors depend on template fits: QA_MAG, PRECISION_TARGET, MAGERR_INJECTED */
    int figures; /* QA_FIGURES */
    rx_quality_params quality;
} rx_check_params;

#endif
