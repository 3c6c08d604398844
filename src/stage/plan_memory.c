/* Peak memory and CPU seconds of a run. */
#include <math.h>
#include <string.h>

#include "nn/stream.h"
#include "restore/richardson_lucy.h"
#include "stage/plan_costs.h"
#include "stage/plan_parts.h"

const rx_cost *rx_cost_of(rx_cost_name name)
{
#define COST(name, fixed, pixel, source, thread, mpixel_seconds, source_seconds)                             \
    [RX_COST_##name] = {fixed, pixel, source, thread, mpixel_seconds, source_seconds},
    static const rx_cost costs[RX_NCOSTS] = {
#include "stage/plan_costs.def"
    };
#undef COST
    return &costs[name];
}

/* --- memory --- */

/* One image while it is worked on. */
typedef struct load {
    const rx_plan_job *job;
    const rx_tile_shape *shape;
    double pixels, sources, threads; /* threads beyond the first */
    int terms;                       /* of the PSF; 1: it is the same everywhere */
} load;

/* Spectra of a PSF that varies, and the planes that its terms are summed in, on one domain of the Fourier
 * transforms. */
static double terms_memory(const load *l)
{
    const rx_cost *cost = rx_cost_of(RX_COST_PSF_TERM);
    const double domain = fmin(cost->fixed, cost->pixel * l->pixels);
    return l->terms > 1 ? (l->terms + 1 + 2 * l->threads) * domain : 0;
}

static double take(const load *l, rx_cost_name name)
{
    const rx_cost *cost = rx_cost_of(name);
    return cost->fixed + cost->pixel * l->pixels + cost->source * l->sources + cost->thread * l->threads;
}

static rx_cost_name cost_of_kind(const rx_restorer *kind)
{
    static const struct {
        const char *name;
        rx_cost_name cost;
    } kinds[] = {{"NONE", RX_COST_NONE}, {"RL", RX_COST_RL}, {"RL_BLIND", RX_COST_RL_BLIND}};
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++)
        if (strcmp(kind->name, kinds[i].name) == 0)
            return kinds[i].cost;
    return RX_COST_NET;
}

static int plain(const rx_restorer *kind)
{
    return cost_of_kind(kind) == RX_COST_NONE;
}

/* Of NET's threads: the network's planes and the Fourier transforms around it, in domains
 * (restore/network.c). */
static double network_scratch(const load *l)
{
    enum { DOMAIN_SIDE = 1024, LARGE = 2048, HALO = 100 };
    const double budget = 1073741824.0; /* restore/network_forward.c */
    const rx_restore_params *par = &l->job->options->restore;
    const int width = l->shape->width, height = l->shape->height;
    const int high = height > LARGE ? DOMAIN_SIDE : DOMAIN_SIDE / 2;
    const int block = width < par->net_block ? width : par->net_block;
    const double stream = rx_stream_bytes(par->model->restore, block, par->precision);
    const double domains = ceil((double)width / DOMAIN_SIDE) * ceil((double)height / high);
    const double area = (fmin(width, DOMAIN_SIDE) + HALO) * (fmin(height, high) + HALO);
    return fmax(stream, fmin(stream * (1 + l->threads), budget)) +
           fmin(1 + l->threads, domains) * area * rx_cost_of(RX_COST_NET_DOMAIN)->pixel;
}

/* Of a large tile data, weights and model are made again instead of being kept. */
static double richardson_lucy(const load *l)
{
    const rx_restore_params *par = &l->job->options->restore;
    const int whole = par->keep_reblurred || par->rl_stop_discrepancy;
    double bytes = take(l, RX_COST_RL);
    if (l->pixels <= (double)RX_PREPARED_KEPT)
        bytes += take(l, RX_COST_RL_DATA);
    if (l->pixels <= (double)RX_RL_WHOLE || whole)
        bytes += take(l, RX_COST_RL_MODEL);
    return bytes;
}

/* As far down as the network is, what it has read of one plane is gone: all but a row of blocks
 * (restore/network_forward.c). */
static double network_planes(const load *l)
{
    enum { HIGHEST = 4096 };
    const double rows = ceil((double)l->shape->height / HIGHEST);
    return take(l, RX_COST_NET) - sizeof(float) * l->pixels * (1 - 1 / fmax(rows, 1));
}

/* NET may hand a tile over to RL (OUT_OF_DOMAIN). */
static double restoration(const load *l, const rx_restorer *kind)
{
    const rx_cost_name name = cost_of_kind(kind);
    double bytes = name == RX_COST_RL    ? richardson_lucy(l)
                   : name == RX_COST_NET ? network_planes(l) + network_scratch(l)
                                         : take(l, name);
    if (name == RX_COST_NET && l->job->options->restore.out_of_domain == RX_DOMAIN_RL)
        bytes = fmax(bytes, richardson_lucy(l));
    if (name == RX_COST_NET && l->job->options->restore.verify_seams)
        bytes += take(l, RX_COST_SEAMS);
    return name == RX_COST_NONE ? bytes : bytes + terms_memory(l);
}

