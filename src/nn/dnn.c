/* Convolutions of a fixed shape on oneDNN (C API, versions 2 and 3). */
#include "nn/dnn.h"

#include <stdlib.h>
#include <string.h>

#include <dnnl.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include "base/memory.h"

/* A descriptor of memory is a struct in version 2 and a handle in version 3. */
#if DNNL_VERSION_MAJOR >= 3
typedef dnnl_memory_desc_t layout;
typedef const_dnnl_memory_desc_t layout_view;
#define VIEW(l) (l)
#else
typedef dnnl_memory_desc_t layout;
typedef const dnnl_memory_desc_t *layout_view;
#define VIEW(l) (&(l))
#endif

/* Memory that grows. */
typedef struct room {
    void *data;
    size_t bytes;
} room;

struct rx_dnn {
    dnnl_engine_t engine;
    dnnl_stream_t stream;
    room scratch;
};

/* One primitive with the memory objects it is given; weights of its own packing. */
typedef struct job {
    dnnl_primitive_t primitive;
    dnnl_memory_t x, y, weights, bias, scratch;
    size_t scratch_bytes;
    dnnl_primitive_t pack; /* user's weights to the packing, or back */
} job;

struct rx_conv {
    rx_dnn *dnn;
    rx_conv_shape shape;
    int kernel;                   /* as the library is asked for it */
    layout x, y, any, user, bias; /* any: weights of the library's choice */
    job run, data, weights;
    dnnl_memory_t plain; /* weights as the user has them */
    float *plain_data, *bias_data, *dbias_data;
};

/* ---- the two versions of the library ---- */

static dnnl_status_t layout_make(layout *l, int ndims, const dnnl_dims_t dims, dnnl_data_type_t type,
                                 dnnl_format_tag_t tag)
{
#if DNNL_VERSION_MAJOR >= 3
    return dnnl_memory_desc_create_with_tag(l, ndims, dims, type, tag);
#else
    return dnnl_memory_desc_init_by_tag(l, ndims, dims, type, tag);
#endif
}

static void layout_free(layout *l)
{
#if DNNL_VERSION_MAJOR >= 3
    if (*l != NULL)
        dnnl_memory_desc_destroy(*l);
    *l = NULL;
#else
    (void)l;
#endif
}

static dnnl_status_t append_sum(dnnl_post_ops_t ops)
{
#if DNNL_VERSION_MAJOR >= 3
    return dnnl_post_ops_append_sum(ops, 1, 0, dnnl_data_type_undef);
#else
    return dnnl_post_ops_append_sum(ops, 1);
#endif
}

static dnnl_status_t append_relu(dnnl_post_ops_t ops)
{
#if DNNL_VERSION_MAJOR >= 3
    return dnnl_post_ops_append_eltwise(ops, dnnl_eltwise_relu, 0, 0);
#else
    return dnnl_post_ops_append_eltwise(ops, 1, dnnl_eltwise_relu, 0, 0);
#endif
}

typedef struct geometry {
    dnnl_dims_t strides, dilates, before, after;
} geometry;

static geometry geometry_of(const rx_conv_shape *s)
{
    return (geometry){.strides = {s->stride, s->stride},
                      .dilates = {0, 0},
                      .before = {s->before, s->before},
                      .after = {s->after, s->after}};
}

static dnnl_status_t describe_run(const rx_conv *c, const_dnnl_primitive_attr_t attr,
                                  dnnl_primitive_desc_t *dst)
{
    geometry g = geometry_of(&c->shape);
#if DNNL_VERSION_MAJOR >= 3
    return dnnl_convolution_forward_primitive_desc_create(
        dst, c->dnn->engine, dnnl_forward_training, dnnl_convolution_direct, VIEW(c->x), VIEW(c->any),
        VIEW(c->bias), VIEW(c->y), g.strides, g.dilates, g.before, g.after, attr);
#else
    dnnl_convolution_desc_t desc;
    dnnl_status_t bad = dnnl_convolution_forward_desc_init(
        &desc, dnnl_forward_training, dnnl_convolution_direct, VIEW(c->x), VIEW(c->any), VIEW(c->bias),
        VIEW(c->y), g.strides, g.before, g.after);
    return bad ? bad : dnnl_primitive_desc_create(dst, &desc, attr, c->dnn->engine, NULL);
#endif
}

