/* fault LAST PLACES ARGUMENT...: the program that is linked in, again and again, with its n-th request for
 * memory refused: each of the first LAST requests, and of those beyond the first one from every place, by
 * which the five functions or so that called each other last are meant. The file PLACES holds those of
 * earlier cases, which are left out, and takes the new ones. RX_FAULT_SHARE=n in the environment: of the places
 * one in n. Each run must end with status 4 and one line,
 * and leave nothing in its folder; or, where it can do without that memory, do all its work.
 *
 * The linker sends the calls of our own code, not those of other libraries, through the __wrap_ functions. Where
 * refuse.c is loaded before all libraries the requests are theirs, too. RX_FAULT_ALL=1: from the n-th request on all
 * are refused. */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
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

static atomic_long requests; /* so far */
static atomic_long victim;   /* the one that is refused; 0: none */
static atomic_int watching;  /* the tested program is at work */
static int all;              /* those behind the victim are refused, too */
static int preloaded;        /* refuse.c sees each request before the __wrap_ functions do */

enum { MOST_REQUESTS = 1 << 20, DEPTH = 8 };

/* Every run works in here; the files it reads lie above. */
#define FOLDER "run"

/* What a run tells the process that watches it. */
typedef struct report {
    atomic_int refused;
    atomic_int recording; /* the places are kept */
    atomic_long requests;
    unsigned long place[MOST_REQUESTS]; /* a digest of the stack at each request */
} report;
static report *shared;

/* The linker's: begin and end of the program's own code. */
extern const char __executable_start[], etext[];

static void keep_place(void)
{
    void *stack[DEPTH];
    const long k = atomic_fetch_add(&shared->requests, 1);
    const int n = backtrace(stack, DEPTH);
    unsigned long digest = 5381;
    for (int i = 0; i < n; i++) {
        const char *address = stack[i];
        Dl_info library;
        if (address >= __executable_start && address < etext) /* libraries lie elsewhere in every process */
            digest = digest * 1000003 + (unsigned long)(address - __executable_start);
        else if (preloaded && dladdr(address, &library) != 0)
            digest = digest * 1000003 + (unsigned long)(address - (const char *)library.dli_fbase);
    }
    if (k < MOST_REQUESTS)
        shared->place[k] = digest;
}

static int refuse_next(void)
{
    if (!atomic_load(&watching))
        return 0;
    if (atomic_load(&shared->recording))
        keep_place();
    const long now = atomic_fetch_add(&requests, 1) + 1, first = atomic_load(&victim);
    if (first == 0 || now < first || (now > first && !all))
        return 0;
    atomic_store(&shared->refused, 1);
    errno = ENOMEM;
    return 1;
}

static int refuse(void)
{
    return !preloaded && refuse_next();
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
    if ((rmdir(FOLDER) != 0 && system("rm -rf " FOLDER) != 0) || mkdir(FOLDER, 0777) != 0)
        return -1;
    pid_t child = fork();
    if (child == 0) {
        if (chdir(FOLDER) != 0)
            exit(99);
        int file = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0666), null = open("/dev/null", O_WRONLY);
        dup2(file, 2);
        dup2(null, 1);
        atomic_store(&victim, n);
        atomic_store(&watching, 1);
        int code = tested_main(argc, argv);
        atomic_store(&watching, 0);
        exit(code);
    }
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/* Has no earlier request come from the place of request n, and none of an earlier case? */
static int is_first(long n, const unsigned long *known, long nknown)
{
    if (n > MOST_REQUESTS)
        return 0;
    for (long i = 0; i < n - 1; i++)
        if (shared->place[i] == shared->place[n - 1])
            return 0;
    for (long i = 0; i < nknown; i++)
        if (known[i] == shared->place[n - 1])
            return 0;
    return 1;
}

/* Number of places in the file of that name. */
static long read_places(const char *path, unsigned long *places)
{
    long n = 0;
    FILE *file = fopen(path, "r");
    while (file != NULL && n < MOST_REQUESTS && fscanf(file, "%lx", &places[n]) == 1)
        n++;
    if (file != NULL)
        fclose(file);
    return n;
}

static int add_places(const char *path, const unsigned long *known, long nknown, long requests)
{
    FILE *file = fopen(path, "a");
    for (long n = 1; file != NULL && n <= requests; n++)
        if (is_first(n, known, nknown))
            fprintf(file, "%lx\n", shared->place[n - 1]);
    return file != NULL && fclose(file) == 0;
}

int main(int argc, char **argv)
{
    static unsigned long known[MOST_REQUESTS];
    char text[4096], log[] = "/tmp/rextract-fault-XXXXXX";
    int file = argc > 3 ? mkstemp(log) : -1;
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (file < 0 || shared == MAP_FAILED) {
        fprintf(stderr, "usage: fault LAST PLACES ARGUMENT...\n");
        return 2;
    }
    close(file);
    const char *places = argv[2];
    long last = atol(argv[1]), runs = 0, wrong = 0, done_without = 0, nrequests;
    const long nknown = read_places(places, known);
    const char *share = getenv("RX_FAULT_SHARE");
    const char *rest = getenv("RX_FAULT_ALL");
    all = rest != NULL && atoi(rest) == 1;
    int (**hook)(void) = (int (**)(void))dlsym(RTLD_DEFAULT, "rx_fault_refuse");
    preloaded = hook != NULL;
    if (preloaded) {
        void *stack[DEPTH];
        backtrace(stack, DEPTH); /* loads a library */
        *hook = refuse_next;
    }
    const unsigned long one_in = share != NULL && atol(share) > 0 ? (unsigned long)atol(share) : 1;
    argv[2] = argv[0];
    atomic_store(&shared->recording, 1);
    if (run(0, log, argc - 2, argv + 2) != 0) {
        read_log(log, text, sizeof text);
        printf("fails without any refused request: %s", text);
        return 1;
    }
    atomic_store(&shared->recording, 0);
    nrequests = atomic_load(&shared->requests);
    const unsigned long expected = digest();
    for (long n = 1; wrong < 10 && n <= nrequests; n++) {
        if (n > last && (!is_first(n, known, nknown) || shared->place[n - 1] % one_in != 0))
            continue;
        int code = run(n, log, argc - 2, argv + 2), lines = read_log(log, text, sizeof text),
            left_there = names();
        if (!atomic_load(&shared->refused))
            break;
        runs++;
        int of_list = code == 8 && strstr(text, "tiles failed") != NULL;
        int gone =
            lines == 1 && left_there == 0 && (of_list || (code == 4 && strstr(text, "memory") != NULL));
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
    printf("%ld of %ld requests refused, %ld runs did without, %ld went wrong\n", runs, nrequests,
           done_without, wrong);
    wrong += !add_places(places, known, nknown, nrequests);
    return wrong > 0 || nrequests == 0;
}
