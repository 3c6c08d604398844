/* trouble KIND FIRST STEP PROGRAM ARGUMENT...: PROGRAM again and again, with its n-th call of the system in
 * trouble, n = FIRST, FIRST + STEP and so on up to the run that makes less than n calls. KIND says what
 * happens to the call:
 *
 *   ENOSPC, EIO, EINTR   it fails, once
 *   FULL                 it and all that follow fail with ENOSPC (EDQUOT where n is odd)
 *   SHORT                a read or a write does half of what was asked
 *   KILL                 the process gets SIGKILL before it
 *
 * Each run works in the folder run, a copy of the folder old: the outputs of an earlier run. The folder new
 * holds what an undisturbed run makes of it. Afterwards every output is that of old or that of new, to the
 * byte. A run that fails says so in one line that shows no name of a temporary, ends with the exit code of
 * its kind, and leaves no temporary; one that succeeds has made new. After KILL, or a failed removal, one
 * more undisturbed run makes exactly new. So it does after every failure where there is a file journal, which
 * may be the beginning of the new one, or checkpoint: it goes on from there.
 *
 * The kernel hands the calls to this process (seccomp_unotify(2)), so that those of the C library and of
 * cfitsio are among them. Exit code 77: it cannot be done here. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

enum { CANNOT = 77, MOST_WRONG = 10, BUFFER = 1 << 16 };

/* What a call does, as far as its faults go. */
enum { READS = 1, WRITES = 2, REMOVES = 4, MAKES = 8, OTHER = 16 };

static const struct call {
    long number;
    int class;
    const char *name;
} calls[] = {
#ifdef __NR_open
    {__NR_open, MAKES, "open"},
    {__NR_rename, MAKES, "rename"},
    {__NR_mkdir, MAKES, "mkdir"},
    {__NR_unlink, REMOVES, "unlink"},
    {__NR_rmdir, REMOVES, "rmdir"},
#endif
    {__NR_openat, MAKES, "openat"},
    {__NR_read, READS, "read"},
    {__NR_pread64, READS, "pread64"},
    {__NR_readv, READS, "readv"},
    {__NR_lseek, OTHER, "lseek"},
    {__NR_write, WRITES, "write"},
    {__NR_pwrite64, WRITES, "pwrite64"},
    {__NR_writev, WRITES, "writev"},
    {__NR_ftruncate, WRITES, "ftruncate"},
    {__NR_fsync, WRITES, "fsync"},
    {__NR_close, OTHER, "close"},
    {__NR_renameat2, MAKES, "renameat2"},
    {__NR_mkdirat, MAKES, "mkdirat"},
    {__NR_unlinkat, REMOVES, "unlinkat"},
    {__NR_getdents64, REMOVES, "getdents64"}, /* of the folder that is to be removed */
    {__NR_flock, OTHER, "flock"},
};
enum { NCALLS = sizeof calls / sizeof calls[0] };

/* One run under supervision. */
typedef struct watch {
    const char *kind;
    long n, seen; /* the call that is struck; calls so far */
    int started;  /* the program is in its main(): it has opened /dev/null */
    pid_t process;
    int pidfd, listener;
    const struct call *struck; /* NULL: the run made less calls */
} watch;

static volatile int *shared; /* the child's number of its listener */

static const struct call *find(long number)
{
    for (int i = 0; i < NCALLS; i++)
        if (calls[i].number == number)
            return &calls[i];
    return NULL;
}

/* --- the child --- */

static int install(void)
{
    struct sock_filter code[NCALLS + 3];
    int n = 0;
    code[n++] = (struct sock_filter)BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr));
    for (int i = 0; i < NCALLS; i++)
        code[n++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, (unsigned)calls[i].number,
                                                 (unsigned char)(NCALLS - i), 0);
    code[n++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
    code[n++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_USER_NOTIF);
    struct sock_fprog program = {(unsigned short)n, code};
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0)
        return -1;
    return (int)syscall(__NR_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_NEW_LISTENER, &program);
}

static void be_program(int watched, char **argv)
{
    const int log = open("log", O_WRONLY | O_CREAT | O_TRUNC, 0666), null = open("/dev/null", O_RDWR);
    if (chdir("run") != 0)
        _exit(99);
    dup2(null, 0);
    dup2(null, 1);
    dup2(log, 2);
    if (watched) {
        const int listener = install();
        *shared = listener;
        if (listener < 0)
            _exit(CANNOT);
        while (*shared != 0) /* exec would close it */
            usleep(50);
    }
    execv(argv[0], argv);
    _exit(99);
}

