/* The paper's printed numbers and claims. */
#include "lab/paper.h"

#include <math.h>
#include <stddef.h>

#include "num/special.h"

static const rx_paper_table tables[RX_PAPER_TABLES] = {
    {.number = 1,
     .by_sigma = 0,
     .ssim = 1,
     .dof = 138,
     .n = 7,
     .column = {{2, 17.97, 5.96e-38},
                {4, 20.46, 1.23e-43},
                {6, 17.57, 5.08e-37},
                {8, 20.27, 3.40e-43},
                {10, 20.76, 2.72e-44},
                {12, 18.79, 7.41e-40},
                {14, 24.56, 3.21e-52}}},
    {.number = 2,
     .by_sigma = 0,
     .ssim = 0,
     .dof = 138,
     .n = 7,
     .column = {{2, 49.69, 6.02e-90},
                {4, 73.94, 6.82e-113},
                {6, 56.31, 4.29e-97},
                {8, 75.21, 6.88e-114},
                {10, 76.49, 7.09e-115},
                {12, 68.05, 4.77e-108},
                {14, 110.96, 8.31e-137}}},
    {.number = 3,
     .by_sigma = 1,
     .ssim = 1,
     .dof = 78,
     .n = 8,
     .column = {{2, 1.70, 4.88e-02},
                {9, 17.81, 3.25e-29},
                {12, 26.46, 1.05e-40},
                {15, 32.40, 5.35e-47},
                {18, 32.12, 1.00e-46},
                {21, 40.43, 4.40e-54},
                {23, 40.60, 3.24e-54},
                {25, 43.98, 1.63e-54}}},
    {.number = 4,
     .by_sigma = 1,
     .ssim = 0,
     .dof = 78,
     .n = 8,
     .column = {{2, 6.66, 3.52e-09},
                {9, 34.76, 3.11e-49},
                {12, 42.52, 1.02e-55},
                {15, 39.62, 1.98e-53},
                {18, 43.38, 2.27e-56},
                {21, 50.09, 4.52e-61},
                {23, 47.96, 1.19e-59},
                {25, 59.78, 6.52e-67}}},
};

const rx_paper_table *rx_paper_table_get(int i)
{
    return &tables[i];
}

const rx_paper_table *rx_paper_table_of(int by_sigma, int ssim)
{
    for (int i = 0; i < RX_PAPER_TABLES; i++)
        if (!tables[i].by_sigma == !by_sigma && !tables[i].ssim == !ssim)
            return &tables[i];
    return NULL;
}

const rx_paper_column *rx_paper_column_at(const rx_paper_table *table, double centre)
{
    for (int i = 0; i < table->n; i++)
        if (fabs(table->column[i].bin - centre) < 0.25)
            return &table->column[i];
    return NULL;
}

int rx_paper_column_fits(const rx_paper_table *table, const rx_paper_column *column, double *p, double *ln_p)
{
    double most, least, digits = log1p(0.005); /* 1.00 may stand for 1.005 */
    *p = rx_student_p(column->t, table->dof, ln_p);
    rx_student_p(column->t - 0.005, table->dof, &most);
    rx_student_p(column->t + 0.005, table->dof, &least);
    double printed = log(column->p);
    return printed >= least - digits && printed <= most + digits;
}

