/* Integrals over a circular arc, in closed form; away from it far_arcs.h takes Gauss points.
 *
 * With the centre as origin, an arc of half-angle theta about the direction a is the image of s in [-1, 1] under
 *
 *     zeta = R a (1 + i q s)/(1 - i q s),   q = tan(theta/2),
 *
 * a Moebius map: zeta = z at s = w, zeta = infinity at s = -i/q, zeta = 0 at s = i/q. Every kernel is rational in zeta
 * and conj(zeta) = R^2/zeta, so that partial fractions in s bring all integrals back to the moments c, d, e of the
 * straight element at w and at the two fixed poles. Displacements are polynomials (or tip shapes) of s; tractions times
 * d(arc length)/ds are polynomials of s.
 *
 *     c = int s^k dzeta/(zeta - z),      d = dc/dz,
 *     q = int s^k ((conj zeta - conj z) dzeta/(zeta - z)^2 - d(conj zeta)/(zeta - z)),   dq = dq/dz at fixed conj z,
 * and for tractions, ds meaning |J| ds with J = 2 R q,
 *     n = int s^k ln|zeta - z| ds,       x = int s^k ds/(zeta - z),
 *     s = int s^k (conj zeta - conj z)/(zeta - z) ds,   y = ds/dz at fixed conj z,   l = int s^k ds.
 */
#ifndef PBEM_ARCS_H
#define PBEM_ARCS_H
#include "moments.h"

typedef struct {
    cplx c[MAX_SHAPES], d[MAX_SHAPES], q[MAX_SHAPES], dq[MAX_SHAPES];
    cplx s[MAX_SHAPES], x[MAX_SHAPES], y[MAX_SHAPES];
    double n[MAX_SHAPES], l[MAX_SHAPES];
} ArcMoments;

typedef struct {
    cplx center, apex; /* apex = R a, the middle of the arc from the centre */
    double q, radius, reach, jacobian;
    int order, family;
    cplx infinity, origin;       /* the poles -i/q and i/q */
    Moments at_infinity, at_origin;
    double node_weight[MAX_SHAPES]; /* by which nodal tractions become coefficients: 1/(1 + q^2 s^2) */
} Arc;

static const double ARC_LARGEST = 3.1416; /* sweep of an element, radians: a half circle and its rounding */

static void evaluate_reference(const Arc *arc, cplx s, int on, Moments *m)
{
    if (is_tip(arc->family))
        evaluate_tip_moments(s, on, arc->order, arc->family, m);
    else
        evaluate_moments(s, on, arc->order, m);
}

/* (theory, 17) */
static void prepare_arc(Arc *arc, cplx start, cplx center, double sweep, int order, int family,
                        const double *local)
{
    arc->center = center;
    arc->radius = cabs(start - center);
    arc->apex = (start - center) * cexp(0.5 * I * sweep);
    arc->q = tan(0.25 * sweep);
    arc->reach = 2 * arc->radius * fabs(sin(0.25 * sweep));
    arc->jacobian = 2 * arc->radius * fabs(arc->q);
    arc->order = order;
    arc->family = family;
    arc->infinity = -I / arc->q;
    arc->origin = I / arc->q;
    for (int k = 0; k <= order; k++) arc->node_weight[k] = 1 / (1 + arc->q * arc->q * local[k] * local[k]);
}

/* The moments at the poles, which only the closed form needs. */
static void prepare_poles(Arc *arc)
{
    evaluate_reference(arc, arc->infinity, 0, &arc->at_infinity);
    evaluate_reference(arc, arc->origin, 0, &arc->at_origin);
}

/* (theory, 30 to 32) */
static void close_near_arc(const Arc *arc, cplx z, int on, double s_on, ArcMoments *m)
{
    const double R = arc->radius, q = arc->q, J = arc->jacobian;
    const cplx a = arc->apex;
    const cplx w = on ? s_on : -I * (z / a - 1) / (q * (z / a + 1));
    const cplx below = 1 - I * q * w;
    const cplx w1 = -I * below * below / (2 * q * a), w2 = -below / a * w1; /* dw/dz, d2w/dz2 */
    /* R^2/z - conj z without cancellation of the squares; it vanishes on the arc */
    const cplx off = on ? 0 : (R - cabs(z)) * (R + cabs(z)) / z;
    const double im = on ? 0 : cimag(w);
    const cplx B = a + z, rho = conj(B) / B, from_pole = w - arc->infinity, from_zero = w - arc->origin;
    const cplx r1 = 2 * I * im * from_pole / from_zero;
    const cplx r2 = (arc->origin - conj(w)) * (arc->origin - arc->infinity) / -from_zero;
    const double log_B = log(cabs(B));
    const cplx zero1 = -I * (1 - I * q * arc->origin) * (1 - I * q * arc->origin) / (2 * q * a); /* dw/dz at z = 0 */
    Moments at;
    evaluate_reference(arc, w, on, &at);
    for (int k = 0; k <= arc->order; k++) {
        const cplx c = at.c[k] - arc->at_infinity.c[k], c_zero = arc->at_origin.c[k] - arc->at_infinity.c[k];
        const cplx d = at.d[k] * w1, e = at.e[k] * w1 * w1 + at.d[k] * w2, d_zero = arc->at_origin.d[k] * zero1;
        const cplx difference = (c - c_zero) / z; /* int s^k dzeta/(zeta (zeta - z)) */
        const cplx slope = (d - difference) / z;
        const cplx turned = -R * R * (difference - d_zero) / z; /* int s^k d conj(zeta)/(zeta - z) */
        const cplx turned1 = -R * R * slope / z - turned / z;
        m->c[k] = c;
        m->d[k] = d;
        m->q[k] = off * d - R * R * difference / z - turned;
        m->dq[k] = off * e - 2 * R * R * slope / z - turned1;
        if (arc->family != BOUNDARY) continue;
        const double l = at.l[k];
        m->n[k] = J * (l * log_B + at.n[k] - arc->at_infinity.n[k]);
        m->s[k] = J * rho * (l + r1 * at.c[k] + r2 * arc->at_origin.c[k]);
        m->x[k] = -J / B * (l + from_pole * at.c[k]);
        m->y[k] = -J * rho / B * (l + (from_pole + r1 + r2 * from_pole / from_zero) * at.c[k] + r1 * from_pole * at.d[k] +
                                  r2 * (1 - from_pole / from_zero) * arc->at_origin.c[k]);
    }
}

/* s_on: the point's coordinate if it lies on the arc. */
static void evaluate_arc_moments(const Arc *arc, cplx point, int on, double s_on, ArcMoments *m)
{
    for (int k = 0; k <= arc->order; k++) m->l[k] = arc->jacobian * ((k % 2) ? 0.0 : 2.0 / (k + 1));
    close_near_arc(arc, point - arc->center, on, s_on, m);
}

#endif
