/* What this machine can do at most, measured here and now: the yardstick of validation/bench/run.sh.
 *
 *   limits [-values] all [FILE]               everything below but rl, on one and on all threads
 *   limits [-values] conv F32|BF16 THREADS [CHANNELS SIDE]
 *                                             3 x 3 convolutions; without CHANNELS the best of a sweep
 *   limits [-values] fft SIDE THREADS         a real transform of SIDE x SIDE pixels
 *   limits [-values] rl WIDTH HEIGHT FWHM THREADS
 *                                             of a tile padded for a PSF; RL's blur and its adjoint
 *   limits [-values] memory THREADS           copy and triad over planes much larger than the cache
 *   limits [-values] read FILE                a file that has been read before
 *
 * -values writes "key value" instead of text. Each number is the best of several tries: a limit is what was
 * possible at least once. Threads work side by side, each with its own convolution and planes.
 *
 * Units: GFLOP are 1e9 additions and multiplications, 2 x 9 x channels^2 a pixel and convolution (padding
 * counts) and 2.5 N log2 N a real transform of N pixels (of radix 2; the count by which FFTW's authors
 * compare). GB are 1e9 bytes, 2 planes a copy a[i] = b[i], 3 a triad a[i] = b[i] + s c[i] (McCalpin's
 * STREAM).
 */
#include <fcntl.h>
#include <math.h>
#include <omp.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"
#include "nn/direct.h"
#include "num/fft.h"
#include "psf/psf.h"
#include "restore/blur.h"

enum { CONV_TRIES = 6, MOST_THREADS = 64, MEMORY_TRIES = 6, READ_BUFFER = 1 << 20 };
static const double CONV_TRY = 0.004, FFT_TIME = 0.25;               /* seconds: of one try, of all */
static const long CONV_LARGEST = 4L << 20, MEMORY_PLANE = 32L << 20; /* numbers in a plane */

static const char *const REAL_NAME[] = {"F32", "BF16"}, *const REAL_KEY[] = {"f32", "bf16"};

/* One number: "key value", or a line of text. */
static void tell(bool values, const char *key, double value, const char *text)
{
    if (values)
        printf("%s %.6g\n", key, value);
    else if (text != NULL)
        printf("%s\n", text);
    fflush(stdout);
}

/* --- convolutions --- */

typedef struct worker {
    rx_direct *direct;
    rx_plane x, y;
    rx_direct_area area;
    float *scratch;
    rx_status status;
    rx_error error;
} worker;

static void fill(void *plane, size_t n, rx_real real)
{
    float *f = plane;
    uint16_t *b = plane;
    for (size_t i = 0; i < n; i++) {
        if (real == RX_REAL_F32)
            f[i] = 0.5f;
        else
            b[i] = 0x3f00; /* 0.5 as bfloat16 */
    }
}

static rx_status open_worker(worker *w, rx_real real, int channels, int side)
{
    const size_t weights = (size_t)channels * (size_t)channels * 9;
    const rx_conv_shape shape = {.height = side + 2,
                                 .width = side + 2,
                                 .in = channels,
                                 .out = channels,
                                 .kernel = 3,
                                 .stride = 1,
                                 .before = 1,
                                 .after = 1,
                                 .x = real,
                                 .y = real,
                                 .relu = 1};
    float *weight = RX_NEW(float, weights), *bias = RX_NEW(float, (size_t)channels);
    w->error = RX_ERROR_NONE;
    w->area = (rx_direct_area){1, side + 1, 0, side};
    w->x = w->y = (rx_plane){.real = real, .height = side + 2, .width = side + 2, .channels = channels};
    w->x.data = rx_alloc(rx_plane_size(&w->x), rx_real_bytes(real));
    w->y.data = rx_alloc(rx_plane_size(&w->y), rx_real_bytes(real));
    w->scratch = RX_NEW(float, rx_direct_scratch());
    rx_status status =
        weight != NULL && bias != NULL && w->x.data != NULL && w->y.data != NULL && w->scratch != NULL
            ? RX_OK
            : rx_error_memory(&w->error, 2 * rx_plane_bytes(&w->x));
    if (status == RX_OK) {
        for (size_t i = 0; i < weights; i++)
            weight[i] = 0.01f;
        fill(w->x.data, rx_plane_size(&w->x), real);
        status = rx_direct_new(&shape, (rx_direct_options){0}, weight, bias, &w->direct, &w->error);
    }
    if (status == RX_OK)
        rx_direct_run(w->direct, &w->x, NULL, &w->y, w->area, w->scratch);
    free(weight);
    free(bias);
    return status;
}

