/* The two ends of an expansion: from nodal values to a cluster's coefficients, from coefficients to values at points.
 *
 * Several integration points, or several points, are done at a time in the lanes of vectors.
 */
#ifndef PBEM_ENDS_H
#define PBEM_ENDS_H
#include "series.h"

/* Elements of a share of the clusters, in the order of these, with their integration points: `points` (a multiple of
 * LANES) of element e from `begin` on, place and slope (times weight) as parts, and shapes there from `shapes` on
 * (node by point); length: of the element per unit of s in its middle, times the point's weight is what a traction acts
 * on, of whose nodal values each is divided by crowd. number: of the element in the mesh. */
typedef struct {
    const int64_t *begin, *points, *shapes, *number;
    const int8_t *family;
    const double *x, *y, *dx, *dy, *weight, *shape, *length, *crowd;
    int nodes;
    int64_t all_nodes;
} Elements;

typedef struct {
    cplx center;
    double radius, kappa, shear_modulus;
} Circle;

typedef struct {
    Complex first, second, third;
} Sums;

/* What some points add: (first, second, third) z^k. */
typedef struct {
    Complex z, first, second, third;
} Added;

/* Vectors of points that are added at once: the sums are read and written once for all of them. */
#define TOGETHER 3
#define BATCH (4 * TOGETHER)

/* sums[k] += (first, second, third) z^k, k = 0 .. terms, of so many vectors of points */
INLINE void add_powers(Sums *sums, const Added *given, int vectors, int terms)
{
    Added at[TOGETHER];
#pragma GCC unroll 3
    for (int i = 0; i < vectors; i++) at[i] = given[i];
    for (int k = 0; k <= terms; k++) {
        Sums own = sums[k];
#pragma GCC unroll 3
        for (int i = 0; i < vectors; i++) {
            own.first = c_add(own.first, at[i].first);
            own.second = c_add(own.second, at[i].second);
            own.third = c_add(own.third, at[i].third);
            at[i].first = c_mul(at[i].first, at[i].z);
            at[i].second = c_mul(at[i].second, at[i].z);
            at[i].third = c_mul(at[i].third, at[i].z);
        }
        sums[k] = own;
    }
}

static void add_all_powers(Sums *sums, const Added *given, int64_t vectors, int terms)
{
    for (; vectors >= 3; vectors -= 3, given += 3) add_powers(sums, given, 3, terms);
    if (vectors == 2) add_powers(sums, given, 2, terms);
    if (vectors == 1) add_powers(sums, given, 1, terms);
}

INLINE Complex load_parts(const double *re, const double *im)
{
    Complex z;
    memcpy(&z.re, re, sizeof z.re);
    memcpy(&z.im, im, sizeof z.im);
    return z;
}

/* Nodal values times shapes at the points. */
INLINE Complex mix_nodes(const double *shape, int64_t stride, const double *value, int nodes)
{
    Complex sum = c_make(0, 0);
    for (int n = 0; n < nodes; n++) {
        Lanes much;
        memcpy(&much, shape + n * stride, sizeof much);
        sum.re += much * value[2 * n];
        sum.im += much * value[2 * n + 1];
    }
    return sum;
}

static cplx add_lanes(Complex z)
{
    double re = 0, im = 0;
    for (int lane = 0; lane < LANES; lane++) re += z.re[lane], im += z.im[lane];
    return re + I * im;
}

/* What one element's displacements, or jumps, add to the sums of a, b and c with (theory, 37, 38)
 * phi_k = a_(k-1), psi_k = b_(k-1) + (k - 1) c_(k-2). */
static void add_displacements(Sums *sums, const Elements *e, int64_t at, const double *value, Circle c, int terms)
{
    const double g = c.shear_modulus / (M_PI * (c.kappa + 1)), unit = 1 / c.radius;
    const int64_t count = e->points[at];
    Added added[BATCH];
    int vectors = 0;
    for (int64_t q = 0; q < count; q += LANES) {
        const int64_t from = e->begin[at] + q;
        const Complex z = c_scale(unit, c_sub(load_parts(e->x + from, e->y + from), c_spread(c.center)));
        const Complex slope = c_scale(unit * g, c_times_i(load_parts(e->dx + from, e->dy + from)));
        const Complex back = c_scale(unit * g, c_times_i(c_conj(load_parts(e->dx + from, e->dy + from))));
        const Complex density = mix_nodes(e->shape + e->shapes[at] + q, count, value, e->nodes);
        const Complex first = c_mul(slope, density);
        const Complex second = c_sub(c_mul(back, density), c_mul_conj(slope, density));
        added[vectors++] = (Added){z, first, second, c_mul_conj(first, z)};
        if (vectors == BATCH || q + LANES >= count) {
            add_all_powers(sums, added, vectors, terms - 1);
            vectors = 0;
        }
    }
}

/* Of tractions, polynomials by the crowding (theory, 18), to the sums of a, b and c with (theory, 37, 38) phi_0 = a_0, psi_0 = -kappa b_0, phi_k = -a_k/k,
 * psi_k = kappa b_k/k + c_(k-1). */
