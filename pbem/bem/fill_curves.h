/* Rows of curved elements: by Gauss points, exact to rounding, away from them, otherwise by the closed forms of their
 * kind; several collocation points at a time. The integrals are those of curves.h.
 */
#ifndef PBEM_FILL_CURVES_H
#define PBEM_FILL_CURVES_H
#include <stdlib.h>

#include "combine.h"
#include "rules.h"

INLINE void add_weighted(int shapes, const double (*weight)[MOST_POINTS], int g, Complex value, Complex *sum)
{
#pragma GCC unroll 4
    for (int j = 0; j < shapes; j++) sum[j] = c_add(sum[j], c_scale(weight[j][g], value));
}

/* Moments of nodal shapes at some points (theory, 9 to 12, 34). */
INLINE void sum_rule(Variant v, const Rule *rule, double log_length, Complex z, CurveMoments *m)
{
    const int shapes = v.order + 1;
    const Complex zero = c_real(spread(0));
#pragma GCC unroll 4
    for (int j = 0; j < shapes; j++) {
        m->c[j] = m->q[j] = m->d[j] = m->dq[j] = m->s[j] = m->x[j] = m->y[j] = zero;
        m->n[j] = zero.re;
    }
    for (int g = 0; g < rule->points; g++) {
        const Complex e = c_make(rule->ex[g], rule->ey[g]), r = c_sub(c_make(rule->x[g], rule->y[g]), z);
        const Complex inverse = c_inverse(r), square = c_square(inverse); /* 1/r, 1/r^2 */
        const Lanes y = c_mul_conj(e, r).im;
        if (v.equation == TRACTION_EQUATION) {
            add_weighted(shapes, rule->H, g, c_mul(e, square), m->d);
            const Complex turned = c_add(c_conj(e), c_times_i(c_scale(4 * y, inverse)));
            add_weighted(shapes, rule->H, g, c_mul(turned, square), m->dq);
            if (!v.tractions) continue;
            add_weighted(shapes, rule->G, g, inverse, m->x);
            add_weighted(shapes, rule->G, g, c_mul_conj(square, r), m->y);
        } else {
            const Complex c = c_mul(e, inverse);
            add_weighted(shapes, rule->H, g, c, m->c);
            add_weighted(shapes, rule->H, g, c_times_i(c_scale(2 * y, square)), m->q);
            if (!v.tractions) continue;
            add_weighted(shapes, rule->G, g, c_mul_conj(inverse, r), m->s);
#pragma GCC unroll 4
            for (int j = 0; j < shapes; j++) m->n[j] -= rule->N[j][g] * c.re;
        }
    }
    if (!has_logarithm(v)) return;
    /* n by parts: the shapes' integrals times ln|r| at the ends, less their integral with its derivative, Re c */
    Lanes logs[FUNCTION_BATCH / LANES];
    for (int i = 0; i < FUNCTION_BATCH / LANES; i++)
        logs[i] = i < 2 ? c_norm(c_sub(c_spread(rule->end[i]), z)) : spread(1);
    take_batch_of_logarithms((double *)logs);
    for (int end = 0; end < 2; end++) {
        const Lanes value = 0.5 * logs[end] - log_length;
#pragma GCC unroll 4
        for (int j = 0; j < shapes; j++) m->n[j] += (end ? 1 : -1) * rule->end_N[end][j] * value;
    }
}

/* The listed points against the element j by a rule. */
INLINE void fill_far_points(Variant v, const Rows *r, const Rule *rule, int64_t j, const int64_t *point, int count)
{
    for (int p = 0; p < count; p += LANES) {
        Pairs pairs = no_pairs(v, r);
        CurveMoments m;
        for (int lane = 0; lane < LANES; lane++)
            put_pair(v, r, point[p + lane < count ? p + lane : count - 1], j, lane, &pairs);
        sum_rule(v, rule, r->log_length, pairs.z, &m);
        store_curve(v, r, &m, &pairs);
    }
}

static void put_moments(const PairMoments *from, int order, int lane, CurveMoments *to)
{
    for (int k = 0; k <= order; k++) {
        c_put(&to->c[k], lane, from->c[k]);
        c_put(&to->q[k], lane, from->q[k]);
        c_put(&to->d[k], lane, from->d[k]);
        c_put(&to->dq[k], lane, from->dq[k]);
        c_put(&to->s[k], lane, from->s[k]);
        c_put(&to->x[k], lane, from->x[k]);
        c_put(&to->y[k], lane, from->y[k]);
        to->n[k][lane] = from->n[k];
    }
}

