/* The kernels of test_direct.c that a processor with wider vectors does not choose. */
#include <stdlib.h>

__attribute__((constructor)) static void no_wider(void)
{
    setenv("ONEDNN_MAX_CPU_ISA", "AVX2", 1);
    setenv("DNNL_MAX_CPU_ISA", "AVX2", 1);
}

#include "test_direct.c"