static void close_worker(worker *w)
{
    rx_direct_free(w->direct);
    free(w->x.data);
    free(w->y.data);
    free(w->scratch);
}

/* Seconds that `runs` convolutions take on each of so many threads. */
static double time_workers(worker *workers, int nthreads, int runs)
{
    double begun = 0;
#pragma omp parallel num_threads(nthreads)
    {
        worker *w = &workers[omp_get_thread_num()];
#pragma omp barrier
#pragma omp single
        begun = rx_seconds();
        for (int i = 0; i < runs && w->status == RX_OK; i++)
            rx_direct_run(w->direct, &w->x, NULL, &w->y, w->area, w->scratch);
    }
    return rx_seconds() - begun;
}

/* *rate: GFLOP/s of all threads together. */
static rx_status measure_conv(rx_real real, int nthreads, int channels, int side, double *rate, rx_error *err)
{
    worker workers[MOST_THREADS] = {0};
    rx_status status = RX_OK;
    double least = INFINITY;
    *rate = 0;
#pragma omp parallel num_threads(nthreads)
    workers[omp_get_thread_num()].status = open_worker(&workers[omp_get_thread_num()], real, channels, side);
    for (int t = 0; t < nthreads && status == RX_OK; t++)
        status = workers[t].status;
    if (status == RX_OK) {
        const double once = time_workers(workers, nthreads, 1);
        const int runs = once < CONV_TRY ? (int)(CONV_TRY / fmax(once, 1e-6)) + 1 : 1;
        for (int i = 0; i < CONV_TRIES; i++)
            least = fmin(least, time_workers(workers, nthreads, runs) / runs);
        *rate = 1e-9 * 18 * nthreads * (double)channels * channels * side * side / least;
    }
    for (int t = 0; t < nthreads; t++) {
        if (workers[t].status != RX_OK) {
            status = workers[t].status;
            *err = workers[t].error;
        }
        close_worker(&workers[t]);
    }
    return status;
}

/* channels 0: the best of a sweep. */
static rx_status tell_conv(bool values, rx_real real, int nthreads, int channels, int side, rx_error *err)
{
    char key[64], text[128];
    double best = 0, rate = 0;
    int best_channels = channels, best_side = side;
    rx_status status = RX_OK;
    if (channels > 0)
        status = measure_conv(real, nthreads, channels, side, &best, err);
    for (int c = 16; channels == 0 && c <= 256; c *= 2)
        for (int s = 32; s <= 256 && (long)s * s * c <= CONV_LARGEST && status == RX_OK; s *= 2) {
            status = measure_conv(real, nthreads, c, s, &rate, err);
            if (rate > best) {
                best = rate;
                best_channels = c;
                best_side = s;
            }
        }
    if (status != RX_OK)
        return status;
    snprintf(text, sizeof text,
             "3 x 3 convolutions, %s, %d thread%s: %.1f GFLOP/s (%d channels, %d x %d pixels)",
             REAL_NAME[real], nthreads, nthreads > 1 ? "s" : "", best, best_channels, best_side, best_side);
    snprintf(key, sizeof key, "conv_%s_%d", REAL_KEY[real], nthreads);
    tell(values, key, best, text);
    snprintf(key, sizeof key, "conv_%s_%d_channels", REAL_KEY[real], nthreads);
    tell(values, key, best_channels, NULL);
    snprintf(key, sizeof key, "conv_%s_%d_side", REAL_KEY[real], nthreads);
    tell(values, key, best_side, NULL);
    return RX_OK;
}

/* --- transforms --- */

