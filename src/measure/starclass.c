/* CLASS_STAR: reader and forward pass of the .nnw network. */
#include "measure/starclass.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/input.h"
#include "base/memory.h"
#include "base/point.h"

enum { MAX_LAYERS = 4, MAX_UNITS = 32, INPUTS = 2 + RX_NISO };

struct rx_starclass {
    int nlayers, size[MAX_LAYERS];
    double in_bias[MAX_UNITS], in_scale[MAX_UNITS];
    double weight[MAX_LAYERS][MAX_UNITS][MAX_UNITS + 1]; /* [layer][to][from], bias last */
    double out_bias, out_scale;
};

/* Next number of the file; lines starting with '#' are skipped. */
static bool next_number(FILE *file, double *value)
{
    char word[64];
    while (fscanf(file, "%63s", word) == 1) {
        if (word[0] == '#') {
            int c;
            while ((c = fgetc(file)) != '\n' && c != EOF)
                continue;
            continue;
        }
        char *end;
        *value = rx_point_number(word, &end);
        return *end == '\0' && isfinite(*value);
    }
    return false;
}

static bool read_list(FILE *file, double *values, int n)
{
    for (int i = 0; i < n; i++)
        if (!next_number(file, &values[i]))
            return false;
    return true;
}

static bool read_sizes(FILE *file, rx_starclass *net)
{
    double value;
    if (!next_number(file, &value) || value < 2 || value > MAX_LAYERS)
        return false;
    net->nlayers = (int)value;
    for (int i = 0; i < net->nlayers; i++) {
        if (!next_number(file, &value) || value < 1 || value > MAX_UNITS)
            return false;
        net->size[i] = (int)value;
    }
    return net->size[0] == INPUTS && net->size[net->nlayers - 1] == 1;
}

static const char *read_network(FILE *file, rx_starclass *net)
{
    char magic[4] = "";
    if (fread(magic, 1, 3, file) != 3 || strcmp(magic, "NNW") != 0)
        return "is no network file: it does not start with NNW";
    if (!read_sizes(file, net))
        return "does not hold a network of 10 inputs and 1 output in 2 to 4 layers of up to 32 units";
    bool complete =
        read_list(file, net->in_bias, net->size[0]) && read_list(file, net->in_scale, net->size[0]);
    for (int l = 0; complete && l + 1 < net->nlayers; l++)
        for (int j = 0; complete && j < net->size[l + 1]; j++)
            complete = read_list(file, net->weight[l][j], net->size[l] + 1);
    if (!complete || !next_number(file, &net->out_bias) || !next_number(file, &net->out_scale))
        return "ends early or holds something that is no number";
    return net->out_scale == 0.0 ? "has an output scale of zero" : NULL;
}

rx_status rx_starclass_read(const char *path, rx_starclass **dst, rx_error *err)
{
    *dst = NULL;
    FILE *file = rx_input_open(path);
    if (file == NULL)
        return rx_error_at(err, RX_USAGE, path, -1, 0,
                           "cannot be read: %s; set STARNNW_NAME or leave out CLASS_STAR", strerror(errno));
    rx_starclass *net = RX_NEW(rx_starclass, 1);
    if (net == NULL) {
        fclose(file);
        return rx_error_memory(err, sizeof *net);
    }
    const char *trouble = read_network(file, net);
    fclose(file);
    if (trouble != NULL) {
        rx_starclass_free(net);
        return rx_error_at(err, RX_USAGE, path, -1, 0, "%s; give SExtractor's default.nnw as STARNNW_NAME",
                           trouble);
    }
    *dst = net;
    return RX_OK;
}

void rx_starclass_free(rx_starclass *net)
{
    free(net);
}

static double respond(const rx_starclass *net, const double *input)
{
    double layer[MAX_UNITS], next[MAX_UNITS];
    for (int i = 0; i < net->size[0]; i++)
        layer[i] = input[i] * net->in_scale[i] + net->in_bias[i];
    for (int l = 0; l + 1 < net->nlayers; l++) {
        for (int j = 0; j < net->size[l + 1]; j++) {
            double sum = net->weight[l][j][net->size[l]];
            for (int i = 0; i < net->size[l]; i++)
                sum += net->weight[l][j][i] * layer[i];
            next[j] = 1.0 / (1.0 + exp(-sum));
        }
        memcpy(layer, next, sizeof layer);
    }
    return (layer[0] - net->out_bias) / net->out_scale;
}

double rx_starclass_evaluate(const rx_starclass *net, const rx_source *s, double seeing, double scale,
                             double threshold)
{
    double input[INPUTS];
    double disc = seeing / scale * (seeing / scale); /* areas in units of the seeing squared */
    int n = 0;
    input[n++] = log10(s->iso[0] > 0 ? s->iso[0] / disc : 0.01);
    input[n++] = threshold > 0.0 ? log10(s->peak > 0.0 ? s->peak / threshold : 0.1) : -1.0;
    for (int i = 1; i < RX_NISO; i++)
        input[n++] = log10(s->iso[i] > 0 ? s->iso[i] / disc : 0.01);
    input[n++] = log10(seeing);
    return respond(net, input);
}
