/* Doubles within a tolerance; shows both when they are not. */
#ifndef TESTS_UNIT_VALIDATE_NEAR_H
#define TESTS_UNIT_VALIDATE_NEAR_H

#include <math.h>

#define assert_near(a, b, tolerance)                                                                         \
    do {                                                                                                     \
        double near_a = (a), near_b = (b);                                                                   \
        if (!(fabs(near_a - near_b) <= (tolerance)))                                                         \
            fail_msg("%s is %.17g, not %.17g", #a, near_a, near_b);                                          \
    } while (0)

#endif
