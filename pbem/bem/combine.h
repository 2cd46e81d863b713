/* From moments of nodal shapes to the factors of an element's nodes: each line is a formula of the page of theory.
 *
 * H takes displacements, G tractions; first straight elements, then curved ones.
 */
#ifndef PBEM_COMBINE_H
#define PBEM_COMBINE_H
#include "curves.h"
#include "straight.h"

/* (theory, 26, 27) */
INLINE void combine_displacements(Variant v, const Rows *r, const double *integral, const Frame *at,
                                  const LaneMoments *m, Factors *H, Factors *G)
{
    const double kappa = r->kappa, f = r->f, ft = r->ft;
    const Complex e2 = c_square(at->e), y_e2 = c_scale(2 * f * m->y, e2);
#pragma GCC unroll 4
    for (int j = 0; j <= v.order; j++) {
        H->P[j] = c_make(f * (kappa + 1) * m->c[j].im, f * (1 - kappa) * m->c[j].re);
        H->Q[j] = c_mul_conj(y_e2, m->d[j]);
    }
    if (!v.tractions) return;
    const Lanes h = ft * at->h, log_h = at->log_h - r->log_length;
    const Complex h_e2 = c_scale(h, e2), yh_e2 = c_scale(2 * m->y, h_e2);
#pragma GCC unroll 4
    for (int j = 0; j <= v.order; j++) {
        const double l = integral[j];
        G->P[j] = c_real(-2 * kappa * h * (m->n[j] + l * log_h));
        G->Q[j] = c_sub(c_scale(l, h_e2), c_times_i(c_mul_conj(yh_e2, m->c[j])));
    }
}

/* On the normals N at the points (theory, 28, 29). */
INLINE void combine_tractions(Variant v, const Rows *r, const Frame *at, Complex N, const LaneMoments *m, Factors *H,
                              Factors *G)
{
    const double kappa = r->kappa, f = r->f;
    const Lanes g = 2 * r->shear_modulus * f * at->inverse_h, y2 = 2 * m->y;
    const Complex e2 = c_square(at->e), A = c_mul_conj(at->e, N), e2_A = c_mul(e2, A), S = c_scale(2 * A.re, e2);
    const Complex gA = c_scale(2 * g, A), igS = c_times_i(c_scale(g, S)), yg_e2_A = c_scale(y2 * g, e2_A);
#pragma GCC unroll 4
    for (int j = 0; j <= v.order; j++) {
        H->P[j] = c_real(-c_mul_conj(gA, m->d[j]).im);
        H->Q[j] = c_add(c_mul_conj(igS, m->d[j]), c_mul_conj(yg_e2_A, m->e[j]));
    }
    if (!v.tractions) return;
    const Complex sum_A = c_scale(f * (kappa + 1), A), difference_A = c_scale(f * (kappa - 1), A);
    const Complex fS = c_scale(f, S), iy_e2_A = c_times_i(c_scale(f * y2, e2_A));
#pragma GCC unroll 4
    for (int j = 0; j <= v.order; j++) {
        G->P[j] = c_make(c_mul_conj(sum_A, m->c[j]).re, c_mul_conj(difference_A, m->c[j]).im);
        G->Q[j] = c_sub(c_mul_conj(fS, m->c[j]), c_mul_conj(iy_e2_A, m->d[j]));
    }
}

/* (theory, 33) */
INLINE void combine_curve_displacements(Variant v, const Rows *r, const CurveMoments *m, Factors *H, Factors *G)
{
    const double kappa = r->kappa, f = r->f, ft = r->ft;
#pragma GCC unroll 4
    for (int j = 0; j <= v.order; j++) {
        H->P[j] = c_make(f * (kappa + 1) * m->c[j].im, f * (1 - kappa) * m->c[j].re);
        H->Q[j] = c_scale(f, c_times_i(c_conj(m->q[j])));
        if (!v.tractions) continue;
        G->P[j] = c_real(-2 * kappa * ft * m->n[j]);
        G->Q[j] = c_scale(ft, c_conj(m->s[j]));
    }
}

/* (theory, 33) */
INLINE void combine_curve_tractions(Variant v, const Rows *r, Complex N, const CurveMoments *m, Factors *H, Factors *G)
{
    const double kappa = r->kappa, f = r->f, g = 2 * r->shear_modulus * f;
#pragma GCC unroll 4
    for (int j = 0; j <= v.order; j++) {
        H->P[j] = c_real(2 * g * c_mul(m->d[j], N).im);
        H->Q[j] = c_scale(g, c_times_i(c_add(c_mul_conj(N, m->d[j]), c_conj(c_mul(m->dq[j], N)))));
        if (!v.tractions) continue;
        const Complex xN = c_mul(m->x[j], N);
        G->P[j] = c_make(f * (1 + kappa) * xN.re, f * (1 - kappa) * xN.im);
        G->Q[j] = c_scale(f, c_add(c_mul_conj(N, m->x[j]), c_conj(c_mul(m->y[j], N))));
    }
}

/* Moments of powers on straight elements, in lanes, to blocks in the rows. */
INLINE void store_straight(Variant v, const Rows *r, const Elements *of, const Frame *at, LaneMoments *m,
                           const Pairs *pairs)
{
    const int shapes = v.order + 1, traction = v.equation == TRACTION_EQUATION;
    Factors H, G;
    shape_complex(shapes, of->shape, m->d);
    if (!traction || v.tractions) shape_complex(shapes, of->shape, m->c);
    if (traction) {
        shape_complex(shapes, of->shape, m->e);
        combine_tractions(v, r, at, pairs->N, m, &H, &G);
    } else {
        if (v.tractions) shape_real(shapes, of->shape, m->n);
        combine_displacements(v, r, of->integral, at, m, &H, &G);
    }
    store_factors(v, &H, pairs->H, pairs->width);
    if (v.tractions) store_factors(v, &G, pairs->G, pairs->width);
}

/* Moments of nodal shapes on curved elements to blocks in the rows. */
INLINE void store_curve(Variant v, const Rows *r, const CurveMoments *m, const Pairs *pairs)
{
    Factors H, G;
    if (v.equation == TRACTION_EQUATION)
        combine_curve_tractions(v, r, pairs->N, m, &H, &G);
    else
        combine_curve_displacements(v, r, m, &H, &G);
    store_factors(v, &H, pairs->H, pairs->width);
    if (v.tractions) store_factors(v, &G, pairs->G, pairs->width);
}

#endif
