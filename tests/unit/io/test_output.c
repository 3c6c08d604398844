/* Outputs appear whole or not at all. */
#include "io_test.h"

#include <signal.h>
#include <sys/wait.h>

#include "io/output.h"

static void check_content(const char *path, const char *text)
{
    size_t size = 0;
    char *data = file_bytes(path, &size);
    assert_int_equal(size, strlen(text));
    assert_memory_equal(data, text, size);
    free(data);
}

static void test_commit(void **state)
{
    rx_outputs *outputs = NULL;
    const char *a = NULL, *b = NULL, *folder = NULL;
    char inner[1000];
    write_text(in(state, "a"), "old");
    assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
    assert_int_equal(rx_outputs_file(outputs, in(state, "a"), &a, NULL), RX_OK);
    assert_int_equal(rx_outputs_file(outputs, in(state, "b"), &b, NULL), RX_OK);
    assert_int_equal(rx_outputs_folder(outputs, in(state, "report/"), &folder, NULL), RX_OK);
    assert_string_equal(rx_outputs_shown(outputs, b), in(state, "b")); /* what errors name */
    assert_string_equal(rx_outputs_shown(outputs, folder), in(state, "report/"));
    assert_string_equal(rx_outputs_shown(outputs, "none of ours"), "none of ours");
    assert_int_equal(access(a, F_OK), -1); /* the writer makes it */
    write_text(a, "new");
    write_text(b, "other");
    snprintf(inner, sizeof inner, "%s/page", folder);
    write_text(inner, "page");
    check_content(in(state, "a"), "old");
    assert_int_equal(rx_outputs_commit(outputs, NULL), RX_OK);
    rx_outputs_free(outputs);
    check_content(in(state, "a"), "new");
    check_content(in(state, "b"), "other");
    check_content(in(state, "report/page"), "page");
    assert_int_equal(count_files(in(state, "")), 3);
}

/* One process removes what it has made while another one is about to write there. */
static void test_folders_of_two(void **state)
{
    const pid_t child = fork();
    int failed = 0;
    for (int i = 0; i < 300; i++) {
        rx_outputs *outputs = NULL;
        const char *file = NULL;
        failed |= rx_outputs_new(&outputs, NULL) != RX_OK ||
                  rx_outputs_file(outputs, in(state, "both/of/us"), &file, NULL) != RX_OK;
        rx_outputs_free(outputs);
    }
    if (child == 0)
        _exit(failed);
    int ended = 1;
    assert_int_equal(waitpid(child, &ended, 0), child);
    assert_int_equal(ended, 0);
    assert_int_equal(failed, 0);
    rx_output_remove(
        in(state, "both")); /* what one of them made while the other one was in it may be left, empty */
}

/* A process that reserves a file and a folder, begins them, says so, and waits to be killed. */
static pid_t reserve_and_wait(void **state, const char *file, const char *folder)
{
    int told[2];
    char byte, path[2][400], inner[1000];
    snprintf(path[0], sizeof path[0], "%s", in(state, file));
    snprintf(path[1], sizeof path[1], "%s", in(state, folder));
    assert_int_equal(pipe(told), 0);
    const pid_t child = fork();
    if (child == 0) {
        rx_outputs *outputs = NULL;
        const char *temporary[2];
        if (rx_outputs_new(&outputs, NULL) != RX_OK ||
            rx_outputs_file(outputs, path[0], &temporary[0], NULL) != RX_OK ||
            rx_outputs_folder(outputs, path[1], &temporary[1], NULL) != RX_OK)
            _exit(1);
        write_text(temporary[0], "half");
        snprintf(inner, sizeof inner, "%s/sub", temporary[1]);
        mkdir(inner, 0777);
        (void)!write(told[1], "x", 1);
        for (;;)
            pause();
    }
    assert_true(child > 0);
    close(told[1]);
    assert_int_equal(read(told[0], &byte, 1), 1);
    close(told[0]);
    return child;
}

/* What a killed process leaves goes with the next run of these outputs; what a living one is at work on
 * stays, and so does what only looks like it. */
