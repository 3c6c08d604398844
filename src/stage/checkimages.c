/* Making and writing the check-images. */
#include "stage/checkimages.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/names.h"
#include "data/map.h"
#include "io/fits_write.h"
#include "pipeline/field.h"
#include "psf/psf_psfex.h"

typedef struct checkimage {
    const char *type;
    char *name; /* of the file */
    int parts;  /* HDUs written */
    rx_fits_writer *writer;
} checkimage;

struct rx_checkimages {
    int n;
    checkimage *list;
};

/* Of one extension; a painter fills pixels[height*width], or the smaller size it sets. */
typedef struct picture {
    int width, height;
    float *pixels;           /* or: */
    const int32_t *integers; /* of the segmentation map */
} picture;
typedef void (*painter)(const rx_checkimage_data *data, picture *dst);

static const rx_background *sky_of(const rx_checkimage_data *data)
{
    const rx_result *result = data->result;
    return result->plain ? result->detect->plain : result->detect->restored;
}

static int hidden(const rx_checkimage_data *data, size_t i)
{
    return data->result->restored->mask[i] != 0;
}

static size_t npixels(const picture *c)
{
    return (size_t)c->width * (size_t)c->height;
}

/* In dual-image mode SExtractor's kinds show the measurement image, but for FILTERED and BACKGROUND_RMS. It is
 * NULL where that one was not restored. */
static const rx_restored *measured_image(const rx_checkimage_data *data)
{
    const rx_result *result = data->result;
    return result->measure == result->detect ? result->restored : result->second;
}

static const rx_background *measured_sky(const rx_checkimage_data *data)
{
    const rx_field *field = data->result->measure;
    const rx_restored *image = measured_image(data);
    return image == NULL || strcmp(image->name, "NONE") == 0 ? field->plain : field->restored;
}

static int measured_hidden(const rx_checkimage_data *data, size_t i)
{
    const rx_restored *image = measured_image(data);
    return image != NULL ? image->mask[i] != 0 : (data->result->measure->image.mask[i] & RX_HIDE_PLAIN) != 0;
}

static void paint_map(rx_map map, picture *dst)
{
    rx_map_fill(&map, dst->height, 1, dst->pixels);
}

/* Above the sky; hidden pixels of an image that was not restored are 0. */
static void paint_measured(const rx_checkimage_data *data, picture *dst)
{
    const rx_restored *image = measured_image(data);
    if (image != NULL) {
        memcpy(dst->pixels, image->pixels, npixels(dst) * sizeof(float));
        return;
    }
    paint_map(rx_background_level(measured_sky(data)), dst);
    for (size_t i = 0; i < npixels(dst); i++)
        dst->pixels[i] =
            measured_hidden(data, i) ? 0.0f : data->result->measure->image.pixels[i] - dst->pixels[i];
}

static void paint_identical(const rx_checkimage_data *data, picture *dst)
{
    const rx_tile *tile = data->result->measure->tile;
    for (size_t i = 0; i < npixels(dst); i++)
        dst->pixels[i] = tile->mask[i] & RX_MASK_BAD ? NAN : tile->pixels[i];
}

static void paint_background(const rx_checkimage_data *data, picture *dst)
{
    paint_map(rx_background_level(measured_sky(data)), dst);
}

static void paint_rms(const rx_checkimage_data *data, picture *dst)
{
    paint_map(rx_background_noise(sky_of(data)), dst);
}

static void paint_restored(const rx_checkimage_data *data, picture *dst)
{
    paint_map(rx_background_level(sky_of(data)), dst);
    for (size_t i = 0; i < npixels(dst); i++)
        dst->pixels[i] = hidden(data, i) ? NAN : data->result->restored->pixels[i] + dst->pixels[i];
}

static void paint_restored_rms(const rx_checkimage_data *data, picture *dst)
{
    memcpy(dst->pixels, data->rms, npixels(dst) * sizeof(float));
}

static void paint_subtracted(const rx_checkimage_data *data, picture *dst)
{
    paint_measured(data, dst);
    for (size_t i = 0; i < npixels(dst); i++)
        if (measured_hidden(data, i))
            dst->pixels[i] = NAN;
}

static void paint_filtered(const rx_checkimage_data *data, picture *dst)
{
    for (size_t i = 0; i < npixels(dst); i++)
        dst->pixels[i] = data->result->filtered_scale * data->result->filtered[i];
}

static void paint_objects(const rx_checkimage_data *data, picture *dst)
{
    paint_measured(data, dst);
    for (size_t i = 0; i < npixels(dst); i++)
        if (data->result->sources->segments[i] == 0)
            dst->pixels[i] = 0.0f;
}

