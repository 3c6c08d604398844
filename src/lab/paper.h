/* What the paper prints: Jia, Lv, Ning, Song, Li, Ji, Cui, Li 2023, "Image restoration with point
 * spread function regularization and active learning", MNRAS 527, 6581 (arXiv:2311.00186). Its own network
 * is "NET" here, Richardson-Lucy with a Gaussian filter "RL". */
#ifndef RX_LAB_PAPER_H
#define RX_LAB_PAPER_H

enum { RX_PAPER_TABLES = 4, RX_PAPER_COLUMNS = 8 };

/* Tables 1 to 4: two-sample t of SSIM or PSNR. The degrees of freedom are not printed; these are the ones
 * that give the printed p of 28 of the 30 columns: 138 = 2 x 70 - 2 and 78 = 2 x 40 - 2. */
typedef struct rx_paper_table {
    int number; /* in the paper */
    int by_sigma, ssim;
    double dof;
    int n;
    double bin[RX_PAPER_COLUMNS];                    /* FWHM in pixels, or noise sigma on the 0..255 scale */
    double t[RX_PAPER_COLUMNS], p[RX_PAPER_COLUMNS]; /* as printed; t of NET against RL */
} rx_paper_table;

extern const rx_paper_table rx_paper_tables[RX_PAPER_TABLES];

/* Whether the printed p of a column follows from its t (two-sided, the table's dof) within what rounding t to
 * 0.01 and p to three digits allows; *p = the p that follows, *ln_p its logarithm. */
int rx_paper_column_fits(const rx_paper_table *table, int column, double *p, double *ln_p);

#endif
