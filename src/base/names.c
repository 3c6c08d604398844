/* Names of outputs, and the two images of the dual-image mode. */
#include "base/names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"

char *rx_name_with_tag(const char *path, const char *tag)
{
    if (tag == NULL || tag[0] == '\0')
        return rx_strdup(path);
    const char *base = strrchr(path, '/');
    base = base != NULL ? base + 1 : path;
    const char *dot = strrchr(base, '.');
    size_t stem = dot != NULL && dot != base ? (size_t)(dot - path) : strlen(path);
    size_t bytes = strlen(path) + strlen(tag) + 2;
    char *name = malloc(bytes);
    if (name != NULL)
        snprintf(name, bytes, "%.*s_%s%s", (int)stem, path, tag, path + stem);
    return name;
}

bool rx_name_split_images(const char *images, char **detect, char **measure)
{
    *detect = *measure = NULL;
    int depth = 0;
    const char *comma = NULL;
    for (const char *c = images; *c != '\0' && comma == NULL; c++) {
        depth += (*c == '[') - (*c == ']');
        if (*c == ',' && depth <= 0)
            comma = c;
    }
    if (comma == NULL) {
        *detect = rx_strdup(images);
        return *detect != NULL;
    }
    *detect = strndup(images, (size_t)(comma - images));
    *measure = rx_strdup(comma + 1);
    if (*detect != NULL && *measure != NULL)
        return true;
    free(*detect);
    free(*measure);
    *detect = *measure = NULL;
    return false;
}

/* Cut `ending` off where the name is more than that. */
static void cut_ending(char *name, const char *ending)
{
    const size_t length = strlen(name), n = strlen(ending);
    if (length > n && strcasecmp(name + length - n, ending) == 0)
        name[length - n] = '\0';
}

char *rx_name_stem(const char *image)
{
    static const char *const packed[] = {".fz", ".gz", ".bz2", ".z"}, *const plain[] = {".fits", ".fit",
                                                                                        ".fts"};
    char *detect, *measure;
    if (!rx_name_split_images(image, &detect, &measure))
        return NULL;
    free(measure);
    const size_t length = strlen(detect);
    char *bracket = length > 0 && detect[length - 1] == ']' ? strchr(detect, '[') : NULL;
    if (bracket != NULL)
        *bracket = '\0';
    const char *slash = strrchr(detect, '/');
    if (slash != NULL)
        memmove(detect, slash + 1, strlen(slash));
    for (size_t i = 0; i < sizeof packed / sizeof packed[0]; i++)
        cut_ending(detect, packed[i]);
    for (size_t i = 0; i < sizeof plain / sizeof plain[0]; i++)
        cut_ending(detect, plain[i]);
    return detect;
}

char *rx_name_real(const char *path)
{
    char *real = realpath(path, NULL);
    char *plain = real == NULL ? rx_strdup(path) : NULL;
    if (plain == NULL)
        return real;
    size_t length = strlen(plain);
    while (length > 1 && plain[length - 1] == '/')
        plain[--length] = '\0';
    char *slash = strrchr(plain, '/');
    const char *name = slash != NULL ? slash + 1 : plain;
    char *folder = slash == NULL    ? rx_strdup(".")
                   : slash == plain ? rx_strdup("/")
                                    : strndup(plain, (size_t)(slash - plain));
    char *place = folder != NULL ? realpath(folder, NULL) : NULL;
    if (place != NULL) {
        const size_t bytes = strlen(place) + strlen(name) + 2;
        real = malloc(bytes);
        if (real != NULL)
            snprintf(real, bytes, "%s/%s", strcmp(place, "/") == 0 ? "" : place, name);
    }
    const bool no_memory = folder == NULL || (place != NULL && real == NULL);
    free(folder);
    free(place);
    if (real == NULL && !no_memory)
        return plain;
    free(plain);
    return real;
}