/* *seconds of a transform: the mean of forward and inverse. */
static rx_status measure_fft(const rx_fft *fft, double *seconds, rx_error *err)
{
    float *from = rx_fft_real(fft), *half = rx_fft_complex(fft), *to = rx_fft_real(fft);
    double least = INFINITY;
    rx_status status = RX_OK;
    if (from == NULL || half == NULL || to == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    from[0] = 1;
    const double begun = rx_seconds();
    for (int i = 0; i < 3 || rx_seconds() - begun < FFT_TIME; i++) {
        const double start = rx_seconds();
        rx_fft_forward(fft, from, half);
        rx_fft_inverse(fft, half, to);
        least = fmin(least, rx_seconds() - start);
    }
    *seconds = least / 2;
exit:
    free(from);
    free(half);
    free(to);
    return status;
}

static rx_status tell_fft(bool values, const char *name, const rx_fft *fft, rx_error *err)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft), nthreads = rx_fft_threads(fft);
    const double area = (double)w * h;
    char key[64], text[128];
    double seconds = 0;
    rx_status status = measure_fft(fft, &seconds, err);
    if (status != RX_OK)
        return status;
    const double rate = 2.5e-9 * area * log2(area) / seconds;
    snprintf(text, sizeof text, "real transform of %d x %d pixels, %d thread%s: %.3f ms, %.1f GFLOP/s", w, h,
             nthreads, nthreads > 1 ? "s" : "", 1e3 * seconds, rate);
    snprintf(key, sizeof key, "%s_%d_ms", name, nthreads);
    tell(values, key, 1e3 * seconds, text);
    snprintf(key, sizeof key, "%s_%d_gflops", name, nthreads);
    tell(values, key, rate, NULL);
    return RX_OK;
}

static rx_status tell_square(bool values, int side, int nthreads, rx_error *err)
{
    char name[32];
    rx_fft *fft = NULL;
    snprintf(name, sizeof name, "fft_%d", side);
    rx_status status = rx_fft_new(side, side, nthreads, &fft, err);
    if (status == RX_OK)
        status = tell_fft(values, name, fft, err);
    rx_fft_free(fft);
    return status;
}

/* *seconds of a blur and its adjoint as the restorer has them. */
static rx_status measure_blur(const rx_blur *blur, double *seconds, rx_error *err)
{
    const size_t pixels = (size_t)blur->width * (size_t)blur->height;
    float *sky = rx_blur_sky(blur), *tile = RX_NEW(float, pixels);
    double least = INFINITY;
    rx_status status = RX_OK;
    if (sky == NULL || tile == NULL) {
        status = rx_error_memory(err, pixels * sizeof *tile);
        goto exit;
    }
    for (size_t i = 0, n = rx_blur_sky_size(blur); i < n; i++)
        sky[i] = 1;
    const double begun = rx_seconds();
    for (int i = 0; i < 3 || rx_seconds() - begun < FFT_TIME; i++) {
        const double start = rx_seconds();
        rx_blur_plane(blur, sky, tile);
        rx_blur_adjoint_plane(blur, tile, sky);
        least = fmin(least, rx_seconds() - start);
    }
    *seconds = least;
exit:
    free(sky);
    free(tile);
    return status;
}

/* A transform of the whole tile, padded by the PSF's radius, and what an iteration really does: blur and
 * adjoint in blocks. */
static rx_status tell_rl(bool values, int width, int height, double fwhm, int nthreads, rx_error *err)
{
    char name[64], key[96], text[128];
    rx_psf *psf = NULL;
    rx_blur *blur = NULL;
    rx_fft *fft = NULL;
    double seconds = 0;
    snprintf(name, sizeof name, "rl_%dx%d", width, height);
    rx_status status = rx_psf_moffat(fwhm, 4.765, 1, 0, 0, &psf, err);
    if (status == RX_OK)
        status = rx_blur_new(psf, width, height, nthreads, &blur, err);
    if (status == RX_OK)
        status = rx_fft_new(rx_fft_good_size(width + 2 * blur->margin),
                            rx_fft_good_size(height + 2 * blur->margin), nthreads, &fft, err);
    if (status == RX_OK)
        status = tell_fft(values, name, fft, err);
    if (status == RX_OK)
        status = measure_blur(blur, &seconds, err);
    if (status == RX_OK) {
        snprintf(key, sizeof key, "%s_%d_blur_ms", name, nthreads);
        snprintf(text, sizeof text, "RL's blur and adjoint of such a tile, %d thread%s: %.3f ms", nthreads,
                 nthreads > 1 ? "s" : "", 1e3 * seconds);
        tell(values, key, 1e3 * seconds, text);
    }
    rx_fft_free(fft);
    rx_blur_free(blur);
    rx_psf_free(psf);
    return status;
}

