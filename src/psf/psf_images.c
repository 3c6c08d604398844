/* PSFs as images: one, or one for each of several places on the tile (a cube), on its pixels or oversampled.
 *
 * A plane of a cube belongs to the place that the header says, as WebbPSF's grids do (DET_YX0 .., "(y, x)" from 0) or
 * the ePSFs of STScI (IPSFX01 .., JPSFY01 .., FITS pixels), or row by row a table of x and y in FITS pixels.
 * Both kinds of grid hold effective PSFs: the pixel response is in them, so that they are interpolated. What other
 * oversampled images hold is light, which the tile's pixels collect. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "psf/psf_files.h"
#include "psf/resample.h"

typedef struct images {
    const char *file;
    const rx_fits_cube *cube;
    int size;        /* of the stamps */
    double sampling; /* samples per tile pixel */
    int integrated, effective;
    double (*at)[2];
} images;

/* The images must hold something that can be normalised. */
static rx_status check_pixels(const char *file, const rx_fits_cube *cube, rx_error *err)
{
    const size_t n = (size_t)cube->width * (size_t)cube->height;
    char plane[40] = "";
    for (int k = 0; k < cube->planes; k++) {
        double sum = 0.0;
        if (cube->planes > 1)
            snprintf(plane, sizeof plane, " of plane %d", k + 1);
        for (size_t i = 0; i < n; i++) {
            if (!isfinite(cube->pixels[(size_t)k * n + i]))
                return rx_error_at(
                    err, RX_INPUT, file, -1, 0,
                    "pixel (%zu,%zu)%s of the PSF image is not a number; replace blank pixels by 0",
                    i % (size_t)cube->width + 1, i / (size_t)cube->width + 1, plane);
            sum += (double)cube->pixels[(size_t)k * n + i];
        }
        if (!(sum > 0.0))
            return rx_error_at(
                err, RX_INPUT, file, -1, 0,
                "the PSF image%s sums to %g; give a PSF with positive flux on a background of 0", plane, sum);
    }
    return RX_OK;
}

/* A PSF whose light is off the centre of its frame moves everything that is restored with it. */
static void warn_off_centre(const char *file, const float *stamp, int size, rx_log *log)
{
    int half = size / 2;
    double sum = 0.0, x = 0.0, y = 0.0, peak = 0.0;
    for (int i = 0; i < size * size; i++)
        peak = fmax(peak, (double)stamp[i]);
    for (int j = 0; j < size; j++)
        for (int i = 0; i < size; i++) {
            double v = (double)stamp[j * size + i];
            if (v < 0.2 * peak)
                continue;
            sum += v;
            x += v * (i - half);
            y += v * (j - half);
        }
    if (hypot(x, y) > 0.3 * sum)
        rx_log_warning(
            log,
            "%s: the PSF's light is centred (%+.2f, %+.2f) pixels off its frame's centre; restored "
            "positions shift by as much",
            file, x / sum, y / sum);
}

/* Side of the PSF: the frame's on the tile's pixels, made odd, or what is asked for; RX_INPUT when the tile is
 * smaller. */
static rx_status choose_side(images *im, int asked, int width, int height, rx_error *err)
{
    const int longer = im->cube->width > im->cube->height ? im->cube->width : im->cube->height;
    const double covered = longer / im->sampling;
    int odd = rx_psf_cut_size(2 * (int)ceil(0.5 * (covered - 1.0) - 1e-9) + 1, asked);
    if (odd > covered && odd > 1 && (odd > width || odd > height))
        odd -= 2; /* less than a pixel on each side instead of more */
    im->size = odd;
    if (odd <= width && odd <= height && odd <= RX_PSF_LARGEST)
        return RX_OK;
    const int said = odd < covered ? odd : (int)ceil(covered);
    return rx_psf_check_size(im->file, said, said, width, height, err);
}

static rx_status draw(const void *model, int k, double x, double y, int fine, double *stamp, rx_error *err)
{
    const images *im = model;
    const rx_fits_cube *cube = im->cube;
    const int side = fine * (im->size - 1) + 1;
    (void)x;
    (void)y;
    const rx_psf_raster src = {.pixels =
                                   cube->pixels + (size_t)k * (size_t)cube->width * (size_t)cube->height,
                               .width = cube->width,
                               .height = cube->height,
                               .centre_x = 0.5 * (cube->width - 1),
                               .centre_y = 0.5 * (cube->height - 1),
                               .box = im->integrated ? im->sampling : 0.0};
    RX_TRY(rx_psf_resample(&src, im->sampling / fine, RX_LANCZOS_MAX, stamp, side, err));
    double sum = 0.0;
    for (int i = 0; i < side * side; i++)
        sum += stamp[i];
    return sum > 0.0 ? RX_OK
                     : rx_error_at(err, RX_INPUT, im->file, -1, 0,
                                   "the middle %d x %d pixels of the PSF image sum to %g; give a larger "
                                   "PSF_SIZE",
                                   im->size, im->size, sum);
}

