/* What the paper prints and claims: Jia, Lv, Ning, Song, Li, Ji, Cui, Li 2023, "Image restoration with point
 * spread function regularization and active learning", MNRAS 527, 6581 (arXiv:2311.00186). Its own network
 * is "NET" here, Richardson-Lucy with a Gaussian filter "RL". */
#ifndef RX_LAB_PAPER_H
#define RX_LAB_PAPER_H

#include "base/text.h"

enum { RX_PAPER_TABLES = 4, RX_PAPER_COLUMNS = 8 };

typedef struct rx_paper_column {
    double bin;  /* FWHM in pixels, or noise sigma on the 0..255 scale */
    double t, p; /* as printed; t of NET against RL */
} rx_paper_column;

/* Tables 1 to 4: two-sample t of SSIM or PSNR. The degrees of freedom are not printed; these are the ones
 * that give the printed p of 28 of the 30 columns: 138 = 2 x 70 - 2 and 78 = 2 x 40 - 2. */
typedef struct rx_paper_table {
    int number; /* in the paper */
    int by_sigma, ssim;
    double dof;
    int n;
    rx_paper_column column[RX_PAPER_COLUMNS];
} rx_paper_table;

/* i = 0..RX_PAPER_TABLES - 1; and the one for a quantity and a metric. */
const rx_paper_table *rx_paper_table_get(int i);
const rx_paper_table *rx_paper_table_of(int by_sigma, int ssim);

/* The column of the bin around `centre`, NULL where the paper prints none. */
const rx_paper_column *rx_paper_column_at(const rx_paper_table *table, double centre);

/* Whether the printed p follows from the printed t (two-sided, the table's dof) within what rounding t to
 * 0.01 and p to three digits allows; *p = the p that follows, *ln_p its logarithm. */
int rx_paper_column_fits(const rx_paper_table *table, const rx_paper_column *column, double *p, double *ln_p);

typedef enum rx_claim_id {
    RX_CLAIM_EVERY_BIN,
    RX_CLAIM_ALL_P,
    RX_CLAIM_NOISE,
    RX_CLAIM_INSIDE,
    RX_CLAIM_BEYOND,
    RX_CLAIM_SPEED,
    RX_CLAIM_NO_FAKES,
    RX_CLAIM_RESTORED_BETTER,
    RX_CLAIM_NET_BEST,
    RX_CLAIM_LOW_SNR,
    RX_CLAIM_ACCURACY,
    RX_CLAIM_ABOVE_RL, /* this and the next ones: goals of this program, not of the paper */
    RX_CLAIM_ABOVE_FLAT,
    RX_CLAIM_LISTS,
    RX_CLAIM_PAIRS,
    RX_CLAIM_PLATEAU,
    RX_CLAIM_FLUXES,
    RX_CLAIM_TEMPLATES,
    RX_CLAIM_COUNT
} rx_claim_id;

typedef struct rx_claim {
    const char *name;  /* short, for files and the terminal */
    const char *place; /* section, figure or table of the paper */
    const char *words; /* what is claimed, in our words */
    const char *test;  /* when it counts as reproduced */
} rx_claim;

const rx_claim *rx_claim_get(rx_claim_id id);

typedef enum rx_claim_state {
    RX_REPRODUCED,
    RX_NOT_REPRODUCED,
    RX_NOT_YET_TESTABLE, /* what it speaks of did not take part */
    RX_NOT_TESTED        /* by this kind of campaign */
} rx_claim_state;

typedef struct rx_claim_verdict {
    rx_claim_id claim;
    rx_claim_state state;
    rx_text said; /* plain sentences made from the numbers */
} rx_claim_verdict;

const char *rx_claim_state_name(rx_claim_state state); /* "reproduced" ... */

void rx_claim_verdicts_free(int n, rx_claim_verdict *verdicts); /* content only */

#endif