/* --- the supervisor --- */

static int remote_text(pid_t process, unsigned long address, char *dst, size_t size)
{
    struct iovec to = {dst, size - 1}, from = {(void *)address, size - 1};
    const ssize_t n = process_vm_readv(process, &to, 1, &from, 1, 0);
    dst[n > 0 ? n : 0] = '\0';
    return n > 0;
}

static int is_thread_of(pid_t process, pid_t thread)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/task/%d", (int)process, (int)thread);
    return process == thread || access(path, F_OK) == 0;
}

/* Half of what was asked, done for it. -1: not possible. */
static long half(const watch *w, const struct seccomp_notif *asked)
{
    static char buffer[BUFFER];
    const unsigned long long *a = asked->data.args;
    const long number = asked->data.nr;
    const size_t n = a[2] / 2 < BUFFER ? a[2] / 2 : BUFFER;
    struct iovec here = {buffer, n}, there = {(void *)a[1], n};
    const int file = (int)syscall(__NR_pidfd_getfd, w->pidfd, (int)a[0], 0);
    long done = -1;
    if (file < 0 || n == 0)
        done = -1;
    else if (number == __NR_read || number == __NR_pread64) {
        done = number == __NR_read ? read(file, buffer, n) : pread(file, buffer, n, (off_t)a[3]);
        if (done > 0) {
            here.iov_len = there.iov_len = (size_t)done;
            done = process_vm_writev(w->process, &here, 1, &there, 1, 0);
        }
    } else if (process_vm_readv(w->process, &here, 1, &there, 1, 0) == (ssize_t)n)
        done = number == __NR_write ? write(file, buffer, n) : pwrite(file, buffer, n, (off_t)a[3]);
    if (file >= 0)
        close(file);
    return done;
}

/* Is this call one that the kind of trouble strikes? */
static int concerns(const watch *w, const struct call *call, const struct seccomp_notif *asked)
{
    const unsigned long long *a = asked->data.args;
    const int on_file = call->class == READS || call->class == WRITES || call->class == OTHER;
    if (on_file && a[0] <= 2)
        return 0; /* what is said */
    if (strcmp(w->kind, "KILL") == 0 || strcmp(w->kind, "EIO") == 0)
        return 1;
    if (strcmp(w->kind, "SHORT") == 0)
        return call->number == __NR_read || call->number == __NR_pread64 || call->number == __NR_write ||
               call->number == __NR_pwrite64;
    if (strcmp(w->kind, "EINTR") == 0)
        return call->class == READS || call->class == WRITES || call->number == __NR_openat ||
               call->number == __NR_flock;
    if (call->number == __NR_openat)
        return (a[2] & O_CREAT) != 0;
    return call->class == WRITES || call->class == MAKES || call->number == __NR_close;
}

/* What becomes of the struck call. */
static void strike(watch *w, const struct call *call, const struct seccomp_notif *asked,
                   struct seccomp_notif_resp *reply)
{
    const int first = w->struck == NULL;
    if (first)
        w->struck = call;
    if (strcmp(w->kind, "KILL") == 0) {
        kill(w->process, SIGKILL);
    } else if (strcmp(w->kind, "SHORT") == 0) {
        const long done = half(w, asked);
        if (done >= 0) {
            reply->val = done;
            reply->flags = 0;
        }
    } else if (first || strcmp(w->kind, "FULL") == 0) {
        reply->error = strcmp(w->kind, "EIO") == 0                     ? -EIO
                       : strcmp(w->kind, "EINTR") == 0                 ? -EINTR
                       : strcmp(w->kind, "FULL") == 0 && w->n % 2 == 1 ? -EDQUOT
                                                                       : -ENOSPC;
        reply->flags = 0;
    }
}

static void answer(watch *w)
{
    struct seccomp_notif asked = {0};
    struct seccomp_notif_resp reply = {.flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE};
    if (ioctl(w->listener, SECCOMP_IOCTL_NOTIF_RECV, &asked) != 0)
        return;
    reply.id = asked.id;
    const struct call *call = find(asked.data.nr);
    char name[16];
    if (call != NULL && is_thread_of(w->process, (pid_t)asked.pid)) {
        if (!w->started && call->number == __NR_openat &&
            remote_text(w->process, asked.data.args[1], name, 10))
            w->started = strcmp(name, "/dev/null") == 0;
        else if (w->started && concerns(w, call, &asked)) {
            w->seen++;
            if (w->seen == w->n || (w->struck != NULL && strcmp(w->kind, "FULL") == 0))
                strike(w, call, &asked, &reply);
        }
    }
    (void)ioctl(w->listener, SECCOMP_IOCTL_NOTIF_SEND, &reply);
}

