// The same from C++, with progress, and an end after a minute.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

#include "stage/pipeline.h"

using Clock = std::chrono::steady_clock;

static bool late(void *end)
{
    return Clock::now() > *static_cast<Clock::time_point *>(end);
}

static void show(void *, const char *what, double done)
{
    std::fprintf(stderr, "%3.0f %% %s\n", 100 * done, what);
}

struct Result : rx_result {
    Result() : rx_result{} {}
    Result(const Result &) = delete;
    ~Result() { rx_result_free(this); }
};

int main()
{
    const int side = 256;
    std::vector<float> pixels(side * side);
    unsigned int noise = 1;
    for (int i = 0; i < side * side; i++) {
        const int x = i % side, y = i / side, dx = x % 64 - 32, dy = y % 64 - 32;
        noise = noise * 1664525u + 1013904223u;
        pixels[i] = 90 + 20 * static_cast<float>(noise) / 4294967296.0f;
        if (x < 192 && y < 192)
            pixels[i] += 360.3f * static_cast<float>(1 + x / 64 + y / 64 * 3) * std::exp(-0.2263f * static_cast<float>(dx * dx + dy * dy));
    }
    auto end = Clock::now() + std::chrono::minutes(1);
    rx_error err = RX_ERROR_NONE;
    err.stop = late;
    err.user = &end;
    rx_log log;
    rx_log_calls(&log, RX_QUIET, nullptr, show, nullptr);
    rx_image image{};
    image.width = image.height = side;
    image.pixels = pixels.data();
    rx_pipeline_params params;
    Result result;
    rx_status status = rx_pipeline_defaults(&params, &err);
    if (status == RX_OK)
        status = rx_pipeline_set(&params, "DETECT_THRESH", "3", &err);
    params.restorer = rx_restorer_find("RL");
    if (status == RX_OK)
        status = rx_pipeline_run(&params, &image, &log, &result, &err);
    for (int i = 0; status == RX_OK && i < result.sources->n; i++) {
        const rx_source &source = result.sources->list[i];
        std::printf("%.1f %.1f %.0f\n", source.x, source.y, source.flux_auto);
    }
    if (status != RX_OK)
        std::fprintf(stderr, "find: %s\n", err.text);
    return status;
}