static const rx_claim claims[RX_CLAIM_COUNT] = {
    [RX_CLAIM_EVERY_BIN] =
        {"every bin", "Section 3.2, Figure 5",
         "The network consistently outperforms RL under all PSFs and noise levels, by PSNR "
         "and by SSIM.",
         "mean PSNR and mean SSIM of NET above those of RL in every bin, paired t, p "
         "adjusted by Holm < 0.05"},
    [RX_CLAIM_ALL_P] = {"all p < 0.05", "Section 3.2, Tables 1 to 4",
                        "All t-tests between RL and the network have p below 0.05; no difference is rejected "
                        "in all cases.",
                        "p of the two-sample t of NET and RL below 0.05 in all 30 columns, as printed (not "
                        "adjusted)"},
    [RX_CLAIM_NOISE] = {"noise", "Section 3.2, Figure 5",
                        "The advantage is significant where noise varies; the network is robust and stable "
                        "with noisy data.",
                        "NET above RL in every noise bin (as above), and its mean PSNR falls less than RL's "
                        "from the first noise bin to the last"},
    [RX_CLAIM_INSIDE] =
        {"training range", "Section 3.2, Figure 6",
         "Within the training range the network significantly enhances the images.",
         "NET above the blurred images in every bin inside the training: its seeing, and no "
         "scenes brighter in units of their noise (fainter ones it has in patches of its fields); both "
         "metrics, paired t, Holm < 0.05"},
    [RX_CLAIM_BEYOND] =
        {"generalisation", "Section 3.2, Figure 7",
         "The network generalises: images of larger FWHM or higher noise than in training "
         "are restored, too.",
         "NET above the blurred images and above RL in every bin of larger FWHM, or of a higher "
         "noise level (on the model's scale, of the blurred scene) than the fields of the training, "
         "both metrics, paired t, Holm < 0.05"},
    [RX_CLAIM_SPEED] = {"speed", "Section 3.3, Figure 8",
                        "The network needs about a tenth of the time of RL with a given PSF.",
                        "not a matter of this campaign: its files hold no timings"},
    [RX_CLAIM_NO_FAKES] =
        {"no artificial features", "Section 3.3",
         "Building on PSFs and deconvolution, the network in principle generates no artificial "
         "features.",
         "not a matter of this campaign: PSNR and SSIM do not single out invented detail"},
    [RX_CLAIM_RESTORED_BETTER] =
        {"restored better", "Section 3.3, Figure 9",
         "Restored images, RL's included, show higher recall and precision.",
         "for every restorer and field: completeness at equal precision above that of "
         "NONE at one magnitude or more and below it at none (McNemar on the same "
         "stars, Holm < 0.05), at every precision compared"},
    [RX_CLAIM_NET_BEST] = {"network best", "Section 3.3, Figure 9",
                           "The data treated with the network have the highest recall and precision.",
                           "the same for NET against NONE and against RL"},
    [RX_CLAIM_LOW_SNR] =
        {"low S/N", "Section 3.3, Figure 9",
         "The network significantly improves the detection of stars of low signal-to-noise "
         "ratio.",
         "NET above NONE and above RL at equal precision, for magnitudes of S/N below 10 (as "
         "above)"},
    [RX_CLAIM_ACCURACY] = {"photometry", "Section 3.3, Figure 9 (top)",
                           "The network enhances the accuracy of photometry.",
                           "|error| of NET below that of NONE at one magnitude or more and above it at none "
                           "(paired t on the stars both found, Holm < 0.05)"},
    [RX_CLAIM_ABOVE_RL] =
        {"goal: above RL", "a goal of this program",
         "The network restores better than RL with a Gaussian filter, tuned in RL's favour.",
         "NET above RL, both metrics, in every bin inside the training range (paired t, "
         "Holm < 0.001) and in more than half of the bins beyond it (Holm < 0.05)"},
    [RX_CLAIM_ABOVE_FLAT] = {"goal: above RL_FLAT", "a goal of this program",
                             "It does so, too, where RL's sky is set flat by the best threshold.",
                             "the same against RL_FLAT"},
    [RX_CLAIM_LISTS] = {"goal: detection", "a goal of this program",
                        "More is found on the network's images, at every seeing, of stars and of galaxies.",
                        "ap and recall at the first precision of NET above those of NONE, of the matched "
                        "filter and of RL at its best, for STARS and GALAXIES under every condition in which "
                        "restorers are given the truth"},
    [RX_CLAIM_PAIRS] =
        {"goal: close pairs", "a goal of this program",
         "The network resolves twice as many close pairs as are resolved unrestored.",
         "share of PAIRS resolved at the first precision's cut, NET at least twice that of NONE "
         "and of the matched filter, at every seeing"},
    [RX_CLAIM_PLATEAU] =
        {"goal: no checkerboard", "a goal of this program",
         "The network puts no pattern on bright extended plateaus.",
         "rms of the 2 x 2 and of the 4 x 4 phases below 0.01 sigma on PLATEAU, NET, at every "
         "seeing"},
    [RX_CLAIM_FLUXES] =
        {"goal: fluxes", "a goal of this program",
         "Fluxes on the network's pixels are as good as RL's, and those of stars unbiased.",
         "MagErr of NET at or below RL's at every magnitude; for S/N above 12 its median bias "
         "below 1 % and its scatter at most 1.5 times that of NONE; on every simulated field on "
         "which restorers are given the truth"},
    [RX_CLAIM_TEMPLATES] =
        {"goal: templates", "a goal of this program",
         "No flux is better than that of template photometry, whatever restored the shapes.",
         "on the stars that every run found, MagErr of every restorer's TEMPLATE at or below the least of "
         "the "
         "other fluxes, or above by less than 1.96 errors of the paired difference, at every magnitude of "
         "every "
         "simulated field on which restorers are given the truth, and of every real one"},
};

const rx_claim *rx_claim_get(rx_claim_id id)
{
    return &claims[id];
}

const char *rx_claim_state_name(rx_claim_state state)
{
    static const char *const names[] = {"reproduced", "not reproduced", "not yet testable",
                                        "not tested here"};
    return names[state];
}

void rx_claim_verdicts_free(int n, rx_claim_verdict *verdicts)
{
    for (int i = 0; i < n; i++)
        rx_text_free(&verdicts[i].said);
}
