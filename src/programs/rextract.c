/* rextract: a tile in, or a list of them; restored images, catalogues and reports out. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "programs/extract.h"
#include "survey/replay.h"

/* Started by mpiexec as one of several? Each launcher says so in its own words. */
static int one_of_several(void)
{
    static const char *const counts[] = {"PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MPI_LOCALNRANKS"};
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        const char *count = getenv(counts[i]);
        if (count != NULL && atoi(count) > 1)
            return 1;
    }
    return 0;
}

/* Linking MPI would cost every run tens of libraries at its start, so that it lives in a program of its own
 * beside this one, which takes over under mpiexec. */
static int hand_over(char **argv)
{
    char path[4096];
    const ssize_t length = readlink("/proc/self/exe", path, sizeof path);
    char *slash = length > 0 && (size_t)length < sizeof path ? memrchr(path, '/', (size_t)length) : NULL;
    if (slash != NULL && slash + sizeof "/rextract-mpi" <= path + sizeof path) {
        memcpy(slash, "/rextract-mpi", sizeof "/rextract-mpi");
        execv(path, argv);
    }
    fputs("rextract: started by mpiexec, but there is no rextract-mpi beside it; build with MPICH "
          "(libmpich-dev), or start it without mpiexec\n",
          stderr);
    return (int)RX_SYSTEM;
}

int main(int argc, char **argv)
{
    return one_of_several()
               ? hand_over(argv)
               : rx_program_extract("rextract", rx_program_extract_alone, rx_replay_run, NULL, argc, argv);
}
