/* Names of outputs and the two images of the dual-image mode. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "base/names.h"

static void check_tag(const char *path, const char *tag, const char *expected)
{
    char *name = rx_name_with_tag(path, tag);
    assert_non_null(name);
    assert_string_equal(name, expected);
    free(name);
}

static void tags_go_before_the_extension(void **state)
{
    (void)state;
    check_tag("night.d/field.cat", "RL", "night.d/field_RL.cat");
    check_tag("night.d/field", "RL", "night.d/field_RL");
    check_tag("field.fits.gz", "RL", "field.fits_RL.gz");
    check_tag(".hidden", "NONE", ".hidden_NONE");
    check_tag("field.cat", NULL, "field.cat");
    check_tag("field.cat", "", "field.cat");
}

static void check_split(const char *images, const char *first, const char *second)
{
    char *detect, *measure;
    assert_true(rx_name_split_images(images, &detect, &measure));
    assert_string_equal(detect, first);
    if (second == NULL)
        assert_null(measure);
    else
        assert_string_equal(measure, second);
    free(detect);
    free(measure);
}

static void commas_in_brackets_do_not_split(void **state)
{
    (void)state;
    check_split("a.fits", "a.fits", NULL);
    check_split("a.fits,b.fits", "a.fits", "b.fits");
    check_split("a.fits[1][1:5,2:6]", "a.fits[1][1:5,2:6]", NULL);
    check_split("a.fits[SCI,1],b.fits[SCI,2]", "a.fits[SCI,1]", "b.fits[SCI,2]");
}

static void check_stem(const char *image, const char *stem)
{
    char *found = rx_name_stem(image);
    assert_string_equal(found, stem);
    free(found);
}

static void a_tile_has_a_name(void **state)
{
    (void)state;
    check_stem("night/a.fits", "a");
    check_stem("a.fits.fz[1]", "a");
    check_stem("A.FIT.GZ", "A");
    check_stem("/data/m31.r.fts.bz2", "m31.r");
    check_stem("a.fits[SCI,1][1:5,2:6],b.fits", "a");
    check_stem("frame", "frame");
    check_stem(".fits", ".fits");
    check_stem("n/..fits", ".");
    check_stem("night/", "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tags_go_before_the_extension),
        cmocka_unit_test(commas_in_brackets_do_not_split),
        cmocka_unit_test(a_tile_has_a_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