/* Grows with the sources up to a limit. */
static double limited(const load *l, rx_cost_name name)
{
    const rx_cost *cost = rx_cost_of(name);
    return fmin(cost->fixed, cost->source * l->sources);
}

/* Objects are drawn in blocks (simulate/render.h). */
static double injection(const load *l)
{
    const rx_cost *cost = rx_cost_of(RX_COST_INJECT);
    return fmin(cost->fixed, cost->pixel * l->pixels);
}

/* So much of a large tile is on the canvas at a time (template/tphot.c); the data of up to four times as many
 * pixels are kept beside it. */
static double template_fit(const load *l)
{
    const double shown = 1 << 24;
    double bytes = take(l, RX_COST_TEMPLATES) + rx_cost_of(RX_COST_CANVAS)->pixel * fmin(l->pixels, shown);
    if (l->pixels > shown && l->pixels <= 4 * shown)
        bytes += sizeof(float) * l->pixels;
    return bytes;
}

static double extraction(const load *l, const rx_restorer *kind, int templates)
{
    const rx_options *options = l->job->options;
    double bytes = take(l, plain(kind) ? RX_COST_EXTRACT : RX_COST_EXTRACT_RESTORED);
    bytes += l->threads * limited(l, RX_COST_EXTRACT_THREAD);
    if (!plain(kind))
        bytes += limited(l, RX_COST_BLENDS);
    if (cost_of_kind(kind) == RX_COST_NET)
        bytes += network_scratch(l); /* of other threads' heaps, which keep it */
    if (options->detect.matched && (plain(kind) || options->filter_restored))
        bytes += take(l, RX_COST_MATCHED);
    if (templates)
        bytes += template_fit(l);
    bytes += 2 * sizeof(float) * l->sources * options->measure.vignet_width * options->measure.vignet_height;
    return bytes;
}

/* A PSF will be measured from stars. */
static int measures_psf(const rx_options *options)
{
    int needed = options->self_check || options->templates.wanted;
    for (int i = 0; i < options->nrestorers; i++)
        needed |= options->restorers[i]->needs_psf;
    return needed && options->psf.type == RX_PSF_AUTO;
}

/* What a map of meshes takes beyond the usual one. */
static double meshes(const load *l, const rx_background_params *par)
{
    return rx_cost_of(RX_COST_MESH)->fixed * l->pixels / ((double)par->mesh_width * par->mesh_height);
}

static double open_tile(const load *l, int role, const rx_tile_shape *shape)
{
    const rx_options *options = l->job->options;
    const rx_tile_params *par = &options->tile[role];
    double bytes = take(l, RX_COST_TILE) + (double)shape->held + 2 * 80.0 * (double)shape->ncards +
                   meshes(l, &options->background[role]);
    if (shape->compressed)
        bytes += take(l, RX_COST_COMPRESSED);
    if (par->weight_type != RX_WEIGHT_NONE)
        bytes += take(l, RX_COST_WEIGHT);
    return bytes + par->nflags * take(l, RX_COST_FLAG_MAP);
}

static double one_restorer(const load *l, const rx_restorer *kind)
{
    const rx_options *options = l->job->options;
    const int more = options->restore.keep_reblurred + options->restore.keep_support +
                     options->keep_filtered + (options->nchecks > 0);
    const double restored = restoration(l, kind);
    double bytes = fmax(restored, extraction(l, kind, options->templates.wanted));
    bytes += more * take(l, RX_COST_CHECKIMAGE);
    if (l->job->measure != NULL)
        bytes += take(l, plain(kind) ? RX_COST_SECOND : RX_COST_SECOND_RESTORED);
    if (options->self_check)
        bytes += injection(l);
    if (options->self_check || options->blank_check > 0)
        bytes +=
            fmax(restored, extraction(l, kind, options->templates.wanted_by_lists)) + take(l, RX_COST_CHECKS);
    return bytes;
}