/* Groups too small to be a source are blanked as well, as in SExtractor. */
static void paint_no_objects(const rx_checkimage_data *data, picture *dst)
{
    const rx_sources *sources = data->result->sources;
    paint_subtracted(data, dst);
    for (size_t i = 0; i < npixels(dst); i++) {
        int small = sources->fragments != NULL && sources->fragments[i] == RX_FRAGMENT_SMALL;
        if (sources->segments[i] != 0 || small)
            dst->pixels[i] = 0.0f;
    }
}

/* In sigmas: a restorer that explains the data leaves white noise of width 1. */
static void paint_residual(const rx_checkimage_data *data, picture *dst)
{
    const rx_map levels = rx_background_level(sky_of(data));
    const rx_map noise = rx_background_noise(sky_of(data));
    const float *reblurred = data->result->restored->reblurred; /* NULL: nothing was restored */
    for (int y = 0; y < dst->height; y++)
        for (int x = 0; x < dst->width; x += RX_MAP_PIECE) {
            const int n = rx_map_piece(x, dst->width);
            float room[2][RX_MAP_PIECE];
            const float *level = rx_map_row(&levels, y, x, n, room[0]);
            const float *sigma = rx_map_row(&noise, y, x, n, room[1]);
            size_t k = (size_t)y * (size_t)dst->width + (size_t)x;
            for (int i = 0; i < n; i++, k++) {
                const float input = data->result->detect->tile->pixels[k] - level[i];
                const float model = reblurred != NULL ? reblurred[k] : data->result->restored->pixels[k];
                dst->pixels[k] = hidden(data, k) || !(sigma[i] > 0.0f) ? NAN : (model - input) / sigma[i];
            }
        }
}

static void paint_support(const rx_checkimage_data *data, picture *dst)
{
    for (size_t i = 0; i < npixels(dst); i++)
        dst->pixels[i] = data->result->restored->support != NULL ? data->result->restored->support[i]
                         : hidden(data, i)                       ? 1.0f
                                                                 : 0.0f;
}

/* dst = the noise of the sky where a pixel took part in the template fit, else not a number; without a fit
 * none did. */
static void paint_fitted_noise(const rx_checkimage_data *data, picture *dst)
{
    paint_map(rx_background_noise(data->result->measure->restored), dst);
    for (size_t i = 0; i < npixels(dst); i++)
        if (data->result->templates.tphot == NULL ||
            (data->result->measure->image.mask[i] & RX_HIDE_RESTORED) != 0 || !(dst->pixels[i] > 0.0f))
            dst->pixels[i] = NAN;
}

static void paint_template_residual(const rx_checkimage_data *data, picture *dst)
{
    paint_fitted_noise(data, dst);
    for (size_t i = 0; i < npixels(dst); i++)
        if (!isnan(dst->pixels[i]))
            dst->pixels[i] = data->result->templates.tphot->residual[i];
}

static void paint_template_model(const rx_checkimage_data *data, picture *dst)
{
    const rx_tphot *tphot = data->result->templates.tphot;
    for (size_t i = 0; i < npixels(dst); i++)
        dst->pixels[i] = tphot != NULL ? tphot->model[i] : NAN;
}

/* In sigmas of sky and photons. */
static void paint_template_chi(const rx_checkimage_data *data, picture *dst)
{
    const rx_tphot *tphot = data->result->templates.tphot;
    const double gain = data->result->measure->image.gain;
    paint_fitted_noise(data, dst);
    for (size_t i = 0; i < npixels(dst); i++) {
        if (isnan(dst->pixels[i]))
            continue;
        const double sigma = (double)dst->pixels[i], model = (double)tphot->model[i];
        const double photons = gain > 0.0 && model > 0.0 ? model / gain : 0.0;
        dst->pixels[i] = (float)((double)tphot->residual[i] / sqrt(sigma * sigma + photons));
    }
}

typedef struct ellipse {
    double x, y, a, b, theta;
} ellipse;

/* Add `value` to the image along an ellipse. */
static void draw_ellipse(const rx_checkimage_data *data, picture *dst, const ellipse *e, float value)
{
    const int steps = 16 + (int)(8.0 * e->a);
    const rx_restored *image = measured_image(data);
    const rx_map level = rx_background_level(measured_sky(data));
    if (!(e->a > 0.0) || !(e->b > 0.0) || e->a > 1e5)
        return;
    for (int k = 0; k < steps; k++) {
        const double t = 2.0 * M_PI * k / steps, u = e->a * cos(t), v = e->b * sin(t);
        const int px = (int)lround(e->x + u * cos(e->theta) - v * sin(e->theta));
        const int py = (int)lround(e->y + u * sin(e->theta) + v * cos(e->theta));
        const size_t k = (size_t)py * (size_t)dst->width + (size_t)px;
        if (px >= 0 && px < dst->width && py >= 0 && py < dst->height && !measured_hidden(data, k))
            dst->pixels[k] =
                (image != NULL ? image->pixels[k]
                               : data->result->measure->image.pixels[k] - rx_map_at(&level, px, py)) +
                value;
    }
}

