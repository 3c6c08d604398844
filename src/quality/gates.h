/* Quality gates: what a .qa file asks, and the verdict on an estimate. */
#ifndef RX_QUALITY_GATES_H
#define RX_QUALITY_GATES_H

#include "quality/metrics.h"
#include "quality/qa.h"

typedef enum rx_gate_operator { RX_GATE_GE, RX_GATE_GT, RX_GATE_LE, RX_GATE_LT, RX_GATE_IN } rx_gate_operator;

typedef struct rx_gate {
    long line;  /* in the file */
    char *text; /* the line without comment, for the report */
    char *run;  /* name of the run, "*" = each */
    rx_metric metric;
    int whole;        /* bin "all" */
    double low, high; /* else this range of magnitude */
    rx_gate_operator op;
    const char *op_name;
    double value, value_high; /* value_high: upper end for RX_GATE_IN */
    double level;
} rx_gate;

struct rx_gates {
    char *path;
    long n;
    rx_gate *gate;
};

/* PASS when the whole interval satisfies the gate, FAIL when the whole interval violates it, else
 * INSUFFICIENT; so it is for an estimate without sources. */
rx_verdict rx_gate_judge(const rx_gate *gate, const rx_estimate *estimate);

#endif
