/* What twins.py needs of the trainer, as files of plain 32-bit floats; settings are those of rextract-train, and TWINS_DO is one of
 *
 *   images   TWINS_OUT: FIELDS fields of each bin, all places and uses of each, one record an image: bin, FWHM as given, 14 that
 *            are 0, x, w, y and the blurred plane [side][side], K' [63][63] (train/sample.h). TEST=1: test images
 *   first    TWINS_OUT.restore, .psf: the networks that a training begins with, parameters as in nn/net.h
 *   loss     of image AT of the file TWINS_IN: terms on standard output, gradients to TWINS_OUT.restore and .psf
 *   model    TWINS_OUT: a model file of the parameters TWINS_IN.restore and .second, after IMAGES training images
 *
 * twins.sh builds it with the objects of build/. What goes wrong ends it. */
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "config/config_fields.h"
#include "programs/program.h"
#include "train/samples.h"
#include "train/setup.h"
#include "train/step.h"

enum { META = 16, KERNEL = RX_SAMPLE_KERNEL * RX_SAMPLE_KERNEL, NAME = 1024 };

static void must(int fine, const char *what)
{
    if (fine)
        return;
    fprintf(stderr, "twins: %s\n", what);
    exit(4);
}

static const char *word(const char *name)
{
    const char *value = getenv(name);
    must(value != NULL, name);
    return value;
}

static long count(const char *name, long normal)
{
    const char *value = getenv(name);
    return value != NULL ? atol(value) : normal;
}

static FILE *opened(const char *name, const char *suffix, const char *how)
{
    char path[NAME];
    snprintf(path, sizeof path, "%s%s", name, suffix);
    FILE *file = fopen(path, how);
    must(file != NULL, path);
    return file;
}

static void write_floats(FILE *file, const float *v, size_t n)
{
    must(fwrite(v, sizeof *v, n, file) == n, "cannot write");
}

static void read_floats(FILE *file, float *v, size_t n)
{
    must(fread(v, sizeof *v, n, file) == n, "an input ends early");
}

static void write_all(const char *suffix, const float *v, long n)
{
    FILE *file = opened(word("TWINS_OUT"), suffix, "wb");
    write_floats(file, v, (size_t)n);
    must(fclose(file) == 0, "cannot write");
}

static long record_bytes(int side)
{
    return (long)sizeof(float) * (META + 4L * side * side + KERNEL);
}

static void write_sample(FILE *file, const rx_sample *s)
{
    const size_t pixels = (size_t)s->side * (size_t)s->side;
    const float meta[META] = {(float)s->id.bin, s->fwhm};
    write_floats(file, meta, META);
    write_floats(file, s->x, pixels);
    write_floats(file, s->w, pixels);
    write_floats(file, s->y, pixels);
    write_floats(file, s->blurred, pixels);
    write_floats(file, s->kernel, KERNEL);
}

/* All images of one field, which the thread's samples render once. */
static rx_status write_field(rx_samples *samples, const rx_train_config *c, const rx_selection *grid,
                             int field, int test, FILE *file, rx_error *err)
{
    enum { MOST = 64 * 64 };
    const int places = c->field_patches * c->field_patches, of_epoch = grid->total / places,
              uses = test ? 1 : c->field_uses;
    const int bin = field % grid->nbins, number = field / grid->nbins;
    rx_sample_id id[MOST];
    rx_sample *made[MOST];
    for (int use = 0; use < uses; use++) {
        for (int place = 0; place < places; place++)
            id[place] = (rx_sample_id){(uint32_t)(number / of_epoch * c->field_uses + use),
                                       test ? RX_SET_TEST : RX_SET_TRAIN, (uint32_t)bin,
                                       (uint32_t)(number % of_epoch * places + place)};
        RX_TRY(rx_samples_make(samples, id, places, made, err));
        for (int place = 0; place < places; place++) {
            write_sample(file, made[place]);
            rx_sample_free(made[place]);
        }
    }
    return RX_OK;
}

