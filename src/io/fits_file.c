/* Opening FITS files for reading. */
#include "io/fits_file.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/input.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "base/text.h"
#include "data/unit.h"
#include "io/cards.h"
#include "io/guard/guard.h"

/* CACHED_PIXELS: what is read is still in the cache when its bytes are swapped and its values looked at.
 * MOST_OF_TILE: pixels of a compressed tile, whose bytes cfitsio counts in an int. */
enum { CHUNK_PIXELS = 1 << 20, CACHED_PIXELS = 1 << 16, MOST_OF_TILE = 1 << 28 };

rx_status rx_fits_check(const rx_fits_source *source, rx_status kind, int status, const char *what,
                        rx_error *err)
{
    if (status == 0)
        return RX_OK;
    static const char held[] = "/proc/self/fd/"; /* the file as cfitsio names it, in a line of its own */
    char text[FLEN_STATUS] = "", line[FLEN_ERRMSG] = "", last[FLEN_ERRMSG] = "";
    fits_get_errstatus(status, text);
    while (fits_read_errmsg(line))
        if (strncmp(line, held, sizeof held - 1) == 0)
            last[0] = '\0';
        else if (line[0] != '\0')
            memcpy(last, line, sizeof last);
    if (status == MEMORY_ALLOCATION)
        return rx_error_at(err, RX_SYSTEM, source->path, source->hdu, 0,
                           "out of memory; free memory or cut the tile");
    return rx_error_at(err, kind, source->path, source->hdu, 0, "%s: %s%s%s%s", what, text,
                       last[0] != '\0' ? " (" : "", last, last[0] != '\0' ? ")" : "");
}

/* By the name that cfitsio has to be given. */
static rx_status open_literal(const char *literal, const char *path, rx_fits_source *dst, rx_error *err)
{
    int failed = 0;
    if (fits_open_diskfile(&dst->file, literal, READONLY, &failed) == 0)
        return RX_OK;
    dst->file = NULL; /* cfitsio could not make out the first header */
    if (failed != END_OF_FILE && failed != NO_END)
        return rx_fits_check(dst, RX_INPUT, failed, "cannot be read as FITS", err);
    fits_clear_errmsg();
    return rx_error_at(err, RX_INPUT, path, -1, 0,
                       "its header has no END: the file is cut off or damaged, fetch it again");
}

/* What the first bytes say when the file is not FITS; NULL when it may be. */
static const char *not_fits(const unsigned char *head, size_t n)
{
    static const char lfs[] = "version https://git-lfs";
    if (n == 0)
        return "is an empty file; fetch it again";
    if (n >= sizeof lfs - 1 && memcmp(head, lfs, sizeof lfs - 1) == 0)
        return "is a Git LFS pointer, not the data; run 'git lfs pull'";
    if (n >= 2 && head[0] == 0x1f && head[1] == 0x8b)
        return NULL; /* gzip */
    if (n >= 2 && head[0] == 0x1f && head[1] == 0x9d)
        return "is packed by compress; unpack it with gunzip";
    if (n >= 4 && memcmp(head, "BZh", 3) == 0)
        return NULL;
    if (n >= 4 && memcmp(head, "PK\3\4", 4) == 0)
        return "is a zip archive; unpack it";
    if (n >= 9 && memcmp(head, "SIMPLE  =", 9) == 0)
        return n < 80 ? "is cut off in its header; fetch it again" : NULL;
    size_t i = 0;
    while (i < n && isspace(head[i]))
        i++;
    if (i < n && head[i] == '<')
        return "is a web page, not FITS; the download failed, fetch it again";
    return "is not a FITS file: it does not begin with SIMPLE";
}

