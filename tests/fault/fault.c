/* fault FIRST LAST ARGUMENT...: the program that is linked in, again and again, with its n-th request for
 * memory refused, n = FIRST to LAST and, beyond, every seventh one, up to the run that asks less than n
 * times. Each run must end with status 4 and one line, and leave nothing in its folder; or, where it can do
 * without that memory, do all its work.
 *
 * The linker sends the calls of our own code, not those of other libraries, through the __wrap_ functions. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

int tested_main(int argc, char **argv);

void *__real_malloc(size_t bytes);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *old, size_t bytes);
void *__real_aligned_alloc(size_t alignment, size_t bytes);
char *__real_strdup(const char *text);
char *__real_strndup(const char *text, size_t n);
char *__real_realpath(const char *path, char *dst);
void *__real_fftwf_malloc(size_t bytes);
void *__wrap_malloc(size_t bytes);
void *__wrap_calloc(size_t n, size_t size);
void *__wrap_realloc(void *old, size_t bytes);
void *__wrap_aligned_alloc(size_t alignment, size_t bytes);
char *__wrap_strdup(const char *text);
char *__wrap_strndup(const char *text, size_t n);
char *__wrap_realpath(const char *path, char *dst);
void *__wrap_fftwf_malloc(size_t bytes);

static atomic_long left = -1; /* requests to grant before one is refused; below 0: all are granted */

/* Every run works in here; the files it reads lie above. */
#define FOLDER "run"

/* What a run tells the process that watches it. */
typedef struct report {
    atomic_int refused;
} report;
static report *shared;

static int refuse(void)
{
    if (left < 0 || atomic_fetch_sub(&left, 1) != 0)
        return 0;
    atomic_store(&shared->refused, 1);
    errno = ENOMEM;
    return 1;
}

void *__wrap_malloc(size_t bytes)
{
    return refuse() ? NULL : __real_malloc(bytes);
}

void *__wrap_calloc(size_t n, size_t size)
{
    return refuse() ? NULL : __real_calloc(n, size);
}

void *__wrap_realloc(void *old, size_t bytes)
{
    return refuse() ? NULL : __real_realloc(old, bytes);
}

void *__wrap_aligned_alloc(size_t alignment, size_t bytes)
{
    return refuse() ? NULL : __real_aligned_alloc(alignment, bytes);
}

char *__wrap_strdup(const char *text)
{
    return refuse() ? NULL : __real_strdup(text);
}

char *__wrap_strndup(const char *text, size_t n)
{
    return refuse() ? NULL : __real_strndup(text, n);
}

char *__wrap_realpath(const char *path, char *dst)
{
    return refuse() ? NULL : __real_realpath(path, dst);
}

void *__wrap_fftwf_malloc(size_t bytes)
{
    return refuse() ? NULL : __real_fftwf_malloc(bytes);
}

/* Number of things that a run left in its folder. */
static int names(void)
{
    int n = -2; /* . and .. */
    DIR *dir = opendir(FOLDER);
    while (dir != NULL && readdir(dir) != NULL)
        n++;
    if (dir != NULL)
        closedir(dir);
    return n;
}

/* A digest of all that a run wrote; the file names are part of it. */
static unsigned long digest(void)
{
    unsigned long value = 0;
    FILE *pipe = popen("cd " FOLDER " && find . -type f | LC_ALL=C sort | xargs cksum | cksum", "r");
    if (pipe == NULL || fscanf(pipe, "%lu", &value) != 1)
        value = 0;
    if (pipe != NULL)
        pclose(pipe);
    return value;
}

/* The text that a run left in its log, and the number of its lines. */
static int read_log(const char *path, char *text, size_t size)
{
    int lines = 0;
    FILE *file = fopen(path, "r");
    size_t n = file != NULL ? fread(text, 1, size - 1, file) : 0;
    if (file != NULL)
        fclose(file);
    text[n] = '\0';
    for (const char *c = text; *c != '\0'; c++)
        lines += *c == '\n';
    return lines;
}

static int run(long n, const char *log, int argc, char **argv)
{
    int status = -1;
    atomic_store(&shared->refused, 0);
    if (system("rm -rf " FOLDER) != 0 || mkdir(FOLDER, 0777) != 0)
        return -1;
    pid_t child = fork();
    if (child == 0) {
        if (chdir(FOLDER) != 0)
            exit(99);
        int file = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0666), null = open("/dev/null", O_WRONLY);
        dup2(file, 2);
        dup2(null, 1);
        left = n - 1;
        int code = tested_main(argc, argv);
        left = -1;
        exit(code);
    }
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int main(int argc, char **argv)
{
    char text[4096], log[] = "/tmp/rextract-fault-XXXXXX";
    int file = argc > 3 ? mkstemp(log) : -1;
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (file < 0 || shared == MAP_FAILED) {
        fprintf(stderr, "usage: fault FIRST LAST ARGUMENT...\n");
        return 2;
    }
    close(file);
    long first = atol(argv[1]), last = atol(argv[2]), runs = 0, wrong = 0, done_without = 0;
    argv[2] = argv[0];
    if (run(0, log, argc - 2, argv + 2) != 0) {
        read_log(log, text, sizeof text);
        printf("fails without any refused request: %s", text);
        return 1;
    }
    const unsigned long expected = digest();
    for (long n = first; wrong < 10; n += n < last ? 1 : 7) {
        int code = run(n, log, argc - 2, argv + 2), lines = read_log(log, text, sizeof text),
            left_there = names();
        if (!atomic_load(&shared->refused))
            break;
        runs++;
        int gone = code == 4 && lines == 1 && left_there == 0 && strstr(text, "memory") != NULL;
        int whole = code == 0 && lines == 0 && digest() == expected;
        done_without += whole;
        if (!gone && !whole) {
            printf("request %ld refused: exit code %d, %d lines, %d names left: %s\n", n, code, lines,
                   left_there, text);
            wrong++;
        }
    }
    unlink(log);
    if (system("rm -rf " FOLDER) != 0)
        wrong++;
    printf("%ld runs with a request refused, %ld did without it, %ld went wrong\n", runs, done_without,
           wrong);
    return wrong > 0 || runs == 0;
}
