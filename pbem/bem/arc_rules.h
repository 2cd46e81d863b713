/* Gauss points on circular arcs: how many by distance, where they lie, and with which weights of the nodes.
 *
 * On a tip element the root of the distance from the tip is the variable: densities are odd polynomials of it, so that
 * the positive half of a rule for [-1, 1] has the accuracy of the whole.
 */
#ifndef PBEM_ARC_RULES_H
#define PBEM_ARC_RULES_H
#include "arcs.h"
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

#endif