/* *is_held: it comes into memory, as it is packed as a whole, or plain and its last block is none. */
static rx_status check_file(const char *path, bool *is_held, rx_error *err)
{
    struct stat info;
    unsigned char head[160] = {0}; /* a file may be shorter than what is compared */
    if (stat(path, &info) != 0) {
        const char *hint = path[0] == '!' || strpbrk(path, "|") != NULL || strstr(path, "://") != NULL
                               ? "; only names of local files are read"
                               : "";
        return rx_error_at(err, RX_INPUT, path, -1, 0, "cannot be opened: %s%s", strerror(errno), hint);
    }
    if (S_ISDIR(info.st_mode))
        return rx_error_at(err, RX_INPUT, path, -1, 0, "is a folder, a FITS file was expected");
    if (!S_ISREG(info.st_mode))
        return rx_error_at(err, RX_INPUT, path, -1, 0, "is not a regular file; copy the data to one");
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        return rx_error_file(err, path, "cannot be opened");
    size_t n = fread(head, 1, sizeof head, file);
    int failed = ferror(file);
    fclose(file);
    if (failed)
        return rx_error_at(err, RX_INPUT, path, -1, 0, "cannot be read");
    *is_held = memcmp(head, "SIMPLE", 6) != 0 || info.st_size % RX_FITS_BLOCK != 0;
    const char *why = not_fits(head, n);
    return why != NULL ? rx_error_at(err, RX_INPUT, path, -1, 0, "%s", why) : RX_OK;
}

/* The file comes into one in memory, its last block filled up with zeros and its headers as cfitsio may see them. cfitsio
 * has memory of its own kind, but forgets there that it could not read a header, and takes the last HDU to be as long as its
 * header says. */
static rx_status open_held(const char *path, rx_fits_source *dst, rx_error *err)
{
    char begin[9] = "", literal[40];
    bool odd;
    rx_status status;
    const int to = memfd_create("rextract", MFD_CLOEXEC);
    if (to < 0)
        return rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be held in memory: %s", strerror(errno));
    RX_TRY_EXIT(rx_fits_unpack(path, to, &dst->bytes, err));
    if (rx_input_read(to, begin, sizeof begin, 0) != sizeof begin ||
        memcmp(begin, "SIMPLE  =", sizeof begin) != 0)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, -1, 0,
                                "is not a packed FITS file: what is in it does not begin with SIMPLE"));
    if (ftruncate(to, (off_t)rx_fits_held(dst)) != 0)
        RX_TRY_EXIT(
            rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be held in memory: %s", strerror(errno)));
    RX_TRY_EXIT(rx_fits_walk(to, true, path, &odd, err));
    snprintf(literal, sizeof literal, "/proc/self/fd/%d", to);
    status = open_literal(literal, path, dst, err);
exit:
    close(to); /* cfitsio has it open */
    return status;
}

void rx_fits_literal(const char *path, char dst[RX_FITS_LITERAL])
{
    snprintf(dst, RX_FITS_LITERAL, "%s%s", path[0] == '~' || path[0] == ' ' ? "./" : "", path);
}

static rx_status open_plain(const char *path, rx_fits_source *dst, rx_error *err)
{
    char literal[RX_FITS_LITERAL];
    bool odd = false;
    const int file = open(path, O_RDONLY | O_CLOEXEC);
    rx_status status = file >= 0 ? rx_fits_walk(file, false, path, &odd, err) : RX_OK; /* cfitsio says why */
    if (file >= 0)
        close(file);
    if (status != RX_OK)
        return status;
    if (odd)
        return open_held(path, dst, err);
    rx_fits_literal(path, literal);
    return open_literal(literal, path, dst, err);
}

rx_status rx_fits_open(const char *path, rx_fits_source *dst, rx_error *err)
{
    bool is_held = false;
    *dst = (rx_fits_source){.path = path, .hdu = -1};
    rx_status status = check_file(path, &is_held, err);
    fits_clear_errmsg();
    if (status == RX_OK)
        status = is_held ? open_held(path, dst, err) : open_plain(path, dst, err);
    int failed = 0;
    if (status == RX_OK)
        status = rx_fits_walk_open(dst->file, path, &failed, err);
    if (failed)
        status = rx_fits_check(dst, RX_INPUT, failed, "cannot be read", err);
    if (status != RX_OK)
        rx_fits_done(dst);
    return status;
}

size_t rx_fits_held(const rx_fits_source *source)
{
    return ((size_t)source->bytes + RX_FITS_BLOCK - 1) / RX_FITS_BLOCK * RX_FITS_BLOCK;
}

