/* Circular arcs away from the point: Gauss points that are exact to rounding, several collocation points at a time.
 *
 * With r = zeta - z from the collocation point to the point zeta of the arc, unit tangent e there and y = Im(conj(r) e),
 * the integrands of arcs.h are, by arc length (c, d, q, dq) and times conj(zeta - z) and so on (x, s, y, n)
 *
 *     c = e/r,   d = e/r^2,   q = 2 i y/r^2,   dq = (conj(e) + 4 i y/r)/r^2,
 *     x = 1/r,   s = conj(r)/r,   dx/dz part y = conj(r)/r^2,   n = ln|r|.
 *
 * On a tip element the root of the distance from the tip is the variable: densities are odd polynomials of it, so that
 * the positive half of a rule for [-1, 1] has the accuracy of the whole.
 */
#ifndef PBEM_FAR_ARCS_H
#define PBEM_FAR_ARCS_H
#include "kinds.h"

#define LEVELS 6
#define MOST_GAUSS 20
#define MOST_PANELS 5 /* of half a circle; a tip element of several panels has twice as many in the root */
#define MOST_ARC_POINTS (2 * MOST_PANELS * MOST_GAUSS)

/* Gauss points of a panel, and the distance from its middle, in chords of half the panel, beyond which their error is
 * below 2e-15 of the integral of order 3 (measured, all directions); by the sweep of the panel. */
static const int LEVEL_POINTS[LEVELS] = {7, 8, 10, 12, 16, MOST_GAUSS};
#define SWEEP_CLASSES 4
static const double CLASS_SWEEP[SWEEP_CLASSES] = {0.1, 0.2, 0.4, 0.8};
static const double LEVEL_DISTANCE[SWEEP_CLASSES][LEVELS] = {{30, 15, 6, 3.5, 2.5, 2},
                                                             {70, 20, 8, 4, 2.5, 2},
                                                             {1e300, 70, 10, 5, 2.5, 2},
                                                             {1e300, 1e300, 40, 8, 3, 2}};
/* Sweep of a panel at most. All points near the centre, or opposite to the arc, where its closed form has poles, are then
 * beyond the least distance. */
static const double PANEL_SWEEP = 0.65;

/* Gauss points and weights on [-1, 1] by level, and the positive half of those with twice as many. */
static double gauss_node[2][LEVELS][MOST_GAUSS], gauss_weight[2][LEVELS][MOST_GAUSS];

static void prepare_gauss_rule(int count, int from, double *node, double *weight)
{
    for (int i = from; i < count; i++) {
        long double x = -cosl((i + 0.75L) * acosl(-1) / (count + 0.5L)), slope = 1;
        for (int step = 0; step < 8; step++) {
            long double below = 1, p = x;
            for (int k = 1; k < count; k++) {
                const long double next = ((2 * k + 1) * x * p - k * below) / (k + 1);
                below = p;
                p = next;
            }
            slope = count * (x * p - below) / (x * x - 1);
            x -= p / slope;
        }
        node[i - from] = (double)x;
        weight[i - from] = (double)(2 / ((1 - x * x) * slope * slope));
    }
}

static void prepare_gauss(void)
{
    for (int level = 0; level < LEVELS; level++) {
        const int n = LEVEL_POINTS[level];
        prepare_gauss_rule(n, 0, gauss_node[0][level], gauss_weight[0][level]);
        prepare_gauss_rule(2 * n, n, gauss_node[1][level], gauss_weight[1][level]);
    }
}

/* Points on an arc: place, unit tangent, weights of its nodes' displacements and tractions, of the latter's integrals from
 * the middle; ends of the arc and the integrals there. */
typedef struct {
    int points;
    double x[MOST_ARC_POINTS], y[MOST_ARC_POINTS], ex[MOST_ARC_POINTS], ey[MOST_ARC_POINTS];
    double H[MAX_SHAPES][MOST_ARC_POINTS], G[MAX_SHAPES][MOST_ARC_POINTS], N[MAX_SHAPES][MOST_ARC_POINTS];
    double end_x[2], end_y[2], end_N[2][MAX_SHAPES];
} ArcRule;

/* What a rule has in common with those of other arcs: coordinates, weights times the shapes and times their integrals
 * from the middle. */
typedef struct {
    int points, family, panels;
    double s[MOST_ARC_POINTS], weight[MAX_SHAPES][MOST_ARC_POINTS], integral[MAX_SHAPES][MOST_ARC_POINTS];
    double end[2][MAX_SHAPES];
} ReferenceRule;

/* An element's rules, made when they are first needed, and where the points stand: panels and their middles. */
typedef struct {
    int panels, class, ready[LEVELS];
    double reach;
    cplx middle[MOST_PANELS];
    ArcRule rule[LEVELS];
    ReferenceRule reference[LEVELS]; /* of the last element that needed them */
} FarArc;

