/* One simulated field in memory, and as a tile. */
#include "stage/simulation.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "io/fits_write.h"
#include "io/tile.h"
#include "io/wcs.h"
#include "simulate/render.h"
#include "stage/simulation_parts.h"

/* SATURATE of a detector that never saturates: beyond all pixels, and a number that every reader takes. */
static const double NEVER = 1e30;

/* Scenes are numbered from 0; what is drawn per pixel comes from streams that no scene has. */
uint64_t rx_simulation_pixel_stream(uint64_t stream)
{
    return stream | UINT64_C(1) << 62;
}

rx_scene_params rx_simulation_scene(const rx_simulation *simulation, uint64_t stream)
{
    rx_scene_params par = simulation->scene;
    par.stream = stream;
    par.allowed = simulation->allowed;
    return par;
}

rx_status rx_simulation_render(const rx_simulation *simulation, const rx_scene *scene, int n,
                               float *const *images, rx_error *err)
{
    const rx_optics *optics[2] = {simulation->optics, simulation->target};
    return rx_render(scene, n, optics, images, simulation->nthreads, err);
}

rx_status rx_simulation_make(const rx_simulation *simulation, uint64_t stream, rx_simulated *dst,
                             rx_error *err)
{
    const int width = simulation->scene.width, height = simulation->scene.height;
    const size_t n = (size_t)width * (size_t)height;
    *dst = (rx_simulated){.width = width, .height = height};
    if (simulation->optics == NULL)
        return rx_error_set(err, RX_USAGE, "INJECT_IMAGE names a real tile; it is no simulated field");
    const rx_scene_params scene = rx_simulation_scene(simulation, stream);
    rx_status status = rx_scene_make(&scene, simulation->templates, &dst->scene, err);
    if (status != RX_OK)
        goto exit;
    dst->image = RX_NEW(float, n);
    dst->clean = RX_NEW(float, n);
    dst->defects = RX_NEW(uint8_t, n);
    if (!simulation->without_sharp)
        dst->sharp = RX_NEW(float, n);
    if (dst->image == NULL || dst->clean == NULL || dst->defects == NULL ||
        (dst->sharp == NULL && !simulation->without_sharp)) {
        status = rx_error_memory(err, n * sizeof(float));
        goto exit;
    }
    float *const images[2] = {dst->clean, dst->sharp};
    status = rx_simulation_render(simulation, dst->scene, simulation->without_sharp ? 1 : 2, images, err);
    if (status != RX_OK)
        goto exit;
    memcpy(dst->image, dst->clean, n * sizeof(float));
    rx_noise_params noise = simulation->noise;
    noise.stream = rx_simulation_pixel_stream(stream);
    status = rx_noise_expose(&noise, width, height, dst->image, dst->defects, simulation->nthreads, err);
exit:
    if (status != RX_OK)
        rx_simulated_free(dst);
    return status;
}

void rx_simulated_free(rx_simulated *simulated)
{
    free(simulated->image);
    free(simulated->clean);
    free(simulated->sharp);
    free(simulated->defects);
    rx_scene_free(simulated->scene);
    *simulated = (rx_simulated){0};
}

/* --- as a tile --- */

/* Gnomonic projection, north up and east to the left. */
static void write_cards(const rx_simulation *simulation, rx_text *cards)
{
    const double step = simulation->scene.pixel_scale / 3600.0;
    const double saturation = simulation->noise.saturation;
    rx_card_text(cards, "CTYPE1", "RA---TAN", "");
    rx_card_text(cards, "CTYPE2", "DEC--TAN", "");
    rx_card_text(cards, "CUNIT1", "deg", "");
    rx_card_text(cards, "CUNIT2", "deg", "");
    rx_card_number(cards, "CRVAL1", simulation->alpha, "");
    rx_card_number(cards, "CRVAL2", simulation->delta, "");
    rx_card_number(cards, "CRPIX1", 0.5 * (simulation->scene.width + 1), "");
    rx_card_number(cards, "CRPIX2", 0.5 * (simulation->scene.height + 1), "");
    rx_card_number(cards, "CD1_1", -step, "");
    rx_card_number(cards, "CD1_2", 0.0, "");
    rx_card_number(cards, "CD2_1", 0.0, "");
    rx_card_number(cards, "CD2_2", step, "");
    rx_card_text(cards, "RADESYS", "ICRS", "");
    rx_card_number(cards, "EQUINOX", 2000.0, "");
    rx_card_text(cards, "BUNIT", "adu", "");
    rx_card_number(cards, "GAIN", simulation->noise.gain, "e-/ADU, 0 = infinite");
    rx_card_number(cards, "SATURATE", fmin(saturation, NEVER), "ADU; 1e30 = never");
    rx_card_number(cards, "EXPTIME", 1.0, "s");
    rx_card_number(cards, "MAGZERO", simulation->scene.zeropoint, "magnitude of 1 ADU");
}

static void take_pixels(const rx_simulated *simulated, rx_tile *tile)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    for (size_t i = 0; i < n; i++) {
        if (simulated->defects[i] & RX_DEFECT_COLUMN || !isfinite(simulated->image[i])) {
            tile->mask[i] = RX_MASK_BAD;
            continue;
        }
        tile->pixels[i] = simulated->image[i];
        if ((double)tile->pixels[i] >= tile->saturation)
            tile->mask[i] = RX_MASK_SATURATED;
    }
}

rx_status rx_simulation_tile(const rx_simulation *simulation, const rx_simulated *simulated, const char *name,
                             rx_tile **dst, rx_error *err)
{
    const size_t n = (size_t)simulated->width * (size_t)simulated->height;
    rx_text cards = {0};
    rx_status status = RX_OK;
    rx_tile *tile = RX_NEW(rx_tile, 1);
    if (tile == NULL)
        return rx_error_memory(err, sizeof *tile);
    *tile = (rx_tile){.extension = 1,
                      .width = simulated->width,
                      .height = simulated->height,
                      .gain = simulation->noise.gain,
                      .saturation = fmin(simulation->noise.saturation, NEVER),
                      .zeropoint = simulation->scene.zeropoint,
                      .exptime = 1.0};
    tile->name = rx_strdup(name);
    tile->extname = rx_strdup("");
    tile->pixels = RX_NEW(float, n);
    tile->mask = RX_NEW(uint8_t, n);
    write_cards(simulation, &cards);
    if (tile->name == NULL || tile->extname == NULL || tile->pixels == NULL || tile->mask == NULL ||
        cards.failed) {
        status = rx_error_memory(err, n * sizeof(float));
        goto exit;
    }
    take_pixels(simulated, tile);
    tile->ncards = cards.length / 80;
    tile->cards = cards.data;
    cards = (rx_text){0};
    status =
        rx_wcs_from_cards(tile->cards, tile->ncards, tile->width, tile->height, &tile->wcs, NULL, 0, err);
    if (status == RX_OK && tile->wcs != NULL)
        tile->pixel_scale = rx_wcs_pixel_scale(tile->wcs, 0.5 * (tile->width - 1), 0.5 * (tile->height - 1));
exit:
    rx_text_free(&cards);
    if (status == RX_OK)
        *dst = tile;
    else
        rx_tile_free(tile);
    return status;
}
