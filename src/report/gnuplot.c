/* Running gnuplot. */
#include "report/gnuplot.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/text.h"

/* PATIENCE: seconds for the figures of a report, which take about one. */
enum { MOST_WORDS = 1 << 20, PATIENCE = 600 };

extern char **environ;

/* The environment without what would change numbers or the terminal; pointers only, `locale` among them. */
static char **clean_environment(char *locale)
{
    size_t n = 0, kept = 0;
    while (environ != NULL && environ[n] != NULL)
        n++;
    char **copy = RX_NEW(char *, n + 2);
    for (size_t i = 0; i < n && copy != NULL; i++)
        if (strncmp(environ[i], "LC_ALL=", 7) != 0 && strncmp(environ[i], "GNUTERM=", 8) != 0)
            copy[kept++] = environ[i];
    if (copy != NULL)
        copy[kept] = locale;
    return copy;
}

/* The parent blocks the signals that end it, to clean up after itself; the child must not inherit that.
 * What is ignored (nohup) stays ignored, but for SIGPIPE. 0 or an error number. */
static int spawn(pid_t *child, const char *program, const char *folder, const char *script)
{
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t none, pipe;
    char options[] = "-d", locale[] = "LC_ALL=C";
    char *name = rx_strdup(program), *file = rx_strdup(script), **environment = clean_environment(locale);
    char *arguments[] = {name, options, file, NULL};
    sigemptyset(&none);
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    posix_spawn_file_actions_init(&actions); /* as the next one it only sets fields */
    posix_spawnattr_init(&attributes);
    int failed = name != NULL && file != NULL && environment != NULL
                     ? posix_spawn_file_actions_addchdir_np(&actions, folder)
                     : ENOMEM;
    if (failed == 0)
        failed = posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    if (failed == 0)
        failed =
            posix_spawn_file_actions_addopen(&actions, 1, "gnuplot.log", O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (failed == 0)
        failed = posix_spawn_file_actions_adddup2(&actions, 1, 2);
    if (failed == 0) { /* these only set fields */
        posix_spawnattr_setsigmask(&attributes, &none);
        posix_spawnattr_setsigdefault(&attributes, &pipe);
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
        failed = posix_spawnp(child, program, &actions, &attributes, arguments, environment);
    }
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    free(name);
    free(file);
    free(environment);
    return failed;
}

/* The last line of its messages, where gnuplot says what it did not understand; "" when there is none. */
static void last_words(const char *folder, char *dst, size_t size)
{
    rx_text path = {0};
    char *log = NULL, *line = NULL;
    dst[0] = '\0';
    rx_text_printf(&path, "%s/gnuplot.log", folder);
    if (!path.failed && rx_text_read_file(path.data, MOST_WORDS, &log, NULL, NULL) == RX_OK)
        for (char *state = NULL, *c = strtok_r(log, "\r\n", &state); c != NULL;
             c = strtok_r(NULL, "\r\n", &state))
            line = c[strspn(c, " \t^")] != '\0' ? c : line;
    if (line != NULL) {
        snprintf(dst, size, ": %s", line);
        for (char *c = dst; *c != '\0'; c++)
            *c = *c >= ' ' && *c < 0x7f ? *c : '?';
    }
    free(log);
    rx_text_free(&path);
}

pid_t rx_gnuplot_start(const char *program, const char *folder, const char *script, char *note, size_t size)
{
    pid_t child;
    /* a path with a folder in it is meant from here, not from where the child works */
    char *absolute = strchr(program, '/') != NULL ? realpath(program, NULL) : NULL;
    int failed = spawn(&child, absolute != NULL ? absolute : program, folder, script);
    free(absolute);
    if (failed == 0)
        return child;
    snprintf(note, size, "%s cannot be started (%s); install gnuplot", program, strerror(failed));
    return 0;
}

/* Wait for its end, but no longer than until a signal asks us to end, or PATIENCE. 0, or what waitpid said.
 * The pauses grow from 1 to 20 ms: short against a figure, nothing against the processor. */
static int await(pid_t child, int *state, int *impatient)
{
    struct timespec pause = {.tv_nsec = 1000000}, begin, now;
    *impatient = 0;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (;;) {
        const pid_t ended = waitpid(child, state, *impatient ? 0 : WNOHANG);
        if (ended == child)
            return 0;
        if (ended < 0 && errno != EINTR)
            return errno;
        clock_gettime(CLOCK_MONOTONIC, &now);
        if (!*impatient && (now.tv_sec - begin.tv_sec > PATIENCE || rx_interrupt_pending())) {
            *impatient = 1;
            kill(child, SIGKILL);
        }
        nanosleep(&pause, NULL);
        pause.tv_nsec = pause.tv_nsec < 20000000 ? pause.tv_nsec + 1000000 : pause.tv_nsec;
    }
}

int rx_gnuplot_wait(pid_t child, const char *program, const char *folder, char *note, size_t size)
{
    int state = 0, impatient;
    const int lost = await(child, &state, &impatient);
    if (lost != 0) {
        snprintf(note, size, "%s got lost: %s", program, strerror(lost));
        return 0;
    }
    if (impatient && WIFSIGNALED(state)) {
        snprintf(note, size, "%s was ended: it had not finished after %d seconds, or the run was interrupted",
                 program, PATIENCE);
        return 0;
    }
    if (WIFEXITED(state) && WEXITSTATUS(state) == 0)
        return 1;
    if (WIFSIGNALED(state))
        snprintf(note, size, "%s was ended by signal %d", program, WTERMSIG(state));
    else {
        char words[160];
        last_words(folder, words, sizeof words);
        snprintf(note, size, "%s failed with exit code %d%s", program, WEXITSTATUS(state), words);
    }
    return 0;
}
