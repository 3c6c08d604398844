/* Claims, and the verdicts on them. */
#include "lab/claims.h"

#include <stddef.h>

#include "lab/store.h"

static const rx_claim claims[RX_CLAIM_COUNT] = {
    [RX_CLAIM_EVERY_BIN] =
        {"every bin", "Section 3.2, Figure 5",
         "The network consistently outperforms RL under all PSFs and noise levels, by PSNR and by SSIM.",
         "mean PSNR and mean SSIM of NET above those of RL in every bin, paired t, p adjusted by Holm < 0.05",
         0, 0, 0},
    [RX_CLAIM_ALL_P] = {"all p < 0.05", "Section 3.2, Tables 1 to 4",
                        "All t-tests between RL and the network have p below 0.05; no difference is rejected "
                        "in all cases.",
                        "p of the two-sample t of NET and RL below 0.05 in all 30 columns, as printed (not "
                        "adjusted)",
                        0, 0, 0},
    [RX_CLAIM_NOISE] = {"noise", "Section 3.2, Figure 5",
                        "The advantage is significant where noise varies; the network is robust and stable "
                        "with noisy data.",
                        "NET above RL in every noise bin (as above), and its mean PSNR falls less than RL's "
                        "from the first noise bin to the last",
                        0, 0, 0},
    [RX_CLAIM_INSIDE] =
        {"training range", "Section 3.2, Figure 6",
         "Within the training range the network significantly enhances the images.",
         "NET above the blurred images in every bin inside the training: its seeing, and no "
         "scenes brighter in units of their noise (fainter ones it has in patches of its fields); both "
         "metrics, paired t, Holm < 0.05",
         0, 0, 0},
    [RX_CLAIM_BEYOND] =
        {"generalisation", "Section 3.2, Figure 7",
         "The network generalises: images of larger FWHM or higher noise than in training are restored, too.",
         "NET above the blurred images and above RL in every bin of larger FWHM, or of a higher "
         "noise level (on the model's scale, of the blurred scene) than the fields of the training, "
         "both metrics, paired t, Holm < 0.05",
         0, 0, 0},
    [RX_CLAIM_SPEED] = {"speed", "Section 3.3, Figure 8",
                        "The network needs about a tenth of the time of RL with a given PSF.",
                        "not a matter of this campaign: its files hold no timings", 0, 0, 0},
    [RX_CLAIM_NO_FAKES] =
        {"no artificial features", "Section 3.3",
         "Building on PSFs and deconvolution, the network in principle generates no artificial features.",
         "not a matter of this campaign: PSNR and SSIM do not single out invented detail", 0, 0, 0},
    [RX_CLAIM_RESTORED_BETTER] =
        {"restored better", "Section 3.3, Figure 9",
         "Restored images, RL's included, show higher recall and precision.",
         "for every restorer and field: completeness at equal precision above that of NONE at one magnitude "
         "or more and below it at none (McNemar on the same stars, Holm < 0.05), at every precision compared",
         0, 0, 0},
    [RX_CLAIM_NET_BEST] = {"network best", "Section 3.3, Figure 9",
                           "The data treated with the network have the highest recall and precision.",
                           "the same for NET against NONE and against RL", 0, 0, 0},
    [RX_CLAIM_LOW_SNR] =
        {"low S/N", "Section 3.3, Figure 9",
         "The network significantly improves the detection of stars of low signal-to-noise ratio.",
         "NET above NONE and above RL at equal precision, for magnitudes of S/N below 10 (as above)", 0, 0,
         0},
    [RX_CLAIM_ACCURACY] = {"photometry", "Section 3.3, Figure 9 (top)",
                           "The network enhances the accuracy of photometry.",
                           "|error| of NET below that of NONE at one magnitude or more and above it at none "
                           "(paired t on the stars both found, Holm < 0.05)",
                           0, 0, 0},
    [RX_CLAIM_ABOVE_RL] =
        {"goal: above RL", "a goal of this program",
         "The network restores better than RL with a Gaussian filter, tuned in RL's favour.",
         "NET above RL, both metrics, in every bin inside the training range (paired t, "
         "Holm < 0.001) and in more than half of the bins beyond it (Holm < 0.05)",
         0, 0, 0},
    [RX_CLAIM_ABOVE_FLAT] = {"goal: above RL_FLAT", "a goal of this program",
                             "It does so, too, where RL's sky is set flat by the best threshold.",
                             "the same against RL_FLAT", 0, 0, 0},
    [RX_CLAIM_LISTS] = {"goal: detection", "a goal of this program",
                        "More is found on the network's images, at every seeing, of stars and of galaxies.",
                        "ap and recall at the first precision of NET above those of NONE, of the matched "
                        "filter and of RL at its best, for STARS and GALAXIES under every condition in which "
                        "restorers are given the truth",
                        0, 0, 0},
    [RX_CLAIM_PAIRS] =
        {"goal: close pairs", "a goal of this program",
         "The network tells twice as many close pairs apart as are told apart unrestored.",
         "share of PAIRS resolved at the first precision's cut, NET at least twice that of NONE "
         "and of the matched filter, at every seeing",
         0, 0, 0},
    [RX_CLAIM_PLATEAU] =
        {"goal: no checkerboard", "a goal of this program",
         "The network puts no pattern on bright extended plateaus.",
         "rms of the 2 x 2 and of the 4 x 4 phases below 0.01 sigma on PLATEAU, NET, at every seeing", 0, 0,
         0},
    [RX_CLAIM_FLUXES] =
        {"goal: fluxes", "a goal of this program",
         "Fluxes on the network's pixels are as good as RL's, and those of stars unbiased.",
         "MagErr of NET at or below RL's at every magnitude; for S/N above 12 its median bias "
         "below 1 % and its scatter at most 1.5 times that of NONE; on every simulated field on "
         "which restorers are given the truth",
         0, 0, 0},
    [RX_CLAIM_TEMPLATES] =
        {"goal: templates", "a goal of this program",
         "No flux is better than that of template photometry, whatever restored the shapes.",
         "on the stars that every run found, MagErr of every restorer's TEMPLATE at or below the least of "
         "the other fluxes, or above by less than 1.96 errors of the paired difference, at every magnitude "
         "of every simulated field on which restorers are given the truth, and of every real one",
         0, 0, 0},
    [RX_GOAL_BIAS_ISOLATED] =
        {"bias, isolated", NULL,
         "Isolated stars and galaxies of S/N above 10: median error of MAG_TEMPLATE within "
         "0.01 mag, each kind at each seeing",
         NULL, 1, -0.01, 0.01},
    [RX_GOAL_BIAS_BINS] = {"bias, by S/N", NULL, "The same in every single bin of S/N above 10", NULL, 1,
                           -0.01, 0.01},
    [RX_GOAL_BIAS_APART] = {"bias, told apart", NULL,
                            "Blended ones (a neighbour within 1.5 FWHM and 2 mag) of S/N above 10 that are "
                            "resolved from it: within 0.02 mag",
                            NULL, 1, -0.02, 0.02},
    [RX_GOAL_BIAS_BLENDED] = {"bias, blended", NULL,
                              "The same whether or not they are resolved: within 0.02 mag", NULL, 1, -0.02,
                              0.02},
    [RX_GOAL_PULL] = {"pulls, median", NULL, "Isolated stars of S/N 5 to 100: median pull within 0.1", NULL,
                      1, -0.1, 0.1},
    [RX_GOAL_WIDTH] = {"pulls, width", NULL,
                       "Isolated stars of S/N 5 to 100: robust width of the pulls 0.95 to 1.05", NULL, 1,
                       0.95, 1.05},
    [RX_GOAL_BOUND] = {"scatter", NULL,
                       "Isolated stars of S/N above 10: scatter at most 1.1 times that of a matched filter",
                       NULL, 1, 0, 1.1},
    [RX_GOAL_MAGERR] =
        {"MagErr", NULL,
         "Isolated stars that all restorers found: mean |error| in percent at or below the least of "
         "AUTO and apertures of any restorer, in every bin of S/N (number: its ratio)",
         NULL, 1, 0, 1},
    [RX_GOAL_PAIRS] =
        {"pairs", NULL,
         "Close pairs that are resolved: median |error| of the flux ratio at or below that of AUTO on NONE "
         "and on RL, at every separation (number: its ratio to the lower one)",
         NULL, 1, 0, 1},
};