static rx_status images(const rx_train_config *c, rx_error *err)
{
    rx_selection grid;
    RX_TRY(rx_setup_selection(c, &grid, err));
    const rx_samples_params par = rx_setup_feed(c, &grid).samples;
    const int test = (int)count("TEST", 0), fields = (int)count("FIELDS", 1) * grid.nbins;
    const long each =
        (long)(test ? 1 : c->field_uses) * c->field_patches * c->field_patches * record_bytes(c->patch);
    fclose(opened(word("TWINS_OUT"), "", "wb"));
#pragma omp parallel num_threads(c->nthreads)
    {
        rx_error mine = RX_ERROR_NONE;
        rx_samples *samples = NULL;
        FILE *file = opened(word("TWINS_OUT"), "", "r+b");
        omp_set_num_threads(1);
        must(rx_samples_new(&par, &grid, c->sim, 1, NULL, &samples, &mine) == RX_OK, mine.text);
#pragma omp for schedule(dynamic, 1)
        for (int field = 0; field < fields; field++) {
            must(fseek(file, field * each, SEEK_SET) == 0, "cannot write");
            must(write_field(samples, c, &grid, field, test, file, &mine) == RX_OK, mine.text);
        }
        must(fclose(file) == 0, "cannot write");
        rx_samples_free(samples);
    }
    return RX_OK;
}

static rx_status loss(const rx_train_config *c, rx_model *model, rx_error *err)
{
    const rx_step_params par = rx_setup_step(c);
    const size_t pixels = (size_t)c->patch * (size_t)c->patch;
    rx_sample *s = rx_sample_new(c->patch);
    FILE *file = opened(word("TWINS_IN"), "", "rb");
    float meta[META], *planes[] = {s->x, s->w, s->y, s->blurred};
    rx_step *step = NULL;
    rx_step_values v;
    must(fseek(file, count("AT", 0) * record_bytes(c->patch), SEEK_SET) == 0, "no such image");
    read_floats(file, meta, META);
    for (int i = 0; i < 4; i++)
        read_floats(file, planes[i], pixels);
    read_floats(file, s->kernel, KERNEL);
    s->fwhm = meta[1];
    RX_TRY(rx_step_new(model, &par, c->patch, &step, err));
    rx_step_load(step);
    float *gradient[RX_MODEL_NETS] = {NULL};
    gradient[RX_NET_RESTORE] = calloc((size_t)model->restore->nparams, sizeof(float));
    if (model->psf != NULL)
        gradient[RX_NET_PSF] = calloc((size_t)model->psf->nparams, sizeof(float));
    RX_TRY(rx_step_run(step, s, gradient, &v, err));
    printf("%.8g %.8g %.8g %.8g %.8g %.8g\n", v.idt_restore, v.light, v.ffl, v.idt_psf, v.rec_restore,
           v.rec_psf);
    write_all(".restore", gradient[RX_NET_RESTORE], model->restore->nparams);
    if (model->psf != NULL)
        write_all(".psf", gradient[RX_NET_PSF], model->psf->nparams);
    return RX_OK;
}

static void read_network(rx_net *net, const char *suffix)
{
    FILE *file = opened(word("TWINS_IN"), suffix, "rb");
    read_floats(file, net->params, (size_t)net->nparams);
    must(fgetc(file) == EOF, "parameters of another network");
    fclose(file);
}

static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    const rx_train_config *config = (const rx_train_config *)settings;
    const char *what = word("TWINS_DO");
    rx_model *model = NULL;
    (void)image, (void)log;
    if (strcmp(what, "images") == 0)
        return images(config, err);
    RX_TRY(rx_setup_model(config, &model, err));
    if (strcmp(what, "loss") == 0)
        return loss(config, model, err);
    if (strcmp(what, "first") == 0) {
        write_all(".restore", model->restore->params, model->restore->nparams);
        if (model->psf != NULL)
            write_all(".psf", model->psf->params, model->psf->nparams);
        return RX_OK;
    }
    read_network(model->restore, ".restore");
    if (model->second != NULL)
        read_network(model->second, ".second");
    model->psf = NULL; /* only RESTORE is judged */
    model->ended = 1;
    model->epochs = model->best = 1;
    model->patches = count("IMAGES", 0);
    return rx_model_write(model, word("TWINS_OUT"), word("TWINS_OUT"), err);
}

int main(int argc, char **argv)
{
    const rx_program program = {.name = "twins",
                                .usage = "usage: see twins.sh\n",
                                .help = "\nSee twins.sh.\n",
                                .table = rx_keytable_train(),
                                .run = run};
    return rx_program_main(&program, argc, argv);
}
