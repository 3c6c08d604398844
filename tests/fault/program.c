/* rextract as a function of fault.c. */
#define main rextract_main
int rextract_main(int argc, char **argv);
#include "programs/rextract.c"
