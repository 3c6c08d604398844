/* Which pixels of a tile are left out. */
#include "pipeline/field_mask.h"

#include <math.h>

#include "data/unit.h"
#include "detect/hollow.h"
#include "detect/no_data.h"
#include "detect/saturation.h"

uint8_t *rx_field_mask(const rx_field *field)
{
    return field->mask != NULL ? field->mask : field->tile != NULL ? field->tile->mask : NULL;
}

bool rx_field_has_pixels(const rx_field *field)
{
    const uint8_t *mask = rx_field_mask(field);
    const size_t n = (size_t)field->image.width * (size_t)field->image.height;
    for (size_t i = 0; i < n; i++)
        if (mask == NULL || (mask[i] & RX_HIDE_PLAIN) == 0)
            return true;
    return false;
}

/* With SExtractor's sky (BACK_PASSES 1) a constant at its level is sky, as there. */
rx_status rx_field_hide_no_data(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
                                rx_error *err)
{
    const rx_image *image = &field->image;
    uint8_t *mask = rx_field_mask(field);
    if (mask == NULL)
        return RX_OK;
    RX_TRY(rx_no_data_hide(image, params->background[role].passes == 1, params->nthreads, mask,
                           &field->no_data, err));
    if (field->no_data > 0)
        rx_log_warning(log,
                       "%s[%d]: %.1f %% of its pixels, in runs of one value, hold no data (RXNODATA): they "
                       "are left out, as by a weight map",
                       image->name, image->hdu,
                       100.0 * (double)field->no_data / ((double)image->width * (double)image->height));
    return RX_OK;
}

/* Where no card and no keyword states a level, the pixels show from where on values are saturated. */
rx_status rx_field_find_saturation(rx_field *field, rx_log *log, rx_error *err)
{
    rx_image *image = &field->image;
    uint8_t *mask = rx_field_mask(field);
    size_t n = 0;
    if (mask == NULL || isfinite(image->saturation))
        return RX_OK;
    RX_TRY(rx_saturation_find(image, mask, &image->saturation, err));
    if (!isfinite(image->saturation))
        return RX_OK;
    for (size_t k = 0; k < (size_t)image->width * (size_t)image->height; k++)
        if (mask[k] == 0 && (double)image->pixels[k] >= image->saturation) {
            mask[k] = RX_MASK_SATURATED;
            n++;
        }
    if (field->tile != NULL)
        field->tile->saturation = image->saturation;
    rx_log_warning(
        log,
        "%s[%d]: no SATUR_LEVEL is stated, and from %.6g ADU on (RXSATUR) its pixels pile up or its cores "
        "are "
        "hollow: %zu pixels are taken as saturated (FLAGS 4); give SATUR_LEVEL if another is right",
        image->name, image->hdu, image->saturation, n);
    return RX_OK;
}

/* Cores that were left at 0 or another low value are below any level. */
rx_status rx_field_hide_hollow(rx_field *field, rx_log *log, rx_error *err)
{
    const rx_image observed = rx_field_observed(field);
    uint8_t *mask = rx_field_mask(field);
    size_t n = 0;
    if (mask == NULL)
        return RX_OK;
    RX_TRY(rx_hollow_hide(&observed, mask, &n, err));
    if (n > 0)
        rx_log_warning(
            log,
            "%s[%d]: %zu pixels, low ones with bright ones all around that fall outwards, are taken as "
            "saturated cores without a value (FLAGS 4), and left out",
            observed.name, observed.hdu, n);
    return RX_OK;
}

/* A pixel that lacks more light than 90,000 electrons are is dead: no dark cloud takes so much off a sky that is in the mesh. */
void rx_field_hide_deep(rx_field *field, rx_log *log)
{
    static const double deep = 300.0,
                        at_least = 30.0; /* sigmas of the pixel, and of the tile: few are looked at */
    const rx_image *image = &field->image;
    uint8_t *mask = rx_field_mask(field);
    const rx_map level = rx_background_level(field->plain), noise = rx_background_noise(field->plain);
    const double limit = field->plain->global_level - at_least * field->plain->global_sigma;
    for (int y = 0; mask != NULL && y < image->height; y++)
        for (int x = 0; x < image->width; x++) {
            const size_t k = (size_t)y * (size_t)image->width + (size_t)x;
            if ((double)image->pixels[k] < limit && (mask[k] & RX_HIDE_RESTORED) == 0 &&
                image->pixels[k] < rx_map_at(&level, x, y) - (float)deep * rx_map_at(&noise, x, y)) {
                mask[k] |= RX_MASK_DEEP;
                field->deep++;
            }
        }
    if (field->deep > 0)
        rx_log_warning(
            log,
            "%s[%d]: %zu pixels are more than %g sigma below the sky, as no light or cloud makes them "
            "(RXDEEP): restorers leave them out; where they are dead, mark them in a weight or flag map",
            image->name, image->hdu, field->deep, deep);
}

void rx_field_make_mask(const rx_image *image, uint8_t *dst)
{
    const float limit = rx_pixel_limit(image->pixels, image->width, image->height);
    const size_t n = (size_t)image->width * (size_t)image->height;
    const int weighted = image->weight_type == RX_WEIGHT_MAP_WEIGHT && image->weight != NULL;
    for (size_t i = 0; i < n; i++) {
        const float value = image->pixels[i];
        int bits = rx_image_hides(image, i) ? RX_MASK_BAD : 0;
        if (!rx_pixel_usable(value, limit))
            bits |= RX_MASK_BAD;
        else if (image->saturation > 0.0 && (double)value >= image->saturation)
            bits |= RX_MASK_SATURATED;
        if (weighted && !(image->weight[i] > 0.0f))
            bits |= RX_MASK_WEIGHT;
        dst[i] = (uint8_t)bits;
    }
}
