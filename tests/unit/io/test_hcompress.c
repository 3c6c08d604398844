/* Streams made by cfitsio, and read by it with memory behind them that nobody may read. */
#include "io/guard/guard.h"

#include <fitsio.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "io_test.h"

#include "base/random.h"

enum { MOST = 96 * 96, ROOM = 1 << 18 };

/* Memory that ends where a page begins that cannot be read. */
typedef struct fence {
    char *begin, *end;
} fence;

static fence make_fence(void)
{
    fence dst;
    dst.begin = mmap(NULL, ROOM + (size_t)sysconf(_SC_PAGESIZE), PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_true(dst.begin != MAP_FAILED);
    dst.end = dst.begin + ROOM;
    assert_int_equal(mprotect(dst.end, (size_t)sysconf(_SC_PAGESIZE), PROT_NONE), 0);
    return dst;
}

static void free_fence(fence *f)
{
    munmap(f->begin, ROOM + (size_t)sysconf(_SC_PAGESIZE));
}

static size_t walk(const char *data, size_t length, int pixels)
{
    size_t used = 0;
    rx_error err;
    assert_int_equal(rx_hcompress_walk((const unsigned char *)data, length, pixels, &used, &err), RX_OK);
    return used;
}

/* Numbers in their turn. */
typedef struct turn {
    uint64_t seed, counter;
} turn;

static double gauss(turn *t)
{
    return rx_random_normal(t->seed, 0, t->counter++);
}

static double uniform(turn *t)
{
    return rx_random_uniform(t->seed, 1, t->counter++);
}

/* Pixels of noise, of a few values or of one, and the stream that cfitsio makes of them. */
static size_t make_stream(turn *random, int kind, int nx, int ny, char *stream)
{
    static const double width[] = {0, 0.3, 10, 1e4, 1e5};
    int pixels[MOST] = {0}, failed = 0;
    long length = ROOM;
    for (int i = 0; i < nx * ny; i++)
        pixels[i] = (int)(width[kind] * gauss(random)) + (i == nx + 1 ? 1000 : 0);
    fits_hcompress(pixels, ny, nx, kind == 3 ? 4 : 1, stream, &length, &failed);
    assert_int_equal(failed, 0);
    return (size_t)length;
}

static void test_length(void **state)
{
    static char stream[ROOM];
    turn random = {.seed = 1};
    (void)state;
    for (int kind = 0; kind < 5; kind++)
        for (int nx = 2; nx <= 34; nx += 1 + nx / 6)
            for (int ny = 2; ny <= 96; ny += 1 + ny / 5) {
                const size_t length = make_stream(&random, kind, nx, ny, stream);
                if (walk(stream, length, nx * ny) != length)
                    fail_msg("kind %d, %d x %d pixels: %zu bytes of %zu", kind, nx, ny,
                             walk(stream, length, nx * ny), length);
                assert_int_equal(walk(stream, length, nx * ny + 1), 0);
                for (size_t cut = 0; cut < length; cut += 1 + length / 50)
                    assert_int_equal(walk(stream, length - 1 - cut, nx * ny), 0);
            }
}

/* What the walk lets through cfitsio reads without a step behind it. */
static void test_damaged(void **state)
{
    static char stream[ROOM], copy[ROOM];
    int accepted = 0, refused = 0;
    turn random = {.seed = 2};
    fence f = make_fence();
    (void)state;
    for (int round = 0; round < 3000; round++) {
        const int nx = 2 + round % 31, ny = 2 + round % 37;
        const size_t length = make_stream(&random, round % 5, nx, ny, stream);
        memcpy(copy, stream, length);
        for (int strikes = 1 + round % 3; strikes > 0; strikes--)
            copy[22 + (size_t)(uniform(&random) * (double)(length - 22))] ^= (char)(1 << round % 8);
        const size_t used = walk(copy, length, nx * ny);
        accepted += used > 0;
        refused += used == 0;
        if (used == 0)
            continue;
        int pixels[2 * MOST], x = 0, y = 0, scale = 0, failed = 0; /* decoded in 32 bits */
        LONGLONG wide[MOST];
        memcpy(f.end - used, copy, used);
        fits_hdecompress((unsigned char *)f.end - used, 0, pixels, &y, &x, &scale, &failed);
        assert_int_equal(x * y, nx * ny);
        failed = 0;
        fits_hdecompress64((unsigned char *)f.end - used, 0, wide, &y, &x, &scale, &failed);
        assert_int_equal(x * y, nx * ny);
    }
    assert_in_range(accepted, 100, 2900);
    assert_in_range(refused, 100, 2900);
    free_fence(&f);
}

static void test_no_such_stream(void **state)
{
    static char stream[ROOM];
    turn random = {.seed = 3};
    (void)state;
    const size_t length = make_stream(&random, 2, 8, 8, stream);
    assert_int_equal(walk(stream, length, 64), length);
    static const struct {
        int at;
        char value;
    } wrong[] = {{0, 0}, {1, 0}, {2, 1}, {5, 7}, {9, 64}, {22, 65}, {23, 65}, {24, 65}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        const char was = stream[wrong[i].at];
        stream[wrong[i].at] = wrong[i].value;
        assert_int_equal(walk(stream, length, 64), 0);
        stream[wrong[i].at] = was;
    }
    stream[5] = 1, stream[9] = 64; /* 1 x 64: half of one pixel */
    assert_int_equal(walk(stream, length, 64), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_length),
        cmocka_unit_test(test_damaged),
        cmocka_unit_test(test_no_such_stream),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
