/* What surveys deliver besides: correlated and uneven noise, edges, waves, holes, defects (scenes_survey.c), and the
 * correlations (scenes_noise.c). */
#ifndef RX_TRAIN_SCENES_SURVEY_H
#define RX_TRAIN_SCENES_SURVEY_H

#include "num/fft.h"
#include "train/scenes_field.h"

typedef enum rx_correlation_kind {
    RX_CORRELATION_NONE,
    RX_CORRELATION_GAUSS,   /* size: FWHM, pixels */
    RX_CORRELATION_LINEAR,  /* size: shift, 0..1 pixel; so for the next two */
    RX_CORRELATION_CUBIC,   /* Keys 1981, a = -1/2 */
    RX_CORRELATION_LANCZOS, /* 3 lobes, sum 1 */
    RX_CORRELATION_DRIZZLE, /* size: side of the drop, pixels of the image */
} rx_correlation_kind;

/* What has become of white noise; x and y. */
typedef struct rx_correlation {
    rx_correlation_kind kind;
    double size[2];
} rx_correlation;

/* |transfer|^2 of one direction at a frequency, cycles per pixel. */
double rx_correlation_power(const rx_correlation *c, int direction, double frequency);

/* filter (a complex plane of fft) for rx_fft_filter(), from white noise of rms 1 to such noise. optics: the
 * spectrum of the PSF, to whose matched filter both are of the same width. Errors: RX_SYSTEM. */
rx_status rx_correlation_filter(const rx_correlation *c, const rx_fft *fft, const float *optics,
                                float *filter, rx_error *err);

/* rms of the errors of given PSFs: ln FWHM, b/a, ln beta; cut at 3 of them */
#define RX_SURVEY_FWHM 0.03
#define RX_SURVEY_RATIO 0.03
#define RX_SURVEY_BETA 0.05
/* largest drop of drizzle, pixels of the image */
#define RX_SURVEY_DROP 2.0

/* What one sample comes with: of what does not, 0. */
enum { RX_SURVEY_MOST = 3 };
typedef struct rx_survey {
    rx_correlation correlation;
    int window, side; /* pixels: of its planes, and of the patch in their middle */
    int uneven, nedges, nwaves, nholes, defects;
    double slope[2], centre; /* of ln g, per pixel, 0 in the centre */
    struct {
        double a, b, c, step;
    } edge[RX_SURVEY_MOST]; /* a x + b y + c, pixels beyond the edge */
    struct {
        double u, v, phase, height;
    } wave[RX_SURVEY_MOST];
    struct {
        double x, y, xx, yy, xy, depth;
    } hole[RX_SURVEY_MOST];        /* exponent: xx dx^2 ... */
    double sky, fwhm, ratio, beta; /* offset; what the PSF as given is wrong by: factors, minor axis added */
    int no_halo;                   /* its halo is not in the PSF as given */
    rx_scenes_key key;
} rx_survey;

void rx_survey_draw(const rx_scenes_survey *par, rx_scenes_key key, int window, int side, double fwhm,
                    rx_survey *dst);
/* At pixel (x, y) of the window: ln g, ln s, and waves and holes. */
double rx_survey_noise(const rx_survey *survey, double x, double y);
double rx_survey_scale(const rx_survey *survey, double x, double y);
double rx_survey_light(const rx_survey *survey, double x, double y);
/* pixels [window][window] += cosmic rays and bad columns. */
void rx_survey_defects(const rx_survey *survey, float *pixels);

#endif