const rx_claim *rx_claim_get(rx_claim_id id)
{
    return &claims[id];
}

const char *rx_claim_state_name(rx_claim_state state)
{
    static const char *const names[RX_CLAIM_STATES] = {
        "reproduced", "not reproduced", "not yet testable", "not tested here",
        "held",       "not held",       "undecided",        "not measured"};
    return names[state];
}

void rx_claims_judge(const rx_store *store, rx_claim_verdicts *dst)
{
    const rx_lab_results *results = store->lab->kind->results;
    dst->n = 0;
    for (int j = 0; j < results->njudges; j++) {
        const rx_claim_judge *judge = &results->judges[j];
        const int each = claims[judge->claim].each;
        for (int run = 0; run < (each ? store->lab->nruns : 1) && dst->n < RX_VERDICTS_MAX; run++) {
            rx_claim_verdict *v = &dst->list[dst->n++];
            *v = (rx_claim_verdict){.claim = judge->claim,
                                    .run = each ? run : -1,
                                    .state = judge->judge == NULL ? RX_NOT_TESTED
                                             : each               ? RX_GOAL_NOT_MEASURED
                                                                  : RX_NOT_YET_TESTABLE};
            if (judge->judge != NULL)
                judge->judge(store, v);
        }
    }
}

void rx_claim_verdicts_free(rx_claim_verdicts *verdicts)
{
    for (int i = 0; i < verdicts->n; i++)
        rx_text_free(&verdicts->list[i].said);
    verdicts->n = 0;
}