/* --- memory and files --- */

static rx_status tell_memory(bool values, int nthreads, rx_error *err)
{
    float *a = malloc((size_t)MEMORY_PLANE * sizeof *a), *b = malloc((size_t)MEMORY_PLANE * sizeof *b),
          *c = malloc((size_t)MEMORY_PLANE * sizeof *c);
    double copy = INFINITY, triad = INFINITY;
    char key[64], text[128];
    rx_status status = RX_OK;
    if (a == NULL || b == NULL || c == NULL) {
        status = rx_error_memory(err, 3 * (size_t)MEMORY_PLANE * sizeof *a);
        goto exit;
    }
#pragma omp parallel for num_threads(nthreads) schedule(static)
    for (long i = 0; i < MEMORY_PLANE; i++)
        a[i] = b[i] = c[i] = 1;
    for (int n = 0; n < MEMORY_TRIES; n++) {
        const double begun = rx_seconds();
#pragma omp parallel for simd num_threads(nthreads) schedule(static)
        for (long i = 0; i < MEMORY_PLANE; i++)
            a[i] = b[i];
        const double between = rx_seconds();
#pragma omp parallel for simd num_threads(nthreads) schedule(static)
        for (long i = 0; i < MEMORY_PLANE; i++)
            a[i] = b[i] + 0.5f * c[i];
        copy = fmin(copy, between - begun);
        triad = fmin(triad, rx_seconds() - between);
    }
    const double plane = 1e-9 * (double)MEMORY_PLANE * sizeof *a;
    snprintf(text, sizeof text, "memory, %d thread%s: copy %.1f GB/s, triad %.1f GB/s", nthreads,
             nthreads > 1 ? "s" : "", 2 * plane / copy, 3 * plane / triad);
    snprintf(key, sizeof key, "memory_copy_%d", nthreads);
    tell(values, key, 2 * plane / copy, text);
    snprintf(key, sizeof key, "memory_triad_%d", nthreads);
    tell(values, key, 3 * plane / triad, NULL);
exit:
    free(a);
    free(b);
    free(c);
    return status;
}

/* Bytes of the file, -1 when it cannot be read. */
static double read_once(const char *file, char *buffer)
{
    const int descriptor = open(file, O_RDONLY);
    double bytes = 0;
    ssize_t got = -1;
    if (descriptor < 0)
        return -1;
    while ((got = read(descriptor, buffer, READ_BUFFER)) > 0)
        bytes += (double)got;
    close(descriptor);
    return got < 0 ? -1 : bytes;
}

static rx_status tell_read(bool values, const char *file, rx_error *err)
{
    char *buffer = malloc(READ_BUFFER), text[128];
    double bytes = 0, least = INFINITY;
    if (buffer == NULL)
        return rx_error_memory(err, READ_BUFFER);
    for (int i = 0; i < 3 && bytes >= 0; i++) {
        const double begun = rx_seconds();
        bytes = read_once(file, buffer);
        least = fmin(least, rx_seconds() - begun);
    }
    free(buffer);
    if (bytes < 0)
        return rx_error_at(err, RX_INPUT, file, -1, 0, "cannot be read; give a tile that is there");
    snprintf(text, sizeof text, "reading a file of %.0f MB that is in memory: %.2f GB/s", 1e-6 * bytes,
             1e-9 * bytes / least);
    tell(values, "read", 1e-9 * bytes / least, text);
    return RX_OK;
}

/* --- the whole --- */

