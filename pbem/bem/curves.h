/* What the kinds of curved elements have in common, and the functions that each of them gives.
 *
 * With r = zeta - z from the collocation point z to the point zeta of the element, unit tangent e there and
 * y = Im(conj(r) e), the moments of a density N of displacements, and of one of tractions, are the integrals
 *
 *     c = int N e/r ds,     q = int N 2 i y/r^2 ds,     d = int N e/r^2 ds = dc/dz,
 *     dq = int N (conj(e) + 4 i y/r)/r^2 ds = dq/dz at fixed conj z,
 *     n = int N ln|r/L| ds,   s = int N conj(r)/r ds,   x = int N/r ds,   y = int N conj(r)/r^2 ds.
 *
 * c, q, n, s make the displacement (theory, 9, 10), d, dq, x, y the traction (theory, 11, 12).
 */
#ifndef PBEM_CURVES_H
#define PBEM_CURVES_H
#include "rows.h"

/* In lanes, by node; and those of one pair, by power. */
typedef struct {
    Complex c[MAX_SHAPES], q[MAX_SHAPES], d[MAX_SHAPES], dq[MAX_SHAPES];
    Complex s[MAX_SHAPES], x[MAX_SHAPES], y[MAX_SHAPES];
    Lanes n[MAX_SHAPES];
} CurveMoments;

typedef struct {
    cplx c[MAX_SHAPES], q[MAX_SHAPES], d[MAX_SHAPES], dq[MAX_SHAPES];
    cplx s[MAX_SHAPES], x[MAX_SHAPES], y[MAX_SHAPES];
    double n[MAX_SHAPES];
} PairMoments;

#define MOST_PANELS 5 /* of an element's Gauss points */

/* An element: what the rules need of it. A kind has this as the first member of its own struct. */
typedef struct {
    int family, panels;
    double turn;                    /* angle by which a panel turns at most */
    double reach;                   /* half the chord of half a panel */
    cplx middle[MOST_PANELS];       /* of the panels */
    double jacobian;                /* unit of |dzeta/ds|: of moments for tractions */
    double node_weight[MAX_SHAPES]; /* |dzeta/ds| at the nodes in that unit: nodal tractions to coefficients */
} Curve;

#define MOST_CURVE_BYTES 4096

typedef union {
    Curve curve;
    double bytes[MOST_CURVE_BYTES / sizeof(double)];
} AnyCurve;

/* The functions of a kind of curved elements: its header ends with one of these. */
typedef struct CurveKind {
    /* Take over the element j. */
    void (*prepare)(AnyCurve *, const Rows *, int64_t j);
    /* Place, unit tangent and stretch |dzeta/ds| at coordinates s. */
    void (*trace)(const AnyCurve *, Lanes s, Complex *place, Complex *tangent, Lanes *stretch);
    /* What the next one needs that is the same for all points; called before it when a point is near. */
    void (*prepare_near)(AnyCurve *, int order);
    /* Moments of powers in closed form at a point; on: it lies on the element, at the coordinate s. */
    void (*integrate)(const AnyCurve *, const Rows *, cplx point, int on, double s, PairMoments *);
} CurveKind;

#endif
