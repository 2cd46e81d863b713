/* One point against a run of straight elements with polynomial shapes, many elements at a time.
 *
 * The loops over the elements of a batch are plain and without branches, for the compiler to vectorise. All elements are
 * first treated as far ones; the few that are near are then done again, one by one, with the closed form. Far from an
 * element only the highest moment is summed, in v = 1/w and q = v^2; with B = 1/(1 - q) the others follow exactly:
 *
 *     c_k = v (c_(k+1) - l_k)
 *     d_k = k v c_k + 2 B q (k even) or 2 B q v (k odd)
 *     e_k = k (k - 1) q c_k + q v (2 k B - 4 B^2) (k even) or q^2 (2 k B - 2 (3 - q) B^2) (k odd)
 */
#ifndef PBEM_STRAIGHT_H
#define PBEM_STRAIGHT_H
#include "moments.h"

#define BATCH 64

typedef struct {
    double *mx, *my, *ex, *ey, *h, *log_h; /* middle, unit direction, half-length and its logarithm, per element */
} Segments;

typedef struct {
    double y[BATCH], r2[BATCH];
    double cr[MAX_SHAPES + 1][BATCH], ci[MAX_SHAPES + 1][BATCH];
    double dr[MAX_SHAPES][BATCH], di[MAX_SHAPES][BATCH];
    double er[MAX_SHAPES][BATCH], ei[MAX_SHAPES][BATCH];
    double n[MAX_SHAPES][BATCH];
} Batch;

/* Coordinates of the point from every element, as far moments see them: v = 1/w, q = v^2, B = 1/(1 - q). */
static void evaluate_far(const Segments *s, Py_ssize_t first, int count, cplx z, int order, int with_n, int with_e, Batch *b)
{
    const double zx = creal(z), zy = cimag(z);
    const int top = order + 1;
    double vr[BATCH], vi[BATCH], qr[BATCH], qi[BATCH], Br[BATCH], Bi[BATCH], log_ends[BATCH];
    double nearest = 1e300;
    for (int j = 0; j < count; j++) {
        const double dx = zx - s->mx[first + j], dy = zy - s->my[first + j];
        const double ex = s->ex[first + j], ey = s->ey[first + j], ih = 1 / s->h[first + j];
        const double x = (dx * ex + dy * ey) * ih, y = (dy * ex - dx * ey) * ih, r2 = x * x + y * y;
        const double inverse = 1 / r2;
        b->y[j] = y;
        b->r2[j] = r2;
        vr[j] = x * inverse;
        vi[j] = -y * inverse;
        qr[j] = vr[j] * vr[j] - vi[j] * vi[j];
        qi[j] = 2 * vr[j] * vi[j];
        const double below = 1 / ((1 - qr[j]) * (1 - qr[j]) + qi[j] * qi[j]);
        Br[j] = (1 - qr[j]) * below;
        Bi[j] = qi[j] * below;
        /* |w^2 - 1|^2, for the logarithm */
        log_ends[j] = ((x - 1) * (x - 1) + y * y) * ((x + 1) * (x + 1) + y * y);
    }
    if (with_n)
        for (int j = 0; j < count; j++) log_ends[j] = 0.5 * log(log_ends[j]);
    for (int j = 0; j < count; j++) {
        const double far = b->r2[j] < FAR_SQUARED ? 1e300 : b->r2[j];
        nearest = far < nearest ? far : nearest;
    }
    double *cr = b->cr[top], *ci = b->ci[top];
    for (int j = 0; j < count; j++) cr[j] = ci[j] = 0;
    const int odd = top % 2;
    for (int i = count_terms(nearest); i >= 0; i--) {
        const double a = -2.0 / (top + odd + 2 * i + 1);
        for (int j = 0; j < count; j++) {
            const double real = cr[j] * qr[j] - ci[j] * qi[j] + a;
            ci[j] = cr[j] * qi[j] + ci[j] * qr[j];
            cr[j] = real;
        }
    }
    const double *leadr = odd ? qr : vr, *leadi = odd ? qi : vi;
    for (int j = 0; j < count; j++) {
        const double real = cr[j] * leadr[j] - ci[j] * leadi[j];
        ci[j] = cr[j] * leadi[j] + ci[j] * leadr[j];
        cr[j] = real;
    }
    for (int k = order; k >= 0; k--) {
        const double l = (k % 2) ? 0.0 : 2.0 / (k + 1), over = 1.0 / (k + 1);
        const double *ur = b->cr[k + 1], *ui = b->ci[k + 1];
        double *tr = b->cr[k], *ti = b->ci[k];
        for (int j = 0; j < count; j++) {
            tr[j] = vr[j] * (ur[j] - l) - vi[j] * ui[j];
            ti[j] = vr[j] * ui[j] + vi[j] * (ur[j] - l);
        }
        if (with_n && k % 2 == 0)
            for (int j = 0; j < count; j++) b->n[k][j] = (log_ends[j] - ur[j]) * over;
        const double *pr = k % 2 ? vr : NULL, *pi = k % 2 ? vi : NULL;
        for (int j = 0; j < count; j++) {
            /* 2 B q, times v if k is odd */
            double gr = 2 * (Br[j] * qr[j] - Bi[j] * qi[j]), gi = 2 * (Br[j] * qi[j] + Bi[j] * qr[j]);
            if (pr) {
                const double real = gr * pr[j] - gi * pi[j];
                gi = gr * pi[j] + gi * pr[j];
                gr = real;
            }
            b->dr[k][j] = k * (vr[j] * tr[j] - vi[j] * ti[j]) + gr;
            b->di[k][j] = k * (vr[j] * ti[j] + vi[j] * tr[j]) + gi;
        }
        if (!with_e) continue;
        for (int j = 0; j < count; j++) {
            const double B2r = Br[j] * Br[j] - Bi[j] * Bi[j], B2i = 2 * Br[j] * Bi[j];
            double gr, gi, lr, li;
            if (k % 2) {
                gr = 2 * k * Br[j] - 2 * ((3 - qr[j]) * B2r + qi[j] * B2i);
                gi = 2 * k * Bi[j] - 2 * ((3 - qr[j]) * B2i - qi[j] * B2r);
                lr = qr[j] * qr[j] - qi[j] * qi[j];
                li = 2 * qr[j] * qi[j];
            } else {
                gr = 2 * k * Br[j] - 4 * B2r;
                gi = 2 * k * Bi[j] - 4 * B2i;
                lr = qr[j] * vr[j] - qi[j] * vi[j];
                li = qr[j] * vi[j] + qi[j] * vr[j];
            }
            b->er[k][j] = k * (k - 1) * (qr[j] * tr[j] - qi[j] * ti[j]) + gr * lr - gi * li;
            b->ei[k][j] = k * (k - 1) * (qr[j] * ti[j] + qi[j] * tr[j]) + gr * li + gi * lr;
        }
    }
    if (with_n)
        for (int k = 1; k <= order; k += 2)
            for (int j = 0; j < count; j++) b->n[k][j] = (b->cr[0][j] - b->cr[k + 1][j]) / (k + 1);
}