static dnnl_status_t describe_data(const rx_conv *c, const_dnnl_primitive_attr_t attr,
                                   const_dnnl_primitive_desc_t hint, dnnl_primitive_desc_t *dst)
{
    geometry g = geometry_of(&c->shape);
#if DNNL_VERSION_MAJOR >= 3
    return dnnl_convolution_backward_data_primitive_desc_create(
        dst, c->dnn->engine, dnnl_convolution_direct, VIEW(c->x), VIEW(c->any), VIEW(c->y), g.strides,
        g.dilates, g.before, g.after, hint, attr);
#else
    dnnl_convolution_desc_t desc;
    dnnl_status_t bad = dnnl_convolution_backward_data_desc_init(
        &desc, dnnl_convolution_direct, VIEW(c->x), VIEW(c->any), VIEW(c->y), g.strides, g.before, g.after);
    return bad ? bad : dnnl_primitive_desc_create(dst, &desc, attr, c->dnn->engine, hint);
#endif
}

static dnnl_status_t describe_weights(const rx_conv *c, const_dnnl_primitive_attr_t attr,
                                      const_dnnl_primitive_desc_t hint, dnnl_primitive_desc_t *dst)
{
    geometry g = geometry_of(&c->shape);
#if DNNL_VERSION_MAJOR >= 3
    return dnnl_convolution_backward_weights_primitive_desc_create(
        dst, c->dnn->engine, dnnl_convolution_direct, VIEW(c->x), VIEW(c->any), VIEW(c->bias), VIEW(c->y),
        g.strides, g.dilates, g.before, g.after, hint, attr);
#else
    dnnl_convolution_desc_t desc;
    dnnl_status_t bad =
        dnnl_convolution_backward_weights_desc_init(&desc, dnnl_convolution_direct, VIEW(c->x), VIEW(c->any),
                                                    VIEW(c->bias), VIEW(c->y), g.strides, g.before, g.after);
    return bad ? bad : dnnl_primitive_desc_create(dst, &desc, attr, c->dnn->engine, hint);
#endif
}

/* ---- one thread ---- */

/* Number of threads that OpenMP would give to this thread; becomes one. */
static int alone_begin(void)
{
    int before = 1;
#ifdef _OPENMP
    before = omp_get_max_threads();
    if (before != 1)
        omp_set_num_threads(1);
#endif
    return before;
}

static void alone_end(int before)
{
#ifdef _OPENMP
    if (before != 1)
        omp_set_num_threads(before);
#else
    (void)before;
#endif
}

static rx_status refuse(rx_error *err, dnnl_status_t bad, const char *what, const rx_conv_shape *s)
{
    if (bad == dnnl_success)
        return RX_OK;
    if (bad == dnnl_out_of_memory)
        return rx_error_memory(err, 0);
    return rx_error_set(err, RX_SYSTEM,
                        "oneDNN cannot %s a %dx%d convolution of %d to %d channels, stride %d, on %dx%d "
                        "pixels (its status %d)",
                        what, s->kernel, s->kernel, s->in, s->out, s->stride, s->width, s->height, (int)bad);
}

/* ---- engine ---- */

static rx_status dnn_new(rx_dnn **dst, rx_error *err)
{
    rx_dnn *dnn = RX_NEW(rx_dnn, 1);
    *dst = dnn;
    if (dnn == NULL)
        return rx_error_memory(err, sizeof *dnn);
    dnnl_status_t bad = dnnl_engine_create(&dnn->engine, dnnl_cpu, 0);
    if (!bad)
        bad = dnnl_stream_create(&dnn->stream, dnn->engine, dnnl_stream_default_flags);
    if (bad)
        return rx_error_set(err, RX_SYSTEM, "oneDNN cannot make its engine (its status %d)", (int)bad);
    return RX_OK;
}

rx_status rx_dnn_new(rx_dnn **dst, rx_error *err)
{
    int before = alone_begin();
    rx_status status = dnn_new(dst, err);
    if (status) {
        rx_dnn_free(*dst);
        *dst = NULL;
    }
    alone_end(before);
    return status;
}

void rx_dnn_free(rx_dnn *dnn)
{
    if (dnn == NULL)
        return;
    if (dnn->stream != NULL)
        dnnl_stream_destroy(dnn->stream);
    if (dnn->engine != NULL)
        dnnl_engine_destroy(dnn->engine);
    free(dnn->scratch.data);
    free(dnn);
}

/* ---- making a convolution ---- */

