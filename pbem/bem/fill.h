/* From moments to the rows of all elements at all points; see _kernels.c for the formulas' source. */
#ifndef PBEM_FILL_H
#define PBEM_FILL_H
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arcs.h"
#include "far_arcs.h"
#include "kinds.h"
#include "moments.h"

/* Write the real 2 x 2 block of a -> P a + Q conj(a). */
static inline void put_block(double *out, Py_ssize_t width, cplx P, cplx Q)
{
    out[0] = creal(P) + creal(Q);
    out[1] = cimag(Q) - cimag(P);
    out[width] = cimag(P) + cimag(Q);
    out[width + 1] = creal(P) - creal(Q);
}

/* From factors of powers to factors of nodal values; weight (per node) may be NULL. */
static void put_shapes(double *out, Py_ssize_t width, int shapes, const double *shape, const double *weight,
                       const cplx *P, const cplx *Q)
{
    for (int j = 0; j < shapes; j++) {
        cplx p = 0, q = 0;
        for (int k = 0; k < shapes; k++) {
            p += shape[k * shapes + j] * P[k];
            q += shape[k * shapes + j] * Q[k];
        }
        const double w = weight ? weight[j] : 1.0;
        put_block(out + 2 * j, width, w * p, w * q);
    }
}

typedef struct {
    cplx Pu[MAX_SHAPES], Qu[MAX_SHAPES], Pt[MAX_SHAPES], Qt[MAX_SHAPES];
} Factors;

/* Crack-tip elements: factors of the displacement at the point, -int T u for the density u (theory, 26). */
static void combine_tip_displacement(const Rows *r, const Moments *m, cplx e, Factors *out)
{
    const double kappa = r->kappa, fu = 1 / (2 * M_PI * (kappa + 1));
    for (int k = 0; k <= r->order; k++) {
        out->Pu[k] = fu * ((kappa + 1) * cimag(m->c[k]) + I * (1 - kappa) * creal(m->c[k]));
        out->Qu[k] = fu * 2 * m->y * e * e * conj(m->d[k]);
    }
}

/* Factors of the traction on the normal N at the point (theory, 28). */
static void combine_tip_traction(const Rows *r, const Moments *m, double h, cplx e, cplx N, Factors *out)
{
    const double g = r->shear_modulus / (M_PI * (r->kappa + 1) * h);
    const cplx e3 = e * e * e;
    for (int k = 0; k <= r->order; k++) {
        const cplx d = conj(m->d[k]);
        out->Pu[k] = g * I * (e * d * conj(N) - conj(e * d) * N);
        out->Qu[k] = g * (I * e * d * N + e3 * (I * d + 2 * m->y * conj(m->e[k])) * conj(N));
    }
}

/* The same two for an arc, and for its tractions t: int U t, int D t (theory, 33). */
static void combine_arc_displacement(const Rows *r, const ArcMoments *m, int tractions, Factors *out)
{
    const double kappa = r->kappa, fu = 1 / (2 * M_PI * (kappa + 1));
    const double ft = -1 / (4 * M_PI * r->shear_modulus * (kappa + 1));
    for (int k = 0; k <= r->order; k++) {
        out->Pu[k] = fu * ((kappa + 1) * cimag(m->c[k]) + I * (1 - kappa) * creal(m->c[k]));
        out->Qu[k] = fu * I * conj(m->q[k]);
        if (!tractions) continue;
        out->Pt[k] = ft * 2 * kappa * (m->n[k] - m->l[k] * r->log_length);
        out->Qt[k] = -ft * conj(m->s[k]);
    }
}

/* (theory, 33) */
static void combine_arc_traction(const Rows *r, const ArcMoments *m, cplx N, int tractions, Factors *out)
{
    const double kappa = r->kappa, g = r->shear_modulus / (M_PI * (kappa + 1)), f = -1 / (2 * M_PI * (kappa + 1));
    for (int k = 0; k <= r->order; k++) {
        const cplx d = m->d[k], x = m->x[k];
        out->Pu[k] = g * I * (conj(d * N) - d * N);
        out->Qu[k] = g * I * (conj(d) * N + conj(m->dq[k] * N));
        if (!tractions) continue;
        out->Pt[k] = -f * (x * N + kappa * conj(x * N));
        out->Qt[k] = -f * (conj(x) * N + conj(m->y[k] * N));
    }
}

