/* Moments of straight elements, several pairs of point and element at a time; see _kernels.c for what they are.
 *
 * Far from an element only the highest c is summed, in v = 1/w; the others follow without loss of digits. With q = v^2
 * and Y = 2/(w^2 - 1) = d_0:
 *
 *     c_k = v (c_(k+1) - l_k),   d_k = k v c_k + Y (k even) or v Y (k odd),   e_k = k (k - 1) q c_k - w v^k Y^2.
 *
 * (Integrate by parts, and s^k/(s - w) = s^(k-1) + w s^(k-1)/(s - w).) For a tip, w now counted from it in units of the
 * element's length, all three of the highest power are summed and
 *
 *     c_k = v (c_(k+1) - 1/(k + 3/2)),   d_k = v (d_(k+1) - c_k),   e_k = v (e_(k+1) - 2 d_k).
 */
#ifndef PBEM_STRAIGHT_H
#define PBEM_STRAIGHT_H
#include "lanes.h"
#include "moments.h"

/* Elements, one a lane: middle, unit direction, half-length, its inverse and its logarithm. */
typedef struct {
    Lanes mx, my, ex, ey, h, inverse_h, log_h;
} Frame;

typedef struct {
    Lanes y, cr[MAX_SHAPES + 1], ci[MAX_SHAPES + 1], dr[MAX_SHAPES], di[MAX_SHAPES], er[MAX_SHAPES], ei[MAX_SHAPES];
    Lanes n[MAX_SHAPES];
} LaneMoments;

#define MOST_TERMS 72
/* Coefficients -2/(2 i + 1) of c_top; of c, d and e of the highest power on a tip element, by order. */
static double series[MOST_TERMS + MAX_SHAPES], tip_series[MAX_SHAPES][3][MOST_TERMS];
/* Where 1/|q| exceeds the limit the rest after q^terms is below rounding; e of tips has larger coefficients. */
static double term_limit[MOST_TERMS], tip_term_limit[MOST_TERMS];

static void prepare_series(void)
{
    for (int i = 0; i < MOST_TERMS + MAX_SHAPES; i++) series[i] = -2.0 / (2 * i + 1);
    for (int i = 0; i < MOST_TERMS; i++) {
        term_limit[i] = pow(10, 17.0 / (i + 1));
        tip_term_limit[i] = pow(10, 19.0 / (i + 1));
        for (int order = 0; order <= MAX_ORDER; order++) {
            const double a = -1 / (order + i + 1.5);
            tip_series[order][0][i] = a;
            tip_series[order][1][i] = -a * (i + 1);
            tip_series[order][2][i] = a * (i + 1) * (i + 2);
        }
    }
}

INLINE int choose_terms(const double *limit, double inverse_ratio)
{
    int terms = 2;
    while (inverse_ratio < limit[terms]) terms++;
    return terms;
}

/* sum of a_i q^i, i = 0 .. terms, with real coefficients: by the real recursion of the quadratic with the roots q. */
INLINE void sum_series(const double *a, int terms, Lanes qr, Lanes qi, Lanes *pr, Lanes *pi)
{
    const Lanes twice = 2 * qr, square = qr * qr + qi * qi;
    Lanes after = spread(0), sum = spread(a[terms]);
    for (int i = terms - 1; i > 0; i--) {
        const Lanes next = (a[i] - square * after) + twice * sum;
        after = sum;
        sum = next;
    }
    *pr = (a[0] - square * after) + qr * sum;
    *pi = qi * sum;
}

/* The points as seen from the elements: along and across, in half-lengths. */
INLINE void locate(const Frame *f, Lanes zx, Lanes zy, Lanes *x, Lanes *y)
{
    const Lanes dx = zx - f->mx, dy = zy - f->my;
    *x = (dx * f->ex + dy * f->ey) * f->inverse_h;
    *y = (dy * f->ex - dx * f->ey) * f->inverse_h;
}

/* |w^2 - 1|^2 = |w - 1|^2 |w + 1|^2, without cancellation near the ends. */
INLINE Lanes measure_ends(Lanes x, Lanes y)
{
    return ((x - 1) * (x - 1) + y * y) * ((x + 1) * (x + 1) + y * y);
}

INLINE double integrate_power(int k) { return k % 2 ? 0.0 : 2.0 / (k + 1); }