/* --- sampling and places --- */

/* PSF_SAMPLING, or what the header says: WebbPSF's OVERSAMP and DET_SAMP, which in images binned to the detector's
 * pixels (EXTNAME DET_SAMP, DET_DIST) is not theirs; 4 for the ePSFs of STScI. */
static rx_status find_sampling(images *im, const rx_psf_params *par, rx_error *err)
{
    static const char *const keys[] = {"DET_SAMP", "OVERSAMP", "OVERSMPL"};
    const rx_fits_cube *cube = im->cube;
    char extname[72] = "", key[24] = "PSF_SAMPLING";
    im->sampling = par->sampling;
    rx_cards_text(cube->cards, cube->ncards, "EXTNAME", extname, sizeof extname);
    if (!(im->sampling > 0.0) && strncasecmp(extname, "DET_", 4) != 0)
        for (size_t i = 0; i < sizeof keys / sizeof *keys && !(im->sampling != 0.0); i++)
            if (rx_cards_number(cube->cards, cube->ncards, keys[i], &im->sampling))
                snprintf(key, sizeof key, "%s", keys[i]);
    double any;
    if (im->sampling == 0.0)
        im->sampling = rx_cards_number(cube->cards, cube->ncards, "IPSFX01", &any) ? 4.0 : 1.0;
    if (!(im->sampling >= 1.0 && im->sampling <= 100.0))
        return rx_error_at(err, RX_INPUT, im->file, -1, 0,
                           "%s = %g samples of the PSF image per pixel of the tile cannot be right; give "
                           "PSF_SAMPLING 1 to 100",
                           key, im->sampling);
    return RX_OK;
}

/* Places from the header; 0 where it says none. */
static int places_of_header(images *im)
{
    const rx_fits_cube *cube = im->cube;
    char key[24], text[72];
    double nx, ny;
    int n = 0;
    for (; n < cube->planes; n++) {
        snprintf(key, sizeof key, "DET_YX%d", n);
        if (!rx_cards_text(cube->cards, cube->ncards, key, text, sizeof text) ||
            sscanf(text, " ( %lf , %lf )", &im->at[n][1], &im->at[n][0]) != 2 || !isfinite(im->at[n][0]) ||
            !isfinite(im->at[n][1]))
            break;
    }
    if (n == cube->planes)
        return im->effective = 1;
    if (!rx_cards_number(cube->cards, cube->ncards, "NXPSFS", &nx) ||
        !rx_cards_number(cube->cards, cube->ncards, "NYPSFS", &ny) ||
        !(nx >= 1.0 && nx <= cube->planes && nx == floor(nx)) || nx * ny != cube->planes)
        return 0;
    for (n = 0; n < cube->planes; n++) {
        snprintf(key, sizeof key, "IPSFX%02d", n % (int)nx + 1);
        if (!rx_cards_number(cube->cards, cube->ncards, key, &im->at[n][0]))
            return 0;
        snprintf(key, sizeof key, "JPSFY%02d", n / (int)nx + 1);
        if (!rx_cards_number(cube->cards, cube->ncards, key, &im->at[n][1]))
            return 0;
        im->at[n][0] -= 1.0;
        im->at[n][1] -= 1.0;
    }
    return im->effective = 1;
}

/* Places from the first table of the file. */
static rx_status places_of_table(images *im, rx_error *err)
{
    static const char *const names[][2] = {
        {"X", "Y"}, {"X_IMAGE", "Y_IMAGE"}, {"XWIN_IMAGE", "YWIN_IMAGE"}, {"XCENTER", "YCENTER"}};
    const int planes = im->cube->planes;
    rx_table *table = NULL;
    int x = -1, y = -1;
    char *path = rx_strdup(im->file);
    if (path == NULL)
        return rx_error_memory(err, 0);
    path[strcspn(path, "[")] = '\0';
    if (rx_fits_read_table(path, 0, &table, NULL) != RX_OK)
        table = NULL;
    free(path);
    for (size_t i = 0; i < sizeof names / sizeof *names && table != NULL && (x < 0 || y < 0); i++) {
        x = rx_table_find(table, names[i][0]);
        y = rx_table_find(table, names[i][1]);
    }
    rx_status status = RX_OK;
    if (x < 0 || y < 0)
        status = rx_error_at(
            err, RX_INPUT, im->file, -1, 0,
            "%d PSFs in a cube, and nothing says where; add a table of x and y (FITS pixels) with "
            "a row for each plane, or cards DET_YX0 ..",
            planes);
    else if (table->nrows != planes)
        status = rx_error_at(err, RX_INPUT, im->file, -1, 0,
                             "a cube of %d PSFs with a table of %ld places; give a row for each plane",
                             planes, table->nrows);
    for (int k = 0; k < planes && status == RX_OK; k++) {
        im->at[k][0] = rx_column_value(&table->columns[x], k, 0) - 1.0;
        im->at[k][1] = rx_column_value(&table->columns[y], k, 0) - 1.0;
        if (!isfinite(im->at[k][0]) || !isfinite(im->at[k][1]))
            status = rx_error_at(err, RX_INPUT, im->file, -1, 0,
                                 "row %d of the table of places holds no position; give x and y", k + 1);
    }
    rx_table_free(table);
    return status;
}

