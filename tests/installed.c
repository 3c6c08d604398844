/* What a stranger's program looks like: made against the installed headers and library by `make
 * installcheck`. */
#include <stdio.h>

#include "config/config.h"
#include "stage/stage.h"

int main(void)
{
    rx_error err = RX_ERROR_NONE;
    rx_config *config = NULL;
    rx_status status = rx_config_new(&config, &err);
    if (status == RX_OK)
        status = rx_stage_run(config, "there-is-no-such.fits", stdout, NULL, NULL, &err);
    rx_config_free(config);
    printf("installed library: status %d, %s\n", (int)status, err.text);
    return status == RX_INPUT ? 0 : 1;
}
