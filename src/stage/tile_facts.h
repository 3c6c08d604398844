/* What a run found out about its tile, in numbers: for the account of a survey (survey/tile_record.h). */
#ifndef RX_STAGE_TILE_FACTS_H
#define RX_STAGE_TILE_FACTS_H

#include "base/error.h"
#include "data/record.h"
#include "io/cards.h"
#include "pipeline/field.h"
#include "quality/qa.h"
#include "quality/rho.h"
#include "quality/tally.h"
#include "stage/extract.h"

/* What the program says of its own work. */
typedef struct rx_run_guard {
    int known;
    double false_per_mpixel; /* on this tile's noise (BLANK_CHECK); NAN: not known */
    double raised;           /* what DETECT_THRESH was multiplied by for it */
    double unexplained;      /* share of cells that the model does not explain (RXMODEL); NAN: not known */
} rx_run_guard;

/* One restorer. */
typedef struct rx_run_facts {
    char name[16]; /* "NONE", "RL", ... as asked for */
    long sources;
    char by[16], why[240]; /* restorer that did it instead, and why; "" none */
    char taken[16];    /* that AUTO took, `why` it did where none did it instead; "" AUTO was not asked for */
    char outside[400]; /* what the restorer was not made for, "" nothing */
    rx_fluxcheck flux; /* n = 0: not measured */
    rx_run_guard guard;
    double sharp;    /* share of the sources with FLAGS_RESTORE 256 (RXSHARP); NAN: not known */
    rx_record facts; /* of data/facts.def; owned */
    rx_tally *tally; /* against the reference catalogue; NULL without one */
} rx_run_facts;

/* How its PSF came about, and what reserved stars say of it. */
typedef struct rx_psf_account {
    char how[16]; /* RXPSFHOW; "" where that does not say */
    int stars, reserved;
    double flux_error, growth, residual;
    double off[3], error[3]; /* means of rx_psf_star.off, and errors */
    rx_rho rho;              /* n 0: nothing known */
} rx_psf_account;

/* Is it of a lower rung than the tile's own stars, one by one? */
int rx_psf_account_is_lower(const rx_psf_account *psf);

/* The whole image, without a reference. */
typedef struct rx_tile_state {
    double ellipticity; /* of the PSF at the centre, 1 - b/a; NAN without one */
    double depth;       /* mag of a point source at S/N 5 (quality/tile_quality.h); NAN without a PSF */
    double factor;      /* noise of wide sums over that of independent pixels */
    double masked;      /* share of pixels that are not used */
    double saturated;
    int wrong, look; /* its remarks; -1 without it */
} rx_tile_state;

/* Cards of RECORD_CARDS that the header has. */
enum { RX_RECORD_CARDS = 8, RX_CARD_NAME = RX_CARD - RX_CARD_KEY };
typedef struct rx_tile_card {
    char name[RX_CARD_NAME];
    double value;
} rx_tile_card;

/* One image of the file. */
typedef struct rx_extension_facts {
    int hdu, width, height;
    double alpha, delta; /* of the centre, deg J2000; NAN without WCS */
    double fwhm;         /* of the PSF at the centre, pixels; NAN where no PSF was needed */
    double sky, noise;   /* ADU */
    rx_psf_account psf;
    rx_verdict verdict; /* over all gates */
    int known;          /* state is known: not of records of 0.1 and before */
    rx_tile_state state;
    int ncards;
    rx_tile_card card[RX_RECORD_CARDS];
    char page[512]; /* of the tile, as the user named its folder; "" none */
    int nruns;
    rx_run_facts *run; /* [nruns] owned */
} rx_extension_facts;

typedef struct rx_tile_facts {
    int n;
    rx_extension_facts *extension;
} rx_tile_facts;

/* A further extension, its sources counted, and the facts of the runs taken over; with_reference: with empty tallies. */
rx_status rx_tile_facts_add(rx_tile_facts *facts, const rx_field *field, rx_run *runs, int nruns,
                            int with_reference, rx_extension_facts **dst, rx_error *err);

/* Those of the header among n cards. */
void rx_tile_facts_cards(rx_extension_facts *facts, const rx_tile *tile, int n, const char *const *names);
void rx_tile_facts_free(rx_tile_facts *facts); /* content only */

#endif
