/* rextract: a tile in, or a list of them; restored images, catalogues and reports out. */
#include <string.h>
#include <unistd.h>

#include "programs/extract.h"

/* Linking MPI would cost every run tens of libraries at its start, so that it lives in a program of its own
 * beside this one, which takes over under mpiexec. */
static void hand_over(char **argv)
{
    char path[4096];
    const ssize_t length = readlink("/proc/self/exe", path, sizeof path);
    char *slash = length > 0 && (size_t)length < sizeof path ? memrchr(path, '/', (size_t)length) : NULL;
    if (slash != NULL && slash + sizeof "/rextract-mpi" <= path + sizeof path) {
        memcpy(slash, "/rextract-mpi", sizeof "/rextract-mpi");
        execv(path, argv);
    }
}

int main(int argc, char **argv)
{
    if (rx_program_launched(NULL) > 1)
        hand_over(argv); /* returns where there is none: rx_program_main() says so */
    const rx_program program = rx_program_extract();
    return rx_program_main(&program, argc, argv);
}
