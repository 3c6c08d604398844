/* The kinds of campaign. */
#ifndef RX_LAB_KINDS_H
#define RX_LAB_KINDS_H

#include "lab/lab.h"

extern const rx_lab_kind rx_kind_restoration, rx_kind_photometry, rx_kind_detection, rx_kind_fluxes;

#endif
