/* What the two kinds of ranks share. A transport moves messages; ranks.c gives them their meaning. */
#ifndef RX_PAR_TRANSPORT_H
#define RX_PAR_TRANSPORT_H

#include "par/ranks.h"

/* Tags below those of callers. FAIL carries an rx_error, SUM the values of rx_ranks_sum(). */
enum { RX_TAG_FAIL = -2, RX_TAG_SUM = -1 };

typedef struct rx_parcel {
    rx_message message;
    struct rx_parcel *next;
} rx_parcel;

typedef struct rx_parcels {
    rx_parcel *first, *last;
} rx_parcels;

typedef struct rx_transport {
    /* Takes the parcel, also when it fails; returns at once. */
    rx_status (*send)(rx_ranks *ranks, int to, rx_parcel *parcel, rx_error *err);
    /* *dst = a parcel that has arrived, in order for each sender and tag; NULL where none has. */
    rx_status (*poll)(rx_ranks *ranks, rx_parcel **dst, rx_error *err);
    /* The rank will send nothing more; what it has sent may still be on its way to poll. */
    bool (*gone)(rx_ranks *ranks, int rank);
    /* Sleep until something may have arrived, 50 ms at most; `round` counts calls since something did. */
    void (*sleep)(rx_ranks *ranks, long round);
    void (*stop)(rx_ranks *ranks); /* of the link; the struct itself is freed by rx_ranks_stop() */
} rx_transport;

struct rx_ranks {
    int rank, count, trainers;
    const rx_transport *via;
    void *link;         /* of the transport */
    rx_parcels arrived; /* taken from the transport while something else was waited for */
    rx_error failed;    /* not RX_OK: another rank failed or is gone */
    bool announced;     /* the others know that this rank goes, and why */
};

void rx_parcels_add(rx_parcels *list, rx_parcel *parcel);
void rx_parcel_free(rx_parcel *parcel);
void rx_parcels_free(rx_parcels *list);

/* The two transports' rx_ranks_start(). */
rx_status rx_ranks_start_threads(int generators, rx_rank_run run, void *user, rx_ranks **dst, rx_error *err);
rx_status rx_ranks_start_mpi(int trainers, rx_ranks **dst, rx_error *err);

#endif
