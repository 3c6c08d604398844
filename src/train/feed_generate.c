/* A generator: its share of the epoch, then what the next epoch will probably need. */
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "train/feed_protocol.h"

typedef struct job {
    long key; /* position of the first of its run that the trainer needs */
    long at;  /* its own position */
    rx_sample_id id;
} job;

/* What this generator has to make for one epoch, in the order of making. */
typedef struct plan {
    rx_feed_counts counts;
    job *jobs;
    long njobs, next;
} plan;

typedef struct generator {
    const rx_feed_params *par;
    rx_ranks *ranks;
    rx_feed_maker *make;
    void *user;
    int run;          /* images of one bin that share a field */
    bool open, over;  /* an epoch has begun; the trainer has ended */
    plan now, then;   /* the epoch, and the guess at the next one */
    rx_sample **kept; /* [then.next] made for the next one */
    long used;        /* images of this epoch that the trainer has taken */
    long made;        /* of this epoch */
    long drawn;       /* images made since the last message that counted them */
    double seconds;   /* that took */
} generator;

/* --- plans --- */

/* Images of one bin that share a field (train/scenes.h). */
static int run_length(const rx_feed_params *par)
{
    int fields = par->scenes.side > 0 ? par->scenes.field_side / par->scenes.side : 0;
    return fields * fields;
}

/* Runs of all bins are dealt out like cards, along the diagonal of the grid, so that no generator gets all
 * the wide PSFs, and from another one on whenever the fields change. */
int rx_feed_owner(const rx_feed_params *par, rx_sample_id id, int generators)
{
    unsigned n = (unsigned)generators, run = (unsigned)run_length(par);
    unsigned deal = id.bin + id.bin / n + id.set + id.index / run + id.epoch / (unsigned)par->scenes.uses;
    return (int)(deal % n);
}

static bool is_mine(const generator *gen, rx_sample_id id)
{
    int first = rx_ranks_trainers(gen->ranks), generators = rx_ranks_count(gen->ranks) - first;
    return rx_feed_owner(gen->par, id, generators) == rx_ranks_rank(gen->ranks) - first;
}

static int compare_jobs(const void *a, const void *b)
{
    const job *p = a, *q = b;
    if (p->key != q->key)
        return p->key < q->key ? -1 : 1;
    if (p->id.set != q->id.set)
        return p->id.set < q->id.set ? -1 : 1;
    if (p->id.bin != q->id.bin)
        return p->id.bin < q->id.bin ? -1 : 1;
    return (p->id.index > q->id.index) - (p->id.index < q->id.index);
}

static void clear_plan(plan *plan)
{
    free(plan->jobs);
    plan->jobs = NULL;
    plan->njobs = plan->next = 0;
}

/* Jobs of one bin: indices that are this generator's and not done[place] (NULL: none is). */
static void plan_bin(const generator *gen, plan *plan, uint32_t set, uint32_t bin, const long *position,
                     const bool *done)
{
    int count = plan->counts.count[set][bin];
    for (int begin = 0; begin < count; begin += gen->run) {
        int end = begin + gen->run < count ? begin + gen->run : count;
        long from = plan->njobs, key = plan->counts.all;
        for (int index = begin; index < end; index++) {
            rx_sample_id id = {plan->counts.epoch, set, bin, (uint32_t)index};
            long place = rx_feed_place(&plan->counts, id);
            if (!is_mine(gen, id) || (done && done[place]))
                continue;
            long at = position && place < plan->counts.n ? position[place] : place;
            plan->jobs[plan->njobs++] = (job){.at = at, .id = id};
            key = at < key ? at : key;
        }
        for (long i = from; i < plan->njobs; i++)
            plan->jobs[i].key = key;
    }
}

/* plan->counts is laid out. position[n] of training images by place, NULL while it is not known. */
static rx_status make_plan(const generator *gen, plan *plan, const long *position, const bool *done,
                           rx_error *err)
{
    clear_plan(plan);
    plan->jobs = RX_NEW(job, (size_t)plan->counts.all);
    if (!plan->jobs)
        return rx_error_memory(err, (size_t)plan->counts.all * sizeof *plan->jobs);
    for (uint32_t set = RX_SET_TRAIN; set <= RX_SET_TEST; set++)
        for (int bin = 0; bin < plan->counts.nbins; bin++)
            plan_bin(gen, plan, set, (uint32_t)bin, position, done);
    qsort(plan->jobs, (size_t)plan->njobs, sizeof *plan->jobs, compare_jobs);
    return RX_OK;
}

/* The next epoch's counts are near this one's: an eighth more, and what more Eq. 4 can ask for is made when
 * it does. */
