/* Where sources stand so close that each is seen amid the light of others: there the residual is looked at again and
 * again, with sky and noise measured anew between the models. */
#ifndef RX_TEMPLATE_CROWD_H
#define RX_TEMPLATE_CROWD_H

#include "base/error.h"
#include "template/fit_image.h"

/* Cells of the image, [ny][nx], 1 where crowded. */
typedef struct rx_crowding {
    int width, height, nx, ny;
    uint8_t *cells; /* owned */
    double *odds;   /* [ny][nx], 2 ln of those that what looks extended is two stars; owned */
    int n, seen;    /* crowded ones; those with visible pixels in or around them */
} rx_crowding;

typedef struct rx_crowd_source {
    double x, y;     /* pixels */
    double star;     /* probability of a point; negative where it is too faint, or too bright, to say */
    double light[2]; /* as a point, extended */
    int hit;         /* it is none */
} rx_crowd_source;

/* A cell of about 64 pixels is crowded where, in it and the eight around it, models are brighter than the noise of a pixel
 * on more than a twentieth of the visible pixels, and sources are more than one in 70 areas of FWHM^2: a galaxy covers a cell,
 * too, and is no crowd. Of hits neither the number nor their share of the pixels counts. What looks extended there is most often two stars. A star has another one within 1.5 FWHM with the odds
 * e^x - 1, x the stars expected there; what looks extended beyond four times that is taken for galaxies. (validation/crowded.py cells,
 * seed 601, seven fields of stars that are not too dense to say: 0.9 to 2.9 times; 2000-4G, a fifth galaxies: 2.8; 700 stars and 700
 * galaxies per Mpixel, the crowded tile of the benchmark: 16. With a PSF that is 5 % too narrow stars count as galaxies.) Where more
 * than 1/e sources are seen within 1.5 FWHM of any place all may be stars.
 * mode RX_CROWDING_NO: none is, RX_CROWDING_YES: all are. Free the contents with rx_crowding_clear(). Errors: RX_SYSTEM. */
rx_status rx_crowding_find(rx_fit_image *image, const rx_crowd_source *sources, int n, double fwhm, int mode,
                           rx_crowding *dst, rx_error *err);

/* Cells in and around which more than four fifths of the light is extended, once pairs are no profiles any more, are no crowd: a
 * nebula, or a galaxy with its knots, is no sum of points and would be cut into ever more of them. Errors: RX_SYSTEM. */
rx_status rx_crowding_spare(const rx_crowd_source *sources, int n, rx_crowding *crowd, rx_error *err);
void rx_crowding_clear(rx_crowding *crowd);

/* Is the pixel in a crowded cell, or, beyond the border, next to one? NULL: it is not. */
int rx_crowding_at(const rx_crowding *crowd, int x, int y);
/* Where it is: 2 ln of the odds that what looks extended is two stars. */
double rx_crowding_pair_odds(const rx_crowding *crowd, int x, int y);
/* Share of the crowded cells where it is more likely one galaxy; 0 without any. */
double rx_crowding_galaxies(const rx_crowding *crowd);

#endif