/* The elements of the batch that are near the point, by the closed form. */
static void mend_near(const Segments *s, Py_ssize_t first, int count, cplx z, int64_t on, int order, Batch *b)
{
    for (int j = 0; j < count; j++) {
        if (b->r2[j] >= FAR_SQUARED) continue;
        const Py_ssize_t i = first + j;
        const cplx e = s->ex[i] + I * s->ey[i], w = (z - (s->mx[i] + I * s->my[i])) * conj(e) / s->h[i];
        Moments m;
        evaluate_moments(w, on == i, order, &m);
        b->y[j] = m.y;
        for (int k = 0; k <= order; k++) {
            b->cr[k][j] = creal(m.c[k]);
            b->ci[k][j] = cimag(m.c[k]);
            b->dr[k][j] = creal(m.d[k]);
            b->di[k][j] = cimag(m.d[k]);
            b->er[k][j] = creal(m.e[k]);
            b->ei[k][j] = cimag(m.e[k]);
            b->n[k][j] = m.n[k];
        }
    }
}

/* From moments of powers to moments of the nodal shapes, in place. */
static void shape_moments(double (*m)[BATCH], int count, int shapes, const double *shape)
{
    double out[MAX_SHAPES][BATCH];
    for (int node = 0; node < shapes; node++) {
        for (int j = 0; j < count; j++) out[node][j] = shape[node] * m[0][j];
        for (int k = 1; k < shapes; k++) {
            const double a = shape[k * shapes + node];
            for (int j = 0; j < count; j++) out[node][j] += a * m[k][j];
        }
    }
    for (int node = 0; node < shapes; node++) memcpy(m[node], out[node], count * sizeof(double));
}

#endif