static void guess_next(const generator *gen, rx_feed_counts *dst)
{
    *dst = gen->now.counts;
    dst->epoch++;
    for (int set = RX_SET_TRAIN; set <= RX_SET_TEST && dst->active; set++)
        for (int bin = 0; bin < dst->nbins; bin++) {
            int more = dst->count[set][bin] + dst->count[set][bin] / 8 + 2;
            dst->count[set][bin] = more < gen->par->grid.total ? more : gen->par->grid.total;
        }
    rx_feed_lay_out(dst);
}

static rx_status plan_ahead(generator *gen, rx_error *err)
{
    guess_next(gen, &gen->then.counts);
    RX_TRY(make_plan(gen, &gen->then, NULL, NULL, err));
    gen->kept = RX_NEW(rx_sample *, (size_t)gen->then.njobs);
    return gen->kept ? RX_OK : rx_error_memory(err, (size_t)gen->then.njobs * sizeof *gen->kept);
}

static void clear_ahead(generator *gen)
{
    for (long i = 0; i < gen->then.next; i++)
        rx_sample_free(gen->kept[i]);
    free(gen->kept);
    gen->kept = NULL;
    clear_plan(&gen->then);
}

/* --- images --- */

static rx_status make_image(generator *gen, rx_sample_id id, rx_sample **dst, rx_error *err)
{
    *dst = rx_sample_new(gen->par->scenes.side);
    if (!*dst)
        return rx_error_memory(err, rx_sample_bytes(gen->par->scenes.side));
    (*dst)->id = id;
    const double begun = rx_seconds();
    rx_status status = gen->make(gen->user, id, *dst, err);
    gen->seconds += rx_seconds() - begun;
    gen->drawn++;
    (*dst)->id = id;
    if (status == RX_OK)
        return RX_OK;
    rx_sample_free(*dst);
    *dst = NULL;
    return status;
}

static rx_status send_image(generator *gen, rx_sample *sample, long at, rx_error *err)
{
    gen->made++;
    return rx_ranks_give(gen->ranks, (int)(at % rx_ranks_trainers(gen->ranks)), RX_FEED_IMAGE, sample,
                         rx_sample_bytes(gen->par->scenes.side), err);
}

static rx_status say_complete(generator *gen, rx_error *err)
{
    rx_feed_done done = {
        .epoch = gen->now.counts.epoch, .made = gen->made, .drawn = gen->drawn, .seconds = gen->seconds};
    gen->drawn = 0;
    gen->seconds = 0;
    return rx_ranks_send(gen->ranks, 0, RX_FEED_COMPLETE, &done, sizeof done, err);
}

static rx_status work_now(generator *gen, rx_error *err)
{
    rx_sample *sample = NULL;
    const job *one = &gen->now.jobs[gen->now.next];
    rx_status status = make_image(gen, one->id, &sample, err);
    if (status == RX_OK)
        status = send_image(gen, sample, one->at, err);
    gen->now.next++;
    if (status == RX_OK && gen->now.next == gen->now.njobs)
        status = say_complete(gen, err);
    return status;
}

static rx_status work_ahead(generator *gen, rx_error *err)
{
    rx_status status = make_image(gen, gen->then.jobs[gen->then.next].id, &gen->kept[gen->then.next], err);
    if (status == RX_OK)
        gen->then.next++;
    return status;
}

/* Room for one more image of the next epoch: what the trainer has not taken yet counts too. */
static bool may_work_ahead(const generator *gen)
{
    long waiting = gen->now.counts.all - gen->used;
    long generators = rx_ranks_count(gen->ranks) - rx_ranks_trainers(gen->ranks);
    return gen->open && gen->then.next < gen->then.njobs &&
           gen->then.next < (gen->par->ahead - waiting) / generators;
}

/* --- what the trainer says --- */

/* Of the images made ahead, send those that the epoch needs. */
static rx_status use_kept(generator *gen, const long *position, bool *done, rx_error *err)
{
    const rx_feed_counts *counts = &gen->now.counts;
    rx_status status = RX_OK;
    for (long i = 0; i < gen->then.next && status == RX_OK; i++) {
        rx_sample *sample = gen->kept[i];
        long place = rx_feed_place(counts, sample->id);
        gen->kept[i] = NULL;
        if (place < 0) {
            rx_sample_free(sample);
            continue;
        }
        done[place] = true;
        status = send_image(gen, sample, place < counts->n ? position[place] : place, err);
    }
    clear_ahead(gen);
    return status;
}

