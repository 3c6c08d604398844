/* Preloaded into a program that is given two threads: one alone does what is in parallel regions, and the clock of CPU time stands
 * still there, so that the log's CPU seconds are those that a second core takes no part in; with RX_SERIAL_WHOLE in the environment it
 * runs on. At the end one line: serial and all CPU seconds. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

void GOMP_parallel(void (*task)(void *), void *data, unsigned threads, unsigned flags);

static double parallel; /* seconds */
static int depth;

static int read_clock(clockid_t clock, struct timespec *now)
{
    static int (*next)(clockid_t, struct timespec *);
    if (next == NULL)
        *(void **)&next = dlsym(RTLD_NEXT, "clock_gettime");
    return next(clock, now);
}

static double cpu_seconds(void)
{
    struct timespec now;
    read_clock(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void GOMP_parallel(void (*task)(void *), void *data, unsigned threads, unsigned flags)
{
    static void (*next)(void (*)(void *), void *, unsigned, unsigned);
    if (next == NULL)
        *(void **)&next = dlsym(RTLD_NEXT, "GOMP_parallel");
    const double begun = cpu_seconds();
    depth++;
    (void)threads;
    next(task, data, 1, flags);
    if (--depth == 0)
        parallel += cpu_seconds() - begun;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
    const int status = read_clock(clock, now);
    if (status == 0 && clock == CLOCK_PROCESS_CPUTIME_ID && getenv("RX_SERIAL_WHOLE") == NULL) {
        const double serial = (double)now->tv_sec + 1e-9 * (double)now->tv_nsec - parallel;
        now->tv_sec = (time_t)serial;
        now->tv_nsec = (long)(1e9 * (serial - (double)now->tv_sec));
    }
    return status;
}

__attribute__((destructor)) static void say(void)
{
    const double all = cpu_seconds();
    fprintf(stderr, "CPU seconds: serial %.4f, all %.4f\n", all - parallel, all);
}