void rx_fits_done(rx_fits_source *source)
{
    int ignored = 0;
    if (source->file != NULL)
        fits_close_file(source->file, &ignored);
    fits_clear_errmsg();
    *source = (rx_fits_source){0};
}

/* --- names --- */

/* "3:20", "*" (to the end: last 0) or "3" into first and last; how many of the two are given, 0 when malformed. */
static int parse_range(const char **cursor, long *first, long *last)
{
    const char *c = *cursor + strspn(*cursor, " ");
    char *end = (char *)c + 1;
    int given = 2;
    *first = 1;
    *last = 0;
    if (*c != '*') {
        *first = *last = strtol(c, &end, 10);
        given = end != c && *end == ':' ? 2 : 1;
        if (given == 2) {
            c = end + 1;
            *last = strtol(c, &end, 10);
        }
        if (end == c || *first < 1 || *last < *first)
            return 0;
    }
    *cursor = end + strspn(end, " ");
    return given;
}

/* Two ranges, then perhaps places, "3" or "3:3" as cfitsio has it. */
static int parse_section(const char *group, rx_fits_name *dst)
{
    const char *c = group;
    for (int i = 0; i < RX_FITS_AXES; i++, c++) {
        long first, last;
        const int given = parse_range(&c, &first, &last);
        if (given == 0 || (i < 2 ? given == 1 : first != last))
            return 0;
        if (i < 2) {
            dst->section.first[i] = first;
            dst->section.last[i] = last;
        } else {
            dst->section.plane[i - 2] = first;
        }
        dst->has_section = *c == '\0' && i > 0;
        if (*c != ',')
            return dst->has_section;
    }
    return 0;
}

/* "2", "SCI" or "SCI,1". */
static int parse_extension(char *group, rx_fits_name *dst)
{
    char *end;
    long n = strtol(group, &end, 10);
    if (end != group && *end == '\0') {
        if (n < 0 || n > 100000)
            return 0;
        dst->hdu = (int)n;
        return 1;
    }
    char *comma = strchr(group, ',');
    if (comma != NULL) {
        n = strtol(comma + 1, &end, 10);
        if (end == comma + 1 || *end != '\0' || n < 1 || n > 100000)
            return 0;
        dst->extver = (int)n;
        *comma = '\0';
    }
    if (group[0] == '\0' || strlen(group) >= sizeof dst->extname || strpbrk(group, "#;=<>&|()'\"") != NULL)
        return 0;
    memcpy(dst->extname, group, strlen(group) + 1);
    return 1;
}

static rx_status parse_groups(const char *name, const char *brackets, rx_fits_name *dst, rx_error *err)
{
    for (const char *c = brackets; *c != '\0';) {
        char group[128];
        const char *end = *c == '[' ? strchr(c, ']') : NULL;
        if (end == NULL || end - c - 1 >= (long)sizeof group)
            goto malformed;
        memcpy(group, c + 1, (size_t)(end - c - 1));
        group[end - c - 1] = '\0';
        int is_section = strchr(group, ':') != NULL || strchr(group, '*') != NULL;
        if (is_section ? dst->has_section || !parse_section(group, dst)
                       : dst->has_section || rx_fits_name_selects(dst) || !parse_extension(group, dst))
            goto malformed;
        c = end + 1;
    }
    return RX_OK;
malformed:
    return rx_error_at(
        err, RX_INPUT, name, -1, 0,
        "cannot use '%s'; give [number], [NAME] or [NAME,version], then perhaps a section [x1:x2,y1:y2] with "
        "x1 <= x2 and y1 <= y2, counted from 1, of a cube with a plane [x1:x2,y1:y2,k]",
        brackets);
}

rx_status rx_fits_name_parse(const char *name, rx_fits_name *dst, rx_error *err)
{
    struct stat info;
    *dst = (rx_fits_name){.hdu = -1, .section.first = {1, 1}};
    if (name == NULL || name[0] == '\0')
        return rx_error_set(err, RX_INPUT, "the name of a FITS file is empty; give one");
    if (strcmp(name, "-") == 0 || strncmp(name, "stdin", 6) == 0)
        return rx_error_at(err, RX_INPUT, name, -1, 0, "standard input is not read; give the name of a file");
    const char *bracket = strchr(name, '[');
    size_t length = bracket != NULL && stat(name, &info) != 0 ? (size_t)(bracket - name) : strlen(name);
    if (length >= sizeof dst->path - 24)
        return rx_error_set(err, RX_INPUT, "a file name of %zu characters is too long", length);
    if (length == 0)
        return rx_error_at(err, RX_INPUT, name, -1, 0, "has no file name before '['");
    memcpy(dst->path, name, length);
    dst->path[length] = '\0';
    return parse_groups(name, name + length, dst, err);
}

