/* Lists of detections. */
#include "lab/lists.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

static const double LEVEL = 0.95;

rx_list rx_list_of(const rx_lab *lab, int condition, int scene)
{
    return (rx_list){lab, condition, scene, scene};
}

rx_list rx_list_of_all(const rx_lab *lab, int condition)
{
    return (rx_list){lab, condition, 0, lab->nscenes - 1};
}

static const rx_lab_table *table_of(const rx_list *list, int scene, int table)
{
    return &rx_lab_set_of(list->lab, list->condition, scene)->table[table];
}

static const rx_lab_table *objects_of(const rx_list *list)
{
    return table_of(list, list->first, list->lab->kind->objects);
}

static int within(const double *own, int column, double low, double high)
{
    return column < 0 || (own[column] >= low && own[column] < high);
}

long rx_list_found(const rx_list *list, int run, double score)
{
    const rx_lab_table *object = objects_of(list);
    long n = 0;
    for (long i = 0; i < object->n; i++)
        n += rx_lab_each(object, i, run)[RX_LIST_SCORE] >= score; /* NAN is below every score */
    return n;
}

rx_estimate rx_list_share(const rx_list *list, int run, double score, int column, double low, double high)
{
    const rx_lab_table *object = objects_of(list);
    long n = 0, found = 0;
    for (long i = 0; i < object->n; i++) {
        if (!within(rx_lab_own(object, i), column, low, high))
            continue;
        n++;
        found += rx_lab_each(object, i, run)[RX_LIST_SCORE] >= score;
    }
    return rx_binomial_interval(found, n, LEVEL);
}

long rx_list_wrong(const rx_list *list, int run, double score, int column, double low, double high)
{
    const rx_lab_table *wrong = table_of(list, list->first, list->lab->kind->wrong);
    long n = 0;
    for (long i = 0; i < wrong->n; i++) {
        const double *v = rx_lab_own(wrong, i);
        n += v[RX_WRONG_RUN] == run && (v[RX_WRONG_SCORE] >= score || score == -HUGE_VAL) &&
             within(v, column, low, high);
    }
    return n;
}

void rx_list_compare(const rx_list *list, const int run[2], const double score[2], long only[2])
{
    const rx_lab_table *object = objects_of(list);
    only[0] = only[1] = 0;
    for (long i = 0; i < object->n; i++) {
        const int first = rx_lab_each(object, i, run[0])[RX_LIST_SCORE] >= score[0],
                  second = rx_lab_each(object, i, run[1])[RX_LIST_SCORE] >= score[1];
        only[0] += first && !second;
        only[1] += second && !first;
    }
}

rx_status rx_list_curve(const rx_list *list, int run, long *objects, rx_pr *dst, rx_error *err)
{
    const rx_lab *lab = list->lab;
    size_t room = 1;
    long n = 0;
    for (int s = list->first; s <= list->last; s++)
        room += (size_t)(table_of(list, s, lab->kind->objects)->n + table_of(list, s, lab->kind->wrong)->n);
    double *score = RX_NEW(double, room);
    unsigned char *right = RX_NEW(unsigned char, room);
    rx_status status = score == NULL || right == NULL ? rx_error_memory(err, room * sizeof *score) : RX_OK;
    *objects = 0;
    for (int s = list->first; s <= list->last && status == RX_OK; s++) {
        const rx_lab_table *object = table_of(list, s, lab->kind->objects),
                           *wrong = table_of(list, s, lab->kind->wrong);
        if (!rx_scene_is_list(lab->scene[s].id))
            continue;
        *objects += object->n;
        for (long i = 0; i < object->n; i++)
            if (!isnan(rx_lab_each(object, i, run)[RX_LIST_SCORE])) {
                right[n] = 1;
                score[n++] = rx_lab_each(object, i, run)[RX_LIST_SCORE];
            }
        for (long i = 0; i < wrong->n; i++)
            if (rx_lab_own(wrong, i)[RX_WRONG_RUN] == run)
                score[n++] = rx_lab_own(wrong, i)[RX_WRONG_SCORE]; /* right: 0 */
    }
    if (status == RX_OK)
        status = rx_pr_make(n, score, right, *objects, dst, err);
    free(score);
    free(right);
    return status;
}

const rx_pr_point *rx_pr_cut(const rx_pr *pr, double precision)
{
    for (long k = pr->n - 1; k >= 0; k--)
        if (pr->point[k].precision >= precision)
            return &pr->point[k];
    return NULL;
}
