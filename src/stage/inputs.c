/* The files behind a run. */
#include "stage/inputs.h"

#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "config/config_fields.h"

void rx_input_model(const char *name, const char *installed, rx_text *dst)
{
    if (strchr(name, '/') == NULL) {
        rx_text_printf(dst, "%s/%s", installed, name);
        if (dst->failed || access(dst->data, F_OK) == 0)
            return;
        rx_text_free(dst);
    }
    rx_text_add(dst, name);
}

rx_status rx_input_digest(const char *key, const char *name, char dst[RX_HASH_TEXT], int *there,
                          rx_error *err)
{
    struct stat info;
    rx_text path = {0};
    int regular = 0;
    if (strcmp(key, "NET_MODEL") == 0)
        rx_input_model(name, RX_DATA_FOLDER, &path);
    else
        rx_text_add(&path, name);
    if (path.failed)
        return rx_error_memory(err, 0);
    *there = stat(path.data, &info) == 0;
    if (!*there) {
        path.data[strcspn(path.data, "[")] = '\0';
        *there = stat(path.data, &info) == 0;
    }
    rx_status status = *there ? rx_hash_file(path.data, dst, &regular, err) : RX_OK;
    if (!regular)
        strcpy(dst, "-");
    rx_text_free(&path);
    return status;
}

typedef struct reading {
    rx_input_visitor visit;
    void *user;
    int digests;
    rx_status status;
    rx_error *err;
} reading;

static void take(reading *r, const char *key, const char *name)
{
    char digest[RX_HASH_TEXT];
    int there = 0;
    if (r->status != RX_OK || name == NULL || name[0] == '\0')
        return;
    if (!r->digests) {
        r->visit(r->user, key, name, NULL);
        return;
    }
    r->status = rx_input_digest(key, name, digest, &there, r->err);
    if (r->status == RX_OK && there)
        r->visit(r->user, key, name, digest);
}

rx_status rx_inputs_visit(const rx_config *config, const rx_options *options, const char *const images[2],
                          int digests, rx_input_visitor visit, void *user, rx_error *err)
{
    reading r = {.visit = visit, .user = user, .digests = digests, .err = err};
    const int nroles = images[1] != NULL ? 2 : 1;
    const int psf_file =
        options->pipeline.psf.type == RX_PSF_FILE || options->pipeline.psf.type == RX_PSF_PSFEX;
    take(&r, "IMAGE", images[0]);
    take(&r, "IMAGE", images[1]);
    if (options->model != NULL)
        take(&r, "NET_MODEL", options->model_name);
    for (int role = 0; role < nroles; role++) {
        if (psf_file && (role == 0 || options->pipeline.psf_files[1] != options->pipeline.psf_files[0]))
            take(&r, "PSF_NAME", options->pipeline.psf_files[role]);
        if (role == 0 && options->pipeline.psf.type == RX_PSF_AUTO)
            take(&r, "PSF_STARS_NAME", options->pipeline.psf.stars_file);
        if (role == 0 || options->tile[1].weight_name != options->tile[0].weight_name)
            take(&r, "WEIGHT_IMAGE", options->tile[role].weight_name);
    }
    for (int i = 0; i < options->tile[0].nflags; i++)
        take(&r, "FLAG_IMAGE", options->tile[0].flag_names[i]);
    take(&r, "PARAMETERS_NAME", config->parameters_name);
    if (config->noise_kernel_name[0] != '\0' && strcmp(config->noise_correlation, "FILE") == 0)
        take(&r, "NOISE_KERNEL_NAME", config->noise_kernel_name);
    if (config->filter)
        take(&r, "FILTER_NAME", config->filter_name);
    if (options->star_net != NULL)
        take(&r, "STARNNW_NAME", config->starnnw_name);
    if (options->assoc_list != NULL)
        take(&r, "ASSOC_NAME", config->assoc_name);
    take(&r, "REFERENCE_NAME", config->reference_name);
    if (config->reference_name[0] != '\0')
        take(&r, "QA_GATES", config->qa_gates);
    return r.status;
}
