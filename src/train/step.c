/* The joint loss of PSF-NET on one sample, chain by chain: from the blurred image, then from the sharp one.
 */
#include "train/step.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "train/step_pass.h"

struct rx_step {
    rx_step_params par;
    int side;
    size_t pixels;
    int from_blurred, from_sharp; /* chains that have a term */
    int uses_restore, uses_psf;   /* networks that have one */
    rx_pass *pass;
    rx_ffl *ffl;                    /* NULL without that term */
    float *restored;                /* RESTORE(x) */
    float *first, *second;          /* what the networks of a chain make after that */
    float *gradient, *inner, *back; /* by the chain's first output, its second one, and what comes back */
    float *weight, *work;           /* [pixels], [2][pixels] */
};

static rx_status new_parts(rx_step *step, const rx_model *model, rx_error *err)
{
    const rx_step_params *par = &step->par;
    float **planes[] = {&step->restored, &step->first, &step->second, &step->gradient,
                        &step->inner,    &step->back,  &step->weight};
    step->work = RX_NEW(float, 2 * step->pixels);
    int bad = step->work == NULL;
    for (size_t i = 0; i < sizeof planes / sizeof planes[0]; i++) {
        *planes[i] = RX_NEW(float, step->pixels);
        bad |= *planes[i] == NULL;
    }
    if (bad)
        return rx_error_memory(err, step->pixels * 9 * sizeof(float));
    RX_TRY(rx_pass_new(model, step->side, step->uses_psf, &step->pass, err));
    if (par->ffl > 0)
        RX_TRY(rx_ffl_new(step->side, par->margin, &step->ffl, err));
    return RX_OK;
}

rx_status rx_step_new(const rx_model *model, const rx_step_params *par, int side, rx_step **dst,
                      rx_error *err)
{
    *dst = NULL;
    if (par->margin < 0 || side - 2 * par->margin < 1)
        return rx_error_set(err, RX_USAGE,
                            "a margin of %d pixels leaves nothing of images of %d pixels; give a smaller one",
                            par->margin, side);
    rx_step *step = RX_NEW(rx_step, 1);
    if (step == NULL)
        return rx_error_memory(err, sizeof *step);
    step->par = *par;
    step->side = side;
    step->pixels = (size_t)side * (size_t)side;
    step->from_blurred = par->idt_restore > 0 || par->light > 0 || par->ffl > 0 || par->rec_psf > 0;
    step->from_sharp = par->idt_psf > 0 || par->rec_restore > 0;
    step->uses_restore = step->from_blurred || par->rec_restore > 0;
    step->uses_psf = step->from_sharp || par->rec_psf > 0;
    rx_status status = new_parts(step, model, err);
    if (status != RX_OK) {
        rx_step_free(step);
        return status;
    }
    *dst = step;
    return RX_OK;
}

void rx_step_free(rx_step *step)
{
    if (step == NULL)
        return;
    rx_pass_free(step->pass);
    rx_ffl_free(step->ffl);
    float *const owned[] = {step->restored, step->first, step->second, step->gradient,
                            step->inner,    step->back,  step->weight, step->work};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++)
        free(owned[i]);
    free(step);
}

void rx_step_load(rx_step *step)
{
    rx_pass_load(step->pass);
}

const float *rx_step_restored(const rx_step *step)
{
    return step->from_blurred ? step->restored : NULL;
}

/* d(out, truth) times `scale`: *term unweighted, *total weighted, gradient += (NULL: not wanted). */
static void add_pixels(const rx_step *step, double scale, const float *out, const float *truth, double *term,
                       double *total, float *gradient)
{
    double value = 0;
    rx_loss_pixels(&(rx_loss){step->par.kind, step->side, step->par.margin, step->weight}, out, truth, scale,
                   &value, gradient);
    *term = value / scale;
    *total += value;
}

static void set_weights(rx_step *step, const float *input)
{
    if (step->par.kind == RX_LOSS_LINEAR)
        rx_loss_weights(input, step->side, step->par.floor, step->work, step->weight);
}

static void clear(const rx_step *step, float *plane)
{
    memset(plane, 0, step->pixels * sizeof *plane);
}

