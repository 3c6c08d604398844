/* What a campaign has found. A group (a scene, a field, bins of FWHM or of noise) has quantities, each of them a number
 * for every condition (a seeing, a magnitude, a bin) and column (a run; DETECTION: and RL at its best). Contests of two
 * columns are of the same things, condition by condition. Claims are judged, tables, files and figures written from
 * this alone. */
#ifndef RX_LAB_STORE_H
#define RX_LAB_STORE_H

#include "lab/claims.h"
#include "lab/lab.h"
#include "quality/hypothesis.h"

enum {
    RX_QUANTITIES_MAX = 24,
    RX_PAIRS_MAX = RX_METHODS_MAX * (RX_METHODS_MAX - 1) / 2,
    RX_ABOUTS_MAX = RX_PRECISIONS_MAX + 4
};

/* How it is named, and of what it is made: a statistic of the campaign's kind, and what that needs. */
typedef struct rx_quantity {
    char name[32];
    const char *unit;
    int digits, statistic, part, cut;
    double low, high;
    int best; /* where the best of several settings is shown: highest value of each */
    char help[160];
} rx_quantity;

/* setting: what was chosen for the number, NULL where nothing was; not owned. */
typedef struct rx_finding {
    rx_estimate value;
    const char *setting;
} rx_finding;

/* What two columns are compared in. adjusted: p by Holm for the conditions of a group; the winner is the one with
 * more (+1) or less (-1) where that is below 0.05, 0: none is named. */
typedef struct rx_about {
    char quantity[48];
    const char *test; /* "McNemar", "paired t" ... */
    int adjusted, winner;
} rx_about;

/* NAN where a test has no such number. */
typedef struct rx_contest {
    rx_test test;
    double only_first, only_second; /* things found by one of both alone */
    double holm;
    int winner; /* +1 the first, -1 the second, 0 undecided */
} rx_contest;

typedef struct rx_store_group {
    const char *name; /* as "scene" of all tables; not owned */
    int nquantities;
    rx_quantity quantity[RX_QUANTITIES_MAX];
    int nconditions;
    char (*condition)[96]; /* owned, as the rest */
    rx_finding *finding;   /* [nquantities][nconditions][ncolumns] */
    rx_contest *contest;   /* [npairs][nabouts][nconditions] */
} rx_store_group;

typedef struct rx_store {
    const rx_lab *lab;
    uint64_t seed; /* of bootstraps */
    int ncolumns;
    const char *column[RX_LAB_RUNS + 1];
    int hidden[RX_LAB_RUNS + 1]; /* 1: in files, not on the page */
    int npairs, pair[RX_PAIRS_MAX][2];
    int nabouts;
    rx_about about[RX_ABOUTS_MAX];
    int ngroups;
    rx_store_group *group;
    void *own[3]; /* of the kind; owned */
} rx_store;

/* What the lab's kind measures, contests decided. rx_store_free(). */
rx_status rx_store_make(const rx_lab *lab, uint64_t seed, rx_store **dst, rx_error *err);
void rx_store_free(rx_store *store);

/* --- for measure() of a kind, which finds a column for each run --- */

rx_status rx_store_groups(rx_store *store, int ngroups, rx_error *err);
/* Room for a group whose quantities are named; columns, pairs and what they are compared in are, too. */
rx_status rx_group_open(rx_store *store, int group, int nconditions, rx_error *err);

int rx_store_column(const rx_store *store, const char *name); /* -1: none */
/* Both are columns, not the same one: the pair is added where it is not there yet. */
void rx_store_add_pair(rx_store *store, int first, int second);
int rx_store_pair(const rx_store *store, int first, int second); /* -1: none */

rx_finding *rx_store_at(const rx_store *store, int group, int quantity, int condition, int column);
/* By the quantity's name; without such a quantity or column NAN. */
rx_estimate rx_store_value(const rx_store *store, int group, const char *quantity, int condition, int column);
rx_contest *rx_contest_of(const rx_store *store, int group, int pair, int about, int condition);

/* --- contests --- */

rx_contest rx_contest_none(void);
rx_contest rx_contest_found(long only_first, long only_second); /* McNemar */
/* Student's t needs two differences that are not the same. */
int rx_has_spread(long n, const double *a, const double *b);
/* Student's and Wilcoxon's test of the differences a - b; without spread they are none. */
rx_status rx_contest_paired(long n, const double *a, const double *b, rx_contest *paired,
                            rx_contest *wilcoxon, rx_error *err);

/* The contests of two columns that a claim or a sentence is about. */
typedef struct rx_contest_place {
    int group;       /* -1: all */
    int first, last; /* subjects, of which those that name a winner count */
    int (*where)(const rx_store *store, int group, int condition,
                 int which); /* does it count; NULL: all do */
    int which;
} rx_contest_place;

/* Does column a win: every one of them (every), or in each group and subject one and none is lost. -1: nothing was
 * compared. said: "NET against RL, psnr of FWHM: better at 2 to 5 by 0.3 to 2.1; undecided at 6. " and so on. */
int rx_contests_won(const rx_store *store, const rx_contest_place *place, int a, int b, int every,
                    rx_text *said);

#endif