/* The image without its background, and the limits of MAG_APER (circles) and MAG_AUTO (ellipses) on it. */
static void paint_apertures(const rx_checkimage_data *data, picture *dst)
{
    static const double overlay = 30.0; /* sigmas */
    paint_subtracted(data, dst);
    float value = (float)(overlay * measured_sky(data)->global_sigma);
    for (int i = 0; i < data->result->sources->n; i++) {
        const rx_source *s = &data->result->sources->list[i];
        const ellipse kron = {s->x, s->y, s->kron_radius * s->a, s->kron_radius * s->b, s->theta};
        draw_ellipse(data, dst, &kron, value);
        for (int k = 0; k < data->result->sources->naper; k++) {
            double r = 0.5 * data->result->sources->aperture_diameter[k];
            draw_ellipse(data, dst, &(ellipse){s->x, s->y, r, r, 0.0}, value);
        }
    }
}

/* One pixel per background mesh, the value of the full map at the mesh centre. */
static void paint_mesh(const rx_checkimage_data *data, rx_map map, picture *dst)
{
    int nx = (dst->width - 1) / data->mesh_width + 1, ny = (dst->height - 1) / data->mesh_height + 1;
    for (int j = 0; j < ny; j++)
        for (int i = 0; i < nx; i++) {
            const int x = rx_min_int(i * data->mesh_width + data->mesh_width / 2, dst->width - 1);
            const int y = rx_min_int(j * data->mesh_height + data->mesh_height / 2, dst->height - 1);
            dst->pixels[(size_t)j * (size_t)nx + (size_t)i] = rx_map_at(&map, x, y);
        }
    dst->width = nx;
    dst->height = ny;
}

static void paint_miniback(const rx_checkimage_data *data, picture *dst)
{
    paint_mesh(data, rx_background_level(measured_sky(data)), dst);
}

static void paint_miniback_rms(const rx_checkimage_data *data, picture *dst)
{
    paint_mesh(data, rx_background_noise(measured_sky(data)), dst);
}

/* SEGMENTATION and PSF have no painter: integers, and a table. `measured`: it shows the measurement image, and has
 * that one's header. */
static const struct {
    const char *type;
    painter paint;
    bool measured;
} painters[] = {
    {"IDENTICAL", paint_identical, true},
    {"RESTORED", paint_restored, false},
    {"RESTORED_RMS", paint_restored_rms, false},
    {"BACKGROUND", paint_background, true},
    {"BACKGROUND_RMS", paint_rms, false},
    {"-BACKGROUND", paint_subtracted, true},
    {"FILTERED", paint_filtered, false},
    {"OBJECTS", paint_objects, true},
    {"-OBJECTS", paint_no_objects, true},
    {"RESIDUAL", paint_residual, false},
    {"SUPPORT", paint_support, false},
    {"APERTURES", paint_apertures, true},
    {"MINIBACKGROUND", paint_miniback, true},
    {"MINIBACK_RMS", paint_miniback_rms, true},
    {"TEMPLATE_RESIDUAL", paint_template_residual, true},
    {"TEMPLATE_MODEL", paint_template_model, true},
    {"TEMPLATE_CHI", paint_template_chi, true},
};

enum { PAINTERS = sizeof painters / sizeof *painters };

/* PAINTERS: none. */
static int painter_of(const char *type)
{
    int k = 0;
    while (k < PAINTERS && strcmp(painters[k].type, type) != 0)
        k++;
    return k;
}

int rx_checkimage_offered(const char *type)
{
    return painter_of(type) < PAINTERS || strcmp(type, "SEGMENTATION") == 0 || strcmp(type, "PSF") == 0;
}

