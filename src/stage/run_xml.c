/* The VOTable of a run. */
#include "stage/run_xml.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "catalog/catalog.h"

/* clang-format off */
#define FIELD(name_, unit_, ucd_, description_, type_, width) \
    {.name = name_, .unit = unit_, .ucd = ucd_, .description = description_, .type = RX_CELL_##type_, .text_width = width}
/* clang-format on */
static const rx_column IMAGES[] = {
    FIELD("Extension", "", "meta.record", "image of the file, from 1", INT32, 0),
    FIELD("HDU", "", "meta.record", "its HDU, from 0", INT32, 0),
    FIELD("Restorer", "", "meta.id;meta.software", "that was asked for", TEXT, 16),
    FIELD("Done_By", "", "meta.id;meta.software", "that did it", TEXT, 16),
    FIELD("NSextracted", "", "meta.number", "sources in the catalogue", INT64, 0),
    FIELD("Background_Mean", "adu", "instr.skyLevel;obs.image;stat.median", "sky level", DOUBLE, 0),
    FIELD("Background_StDev", "adu", "stat.stdev;obs.image;instr.skyLevel", "noise of a pixel", DOUBLE, 0),
    FIELD("FWHM", "pixel", "instr.obsty.seeing", "of the PSF at the centre; nan: none", DOUBLE, 0),
    FIELD("Ellipticity", "", "src.ellipticity;instr.det.psf", "1 - b/a of the PSF at the centre", DOUBLE, 0),
    FIELD("Depth", "mag", "phot.mag;stat.min", "point source at S/N 5 in the noise of the sky", DOUBLE, 0),
    FIELD("Noise_Factor", "", "stat.correlation", "noise of wide sums over that of independent pixels",
          DOUBLE, 0),
    FIELD("Masked", "", "meta.number;stat.value", "share of pixels that are not used", DOUBLE, 0),
    FIELD("Saturated", "", "instr.saturation;stat.value", "share of pixels that are saturated", DOUBLE, 0),
    FIELD("Flux_Scale", "", "phot.flux;arith.ratio", "restored over original flux of isolated sources",
          DOUBLE, 0),
    FIELD("Flux_Scale_Error", "", "stat.error;phot.flux;arith.ratio", "1 sigma of it", DOUBLE, 0),
    FIELD("Not_Explained", "", "stat.fit.goodness", "share of cells that the model does not explain", DOUBLE,
          0),
    FIELD("PSF_Stars", "", "meta.number;instr.det.psf", "stars that made the PSF", INT32, 0),
};
enum { NIMAGES = sizeof IMAGES / sizeof *IMAGES };

static rx_status images_table(const rx_tile_facts *facts, rx_table **dst, rx_error *err)
{
    long rows = 0;
    for (int k = 0; k < facts->n; k++)
        rows += facts->extension[k].nruns;
    RX_TRY(rx_table_make("Extension_Data", IMAGES, NIMAGES, rows, dst, err));
    rows = 0;
    for (int k = 0; k < facts->n; k++)
        for (int i = 0; i < facts->extension[k].nruns; i++, rows++) {
            const rx_extension_facts *e = &facts->extension[k];
            const rx_run_facts *run = &e->run[i];
            const int measured = run->flux.n > 0;
            const struct {
                double number;
                const char *text;
            } values[NIMAGES] = {{k + 1, NULL},
                                 {e->hdu, NULL},
                                 {0, run->name},
                                 {0, run->by[0] != '\0' ? run->by : run->name},
                                 {(double)run->sources, NULL},
                                 {e->sky, NULL},
                                 {e->noise, NULL},
                                 {e->fwhm, NULL},
                                 {e->state.ellipticity, NULL},
                                 {e->state.depth, NULL},
                                 {e->state.factor, NULL},
                                 {e->state.masked, NULL},
                                 {e->state.saturated, NULL},
                                 {measured ? run->flux.wide : NAN, NULL},
                                 {measured ? run->flux.wide_error : NAN, NULL},
                                 {run->guard.unexplained, NULL},
                                 {e->psf.stars, NULL}};
            for (int c = 0; c < NIMAGES; c++)
                rx_column_set(&(*dst)->columns[c], rows, values[c].number, values[c].text);
        }
    return RX_OK;
}

static rx_status warnings_table(const rx_text *warnings, rx_table **dst, rx_error *err)
{
    long n = 0;
    int longest = 1;
    for (size_t at = 0; at < warnings->length; at += strlen(warnings->data + at) + 1, n++)
        longest = (int)fmax(longest, (double)strlen(warnings->data + at) + 1);
    if (warnings->failed)
        return rx_error_memory(err, 0);
    const rx_column text = FIELD("Text", "", "meta.note", "as the log has it", TEXT, longest);
    RX_TRY(rx_table_make("Warnings", &text, 1, n, dst, err));
    n = 0;
    for (size_t at = 0; at < warnings->length; at += strlen(warnings->data + at) + 1, n++)
        rx_column_set(&(*dst)->columns[0], n, 0, warnings->data + at);
    return RX_OK;
}

rx_status rx_run_xml(const rx_run_xml_input *in, const char *temporary, const char *shown, rx_error *err)
{
    char images[16], thresh[32] = "";
    const rx_votable_param params[] = {
        {"Software", "char", NULL, "meta.title;meta.software", "Rextract", "that made the catalogue"},
        {"Version", "char", NULL, "meta.version;meta.software", RX_VERSION, "its version"},
        {"Image_Name", "char", NULL, "meta.id;obs.image;meta.fits", in->image, "detection image"},
        {"NImages", "int", NULL, "meta.number;obs.image", images, "images of it"},
        {"Catalog_Name", "char", NULL, "meta.dataset;meta.file", in->options->catalog_name,
         "catalogue, of each restorer with its name"},
        {"Detect_Thresh", "double", NULL, "stat.snr;obs.image", thresh,
         "DETECT_THRESH in sigmas, or ADU where THRESH_TYPE says so"},
    };
    rx_table *tables[2] = {NULL, NULL};
    rx_text text = {0};
    rx_status status;
    snprintf(images, sizeof images, "%d", in->facts->n);
    snprintf(thresh, sizeof thresh, "%.9g", in->options->pipeline.detect.threshold);
    RX_TRY_EXIT(images_table(in->facts, &tables[0], err));
    RX_TRY_EXIT(warnings_table(in->warnings, &tables[1], err));
    RX_TRY_EXIT(
        rx_votable_run_text(params, sizeof params / sizeof *params, tables, 2, in->record, &text, err));
    status = rx_text_write_file(&text, temporary, shown, err);
exit:
    rx_text_free(&text);
    rx_table_free(tables[0]);
    rx_table_free(tables[1]);
    return status;
}
