/* Sources against their brighter neighbours. */
#include "template/evidence.h"

#include <math.h>

#include "template/patch.h"

static const double OVERLAP = 0.3, BLEND = 0.2;
static const double LUMPS = 0.3; /* of a large galaxy's light, on the scale of a source */

/* The brighter member with most light under the template of i; -1: none. *light: in units of i's flux. */
static int brightest_over(const rx_subject *subjects, const int *member, int n, int i, double *light)
{
    const rx_subject *one = &subjects[member[i]];
    const double power = rx_footprint_product(&one->footprint, &one->footprint, NULL);
    int found = -1;
    *light = 0;
    for (int j = 0; j < n && power > 0; j++) {
        const rx_subject *other = &subjects[member[j]];
        if (j == i || !(other->flux > one->flux))
            continue;
        const double under =
            other->flux / one->flux * rx_footprint_product(&one->footprint, &other->footprint, NULL) / power;
        if (under > *light) {
            *light = under;
            found = j;
        }
    }
    return found;
}

/* Relative error of a smooth profile on the scale of a source: arms and knots of a galaxy that is resolved.
 */
static double lumpiness(const rx_subject *s, double fwhm)
{
    const double r2 = s->profile.radius * s->profile.radius;
    return s->kind == RX_TPHOT_POINT ? 0 : LUMPS * (1 - s->point) * r2 / (r2 + fwhm * fwhm);
}

static double alone(const rx_subject *subject, const rx_joint_member *member)
{
    return subject->flux > 0 && member->variance > 0 ? subject->flux * subject->flux / member->variance : 0;
}

rx_rival rx_evidence_rival(const rx_subject *subjects, const rx_joint_member *members, const int *member,
                           int n, int i)
{
    rx_rival rival = {.other = -1};
    if (!(alone(&subjects[member[i]], &members[member[i]]) > 0))
        return rival;
    const int j = brightest_over(subjects, member, n, i, &rival.light);
    if (j >= 0 && (rival.light >= OVERLAP || members[member[i]].blend >= BLEND))
        rival.other = member[j];
    return rival;
}

rx_status rx_evidence_of(const rx_refine_params *par, const rx_refine_view *view, rx_lens *lens,
                         const rx_subject *subjects, const rx_joint_member *members, int i,
                         const rx_rival *rival, double *evidence, rx_error *err)
{
    const rx_subject *one = &subjects[i];
    double rise = 0;
    *evidence = alone(one, &members[i]);
    if (rival->other < 0)
        return RX_OK;
    const rx_subject *other = &subjects[rival->other];
    rx_status status = rx_refine_alone(par, view, lens, other, one, &rise, err);
    if (status != RX_OK || !isfinite(rise))
        return status;
    const double lumps = lumpiness(other, view->fwhm) * rival->light;
    *evidence = 1 / (1 / fmin(*evidence, fmax(rise, 1e-3)) + lumps * lumps);
    return RX_OK;
}
