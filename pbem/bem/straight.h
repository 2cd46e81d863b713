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
#include "rows.h"

/* Elements, one a lane: middle, unit direction, half-length, its inverse and its logarithm (theory, 16). */
typedef struct {
    Complex m, e;
    Lanes h, inverse_h, log_h;
} Frame;

typedef struct {
    Lanes y;
    Complex c[MAX_SHAPES + 1], d[MAX_SHAPES], e[MAX_SHAPES];
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
INLINE Complex sum_series(const double *a, int terms, Complex q)
{
    const Lanes twice = 2 * q.re, square = c_norm(q);
    Lanes after = spread(0), sum = spread(a[terms]);
    for (int i = terms - 1; i > 0; i--) {
        const Lanes next = (a[i] - square * after) + twice * sum;
        after = sum;
        sum = next;
    }
    return c_make((a[0] - square * after) + q.re * sum, q.im * sum);
}

/* The points as seen from the elements: w = (z - m) conj(e)/h. */
INLINE Complex locate(const Frame *f, Complex z)
{
    return c_scale(f->inverse_h, c_mul_conj(c_sub(z, f->m), f->e));
}

/* w^2 - 1 and, from its two factors, |w - 1|^2 and |w + 1|^2; without cancellation near the ends. */
INLINE Complex multiply_ends(Complex w)
{
    return c_make((w.re - 1) * (w.re + 1) - w.im * w.im, 2 * w.re * w.im);
}

INLINE Lanes measure_end(Complex w, int end) { return (w.re - end) * (w.re - end) + w.im * w.im; }
INLINE Lanes measure_ends(Complex w) { return measure_end(w, 1) * measure_end(w, -1); }

INLINE double integrate_power(int k) { return k % 2 ? 0.0 : 2.0 / (k + 1); }

/* n_k from the others. log_ends = ln|w^2 - 1| (theory, 22). */
INLINE void find_logarithmic(int order, Lanes log_ends, LaneMoments *m)
{
    for (int k = 0; k <= order; k++) m->n[k] = ((k % 2 ? m->c[0].re : log_ends) - m->c[k + 1].re) * (1.0 / (k + 1));
}

/* ends = |w^2 - 1|^2 (theory, 23) */
INLINE void evaluate_far(Variant is, int terms, Complex w, Lanes ends, LaneMoments *m)
{
    const int top = is.order + 1;
    const Lanes r2 = c_norm(w), both = 1 / (r2 * ends);
    const Complex v = c_scale(both * ends, c_conj(w)), q = c_square(v);  /* 1/w, 1/w^2 */
    const Complex d0 = c_scale(2 * both * r2, c_conj(multiply_ends(w))); /* 2/(w^2 - 1) */
    const Complex sum = sum_series(series + (top + 1) / 2, terms, q);
    m->y = w.im;
    m->c[top] = c_mul(sum, top % 2 ? q : v);
#pragma GCC unroll 4
    for (int k = is.order; k >= 0; k--) m->c[k] = c_mul(c_shift(m->c[k + 1], -integrate_power(k)), v);
    m->d[0] = d0;
#pragma GCC unroll 4
    for (int k = 1; k <= is.order; k++) {
        const Complex kc = c_scale(k, m->c[k]);
        m->d[k] = k % 2 ? c_mul(c_add(kc, d0), v) : c_add(c_mul(kc, v), d0);
    }
    if (is.equation != TRACTION_EQUATION) return;
    Complex rest = c_mul(c_square(d0), w); /* d_0^2 w^(1 - k) */
#pragma GCC unroll 4
    for (int k = 0; k <= is.order; k++) {
        m->e[k] = k > 1 ? c_sub(c_mul(c_scale(k * (k - 1), m->c[k]), q), rest) : c_neg(rest);
        rest = c_mul(rest, v);
    }
}

/* Near the element: upward from c_0 = log_ratio + i angle (theory, 20, 21). */
INLINE void evaluate_near(Variant is, Complex w, Lanes log_ratio, Lanes angle, LaneMoments *m)
{
    m->y = w.im;
    m->c[0] = c_make(log_ratio, angle);
    m->d[0] = c_scale(2 / measure_ends(w), c_conj(multiply_ends(w)));
#pragma GCC unroll 4
    for (int k = 0; k <= is.order; k++) m->c[k + 1] = c_shift(c_mul(w, m->c[k]), integrate_power(k));
#pragma GCC unroll 4
    for (int k = 0; k < is.order; k++) m->d[k + 1] = c_add(c_mul(w, m->d[k]), m->c[k]);
    if (is.equation != TRACTION_EQUATION) return;
    m->e[0] = c_neg(c_mul(c_square(m->d[0]), w));
#pragma GCC unroll 4
    for (int k = 0; k < is.order; k++) m->e[k + 1] = c_add(c_mul(w, m->e[k]), c_scale(2, m->d[k]));
}

/* A point's place as a tip sees it: distance along and across from it, in lengths of the element. */
INLINE Complex locate_from_tip(int tip, Complex w) { return c_shift(c_scale(0.5 * point_inward(tip), w), 0.5); }

/* Far from a tip element, q counted from the tip; moments in the element's coordinate as the others (theory, 25). */
INLINE void evaluate_far_tip(Variant is, int terms, int tip, Complex q, LaneMoments *m)
{
    const int with_e = is.equation == TRACTION_EQUATION;
    const double sign = point_inward(tip), (*a)[MOST_TERMS] = tip_series[is.order];
    const Complex v = c_inverse(q), v2 = c_square(v);
    Complex c = c_mul(sum_series(a[0], terms, v), v), d = c_mul(sum_series(a[1], terms, v), v2), e = c_real(spread(0));
    if (with_e) e = c_mul(c_mul(sum_series(a[2], terms, v), v), v2);
    m->y = 2 * sign * q.im;
#pragma GCC unroll 4
    for (int k = is.order; k >= 0; k--) {
        m->c[k] = c_scale(sign, c);
        m->d[k] = c_scale(0.5, d);
        m->e[k] = c_scale(0.25 * sign, e);
        if (k == 0) break;
        c = c_mul(c_shift(c, -1 / (k - 1 + 1.5)), v);
        d = c_mul(c_sub(d, c), v);
        if (with_e) e = c_mul(c_sub(e, c_scale(2, d)), v);
    }
}

/* Near a tip element, one pair after the other (theory, 24). */
static void put_near_tip(int order, int tip, cplx w, int on, int lane, LaneMoments *to)
{
    Moments m;
    evaluate_tip_moments(w, on, order, tip, &m);
    to->y[lane] = m.y;
    for (int k = 0; k <= order; k++) {
        c_put(&to->c[k], lane, m.c[k]);
        c_put(&to->d[k], lane, m.d[k]);
        c_put(&to->e[k], lane, m.e[k]);
    }
}

#endif