static void test_leftovers(void **state)
{
    rx_outputs *outputs = NULL;
    const char *temporary = NULL;
    char left[4][64];
    const int before = count_files(in(state, ""));
    const pid_t child = reserve_and_wait(state, "later.fits", "later");
    for (int i = 0; i < 4; i++)
        snprintf(left[i], sizeof left[i], ".later%s.rx-%ld.%s", i < 2 ? ".fits" : "", (long)child,
                 i % 2 == 0 ? "tmp" : "lock");
    static const char *const alike[] = {".later.rx-12x.lock", ".later.rx-.lock", ".later.fits.x.rx-1.lock",
                                        "later.rx-1.lock", ".later.rx-1.lock.old"};
    for (int i = 0; i < 5; i++)
        write_text(in(state, alike[i]), "mine");
    for (int alive = 1; alive >= 0; alive--) {
        assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
        assert_int_equal(rx_outputs_file(outputs, in(state, "later.fits"), &temporary, NULL), RX_OK);
        assert_int_equal(rx_outputs_folder(outputs, in(state, "later"), &temporary, NULL), RX_OK);
        rx_outputs_free(outputs);
        for (int i = 0; i < 4; i++)
            assert_int_equal(access(in(state, left[i]), F_OK), alive ? 0 : -1);
        if (alive) {
            assert_int_equal(kill(child, SIGKILL), 0);
            assert_int_equal(waitpid(child, NULL, 0), child);
        }
    }
    for (int i = 0; i < 5; i++)
        assert_int_equal(unlink(in(state, alike[i])), 0);
    assert_int_equal(count_files(in(state, "")), before);
}

/* Two processes write the same output again and again: neither takes the other's temporary away, whatever the
 * moment, and nothing is left. */
static void test_two_at_once(void **state)
{
    const int before = count_files(in(state, ""));
    char path[400];
    int status = -1;
    snprintf(path, sizeof path, "%s", in(state, "shared"));
    const pid_t child = fork();
    assert_true(child >= 0);
    for (int i = 0; i < 300; i++) {
        rx_outputs *outputs = NULL;
        const char *temporary = NULL;
        const int good = rx_outputs_new(&outputs, NULL) == RX_OK &&
                         rx_outputs_file(outputs, path, &temporary, NULL) == RX_OK &&
                         (write_text(temporary, "whole"), rx_outputs_commit(outputs, NULL) == RX_OK);
        rx_outputs_free(outputs);
        if (!good && child == 0)
            _exit(1);
        assert_true(good);
    }
    if (child == 0)
        _exit(0);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
    check_content(path, "whole");
    assert_int_equal(unlink(path), 0);
    assert_int_equal(count_files(in(state, "")), before);
}

/* Where another has our number, the next one is taken. */
static void test_taken_number(void **state)
{
    rx_outputs *outputs[2] = {NULL, NULL};
    const char *temporary[2];
    for (int i = 0; i < 2; i++) {
        assert_int_equal(rx_outputs_new(&outputs[i], NULL), RX_OK);
        assert_int_equal(rx_outputs_file(outputs[i], in(state, "numbered"), &temporary[i], NULL), RX_OK);
        write_text(temporary[i], i == 0 ? "first" : "second");
    }
    assert_string_not_equal(temporary[0], temporary[1]);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(rx_outputs_commit(outputs[i], NULL), RX_OK);
        rx_outputs_free(outputs[i]);
        check_content(in(state, "numbered"), i == 0 ? "first" : "second");
    }
    assert_int_equal(unlink(in(state, "numbered")), 0);
}

