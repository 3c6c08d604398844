/* The table of restorers. A new kind is one more row: its name as users give it in RESTORE_TYPE, one line of
 * help, whether it needs the tile's PSF, and its function. */
#include "restore/restore.h"

#include <stddef.h>
#include <string.h>
#include <strings.h>

#include "restore/network.h"
#include "restore/none.h"
#include "restore/richardson_lucy.h"
#include "restore/rl_blind.h"

static const rx_restorer restorers[] = {
    {"NONE", "the tile as it is, background subtracted", 0, rx_none_run},
    {"RL", "Richardson-Lucy with the given PSF", 1, rx_rl_run},
    {"RL_BLIND", "Richardson-Lucy that improves the PSF as well", 1, rx_rl_blind_run},
    {"NET", "a trained network", 1, rx_network_run},
};

enum { NRESTORERS = sizeof restorers / sizeof *restorers };

const rx_restorer *rx_restorers(int *n)
{
    *n = NRESTORERS;
    return restorers;
}

int rx_restorer_must_have_psf(const rx_restorer *kind, const rx_restore_params *par)
{
    return kind->needs_psf &&
           !(strcmp(kind->name, "NET") == 0 && par->model != NULL && par->model->front.mode == RX_MODE_BLIND);
}

const rx_restorer *rx_restorer_find(const char *name)
{
    for (int i = 0; i < NRESTORERS; i++)
        if (strcasecmp(name, restorers[i].name) == 0)
            return &restorers[i];
    return NULL;
}
