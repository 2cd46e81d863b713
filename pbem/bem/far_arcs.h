/* Circular arcs away from the point: Gauss points that are exact to rounding, several collocation points at a time.
 *
 * With r = zeta - z from the collocation point to the point zeta of the arc, unit tangent e there and y = Im(conj(r) e),
 * the integrands of arcs.h are, by arc length (c, d, q, dq) and times conj(zeta - z) and so on (x, s, y, n)
 *
 *     c = e/r,   d = e/r^2,   q = 2 i y/r^2,   dq = (conj(e) + 4 i y/r)/r^2,
 *     x = 1/r,   s = conj(r)/r,   dx/dz part y = conj(r)/r^2,   n = ln|r|.
 */
#ifndef PBEM_FAR_ARCS_H
#define PBEM_FAR_ARCS_H
#include "arc_rules.h"

/* Rows of some points on the element of a rule (theory, 9 to 12, 34). */
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
