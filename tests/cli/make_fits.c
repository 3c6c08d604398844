/* make_fits KIND FILE [CARD...]: small FITS files, good and broken ones, for the command line tests. Written
 * byte by byte without cfitsio, which would refuse to make most of them. A CARD ("NAXIS1  = 7") takes the
 * place of the one of that key in the last header, or comes at its end. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK = 2880, CARD = 80, SIDE = 96 };

typedef struct header {
    char text[8 * BLOCK];
    size_t length;
} header;

static void card(header *h, const char *name, const char *value)
{
    char line[CARD + 1];
    snprintf(line, sizeof line, "%-8s= %20s", name, value);
    memset(h->text + h->length, ' ', CARD);
    memcpy(h->text + h->length, line, strlen(line));
    h->length += CARD;
}

static void number(header *h, const char *name, long value)
{
    char text[24];
    snprintf(text, sizeof text, "%ld", value);
    card(h, name, text);
}

static void word(header *h, const char *name, const char *value)
{
    char line[CARD + 1];
    snprintf(line, sizeof line, "%-8s= '%-8s'", name, value);
    memset(h->text + h->length, ' ', CARD);
    memcpy(h->text + h->length, line, strlen(line));
    h->length += CARD;
}

/* First cards of an image HDU; axes: naxis lengths. */
static void image_header(header *h, int extension, long bitpix, int naxis, const long *axes)
{
    h->length = 0;
    if (extension)
        word(h, "XTENSION", "IMAGE");
    else
        card(h, "SIMPLE", "T");
    number(h, "BITPIX", bitpix);
    number(h, "NAXIS", naxis);
    for (int i = 0; i < naxis; i++) {
        char name[24];
        snprintf(name, sizeof name, "NAXIS%d", i + 1);
        number(h, name, axes[i]);
    }
    if (extension) {
        number(h, "PCOUNT", 0);
        number(h, "GCOUNT", 1);
    }
}

static void put_header(FILE *file, header *h, int with_end)
{
    memset(h->text + h->length, ' ', CARD);
    memcpy(h->text + h->length, with_end ? "END" : "COMMENT", with_end ? 3 : 7);
    h->length += CARD;
    while (h->length % BLOCK != 0)
        h->text[h->length++] = ' ';
    fwrite(h->text, 1, h->length, file);
}

static void put_u32(FILE *file, uint32_t bits)
{
    const unsigned char bytes[4] = {(unsigned char)(bits >> 24), (unsigned char)(bits >> 16),
                                    (unsigned char)(bits >> 8), (unsigned char)bits};
    fwrite(bytes, 1, 4, file);
}

static void put_float(FILE *file, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    put_u32(file, bits);
}

static void fill(FILE *file)
{
    while (ftell(file) % BLOCK != 0)
        fputc(0, file);
}

/* Noise of width 1: the sum of 12 uniform numbers minus 6. */
static double noise(uint64_t *state)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        *state = *state * 6364136223846793005u + 1442695040888963407u;
        sum += (double)(*state >> 11) / 9007199254740992.0;
    }
    return sum;
}

/* Sky 100, noise 2, and 16 stars of FWHM 3 pixels with peaks of 300 to 1800. */
static double sky_pixel(int x, int y, uint64_t *state)
{
    double value = 100.0 + 2.0 * noise(state);
    for (int i = 0; i < 16; i++) {
        double dx = x - (12.0 + 24.0 * (i % 4) + 0.37 * (i % 3)),
               dy = y - (11.0 + 24.0 * (i / 4) + 0.21 * (i % 5));
        value += 100.0 * (3 + i) * exp(-2.7726 * (dx * dx + dy * dy) / 9.0);
    }
    return value;
}

static void put_plane(FILE *file, int width, int height, uint64_t seed)
{
    uint64_t state = seed;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            put_float(file, (float)sky_pixel(x, y, &state));
}

static void put_tile(FILE *file, int width, int height, uint64_t seed)
{
    put_plane(file, width, height, seed);
    fill(file);
}

static void put_cube(FILE *file)
{
    for (uint64_t seed = 1; seed <= 3; seed++)
        put_plane(file, SIDE, SIDE, seed);
    fill(file);
}

static void put_constant(FILE *file, long n, float value)
{
    for (long i = 0; i < n; i++)
        put_float(file, value);
    fill(file);
}

static void put_gauss(FILE *file, int width, int height, double fwhm)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            double dx = x - width / 2, dy = y - height / 2;
            put_float(file, (float)exp(-2.7726 * (dx * dx + dy * dy) / (fwhm * fwhm)));
        }
    fill(file);
}