int rx_fits_name_selects(const rx_fits_name *name)
{
    return name->hdu >= 0 || name->extname[0] != '\0';
}

/* --- moving about --- */

rx_status rx_fits_goto(rx_fits_source *source, int hdu, rx_error *err)
{
    const char *path = source->path;
    int failed = 0, count = 0;
    fits_clear_errmsg();
    source->hdu = hdu;
    if (fits_movabs_hdu(source->file, hdu + 1, NULL, &failed) == END_OF_FILE) {
        fits_clear_errmsg();
        RX_TRY(rx_fits_count(source, &count, NULL, err));
        return rx_error_at(err, RX_INPUT, path, hdu, 0,
                           "there is no such HDU; the file has %d, counted from 0", count);
    }
    return rx_fits_check(source, RX_INPUT, failed, "this HDU cannot be read", err);
}

rx_status rx_fits_goto_name(rx_fits_source *source, const rx_fits_name *name, rx_error *err)
{
    int failed = 0, number = 0;
    if (name->extname[0] == '\0')
        return rx_fits_goto(source, name->hdu, err);
    char wanted[72];
    memcpy(wanted, name->extname, sizeof wanted);
    fits_clear_errmsg();
    if (fits_movnam_hdu(source->file, ANY_HDU, wanted, name->extver, &failed)) {
        fits_clear_errmsg();
        return rx_error_at(err, RX_INPUT, name->path, -1, 0, "has no extension named '%s'%s", name->extname,
                           name->extver > 0 ? " of that version" : "");
    }
    fits_get_hdu_num(source->file, &number);
    source->hdu = number - 1;
    return RX_OK;
}

rx_status rx_fits_count(rx_fits_source *source, int *n, int *broken, rx_error *err)
{
    int failed = 0;
    for (*n = 0; fits_movabs_hdu(source->file, *n + 1, NULL, &failed) == 0;)
        ++*n;
    if (broken != NULL)
        *broken = failed != END_OF_FILE;
    if (rx_fits_is_unreadable(failed))
        return rx_fits_check(&(rx_fits_source){.path = source->path, .hdu = *n}, RX_INPUT, failed,
                             "this HDU cannot be read", err);
    fits_clear_errmsg();
    return RX_OK;
}

rx_status rx_fits_shape_of(const rx_fits_source *source, rx_fits_shape *dst, rx_error *err)
{
    fitsfile *file = source->file;
    int failed = 0, type = 0;
    *dst = (rx_fits_shape){0};
    fits_get_hdu_type(file, &type, &failed);
    dst->is_compressed = !failed && fits_is_compressed_image(file, &failed);
    dst->is_image = !failed && (type == IMAGE_HDU || dst->is_compressed);
    if (dst->is_image)
        fits_get_img_paramll(file, RX_FITS_AXES, &dst->bitpix, &dst->naxis, dst->axes, &failed);
    return rx_fits_check(source, RX_INPUT, failed, "this HDU cannot be read", err);
}

int rx_fits_is_plane(const rx_fits_shape *shape, const rx_fits_section *section)
{
    if (!shape->is_image || shape->naxis < 2 || shape->naxis > RX_FITS_AXES)
        return 0;
    for (int i = 2; i < shape->naxis; i++)
        if (shape->axes[i] != 1 && section->plane[i - 2] == 0)
            return 0;
    return 1;
}

/* --- sanity --- */

/* A compressed image is a table with one row for each tile: more pixels than the rows can
 * hold would make cfitsio allocate for nothing. */