static rx_status tell_all(bool values, const char *file, rx_error *err)
{
    static const int SIDES[] = {1024, 1152, 4096};
    const int most = omp_get_max_threads() < MOST_THREADS ? omp_get_max_threads() : MOST_THREADS;
    rx_status status = RX_OK;
    for (int turn = 0; turn < (most > 1 ? 2 : 1) && status == RX_OK; turn++) {
        const int nthreads = turn == 0 ? 1 : most;
        for (int real = RX_REAL_F32; real <= RX_REAL_BF16 && status == RX_OK; real++)
            if (real == RX_REAL_F32 || rx_direct_has_bf16())
                status = tell_conv(values, (rx_real)real, nthreads, 0, 0, err);
        for (size_t i = 0; i < sizeof SIDES / sizeof *SIDES && status == RX_OK; i++)
            status = tell_square(values, SIDES[i], nthreads, err);
        if (status == RX_OK)
            status = tell_memory(values, nthreads, err);
    }
    if (status == RX_OK && file != NULL)
        status = tell_read(values, file, err);
    return status;
}

/* A whole number of at least `least`, -1 for anything else. */
static int count_of(const char *text, int least, int most)
{
    char *end = NULL;
    const long n = strtol(text, &end, 10);
    return *text != '\0' && *end == '\0' && n >= least && n <= most ? (int)n : -1;
}

static rx_status obey_conv(bool values, int n, char **word, rx_error *err)
{
    const bool is_bf16 = strcmp(word[1], "BF16") == 0;
    const int nthreads = count_of(word[2], 1, MOST_THREADS),
              channels = n == 5 ? count_of(word[3], 1, 1024) : 0,
              side = n == 5 ? count_of(word[4], 4, 4096) : 0;
    if ((!is_bf16 && strcmp(word[1], "F32") != 0) || nthreads < 0 || channels < 0 || side < 0)
        return rx_error_set(err, RX_USAGE, "conv: give F32 or BF16, threads, and no or two numbers more");
    if (is_bf16 && !rx_direct_has_bf16())
        return rx_error_set(err, RX_SYSTEM, "this processor has no bfloat16");
    return tell_conv(values, is_bf16 ? RX_REAL_BF16 : RX_REAL_F32, nthreads, channels, side, err);
}

/* word[0 .. n-1]: what to measure and its arguments. */
static rx_status obey(bool values, int n, char **word, rx_error *err)
{
    const char *what = n > 0 ? word[0] : "";
    if (strcmp(what, "all") == 0 && n <= 2)
        return tell_all(values, n == 2 ? word[1] : NULL, err);
    if (strcmp(what, "conv") == 0 && (n == 3 || n == 5))
        return obey_conv(values, n, word, err);
    if (strcmp(what, "fft") == 0 && n == 3 && count_of(word[1], 2, 65536) > 0 &&
        count_of(word[2], 1, MOST_THREADS) > 0)
        return tell_square(values, atoi(word[1]), atoi(word[2]), err);
    if (strcmp(what, "rl") == 0 && n == 5 && count_of(word[1], 2, 65536) > 0 &&
        count_of(word[2], 2, 65536) > 0 && atof(word[3]) > 0 && count_of(word[4], 1, MOST_THREADS) > 0)
        return tell_rl(values, atoi(word[1]), atoi(word[2]), atof(word[3]), atoi(word[4]), err);
    if (strcmp(what, "memory") == 0 && n == 2 && count_of(word[1], 1, MOST_THREADS) > 0)
        return tell_memory(values, atoi(word[1]), err);
    if (strcmp(what, "read") == 0 && n == 2)
        return tell_read(values, word[1], err);
    return rx_error_set(err, RX_USAGE,
                        "give what to measure: all, conv, fft, rl, memory or read, with its arguments");
}

int main(int argc, char **argv)
{
    rx_error error = RX_ERROR_NONE;
    char text[1024];
    const int values = argc > 1 && strcmp(argv[1], "-values") == 0;
    const rx_status status = obey(values, argc - 1 - values, argv + 1 + values, &error);
    if (status != RX_OK) {
        rx_error_format(&error, "limits", text, sizeof text);
        fprintf(stderr, "%s\n", text);
    }
    return (int)status;
}
