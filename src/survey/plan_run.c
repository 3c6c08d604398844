/* Plans as JSON. */
#include "survey/plan_run.h"

#include <math.h>

#include "base/interrupt.h"
#include "config/config_fields.h"
#include "config/tiles.h"
#include "report/json.h"
#include "stage/plan.h"

/* A record of a tile, survey/tile_record.h: its counts in bins of magnitude for every restorer. */
static const double RECORD_BYTES = 65536;

typedef struct totals {
    long tiles, failed;
    double memory, cpu_seconds, outputs;
} totals;

static void add_error(rx_json *json, const char *image, const rx_error *why)
{
    char line[RX_ERROR_WHERE + RX_ERROR_TEXT + 128];
    rx_error_format(why, "rextract", line, sizeof line);
    rx_json_object(json, NULL, false);
    rx_json_string(json, "image", image);
    rx_json_string(json, "error", line);
    rx_json_end(json);
}

static void add_plan(rx_json *json, const char *image, const rx_config *config, const rx_plan *plan,
                     totals *all)
{
    const int record = config->record_name[0] != '\0';
    double bytes = record ? RECORD_BYTES : 0;
    for (int i = 0; i < plan->noutputs; i++)
        bytes += (double)plan->outputs[i].bytes;
    rx_json_object(json, NULL, false);
    rx_json_string(json, "image", image);
    rx_json_count(json, "images", (uint64_t)plan->images);
    rx_json_count(json, "pixels", (uint64_t)plan->pixels);
    rx_json_number(json, "sources_per_mpixel", config->plan_density);
    rx_json_count(json, "sources", (uint64_t)plan->sources);
    rx_json_count(json, "threads", (uint64_t)plan->threads);
    rx_json_count(json, "memory_bytes", (uint64_t)plan->memory);
    rx_json_number(json, "cpu_seconds", plan->cpu_seconds);
    rx_json_count(json, "output_bytes", (uint64_t)bytes);
    rx_json_array(json, "outputs", false);
    for (int i = 0; i < plan->noutputs + record; i++) {
        rx_json_object(json, NULL, true);
        rx_json_string(json, "name", i < plan->noutputs ? plan->outputs[i].name : config->record_name);
        rx_json_count(json, "bytes", i < plan->noutputs ? plan->outputs[i].bytes : (uint64_t)RECORD_BYTES);
        rx_json_end(json);
    }
    rx_json_end(json);
    rx_json_end(json);
    all->memory = fmax(all->memory, plan->memory);
    all->cpu_seconds += plan->cpu_seconds;
    all->outputs += bytes;
}

static rx_status plan_tile(rx_json *json, const rx_settings *settings, const char *image, rx_log *log,
                           totals *all, rx_error *err)
{
    const rx_config *config = (const rx_config *)settings;
    rx_plan *plan = NULL;
    RX_TRY(rx_plan_make(config, image, log, &plan, err));
    all->tiles++;
    add_plan(json, image, config, plan, all);
    rx_plan_free(plan);
    return RX_OK;
}

static rx_status plan_list(rx_json *json, const rx_settings *common, const char *path, rx_log *log,
                           totals *all, rx_error *err)
{
    rx_tiles *tiles = NULL;
    rx_status status = rx_tiles_read(path, &tiles, err);
    if (status == RX_OK)
        status = rx_tiles_check(tiles, common, NULL, log, err);
    for (int i = 0; status == RX_OK && i < tiles->n; i++) {
        rx_settings *settings = NULL;
        rx_error why = rx_error_part(err);
        const char *image = rx_tiles_image(tiles, i);
        status = rx_tiles_settings(tiles, i, common, log, &settings, err);
        if (status == RX_OK && plan_tile(json, settings, image, log, all, &why) != RX_OK) {
            add_error(json, image, &why);
            all->tiles++;
            all->failed++;
        }
        rx_settings_free(settings);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
    }
    rx_tiles_free(tiles);
    return status;
}

static void add_totals(rx_json *json, const totals *all)
{
    rx_json_object(json, "all", false);
    rx_json_count(json, "tiles", (uint64_t)all->tiles);
    rx_json_count(json, "failed", (uint64_t)all->failed);
    rx_json_count(json, "memory_bytes", (uint64_t)all->memory);
    rx_json_number(json, "cpu_seconds", all->cpu_seconds);
    rx_json_count(json, "output_bytes", (uint64_t)all->outputs);
    rx_json_end(json);
}

rx_status rx_plan_run(const rx_settings *settings, const char *image, FILE *standard_out, rx_log *log,
                      rx_error *err)
{
    rx_text text = {0};
    rx_json json = rx_json_on(&text);
    totals all = {0};
    rx_json_object(&json, NULL, false);
    rx_json_string(&json, "version", RX_VERSION);
    rx_json_array(&json, "tiles", false);
    rx_status status = image[0] == '@' ? plan_list(&json, settings, image + 1, log, &all, err)
                                       : plan_tile(&json, settings, image, log, &all, err);
    rx_json_end(&json);
    add_totals(&json, &all);
    rx_json_end(&json);
    if (status == RX_OK && text.failed)
        status = rx_error_memory(err, text.capacity);
    if (status == RX_OK && (fputs(text.data, standard_out), !rx_stream_end(standard_out)))
        status = rx_error_set(err, RX_SYSTEM, "standard output cannot be written");
    if (status == RX_OK && all.failed > 0)
        status = rx_error_set(err, RX_SOME_FAILED, "%s: %ld of %ld tiles cannot be planned", image + 1,
                              all.failed, all.tiles);
    rx_text_free(&text);
    return status;
}