static rx_status check_compressed(const rx_fits_source *source, const rx_fits_shape *shape, LONGLONG bytes,
                                  rx_error *err)
{
    LONGLONG tiles = 1, rows = 0, tile = 1;
    int failed = 0;
    const int bits = abs(shape->bitpix);
    if ((bits != 8 && bits != 16 && bits != 32 && bits != 64) || shape->bitpix == -8 || shape->bitpix == -16)
        return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0,
                           "ZBITPIX = %d of the compressed image is no kind of pixels; the header is damaged",
                           shape->bitpix);
    for (int i = 0; i < shape->naxis && i < 9; i++) {
        char key[FLEN_KEYWORD];
        LONGLONG length = i == 0 ? shape->axes[0] : 1;
        int absent = 0;
        snprintf(key, sizeof key, "ZTILE%d", i + 1);
        fits_read_key(source->file, TLONGLONG, key, &length, NULL, &absent);
        if (length < 1 || length > MOST_OF_TILE / tile)
            return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0,
                               "compressed image with a bad %s; the file is damaged, fetch it again", key);
        tile *= length;
        LONGLONG n = (shape->axes[i] + length - 1) / length;
        tiles = n > 0 && tiles > LLONG_MAX / n ? LLONG_MAX : tiles * n;
    }
    fits_clear_errmsg();
    fits_read_key(source->file, TLONGLONG, "NAXIS2", &rows, NULL, &failed);
    double pixels = (double)shape->axes[0] * (double)shape->axes[1];
    /* PLIO makes 2000 pixels of one byte, gzip 1000, Rice fewer; HCOMPRESS any number, but only of one value */
    if (failed || tiles != rows || pixels > 1e4 * (double)(bytes + 2880))
        return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0,
                           "compressed image of %lld x %lld pixels whose table has %lld rows in %lld bytes; "
                           "the file is damaged, fetch it again",
                           shape->axes[0], shape->axes[1], rows, bytes);
    return RX_OK;
}

/* cfitsio takes a scale or a BLANK that it cannot read as none: fluxes would be wrong without a word. */
static rx_status check_scale(const rx_fits_source *source, const rx_fits_shape *shape, rx_error *err)
{
    static const char *const keys[] = {"BSCALE", "BZERO", "BLANK"};
    for (int i = 0; i < (shape->bitpix > 0 ? 3 : 2); i++) {
        char text[FLEN_VALUE] = "";
        double value = 0;
        int failed = 0;
        fits_read_keyword(source->file, keys[i], text, NULL, &failed);
        const bool there = failed != KEY_NO_EXIST;
        const char *end = rx_card_number_end(text, text + strlen(text));
        const bool number = end != NULL && *end == '\0',
                   whole = i < 2 || strcspn(text, ".EeDd") == strlen(text);
        if (there && number)
            fits_read_key(source->file, TDOUBLE, keys[i], &value, NULL, &failed);
        fits_clear_errmsg();
        if (there && (failed || !number || !isfinite(value) || !whole))
            return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0,
                               "%s = %.40s is no number%s; correct the header, or fetch the file again",
                               keys[i], text, whole ? "" : " of a pixel value");
    }
    return RX_OK;
}

rx_status rx_fits_check_size(const rx_fits_source *source, const rx_fits_shape *shape, rx_error *err)
{
    fitsfile *file = source->file;
    LONGLONG start = 0, end = 0, axes[2] = {0, 0}, heap = 0;
    int failed = 0, absent = 0;
    fits_get_hduaddrll(file, NULL, &start, &end, &failed);
    RX_TRY(rx_fits_check(source, RX_INPUT, failed, "this HDU cannot be read", err));
    double bytes = 0;
    if (shape->is_image && !shape->is_compressed) {
        bytes = abs(shape->bitpix) / 8.;
        for (int i = 0; i < shape->naxis && i < 9; i++)
            bytes *= (double)shape->axes[i];
    } else {
        fits_read_key(file, TLONGLONG, "NAXIS1", &axes[0], NULL, &failed);
        fits_read_key(file, TLONGLONG, "NAXIS2", &axes[1], NULL, &failed);
        fits_read_key(file, TLONGLONG, "PCOUNT", &heap, NULL, &absent);
        fits_clear_errmsg();
        bytes = (double)axes[0] * (double)axes[1] + (double)heap;
    }
    double there = (double)((source->bytes > 0 ? source->bytes : file->Fptr->filesize) - start);
    if (there < 0)
        there = 0;
    if (failed || bytes > there)
        return rx_error_at(
            err, RX_INPUT, source->path, source->hdu, 0,
            "is cut off: the header says %.0f bytes of data, the file has %.0f; fetch it again", bytes,
            there);
    if (shape->is_image)
        RX_TRY(check_scale(source, shape, err));
    if (!shape->is_compressed)
        return RX_OK;
    RX_TRY(check_compressed(source, shape, (LONGLONG)bytes, err));
    return rx_fits_check_tiles(file, source->path, source->hdu, rx_min_int(shape->naxis, RX_FITS_AXES),
                               shape->axes, err);
}