/* A folder of one page, as a run writes it. */
static void write_report(const char *path, const char *page)
{
    rx_outputs *outputs = NULL;
    const char *folder = NULL;
    char inner[1000];
    assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
    assert_int_equal(rx_outputs_folder(outputs, path, &folder, NULL), RX_OK);
    snprintf(inner, sizeof inner, "%s/deep", folder);
    assert_int_equal(mkdir(inner, 0777), 0);
    snprintf(inner, sizeof inner, "%s/page", folder);
    write_text(inner, page);
    snprintf(inner, sizeof inner, "%s/deep/table", folder);
    write_text(inner, "1 2 3");
    assert_int_equal(rx_outputs_commit(outputs, NULL), RX_OK);
    rx_outputs_free(outputs);
}

/* Only what a run wrote is replaced, as it wrote it; whatever else is there keeps the folder. */
static void test_only_ours(void **state)
{
    static const char *const harm[] = {
        "echo note >ours/note.txt",
        "echo note >ours/deep/note.txt",
        "mkdir ours/mine",
        "ln -s page ours/link",
        "mkfifo ours/pipe",
        "echo note >>ours/page",
        "rm ours/page && ln -s ../kept ours/page",
        "rm ours/page && mkdir ours/page",
        "cp ours/page ours/'page\nfolder deep'",
        ": >ours/.rextract",
        "rm ours/.rextract",
        "head -n 1 ours/.rextract >t && mv t ours/.rextract",
        "head -c -2 ours/.rextract >t && mv t ours/.rextract",
        "mv ours/.rextract marker && ln -s ../marker ours/.rextract",
        "rm ours/.rextract && mkfifo ours/.rextract",
        "rm ours/.rextract && mkdir ours/.rextract",
        "echo 'Made by rextract: the next run replaces this folder.' >ours/.rextract",
        "echo note >ours/note.txt && echo 'folder note.txt' >>ours/.rextract",
        "ln -s ../kept ours/note.txt && echo ' note.txt' >>ours/.rextract",
    };
    const char *folder = NULL;
    char path[400], command[4000];
    snprintf(path, sizeof path, "%s", in(state, "ours"));
    write_text(in(state, "kept"), "kept");
    for (size_t i = 0; i < sizeof harm / sizeof harm[0]; i++) {
        rx_error err = RX_ERROR_NONE;
        rx_outputs *outputs = NULL;
        rx_output_remove(path);
        write_report(path, "first");
        snprintf(command, sizeof command, "cd '%s' && { %s; } && ls -lR ours >before", in(state, ""),
                 harm[i]);
        assert_int_equal(system(command), 0);
        assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
        assert_int_equal(rx_outputs_folder(outputs, path, &folder, &err), RX_USAGE);
        assert_non_null(strstr(err.text, "replaced; give another name"));
        rx_outputs_free(outputs);
        snprintf(command, sizeof command, "cd '%s' && ls -lR ours | cmp - before", in(state, ""));
        assert_int_equal(system(command), 0);
    }
    rx_output_remove(path);
    write_report(path, "first");
    unlink(in(state, "ours/page")); /* what was taken away is not missed, and "../" in a list leads nowhere */
    snprintf(command, sizeof command, "cd '%s' && echo 'folder ../kept' >>ours/.rextract", in(state, ""));
    assert_int_equal(system(command), 0);
    write_report(path, "second");
    check_content(in(state, "ours/page"), "second");
    check_content(in(state, "kept"), "kept");
    rx_output_remove(path);
    static const char *const gone[] = {"kept", "before", "marker"};
    for (int i = 0; i < 3; i++)
        unlink(in(state, gone[i]));
}

/* What comes into the folder while the run is at work keeps it, too, and the other outputs of the run wait. */
static void test_filled_meanwhile(void **state)
{
    rx_outputs *outputs = NULL;
    const char *folder = NULL, *file = NULL;
    const int before = count_files(in(state, ""));
    write_report(in(state, "busy"), "first");
    assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
    assert_int_equal(rx_outputs_file(outputs, in(state, "busy.cat"), &file, NULL), RX_OK);
    assert_int_equal(rx_outputs_folder(outputs, in(state, "busy"), &folder, NULL), RX_OK);
    write_text(file, "1");
    write_text(in(state, "busy/note"), "mine");
    assert_int_equal(rx_outputs_commit(outputs, NULL), RX_USAGE);
    rx_outputs_free(outputs);
    check_content(in(state, "busy/note"), "mine");
    check_content(in(state, "busy/page"), "first");
    assert_int_equal(access(in(state, "busy.cat"), F_OK), -1);
    rx_output_remove(in(state, "busy"));
    assert_int_equal(count_files(in(state, "")), before);
}