rx_status rx_checkimages_open(int n, const char *const *types, const char *const *names, const char *tag,
                              rx_outputs *outputs, rx_checkimages **dst, rx_error *err)
{
    rx_status status = RX_OK;
    rx_checkimages *images = RX_NEW(rx_checkimages, 1);
    if (images == NULL || (images->list = RX_NEW(checkimage, (size_t)n)) == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    for (int i = 0; i < n; i++) {
        const char *temporary;
        checkimage *image = &images->list[images->n++];
        image->type = types[i];
        image->name = rx_name_with_tag(names[i], tag);
        if (image->name == NULL)
            RX_TRY_EXIT(rx_error_memory(err, 0));
        RX_TRY_EXIT(rx_outputs_file(outputs, image->name, &temporary, err));
        RX_TRY_EXIT(rx_fits_create(temporary, image->name, &image->writer, err));
    }
    *dst = images;
    images = NULL;
exit:
    rx_checkimages_free(images);
    return status;
}

/* The header of an image whose pixels have that digest: facts, digest, record. */
static rx_status make_cards(checkimage *image, const rx_checkimage_data *data, const char *digest,
                            rx_text *cards, rx_error *err)
{
    rx_record own = {0}, whole = {0};
    image->parts++;
    rx_record_product(&own, digest, image->parts, image->name);
    rx_record_product(data->products, digest, image->parts, image->name);
    rx_status status = rx_record_of(data->record, &own, image->name, &whole, err);
    if (status == RX_OK) {
        rx_record_cards(data->facts, cards);
        rx_card_text(cards, "RXDIGEST", digest, "");
        rx_record_cards(&whole, cards);
        if (cards->failed || data->products->failed)
            status = rx_error_memory(err, 0);
    }
    rx_record_free(&own);
    rx_record_free(&whole);
    return status;
}

/* The PSF that the restorer used or, where it used none, that of the tile, as PSFEx writes it. */
static rx_status write_psf(checkimage *image, const rx_checkimage_data *data, rx_error *err)
{
    const rx_tile *tile = data->result->detect->tile;
    const rx_psf *used = data->result->restored->blur;
    const rx_psf *psf = used != NULL ? used : data->result->detect->psf;
    char digest[RX_HASH_TEXT];
    rx_text cards = {0};
    rx_table *table = NULL;
    rx_status status;
    if (psf == NULL)
        rx_log_warning(data->log,
                       "%s[%d]: no PSF is known: CHECKIMAGE_TYPE PSF holds NaN for it, as psfex writes it, "
                       "and cannot be read as a PSF; give PSF_FWHM or a PSF file",
                       tile->name, tile->hdu);
    RX_TRY_EXIT(rx_psf_psfex_table(psf, &table, &cards, err));
    rx_fits_digest_table(table, digest);
    RX_TRY_EXIT(make_cards(image, data, digest, &cards, err));
    status = rx_fits_table(image->writer, table, &cards, err);
exit:
    rx_text_free(&cards);
    rx_table_free(table);
    return status;
}

static rx_status write_picture(checkimage *image, const rx_checkimage_data *data, const rx_tile *tile,
                               const picture *src, rx_error *err)
{
    char digest[RX_HASH_TEXT];
    rx_text cards = {0};
    rx_fits_plane plane = {.extname = tile->extname};
    if (src->width == tile->width && src->height == tile->height) /* a mesh map has other coordinates */
        plane = rx_fits_plane_of(tile);
    plane.width = src->width;
    plane.height = src->height;
    plane.floats = src->pixels;
    plane.integers = src->integers;
    rx_fits_digest_pixels(src->pixels != NULL ? (const void *)src->pixels : src->integers, npixels(src),
                          digest);
    rx_status status = make_cards(image, data, digest, &cards, err);
    if (status == RX_OK)
        status = rx_fits_image(image->writer, &plane, &cards, err);
    rx_text_free(&cards);
    return status;
}

/* Of a type that is offered. */
static rx_status write_one(checkimage *image, const rx_checkimage_data *data, float *pixels, rx_error *err)
{
    const rx_field *detect = data->result->detect;
    const int k = painter_of(image->type);
    picture dst = {.width = detect->tile->width, .height = detect->tile->height};
    if (strcmp(image->type, "PSF") == 0)
        return write_psf(image, data, err);
    if (k == PAINTERS) {
        dst.integers = data->result->sources->segments;
        return write_picture(image, data, detect->tile, &dst, err);
    }
    dst.pixels = pixels;
    painters[k].paint(data, &dst);
    return write_picture(image, data, painters[k].measured ? data->result->measure->tile : detect->tile, &dst,
                         err);
}

rx_status rx_checkimages_write(rx_checkimages *images, const rx_checkimage_data *data, rx_error *err)
{
    if (images->n == 0)
        return RX_OK;
    rx_status status = RX_OK;
    size_t n = (size_t)data->result->detect->tile->width * (size_t)data->result->detect->tile->height;
    float *pixels;
    RX_TRY(RX_MAKE(pixels, n, err));
    for (int i = 0; i < images->n && status == RX_OK; i++)
        status = write_one(&images->list[i], data, pixels, err);
    free(pixels);
    return status;
}

rx_status rx_checkimages_close(rx_checkimages *images, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < images->n && status == RX_OK; i++) {
        status = rx_fits_close(images->list[i].writer, err);
        images->list[i].writer = NULL;
    }
    rx_checkimages_free(images);
    return status;
}

void rx_checkimages_free(rx_checkimages *images)
{
    if (images == NULL)
        return;
    for (int i = 0; images->list != NULL && i < images->n; i++) {
        rx_fits_abort(images->list[i].writer);
        free(images->list[i].name);
    }
    free(images->list);
    free(images);
}
