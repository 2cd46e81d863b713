/* From moments of straight elements to the blocks of their nodes; see _kernels.c for the formulas' source. */
#ifndef PBEM_COMBINE_H
#define PBEM_COMBINE_H
#include "straight.h"

/* What the blocks of one kind of element have in common. */
typedef struct {
    double kappa, shear_modulus, log_length;
    double shape[MAX_SHAPES * MAX_SHAPES]; /* coefficient of power k in the shape of node j: [k * shapes + j] */
    double integral[MAX_SHAPES];           /* of the shapes over [-1, 1] */
} Factor;

/* The 2 x 2 blocks of an element's nodes, by component of the value and of the density. */
typedef struct {
    Lanes xx[MAX_SHAPES], xy[MAX_SHAPES], yx[MAX_SHAPES], yy[MAX_SHAPES];
} Blocks;

/* From moments of powers to moments of the nodal shapes, in place. */
INLINE void shape_moments(int shapes, const double *shape, Lanes *m)
{
    Lanes sum[MAX_SHAPES];
#pragma GCC unroll 4
    for (int node = 0; node < shapes; node++) {
        sum[node] = shape[node] * m[0];
#pragma GCC unroll 4
        for (int k = 1; k < shapes; k++) sum[node] += shape[k * shapes + node] * m[k];
    }
#pragma GCC unroll 4
    for (int node = 0; node < shapes; node++) m[node] = sum[node];
}

/* The real 2 x 2 block of a -> P a + Q conj(a). */
INLINE void put_lanes(Blocks *b, int node, Lanes Pr, Lanes Pi, Lanes Qr, Lanes Qi)
{
    b->xx[node] = Pr + Qr;
    b->xy[node] = Qi - Pi;
    b->yx[node] = Qi + Pi;
    b->yy[node] = Pr - Qr;
}

INLINE void put_symmetric(Blocks *b, int node, Lanes P, Lanes Qr, Lanes Qi)
{
    b->xx[node] = P + Qr;
    b->xy[node] = b->yx[node] = Qi;
    b->yy[node] = P - Qr;
}

/* Displacement at the points, from moments of nodal shapes: of displacements into H, of tractions into G. */
/* (theory, 26, 27) */
INLINE void combine_displacements(int shapes, int tractions, const Factor *c, const Frame *f, const LaneMoments *m,
                                  Blocks *H, Blocks *G)
{
    const double kappa = c->kappa, fu = 1 / (2 * M_PI * (kappa + 1)), skew = fu * (1 - kappa), even = fu * (kappa + 1);
    const Lanes e2r = f->ex * f->ex - f->ey * f->ey, e2i = 2 * f->ex * f->ey;
    const Lanes y2 = 2 * m->y, Yr = fu * y2 * e2r, Yi = fu * y2 * e2i;
#pragma GCC unroll 4
    for (int j = 0; j < shapes; j++)
        put_lanes(H, j, even * m->ci[j], skew * m->cr[j], Yr * m->dr[j] + Yi * m->di[j], Yi * m->dr[j] - Yr * m->di[j]);
    if (!tractions) return;
    const Lanes h = f->h * (1 / (4 * M_PI * c->shear_modulus * (kappa + 1))), log_h = f->log_h - c->log_length;
    const Lanes Lr = h * e2r, Li = h * e2i, Zr = y2 * Lr, Zi = y2 * Li, log_factor = -2 * kappa * h;
#pragma GCC unroll 4
    for (int j = 0; j < shapes; j++) {
        const double l = c->integral[j];
        /* e^2 h (l - 2 i y conj(c)) */
        put_symmetric(G, j, log_factor * (m->n[j] + l * log_h), l * Lr - MULTIPLY_REAL(Zr, Zi, m->ci[j], m->cr[j]),
                      l * Li - MULTIPLY_IMAGINARY(Zr, Zi, m->ci[j], m->cr[j]));
    }
}

