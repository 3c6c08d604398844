"""The extension rextract._librextract: librextract by cffi in API mode.

A compiler reads the installed headers, so that a struct or a function that is not what stands below is an error of the
build, and never a wrong number; what stands as "..." is the headers' alone. cffi's ABI mode would need no compiler, but
believes every layout that it is given.
"""
import re
import shlex
import subprocess

from cffi import FFI


def pkg_config(option):
    return shlex.split(subprocess.run(["pkg-config", option, "librextract"], check=True, text=True,
                                      stdout=subprocess.PIPE).stdout)


DECLARATIONS = """
typedef enum { RX_OK, RX_USAGE, RX_INPUT, RX_SYSTEM, RX_GATE_FAIL, RX_GATE_INSUFFICIENT, RX_INTERRUPTED, RX_SOME_FAILED,
    RX_DIFFERENT, RX_NOT_RESTORED, ... } rx_status;
typedef struct { rx_status status; char where[...]; int hdu; long line; char text[...]; bool (*stop)(void *); void *user;
    ...; } rx_error;
void rx_error_format(const rx_error *err, const char *program, char *dst, size_t size);

typedef enum { RX_QUIET, RX_NORMAL, RX_FULL, ... } rx_verbosity;
typedef enum { RX_LOG_WARNING, RX_LOG_INFO, RX_LOG_DETAIL, ... } rx_log_kind;
typedef struct { ...; } rx_log;
void rx_log_calls(rx_log *log, rx_verbosity level, void (*message)(void *, rx_log_kind, const char *),
    void (*progress)(void *, const char *, double), void *user);

typedef enum { RX_CELL_INT16, RX_CELL_INT32, RX_CELL_INT64, RX_CELL_FLOAT, RX_CELL_DOUBLE, RX_CELL_TEXT, ... } rx_cell_type;
typedef struct { char name[...]; char unit[...]; char ucd[...]; char description[...]; rx_cell_type type; int ndim;
    int dim[2]; int text_width; void *data; ...; } rx_column;
typedef struct { char *name; long nrows; int ncolumns; rx_column *columns; ...; } rx_table;
long rx_column_elements(const rx_column *column);
long rx_column_element_size(const rx_column *column);
typedef struct { int n; char *(*pairs)[3]; ...; } rx_record;

typedef struct { const char *column; int bit; const char *name; const char *meaning; ...; } rx_flag;
const rx_flag *rx_flags(int *n);

typedef enum { RX_PSF_BY_NOTHING, ... } rx_psf_how;
const char *rx_psf_how_name(rx_psf_how how);
typedef struct { rx_psf_how how; int reserved; double flux_error; ...; } rx_psf_quality;
typedef struct { int size; double fwhm; double ellipticity; double beta; int nstars; double fwhm_error;
    double (*stars)[2]; rx_psf_quality quality; char description[...]; ...; } rx_psf;
void rx_psf_at(const rx_psf *psf, double x, double y, float *stamp);
double rx_psf_flux_error(const rx_psf *psf, double x, double y);

typedef struct { double global_level; double global_sigma; ...; } rx_background;
typedef struct { ...; } rx_map;
rx_map rx_background_level(const rx_background *sky);
rx_map rx_background_noise(const rx_background *sky);
void rx_map_fill(const rx_map *map, int height, int nthreads, float *dst);

typedef struct { float *pixels; ...; } rx_tile;
typedef struct { const char *name; int width; int height; const float *pixels; const uint8_t *mask; const float *weight;
    const char *cards; size_t ncards; ...; } rx_tile_arrays;
typedef struct { rx_tile *tile; uint8_t *mask; rx_background *plain; rx_background *restored; rx_psf *psf; ...; } rx_field;
typedef struct { const char *name; int width; int height; float *pixels; uint8_t *mask; rx_psf *psf; rx_psf *blur; ...; }
    rx_restored;
typedef struct { int n; int32_t *segments; ...; } rx_sources;
typedef struct { rx_restored *restored; rx_sources *sources; int plain; ...; } rx_result;

typedef struct { const char *name; const char *value; ...; } rx_job_setting;
typedef struct { const char *config; const rx_job_setting *settings; int nsettings; const char *const *columns;
    int ncolumns; bool psf_only; ...; } rx_job;
typedef struct { int width; int height; const float *pixels; ...; } rx_psf_pixels;
typedef struct { const rx_tile_arrays *detect; const rx_tile_arrays *measure; const rx_psf *psf[2];
    const rx_psf_pixels *image_of_psf[2]; ...; } rx_job_images;
typedef struct { rx_field *detect; rx_field *measure; rx_result result; rx_table *table; rx_table *injected;
    rx_record facts; ...; } rx_job_result;
rx_status rx_job_arrays(const rx_job *job, const rx_job_images *images, rx_log *log, rx_job_result *dst, rx_error *err);
void rx_job_result_free(rx_job_result *result);
rx_status rx_job_files(const rx_job *job, const char *image, rx_log *log, rx_error *err);
const char *rx_job_version(void);

extern "Python" bool rextract_stop(void *);
extern "Python" void rextract_message(void *, rx_log_kind, const char *);
extern "Python" void rextract_progress(void *, const char *, double);
"""

builder = FFI()
builder.cdef(DECLARATIONS)
libraries = pkg_config("--libs-only-L")
folders = [flag[2:] for flag in libraries]
# Where the linker of the system does not look, the extension must.
searched = [folder for folder in folders if not re.match(r"/(usr/)?lib(/|$|64)", folder)]
builder.set_source("rextract._librextract", """
#include "base/error.h"
#include "base/log.h"
#include "catalog/catalog.h"
#include "data/flags.h"
#include "data/map.h"
#include "stage/job.h"
""", extra_compile_args=pkg_config("--cflags"), library_dirs=folders, runtime_library_dirs=searched, libraries=["rextract"])

if __name__ == "__main__":
    builder.compile(verbose=True)
