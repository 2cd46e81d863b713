/* From moments to the rows of all elements at all points; see _kernels.c for the formulas' source. */
#ifndef PBEM_FILL_H
#define PBEM_FILL_H
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arcs.h"
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

/* Crack-tip elements: factors of the displacement at the point, -int T u for the density u. */
static void combine_tip_displacement(const Rows *r, const Moments *m, cplx e, Factors *out)
{
    const double kappa = r->kappa, fu = 1 / (2 * M_PI * (kappa + 1));
    for (int k = 0; k <= r->order; k++) {
        out->Pu[k] = fu * ((kappa + 1) * cimag(m->c[k]) + I * (1 - kappa) * creal(m->c[k]));
        out->Qu[k] = fu * 2 * m->y * e * e * conj(m->d[k]);
    }
}

/* Factors of the traction on the normal N at the point. */
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

/* The same two for an arc, and for its tractions t: int U t, int D t. */
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

/* An arc or a crack tip: what cannot be done in batches. */
static void fill_element(const Rows *r, const Arc *arcs, Py_ssize_t i, Py_ssize_t j)
{
    const int shapes = r->order + 1, family = r->family[j], is_arc = r->sweep[j] != 0;
    const int tractions = r->traction && family == BOUNDARY;
    const Py_ssize_t width = 2 * r->elements * shapes, at = 2 * i * width + 2 * j * shapes;
    const double *shape = r->shape + family * shapes * shapes;
    Factors f;
    if (is_arc)
        evaluate_arc(r, &arcs[j], i, j, tractions, &f);
    else
        evaluate_tip(r, i, j, &f);
    put_shapes(r->displacement + at, width, shapes, shape, NULL, f.Pu, f.Qu);
    if (tractions) put_shapes(r->traction + at, width, shapes, shape, is_arc ? arcs[j].node_weight : NULL, f.Pt, f.Qt);
}

/* Points that are done with all elements of a tile before the next ones: their rows stay in the cache. */
#define MOST_POINTS 128

static void fill_near_tip(const Rows *r, Py_ssize_t i, Py_ssize_t j) { fill_element(r, NULL, i, j); }

/* arcs: one for every element, prepared where the element is an arc. */
static void fill_rows(const Rows *r, const Arc *arcs, const Kind *kinds, NearPairs *near)
{
    for (int k = 0; k < FAMILIES; k++) {
        const Kind *kind = &kinds[k];
        for (Py_ssize_t first = 0; first < kind->groups; first += TILE) {
            const Py_ssize_t last = first + TILE < kind->groups ? first + TILE : kind->groups;
            if (is_tip(k))
                for (Py_ssize_t group = first; group < last; group++) fill_tips(r, kind, group, fill_near_tip);
            else
                fill_kind(r, kind, first, last, near);
        }
    }
    for (Py_ssize_t j = 0; j < r->elements; j++)
        if (r->sweep[j] != 0)
            for (Py_ssize_t i = 0; i < r->points; i++) fill_element(r, arcs, i, j);
}

/* Prepared arcs, one slot an element; NULL if there are none (*count is 0) or memory is short. */
static Arc *prepare_arcs(const Rows *r, Py_ssize_t *count)
{
    *count = 0;
    for (Py_ssize_t j = 0; j < r->elements; j++) *count += r->sweep[j] != 0;
    Arc *arcs = *count ? malloc(r->elements * sizeof(Arc)) : NULL;
    for (Py_ssize_t j = 0; arcs && j < r->elements; j++)
        if (r->sweep[j] != 0)
            prepare_arc(&arcs[j], r->start[j], r->center[j], r->sweep[j], r->order, r->family[j], r->local);
    return arcs;
}

#endif