static void prepare_far_arc(FarArc *far, const Arc *arc, double sweep)
{
    far->panels = (int)ceil(fabs(sweep) / PANEL_SWEEP);
    if (far->panels > MOST_PANELS) far->panels = MOST_PANELS;
    const double part = fabs(sweep) / far->panels;
    for (far->class = 0; far->class < SWEEP_CLASSES - 1 && part > CLASS_SWEEP[far->class];) far->class++;
    far->reach = 2 * arc->radius * sin(0.25 * part);
    memset(far->ready, 0, sizeof far->ready);
    for (int p = 0; p < far->panels; p++) {
        const double turn = sweep * ((p + 0.5) / far->panels - 0.5);
        far->middle[p] = arc->center + arc->apex * (far->panels > 1 ? cexp(I * turn) : 1);
    }
}

/* Integral from 0 to s of the shape j with coefficients by power and node. */
static double integrate_shape(int shapes, const double *shape, int j, double s)
{
    double value = 0;
    for (int k = shapes - 1; k >= 0; k--) value = (value + shape[k * shapes + j] / (k + 1)) * s;
    return value;
}

/* shape: coefficients by power and node, powers being s^k or root^(2 k + 1). */
static void prepare_reference(ReferenceRule *to, int order, int family, int panels, int level, const double *shape)
{
    const int shapes = order + 1, tip = is_tip(family), half = tip && panels == 1, count = LEVEL_POINTS[level];
    const int parts = tip && !half ? 2 * panels : panels;
    to->points = parts * count;
    to->family = family;
    to->panels = panels;
    for (int g = 0; g < to->points; g++) {
        const double node = gauss_node[half][level][g % count], part = gauss_weight[half][level][g % count] / parts;
        const double x = half ? node : (g / count + 0.5 * (1 + node)) / parts; /* in [0, 1] */
        const double s = !tip ? 2 * x - 1 : family == TIP_AT_START ? 2 * x * x - 1 : 1 - 2 * x * x;
        const double power = tip ? x * x : s;
        to->s[g] = s;
        for (int j = 0; j < shapes; j++) {
            double value = shape[order * shapes + j];
            for (int k = order - 1; k >= 0; k--) value = value * power + shape[k * shapes + j];
            /* on a tip the density has one root more, and ds = 4 x dx */
            to->weight[j][g] = value * part * (tip ? (half ? 4 : 2) * x * x : 1);
            to->integral[j][g] = part * integrate_shape(shapes, shape, j, s);
        }
    }
    for (int j = 0; j < shapes; j++)
        for (int end = 0; end < 2; end++) to->end[end][j] = integrate_shape(shapes, shape, j, 2 * end - 1);
}

static const ArcRule *use_rule(FarArc *far, const Arc *arc, const double *shape, int level)
{
    ArcRule *rule = &far->rule[level];
    ReferenceRule *from = &far->reference[level];
    if (far->ready[level]) return rule;
    far->ready[level] = 1;
    if (from->points == 0 || from->family != arc->family || from->panels != far->panels)
        prepare_reference(from, arc->order, arc->family, far->panels, level, shape);
    const int points = rule->points = from->points;
    const double ax = creal(arc->apex), ay = cimag(arc->apex), cx = creal(arc->center), cy = cimag(arc->center);
    const double turn = (arc->q > 0 ? 1 : -1) / arc->radius;
    double stretch[MOST_ARC_POINTS];
    for (int g = 0; g < points; g++) {
        const double qs = arc->q * from->s[g], inverse = 1 / (1 + qs * qs);
        const double cosine = (1 - qs * qs) * inverse, sine = 2 * qs * inverse;
        const double dx = ax * cosine - ay * sine, dy = ax * sine + ay * cosine;
        stretch[g] = inverse;
        rule->x[g] = cx + dx;
        rule->y[g] = cy + dy;
        rule->ex[g] = -turn * dy;
        rule->ey[g] = turn * dx;
    }
    for (int j = 0; j <= arc->order; j++) {
        const double jacobian = arc->jacobian, by_node = jacobian * arc->node_weight[j];
        for (int g = 0; g < points; g++) {
            const double length = jacobian * stretch[g];
            rule->H[j][g] = length * from->weight[j][g];
            rule->G[j][g] = by_node * from->weight[j][g];
            rule->N[j][g] = by_node * length * from->integral[j][g];
        }
        for (int end = 0; end < 2; end++) rule->end_N[end][j] = by_node * from->end[end][j];
    }
    for (int end = 0; end < 2; end++) {
        const double qs = end ? arc->q : -arc->q, inverse = 1 / (1 + qs * qs);
        const double cosine = (1 - qs * qs) * inverse, sine = 2 * qs * inverse;
        rule->end_x[end] = cx + ax * cosine - ay * sine;
        rule->end_y[end] = cy + ax * sine + ay * cosine;
    }
    return rule;
}

