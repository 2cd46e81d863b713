/* Gauss points on curved elements: how many by distance, where they lie, and with which weights of the nodes.
 *
 * On a tip element the root of the distance from the tip is the variable: densities are odd polynomials of it, so that
 * the positive half of a rule for [-1, 1] has the accuracy of the whole.
 */
#ifndef PBEM_RULES_H
#define PBEM_RULES_H
#include "curves.h"

#define LEVELS 6
#define MOST_GAUSS 20
/* A tip element of several panels has twice as many in the root. */
#define MOST_POINTS (2 * MOST_PANELS * MOST_GAUSS)

/* Gauss points of a panel, and the distance from its middle, in chords of half the panel, beyond which their error is
 * below 2e-15 of the integral of order 3 (measured on arcs, all directions); by the angle by which the panel turns. */
static const int LEVEL_POINTS[LEVELS] = {7, 8, 10, 12, 16, MOST_GAUSS};
#define TURN_CLASSES 4
static const double CLASS_TURN[TURN_CLASSES] = {0.1, 0.2, 0.4, 0.8};
static const double LEVEL_DISTANCE[TURN_CLASSES][LEVELS] = {{30, 15, 6, 3.5, 2.5, 2},
                                                             {70, 20, 8, 4, 2.5, 2},
                                                             {1e300, 70, 10, 5, 2.5, 2},
                                                             {1e300, 1e300, 40, 8, 3, 2}};
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

/* Points on an element: place, unit tangent, weights of its nodes' displacements and tractions, of the latter's integrals
 * from the middle; ends of the element and the integrals there. */
typedef struct {
    int points;
    double x[MOST_POINTS], y[MOST_POINTS], ex[MOST_POINTS], ey[MOST_POINTS];
    double H[MAX_SHAPES][MOST_POINTS], G[MAX_SHAPES][MOST_POINTS], N[MAX_SHAPES][MOST_POINTS];
    cplx end[2];
    double end_N[2][MAX_SHAPES];
} Rule;

/* What a rule has in common with those of other elements: coordinates, weights times the shapes and times their
 * integrals from the middle. */
typedef struct {
    int points, panels;
    double s[MOST_POINTS], weight[MAX_SHAPES][MOST_POINTS], integral[MAX_SHAPES][MOST_POINTS];
    double end[2][MAX_SHAPES];
} ReferenceRule;

/* An element's rules, made when they are first needed. */
typedef struct {
    int ready[LEVELS];
    Rule rule[LEVELS];
    ReferenceRule reference[LEVELS]; /* of the last element that needed them */
} Rules;

/* Integral from 0 to s of the shape j with coefficients by power and node. */
static double integrate_shape(int shapes, const double *shape, int j, double s)
{
    double value = 0;
    for (int k = shapes - 1; k >= 0; k--) value = (value + shape[k * shapes + j] / (k + 1)) * s;
    return value;
}

/* Powers are s^k or root^(2 k + 1). */
static void prepare_reference(ReferenceRule *to, int order, const Elements *of, int panels, int level)
{
    const int shapes = order + 1, tip = is_tip(of->family), half = tip && panels == 1, count = LEVEL_POINTS[level];
    const int parts = tip && !half ? 2 * panels : panels;
    const double *shape = of->shape, inward = point_inward(of->family);
    memset(to, 0, sizeof *to);
    to->points = parts * count;
    to->panels = panels;
    for (int g = 0; g < to->points; g++) {
        const double node = gauss_node[half][level][g % count], part = gauss_weight[half][level][g % count] / parts;
        const double x = half ? node : (g / count + 0.5 * (1 + node)) / parts; /* in [0, 1] */
        const double s = tip ? inward * (2 * x * x - 1) : 2 * x - 1;
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

static const Rule *use_rule(Rules *rules, const CurveKind *kind, const AnyCurve *element, int order, const Elements *of,
                            int level)
{
    const Curve *curve = &element->curve;
    Rule *rule = &rules->rule[level];
    ReferenceRule *from = &rules->reference[level];
    if (rules->ready[level]) return rule;
    rules->ready[level] = 1;
    if (from->panels != curve->panels) prepare_reference(from, order, of, curve->panels, level);
    const int points = rule->points = from->points;
    double stretch[MOST_POINTS];
    Complex place, tangent;
    Lanes s, length;
    for (int g = 0; g < points; g += LANES) {
        memcpy(&s, from->s + g, sizeof s);
        kind->trace(element, s, &place, &tangent, &length);
        memcpy(rule->x + g, &place.re, sizeof s);
        memcpy(rule->y + g, &place.im, sizeof s);
        memcpy(rule->ex + g, &tangent.re, sizeof s);
        memcpy(rule->ey + g, &tangent.im, sizeof s);
        memcpy(stretch + g, &length, sizeof s);
    }
    for (int j = 0; j <= order; j++) {
        const double by_node = curve->jacobian * curve->node_weight[j];
        for (int g = 0; g < points; g++) {
            rule->H[j][g] = stretch[g] * from->weight[j][g];
            rule->G[j][g] = by_node * from->weight[j][g];
            rule->N[j][g] = by_node * stretch[g] * from->integral[j][g];
        }
        for (int end = 0; end < 2; end++) rule->end_N[end][j] = by_node * from->end[end][j];
    }
    s = spread(1);
    s[0] = -1;
    kind->trace(element, s, &place, &tangent, &length);
    for (int end = 0; end < 2; end++) rule->end[end] = place.re[end] + I * place.im[end];
    return rule;
}

/* Distances of the levels, squared, for an element. */
static void list_distances(const Curve *curve, double *square)
{
    int class = 0;
    while (class < TURN_CLASSES - 1 && curve->turn > CLASS_TURN[class]) class++;
    for (int level = 0; level < LEVELS; level++)
        square[level] = LEVEL_DISTANCE[class][level] * LEVEL_DISTANCE[class][level] * curve->reach * curve->reach;
}

/* The rule for a point; LEVELS if it is near. */
static int choose_level(const Curve *curve, const double *distance2, cplx z)
{
    double least = INFINITY;
    for (int p = 0; p < curve->panels; p++) {
        const double dx = creal(z) - creal(curve->middle[p]), dy = cimag(z) - cimag(curve->middle[p]);
        const double square = dx * dx + dy * dy;
        least = square < least ? square : least;
    }
    int level = 0;
    while (level < LEVELS && !(least > distance2[level])) level++;
    /* the root's panels do not resolve more than this */
    return level < LEVELS && curve->panels > 1 ? LEVELS - 1 : level;
}

#endif
