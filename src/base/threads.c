/* Threads are tried before OpenMP's runtime makes them. */
#include "base/threads.h"

#include <limits.h>
#include <math.h>
#include <omp.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "base/memory.h"
#include "base/min_max.h"

/* The first line of a file, "" where there is none. */
static void read_line(const char *path, char *dst, int size)
{
    FILE *file = fopen(path, "r");
    if (file == NULL || fgets(dst, size, file) == NULL)
        dst[0] = '\0';
    if (file != NULL)
        fclose(file);
}

/* Longer names of groups than these are none that any system makes. */
enum { GROUP = 1024, FOLDER = 2048, NAME = FOLDER + 32 };

/* Processors that the quota of one cgroup allows, rounded up; INT_MAX without one. Version 2 has "quota period" in one
 * file, version 1 has two; a quota that is no positive number ("max", -1) is none. */
static int quota_of(const char *folder)
{
    char path[NAME], text[64];
    double quota = 0, period = 0;
    snprintf(path, sizeof path, "%s/cpu.max", folder);
    read_line(path, text, sizeof text);
    if (sscanf(text, "%lf %lf", &quota, &period) != 2) {
        snprintf(path, sizeof path, "%s/cpu.cfs_quota_us", folder);
        read_line(path, text, sizeof text);
        quota = strtod(text, NULL);
        snprintf(path, sizeof path, "%s/cpu.cfs_period_us", folder);
        read_line(path, text, sizeof text);
        period = strtod(text, NULL);
    }
    const double processors = quota > 0 && period > 0 ? ceil(quota / period) : INT_MAX;
    return processors < INT_MAX ? (int)processors : INT_MAX;
}

int rx_threads_quota(const char *list, const char *root)
{
    char line[GROUP], folder[FOLDER];
    int least = INT_MAX;
    FILE *file = fopen(list, "r");
    while (file != NULL && fgets(line, sizeof line, file) != NULL) {
        char *name = strchr(line, ':'), *path = name != NULL ? strchr(name + 1, ':') : NULL;
        if (path == NULL)
            continue;
        line[strcspn(line, "\n")] = '\0';
        *path++ = '\0';
        name++;
        if (name[0] != '\0' && strstr(name, "cpu") == NULL)
            continue;
        /* each group is within the one above it; a container sees its own as the root */
        for (char *slash = path + strlen(path); slash != NULL; slash = strrchr(path, '/')) {
            *slash = '\0';
            snprintf(folder, sizeof folder, "%s%s%s%s", root, name[0] != '\0' ? "/" : "", name, path);
            least = rx_min_int(least, quota_of(folder));
        }
    }
    if (file != NULL)
        fclose(file);
    return least;
}

/* The runtime takes OMP_NUM_THREADS as it is. More threads than processors wait for each other and change no result;
 * what is asked for by NTHREADS may still be some, as it is where threads are tested on a small machine. */
int rx_threads_count(int wanted)
{
    const int most = omp_get_num_procs(); /* of the affinity */
    if (wanted > 0)
        return rx_min_int(wanted, rx_min_int(omp_get_thread_limit(), rx_max_int(4 * most, 8)));
    const int all = rx_max_int(rx_min_int(rx_min_int(omp_get_max_threads(), most),
                                          rx_threads_quota("/proc/self/cgroup", "/sys/fs/cgroup")),
                               1);
    return wanted < 0 && -wanted < all ? -wanted : all;
}

/* Stack size of OpenMP's threads in bytes as libgomp reads it, a number of kB or with B, K, M or G behind it;
 * 0: the system's own. */
static size_t stack_size(void)
{
    const char *text = getenv("OMP_STACKSIZE");
    if (text == NULL)
        text = getenv("GOMP_STACKSIZE");
    if (text == NULL)
        return 0;
    char *end = NULL;
    const unsigned long n = strtoul(text, &end, 10);
    while (*end == ' ')
        end++;
    const int shift = *end == 'B' || *end == 'b'   ? 0
                      : *end == 'M' || *end == 'm' ? 20
                      : *end == 'G' || *end == 'g' ? 30
                                                   : 10;
    return (size_t)n << shift;
}

/* A thread that lives until the gate is opened. */
static void *wait_at(void *gate)
{
    pthread_mutex_lock(gate);
    pthread_mutex_unlock(gate);
    return NULL;
}

/* Threads of this process by Linux's count; 0: not known. */
static long living(void)
{
    struct stat task;
    return stat("/proc/self/task", &task) == 0 ? (long)task.st_nlink - 2 : 0;
}

/* Threads that have ended still count for a moment: until no more than `before` do, 0.1 s at most. */
static void wait_for_ends(long before)
{
    const struct timespec moment = {.tv_nsec = 100000};
    for (int i = 0; i < 1000 && living() > before; i++)
        nanosleep(&moment, NULL);
}

/* How many of n threads can live at once. */
static int possible(int n)
{
    int made = 0;
    const long before = living();
    pthread_mutex_t gate = PTHREAD_MUTEX_INITIALIZER;
    pthread_attr_t how;
    pthread_t *thread = RX_NEW(pthread_t, (size_t)n);
    if (thread == NULL || pthread_attr_init(&how) != 0) {
        free(thread);
        return 0;
    }
    const size_t size = stack_size();
    if (size > 0)
        (void)pthread_attr_setstacksize(&how, size); /* refused: neither will libgomp have its way */
    pthread_mutex_lock(&gate);
    while (made < n && pthread_create(&thread[made], &how, wait_at, &gate) == 0)
        made++;
    pthread_mutex_unlock(&gate);
    for (int i = 0; i < made; i++)
        pthread_join(thread[i], NULL);
    wait_for_ends(before);
    pthread_mutex_destroy(&gate);
    pthread_attr_destroy(&how);
    free(thread);
    return made;
}

int rx_threads_had(int wanted, rx_log *log)
{
    const int n = rx_threads_count(wanted);
    if (n == 1)
        return 1;
    int had = 1 + possible(n - 1);
    if (had < n && omp_pause_resource_all(omp_pause_soft) == 0) {
        wait_for_ends(1); /* those of an earlier tile were in the way */
        had = 1 + possible(n - 1);
    }
    if (had < n) { /* something has to be left for planes and for gnuplot */
        had = 1 + (had - 1) / 2;
        rx_log_warning(
            log,
            "%d threads cannot be made here; going on with %d (ulimit -u and -v, OMP_STACKSIZE and "
            "NTHREADS say how many there are)",
            n, had);
    }
    /* kept by the runtime, which asks for none from now on */
#pragma omp parallel num_threads(had)
    {
    }
    return had;
}
