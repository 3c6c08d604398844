/* How many threads a run takes: never more than serve it, whatever is asked for. */
#include "../scratch.h"

#include <limits.h>
#include <omp.h>

#include "base/threads.h"

static int quota(void **state, const char *groups)
{
    char list[256], root[256];
    snprintf(list, sizeof list, "%s", in(state, "list"));
    snprintf(root, sizeof root, "%s", in(state, "root"));
    write_bytes(list, groups, strlen(groups));
    return rx_threads_quota(list, root);
}

static void put_quota(void **state, const char *name, const char *text)
{
    write_bytes(in(state, name), text, strlen(text));
}

static void test_quota_of_cgroups(void **state)
{
    static const char *const folders[] = {"root",     "root/job",         "root/job/step",
                                          "root/cpu", "root/cpu,cpuacct", "root/cpu/docker"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++)
        assert_int_equal(mkdir(in(state, folders[i]), 0777), 0);
    assert_int_equal(rx_threads_quota(in(state, "none"), in(state, "root")), INT_MAX);
    assert_int_equal(quota(state, "0::/job/step\n"), INT_MAX);
    put_quota(state, "root/job/step/cpu.max", "max 100000\n");
    assert_int_equal(quota(state, "0::/job/step\n"), INT_MAX);
    put_quota(state, "root/job/cpu.max", "350000 100000\n"); /* of the group above */
    assert_int_equal(quota(state, "0::/job/step\n"), 4);
    put_quota(state, "root/job/step/cpu.max", "50000 100000\n");
    assert_int_equal(quota(state, "0::/job/step\n"), 1);
    put_quota(state, "root/cpu.max", "200000 100000\n"); /* a container sees its own group at the root */
    assert_int_equal(quota(state, "0::/elsewhere\n"), 2);
    assert_int_equal(quota(state, "nonsense\n\n1:memory:/job/step\n"), INT_MAX);
    put_quota(state, "root/cpu,cpuacct/cpu.cfs_quota_us", "300000\n");
    put_quota(state, "root/cpu,cpuacct/cpu.cfs_period_us", "100000\n");
    assert_int_equal(quota(state, "7:name=systemd:/\n4:cpu,cpuacct:/\n"), 3);
    put_quota(state, "root/cpu/docker/cpu.cfs_quota_us", "-1\n");
    put_quota(state, "root/cpu/docker/cpu.cfs_period_us", "100000\n");
    assert_int_equal(quota(state, "1:cpu:/docker\n"), INT_MAX);
}

static void test_never_thousands(void **state)
{
    const int processors = omp_get_num_procs();
    const int before = omp_get_max_threads();
    omp_set_num_threads(5000); /* as OMP_NUM_THREADS does */
    assert_true(rx_threads_count(0) <= processors);
    assert_true(rx_threads_count(-5000) <= processors);
    assert_true(rx_threads_count(5000) <= 4 * processors || rx_threads_count(5000) == 8);
    assert_int_equal(rx_threads_count(3), 3); /* more than the processors of a small machine */
    omp_set_num_threads(1);
    assert_int_equal(rx_threads_count(0), 1);
    assert_int_equal(rx_threads_count(-2), 1);
    omp_set_num_threads(before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_quota_of_cgroups),
        cmocka_unit_test(test_never_thousands),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
