/* The speed of a network, layer by layer. */
#include "restore/network_report.h"

#include "nn/peak.h"

static double per(double amount, double seconds)
{
    return seconds > 0 ? amount / seconds : 0;
}

static void report_node(const rx_net *net, int i, const rx_stream_cost *cost, double peak, rx_log *log)
{
    const rx_node *n = &net->node[i];
    const double speed = per(cost->flops, cost->seconds);
    rx_log_detail(log, "NET: layer %d %s %dx%d %d->%d: %.4f s, %.1f GFLOP/s, %.1f %% of peak", i,
                  rx_op_name(n->op), n->kernel, n->kernel, net->node[n->src].channels, n->channels,
                  cost->seconds, 1e-9 * speed, 100 * per(speed, peak));
}

void rx_network_report(const rx_network_forward *f, const rx_network_times *times, rx_log *log)
{
    const rx_net *net = f->model->restore;
    double peak = 0;
    if (rx_peak_measure(f->precision == RX_BF16 ? RX_REAL_BF16 : RX_REAL_F32, &peak, NULL) != RX_OK)
        return;
    for (int i = 1; i < net->nnodes; i++)
        report_node(net, i, &f->cost[i], peak, log);
    const double speed = per(2 * rx_net_macs(net) * f->width * (double)f->height, times->network);
    rx_log_detail(log,
                  "NET: network %.4f s, %.1f GFLOP/s, %.1f %% of peak; Tikhonov %.4f s, steps %.4f s, rest "
                  "%.4f s",
                  times->network, 1e-9 * speed, 100 * per(speed, peak * f->nthreads), times->tikhonov,
                  times->steps, times->rest);
}
