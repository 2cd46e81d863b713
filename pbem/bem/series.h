/* How series of two analytic functions move from cluster to cluster; see pbem/bem/expansion.py for what they are.
 *
 * The coefficients of a cluster are phi_0 .. phi_p, then psi_0 .. psi_p, complex, in units of its radius. While they are
 * worked on, real and imaginary parts are apart, so that loops over powers or over pairs of clusters are vectors.
 */
#ifndef PBEM_SERIES_H
#define PBEM_SERIES_H
#include "complex_lanes.h"

/* Terms at most, the constant one among them. */
#define MOST_POWERS 128
/* Pairs of clusters that are carried over at once; of each two functions with two parts. */
#define PAIRS 8
#define COLUMNS (4 * PAIRS)

typedef struct {
    double re[MOST_POWERS], im[MOST_POWERS];
} Series;

/* binomials[i][k] = binom(k + i, i), i + k <= MOST_POWERS. */
static double binomials[MOST_POWERS][MOST_POWERS];

static void prepare_binomials(void)
{
    for (int i = 0; i < MOST_POWERS; i++)
        for (int k = 0; k < MOST_POWERS; k++)
            binomials[i][k] = i && k ? binomials[i - 1][k] + binomials[i][k - 1] : 1.0;
}

static void read_series(Series *to, const cplx *from, int terms)
{
    for (int k = 0; k <= terms; k++) to->re[k] = creal(from[k]), to->im[k] = cimag(from[k]);
}

/* z^0 .. z^terms */
static void take_powers(Series *power, cplx z, int terms)
{
    cplx value = 1;
    for (int k = 0; k <= terms; k++, value *= z) power->re[k] = creal(value), power->im[k] = cimag(value);
}

/* A child's coefficients about its parent's centre, added to the parent's (theory, 39). offset: from parent to child. */
static void lift_series(const cplx *child, cplx *parent, cplx offset, double inner, double outer, int terms)
{
    Series power, seen, moved[2];
    const double scale = inner / outer;
    take_powers(&power, offset / outer, terms);
    for (int f = 0; f < 2; f++) {
        const cplx *own = child + f * (terms + 1);
        const double re0 = creal(own[0]), im0 = cimag(own[0]);
        Series *to = &moved[f];
        read_series(&seen, own, terms);
        double factor = 1;
        for (int k = 1; k <= terms; k++) {
            factor *= scale;
            seen.re[k] *= factor;
            seen.im[k] *= factor;
        }
        to->re[0] = re0, to->im[0] = im0;
        for (int k = 1; k <= terms; k++) {
            to->re[k] = seen.re[k] - (re0 * power.re[k] - im0 * power.im[k]) / k;
            to->im[k] = seen.im[k] - (re0 * power.im[k] + im0 * power.re[k]) / k;
        }
        for (int i = 1; i < terms; i++) {
            const double re = power.re[i], im = power.im[i];
            for (int k = 1; k <= terms - i; k++) {
                const double much = binomials[i][k - 1];
                to->re[k + i] += much * (re * seen.re[k] - im * seen.im[k]);
                to->im[k + i] += much * (re * seen.im[k] + im * seen.re[k]);
            }
        }
    }
    /* psi about the parent's centre: less conj(offset) phi' */
    const cplx turned = conj(offset) / outer;
    cplx *phi = parent, *psi = parent + terms + 1;
    for (int k = 0; k <= terms; k++) {
        phi[k] += moved[0].re[k] + I * moved[0].im[k];
        psi[k] += moved[1].re[k] + I * moved[1].im[k];
    }
    if (terms > 0) psi[1] -= turned * (moved[0].re[0] + I * moved[0].im[0]);
    for (int k = 1; k < terms; k++) psi[k + 1] += turned * (double)k * (moved[0].re[k] + I * moved[0].im[k]);
}