static double image_memory(const rx_plan_job *job, int i)
{
    const rx_options *options = job->options;
    const rx_tile_shape *shape = &job->detect[i];
    load l = {.job = job,
              .shape = shape,
              .pixels = rx_plan_pixels(shape),
              .sources = rx_plan_sources(job, shape),
              .threads = options->nthreads - 1,
              .terms = job->terms[i]};
    double open = open_tile(&l, 0, shape), peak = 0;
    if (job->measure != NULL)
        open += open_tile(&l, 1, &job->measure[i]);
    if (measures_psf(options))
        peak = take(&l, RX_COST_PSF_AUTO) + l.threads * limited(&l, RX_COST_EXTRACT_THREAD);
    for (int k = 0; k < options->nrestorers; k++)
        peak = fmax(peak, k * take(&l, RX_COST_KEPT) + one_restorer(&l, options->restorers[k]));
    if (options->reference.name != NULL)
        peak = fmax(peak, options->nrestorers * (take(&l, RX_COST_KEPT) + take(&l, RX_COST_REPORT)));
    return open + peak;
}

double rx_plan_memory(const rx_plan_job *job)
{
    const rx_options *options = job->options;
    const load none = {.job = job, .threads = options->nthreads - 1};
    double most = 0, sources = 0;
    for (int i = 0; i < job->n; i++) {
        most = fmax(most, image_memory(job, i));
        sources += rx_plan_sources(job, &job->detect[i]);
    }
    double bytes = take(&none, RX_COST_PROGRAM) + most;
    if (options->model != NULL)
        bytes += take(&none, RX_COST_MODEL);
    bytes += options->nrestorers * rx_plan_row_bytes(job->row) * sources;
    return bytes + rx_cost_of(RX_COST_REFERENCE)->fixed * job->reference_bytes;
}

/* --- time --- */

static double seconds(const load *l, rx_cost_name name)
{
    const rx_cost *cost = rx_cost_of(name);
    return 1e-6 * l->pixels * cost->mpixel_seconds + l->sources * cost->source_seconds;
}

static double restoration_seconds(const load *l, const rx_restorer *kind)
{
    const rx_restore_params *par = &l->job->options->restore;
    const rx_cost_name name = cost_of_kind(kind);
    const double once = seconds(l, name), varies = l->terms > 1;
    if (name == RX_COST_RL) /* of 4 transforms 2 are made for each term */
        return once * par->rl_niter * (l->terms + 1) / 2;
    if (name == RX_COST_RL_BLIND)
        return once * par->blind_cycles * par->blind_psf_niter * (1 + 0.7 * varies);
    const double net = once + varies * (l->terms + 6) * seconds(l, RX_COST_PSF_TERM);
    return name == RX_COST_NET ? net * (1 + par->verify_seams) : once;
}

/* The more crowded, the more neighbours a template has: at so many sources per Mpixel it takes twice as long.
 */
static const double CROWDED = 5000;

static double template_seconds(const load *l)
{
    const double density = 1e6 * l->sources / fmax(l->pixels, 1);
    const double once = seconds(l, RX_COST_TEMPLATES) * (1 + density / CROWDED);
    return l->job->options->templates.wanted ? once * (l->terms > 1 ? 1.8 : 1)
                                             : 0; /* the PSF at each place */
}

/* How often the checks send a copy the same way. */
static double rounds(const load *l)
{
    const rx_options *options = l->job->options;
    double n = options->blank_check;
    if (options->self_check)
        n += ceil((double)options->self_check_count /
                  ceil(options->self_check_density * fmax(1e-6 * l->pixels, 1e-6)));
    return n;
}

static double image_seconds(const rx_plan_job *job, int i)
{
    const rx_options *options = job->options;
    const int dual = job->measure != NULL;
    const load l = {.job = job,
                    .pixels = rx_plan_pixels(&job->detect[i]),
                    .sources = rx_plan_sources(job, &job->detect[i]),
                    .terms = job->terms[i]};
    double sum = (1 + dual) * seconds(&l, RX_COST_TILE);
    if (measures_psf(options))
        sum += (1 + dual) * seconds(&l, RX_COST_PSF_AUTO);
    for (int k = 0; k < options->nrestorers; k++) {
        const rx_restorer *kind = options->restorers[k];
        const double way = restoration_seconds(&l, kind) +
                           seconds(&l, plain(kind) ? RX_COST_EXTRACT : RX_COST_EXTRACT_RESTORED);
        sum += way * (1 + rounds(&l)) + template_seconds(&l);
        sum += options->templates.wanted_by_lists ? template_seconds(&l) * rounds(&l) : 0;
        sum += dual && !plain(kind) && !options->measure_original ? restoration_seconds(&l, kind) : 0;
        sum += options->nchecks * seconds(&l, RX_COST_CHECKIMAGE);
        sum += options->reference.name != NULL ? seconds(&l, RX_COST_REPORT) : 0;
    }
    return sum;
}

double rx_plan_seconds(const rx_plan_job *job)
{
    double sum = rx_cost_of(RX_COST_PROGRAM)->mpixel_seconds; /* its start */
    for (int i = 0; i < job->n; i++)
        sum += image_seconds(job, i);
    return sum;
}
