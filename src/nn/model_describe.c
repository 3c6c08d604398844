/* A model in words. */
#include <inttypes.h>
#include <math.h>

#include "nn/model.h"

static void add_net(rx_text *dst, const char *name, const rx_net *net)
{
    int widest = 0, convolutions = 0;
    for (int i = 1; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        widest = n->channels > widest ? n->channels : widest;
        convolutions += n->nweights > 0;
    }
    rx_text_printf(dst,
                   "%-12s%d nodes, %d convolutions of up to %d channels, %ld parameters, %.1f thousand "
                   "multiplications per pixel, reaches %d pixels\n",
                   name, net->nnodes, convolutions, widest, net->nparams, 1e-3 * rx_net_macs(net),
                   rx_net_halo(net));
}

static void add_nodes(rx_text *dst, const char *name, const rx_net *net)
{
    rx_text_printf(dst, "\n%s operation   of  plus  channels  kernel  stride  resolution\n", name);
    for (int i = 0; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        rx_text_printf(dst, "%5d  %-10s", i, rx_op_name(n->op));
        const int cells[][2] = {{4, n->src}, {6, n->add}, {10, n->channels}, {8, n->kernel}, {8, n->stride}};
        for (int c = 0; c < 5; c++) /* blank where it has no meaning */
            if (cells[c][1] > 0 || (cells[c][1] == 0 && c < 2))
                rx_text_printf(dst, "%*d", cells[c][0], cells[c][1]);
            else
                rx_text_printf(dst, "%*s", cells[c][0], "");
        rx_text_printf(dst, "  1/%d%s\n", 1 << n->level, n->relu ? "  ReLU" : "");
    }
}

/* A value of the dictionary, or a dash. */
static void add_value(rx_text *dst, int width, int digits, double value)
{
    if (isfinite(value))
        rx_text_printf(dst, " %*.*f", width, digits, value);
    else
        rx_text_printf(dst, " %*s", width, "-");
}

static void add_bins(rx_text *dst, const rx_model *model)
{
    rx_text_add(dst, "\nWhat it does in each bin of seeing and noise (test images, never trained on):\n"
                     "FWHM (pix)   noise          loss        list  recall  bias (%)  scatter (%)  images\n");
    for (long i = 0; i < (long)model->nfwhm * model->nsigma; i++) {
        const rx_model_bin *b = &model->bins[i];
        rx_text_printf(dst, "%4.2f-%-6.2f %5.2f-%-7.2f %-11.5g", b->fwhm[0], b->fwhm[1], b->sigma[0],
                       b->sigma[1], b->loss);
        add_value(dst, 5, 3, b->list);
        add_value(dst, 7, 3, b->recall);
        add_value(dst, 9, 2, 100 * b->bias);
        add_value(dst, 12, 2, 100 * b->scatter);
        rx_text_printf(dst, " %7ld\n", b->images);
    }
    rx_text_add(
        dst,
        "Noise: on the scale on which 0.1 % of the blurred pixels exceed 255; fainter images belong to the "
        "last bins. List: how hard the bin is, 0 to 1; with active learning the share of its images that "
        "train. Recall: stars of S/N above 5; bias and scatter: fluxes of stars of S/N above 12.\n");
}

void rx_model_describe(const rx_model *model, rx_text *dst)
{
    const rx_front *f = &model->front;
    rx_text_printf(dst, "Model       %s, digest %s\n", model->name[0] != '\0' ? model->name : "(no name)",
                   model->digest[0] != '\0' ? model->digest : "(not yet written)");
    rx_text_printf(dst, "Mode        %s\n",
                   f->mode == RX_MODE_BLIND ? "BLIND: given the image alone"
                                            : "INFORMED: given the image, a deconvolved copy and the seeing");
    rx_text_printf(dst, "Output      PSF a Gaussian of FWHM %g pixels\n", f->target_fwhm);
    if (f->mode == RX_MODE_INFORMED)
        rx_text_printf(
            dst,
            "Optics      regularisation %g; Richardson-Lucy steps with the tile's PSF: %d%s (pedestal %g)\n",
            f->tikhonov, f->rl_steps, model->second != NULL ? " after each stage" : "", f->pedestal);
    add_net(dst, "RESTORE", model->restore);
    if (model->second != NULL)
        add_net(dst, "SECOND", model->second);
    if (model->psf != NULL)
        add_net(dst, "PSF", model->psf);
    rx_text_printf(
        dst, "Training    %ld epochs, %ld images, seed %" PRIu64 "; these are the parameters of epoch %ld\n",
        model->epochs, model->patches, model->seed, model->best);
    if (!model->ended)
        rx_text_add(dst, "            has not ended: start rextract-train again to go on\n");
    rx_text_printf(dst, "Noise       correlated up to a factor of %.2f in the training; works up to %.2f\n",
                   model->factor, rx_model_factor(model));
    if (model->bins != NULL)
        rx_text_printf(dst,
                       "Brightness  of fields, up to %.0f noise units, of pixels up to %.0f; dark structure "
                       "in %g of the images\n",
                       rx_model_peak(model) / RX_NOISE_LEVEL_PEAK, rx_model_peak(model), model->dark);
    add_nodes(dst, "node  ", model->restore);
    if (model->second != NULL)
        add_nodes(dst, "second", model->second);
    if (model->bins != NULL)
        add_bins(dst, model);
    else
        rx_text_add(dst, "\nNo dictionary: how well it does is not known\n");
    if (model->provenance != NULL)
        rx_text_printf(dst, "\nConfiguration of the training:\n%s", model->provenance);
}