/* n_k from the others. log_ends = ln|w^2 - 1| (theory, 22). */
INLINE void find_logarithmic(int order, Lanes log_ends, LaneMoments *m)
{
    for (int k = 0; k <= order; k++) m->n[k] = ((k % 2 ? m->cr[0] : log_ends) - m->cr[k + 1]) * (1.0 / (k + 1));
}

/* (theory, 23) */
INLINE void evaluate_far(int order, int with_e, int terms, Lanes x, Lanes y, Lanes ends, LaneMoments *m)
{
    const int top = order + 1;
    const Lanes r2 = x * x + y * y, both = 1 / (r2 * ends), inverse = both * ends, over_ends = 2 * both * r2;
    const Lanes vr = x * inverse, vi = -y * inverse, qr = vr * vr - vi * vi, qi = 2 * vr * vi;
    const Lanes Yr = over_ends * ((x - 1) * (x + 1) - y * y), Yi = -2 * over_ends * x * y;
    Lanes cr, ci;
    /* c_top = - sum of 2/(top + j + 1) v^(j + 1) over j = top (mod 2) */
    sum_series(series + (top + 1) / 2, terms, qr, qi, &cr, &ci);
    m->y = y;
    m->cr[top] = top % 2 ? MULTIPLY_REAL(cr, ci, qr, qi) : MULTIPLY_REAL(cr, ci, vr, vi);
    m->ci[top] = top % 2 ? MULTIPLY_IMAGINARY(cr, ci, qr, qi) : MULTIPLY_IMAGINARY(cr, ci, vr, vi);
#pragma GCC unroll 4
    for (int k = order; k >= 0; k--) {
        const Lanes ur = m->cr[k + 1] - integrate_power(k), ui = m->ci[k + 1];
        m->cr[k] = MULTIPLY_REAL(ur, ui, vr, vi);
        m->ci[k] = MULTIPLY_IMAGINARY(ur, ui, vr, vi);
    }
#pragma GCC unroll 4
    for (int k = 0; k <= order; k++) {
        const Lanes cr = k * m->cr[k], ci = k * m->ci[k];
        if (k == 0) {
            m->dr[k] = Yr;
            m->di[k] = Yi;
        } else if (k % 2) {
            m->dr[k] = MULTIPLY_REAL(cr + Yr, ci + Yi, vr, vi);
            m->di[k] = MULTIPLY_IMAGINARY(cr + Yr, ci + Yi, vr, vi);
        } else {
            m->dr[k] = MULTIPLY_REAL(cr, ci, vr, vi) + Yr;
            m->di[k] = MULTIPLY_IMAGINARY(cr, ci, vr, vi) + Yi;
        }
    }
    if (!with_e) return;
    /* X = w v^k Y^2 */
    const Lanes Y2r = Yr * Yr - Yi * Yi, Y2i = 2 * Yr * Yi;
    Lanes Xr = MULTIPLY_REAL(Y2r, Y2i, x, y), Xi = MULTIPLY_IMAGINARY(Y2r, Y2i, x, y);
#pragma GCC unroll 4
    for (int k = 0; k <= order; k++) {
        m->er[k] = -Xr;
        m->ei[k] = -Xi;
        if (k > 1) {
            const Lanes cr = k * (k - 1) * m->cr[k], ci = k * (k - 1) * m->ci[k];
            m->er[k] += MULTIPLY_REAL(cr, ci, qr, qi);
            m->ei[k] += MULTIPLY_IMAGINARY(cr, ci, qr, qi);
        }
        const Lanes real = MULTIPLY_REAL(Xr, Xi, vr, vi);
        Xi = MULTIPLY_IMAGINARY(Xr, Xi, vr, vi);
        Xr = real;
    }
}