static rx_status begin_epoch(generator *gen, const rx_message *message, rx_error *err)
{
    rx_feed_counts *counts = &gen->now.counts;
    if (message->size < sizeof *counts)
        return rx_error_set(err, RX_SYSTEM, "the message of an epoch has %zu bytes", message->size);
    memcpy(counts, message->data, sizeof *counts);
    const rx_pick *order = (const rx_pick *)((const char *)message->data + sizeof *counts);
    long n = (long)((message->size - sizeof *counts) / sizeof *order);
    long *position = RX_NEW(long, (size_t)counts->n);
    bool *done = RX_NEW(bool, (size_t)counts->all);
    rx_status status = RX_OK;
    gen->open = true;
    gen->used = gen->made = 0;
    if (!position || !done)
        status = rx_error_memory(err, (size_t)counts->all * sizeof *position);
    if (status == RX_OK)
        status = rx_feed_positions(counts, order, n, position, err);
    if (status == RX_OK)
        status = use_kept(gen, position, done, err);
    if (status == RX_OK)
        status = make_plan(gen, &gen->now, position, done, err);
    if (status == RX_OK)
        status = plan_ahead(gen, err);
    if (status == RX_OK && gen->now.njobs == 0)
        status = say_complete(gen, err);
    free(position);
    free(done);
    return status;
}

static rx_status obey(generator *gen, const rx_message *message, rx_error *err)
{
    if (message->tag == RX_FEED_EPOCH)
        return begin_epoch(gen, message, err);
    if (message->tag == RX_FEED_PROGRESS && message->size == sizeof(rx_feed_progress)) {
        const rx_feed_progress *progress = message->data;
        if (gen->open && progress->epoch == gen->now.counts.epoch)
            gen->used = progress->used;
    } else if (message->tag == RX_FEED_END)
        gen->over = true;
    return RX_OK;
}

/* All that has come; waits for a message where there is nothing to do. */
static rx_status listen_to_trainer(generator *gen, rx_error *err)
{
    while (!gen->over) {
        rx_message message;
        int wait = gen->now.next == gen->now.njobs && !may_work_ahead(gen);
        rx_status status = rx_ranks_receive(gen->ranks, wait, &message, err);
        if (status != RX_OK || message.from < 0)
            return status;
        status = obey(gen, &message, err);
        free(message.data);
        if (status != RX_OK)
            return status;
    }
    return RX_OK;
}

rx_status rx_feed_generate_with(const rx_feed_params *par, rx_ranks *ranks, rx_feed_maker *make, void *user,
                                rx_error *err)
{
    rx_error why = rx_error_part(err);
    generator *gen = RX_NEW(generator, 1);
    rx_status status = RX_OK;
    if (gen == NULL)
        RX_TRY_EXIT(rx_error_memory(&why, sizeof *gen));
    gen->par = par;
    gen->ranks = ranks;
    gen->make = make;
    gen->user = user;
    gen->run = run_length(par);
    if (gen->run < 1 || par->scenes.uses < 1)
        status =
            rx_error_set(&why, RX_USAGE, "a field of %d pixels holds no image of %d pixels, or %d uses of it",
                         par->scenes.field_side, par->scenes.side, par->scenes.uses);
    while (status == RX_OK && !gen->over) {
        status = listen_to_trainer(gen, &why);
        if (status != RX_OK || gen->over)
            continue;
        status = gen->now.next < gen->now.njobs ? work_now(gen, &why) : work_ahead(gen, &why);
    }
    clear_ahead(gen);
    clear_plan(&gen->now);
    free(gen);
exit:
    if (status == RX_OK || rx_ranks_over(ranks)) /* the trainer is gone */
        return RX_OK;
    rx_ranks_fail(ranks, &why);
    rx_error_take(err, &why);
    return status;
}

/* --- with the simulator --- */

/* One maker for each set of images; validation images have a seed of their own. */
enum { VALIDATION = RX_SET_TEST + 1, MAKERS };
#define VALIDATION_SEED 0x76616c6964617465u

static rx_status make_scene(void *user, rx_sample_id id, rx_sample *dst, rx_error *err)
{
    rx_scenes **scenes = user;
    if (id.epoch == RX_EPOCH_VALIDATION)
        return rx_scenes_make(scenes[VALIDATION], id, dst, err);
    rx_scenes_free(scenes[VALIDATION]); /* these images come once, before all others */
    scenes[VALIDATION] = NULL;
    return rx_scenes_make(scenes[id.set], id, dst, err);
}

rx_status rx_feed_generate(const rx_feed_params *par, rx_ranks *ranks, rx_log *log, rx_error *err)
{
    rx_scenes *scenes[MAKERS] = {NULL};
    rx_error why = rx_error_part(err);
    rx_status status = RX_OK;
    for (int i = 0; i < MAKERS && status == RX_OK; i++) {
        rx_scenes_params one = par->scenes;
        one.set = i == RX_SET_TRAIN ? RX_SET_TRAIN : RX_SET_TEST;
        one.seed = i == VALIDATION ? VALIDATION_SEED : one.seed;
        status = rx_scenes_new(&one, &par->grid, par->sim, log, &scenes[i], &why);
    }
    if (status != RX_OK) {
        rx_ranks_fail(ranks, &why);
        rx_error_take(err, &why);
    } else
        status = rx_feed_generate_with(par, ranks, make_scene, scenes, err);
    for (int i = 0; i < MAKERS; i++)
        rx_scenes_free(scenes[i]);
    return status;
}