rx_fits_section rx_fits_part(const rx_fits_name *name, const rx_fits_shape *shape)
{
    const long axes[2] = {(long)shape->axes[0], shape->naxis > 1 ? (long)shape->axes[1] : 1};
    rx_fits_section part = {.first = {1, 1}, .last = {axes[0], axes[1]}};
    for (int i = 0; name->has_section && i < 2; i++) {
        part.first[i] = name->section.first[i];
        part.last[i] = name->section.last[i] > 0 ? name->section.last[i] : axes[i];
    }
    for (int i = 0; i < RX_FITS_AXES - 2; i++)
        part.plane[i] = name->section.plane[i] > 0 ? name->section.plane[i] : 1;
    return part;
}

/* --- reading --- */

rx_status rx_fits_read_rows(const rx_fits_source *source, const rx_fits_section *part, size_t row, size_t n,
                            const double *null, void *dst, rx_error *err)
{
    long low[RX_FITS_AXES] = {part->first[0], part->first[1] + (long)row},
         high[RX_FITS_AXES] = {part->last[0], low[1] + (long)n - 1}, step[RX_FITS_AXES];
    double none = null != NULL ? *null : 0;
    int failed = 0, anynul = 0;
    for (int i = 0; i < RX_FITS_AXES; i++) {
        step[i] = 1;
        if (i >= 2)
            low[i] = high[i] = part->plane[i - 2];
    }
    fits_read_subset(source->file, null != NULL ? TDOUBLE : TFLOAT, low, high, step,
                     null != NULL ? &none : NULL, dst, &anynul, &failed);
    return rx_fits_check(source, RX_INPUT, failed, "the pixels cannot be read", err);
}

/* Are the pixels floats that need no arithmetic? */
static int holds_floats(fitsfile *file)
{
    int failed = 0, type = 0, equivalent = 0;
    fits_get_img_type(file, &type, &failed);
    fits_get_img_equivtype(file, &equivalent, &failed);
    const int compressed = fits_is_compressed_image(file, &failed);
    fits_clear_errmsg();
    return !failed && !compressed && type == FLOAT_IMG && equivalent == FLOAT_IMG;
}

/* The values of an image against what a float holds. */
typedef struct extent {
    size_t tiny, huge; /* pixels too small for a float's full precision but not 0, and too large */
    size_t others;     /* neither; not 0 */
    double brightest;  /* but for what stands for no data, from RX_PIXEL_MOST on */
    double huge_one;   /* of those too large, the last */
} extent;

/* An image of which all pixels are too large, or most too small and none is large: not the faint wings of one without noise. */
static rx_status check_extent(const extent *of, const rx_fits_source *source, rx_error *err)
{
    const bool large = of->huge > 0 && of->tiny + of->others == 0;
    const bool small = of->tiny > of->others && of->brightest < RX_PIXEL_MOST * (double)FLT_MIN;
    if (!large && !small)
        return RX_OK;
    const double value = large ? of->huge_one : of->brightest;
    return rx_error_at(
        err, RX_INPUT, source->path, source->hdu, 0,
        "its values, such as %.3g, are beyond what single precision holds; multiply them by 1e%d", value,
        (int)-floor(log10(value)));
}

/* These are read as they are: no doubles, no search for blank values. What is too small for a float's full
 * precision becomes 0, as cfitsio would have made it. */