/* Near the element: upward from c_0 = log_ratio + i angle (theory, 20, 21). */
INLINE void evaluate_near(int order, int with_e, Lanes x, Lanes y, Lanes log_ratio, Lanes angle, LaneMoments *m)
{
    const Lanes over_ends = 2 / measure_ends(x, y);
    const Lanes Yr = over_ends * ((x - 1) * (x + 1) - y * y), Yi = -2 * over_ends * x * y;
    m->y = y;
    m->cr[0] = log_ratio;
    m->ci[0] = angle;
    m->dr[0] = Yr;
    m->di[0] = Yi;
#pragma GCC unroll 4
    for (int k = 0; k <= order; k++) {
        m->cr[k + 1] = MULTIPLY_REAL(x, y, m->cr[k], m->ci[k]) + integrate_power(k);
        m->ci[k + 1] = MULTIPLY_IMAGINARY(x, y, m->cr[k], m->ci[k]);
    }
#pragma GCC unroll 4
    for (int k = 0; k < order; k++) {
        m->dr[k + 1] = MULTIPLY_REAL(x, y, m->dr[k], m->di[k]) + m->cr[k];
        m->di[k + 1] = MULTIPLY_IMAGINARY(x, y, m->dr[k], m->di[k]) + m->ci[k];
    }
    if (!with_e) return;
    const Lanes Y2r = Yr * Yr - Yi * Yi, Y2i = 2 * Yr * Yi;
    m->er[0] = -MULTIPLY_REAL(Y2r, Y2i, x, y);
    m->ei[0] = -MULTIPLY_IMAGINARY(Y2r, Y2i, x, y);
#pragma GCC unroll 4
    for (int k = 0; k < order; k++) {
        m->er[k + 1] = MULTIPLY_REAL(x, y, m->er[k], m->ei[k]) + 2 * m->dr[k];
        m->ei[k + 1] = MULTIPLY_IMAGINARY(x, y, m->er[k], m->ei[k]) + 2 * m->di[k];
    }
}

/* A point's place as a tip sees it: distance along and across from it, in lengths of the element. */
INLINE void locate_from_tip(int tip, Lanes *x, Lanes *y)
{
    const double sign = tip == TIP_AT_START ? 0.5 : -0.5;
    *x = 0.5 + sign * *x;
    *y = sign * *y;
}

/* Far from a tip element, x and y counted from the tip; moments in the element's own coordinate as the others. */
/* (theory, 25) */
INLINE void evaluate_far_tip(int order, int with_e, int terms, int tip, Lanes x, Lanes y, LaneMoments *m)
{
    const double sign = tip == TIP_AT_START ? 1.0 : -1.0;
    const Lanes inverse = 1 / (x * x + y * y), vr = x * inverse, vi = -y * inverse;
    const Lanes v2r = vr * vr - vi * vi, v2i = 2 * vr * vi;
    Lanes pr, pi, cr, ci, dr, di, er = spread(0), ei = er;
    sum_series(tip_series[order][0], terms, vr, vi, &pr, &pi);
    cr = MULTIPLY_REAL(pr, pi, vr, vi);
    ci = MULTIPLY_IMAGINARY(pr, pi, vr, vi);
    sum_series(tip_series[order][1], terms, vr, vi, &pr, &pi);
    dr = MULTIPLY_REAL(pr, pi, v2r, v2i);
    di = MULTIPLY_IMAGINARY(pr, pi, v2r, v2i);
    if (with_e) {
        sum_series(tip_series[order][2], terms, vr, vi, &pr, &pi);
        const Lanes ar = MULTIPLY_REAL(pr, pi, vr, vi), ai = MULTIPLY_IMAGINARY(pr, pi, vr, vi);
        er = MULTIPLY_REAL(ar, ai, v2r, v2i);
        ei = MULTIPLY_IMAGINARY(ar, ai, v2r, v2i);
    }
    m->y = 2 * sign * y;
#pragma GCC unroll 4
    for (int k = order; k >= 0; k--) {
        m->cr[k] = sign * cr;
        m->ci[k] = sign * ci;
        m->dr[k] = 0.5 * dr;
        m->di[k] = 0.5 * di;
        m->er[k] = 0.25 * sign * er;
        m->ei[k] = 0.25 * sign * ei;
        if (k == 0) break;
        const Lanes br = cr - 1 / (k + 0.5), bi = ci;
        cr = MULTIPLY_REAL(br, bi, vr, vi);
        ci = MULTIPLY_IMAGINARY(br, bi, vr, vi);
        const Lanes fr = dr - cr, fi = di - ci;
        dr = MULTIPLY_REAL(fr, fi, vr, vi);
        di = MULTIPLY_IMAGINARY(fr, fi, vr, vi);
        if (!with_e) continue;
        const Lanes gr = er - 2 * dr, gi = ei - 2 * di;
        er = MULTIPLY_REAL(gr, gi, vr, vi);
        ei = MULTIPLY_IMAGINARY(gr, gi, vr, vi);
    }
}

#endif
