/* The laboratory: experiments whose truth is known. There are two kinds of them, restored images against the true one,
 * and sources against the true ones; the kinds of campaign are entries: RESTORATION of the first, DETECTION and
 * PHOTOMETRY of the second.
 *
 *   scenes x conditions x runs -> units of work -> tables with named columns -> sets -> rows, numbers, pages
 *
 * A unit is one tile of a scene under a condition, through every run (a restorer and its settings). It depends on
 * nothing but its place, the settings, and, where a campaign tunes, on units of the first scene. A set holds the
 * tables of all units of one scene and condition. What a campaign leaves is rows (report.h); its page has the paper's
 * numbers, and tests between runs, claims and goals are made from rows by scripts (validation/contests.py). */
#ifndef RX_LAB_LAB_H
#define RX_LAB_LAB_H

#include <stdint.h>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "config/config_fields.h"
#include "lab/journal.h"
#include "pipeline/pipeline.h"
#include "quality/qa.h"
#include "restore/restore.h"
#include "stage/options.h"
#include "stage/simulation.h"

enum { RX_LAB_RUNS = 48, RX_LAB_TABLES = 6, RX_METHODS_MAX = 16, RX_METHOD_NAME = 24, RX_PRECISIONS_MAX = 8 };

/* --- what a unit measures --- */

/* Tables whose columns have names. A row is a thing (an object, a tile, a false detection): first its own columns, then
 * those that every run has in turn. The columns of a table are declared once, by a list of X(identifier, name, unit, text),
 * of which the identifiers and the names are made; the journal's header holds the names, so that numbers of other columns
 * are never read as these. */
typedef struct rx_lab_column {
    const char *name, *unit, *help;
} rx_lab_column;
#define RX_LAB_RUN "run" /* a table's own column of that name holds the number of a run */
#define RX_LAB_ID(id, name, unit, help) id,
#define RX_LAB_COLUMN(id, name, unit, help) {name, unit, help},

typedef struct rx_lab_schema {
    const char *name;
    int nown, neach;
    const rx_lab_column *own, *each;
    int exact; /* 1: doubles; 0: floats, which nine digits of the journal hold */
} rx_lab_schema;

typedef struct rx_lab_table {
    const rx_lab_schema *schema;
    int nruns, width; /* width = nown + nruns neach */
    long n, capacity; /* rows */
    double *v;        /* [n][width]; owned */
} rx_lab_table;

/* n more rows of zeros, the first one at *first. Rows move when more are added. Errors: RX_SYSTEM. */
rx_status rx_lab_rows_add(rx_lab_table *table, long n, double **first, rx_error *err);

/* Columns of row i: its own, and those of a run. */
static inline double *rx_lab_own(const rx_lab_table *table, long i)
{
    return table->v + i * table->width;
}

static inline double *rx_lab_each(const rx_lab_table *table, long i, int run)
{
    return table->v + i * table->width + table->schema->nown + run * table->schema->neach;
}

/* --- conditions: sky.c --- */

/* Under which tiles are made, and what their restorers are given of them: the seeing, and an error in one of PSF (wider by
 * this share), sky (so much of it is left in the image, in sigmas of its noise) and noise (higher by this share). */
typedef enum rx_given { RX_GIVEN_PSF, RX_GIVEN_SKY, RX_GIVEN_NOISE } rx_given;
typedef struct rx_condition {
    double fwhm; /* of the PSF, pixels; 0: SIM.PSF_FWHM */
    rx_given of;
    double error; /* 0: restorers are given the truth */
} rx_condition;

/* Sky and noise of a prepared field become those that restorers are given. */
void rx_condition_apply(const rx_condition *condition, rx_field *field);

/* --- what a campaign is made of --- */

/* A column of every report: a restorer with its settings. */
typedef struct rx_lab_run {
    char name[RX_METHOD_NAME]; /* NONE, MATCHED, NET, "RL 20 0.5", "NET TEMPLATE" */
    const rx_restorer *restorer;
    int matched;   /* DETECTION: detection filter of the PSF's width */
    int templates; /* PHOTOMETRY: fluxes of template photometry */
    int tuned;     /* RL; DETECTION: with what follows; RESTORATION: as chosen bin by bin, NET_FLAT too */
    int niter;     /* iterations */
    double filter; /* FWHM of the Gaussian afterwards, units of the PSF's */
    int method;    /* RESTORATION: how it is tuned */
} rx_lab_run;

typedef enum rx_scene_id {
    RX_SCENE_STARS,
    RX_SCENE_GALAXIES,
    RX_SCENE_PAIRS,     /* of stars, much alike */
    RX_SCENE_MAGNITUDE, /* PHOTOMETRY: stars of one magnitude */
    RX_SCENE_TUNING,    /* RESTORATION: scenes that methods are tuned on */
    RX_SCENE_TEST       /* RESTORATION: the others */
} rx_scene_id;