/* The rule for a point; LEVELS if it is near. */
static int choose_level(const FarArc *far, cplx z)
{
    double least = INFINITY;
    for (int p = 0; p < far->panels; p++) {
        const double dx = creal(z) - creal(far->middle[p]), dy = cimag(z) - cimag(far->middle[p]);
        const double square = dx * dx + dy * dy;
        least = square < least ? square : least;
    }
    const double *distance = LEVEL_DISTANCE[far->class], reach2 = far->reach * far->reach;
    int level = 0;
    while (level < LEVELS && !(least > distance[level] * distance[level] * reach2)) level++;
    /* the root's panels do not resolve more than this */
    return level < LEVELS && far->panels > 1 ? LEVELS - 1 : level;
}

/* Rows of some points on the element of a rule. */
INLINE void sum_rule(int order, int tractions, int stress, const Rows *r, const ArcRule *rule, Lanes zx, Lanes zy,
                     Lanes Nx, Lanes Ny, double *const *H, double *const *G)
{
    const int shapes = order + 1, logarithm = tractions && !stress;
    const int64_t width = 2 * r->elements * shapes;
    const Lanes zero = spread(0);
    Lanes logs[FUNCTION_BATCH / LANES], a[4][MAX_SHAPES], b[4][MAX_SHAPES];
#pragma GCC unroll 4
    for (int j = 0; j < shapes; j++)
#pragma GCC unroll 4
        for (int part = 0; part < 4; part++) a[part][j] = b[part][j] = zero;
    for (int g = 0; g < rule->points; g++) {
        const Lanes rx = rule->x[g] - zx, ry = rule->y[g] - zy, inverse = 1 / (rx * rx + ry * ry);
        const Lanes vr = rx * inverse, vi = -ry * inverse, v2r = vr * vr - vi * vi, v2i = 2 * vr * vi; /* 1/r, 1/r^2 */
        const double ex = rule->ex[g], ey = rule->ey[g];
        const Lanes y = ey * rx - ex * ry;
        Lanes h[4], t[4];
        if (stress) {
            const Lanes dr = ex - 4 * y * vi, di = 4 * y * vr - ey;
            h[0] = MULTIPLY_REAL(ex, ey, v2r, v2i);
            h[1] = MULTIPLY_IMAGINARY(ex, ey, v2r, v2i);
            h[2] = MULTIPLY_REAL(dr, di, v2r, v2i);
            h[3] = MULTIPLY_IMAGINARY(dr, di, v2r, v2i);
            t[0] = vr;
            t[1] = vi;
            t[2] = rx * v2r + ry * v2i;
            t[3] = rx * v2i - ry * v2r;
        } else {
            h[0] = MULTIPLY_REAL(ex, ey, vr, vi);
            h[1] = MULTIPLY_IMAGINARY(ex, ey, vr, vi);
            h[2] = y * v2r;
            h[3] = y * v2i;
            t[0] = h[0];
            t[1] = zero;
            t[2] = rx * vr + ry * vi;
            t[3] = rx * vi - ry * vr;
        }
#pragma GCC unroll 4
        for (int j = 0; j < shapes; j++)
#pragma GCC unroll 4
            for (int part = 0; part < 4; part++) {
                a[part][j] += rule->H[j][g] * h[part];
                if (tractions && (stress || part > 1))
                    b[part][j] += rule->G[j][g] * t[part];
                else if (tractions && part == 0)
                    b[part][j] -= rule->N[j][g] * t[part];
            }
    }
    if (logarithm) {
        /* n by parts: the shapes' integrals times ln|r| at the ends, less their integral with its derivative, Re c */
        for (int end = 0; end < 2; end++) {
            const Lanes rx = rule->end_x[end] - zx, ry = rule->end_y[end] - zy;
            logs[end] = rx * rx + ry * ry;
        }
        for (int i = 2; i < FUNCTION_BATCH / LANES; i++) logs[i] = spread(1);
        take_batch_of_logarithms((double *)logs);
        for (int end = 0; end < 2; end++) {
            const Lanes value = (end ? 0.5 : -0.5) * logs[end] - (end ? 1 : -1) * r->log_length;
#pragma GCC unroll 4
            for (int j = 0; j < shapes; j++) b[0][j] += rule->end_N[end][j] * value;
        }
    }
    Blocks hb, gb;
    const double kappa = r->kappa, fu = 1 / (2 * M_PI * (kappa + 1)), g = r->shear_modulus / (M_PI * (kappa + 1));
    const double ft = 1 / (4 * M_PI * r->shear_modulus * (kappa + 1));
#pragma GCC unroll 4
    for (int j = 0; j < shapes; j++) {
        const Lanes *A[4] = {a[0] + j, a[1] + j, a[2] + j, a[3] + j}, *B[4] = {b[0] + j, b[1] + j, b[2] + j, b[3] + j};
        if (stress) {
            /* P = 2 g Im(d N), Q = g i (conj(d) N + conj(dq N)) */
            put_symmetric(&hb, j, 2 * g * MULTIPLY_IMAGINARY(*A[0], *A[1], Nx, Ny),
                          g * (*A[1] * Nx - *A[0] * Ny + MULTIPLY_IMAGINARY(*A[2], *A[3], Nx, Ny)),
                          g * (*A[0] * Nx + *A[1] * Ny + MULTIPLY_REAL(*A[2], *A[3], Nx, Ny)));
            /* P = fu (x N + kappa conj(x N)), Q = fu (conj(x) N + conj(y N)) */
            if (tractions)
                put_lanes(&gb, j, fu * (1 + kappa) * MULTIPLY_REAL(*B[0], *B[1], Nx, Ny),
                          fu * (1 - kappa) * MULTIPLY_IMAGINARY(*B[0], *B[1], Nx, Ny),
                          fu * (*B[0] * Nx + *B[1] * Ny + MULTIPLY_REAL(*B[2], *B[3], Nx, Ny)),
                          fu * (*B[0] * Ny - *B[1] * Nx - MULTIPLY_IMAGINARY(*B[2], *B[3], Nx, Ny)));
        } else {
            put_lanes(&hb, j, fu * (kappa + 1) * *A[1], fu * (1 - kappa) * *A[0], 2 * fu * *A[2], -2 * fu * *A[3]);
            if (tractions)
                put_symmetric(&gb, j, -2 * kappa * ft * *B[0], ft * *B[2], -ft * *B[3]);
        }
    }
    store_row(shapes, hb.xx, hb.xy, H, 0);
    store_row(shapes, hb.yx, hb.yy, H, width);
    if (!tractions) return;
    store_row(shapes, gb.xx, gb.xy, G, 0);
    store_row(shapes, gb.yx, gb.yy, G, width);
}

