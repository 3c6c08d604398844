/* Units as headers write them. */
#ifndef RX_IO_UNITS_H
#define RX_IO_UNITS_H

enum { RX_UNIT_TEXT = 16 };

/* One spelling for the many of a unit: "e" (electrons), "adu" (ADU, DN, counts), "s", "mag", "deg", "pix", "sr",
 * "nmgy" (nanomaggies), "mgy", "Jy" with its prefixes m, u, n and M, and one of them per another, "e/s". "":
 * another unit, or none. */
void rx_unit_spelling(const char *text, char dst[RX_UNIT_TEXT]);

#endif