/* From powers to nodes; of_tractions: shapes of the tractions' densities. */
INLINE void shape_curve(Variant v, const double *of_displacements, const double *of_tractions, CurveMoments *m)
{
    const int shapes = v.order + 1, traction = v.equation == TRACTION_EQUATION;
    shape_complex(shapes, of_displacements, traction ? m->d : m->c);
    shape_complex(shapes, of_displacements, traction ? m->dq : m->q);
    if (!v.tractions) return;
    if (!traction) shape_real(shapes, of_tractions, m->n);
    shape_complex(shapes, of_tractions, traction ? m->x : m->s);
    if (traction) shape_complex(shapes, of_tractions, m->y);
}

/* The listed points against the element j by the closed form. */
INLINE void fill_near_points(Variant v, const Rows *r, const Elements *of, const CurveKind *kind, AnyCurve *element,
                             int64_t j, const int64_t *point, int count)
{
    const int shapes = v.order + 1;
    double of_tractions[MAX_SHAPES * MAX_SHAPES];
    for (int k = 0; k < shapes * shapes; k++) of_tractions[k] = of->shape[k] * element->curve.node_weight[k % shapes];
    kind->prepare_near(element, v.order);
    for (int p = 0; p < count; p += LANES) {
        Pairs pairs = no_pairs(v, r);
        CurveMoments m;
        PairMoments one = {0};
        for (int lane = 0; lane < LANES; lane++) {
            const int64_t i = point[p + lane < count ? p + lane : count - 1];
            if (p + lane < count) kind->integrate(element, r, r->point[i], r->on[i] == j, r->on_local[i], &one);
            put_moments(&one, v.order, lane, &m);
            put_pair(v, r, i, j, lane, &pairs);
        }
        shape_curve(v, of->shape, of_tractions, &m);
        store_curve(v, r, &m, &pairs);
    }
}

/* Points sorted by the rule that they need; the last list holds those near the element. */
#define MOST_SORTED 256

typedef struct {
    int count[LEVELS + 1];
    int64_t point[LEVELS + 1][MOST_SORTED];
} SortedPoints;

static void sort_points(const Rows *r, const Curve *curve, int64_t j, Py_ssize_t first, SortedPoints *to)
{
    const Py_ssize_t last = first + MOST_SORTED < r->points ? first + MOST_SORTED : r->points;
    double distance2[LEVELS];
    list_distances(curve, distance2);
    memset(to->count, 0, sizeof to->count);
    for (Py_ssize_t i = first; i < last; i++) {
        const int level = r->on[i] == j ? LEVELS : choose_level(curve, distance2, r->point[i]);
        to->point[level][to->count[level]++] = i;
    }
}

typedef struct {
    AnyCurve element;
    SortedPoints sorted;
    Rules rules;
} CurveRoom;

/* All points against curved elements. Returns 0 if memory is short. */
INLINE int fill_curves(Variant v, const Rows *r, const Elements *of)
{
    CurveRoom *room = malloc(sizeof(CurveRoom));
    if (!room) return 0;
    for (int level = 0; level < LEVELS; level++) room->rules.reference[level].panels = 0;
    for (Py_ssize_t at = 0; at < of->count; at++) {
        const int64_t j = of->index[at];
        of->curve->prepare(&room->element, r, j);
        memset(room->rules.ready, 0, sizeof room->rules.ready);
        for (Py_ssize_t first = 0; first < r->points; first += MOST_SORTED) {
            const SortedPoints *sorted = &room->sorted;
            sort_points(r, &room->element.curve, j, first, &room->sorted);
            for (int level = 0; level < LEVELS; level++)
                if (sorted->count[level])
                    fill_far_points(v, r, use_rule(&room->rules, of->curve, &room->element, v.order, of, level), j,
                                    sorted->point[level], sorted->count[level]);
            if (sorted->count[LEVELS])
                fill_near_points(v, r, of, of->curve, &room->element, j, sorted->point[LEVELS], sorted->count[LEVELS]);
        }
    }
    free(room);
    return 1;
}

#endif