static int exit_code(int state)
{
    return WIFEXITED(state) ? WEXITSTATUS(state) : 128 + WTERMSIG(state);
}

/* An undisturbed run. */
static int run_plain(char **argv)
{
    int state = -1;
    const pid_t child = fork();
    if (child == 0)
        be_program(0, argv);
    waitpid(child, &state, 0);
    return exit_code(state);
}

/* The run with call n in trouble; its exit code, CANNOT where the kernel refuses. */
static int run_watched(watch *w, char **argv)
{
    int state = -1;
    *shared = 0;
    w->process = fork();
    if (w->process == 0)
        be_program(1, argv);
    while (*shared == 0)
        usleep(100);
    w->pidfd = *shared > 0 ? (int)syscall(__NR_pidfd_open, w->process, 0) : -1;
    w->listener = w->pidfd >= 0 ? (int)syscall(__NR_pidfd_getfd, w->pidfd, *shared, 0) : -1;
    *shared = 0;
    if (w->listener < 0) {
        kill(w->process, SIGKILL);
        waitpid(w->process, &state, 0);
        return CANNOT;
    }
    while (waitpid(w->process, &state, WNOHANG) == 0) {
        struct pollfd ready = {.fd = w->listener, .events = POLLIN};
        if (poll(&ready, 1, 20) > 0 && (ready.revents & POLLIN) != 0)
            answer(w);
        else if ((ready.revents & POLLHUP) != 0)
            usleep(200);
    }
    close(w->listener);
    close(w->pidfd);
    return exit_code(state);
}

/* --- what is left --- */

static int same_file(const char *a, const char *b)
{
    char text[2][8192];
    FILE *file[2] = {fopen(a, "rb"), fopen(b, "rb")};
    int same = file[0] != NULL && file[1] != NULL;
    for (size_t n = 1; same && n > 0;) {
        n = fread(text[0], 1, sizeof text[0], file[0]);
        same = fread(text[1], 1, sizeof text[1], file[1]) == n && memcmp(text[0], text[1], n) == 0;
    }
    for (int i = 0; i < 2; i++)
        if (file[i] != NULL)
            fclose(file[i]);
    return same;
}

/* Does b begin with what is in a? */
static int is_beginning(const char *a, const char *b)
{
    FILE *file[2] = {fopen(a, "rb"), fopen(b, "rb")};
    int good = file[0] != NULL && file[1] != NULL;
    for (int c = 0; good && (c = getc(file[0])) != EOF;)
        good = c == getc(file[1]);
    for (int i = 0; i < 2; i++)
        if (file[i] != NULL)
            fclose(file[i]);
    return good;
}

static int same(const char *a, const char *b);

/* Is everything in folder a in b too, with the same bytes? */
static int within(const char *a, const char *b)
{
    int good = 1;
    DIR *dir = opendir(a);
    for (struct dirent *entry; good && dir != NULL && (entry = readdir(dir)) != NULL;) {
        char name[2][4096];
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        snprintf(name[0], sizeof name[0], "%s/%s", a, entry->d_name);
        snprintf(name[1], sizeof name[1], "%s/%s", b, entry->d_name);
        good = same(name[0], name[1]);
    }
    if (dir != NULL)
        closedir(dir);
    return good && dir != NULL;
}

static int same(const char *a, const char *b)
{
    struct stat one, two;
    if (stat(a, &one) != 0 || stat(b, &two) != 0 || S_ISDIR(one.st_mode) != S_ISDIR(two.st_mode))
        return 0;
    return S_ISDIR(one.st_mode) ? within(a, b) && within(b, a) : same_file(a, b);
}

/* Something that is neither of old nor of new, or a name of neither; "" when there is none. A run that fails
 * may leave a third record.txt, which says so. */
