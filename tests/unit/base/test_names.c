/* Names of outputs and the two images of the dual-image mode. */
#include "../scratch.h"

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

static void check_real(const char *path, const char *folder, const char *name)
{
    char expected[4096], *real = rx_name_real(path);
    assert_non_null(real);
    snprintf(expected, sizeof expected, "%s%s", folder, name);
    assert_string_equal(real, expected);
    free(real);
}

static void names_of_one_file_are_one(void **state)
{
    char here[512], link[600], path[1200], dangling[600];
    new_folder(here);
    char *folder = realpath(here, NULL); /* /tmp may be a link */
    assert_non_null(folder);
    snprintf(link, sizeof link, "%s/link", here);
    assert_int_equal(symlink(".", link), 0);
    snprintf(path, sizeof path, "%s/../%s/./link/new.cat", here, strrchr(here, '/') + 1);
    check_real(path, folder, "/new.cat");
    snprintf(path, sizeof path, "%s/link/new.cat/", here);
    check_real(path, folder, "/new.cat");
    check_real(link, folder, "");
    snprintf(dangling, sizeof dangling, "%s/dangling", here);
    assert_int_equal(symlink("link/new.cat", dangling), 0);
    check_real(dangling, folder, "/new.cat");
    unlink(dangling);
    assert_int_equal(symlink("dangling", dangling), 0); /* to itself */
    check_real(dangling, folder, "/dangling");
    unlink(dangling);
    check_real("/new.cat", "", "/new.cat");
    check_real("/", "", "/");
    snprintf(path, sizeof path, "%s/absent/../new.cat", here); /* folders that are made before the file */
    check_real(path, folder, "/new.cat");
    snprintf(path, sizeof path, "%s/link/absent/./deeper//new.cat", here);
    check_real(path, folder, "/absent/deeper/new.cat");
    assert_int_equal(symlink("absent", dangling), 0);
    snprintf(path, sizeof path, "%s/dangling/new.cat", here);
    check_real(path, folder, "/absent/new.cat");
    unlink(dangling);
    char *cwd = realpath(".", NULL);
    assert_non_null(cwd);
    check_real("absent.cat", cwd, "/absent.cat");
    check_real("absent/new.cat", cwd, "/absent/new.cat");
    free(cwd);
    free(folder);
    assert_int_equal(clear_folder(here), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tags_go_before_the_extension),
        cmocka_unit_test(commas_in_brackets_do_not_split),
        cmocka_unit_test(a_tile_has_a_name),
        cmocka_unit_test(names_of_one_file_are_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
