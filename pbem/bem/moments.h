/* Moments of the densities on a straight reference element [-1, 1]; see _kernels.c for what they are. */
#ifndef PBEM_MOMENTS_H
#define PBEM_MOMENTS_H
#include <complex.h>
#include <math.h>

typedef double complex cplx;

#define MAX_ORDER 3
#define MAX_SHAPES (MAX_ORDER + 1)
/* What an element's nodal values mean: polynomials on boundaries; on cracks polynomials between other nodes, or the
 * square-root shapes of a tip at either end. Only boundaries carry tractions. */
enum { BOUNDARY = 0, TIP_AT_START = 1, TIP_AT_END = 2, CRACK = 3, FAMILIES = 4 };

static inline int is_tip(int family)
{
    return family == TIP_AT_START || family == TIP_AT_END;
}

/* The direction from the tip into its element, along s. */
static inline double point_inward(int tip)
{
    return tip == TIP_AT_START ? 1.0 : -1.0;
}

typedef struct {
    cplx c[MAX_SHAPES + 1], d[MAX_SHAPES], e[MAX_SHAPES];
    double n[MAX_SHAPES], l[MAX_SHAPES]; /* l_k = int s^k ds */
    double y;                            /* Im w, in units of h */
} Moments;

/* Beyond this |w|^2 the series in 1/w is used; at it, upward recursion to k = 4 loses a factor of about 16. */
static const double FAR_SQUARED = 4.0;
/* The same for a tip element, counted from the tip in units of the element's length. */
static const double FAR_TIP_SQUARED = 4.0;

/* Terms of a series in q = 1/|w|^2 (or 1/|w|) that reach rounding: the least K with q^K < 1e-17. */
static int count_terms(double inverse_ratio)
{
    return 1 + (int)(39.2 / log(inverse_ratio));
}

/* (theory, 20, 21) */
static void evaluate_moments(cplx w, int on_element, int order, Moments *m)
{
    const double x = creal(w), y = on_element ? 0.0 : cimag(w);
    const double r2 = x * x + y * y;
    /* |w^2 - 1|^2 = |w - 1|^2 |w + 1|^2, without cancellation near the ends */
    const double right = (x - 1) * (x - 1) + y * y, left = (x + 1) * (x + 1) + y * y;
    const double log_ends = 0.5 * log(right * left);
    const int top = order + 1;
    m->y = y;
    w = x + I * y;
    for (int k = 0; k <= order; k++) m->l[k] = (k % 2) ? 0.0 : 2.0 / (k + 1);

    if (r2 < FAR_SQUARED) {
        /* |w|^2 - 1, without cancellation near the ends */
        const double angle = on_element ? 0.0 : atan2(2 * y, (x - 1) * (x + 1) + y * y);
        const cplx below = 1 / (w - 1), above = 1 / (w + 1);
        m->c[0] = 0.5 * log(right / left) + I * angle;
        m->d[0] = below - above;
        m->e[0] = above * above - below * below;
        for (int k = 0; k < top; k++) {
            const double l = (k % 2) ? 0.0 : 2.0 / (k + 1);
            m->c[k + 1] = w * m->c[k] + l;
        }
        for (int k = 0; k < order; k++) {
            m->d[k + 1] = w * m->d[k] + m->c[k];
            m->e[k + 1] = w * m->e[k] + 2 * m->d[k];
        }
    } else {
        const cplx v = conj(w) / r2, v2 = v * v;
        const int terms = count_terms(r2);
        cplx c = 0, d = 0, e = 0;
        /* c_top = - sum over j = top (mod 2), j += 2 of 2/(top + j + 1) v^(j + 1); Horner in v^2 */
        const int first = top % 2;
        for (int i = terms; i >= 0; i--) {
            const int j = first + 2 * i;
            const double a = -2.0 / (top + j + 1);
            c = c * v2 + a;
            d = d * v2 - a * (j + 1);
            e = e * v2 + a * (j + 1) * (j + 2);
        }
        const cplx lead = first ? v2 : v;
        m->c[top] = c * lead;
        cplx d_above = d * lead * v, e_above = e * lead * v2;
        for (int k = order; k >= 0; k--) {
            const double l = (k % 2) ? 0.0 : 2.0 / (k + 1);
            m->c[k] = v * (m->c[k + 1] - l);
            m->d[k] = d_above = v * (d_above - m->c[k]);
            m->e[k] = e_above = v * (e_above - 2 * m->d[k]);
        }
    }
    for (int k = 0; k <= order; k++) {
        const double ends = (k % 2) ? creal(m->c[0]) : log_ends;
        m->n[k] = (ends - creal(m->c[k + 1])) / (k + 1);
    }
}

/* Moments of t^(k + 1/2) seen from the tip, in the element's own coordinate, units and direction (theory, 24). */
static void evaluate_tip_moments(cplx w, int on_element, int order, int tip, Moments *m)
{
    const double sign = point_inward(tip);
    m->y = on_element ? 0.0 : cimag(w);
    /* distance from the tip over the length: (1 + w)/2 at the start; at the end the axis is reversed, (1 - w)/2 */
    const cplx q = 0.5 * (1 + sign * (creal(w) + I * m->y));
    const double r2 = creal(q) * creal(q) + cimag(q) * cimag(q);
    if (r2 < FAR_TIP_SQUARED) {
        const cplx root = csqrt(q), sum = root + 1;
        /* q - 1 = (root - 1)(root + 1), without cancellation near the other end */
        const cplx rest = 0.5 * (sign * (creal(w) + I * m->y) - 1), ratio = rest / (sum * sum);
        const cplx logarithm = on_element ? log(-creal(ratio)) : clog(ratio);
        m->c[0] = 2 + root * logarithm;
        m->d[0] = logarithm / (2 * root) + 1 / rest;
        m->e[0] = -logarithm / (4 * q * root) + 1 / (2 * q * rest) - 1 / (rest * rest);
        for (int k = 0; k < order; k++) {
            m->c[k + 1] = q * m->c[k] + 1 / (k + 1.5);
            m->d[k + 1] = q * m->d[k] + m->c[k];
            m->e[k + 1] = q * m->e[k] + 2 * m->d[k];
        }
    } else {
        const cplx v = conj(q) / r2;
        const int terms = count_terms(sqrt(r2));
        cplx c = 0, d = 0, e = 0;
        for (int j = terms; j >= 0; j--) {
            const double a = -1.0 / (order + j + 1.5);
            c = c * v + a;
            d = d * v - a * (j + 1);
            e = e * v + a * (j + 1) * (j + 2);
        }
        m->c[order] = c * v;
        m->d[order] = d * v * v;
        m->e[order] = e * v * v * v;
        for (int k = order - 1; k >= 0; k--) {
            m->c[k] = v * (m->c[k + 1] - 1 / (k + 1.5));
            m->d[k] = v * (m->d[k + 1] - m->c[k]);
            m->e[k] = v * (m->e[k + 1] - 2 * m->d[k]);
        }
    }
    for (int k = 0; k <= order; k++) {
        m->c[k] *= sign;
        m->d[k] *= 0.5;
        m->e[k] *= 0.25 * sign;
    }
}

/* Of the shapes of a family: polynomials, or those of a tip. */
static void evaluate_family_moments(cplx w, int on_element, int order, int family, Moments *m)
{
    if (is_tip(family))
        evaluate_tip_moments(w, on_element, order, family, m);
    else
        evaluate_moments(w, on_element, order, m);
}

#endif