/* A primary image of one kind of pixels. */
static void plain(FILE *file, long bitpix, int width, int height, const char *pixels, float value)
{
    static header h;
    const long axes[2] = {width, height};
    image_header(&h, 0, bitpix, 2, axes);
    put_header(file, &h, 1);
    if (strcmp(pixels, "tile") == 0)
        put_tile(file, width, height, 1);
    else if (strcmp(pixels, "gauss") == 0)
        put_gauss(file, width, height, value);
    else
        put_constant(file, (long)width * height, value);
}

static void put_table(FILE *file, const char *form)
{
    static header h;
    h.length = 0;
    image_header(&h, 0, 8, 0, NULL);
    card(&h, "EXTEND", "T");
    put_header(file, &h, 1);
    h.length = 0;
    word(&h, "XTENSION", "BINTABLE");
    number(&h, "BITPIX", 8);
    number(&h, "NAXIS", 2);
    number(&h, "NAXIS1", 12);
    number(&h, "NAXIS2", 16);
    number(&h, "PCOUNT", 0);
    number(&h, "GCOUNT", 1);
    number(&h, "TFIELDS", 3);
    word(&h, "TTYPE1", "X_IMAGE");
    word(&h, "TFORM1", form);
    word(&h, "TTYPE2", "Y_IMAGE");
    word(&h, "TFORM2", form);
    word(&h, "TTYPE3", "MAG_AUTO");
    word(&h, "TFORM3", form);
    word(&h, "EXTNAME", "OBJECTS");
    put_header(file, &h, 1);
    for (int i = 0; i < 16; i++) { /* the stars of put_tile */
        put_float(file, (float)(13.0 + 24.0 * (i % 4) + 0.37 * (i % 3)));
        put_float(file, (float)(12.0 + 24.0 * (i / 4) + 0.21 * (i % 5)));
        put_float(file, (float)(-2.5 * log10(100.0 * (3 + i) * 10.198)));
    }
    fill(file);
}

static void put_extensions(FILE *file)
{
    static header h;
    const long axes[2] = {SIDE, SIDE};
    image_header(&h, 0, 8, 0, NULL);
    card(&h, "EXTEND", "T");
    put_header(file, &h, 1);
    for (int i = 0; i < 2; i++) {
        image_header(&h, 1, -32, 2, axes);
        word(&h, "EXTNAME", i == 0 ? "CCD1" : "CCD2");
        put_header(file, &h, 1);
        put_tile(file, SIDE, SIDE, (uint64_t)i + 1);
    }
}

/* As Rubin's pipelines write an image with its maps; the lowest rows are bad. */
static void put_calexp(FILE *file)
{
    enum { ROWS = 8, BAD = 3 };
    static header h;
    const long axes[2] = {SIDE, SIDE};
    image_header(&h, 0, 8, 0, NULL);
    card(&h, "EXTEND", "T");
    put_header(file, &h, 1);
    image_header(&h, 1, -32, 2, axes);
    word(&h, "EXTNAME", "IMAGE");
    put_header(file, &h, 1);
    put_tile(file, SIDE, SIDE, 1);
    image_header(&h, 1, 32, 2, axes);
    word(&h, "EXTNAME", "MASK");
    number(&h, "MP_BAD", BAD);
    put_header(file, &h, 1);
    for (int i = 0; i < SIDE * SIDE; i++)
        put_u32(file, i < ROWS * SIDE ? 1u << BAD : 0);
    fill(file);
    image_header(&h, 1, -32, 2, axes);
    word(&h, "EXTNAME", "VARIANCE");
    put_header(file, &h, 1);
    put_constant(file, (long)SIDE * SIDE, 25);
}

/* Headers that lie or break off. */
static int broken(FILE *file, const char *kind)
{
    static header h;
    long axes[4] = {SIDE, SIDE, 3, 2};
    if (strcmp(kind, "bitpix") == 0) {
        image_header(&h, 0, 7, 2, axes);
    } else if (strcmp(kind, "huge") == 0) {
        axes[0] = axes[1] = 1000000;
        image_header(&h, 0, -32, 2, axes);
    } else if (strcmp(kind, "overflow") == 0) {
        axes[0] = axes[1] = 4000000000;
        image_header(&h, 0, -64, 2, axes);
    } else if (strcmp(kind, "negative") == 0) {
        axes[0] = -SIDE;
        image_header(&h, 0, -32, 2, axes);
    } else if (strcmp(kind, "zero") == 0) {
        axes[0] = 0;
        image_header(&h, 0, -32, 2, axes);
    } else if (strcmp(kind, "line") == 0) {
        image_header(&h, 0, -32, 1, axes);
    } else if (strcmp(kind, "cube") == 0) {
        image_header(&h, 0, -32, 3, axes);
    } else if (strcmp(kind, "primary-only") == 0 || strcmp(kind, "endless") == 0) {
        image_header(&h, 0, 8, 0, axes);
    } else {
        return 0;
    }
    put_header(file, &h, strcmp(kind, "endless") != 0);
    if (strcmp(kind, "line") == 0)
        put_constant(file, SIDE, 1.0f);
    else if (strcmp(kind, "cube") == 0)
        put_cube(file);
    else if (strcmp(kind, "primary-only") != 0 && strcmp(kind, "endless") != 0)
        put_constant(file, BLOCK / 4, 1.0f);
    return 1;
}

