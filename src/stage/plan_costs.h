/* The table of what steps take (plan_costs.def), in memory. For plan*.c alone. */
#ifndef RX_STAGE_PLAN_COSTS_H
#define RX_STAGE_PLAN_COSTS_H

#define COST(name, fixed, pixel, source, thread, mpixel_seconds, source_seconds) RX_COST_##name,
typedef enum rx_cost_name {
#include "stage/plan_costs.def"
    RX_NCOSTS
} rx_cost_name;
#undef COST

typedef struct rx_cost {
    double fixed, pixel, source, thread; /* bytes */
    double mpixel_seconds, source_seconds;
} rx_cost;

const rx_cost *rx_cost_of(rx_cost_name name);

#endif
