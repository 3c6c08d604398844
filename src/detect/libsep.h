/* sep.h lacks an include guard and needs size_t from before. */
#ifndef RX_DETECT_LIBSEP_H
#define RX_DETECT_LIBSEP_H

#include <stddef.h>

#include <sep.h>

#endif