static rx_status read_floats(const rx_fits_source *source, const rx_fits_section *part, float *dst,
                             rx_error *err)
{
    float brightest = 0.0f;
    extent all = {0};
    const long *first = part->first, *last = part->last;
    const size_t width = (size_t)(last[0] - first[0] + 1), height = (size_t)(last[1] - first[1] + 1);
    const size_t rows = CACHED_PIXELS / width + 1;
    for (size_t row = 0; row < height; row += rows) {
        const size_t n = height - row < rows ? height - row : rows;
        float *to = dst + row * width;
        RX_TRY(rx_fits_read_rows(source, part, row, n, NULL, to, err));
        unsigned tiny = 0, others = 0; /* of CACHED_PIXELS or a row */
#pragma omp simd reduction(+ : tiny, others) reduction(max : brightest)
        for (size_t i = 0; i < n * width; i++) {
            const float size = fabsf(to[i]);
            tiny += (size > 0.0f) & (size < FLT_MIN);
            others += (size >= FLT_MIN) & (size <= FLT_MAX);
            brightest = size < (float)RX_PIXEL_MOST && size > brightest ? size : brightest;
            to[i] = size < FLT_MIN ? 0.0f : size <= FLT_MAX ? to[i] : NAN;
        }
        all.tiny += tiny;
        all.others += others;
    }
    all.brightest = (double)brightest;
    return check_extent(&all, source, err);
}

rx_status rx_fits_read_pixels(const rx_fits_source *source, const rx_fits_section *part, float *dst,
                              rx_error *err)
{
    rx_status status = RX_OK;
    const long *first = part->first, *last = part->last;
    size_t width = (size_t)(last[0] - first[0] + 1), height = (size_t)(last[1] - first[1] + 1);
    size_t rows = CHUNK_PIXELS / width + 1;
    rows = rows < height ? rows : height;
    extent all = {0};
    if (holds_floats(source->file))
        return read_floats(source, part, dst, err);
    double *buffer;
    RX_TRY(RX_MAKE(buffer, rows * width, err));
    fits_clear_errmsg();
    for (size_t row = 0; row < height; row += rows) {
        size_t n = height - row < rows ? height - row : rows;
        const double null = NAN;
        RX_TRY_EXIT(rx_fits_read_rows(source, part, row, n, &null, buffer, err));
        for (size_t i = 0; i < n * width; i++) {
            const double size = fabs(buffer[i]);
            all.tiny += size > 0.0 && size < (double)FLT_MIN;
            all.huge += size > (double)FLT_MAX && size <= DBL_MAX;
            all.others += size >= (double)FLT_MIN && size <= (double)FLT_MAX;
            all.brightest = size < RX_PIXEL_MOST ? fmax(all.brightest, size) : all.brightest;
            all.huge_one = size > (double)FLT_MAX && size <= DBL_MAX ? size : all.huge_one;
            dst[row * width + i] = size <= (double)FLT_MAX ? (float)buffer[i]
                                   : size <= DBL_MAX       ? copysignf(INFINITY, (float)buffer[i])
                                                           : NAN;
        }
    }
    status = check_extent(&all, source, err);
exit:
    free(buffer);
    return status;
}

/* How the header of a compressed image calls the keywords of the image, in the order in which that one must
 * begin; the last of them may stand anywhere. */
static const char *const image_keys[][2] = {
    {"ZSIMPLE", "SIMPLE"},   {"ZTENSION", "XTENSION"}, {"ZBITPIX", "BITPIX"},  {"ZNAXIS", "NAXIS"},
    {"ZNAXIS1", "NAXIS1"},   {"ZNAXIS2", "NAXIS2"},    {"ZNAXIS3", "NAXIS3"},  {"ZNAXIS4", "NAXIS4"},
    {"ZNAXIS5", "NAXIS5"},   {"ZNAXIS6", "NAXIS6"},    {"ZNAXIS7", "NAXIS7"},  {"ZNAXIS8", "NAXIS8"},
    {"ZNAXIS9", "NAXIS9"},   {"ZPCOUNT", "PCOUNT"},    {"ZGCOUNT", "GCOUNT"},  {"ZEXTEND", "EXTEND"},
    {"ZBLOCKED", "BLOCKED"}, {"ZHECKSUM", "CHECKSUM"}, {"ZDATASUM", "DATASUM"}};