/* What is replaced keeps its permissions, and until then no other user can read what takes its place. */
static void test_modes(void **state)
{
    struct stat info;
    rx_outputs *outputs = NULL;
    const char *file = NULL, *folder = NULL;
    write_text(in(state, "private"), "old");
    assert_int_equal(chmod(in(state, "private"), 0640), 0);
    write_report(in(state, "closed"), "old");
    assert_int_equal(chmod(in(state, "closed"), 0750), 0);
    assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
    assert_int_equal(rx_outputs_file(outputs, in(state, "private"), &file, NULL), RX_OK);
    assert_int_equal(rx_outputs_folder(outputs, in(state, "closed"), &folder, NULL), RX_OK);
    write_text(file, "new");
    char room[1000];
    snprintf(room, sizeof room, "%.*s", (int)(strrchr(file, '/') - file), file);
    assert_int_equal(stat(room, &info), 0);
    assert_int_equal(info.st_mode & 0777, 0700);
    assert_int_equal(rx_outputs_commit(outputs, NULL), RX_OK);
    rx_outputs_free(outputs);
    assert_int_equal(stat(in(state, "private"), &info), 0);
    assert_int_equal(info.st_mode & 0777, 0640);
    assert_int_equal(stat(in(state, "closed"), &info), 0);
    assert_int_equal(info.st_mode & 0777, 0750);
    unlink(in(state, "private"));
    rx_output_remove(in(state, "closed"));
}

/* In a folder that all share no link is followed that another user put there, on whatever part of the way; one's own
 * are. Temporaries go around what waits under their name. */
static void test_planted(void **state)
{
    enum { OTHER = 12345 };
    rx_outputs *outputs = NULL;
    const char *file = NULL;
    char path[1000];
    if (geteuid() != 0)
        skip(); /* only root can make what belongs to another */
    const int before = count_files(in(state, ""));
    write_text(in(state, "victim"), "kept");
    assert_int_equal(mkdir(in(state, "home"), 0777), 0);
    assert_int_equal(mkdir(in(state, "shared"), 0777), 0);
    assert_int_equal(chmod(in(state, "shared"), 01777), 0);
    assert_int_equal(symlink("../victim", in(state, "shared/link")), 0);
    assert_int_equal(symlink("../home", in(state, "shared/way")), 0);
    assert_int_equal(symlink("shared/way", in(state, "through")), 0);
    assert_int_equal(mkfifo(in(state, "shared/pipe"), 0666), 0);
    static const char *const names[] = {"shared/link", "shared/way/new", "through/new", "shared/pipe"};
    for (int other = 0; other < 2; other++)
        for (int i = 0; i < 4; i++) {
            rx_error err = RX_ERROR_NONE;
            for (int k = 0; k < 4; k++)
                assert_int_equal(lchown(in(state, k == 0   ? "shared/link"
                                                  : k == 1 ? "shared/way"
                                                  : k == 2 ? "shared/pipe"
                                                           : "through"),
                                        other ? OTHER : 0, (gid_t)-1),
                                 0);
            assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
            assert_int_equal(rx_outputs_file(outputs, in(state, names[i]), &file, &err),
                             other ? RX_USAGE : RX_OK);
            if (other)
                assert_non_null(strstr(err.text, "another user"));
            rx_outputs_free(outputs);
        }
    snprintf(path, sizeof path, "shared/.x.rx-%ld.tmp", (long)getpid());
    assert_int_equal(symlink("../victim", in(state, path)), 0);
    snprintf(path, sizeof path, "shared/.x.rx-%ld.lock", (long)getpid() + 1);
    assert_int_equal(symlink("../victim", in(state, path)), 0);
    assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
    assert_int_equal(rx_outputs_file(outputs, in(state, "shared/x"), &file, NULL), RX_OK);
    write_text(file, "new");
    assert_int_equal(rx_outputs_commit(outputs, NULL), RX_OK);
    rx_outputs_free(outputs);
    check_content(in(state, "shared/x"), "new");
    check_content(in(state, "victim"), "kept");
    static const char *const gone[] = {"victim", "home", "shared", "through"};
    for (int i = 0; i < 4; i++)
        rx_output_remove(in(state, gone[i]));
    assert_int_equal(count_files(in(state, "")), before);
}

