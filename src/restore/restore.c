/* The table of restorers, from the rows of data/restorers.h. */
#include "restore/restore.h"

#include <stddef.h>
#include <string.h>
#include <strings.h>

#include "restore/runs.h"

/* clang-format off */
#define RESTORER(name, run, traits, cost, help) {#name, help, traits, run},
static const rx_restorer restorers[] = {RX_RESTORERS(RESTORER)};
#undef RESTORER
/* clang-format on */

enum { NRESTORERS = sizeof restorers / sizeof *restorers };

_Static_assert((int)NRESTORERS <= (int)RX_MAX_RUNS, "a run can take all of them");

const rx_restorer *rx_restorers(int *n)
{
    *n = NRESTORERS;
    return restorers;
}

int rx_restorer_is_auto(const rx_restorer *kind)
{
    return kind->run == rx_auto_run;
}

/* The choice needs injections, which are no business of this folder. */
rx_status rx_auto_run(const rx_restore_params *par, const rx_image *image, rx_log *log, rx_restored **dst,
                      rx_error *err)
{
    (void)par;
    (void)log;
    *dst = NULL;
    return rx_error_at(err, RX_USAGE, image->name, image->hdu, 0,
                       "RESTORE_TYPE AUTO is not chosen here; name the restorer, or take rextract, "
                       "rx_job_arrays() or rx_job_files()");
}

int rx_restorer_must_have_psf(const rx_restorer *kind, const rx_restore_params *par)
{
    return (kind->traits & RX_TRAIT_PSF) != 0 &&
           !((kind->traits & RX_TRAIT_TRAINED) != 0 && par->model != NULL &&
             par->model->front.mode == RX_MODE_BLIND);
}

const rx_restorer *rx_restorer_find(const char *name)
{
    for (int i = 0; i < NRESTORERS; i++)
        if (strcasecmp(name, restorers[i].name) == 0)
            return &restorers[i];
    return NULL;
}