/* The parent's field about its child's centre, added to the child's (theory, 41). */
static void lower_series(const cplx *parent, cplx *child, cplx offset, double inner, double outer, int terms)
{
    Series power, seen[2];
    const double scale = inner / outer;
    const cplx turned = conj(offset) / outer;
    take_powers(&power, offset / outer, terms);
    for (int f = 0; f < 2; f++) read_series(&seen[f], parent + f * (terms + 1), terms);
    for (int k = 0; k < terms; k++) {
        const cplx more = turned * (double)(k + 1) * parent[k + 1];
        seen[1].re[k] += creal(more);
        seen[1].im[k] += cimag(more);
    }
    for (int f = 0; f < 2; f++) {
        Series moved = seen[f];
        for (int i = 1; i <= terms; i++) {
            const double re = power.re[i], im = power.im[i];
            for (int k = 0; k <= terms - i; k++) {
                const double much = binomials[i][k];
                moved.re[k] += much * (re * seen[f].re[k + i] - im * seen[f].im[k + i]);
                moved.im[k] += much * (re * seen[f].im[k + i] + im * seen[f].re[k + i]);
            }
        }
        double factor = 1;
        for (int k = 0; k <= terms; k++, factor *= scale)
            child[f * (terms + 1) + k] += factor * (moved.re[k] + I * moved.im[k]);
    }
}

/* A pair of clusters well apart, and what they are to each other. */
typedef struct {
    const cplx *moments;
    cplx *field;
    cplx distance;
    double source, target, length;
} Carried;

/* weights (terms + 1)^2 times seen, (terms + 1, COLUMNS), of one row into out. */
INLINE void weigh_two(const double *weights, const double (*seen)[COLUMNS], int terms, double *out, double *next)
{
    Lanes sum[2][COLUMNS / LANES];
    for (int c = 0; c < COLUMNS / LANES; c++) sum[0][c] = sum[1][c] = spread(0);
    const double *other = weights + terms + 1;
    for (int k = 0; k <= terms; k++) {
        const double one = weights[k], two = other[k];
        for (int c = 0; c < COLUMNS / LANES; c++) {
            Lanes value;
            memcpy(&value, seen[k] + c * LANES, sizeof value);
            sum[0][c] += one * value;
            sum[1][c] += two * value;
        }
    }
    memcpy(out, sum[0], sizeof sum[0]);
    memcpy(next, sum[1], sizeof sum[1]);
}

/* Fields about the targets from the coefficients of the sources, added (theory, 40). weights: of one row more, of
 * zeros, where their number is odd. */
static void carry_series(const Carried *pairs, int count, const double *weights, int terms)
{
    double seen[MOST_POWERS][COLUMNS], far[MOST_POWERS + 1][COLUMNS];
    memset(seen, 0, (terms + 1) * sizeof seen[0]);
    for (int j = 0; j < count; j++) {
        const cplx ratio = pairs[j].source / pairs[j].distance;
        cplx power = 1;
        for (int k = 0; k <= terms; k++, power *= ratio)
            for (int f = 0; f < 2; f++) {
                const cplx value = pairs[j].moments[f * (terms + 1) + k] * power;
                seen[k][4 * j + 2 * f] = creal(value);
                seen[k][4 * j + 2 * f + 1] = cimag(value);
            }
    }
    for (int l = 0; l <= terms; l += 2)
        weigh_two(weights + l * (terms + 1), (const double (*)[COLUMNS])seen, terms, far[l], far[l + 1]);
    for (int j = 0; j < count; j++) {
        const Carried *each = &pairs[j];
        const cplx *own = each->moments, back = conj(each->distance) / each->distance;
        const cplx ratio = each->target / each->distance;
        cplx *phi = each->field, *psi = each->field + terms + 1;
        if (own[0] != 0 || own[terms + 1] != 0) {
            const cplx logarithm = clog(each->distance / each->length);
            const cplx more[2] = {logarithm * own[0], logarithm * own[terms + 1]};
            for (int f = 0; f < 2; f++) {
                far[0][4 * j + 2 * f] += creal(more[f]);
                far[0][4 * j + 2 * f + 1] += cimag(more[f]);
            }
        }
        cplx power = 1;
        for (int l = 0; l <= terms; l++, power *= ratio) {
            const double *at = far[l] + 4 * j;
            cplx second = at[2] + I * at[3];
            /* psi about the target: plus conj(distance) phi' */
            if (l < terms) second += back * (double)(l + 1) * (at[4 * PAIRS] + I * at[4 * PAIRS + 1]);
            phi[l] += power * (at[0] + I * at[1]);
            psi[l] += power * second;
        }
    }
}

#endif