static void find_wrong(char *dst, size_t size, int with_temporaries, int failed)
{
    DIR *dir = opendir("run");
    dst[0] = '\0';
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;) {
        char name[3][512];
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        if (with_temporaries && strstr(entry->d_name, ".rx-") != NULL)
            continue;
        if (failed && strcmp(entry->d_name, "record.txt") == 0)
            continue;
        snprintf(name[0], sizeof name[0], "run/%s", entry->d_name);
        snprintf(name[1], sizeof name[1], "old/%s", entry->d_name);
        snprintf(name[2], sizeof name[2], "new/%s", entry->d_name);
        if (strcmp(entry->d_name, "journal") == 0 && is_beginning(name[0], name[2]))
            continue;
        if (!same(name[0], name[1]) && !same(name[0], name[2]))
            snprintf(dst, size, "%s is neither old nor new", entry->d_name);
    }
    if (dir != NULL)
        closedir(dir);
    dir = opendir("old");
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;) {
        char name[512];
        snprintf(name, sizeof name, "run/%s", entry->d_name);
        if (access(name, F_OK) != 0)
            snprintf(dst, size, "%s is gone", entry->d_name);
    }
    if (dir != NULL)
        closedir(dir);
}

static int read_log(char *text, size_t size)
{
    int lines = 0;
    FILE *file = fopen("log", "r");
    const size_t n = file != NULL ? fread(text, 1, size - 1, file) : 0;
    if (file != NULL)
        fclose(file);
    text[n] = '\0';
    for (const char *c = text; *c != '\0'; c++)
        lines += *c == '\n';
    return lines;
}

/* What is wrong with a run that was struck; "" nothing. */
static void judge(const watch *w, int code, char **argv, char *dst, size_t size)
{
    char text[4096], begin[64];
    const int lines = read_log(text, sizeof text), killed = strcmp(w->kind, "KILL") == 0,
              not_removed = w->struck->class == REMOVES || killed,
              goes_on = access("new/journal", F_OK) == 0 || access("new/checkpoint", F_OK) == 0;
    const int system_only =
        strcmp(w->kind, "FULL") == 0 || strcmp(w->kind, "ENOSPC") == 0 || w->struck->class == WRITES;
    const char *program = strrchr(argv[0], '/');
    snprintf(begin, sizeof begin, "%s: ", program != NULL ? program + 1 : argv[0]);
    find_wrong(dst, size, not_removed, !killed && code != 0);
    if (dst[0] != '\0')
        return;
    if (killed && code != 128 + SIGKILL)
        snprintf(dst, size, "exit code %d of a killed run", code);
    else if (!killed && code == 0 && (lines != 0 || (!not_removed && !same("run", "new"))))
        snprintf(dst, size, "exit code 0, but not the outputs of an undisturbed run: %.200s", text);
    else if (!killed && strcmp(w->kind, "SHORT") == 0 && code != 0)
        snprintf(dst, size, "exit code %d: %.200s", code, text);
    else if (!killed && code != 0 && (lines != 1 || strncmp(text, begin, strlen(begin)) != 0))
        snprintf(dst, size, "exit code %d, %d lines: %.400s", code, lines, text);
    else if (!killed && code == 8 && strstr(text, "tiles failed") != NULL)
        return; /* of a list */
    else if (!killed && code != 0 && code != 4 && (system_only || (code != 2 && code != 3)))
        snprintf(dst, size, "exit code %d: %.200s", code, text);
    else if (strstr(text, ".rx-") != NULL)
        snprintf(dst, size, "shows a temporary: %.200s", text);
    else if ((not_removed || goes_on) && (code = run_plain(argv), code != 0 || !same("run", "new")))
        snprintf(dst, size, "one more run, exit code %d, does not leave exactly the new outputs", code);
}

static int prepare(void)
{
    return system("rm -rf run && cp -a old run");
}

int main(int argc, char **argv)
{
    char what[1024];
    long runs = 0, wrong = 0, did = 0;
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (argc < 5 || shared == MAP_FAILED) {
        fprintf(stderr, "usage: trouble KIND FIRST STEP PROGRAM ARGUMENT...\n");
        return 2;
    }
    if (prepare() != 0 || run_plain(argv + 4) != 0 || !same("run", "new")) {
        printf("an undisturbed run does not make the new outputs\n");
        return 1;
    }
    for (long n = atol(argv[2]); wrong < MOST_WRONG; n += atol(argv[3])) {
        watch w = {.kind = argv[1], .n = n};
        if (prepare() != 0)
            return 2;
        const int code = run_watched(&w, argv + 4);
        if (code == CANNOT)
            return CANNOT;
        if (w.struck == NULL)
            break;
        runs++;
        did += code == 0;
        judge(&w, code, argv + 4, what, sizeof what);
        if (what[0] != '\0') {
            printf("%s at call %ld, %s: %s\n", argv[1], n, w.struck->name, what);
            wrong++;
        }
    }
    printf("%s: %ld runs with a call in trouble, %ld did all their work, %ld went wrong\n", argv[1], runs,
           did, wrong);
    return wrong > 0 || runs == 0;
}