static int whole(FILE *file, const char *kind)
{
    static const struct {
        const char *kind, *pixels;
        int width, height;
        float value;
    } kinds[] = {
        {"tile", "tile", SIDE, SIDE, 0},       {"small", "tile", 64, 48, 0},
        {"large", "tile", 700, 600, 0},        {"flat", "constant", SIDE, SIDE, 100},
        {"ones", "constant", SIDE, SIDE, 1},   {"zeros", "constant", SIDE, SIDE, 0},
        {"nan", "constant", SIDE, SIDE, NAN},  {"infinite", "constant", SIDE, SIDE, INFINITY},
        {"minus", "constant", SIDE, SIDE, -1}, {"pixel", "constant", 1, 1, 5},
        {"psf", "gauss", 15, 15, 3},           {"psf-zero", "constant", 15, 15, 0},
        {"psf-minus", "constant", 15, 15, -1}, {"psf-nan", "constant", 15, 15, NAN},
        {"psf-large", "gauss", 201, 201, 40},
    };
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++)
        if (strcmp(kind, kinds[i].kind) == 0) {
            plain(file, -32, kinds[i].width, kinds[i].height, kinds[i].pixels, kinds[i].value);
            return 1;
        }
    return 0;
}

/* Where the last header of the file begins. */
static size_t last_header(const char *text, size_t length)
{
    size_t last = 0;
    for (size_t at = 0; at + BLOCK <= length; at += BLOCK)
        if (memcmp(text + at, "XTENSION= ", 10) == 0)
            last = at;
    return last;
}

/* The header with the cards in it; what follows it stays. */
static int amend(const char *name, int ncards, char **cards)
{
    static char text[1 << 22];
    static header h;
    h.length = 0;
    FILE *file = fopen(name, "rb");
    const size_t length = file != NULL ? fread(text, 1, sizeof text, file) : 0,
                 start = last_header(text, length);
    if (file == NULL || fclose(file) != 0 || (file = fopen(name, "wb")) == NULL)
        return 0;
    size_t at = start;
    for (; at + CARD <= length && memcmp(text + at, "END     ", 8) != 0; at += CARD, h.length += CARD)
        memcpy(h.text + h.length, text + at, CARD);
    for (int i = 0; i < ncards; i++) {
        size_t place = 0, n = strlen(cards[i]);
        while (place < h.length && strncmp(h.text + place, cards[i], 8) != 0)
            place += CARD;
        if (place == h.length)
            h.length += CARD;
        memset(h.text + place, ' ', CARD);
        memcpy(h.text + place, cards[i], n < CARD ? n : CARD);
    }
    at = (at + CARD + BLOCK - 1) / BLOCK * BLOCK;
    fwrite(text, 1, start, file);
    put_header(file, &h, 1);
    fwrite(text + at, 1, length > at ? length - at : 0, file);
    return (ferror(file) | fclose(file)) == 0;
}

int main(int argc, char **argv)
{
    FILE *file = argc >= 3 ? fopen(argv[2], "wb") : NULL;
    int known = file != NULL;
    if (!known)
        fprintf(stderr, "usage: make_fits KIND FILE [CARD...]\n");
    else if (strcmp(argv[1], "extensions") == 0)
        put_extensions(file);
    else if (strcmp(argv[1], "calexp") == 0)
        put_calexp(file);
    else if (strcmp(argv[1], "table") == 0)
        put_table(file, "E");
    else if (strcmp(argv[1], "table-form") == 0)
        put_table(file, "9Q9");
    else
        known = whole(file, argv[1]) || broken(file, argv[1]);
    if (file != NULL && (ferror(file) | fclose(file)) != 0)
        known = 0;
    if (known && argc > 3)
        known = amend(argv[2], argc - 3, argv + 3);
    return known ? 0 : 1;
}
