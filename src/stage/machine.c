/* Instruction sets and libraries. */
#include "stage/machine.h"

#include <gnu/libc-version.h>

#include "detect/sep_extract.h"
#include "io/fits_read.h"
#include "io/wcs.h"
#include "nn/direct.h"
#include "num/fft.h"
#include "num/lsq.h"

#if defined(__x86_64__) || defined(__i386__)
static void add_processor(rx_text *dst)
{
    rx_text_add(dst, "x86");
#define ADD(name) rx_text_add(dst, __builtin_cpu_supports(name) ? " " name : "")
    ADD("sse4.2");
    ADD("avx");
    ADD("avx2");
    ADD("fma");
    ADD("avx512f");
    ADD("avx512dq");
    ADD("avx512bw");
    ADD("avx512vl");
    ADD("avx512vnni");
    ADD("avx512bf16");
#undef ADD
}
#elif defined(__aarch64__)
static void add_processor(rx_text *dst)
{
    rx_text_add(dst, "aarch64");
}
#else
static void add_processor(rx_text *dst)
{
    rx_text_add(dst, "another processor");
}
#endif

void rx_machine_describe(rx_text *dst)
{
    char fits[32];
    rx_fits_library(fits, sizeof fits);
    add_processor(dst);
#ifdef __VERSION__
    rx_text_add(dst, "; compiler " __VERSION__);
#endif
    rx_text_printf(dst, "; libc %s, %s, network on %s, sep %s, GSL %s, wcslib %s, cfitsio %s",
                   gnu_get_libc_version(), rx_fft_library(), rx_direct_name(), rx_sep_library(),
                   rx_lsq_library(), rx_wcs_library(), fits);
}
