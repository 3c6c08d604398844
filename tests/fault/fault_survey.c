/* rextract-survey as the function that fault.c runs. */
#define main tested_main
int tested_main(int argc, char **argv);
#include "programs/rextract_survey.c"
