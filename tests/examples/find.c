/* Nine stars in an array: restored, detected and measured. Prints x, y (from 0) and flux. */
#include <math.h>
#include <stdio.h>

#include "stage/pipeline.h"

enum { SIDE = 256 };

int main(void)
{
    static float pixels[SIDE * SIDE];
    unsigned int noise = 1;
    for (int i = 0; i < SIDE * SIDE; i++) { /* sky 100, noise 5.8, stars of 5000 to 45000 counts */
        const int x = i % SIDE, y = i / SIDE, dx = x % 64 - 32, dy = y % 64 - 32;
        noise = noise * 1664525u + 1013904223u;
        pixels[i] = 90.0f + 20.0f * (float)noise / 4294967296.0f;
        if (x < 192 && y < 192)
            pixels[i] +=
                360.3f * (float)(1 + x / 64 + y / 64 * 3) * expf(-0.2263f * (float)(dx * dx + dy * dy));
    }
    rx_error err = RX_ERROR_NONE;
    rx_pipeline_params params;
    rx_result result = {0};
    const rx_image image = {.width = SIDE, .height = SIDE, .pixels = pixels};
    rx_status status = rx_pipeline_defaults(&params, &err);
    if (status == RX_OK)
        status = rx_pipeline_set(&params, "DETECT_THRESH", "3", &err);
    params.restorer = rx_restorer_find("RL");
    if (status == RX_OK)
        status = rx_pipeline_run(&params, &image, NULL, &result, &err);
    for (int i = 0; status == RX_OK && i < result.sources->n; i++) {
        const rx_source *source = &result.sources->list[i];
        printf("%.1f %.1f %.0f\n", source->x, source->y, source->flux_auto);
    }
    if (status != RX_OK)
        fprintf(stderr, "find: %s\n", err.text);
    rx_result_free(&result);
    return (int)status;
}
