/* Views of a tile with what is known of it. */
#include "pipeline/field.h"

#include <stdlib.h>

rx_image rx_field_observed(const rx_field *field)
{
    rx_image image = rx_image_on_sky(&field->image, field->plain);
    image.psf = field->psf;
    return image;
}

rx_image rx_field_restorable(const rx_field *field)
{
    rx_image image = rx_image_on_sky(&field->image, field->restored);
    image.hide = RX_HIDE_RESTORED;
    image.psf = field->psf;
    return image;
}

rx_image rx_field_effective(const rx_field *field)
{
    rx_image image = rx_field_restorable(field);
    if (field->effective.maker.make != NULL) /* a factor that is 1 in single precision takes no room */
        image.noise = rx_map_made(&field->effective.maker, image.width);
    image.global_noise *= field->noise_factor;
    return image;
}

void rx_field_free(rx_field *field)
{
    if (field == NULL)
        return;
    if (field->restored != field->plain)
        rx_background_free(field->restored);
    rx_background_free(field->plain);
    rx_psf_free(field->psf);
    rx_tile_free(field->tile);
    rx_record_free(&field->inputs);
    free(field->mask);
    free(field);
}
