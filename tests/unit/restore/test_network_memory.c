/* What NET takes besides the restored planes does not grow with the tile. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
/* cmocka.h comes after the headers it needs */
#include <cmocka.h>
#include <malloc.h>
#include <stdio.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "network_model.h"
#include "restore/network.h"
#include "sky.h"

enum { WIDTH = 2048, LOW = 512, HIGH = 2048 }; /* heights in whole blocks */

static double resident(void)
{
    long pages = 0, ours = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file == NULL)
        return -1;
    if (fscanf(file, "%ld %ld", &pages, &ours) != 2)
        ours = -1;
    fclose(file);
    return ours < 0 ? -1 : (double)ours * (double)sysconf(_SC_PAGESIZE);
}

/* Peak of a restoration, bytes above what the tile itself takes; -1 when this system does not tell. */
static double peak_of(int height)
{
    sky s;
    struct rusage use;
    rx_restored *restored = NULL;
    sky_new(&s, WIDTH, height);
    for (int k = 0; k < WIDTH * height; k++) {
        s.tile.pixels[k] += (float)(k * 7 % 31) / 10;
        s.tile.mask[k] = k % 997 == 0 ? RX_MASK_BAD : 0;
    }
    rx_model *model = small_model(RX_MODE_INFORMED, 1);
    rx_psf *psf = sky_psf_varying(4, 0.2, WIDTH);
    s.par.model = model;
    s.par.net_block = 256;
    s.par.keep_reblurred = s.par.keep_support = 0;
    s.par.nthreads = 2;
    const double before = resident();
    const rx_image image = sky_image(&s, psf);
    const rx_status status = rx_network_run(&s.par, &image, NULL, &restored, NULL);
    getrusage(RUSAGE_SELF, &use);
    rx_restored_free(restored);
    rx_psf_free(psf);
    rx_model_free(model);
    sky_free(&s);
    return before < 0 || status != RX_OK ? -1 : (double)use.ru_maxrss * 1024 - before;
}

/* In a process of its own, whose peak nothing else has raised. */
static double peak_alone(int height)
{
    int ends[2];
    double peak = -1;
    assert_int_equal(pipe(ends), 0);
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        mallopt(M_MMAP_THRESHOLD, 1 << 20); /* what is freed goes back to the system, as large planes do */
        peak = peak_of(height);
        _exit(write(ends[1], &peak, sizeof peak) != sizeof peak);
    }
    close(ends[1]);
    assert_int_equal(read(ends[0], &peak, sizeof peak), sizeof peak);
    close(ends[0]);
    waitpid(child, NULL, 0);
    return peak;
}

static void memory_is_that_of_the_restored_planes(void **state)
{
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
    print_message("the sanitizer's memory is not ours: not measured\n");
    skip();
#endif
    const double low = peak_alone(LOW), high = peak_alone(HIGH);
    if (low < 0 || high < 0) {
        print_message("this system does not tell what memory a process takes: not measured\n");
        skip();
    }
    const double slope = (high - low) / (WIDTH * (double)(HIGH - LOW)), rest = low - 13.0 * WIDTH * LOW;
    print_message("%.2f bytes per pixel (restored planes: 13), %.1f MB besides\n", slope, rest / 1e6);
    assert_true(slope < 14);
    assert_true(slope > 12);
    assert_true(rest < 100e6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(memory_is_that_of_the_restored_planes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