static dnnl_status_t make_layouts(rx_conv *c)
{
    const rx_conv_shape *s = &c->shape;
    const dnnl_dims_t x = {1, s->in, s->height, s->width};
    const dnnl_dims_t y = {1, s->out, s->height / s->stride, s->width / s->stride};
    const dnnl_dims_t w = {s->out, s->in, c->kernel, c->kernel}, b = {s->out};

    dnnl_status_t bad = layout_make(&c->x, 4, x, dnnl_f32, dnnl_nhwc);
    bad = bad ? bad : layout_make(&c->y, 4, y, dnnl_f32, dnnl_nhwc);
    bad = bad ? bad : layout_make(&c->any, 4, w, dnnl_f32, dnnl_format_tag_any);
    bad = bad ? bad : layout_make(&c->user, 4, w, dnnl_f32, dnnl_oihw);
    bad = bad ? bad : layout_make(&c->bias, 1, b, dnnl_f32, dnnl_x);
    return bad;
}

/* Attributes: scratch memory from us; what follows the sum over the kernel where `follow`. */
static dnnl_status_t make_attributes(const rx_conv_shape *s, int follow, dnnl_primitive_attr_t *dst)
{
    dnnl_post_ops_t ops = NULL;
    dnnl_status_t bad = dnnl_primitive_attr_create(dst);
    bad = bad ? bad : dnnl_primitive_attr_set_scratchpad_mode(*dst, dnnl_scratchpad_mode_user);
    bad = bad ? bad : dnnl_post_ops_create(&ops);
    if (!bad && follow && s->sum)
        bad = append_sum(ops);
    if (!bad && follow && s->relu)
        bad = append_relu(ops);
    bad = bad ? bad : dnnl_primitive_attr_set_post_ops(*dst, ops);
    if (ops != NULL)
        dnnl_post_ops_destroy(ops);
    return bad;
}

static dnnl_status_t make_pack(rx_conv *c, job *j, layout_view packed, int back)
{
    dnnl_engine_t engine = c->dnn->engine;
    layout_view user = VIEW(c->user);
    dnnl_primitive_desc_t desc = NULL;
    dnnl_status_t bad = dnnl_memory_create(&j->weights, packed, engine, DNNL_MEMORY_ALLOCATE);
    bad = bad ? bad
              : dnnl_reorder_primitive_desc_create(&desc, back ? packed : user, engine, back ? user : packed,
                                                   engine, NULL);
    bad = bad ? bad : dnnl_primitive_create(&j->pack, desc);
    if (desc != NULL)
        dnnl_primitive_desc_destroy(desc);
    return bad;
}

/* The job of a described primitive; `query` names its weights. */
static dnnl_status_t make_job(rx_conv *c, job *j, const_dnnl_primitive_desc_t desc, dnnl_query_t query)
{
    dnnl_engine_t engine = c->dnn->engine;
    int back = query == dnnl_query_diff_weights_md;
    layout_view packed = dnnl_primitive_desc_query_md(desc, query, 0);
    layout_view scratch = dnnl_primitive_desc_query_md(desc, dnnl_query_scratchpad_md, 0);
    dnnl_status_t bad = dnnl_primitive_create(&j->primitive, desc);
    bad = bad ? bad : make_pack(c, j, packed, back);
    bad = bad ? bad : dnnl_memory_create(&j->x, VIEW(c->x), engine, DNNL_MEMORY_NONE);
    bad = bad ? bad : dnnl_memory_create(&j->y, VIEW(c->y), engine, DNNL_MEMORY_NONE);
    bad =
        bad ? bad : dnnl_memory_create(&j->bias, VIEW(c->bias), engine, back ? c->dbias_data : c->bias_data);
    bad = bad ? bad : dnnl_memory_create(&j->scratch, scratch, engine, DNNL_MEMORY_NONE);
    j->scratch_bytes = bad ? 0 : dnnl_memory_desc_get_size(scratch);
    return bad;
}

static rx_status grow(room *r, size_t bytes, rx_error *err)
{
    if (bytes <= r->bytes)
        return RX_OK;
    free(r->data);
    r->bytes = 0;
    r->data = rx_alloc(bytes, 1);
    if (r->data == NULL)
        return rx_error_memory(err, bytes);
    r->bytes = bytes;
    return RX_OK;
}