static void add_tractions(Sums *sums, const Elements *e, int64_t at, const double *value, Circle c, int terms)
{
    const double f = -1 / (2 * M_PI * (c.kappa + 1));
    const int64_t count = e->points[at];
    Added added[BATCH];
    int vectors = 0;
    double crowded[8];
    for (int n = 0; n < e->nodes; n++)
        for (int i = 0; i < 2; i++) crowded[2 * n + i] = value[2 * n + i] / e->crowd[at * e->nodes + n];
    for (int64_t q = 0; q < count; q += LANES) {
        const int64_t from = e->begin[at] + q;
        Lanes weight;
        memcpy(&weight, e->weight + e->shapes[at] / e->nodes + q, sizeof weight);
        const Complex z = c_scale(1 / c.radius, c_sub(load_parts(e->x + from, e->y + from), c_spread(c.center)));
        const Complex density = mix_nodes(e->shape + e->shapes[at] + q, count, crowded, e->nodes);
        const Complex first = c_scale(f * e->length[at] * weight, density);
        added[vectors++] = (Added){z, first, c_conj(first), c_neg(c_mul_conj(first, z))};
        if (vectors == BATCH || q + LANES >= count) {
            add_all_powers(sums, added, vectors, terms);
            vectors = 0;
        }
    }
}

/* Coefficients of a cluster's elements first .. last - 1 for v = (u, t) (theory, 35, 37, 38). */
static void sum_moments(const Elements *e, int64_t first, int64_t last, const double *v, Circle c, int terms, cplx *out)
{
    Sums moved[MOST_POWERS], pulled[MOST_POWERS];
    memset(moved, 0, (terms + 1) * sizeof *moved);
    memset(pulled, 0, (terms + 1) * sizeof *pulled);
    for (int64_t at = first; at < last; at++) {
        const int64_t node = e->number[at] * e->nodes;
        add_displacements(moved, e, at, v + 2 * node, c, terms);
        if (e->family[at] == 0) add_tractions(pulled, e, at, v + 2 * (e->all_nodes + node), c, terms);
    }
    cplx *phi = out, *psi = out + terms + 1;
    phi[0] = add_lanes(pulled[0].first);
    psi[0] = -c.kappa * add_lanes(pulled[0].second);
    for (int k = 1; k <= terms; k++) {
        phi[k] = add_lanes(moved[k - 1].first) - add_lanes(pulled[k].first) / k;
        psi[k] = add_lanes(moved[k - 1].second) + c.kappa * add_lanes(pulled[k].second) / k +
                 add_lanes(pulled[k - 1].third);
        if (k > 1) psi[k] += (k - 1) * add_lanes(moved[k - 2].third);
    }
}

/* Displacement, or traction where the normal is not 0, at points from a field about a centre (theory, 2, 4, 36). */
static void evaluate_series(const cplx *field, const cplx *point, const cplx *normal, int64_t count, Circle c, int terms,
                            cplx *out)
{
    for (int64_t begin = 0; begin < count; begin += LANES) {
        const int64_t here = count - begin < LANES ? count - begin : LANES;
        Complex h = c_make(0, 0), n = c_make(0, 0);
        for (int lane = 0; lane < here; lane++) {
            c_put(&h, lane, point[begin + lane] - c.center);
            c_put(&n, lane, normal[begin + lane]);
        }
        const Complex z = c_scale(1 / c.radius, h);
        /* Both functions and their derivatives, the second one by two. */
        Complex phi[3], psi[2];
        for (int i = 0; i < 3; i++) phi[i] = c_make(0, 0);
        for (int i = 0; i < 2; i++) psi[i] = c_make(0, 0);
        for (int k = terms; k >= 0; k--) {
            for (int i = 2; i > 0; i--) phi[i] = c_add(c_mul(phi[i], z), phi[i - 1]);
            phi[0] = c_add(c_mul(phi[0], z), c_spread(field[k]));
            psi[1] = c_add(c_mul(psi[1], z), psi[0]);
            psi[0] = c_add(c_mul(psi[0], z), c_spread(field[terms + 1 + k]));
        }
        const Complex slope = c_scale(1 / c.radius, phi[1]), bend = c_scale(2 / (c.radius * c.radius), phi[2]);
        const Complex moved = c_scale(0.5 / c.shear_modulus, c_sub(c_scale(c.kappa, phi[0]),
            c_add(c_mul_conj(h, slope), c_conj(psi[0]))));
        const Complex across = c_conj(c_mul(n, c_scale(1 / c.radius, psi[1])));
        const Complex pulled = c_sub(c_scale(2 * slope.re, n), c_add(c_mul_conj(h, c_mul(n, bend)), across));
        for (int lane = 0; lane < here; lane++)
            out[begin + lane] = normal[begin + lane] == 0 ? moved.re[lane] + I * moved.im[lane]
                                                          : pulled.re[lane] + I * pulled.im[lane];
    }
}

#endif