static void add_back(const rx_step *step)
{
    for (size_t k = 0; k < step->pixels; k++)
        step->gradient[k] += step->back[k];
}

/* RESTORE(x) against y, and PSF(RESTORE(x)) against x. */
static void run_blurred(rx_step *step, const rx_sample *sample, float *const gradient[RX_MODEL_NETS],
                        rx_step_values *values)
{
    const int back = gradient != NULL;
    const rx_step_params *par = &step->par;
    rx_pass_restore(step->pass, sample->x, sample->w, step->restored);
    if (par->idt_restore > 0 || par->light > 0 || par->rec_psf > 0)
        set_weights(step, sample->x);
    clear(step, step->gradient);
    if (par->idt_restore > 0)
        add_pixels(step, par->idt_restore, step->restored, sample->y, &values->idt_restore, &values->total,
                   step->gradient);
    if (par->light > 0) {
        double value = 0;
        rx_loss_light(&(rx_loss){par->kind, step->side, par->margin, step->weight}, step->restored, sample->y,
                      par->light, step->work, &value, back ? step->gradient : NULL);
        values->light = value / par->light;
        values->total += value;
    }
    if (par->ffl > 0) {
        double value = 0;
        rx_ffl_add(step->ffl, step->restored, sample->y, par->ffl, &value, back ? step->gradient : NULL);
        values->ffl = value / par->ffl;
        values->total += value;
    }
    if (par->rec_psf > 0) {
        rx_pass_blur(step->pass, step->restored, step->first);
        clear(step, step->inner);
        add_pixels(step, par->rec_psf, step->first, sample->x, &values->rec_psf, &values->total, step->inner);
        if (back) {
            rx_pass_blur_back(step->pass, step->inner, gradient[RX_NET_PSF], step->back);
            add_back(step);
        }
    }
    if (back)
        rx_pass_restore_back(step->pass, step->gradient, gradient, NULL);
}

/* PSF(y) against x, and RESTORE(PSF(y)) against y. */
static void run_sharp(rx_step *step, const rx_sample *sample, float *const gradient[RX_MODEL_NETS],
                      rx_step_values *values)
{
    const int back = gradient != NULL;
    const rx_step_params *par = &step->par;
    rx_pass_blur(step->pass, sample->y, step->first);
    set_weights(step, sample->y);
    clear(step, step->gradient);
    if (par->idt_psf > 0)
        add_pixels(step, par->idt_psf, step->first, sample->x, &values->idt_psf, &values->total,
                   step->gradient);
    if (par->rec_restore > 0) {
        rx_pass_restore(step->pass, step->first, NULL, step->second);
        clear(step, step->inner);
        add_pixels(step, par->rec_restore, step->second, sample->y, &values->rec_restore, &values->total,
                   step->inner);
        if (back) {
            rx_pass_restore_back(step->pass, step->inner, gradient, step->back);
            add_back(step);
        }
    }
    if (back)
        rx_pass_blur_back(step->pass, step->gradient, gradient[RX_NET_PSF], NULL);
}

/* Is there a place for the gradient of each network that has one? */
static int has_places(const rx_step *step, float *const gradient[RX_MODEL_NETS])
{
    const int restore = gradient[RX_NET_RESTORE] != NULL &&
                        (rx_pass_stages(step->pass) == 1 || gradient[RX_NET_SECOND] != NULL);
    return (!step->uses_restore || restore) && (!step->uses_psf || gradient[RX_NET_PSF] != NULL);
}

rx_status rx_step_run(rx_step *step, const rx_sample *sample, float *const gradient[RX_MODEL_NETS],
                      rx_step_values *values, rx_error *err)
{
    *values = (rx_step_values){0};
    if (sample->side != step->side)
        return rx_error_set(err, RX_INPUT, "a training image of %d pixels instead of %d; make it anew",
                            sample->side, step->side);
    if (gradient != NULL && !has_places(step, gradient))
        return rx_error_set(err, RX_INPUT,
                            "a network of the loss without a place for its gradient; give one");
    RX_TRY(rx_pass_optics(step->pass, sample, step->par.rec_restore > 0, err));
    if (step->from_blurred)
        run_blurred(step, sample, gradient, values);
    if (step->from_sharp)
        run_sharp(step, sample, gradient, values);
    return RX_OK;
}
