/* Maps that are read by rows. */
#include "data/map.h"

rx_map rx_map_plane(const float *plane, int width)
{
    return (rx_map){.width = width, .plane = plane};
}

rx_map rx_background_level(const rx_background *sky)
{
    return rx_map_plane(sky->level, sky->width);
}

rx_map rx_background_noise(const rx_background *sky)
{
    return rx_map_plane(sky->sigma, sky->width);
}

const float *rx_map_row(const rx_map *map, int y, int x, int n, float *room)
{
    (void)n;
    (void)room;
    return map->plane + (size_t)y * (size_t)map->width + (size_t)x;
}

float rx_map_at(const rx_map *map, int x, int y)
{
    float value;
    return *rx_map_row(map, y, x, 1, &value);
}