/* Killed between the renames of an old folder and the new one, where they cannot change places at once: the
 * old one comes back. Killed after them: it goes. */
static void test_aside(void **state)
{
    rx_outputs *outputs = NULL;
    const char *folder = NULL;
    char old[400];
    snprintf(old, sizeof old, "%s", in(state, ".twice.rx-1.tmp.old"));
    for (int whole = 0; whole < 2; whole++) {
        write_text(in(state, ".twice.rx-1.lock"), "");
        write_report(old, whole ? "second" : "first");
        assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
        assert_int_equal(rx_outputs_folder(outputs, in(state, "twice"), &folder, NULL), RX_OK);
        rx_outputs_free(outputs);
        check_content(in(state, "twice/page"), "first");
        assert_int_equal(access(in(state, ".twice.rx-1.tmp.old"), F_OK), -1);
        assert_int_equal(access(in(state, ".twice.rx-1.lock"), F_OK), -1);
    }
}

/* Links are followed, so that what they point to is made or replaced and they stay links. */
static void test_links(void **state)
{
    rx_outputs *outputs = NULL;
    const char *a = NULL;
    struct stat info;
    assert_int_equal(symlink("b", in(state, "link")), 0);
    unlink(in(state, "b"));
    for (int there = 0; there < 2; there++) {
        assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
        assert_int_equal(rx_outputs_file(outputs, in(state, "link"), &a, NULL), RX_OK);
        write_text(a, there ? "again" : "through");
        assert_int_equal(rx_outputs_commit(outputs, NULL), RX_OK);
        rx_outputs_free(outputs);
        check_content(in(state, "b"), there ? "again" : "through");
        assert_int_equal(lstat(in(state, "link"), &info), 0);
        assert_true(S_ISLNK(info.st_mode));
    }
}

static void test_failing_commit(void **state)
{
    rx_outputs *outputs = NULL;
    const char *a = NULL, *b = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_outputs_new(&outputs, NULL), RX_OK);
    assert_int_equal(rx_outputs_file(outputs, in(state, "p"), &a, NULL), RX_OK);
    assert_int_equal(rx_outputs_file(outputs, in(state, "q"), &b, NULL), RX_OK);
    write_text(a, "p");
    assert_int_equal(rx_outputs_commit(outputs, &err), RX_SYSTEM); /* q was never written */
    write_text(b, "q");
    assert_int_equal(mkdir(in(state, "p"), 0777), 0); /* in the way since */
    assert_int_equal(rx_outputs_commit(outputs, &err), RX_SYSTEM);
    assert_non_null(strstr(err.where, "p"));
    rx_outputs_free(outputs);
    assert_int_equal(access(in(state, "q"), F_OK), -1);
    assert_int_equal(rmdir(in(state, "p")), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_commit),       cmocka_unit_test(test_folders_of_two),
        cmocka_unit_test(test_only_ours),    cmocka_unit_test(test_filled_meanwhile),
        cmocka_unit_test(test_modes),        cmocka_unit_test(test_planted),
        cmocka_unit_test(test_leftovers),    cmocka_unit_test(test_two_at_once),
        cmocka_unit_test(test_taken_number), cmocka_unit_test(test_aside),
        cmocka_unit_test(test_links),        cmocka_unit_test(test_failing_commit),
    };
    return cmocka_run_group_tests_name("outputs", tests, make_scratch, remove_scratch);
}