static void evaluate_tip(const Rows *r, Py_ssize_t i, Py_ssize_t j, Factors *out)
{
    const cplx half = 0.5 * (r->end[j] - r->start[j]), middle = 0.5 * (r->end[j] + r->start[j]);
    const double h = cabs(half);
    const cplx e = half / h, w = (r->point[i] - middle) * conj(e) / h;
    Moments m;
    evaluate_tip_moments(w, r->on[i] == j, r->order, r->family[j], &m);
    if (r->normal)
        combine_tip_traction(r, &m, h, e, r->normal[i], out);
    else
        combine_tip_displacement(r, &m, e, out);
}

static void evaluate_arc(const Rows *r, const Arc *arc, Py_ssize_t i, Py_ssize_t j, int tractions, Factors *out)
{
    ArcMoments m;
    evaluate_arc_moments(arc, r->point[i], r->on[i] == j, r->on_local[i], &m);
    if (r->normal)
        combine_arc_traction(r, &m, r->normal[i], tractions, out);
    else
        combine_arc_displacement(r, &m, tractions, out);
}

/* A point near a crack tip. */
static void fill_near_tip(const Rows *r, Py_ssize_t i, Py_ssize_t j)
{
    const int shapes = r->order + 1;
    Factors f;
    evaluate_tip(r, i, j, &f);
    put_shapes(locate_block(r, r->displacement, i, j), 2 * r->elements * shapes, shapes,
               r->shape + r->family[j] * shapes * shapes, NULL, f.Pu, f.Qu);
}

static void fill_near_arc(const Rows *r, const Arc *arc, Py_ssize_t i, Py_ssize_t j)
{
    const int shapes = r->order + 1, tractions = r->traction && arc->family == BOUNDARY;
    const Py_ssize_t width = 2 * r->elements * shapes;
    const double *shape = r->shape + arc->family * shapes * shapes;
    Factors f;
    evaluate_arc(r, arc, i, j, tractions, &f);
    put_shapes(locate_block(r, r->displacement, i, j), width, shapes, shape, NULL, f.Pu, f.Qu);
    if (tractions) put_shapes(locate_block(r, r->traction, i, j), width, shapes, shape, arc->node_weight, f.Pt, f.Qt);
}

/* Room for the work on one element after the other. */
typedef struct {
    NearPairs near;
    SortedPoints sorted;
    Arc arc;
    FarArc far;
} Workspace;

/* All points against the arc j. */
static void fill_arc(const Rows *r, Py_ssize_t j, Workspace *work)
{
    SortedPoints *sorted = &work->sorted;
    const double *shape = r->shape + r->family[j] * (r->order + 1) * (r->order + 1);
    prepare_arc(&work->arc, r->start[j], r->center[j], r->sweep[j], r->order, r->family[j], r->local);
    prepare_far_arc(&work->far, &work->arc, r->sweep[j]);
    for (Py_ssize_t first = 0; first < r->points; first += MOST_SORTED) {
        const Py_ssize_t last = first + MOST_SORTED < r->points ? first + MOST_SORTED : r->points;
        sort_points(r, &work->far, j, first, last, sorted);
        for (int level = 0; level < LEVELS; level++)
            if (sorted->count[level])
                fill_listed(r, use_rule(&work->far, &work->arc, shape, level), j, sorted->point[level],
                            sorted->count[level]);
        if (sorted->count[LEVELS]) prepare_poles(&work->arc);
        for (int p = 0; p < sorted->count[LEVELS]; p++) fill_near_arc(r, &work->arc, sorted->point[LEVELS][p], j);
    }
}

static void fill_rows(const Rows *r, const Kind *kinds, Workspace *work)
{
    work->near.count = 0;
    for (int level = 0; level < LEVELS; level++) work->far.reference[level].points = 0;
    for (int k = 0; k < FAMILIES; k++) {
        const Kind *kind = &kinds[k];
        for (Py_ssize_t first = 0; first < kind->groups; first += TILE) {
            const Py_ssize_t last = first + TILE < kind->groups ? first + TILE : kind->groups;
            if (is_tip(k))
                for (Py_ssize_t group = first; group < last; group++) fill_tips(r, kind, group, fill_near_tip);
            else
                fill_kind(r, kind, first, last, &work->near);
        }
    }
    for (Py_ssize_t j = 0; j < r->elements; j++)
        if (r->sweep[j] != 0) fill_arc(r, j, work);
}

#endif