/* How far the tile reaches out of the places. */
static double beyond(const images *im, int width, int height)
{
    double worst = 0.0;
    for (int axis = 0; axis < 2; axis++) {
        double low = HUGE_VAL, high = -HUGE_VAL;
        for (int k = 0; k < im->cube->planes; k++) {
            low = fmin(low, im->at[k][axis] + 1.0);
            high = fmax(high, im->at[k][axis] + 1.0);
        }
        worst = fmax(worst, rx_psf_beyond(low, high, axis == 0 ? width : height));
    }
    return worst;
}

rx_status rx_psf_images(const rx_psf_params *par, const rx_fits_cube *cube, int width, int height,
                        rx_log *log, rx_psf **dst, rx_error *err)
{
    images im = {.file = par->file, .cube = cube};
    int degree = 0;
    double misfit = 0.0;
    rx_psf *psf = NULL;
    *dst = NULL;
    im.at = rx_alloc((size_t)cube->planes, sizeof *im.at);
    float *stamp = NULL;
    rx_status status = im.at != NULL ? find_sampling(&im, par, err) : rx_error_memory(err, 0);
    if (status == RX_OK)
        status = choose_side(&im, par->size, width, height, err);
    if (status == RX_OK)
        status = check_pixels(par->file, cube, err);
    if (status == RX_OK && !places_of_header(&im) && cube->planes > 1)
        status = places_of_table(&im, err);
    if (status != RX_OK)
        goto exit;
    im.integrated =
        par->integrate == RX_PSF_INTEGRATE_AUTO ? !im.effective : par->integrate == RX_PSF_INTEGRATE;
    const rx_psf_source src = {.file = par->file,
                               .what = cube->planes > 1 ? "grid of PSF images" : "PSF image",
                               .type = RX_PSF_FILE,
                               .size = im.size,
                               .draw = draw,
                               .finest = (int)(im.sampling + 1e-6),
                               .model = &im,
                               .n = cube->planes,
                               .at = (const double(*)[2])im.at};
    stamp = RX_NEW(float, (size_t)im.size *(size_t)im.size);
    status = stamp != NULL ? rx_psf_project(&src, width, height, &psf, &degree, &misfit, err)
                           : rx_error_memory(err, 0);
    if (status != RX_OK)
        goto exit;
    rx_psf_at(psf, 0.5 * (width - 1), 0.5 * (height - 1), stamp);
    warn_off_centre(par->file, stamp, im.size, log);
    rx_psf_warn_misfit(&src, misfit, log);
    rx_psf_warn_beyond(par->file, src.what, beyond(&im, width, height), log);
    char sampled[48] = "", grid[40] = "image";
    if (im.sampling != 1.0)
        snprintf(sampled, sizeof sampled, ", %g samples a pixel%s", im.sampling,
                 im.integrated ? " integrated" : "");
    if (cube->planes > 1)
        snprintf(grid, sizeof grid, "%d images to degree %d,", cube->planes, degree);
    snprintf(psf->description, sizeof psf->description,
             "%.39s %.40s, %d x %d px%.32s, FWHM %.3f px, ellipticity %.3f", grid,
             rx_psf_base_name(par->file), cube->width, cube->height, sampled, psf->fwhm, psf->ellipticity);
    *dst = psf;
    psf = NULL;
exit:
    rx_psf_free(psf);
    free(im.at);
    free(stamp);
    return status;
}

rx_status rx_psf_of_pixels(const rx_psf_params *par, const rx_psf_pixels *image, int width, int height,
                           rx_log *log, rx_psf **dst, rx_error *err)
{
    const rx_fits_cube cube = {
        .pixels = (float *)image->pixels, .width = image->width, .height = image->height, .planes = 1};
    rx_psf_params own = *par;
    own.file = "array";
    return rx_psf_images(&own, &cube, width, height, log, dst, err);
}
