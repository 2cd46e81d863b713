/* From moments to the rows of all elements at all points; see _kernels.c for the formulas' source. */
#ifndef PBEM_FILL_H
#define PBEM_FILL_H
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arcs.h"
#include "moments.h"
#include "straight.h"

typedef struct {
    Py_ssize_t points, elements;
    const cplx *point, *normal, *start, *end, *center;
    const double *sweep;           /* angle through which an arc turns; 0 for a straight element */
    const int64_t *on;             /* element on which the point lies, or -1 */
    const double *on_local;        /* the point's coordinate s on that element */
    const double *local;           /* coordinates of an element's nodes */
    const int8_t *family;          /* BOUNDARY, TIP_AT_START, TIP_AT_END, CRACK */
    const double *shape;           /* coefficient of power k in a family's shape j: [(family * shapes + k) * shapes + j] */
    int order;
    double kappa, shear_modulus, log_length;
    double *displacement, *traction; /* outputs: row 2 i + component, column 2 (element * shapes + j) + component */
} Rows;

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

typedef struct {
    double xx[BATCH], xy[BATCH], yx[BATCH], yy[BATCH];
} Blocks;

/* Store 2 x 2 blocks of neighbouring elements, `stride` columns apart. */
static void put_blocks(double *out, Py_ssize_t width, int stride, int count, const Blocks *t)
{
    for (int j = 0; j < count; j++, out += stride) {
        out[0] = t->xx[j];
        out[1] = t->xy[j];
        out[width] = t->yx[j];
        out[width + 1] = t->yy[j];
    }
}

/* Straight elements: displacements at the point, from the moments of one nodal shape: u into H, t into G (or NULL). */
static void combine_displacements(const Rows *r, const Segments *s, Py_ssize_t first, int count, int node, double l,
                                  const Batch *b, Blocks *H, Blocks *G)
{
    const double kappa = r->kappa, fu = 1 / (2 * M_PI * (kappa + 1));
    const double ft = -1 / (4 * M_PI * r->shear_modulus * (kappa + 1));
    const double *cr = b->cr[node], *ci = b->ci[node], *dr = b->dr[node], *di = b->di[node], *n = b->n[node];
    for (int j = 0; j < count; j++) {
        const double ex = s->ex[first + j], ey = s->ey[first + j], e2r = ex * ex - ey * ey, e2i = 2 * ex * ey;
        const double Pr = fu * (kappa + 1) * ci[j], Pi = fu * (1 - kappa) * cr[j], y2 = 2 * fu * b->y[j];
        const double Qr = y2 * (e2r * dr[j] + e2i * di[j]), Qi = y2 * (e2i * dr[j] - e2r * di[j]);
        H->xx[j] = Pr + Qr;
        H->xy[j] = Qi - Pi;
        H->yx[j] = Pi + Qi;
        H->yy[j] = Pr - Qr;
    }
    if (!G) return;
    for (int j = 0; j < count; j++) {
        const double ex = s->ex[first + j], ey = s->ey[first + j], e2r = ex * ex - ey * ey, e2i = 2 * ex * ey;
        const double h = ft * s->h[first + j], y2 = 2 * b->y[j];
        const double P = h * 2 * kappa * (n[j] + l * (s->log_h[first + j] - r->log_length));
        const double ar = -h * (l - y2 * ci[j]), ai = h * y2 * cr[j];
        const double Qr = e2r * ar - e2i * ai, Qi = e2r * ai + e2i * ar;
        G->xx[j] = P + Qr;
        G->xy[j] = Qi;
        G->yx[j] = Qi;
        G->yy[j] = P - Qr;
    }
}