static dnnl_status_t make_jobs(rx_conv *c)
{
    dnnl_primitive_attr_t attr = NULL, bare = NULL;
    dnnl_primitive_desc_t run = NULL, data = NULL, weights = NULL;
    dnnl_status_t bad = make_attributes(&c->shape, 1, &attr);
    bad = bad ? bad : make_attributes(&c->shape, 0, &bare);
    bad = bad ? bad : describe_run(c, attr, &run);
    bad = bad ? bad : make_job(c, &c->run, run, dnnl_query_weights_md);
    bad = bad ? bad : describe_data(c, bare, run, &data);
    bad = bad ? bad : make_job(c, &c->data, data, dnnl_query_weights_md);
    bad = bad ? bad : describe_weights(c, bare, run, &weights);
    bad = bad ? bad : make_job(c, &c->weights, weights, dnnl_query_diff_weights_md);
    dnnl_primitive_desc_t descs[] = {run, data, weights};
    for (int i = 0; i < 3; i++)
        if (descs[i] != NULL)
            dnnl_primitive_desc_destroy(descs[i]);
    if (bare != NULL)
        dnnl_primitive_attr_destroy(bare);
    if (attr != NULL)
        dnnl_primitive_attr_destroy(attr);
    return bad;
}

static size_t weights_of(const rx_conv *c)
{
    return (size_t)c->shape.out * (size_t)c->shape.in * (size_t)c->kernel * (size_t)c->kernel;
}

static rx_status conv_make(rx_conv *c, rx_error *err)
{
    c->plain_data = RX_NEW(float, weights_of(c));
    c->bias_data = RX_NEW(float, (size_t)c->shape.out);
    c->dbias_data = RX_NEW(float, (size_t)c->shape.out);
    if (c->plain_data == NULL || c->bias_data == NULL || c->dbias_data == NULL)
        return rx_error_memory(err, weights_of(c) * sizeof(float));
    dnnl_status_t bad = make_layouts(c);
    bad = bad ? bad : dnnl_memory_create(&c->plain, VIEW(c->user), c->dnn->engine, c->plain_data);
    bad = bad ? bad : make_jobs(c);
    if (bad)
        return refuse(err, bad, "make", &c->shape);
    size_t most = c->run.scratch_bytes;
    most = c->data.scratch_bytes > most ? c->data.scratch_bytes : most;
    most = c->weights.scratch_bytes > most ? c->weights.scratch_bytes : most;
    return grow(&c->dnn->scratch, most, err);
}

rx_status rx_conv_new(rx_dnn *dnn, const rx_conv_shape *shape, rx_conv **dst, rx_error *err)
{
    rx_conv *c = *dst = RX_NEW(rx_conv, 1);
    if (c == NULL)
        return rx_error_memory(err, sizeof *c);
    c->dnn = dnn;
    c->shape = *shape;
    /* The library's kernels for strided 1x1 convolutions write beyond their scratch memory where the channels
     * fill no vector (oneDNN's issue 6035): a 2x2 kernel with three zeros does the same. */
    c->kernel = shape->kernel == 1 && shape->stride == 2 ? 2 : shape->kernel;
    int before = alone_begin();
    rx_status status = conv_make(c, err);
    if (status) {
        rx_conv_free(c);
        *dst = NULL;
    }
    alone_end(before);
    return status;
}

static void job_free(job *j)
{
    dnnl_memory_t memories[] = {j->x, j->y, j->weights, j->bias, j->scratch};
    for (size_t i = 0; i < sizeof memories / sizeof memories[0]; i++)
        if (memories[i] != NULL)
            dnnl_memory_destroy(memories[i]);
    if (j->pack != NULL)
        dnnl_primitive_destroy(j->pack);
    if (j->primitive != NULL)
        dnnl_primitive_destroy(j->primitive);
}

void rx_conv_free(rx_conv *conv)
{
    if (conv == NULL)
        return;
    job_free(&conv->run);
    job_free(&conv->data);
    job_free(&conv->weights);
    if (conv->plain != NULL)
        dnnl_memory_destroy(conv->plain);
    layout *layouts[] = {&conv->x, &conv->y, &conv->any, &conv->user, &conv->bias};
    for (size_t i = 0; i < sizeof layouts / sizeof layouts[0]; i++)
        layout_free(layouts[i]);
    free(conv->plain_data);
    free(conv->bias_data);
    free(conv->dbias_data);
    free(conv);
}

/* ---- work ---- */