/* Points sorted by the rule that they need; the last list holds those near the arc. */
#define MOST_SORTED 256

typedef struct {
    int count[LEVELS + 1];
    int64_t point[LEVELS + 1][MOST_SORTED];
} SortedPoints;

static void sort_points(const Rows *r, const FarArc *far, Py_ssize_t j, Py_ssize_t first, Py_ssize_t last, SortedPoints *to)
{
    memset(to->count, 0, sizeof to->count);
    for (Py_ssize_t i = first; i < last; i++) {
        const int level = r->on[i] == j ? LEVELS : choose_level(far, r->point[i]);
        to->point[level][to->count[level]++] = i;
    }
}

/* The listed points against the element j of a rule. */
INLINE void fill_far_arc(int order, int tractions, int stress, const Rows *r, const ArcRule *rule, Py_ssize_t j,
                         const int64_t *point, int count)
{
    for (int p = 0; p < count; p += LANES) {
        Lanes zx = spread(0), zy = zx, Nx = zx, Ny = zx;
        double *H[LANES], *G[LANES];
        for (int lane = 0; lane < LANES; lane++) {
            const int64_t i = point[p + lane < count ? p + lane : count - 1];
            zx[lane] = creal(r->point[i]);
            zy[lane] = cimag(r->point[i]);
            Nx[lane] = stress ? creal(r->normal[i]) : 0;
            Ny[lane] = stress ? cimag(r->normal[i]) : 0;
            H[lane] = locate_block(r, r->displacement, i, j);
            G[lane] = locate_block(r, r->traction, i, j);
        }
        sum_rule(order, tractions, stress, r, rule, zx, zy, Nx, Ny, H, G);
    }
}

static void fill_listed(const Rows *r, const ArcRule *rule, Py_ssize_t j, const int64_t *point, int count)
{
#define ARC_STRESS_BOTH(order) fill_far_arc(order, 1, 1, r, rule, j, point, count)
#define ARC_STRESS_ONE(order) fill_far_arc(order, 0, 1, r, rule, j, point, count)
#define ARC_BOTH(order) fill_far_arc(order, 1, 0, r, rule, j, point, count)
#define ARC_ONE(order) fill_far_arc(order, 0, 0, r, rule, j, point, count)
    const int tractions = r->traction && r->family[j] == BOUNDARY;
    if (r->normal && tractions)
        DISPATCH(r->order, ARC_STRESS_BOTH)
    else if (r->normal)
        DISPATCH(r->order, ARC_STRESS_ONE)
    else if (tractions)
        DISPATCH(r->order, ARC_BOTH)
    else
        DISPATCH(r->order, ARC_ONE)
}

#endif
