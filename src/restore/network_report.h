/* How fast the restorer NET was, against what the machine convolves at most (nn/peak.h). */
#ifndef RX_RESTORE_NETWORK_REPORT_H
#define RX_RESTORE_NETWORK_REPORT_H

#include "restore/network_forward.h"

/* Wall time of the parts of a restoration, seconds. */
typedef struct rx_network_times {
    double network, tikhonov, steps, rest;
} rx_network_times;

/* Lines for VERBOSE_TYPE FULL, one per node of the network and one for all. Seconds of a node are summed over
 * threads, its share is that of one thread's peak; the network's work is what its output pixels need, halo
 * not counted, and its share that of the peak of all threads. Convolutions by Winograd's algorithm count as
 * direct ones, and may exceed the peak. */
void rx_network_report(const rx_network_forward *forward, const rx_network_times *times, rx_log *log);

#endif
