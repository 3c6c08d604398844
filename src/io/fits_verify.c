/* Is a FITS file as it was written? */
#include "io/fits_verify.h"

#include "io/fits_file.h"

static rx_status verify_hdu(fitsfile *file, const char *path, int hdu, LONGLONG *end, rx_error *err)
{
    rx_fits_shape shape;
    int failed = 0, data = 0, all = 0;
    rx_status status = rx_fits_goto(file, path, hdu, err);
    if (status == RX_OK)
        failed = rx_fits_shape_of(file, &shape);
    if (status == RX_OK && !failed)
        status = rx_fits_check_size(file, path, hdu, &shape, err);
    if (status != RX_OK)
        return status;
    fits_verify_chksum(file, &data, &all, &failed);
    fits_get_hduaddrll(file, NULL, NULL, end, &failed);
    if (failed)
        return rx_fits_failed(err, RX_INPUT, path, hdu, failed, "the checksum cannot be computed");
    if (data == 0 || all == 0)
        return rx_error_at(err, RX_INPUT, path, hdu, 0,
                           "has no %s, so that nobody can tell whether it is whole; fetch or make it again",
                           all == 0 ? "CHECKSUM" : "DATASUM");
    if (data < 0 || all < 0)
        return rx_error_at(err, RX_INPUT, path, hdu, 0,
                           "the %s of this HDU is wrong: the file is damaged or was edited; fetch or make it "
                           "again",
                           data < 0 ? "DATASUM" : "CHECKSUM");
    return RX_OK;
}

rx_status rx_fits_verify(const char *path, int nhdus, rx_error *err)
{
    rx_fits_source source = {0};
    LONGLONG end = 0;
    int n = 0, broken = 0;
    rx_status status = rx_fits_open(path, &source, err);
    if (status == RX_OK && source.memory != NULL)
        status = rx_error_at(err, RX_INPUT, path, -1, 0,
                             "is cut off: its size is no multiple of 2880 bytes; fetch it again");
    if (status == RX_OK)
        n = rx_fits_count(source.file, &broken);
    for (int hdu = 0; hdu < n && status == RX_OK; hdu++)
        status = verify_hdu(source.file, path, hdu, &end, err);
    if (status == RX_OK && broken)
        status = rx_error_at(err, RX_INPUT, path, n, 0,
                             "this HDU cannot be read: the file is damaged; fetch it again");
    if (status == RX_OK && nhdus > 0 && n != nhdus)
        status = rx_error_at(err, RX_INPUT, path, -1, 0,
                             "has %d HDUs, %d were written: the file is damaged or cut off; fetch it again",
                             n, nhdus);
    if (status == RX_OK && end != source.file->Fptr->filesize)
        status = rx_error_at(err, RX_INPUT, path, -1, 0,
                             "has bytes behind its last HDU: the file is damaged; fetch it again");
    rx_fits_done(&source);
    return status;
}