typedef struct rx_lab_scene {
    rx_scene_id id;
    int number; /* of its random numbers */
    double mag; /* MAGNITUDE */
    char name[32];
    const char *about; /* DETECTION */
} rx_lab_scene;

/* Objects of a tile and their roles in a match: sources.h. */
typedef enum rx_truth_role { RX_LISTED, RX_RIVAL, RX_OTHER } rx_truth_role;

/* One object that is really there. Pixels from 0, ADU. */
typedef struct rx_lab_object {
    double x, y, flux;
    double snr;   /* in a matched filter on the bare sky: lab.h */
    double reach; /* 0: none */
    rx_truth_role role;
} rx_lab_object;

typedef struct rx_lab_objects {
    long n;
    rx_lab_object *list; /* owned */
    int width, height;
    const unsigned char
        *covered; /* [height][width], 1: belongs to what was there before; NULL: no such map */
} rx_lab_objects;

/* What the tiles of a condition share: a simulation, or a real tile that objects are added to. Of a campaign of
 * restored images the first one is that of all bins. */
typedef struct rx_lab_sky {
    char
        name[64]; /* "FWHM 4, PSF +5 %"; of PHOTOMETRY "simulated" without SEEING and errors, or the tile's */
    char about[600];           /* PHOTOMETRY: of the field */
    rx_condition condition;    /* a real tile: all zero */
    rx_simulation *simulation; /* NULL: PHOTOMETRY on a real tile; owned */
    rx_field *field;           /* the untouched real tile, NULL: none; owned */
    rx_psf *psf;               /* the true one on the pixels; owned */
    rx_psf *given;             /* the one that restorers are given, NULL: the stage finds it; owned */
    int width, height;
    double fwhm, power, area; /* of the true PSF: pixels, sum of PSF^2 over pixels, 1 / power */
    double sigma;             /* noise of the sky, ADU */
    float *kernel;            /* a Gaussian of the PSF's FWHM, [side][side]; owned */
    int side;
    rx_optics *optics;          /* real tile, PHOTOMETRY: its PSF; owned */
    unsigned char *allowed;     /* and where stars may lie; owned */
    unsigned char *covered;     /* and what detections of the untouched tile cover; owned */
    rx_lab_objects known;       /* and these detections */
    rx_noise_correlation noise; /* and its noise without sources */
} rx_lab_sky;

/* RESTORATION: the condition of its sets. Its scenes' quantities are uniform in these ranges. */
typedef struct rx_lab_bin {
    int by_sigma; /* 0: FWHM (pixels), 1: the noise's sigma (brightest pixel of the sharp scene: SCENE_PEAK) */
    double low, high; /* of the binned quantity */
    double other_low, other_high;
    long nscenes;
} rx_lab_bin;

typedef struct rx_lab_tuned {
    char setting[160]; /* "RL_NITER 20, filter 0.8 FWHM"; "": not tuned */
    int at_end;        /* 1: it lies at an end of what was tried, beyond which better ones may be */
} rx_lab_tuned;

typedef struct rx_lab_unit {
    int condition, scene;
    long number; /* of the tile, from 0 in its set */
} rx_lab_unit;

typedef struct rx_lab rx_lab;
struct rx_lab_page;

/* One tile and what is on it. */
typedef struct rx_lab_tile {
    rx_field *field, *blank; /* blank: PHOTOMETRY on a real tile, its noise and nothing else; owned */
    rx_lab_objects objects;
} rx_lab_tile;

/* An entry of the table of campaigns. */
typedef struct rx_lab_kind {
    const char *name, *title; /* as in CAMPAIGN_TYPE; of the report */
    uint64_t tag;             /* of its random numbers */
    int most;                 /* runs */
    int ntables;
    const rx_lab_schema *tables;
    int by_width; /* DETECTION: skies have their FWHM in their names, and NET_DEPTH counts */
    int in_turns; /* units of the first scene come before the others of their condition, in one shard */
    rx_status (*open)(rx_lab *lab, rx_log *log, rx_error *err); /* runs, scenes, conditions, skies */
    /* Before the first unit, what a report alone does not need; may be NULL. */
    rx_status (*prepare)(rx_lab *lab, rx_log *log, rx_error *err);
    rx_status (*tile)(const rx_lab *lab, const rx_lab_unit *unit, rx_lab_tile *dst,
                      rx_error *err); /* of sources against the true ones (sources.h) */
    /* The tables of one unit, on one thread; several at the same time. done: values of earlier units. */
    rx_status (*unit)(const rx_lab *lab, const rx_lab_unit *unit, const rx_unit_values *done,
                      rx_lab_table *dst, rx_error *err);
    /* Words and numbers of the report that are no table's; the sets are there. */
    rx_status (*describe)(rx_lab *lab, rx_error *err);
    /* Its scene and its condition, as rows and tables name them. */
    void (*name_set)(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96]);
    rx_status (*report)(struct rx_lab_page *page, rx_error *err);
    const char *reading; /* HTML: how to read the page */
} rx_lab_kind;

