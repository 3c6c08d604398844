/* Conditions, and what the tiles of each share. */
#include "lab/lab.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/psf.h"
#include "io/tile.h"
#include "num/convolve.h"
#include "stage/listed_objects.h"
#include "stage/open.h"

double rx_lab_beyond(const rx_lab_sky *sky, double x, double y)
{
    return hypot(fmax(fmax(-x, x - (sky->width - 1)), 0), fmax(fmax(-y, y - (sky->height - 1)), 0));
}

/* At the centre of the tile; and a Gaussian as wide as the PSF. */
static rx_status measure_psf(rx_lab_sky *sky, rx_error *err)
{
    const size_t n = (size_t)sky->psf->size * (size_t)sky->psf->size;
    const int radius = rx_gauss_radius(sky->fwhm), side = 2 * radius + 1;
    float *stamp = NULL, *line = NULL;
    rx_status status;
    sky->side = side;
    RX_TRY_EXIT(RX_MAKE(stamp, n, err));
    RX_TRY_EXIT(RX_MAKE(line, (size_t)side, err));
    RX_TRY_EXIT(RX_MAKE(sky->kernel, (size_t)side * (size_t)side, err));
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

/* --- conditions --- */

static double psf_error_of(const rx_condition *c)
{
    return c->of == RX_GIVEN_PSF ? c->error : 0;
}

static rx_status make_psf(const rx_condition *c, const rx_simulate_config *sim,
                          const rx_simulation *simulation, rx_psf **dst, rx_error *err)
{
    rx_optics *given = NULL;
    if (psf_error_of(c) == 0.0)
        return rx_optics_on_pixels(simulation->optics, dst, err);
    rx_status status = rx_optics_moffat(
        &(rx_moffat_profile){(c->fwhm > 0 ? c->fwhm : sim->psf_fwhm) * (1 + psf_error_of(c)), sim->psf_beta,
                             sim->psf_ratio, sim->psf_angle * M_PI / 180.0, sim->psf_variation},
        simulation->scene.width, simulation->scene.height, &given, err);
    if (status == RX_OK)
        status = rx_optics_on_pixels(given, dst, err);
    rx_optics_free(given);
    return status;
}

static void spoil(rx_background *sky, double level, double noise)
{
    const size_t n = (size_t)sky->width * (size_t)sky->height;
    const double more = 1 + noise;
    sky->level_error += level * (1 + sky->sigma_error);
    if (sky->sigma == NULL) {
        sky->sigma_error = (1 + sky->sigma_error) * more - 1;
    } else {
        sky->level_error /= more;
        for (size_t i = 0; i < n; i++)
            sky->sigma[i] = (float)((double)sky->sigma[i] * more);
    }
    sky->global_level -= level * sky->global_sigma;
    sky->global_sigma *= more;
}

void rx_condition_apply(const rx_condition *c, rx_field *field)
{
    const double level = c->of == RX_GIVEN_SKY ? c->error : 0, noise = c->of == RX_GIVEN_NOISE ? c->error : 0;
    if (level == 0.0 && noise == 0.0)
        return;
    spoil(field->plain, level, noise);
    if (field->restored != field->plain)
        spoil(field->restored, level, noise);
}

/* --- skies --- */

/* A further one. */
static rx_status add_sky(rx_lab *lab, rx_lab_sky **dst, rx_error *err)
{
    RX_TRY(RX_GROW(lab->sky, (size_t)lab->nskies + 1, err));
    *dst = &lab->sky[lab->nskies++];
    **dst = (rx_lab_sky){0};
    lab->nconditions = lab->nskies;
    return RX_OK;
}

rx_status rx_lab_sky_add(rx_lab *lab, const char *keyword, double value, rx_log *log, rx_lab_sky **sky,
                         rx_error *err)
{
    const rx_simulate_config *sim = lab->config->sim;
    rx_simulate_config *own = NULL;
    char text[40];
    rx_status status;
    RX_TRY(add_sky(lab, sky, err));
    rx_lab_sky *dst = *sky;
    snprintf(text, sizeof text, "%.17g", value);
    RX_TRY_EXIT(rx_simulate_config_copy(sim, &own, err));
    if (keyword != NULL)
        RX_TRY_EXIT(rx_settings_set(&own->settings, keyword, text, log, err));
    RX_TRY_EXIT(rx_simulation_from_config(own, log, &dst->simulation, err));
    if (sim->catalog_name[0] != '\0')
        RX_TRY_EXIT(rx_listed_objects(sim->catalog_name, NULL, dst->simulation, err));
    dst->simulation->nthreads = 1;
    dst->width = dst->simulation->scene.width;
    dst->height = dst->simulation->scene.height;
    dst->fwhm = dst->simulation->optics->fwhm;
    const rx_noise_params *noise = &dst->simulation->noise;
    if (noise->type == RX_NOISE_GAUSS)
        dst->sigma = noise->sigma;
    else if (noise->type == RX_NOISE_CCD)
        dst->sigma = sqrt(noise->sky * noise->gain + noise->read_noise * noise->read_noise) / noise->gain;
exit:
    rx_simulate_config_free(own);
    return status;
}

/* One of that condition, by name "FWHM 4, sky +0.3 sigma". */
static rx_status simulate(rx_lab *lab, rx_condition condition, int find, rx_log *log, rx_error *err)
{
    const rx_simulate_config *sim = lab->config->sim;
    static const char *const formats[] = {"PSF %+g %%", "sky %+g sigma", "noise %+g %%"};
    const char *width = condition.fwhm > 0 ? "PSF_FWHM" : NULL;
    rx_lab_sky *dst;
    if (find && psf_error_of(&condition) != 0.0)
        return rx_error_set(
            err, RX_USAGE,
            "PSF_ERROR says what PSF restorers are given, STAGE.PSF_TYPE that they find it; leave out one of "
            "them");
    if ((width != NULL || psf_error_of(&condition) != 0.0) && strcmp(sim->psf_type, "MOFFAT") != 0)
        return rx_error_set(err, RX_USAGE,
                            "SIM.PSF_TYPE %s has no FWHM that SEEING or PSF_ERROR could change; give MOFFAT",
                            sim->psf_type);
    RX_TRY(rx_lab_sky_add(lab, width, condition.fwhm, log, &dst, err));
    dst->condition = condition;
    const double fwhm = width != NULL || !lab->kind->by_width ? condition.fwhm : dst->fwhm;
    int used = 0;
    if (fwhm > 0)
        used = snprintf(dst->name, sizeof dst->name, "FWHM %g%s", fwhm, condition.error != 0.0 ? ", " : "");
    else if (condition.error == 0.0)
        snprintf(dst->name, sizeof dst->name, "simulated");
    if (condition.error != 0.0)
        snprintf(dst->name + used, sizeof dst->name - (size_t)used, formats[condition.of],
                 (condition.of == RX_GIVEN_SKY ? 1 : 100) * condition.error);
    RX_TRY(rx_optics_on_pixels(dst->simulation->optics, &dst->psf, err));
    RX_TRY(measure_psf(dst, err));
    return find ? RX_OK : make_psf(&condition, sim, dst->simulation, &dst->given, err);
}

rx_status rx_lab_skies_simulate(rx_lab *lab, int find, rx_log *log, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    const rx_reals *const errors[] = {&config->psf_error, &config->sky_error, &config->noise_error};
    for (int f = 0; f == 0 || f < config->seeing.n; f++) {
        rx_condition condition = {.fwhm = config->seeing.n > 0 ? config->seeing.v[f] : 0.0};
        RX_TRY(simulate(lab, condition, find, log, err));
        for (int of = 0; of < 3; of++)
            for (int i = 0; i < errors[of]->n; i++) {
                condition.of = (rx_given)of;
                condition.error = errors[of]->v[i];
                if (condition.error != 0.0)
                    RX_TRY(simulate(lab, condition, find, log, err));
            }
    }
    return RX_OK;
}

rx_status rx_lab_sky_read(rx_lab *lab, rx_log *log, rx_lab_sky **sky, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    int *hdus = NULL, n = 0;
    RX_TRY(add_sky(lab, sky, err));
    rx_lab_sky *dst = *sky;
    rx_status status = rx_tile_list(config->tile_name, log, &hdus, &n, err);
    if (status == RX_OK)
        status = rx_field_open(lab->options, RX_FIELD_PSF, &(rx_image_place){config->tile_name, hdus[0], 1},
                               log, &dst->field, err);
    free(hdus);
    RX_TRY(status);
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
