/* What the tiles of a condition share. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/psf.h"
#include "io/tile.h"
#include "lab/lab.h"
#include "num/convolve.h"
#include "stage/open.h"

static const double EXTENDED = 9.06; /* 4 pi / (2 ln 2): r_e^2 of a Gaussian to 1 / sum of its squares */

double rx_lab_mag(const rx_lab_sky *sky, double snr)
{
    return sky->simulation->scene.zeropoint - 2.5 * log10(snr * sky->sigma * sqrt(sky->area));
}

double rx_lab_snr(const rx_lab_sky *sky, const rx_object *object)
{
    const double area = sky->area + EXTENDED * object->radius * object->radius * object->ratio;
    return object->flux / (sky->sigma * sqrt(area));
}

double rx_lab_beyond(const rx_lab_sky *sky, double x, double y)
{
    return hypot(fmax(fmax(-x, x - (sky->width - 1)), 0), fmax(fmax(-y, y - (sky->height - 1)), 0));
}

/* Noise of a sky pixel, ADU. */
static double sky_noise(const rx_noise_params *noise)
{
    if (noise->type == RX_NOISE_GAUSS)
        return noise->sigma;
    return noise->type == RX_NOISE_CCD
               ? sqrt(noise->sky * noise->gain + noise->read_noise * noise->read_noise) / noise->gain
               : 0;
}

/* At the centre of the tile; and a Gaussian as wide as the PSF. */
static rx_status measure_psf(rx_lab_sky *sky, rx_error *err)
{
    const size_t n = (size_t)sky->psf->size * (size_t)sky->psf->size;
    const int radius = rx_gauss_radius(sky->fwhm), side = 2 * radius + 1;
    float *stamp = RX_NEW(float, n), *line = RX_NEW(float, (size_t)side);
    sky->side = side;
    sky->kernel = RX_NEW(float, (size_t)side *(size_t)side);
    rx_status status = RX_OK;
    if (stamp == NULL || line == NULL || sky->kernel == NULL) {
        status = rx_error_memory(err, (n + (size_t)side) * sizeof *stamp);
        goto exit;
    }
    rx_psf_at(sky->psf, 0.5 * (sky->width - 1), 0.5 * (sky->height - 1), stamp);
    for (size_t i = 0; i < n; i++)
        sky->power += (double)stamp[i] * (double)stamp[i];
    sky->area = 1 / sky->power;
    rx_gauss_weights(sky->fwhm, radius, line);
    for (int i = 0; i < side * side; i++)
        sky->kernel[i] = line[i / side] * line[i % side];
exit:
    free(stamp);
    free(line);
    return status;
}

rx_status rx_lab_sky_simulate(const rx_lab *lab, const rx_condition *condition, int find, rx_log *log,
                              rx_lab_sky *dst, rx_error *err)
{
    const rx_simulate_config *sim = lab->config->sim;
    dst->condition = *condition;
    RX_TRY(rx_condition_simulation(condition, sim, log, &dst->simulation, err));
    dst->width = dst->simulation->scene.width;
    dst->height = dst->simulation->scene.height;
    dst->fwhm = dst->simulation->optics->fwhm;
    dst->sigma = sky_noise(&dst->simulation->noise);
    rx_status status = rx_optics_on_pixels(dst->simulation->optics, &dst->psf, err);
    if (status == RX_OK)
        status = measure_psf(dst, err);
    if (status == RX_OK && !find)
        status = rx_condition_psf(condition, sim, dst->simulation, &dst->given, err);
    return status;
}

rx_status rx_lab_skies_simulate(rx_lab *lab, rx_log *log, rx_error *err)
{
    rx_condition *conditions = NULL;
    rx_status status = rx_conditions_make(lab->config, &lab->nconditions, &conditions, err);
    if (status == RX_OK) {
        lab->sky = RX_NEW(rx_lab_sky, (size_t)lab->nconditions);
        status = lab->sky == NULL ? rx_error_memory(err, (size_t)lab->nconditions * sizeof *lab->sky) : RX_OK;
    }
    for (int c = 0; status == RX_OK && c < lab->nconditions; c++) {
        lab->nskies = c + 1;
        status = rx_lab_sky_simulate(lab, &conditions[c], 0, log, &lab->sky[c], err);
        if (status == RX_OK && !(lab->sky[c].sigma > 0))
            status = rx_error_set(err, RX_USAGE,
                                  "SIM.NOISE_TYPE, SIM.NOISE_SIGMA: the sky of a %s campaign needs noise",
                                  lab->config->campaign_type);
    }
    free(conditions);
    return status;
}

rx_status rx_lab_sky_read(const rx_lab *lab, rx_log *log, rx_lab_sky *dst, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    int *hdus = NULL, n = 0;
    rx_status status = rx_tile_list(config->tile_name, log, &hdus, &n, err);
    if (status == RX_OK)
        status = rx_field_open(lab->options, RX_FIELD_PSF, &(rx_image_place){config->tile_name, hdus[0], 1},
                               log, &dst->field, err);
    free(hdus);
    if (status != RX_OK)
        return status;
    rx_tile *tile = dst->field->tile;
    if (dst->field->psf == NULL)
        return rx_error_at(
            err, RX_INPUT, tile->name, tile->hdu, 0,
            "has too few stars for a PSF of its own; give STAGE.PSF_TYPE and what belongs to it");
    if (tile->zeropoint == 0) /* the stage's default states nothing */
        tile->zeropoint = config->sim->mag_zeropoint;
    dst->width = tile->width;
    dst->height = tile->height;
    dst->fwhm = dst->field->psf->fwhm;
    dst->sigma = dst->field->plain->global_sigma;
    dst->psf = rx_psf_copy(dst->field->psf);
    dst->given = rx_psf_copy(dst->field->psf);
    return dst->psf != NULL && dst->given != NULL ? measure_psf(dst, err) : rx_error_memory(err, 0);
}

void rx_lab_sky_close(rx_lab_sky *sky)
{
    rx_simulation_free(sky->simulation);
    rx_field_free(sky->field);
    rx_psf_free(sky->psf);
    rx_psf_free(sky->given);
    rx_optics_free(sky->optics);
    free(sky->kernel);
    free(sky->allowed);
    free(sky->covered);
    free(sky->known.list);
    *sky = (rx_lab_sky){0};
}