/* Traction on the normals N at the points, in the same way (theory, 28, 29). */
INLINE void combine_tractions(int shapes, int tractions, const Factor *c, const Frame *f, Lanes Nx, Lanes Ny,
                              const LaneMoments *m, Blocks *H, Blocks *G)
{
    const double kappa = c->kappa, g0 = c->shear_modulus / (M_PI * (kappa + 1)), f0 = 1 / (2 * M_PI * (kappa + 1));
    const Lanes ex = f->ex, ey = f->ey, g = g0 * f->inverse_h, y2 = 2 * m->y;
    const Lanes e2r = ex * ex - ey * ey, e2i = 2 * ex * ey;
    const Lanes ar = ex * Nx + ey * Ny, ai = ey * Nx - ex * Ny; /* e conj(N) */
    const Lanes Tr = MULTIPLY_REAL(e2r, e2i, ar, ai), Ti = MULTIPLY_IMAGINARY(e2r, e2i, ar, ai); /* e^3 conj(N) */
    const Lanes Sr = 2 * ar * e2r, Si = 2 * ar * e2i;                                            /* e N + T */
    const Lanes Pr = 2 * g * ar, Pi = 2 * g * ai, Dr = -g * Si, Di = g * Sr, Er = g * y2 * Tr, Ei = g * y2 * Ti;
#pragma GCC unroll 4
    for (int j = 0; j < shapes; j++) {
        const Lanes dr = m->dr[j], di = m->di[j], er = m->er[j], ei = m->ei[j];
        /* P = -2 g Im(conj(d) a), Q = i g S conj(d) + 2 y g T conj(e) */
        put_symmetric(H, j, di * Pr - dr * Pi, dr * Dr + di * Di + er * Er + ei * Ei,
                      dr * Di - di * Dr + er * Ei - ei * Er);
    }
    if (!tractions) return;
    const Lanes Cr = f0 * Sr, Ci = f0 * Si, Fr = f0 * y2 * Ti, Fi = -f0 * y2 * Tr;
    const double sum = f0 * (kappa + 1), difference = f0 * (kappa - 1);
    const Lanes Ar = sum * ar, Ai = sum * ai, Br = difference * ar, Bi = difference * ai;
#pragma GCC unroll 4
    for (int j = 0; j < shapes; j++) {
        const Lanes cr = m->cr[j], ci = m->ci[j], dr = m->dr[j], di = m->di[j];
        /* P = (kappa + 1) Re(a conj(c)) + i (kappa - 1) Im(a conj(c)), Q = S conj(c) - 2 i y T conj(d) */
        put_lanes(G, j, cr * Ar + ci * Ai, cr * Bi - ci * Br, cr * Cr + ci * Ci + dr * Fr + di * Fi,
                  cr * Ci - ci * Cr + dr * Fi - di * Fr);
    }
}

/* Shape, combine and store the pairs. H, G: where each lane's rows begin; G is not read without tractions. */
INLINE void store_pairs(int order, int tractions, int stress, const Factor *c, const Frame *f, Lanes Nx, Lanes Ny,
                        LaneMoments *m, int64_t width, double *const *H, double *const *G)
{
    const int shapes = order + 1;
    Blocks h, g;
    shape_moments(shapes, c->shape, m->dr);
    shape_moments(shapes, c->shape, m->di);
    if (!stress || tractions) {
        shape_moments(shapes, c->shape, m->cr);
        shape_moments(shapes, c->shape, m->ci);
    }
    if (stress) {
        shape_moments(shapes, c->shape, m->er);
        shape_moments(shapes, c->shape, m->ei);
        combine_tractions(shapes, tractions, c, f, Nx, Ny, m, &h, &g);
    } else {
        if (tractions) shape_moments(shapes, c->shape, m->n);
        combine_displacements(shapes, tractions, c, f, m, &h, &g);
    }
    store_row(shapes, h.xx, h.xy, H, 0);
    store_row(shapes, h.yx, h.yy, H, width);
    if (!tractions) return;
    store_row(shapes, g.xx, g.xy, G, 0);
    store_row(shapes, g.yx, g.yy, G, width);
}

#endif