/* Straight elements: tractions on the normal at the point. */
static void combine_tractions(const Rows *r, const Segments *s, Py_ssize_t first, int count, int node, cplx normal,
                              const Batch *b, Blocks *H, Blocks *G)
{
    const double kappa = r->kappa, nx = creal(normal), ny = cimag(normal);
    const double g0 = r->shear_modulus / (M_PI * (kappa + 1)), f = -1 / (2 * M_PI * (kappa + 1));
    const double *cr = b->cr[node], *ci = b->ci[node], *dr = b->dr[node], *di = b->di[node];
    const double *er = b->er[node], *ei = b->ei[node];
    for (int j = 0; j < count; j++) {
        const double ex = s->ex[first + j], ey = s->ey[first + j], g = g0 / s->h[first + j], y2 = 2 * b->y[j];
        const double e2r = ex * ex - ey * ey, e2i = 2 * ex * ey, e3r = e2r * ex - e2i * ey, e3i = e2r * ey + e2i * ex;
        const double ur = ex * dr[j] + ey * di[j], ui = ey * dr[j] - ex * di[j]; /* e conj(d) */
        const double P = -2 * g * (ui * nx - ur * ny);
        /* i e conj(d) N + e^3 (i conj(d) + 2 y conj(e)) conj(N) */
        const double ar = di[j] + y2 * er[j], ai = dr[j] - y2 * ei[j];
        const double br = e3r * ar - e3i * ai, bi = e3r * ai + e3i * ar;
        const double Qr = g * (-(ur * ny + ui * nx) + br * nx + bi * ny);
        const double Qi = g * (ur * nx - ui * ny + bi * nx - br * ny);
        H->xx[j] = P + Qr;
        H->xy[j] = Qi;
        H->yx[j] = Qi;
        H->yy[j] = P - Qr;
    }
    if (!G) return;
    for (int j = 0; j < count; j++) {
        const double ex = s->ex[first + j], ey = s->ey[first + j], y2 = 2 * b->y[j];
        const double e2r = ex * ex - ey * ey, e2i = 2 * ex * ey, e3r = e2r * ex - e2i * ey, e3i = e2r * ey + e2i * ex;
        const double vr = ex * cr[j] + ey * ci[j], vi = ey * cr[j] - ex * ci[j]; /* e conj(c) */
        const double Pr = -f * (1 + kappa) * (vr * nx + vi * ny), Pi = -f * (kappa - 1) * (vi * nx - vr * ny);
        /* -e conj(c) N + e^3 (2 i y conj(d) - conj(c)) conj(N) */
        const double ar = y2 * di[j] - cr[j], ai = y2 * dr[j] + ci[j];
        const double br = e3r * ar - e3i * ai, bi = e3r * ai + e3i * ar;
        const double Qr = f * (-(vr * nx - vi * ny) + br * nx + bi * ny);
        const double Qi = f * (-(vr * ny + vi * nx) + bi * nx - br * ny);
        G->xx[j] = Pr + Qr;
        G->xy[j] = Qi - Pi;
        G->yx[j] = Pi + Qi;
        G->yy[j] = Pr - Qr;
    }
}

/* Straight elements first .. first + count - 1 of one family with polynomial shapes. */
static void fill_batch(const Rows *r, const Segments *s, Py_ssize_t i, Py_ssize_t first, int count, Batch *b)
{
    const int shapes = r->order + 1, family = r->family[first], tractions = r->traction && family == BOUNDARY;
    const int stress = r->normal != NULL;
    const Py_ssize_t width = 2 * r->elements * shapes;
    const double *shape = r->shape + family * shapes * shapes;
    evaluate_far(s, first, count, r->point[i], r->order, tractions && !stress, stress, b);
    mend_near(s, first, count, r->point[i], r->on[i], r->order, b);
    shape_moments(b->cr, count, shapes, shape);
    shape_moments(b->ci, count, shapes, shape);
    shape_moments(b->dr, count, shapes, shape);
    shape_moments(b->di, count, shapes, shape);
    if (stress) {
        shape_moments(b->er, count, shapes, shape);
        shape_moments(b->ei, count, shapes, shape);
    } else if (tractions) {
        shape_moments(b->n, count, shapes, shape);
    }
    for (int node = 0; node < shapes; node++) {
        const Py_ssize_t at = 2 * i * width + 2 * (first * shapes + node);
        Blocks H, G;
        double l = 0;
        for (int k = 0; k < shapes; k += 2) l += shape[k * shapes + node] * 2.0 / (k + 1);
        if (stress)
            combine_tractions(r, s, first, count, node, r->normal[i], b, &H, tractions ? &G : NULL);
        else
            combine_displacements(r, s, first, count, node, l, b, &H, tractions ? &G : NULL);
        put_blocks(r->displacement + at, width, 2 * shapes, count, &H);
        if (tractions) put_blocks(r->traction + at, width, 2 * shapes, count, &G);
    }
}

/* How many elements from j on can be done in one batch; 0 if j needs treatment of its own (an arc, a crack tip). */
static int count_batch(const Rows *r, Py_ssize_t j)
{
    int count = 0;
    while (count < BATCH && j + count < r->elements && r->sweep[j + count] == 0 && !is_tip(r->family[j + count]) &&
           r->family[j + count] == r->family[j])
        count++;
    return count;
}

/* arcs: one for every element, prepared where the element is an arc. */
static void fill_rows(const Rows *r, const Arc *arcs, const Segments *s)
{
    Batch batch;
    for (Py_ssize_t j = 0; j < r->elements;) {
        const int count = count_batch(r, j);
        for (Py_ssize_t i = 0; i < r->points; i++) {
            if (count)
                fill_batch(r, s, i, j, count, &batch);
            else
                fill_element(r, arcs, i, j);
        }
        j += count ? count : 1;
    }
}

/* Geometry of all elements as the batches read it; NULL fields if memory is short. */
static Segments prepare_segments(const Rows *r)
{
    const Py_ssize_t n = r->elements;
    double *all = malloc((6 * n + 1) * sizeof(double));
    const Segments s = {all, all + n, all + 2 * n, all + 3 * n, all + 4 * n, all + 5 * n};
    for (Py_ssize_t j = 0; all && j < n; j++) {
        const cplx half = 0.5 * (r->end[j] - r->start[j]), middle = 0.5 * (r->end[j] + r->start[j]);
        const double h = cabs(half);
        s.mx[j] = creal(middle);
        s.my[j] = cimag(middle);
        s.ex[j] = creal(half) / h;
        s.ey[j] = cimag(half) / h;
        s.h[j] = h;
        s.log_h[j] = log(h);
    }
    return s;
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