enum { IMAGE_KEYS = sizeof image_keys / sizeof *image_keys, ORDERED = 15 };

static void add_renamed(rx_text *dst, const char *card, const char *key)
{
    char name[9];
    snprintf(name, sizeof name, "%-8s", key);
    rx_text_add_bytes(dst, name, 8);
    rx_text_add_bytes(dst, card + 8, 72);
}

/* The header of the image out of that of the table it is compressed in. BSCALE and others of the image may
 * stand before ZTENSION, where cfitsio would take them for the begin of the header. */
static void image_cards(const rx_text *table, rx_text *dst)
{
    static const char *const dropped[] = {"XTENSION", "BITPIX",   "NAXIS",    "NAXIS#", "PCOUNT", "GCOUNT",
                                          "TFIELDS",  "TTYPE#",   "TFORM#",   "THEAP",  "ZIMAGE", "ZQUANTIZ",
                                          "ZDITHER0", "ZTILE#",   "ZCMPTYPE", "ZBLANK", "ZNAME#", "ZVAL#",
                                          "ZMASKCMP", "CHECKSUM", "DATASUM"};
    const char *end = table->data + table->length;
    for (int k = 0; k < ORDERED; k++) {
        if (k == 2 && dst->length == 0)
            rx_text_printf(dst, "%-80s",
                           "SIMPLE  =                    T / file does conform to FITS standard");
        for (const char *card = table->data; card < end; card += 80)
            if (rx_card_is(card, image_keys[k][0]))
                add_renamed(dst, card, image_keys[k][1]);
    }
    for (const char *card = table->data; card < end; card += 80) {
        bool kept = !rx_card_is(card, "EXTNAME") || strncmp(card + 8, "= 'COMPRESSED_IMAGE'", 20) != 0;
        int key = 0;
        for (size_t i = 0; i < sizeof dropped / sizeof *dropped; i++)
            kept &= !rx_card_is(card, dropped[i]);
        while (key < IMAGE_KEYS && !rx_card_is(card, image_keys[key][0]))
            key++;
        if (kept && key == IMAGE_KEYS)
            rx_text_add_bytes(dst, card, 80);
        else if (kept && key >= ORDERED)
            add_renamed(dst, card, image_keys[key][1]);
    }
}

/* Keywords of small letters, which cfitsio finds, become what they stand for; what FITS does not allow '?'. */
static void add_as_read(rx_text *dst, const char *as_read)
{
    char card[FLEN_CARD];
    snprintf(card, sizeof card, "%-80.80s", as_read);
    for (int i = 0; i < 80; i++) {
        if ((unsigned char)card[i] < 0x20 || (unsigned char)card[i] > 0x7e)
            card[i] = '?';
        if (i < 8)
            card[i] = (char)toupper((unsigned char)card[i]);
    }
    rx_text_add_bytes(dst, card, 80);
}

rx_status rx_fits_read_cards(const rx_fits_source *source, char **cards, size_t *ncards, rx_error *err)
{
    int failed = 0, n = 0;
    rx_text text = {0}, image = {0};
    rx_status status = RX_OK;
    fits_clear_errmsg();
    const int compressed = fits_is_compressed_image(source->file, &failed);
    fits_get_hdrspace(source->file, &n, NULL, &failed);
    for (int i = 1; i <= n && !failed; i++) {
        char card[FLEN_CARD] = "";
        if (fits_read_record(source->file, i, card, &failed) == 0)
            add_as_read(&text, card);
    }
    RX_TRY_EXIT(rx_fits_check(source, RX_INPUT, failed, "the header cannot be read", err));
    if (compressed)
        image_cards(&text, &image);
    rx_text *wanted = compressed ? &image : &text;
    rx_text_add(wanted, "");
    if (text.failed || wanted->failed)
        RX_TRY_EXIT(rx_error_memory(err, text.length));
    *cards = wanted->data;
    *ncards = wanted->length / 80;
    *wanted = (rx_text){0};
exit:
    rx_text_free(&text);
    rx_text_free(&image);
    return status;
}