static dnnl_status_t pack(rx_conv *c, job *j, int back)
{
    if (j->pack == NULL)
        return dnnl_success;
    dnnl_exec_arg_t arguments[] = {{DNNL_ARG_FROM, back ? j->weights : c->plain},
                                   {DNNL_ARG_TO, back ? c->plain : j->weights}};
    return dnnl_primitive_execute(j->pack, c->dnn->stream, 2, arguments);
}

rx_status rx_conv_load(rx_conv *conv, const float *weights, const float *bias, rx_error *err)
{
    const rx_conv_shape *s = &conv->shape;
    size_t kernels = (size_t)s->out * (size_t)s->in;
    size_t size = (size_t)(s->kernel * s->kernel), room = (size_t)(conv->kernel * conv->kernel);
    memset(conv->plain_data, 0, weights_of(conv) * sizeof(float));
    for (size_t k = 0; k < kernels; k++)
        memcpy(conv->plain_data + k * room, weights + k * size, size * sizeof(float));
    memcpy(conv->bias_data, bias, (size_t)s->out * sizeof(float));
    int before = alone_begin();
    dnnl_status_t bad = pack(conv, &conv->run, 0);
    bad = bad ? bad : pack(conv, &conv->data, 0);
    bad = bad ? bad : dnnl_stream_wait(conv->dnn->stream);
    alone_end(before);
    return refuse(err, bad, "load", s);
}

/* Give the planes to a job and run it; args: what x, y, weights and bias are to this primitive. */
static dnnl_status_t execute(rx_conv *c, job *j, const void *x, const void *y, const int args[4])
{
    dnnl_status_t bad = dnnl_memory_set_data_handle(j->x, (void *)(size_t)x);
    bad = bad ? bad : dnnl_memory_set_data_handle(j->y, (void *)(size_t)y);
    bad = bad ? bad : dnnl_memory_set_data_handle(j->scratch, c->dnn->scratch.data);
    if (bad)
        return bad;
    dnnl_exec_arg_t arguments[] = {{args[0], j->x},
                                   {args[1], j->y},
                                   {args[2], j->weights},
                                   {DNNL_ARG_SCRATCHPAD, j->scratch},
                                   {args[3], j->bias}};
    bad = dnnl_primitive_execute(j->primitive, c->dnn->stream, args[3] ? 5 : 4, arguments);
    return bad ? bad : dnnl_stream_wait(c->dnn->stream);
}

rx_status rx_conv_run(rx_conv *conv, const void *x, const void *add, void *y, rx_error *err)
{
    static const int args[4] = {DNNL_ARG_SRC, DNNL_ARG_DST, DNNL_ARG_WEIGHTS, DNNL_ARG_BIAS};
    int before = alone_begin();
    if (add != NULL && add != y)
        memcpy(y, add, dnnl_memory_desc_get_size(VIEW(conv->y)));
    dnnl_status_t bad = execute(conv, &conv->run, x, y, args);
    alone_end(before);
    return refuse(err, bad, "run", &conv->shape);
}

rx_status rx_conv_data(rx_conv *conv, const void *dy, void *dx, rx_error *err)
{
    static const int args[4] = {DNNL_ARG_DIFF_SRC, DNNL_ARG_DIFF_DST, DNNL_ARG_WEIGHTS, 0};
    int before = alone_begin();
    dnnl_status_t bad = execute(conv, &conv->data, dx, dy, args);
    alone_end(before);
    return refuse(err, bad, "transpose", &conv->shape);
}

rx_status rx_conv_weights(rx_conv *conv, const void *x, const void *dy, const float **dweights,
                          const float **dbias, rx_error *err)
{
    static const int args[4] = {DNNL_ARG_SRC, DNNL_ARG_DIFF_DST, DNNL_ARG_DIFF_WEIGHTS, DNNL_ARG_DIFF_BIAS};
    int before = alone_begin();
    dnnl_status_t bad = execute(conv, &conv->weights, x, dy, args);
    bad = bad ? bad : pack(conv, &conv->weights, 1);
    bad = bad ? bad : dnnl_stream_wait(conv->dnn->stream);
    alone_end(before);
    /* Of an enlarged kernel only the first element is the user's. */
    size_t kernels = (size_t)conv->shape.out * (size_t)conv->shape.in;
    for (size_t k = 0; conv->kernel != conv->shape.kernel && k < kernels; k++)
        conv->plain_data[k] = conv->plain_data[4 * k];
    *dweights = conv->plain_data;
    *dbias = conv->dbias_data;
    return refuse(err, bad, "differentiate", &conv->shape);
}
