/* Doubles within a tolerance, never NaN; says both when they are not. */
#ifndef TESTS_UNIT_NEAR_H
#define TESTS_UNIT_NEAR_H

#include <math.h>

#include "unit.h"

#define assert_near(value, expected, tolerance)                                                              \
    do {                                                                                                     \
        const double near_value = (value), near_expected = (expected), near_tolerance = (tolerance);         \
        if (!(fabs(near_value - near_expected) <= near_tolerance))                                           \
            fail_msg("%s is %.17g, not %.17g +- %g", #value, near_value, near_expected, near_tolerance);     \
    } while (0)

#define assert_close(value, expected, relative)                                                              \
    assert_near((value), (expected), (relative)*fabs((double)(expected)))

#define assert_between(value, low, high)                                                                     \
    do {                                                                                                     \
        const double near_value = (value), near_low = (low), near_high = (high);                             \
        if (!(near_value >= near_low && near_value <= near_high))                                            \
            fail_msg("%s is %.17g, not in %.17g to %.17g", #value, near_value, near_low, near_high);         \
    } while (0)

#endif