struct rx_lab {
    const rx_lab_kind *kind;
    const rx_campaign_config *config; /* not owned */
    rx_config *stage;                 /* owned, under the options */
    rx_options *options;              /* everything on one thread; owned */
    int nthreads;                     /* before the units begin */
    int nruns;
    rx_lab_run run[RX_LAB_RUNS];
    int nconditions, nskies; /* nskies: nconditions, or 1 of RESTORATION */
    rx_lab_sky *sky;         /* owned */
    rx_lab_bin *bin;         /* [nconditions] of RESTORATION, else NULL; owned */
    int nscenes;
    rx_lab_scene *scene; /* owned */
    long ntiles;         /* of a set, where bins do not say it */
    int tunes;           /* RESTORATION: RL takes part, which is tuned */
    long nunits;
    rx_lab_unit *unit; /* [nunits] by condition, scene and tile; owned */
    /* when the units are done */
    rx_lab_table (*set)[RX_LAB_TABLES]; /* [nconditions][nscenes] of all units of each; owned */
    int nprecisions;                    /* at which completeness is compared, as PRECISIONS */
    double precision[RX_PRECISIONS_MAX];
    char about[600];
    const rx_unit_values *values; /* of all units; not owned */
    rx_lab_tuned *tuned;          /* RESTORATION: [nconditions][nruns]; owned */
    double fwhm_trained[2];       /* of the network's model, without one of the keyword */
    double level_trained[2];      /* noise levels (nn/noise_level.h) of the model's fields; 0, 0 = no model */
};

#define RX_LAB_KIND(kind, ...) const rx_lab_kind kind = {__VA_ARGS__}
extern const rx_lab_kind rx_kind_restoration, rx_kind_photometry, rx_kind_detection;

/* Errors: RX_USAGE (settings that give nothing), those of files they name. */
rx_status rx_lab_open(const rx_lab_kind *kind, const rx_campaign_config *config, int nthreads, rx_log *log,
                      rx_lab **dst, rx_error *err);
void rx_lab_close(rx_lab *lab); /* NULL is fine */

/* For open(): */
/* Of the restorer of that word, whose name it has where it comes without one. */
rx_status rx_lab_add_run(rx_lab *lab, const char *word, rx_lab_run run, rx_error *err);
long rx_lab_size(const rx_lab *lab, const rx_ints *list); /* as SIZE says: the first number, or the last */
rx_status rx_lab_add_scene(rx_lab *lab, rx_lab_scene scene, rx_error *err);

/* A unit as journals keep it: of each table the number of rows, then the rows. */
rx_status rx_lab_do_unit(const rx_lab *lab, long unit, const rx_unit_values *done, rx_unit_values *dst,
                         rx_error *err);
/* Table t of a unit, whose values it shows; n -1: these are no values of such tables. */
rx_lab_table rx_lab_unit_table(const rx_lab *lab, const rx_unit_values *unit, int t);

/* Sets from the values of all units. Errors: RX_INPUT (values of other tables), RX_SYSTEM. */
rx_status rx_lab_collect(rx_lab *lab, const rx_unit_values *all, rx_error *err);
rx_lab_table *rx_lab_tables_of(const rx_lab *lab, int condition, int scene); /* of a set */

/* The seed of random numbers for a purpose: their streams never meet. */
uint64_t rx_lab_seed(const rx_lab *lab, uint64_t purpose);

/* The options of the stage for a run on a sky; they point into both. */
rx_options rx_lab_options(const rx_lab *lab, const rx_lab_sky *sky, const rx_lab_run *run);

/* --- skies: sky.c --- */

/* A further simulated one, of the SIM. keywords, of which one (or none: NULL) has another value, on one thread. */
rx_status rx_lab_sky_add(rx_lab *lab, const char *keyword, double value, rx_log *log, rx_lab_sky **sky,
                         rx_error *err);
/* A simulated one for each condition: for each number of SEEING (none: one of the simulator's own FWHM) the truth first,
 * then one for every number but 0 of PSF_ERROR, SKY_ERROR and NOISE_ERROR. find: the stage measures its PSF. Errors:
 * RX_USAGE (no Moffat whose FWHM could be set, a PSF that is found and given wrongly). */
rx_status rx_lab_skies_simulate(rx_lab *lab, int find, rx_log *log, rx_error *err);
/* TILE_NAME with a PSF of its own, as a further one. */
rx_status rx_lab_sky_read(rx_lab *lab, rx_log *log, rx_lab_sky **sky, rx_error *err);
void rx_lab_sky_close(rx_lab_sky *sky); /* content only */

/* Pixels from a place beyond the border of a tile to the nearest one on it; 0 inside. */
double rx_lab_beyond(const rx_lab_sky *sky, double x, double y);

#endif
