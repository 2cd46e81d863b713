/* Circular arcs: where they lie, and their integrals in closed form; away from them fill_curves.h takes Gauss points.
 *
 * With the centre as origin, an arc of half-angle theta about the direction a is the image of s in [-1, 1] under
 *
 *     zeta = R a (1 + i q s)/(1 - i q s),   q = tan(theta/2),
 *
 * a Moebius map: zeta = z at s = w, zeta = infinity at s = -i/q, zeta = 0 at s = i/q. Every kernel is rational in zeta
 * and conj(zeta) = R^2/zeta, so that partial fractions in s bring all integrals back to the moments c, d, e of the
 * straight element at w and at the two fixed poles. Displacements are polynomials (or tip shapes) of s; tractions times
 * d(arc length)/ds are polynomials of s.
 */
#ifndef PBEM_ARCS_H
#define PBEM_ARCS_H
#include "curves.h"

typedef struct {
    Curve curve;
    cplx center, apex; /* apex = R a, the middle of the arc from the centre */
    double q, radius;
    cplx infinity, origin; /* the poles -i/q and i/q */
    Moments at_infinity, at_origin;
} Arc;

_Static_assert(sizeof(Arc) <= sizeof(AnyCurve), "MOST_CURVE_BYTES is too small");

static const double ARC_LARGEST = 3.1416; /* sweep of an element, radians: a half circle and its rounding */
/* Sweep of a panel at most. All points near the centre, or opposite to the arc, where its closed form has poles, are then
 * beyond the least distance. */
static const double PANEL_SWEEP = 0.65;

/* (theory, 17, 18) */
static void prepare_arc(AnyCurve *element, const Rows *r, int64_t j)
{
    Arc *arc = (Arc *)element;
    Curve *curve = &arc->curve;
    const double sweep = r->sweep[j];
    const int panels = (int)ceil(fabs(sweep) / PANEL_SWEEP);
    arc->center = r->center[j];
    arc->radius = cabs(r->start[j] - arc->center);
    arc->apex = (r->start[j] - arc->center) * cexp(0.5 * I * sweep);
    arc->q = tan(0.25 * sweep);
    arc->infinity = -I / arc->q;
    arc->origin = I / arc->q;
    curve->family = r->family[j];
    curve->panels = panels < MOST_PANELS ? panels : MOST_PANELS;
    curve->turn = fabs(sweep) / curve->panels;
    curve->reach = 2 * arc->radius * sin(0.25 * curve->turn);
    curve->jacobian = 2 * arc->radius * fabs(arc->q);
    for (int p = 0; p < curve->panels; p++) {
        const double turn = sweep * ((p + 0.5) / curve->panels - 0.5);
        curve->middle[p] = arc->center + arc->apex * (curve->panels > 1 ? cexp(I * turn) : 1);
    }
    for (int k = 0; k <= r->order; k++) curve->node_weight[k] = 1 / (1 + arc->q * arc->q * r->local[k] * r->local[k]);
}

/* (1 + i q s)/(1 - i q s) and 1/(1 + q^2 s^2) */
INLINE Complex turn_to(const Arc *arc, Lanes s, Lanes *inverse)
{
    const Lanes qs = arc->q * s;
    *inverse = 1 / (1 + qs * qs);
    return c_make((1 - qs * qs) * *inverse, 2 * qs * *inverse);
}

/* (theory, 17) */
static void trace_arc(const AnyCurve *element, Lanes s, Complex *place, Complex *tangent, Lanes *stretch)
{
    const Arc *arc = (const Arc *)element;
    Lanes inverse;
    const Complex radial = c_mul(c_spread(arc->apex), turn_to(arc, s, &inverse));
    *place = c_add(c_spread(arc->center), radial);
    *tangent = c_scale((arc->q > 0 ? 1 : -1) / arc->radius, c_times_i(radial));
    *stretch = arc->curve.jacobian * inverse;
}

/* The moments at the poles, which only the closed form needs. */
static void prepare_poles(AnyCurve *element, int order)
{
    Arc *arc = (Arc *)element;
    evaluate_family_moments(arc->infinity, 0, order, arc->curve.family, &arc->at_infinity);
    evaluate_family_moments(arc->origin, 0, order, arc->curve.family, &arc->at_origin);
}

/* (theory, 30 to 32) */
static void close_near_arc(const AnyCurve *element, const Rows *r, cplx point, int on, double s_on, PairMoments *m)
{
    const Arc *arc = (const Arc *)element;
    const double R = arc->radius, q = arc->q, J = arc->curve.jacobian;
    const cplx a = arc->apex, z = point - arc->center;
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
    evaluate_family_moments(w, on, r->order, arc->curve.family, &at);
    for (int k = 0; k <= r->order; k++) {
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
        if (arc->curve.family != BOUNDARY) continue;
        const double l = at.l[k];
        m->n[k] = J * (l * (log_B - r->log_length) + at.n[k] - arc->at_infinity.n[k]);
        m->s[k] = J * rho * (l + r1 * at.c[k] + r2 * arc->at_origin.c[k]);
        m->x[k] = -J / B * (l + from_pole * at.c[k]);
        m->y[k] = -J * rho / B * (l + (from_pole + r1 + r2 * from_pole / from_zero) * at.c[k] + r1 * from_pole * at.d[k] +
                                  r2 * (1 - from_pole / from_zero) * arc->at_origin.c[k]);
    }
}

static const CurveKind ARCS = {prepare_arc, trace_arc, prepare_poles, close_near_arc};

#endif
