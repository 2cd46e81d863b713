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

/* Rows of weights that are summed at a time: their sums stay in registers. */
#define WEIGHED 4
#define CHUNK (WIDE == 8 ? 4 : 2)
#define EACH_SUM                                                      \
    _Pragma("GCC unroll 4") for (int row = 0; row < WEIGHED; row++)   \
    _Pragma("GCC unroll 4") for (int c = 0; c < CHUNK; c++)

/* out (WEIGHED, COLUMNS) = weights (WEIGHED, terms + 1) times seen (terms + 1, COLUMNS) */
INLINE void weigh_rows(const double *weights, const double (*seen)[COLUMNS], int terms, double (*out)[COLUMNS])
{
    for (int begin = 0; begin < COLUMNS; begin += CHUNK * WIDE) {
        Wide sum[WEIGHED][CHUNK];
        EACH_SUM sum[row][c] = (Wide){0};
        for (int k = 0; k <= terms; k++) {
            const WideLoose *value = (const WideLoose *)(seen[k] + begin);
            EACH_SUM sum[row][c] += weights[row * (terms + 1) + k] * value[c];
        }
        EACH_SUM *(WideLoose *)(out[row] + begin + c * WIDE) = sum[row][c];
    }
}

/* Powers of a number of each pair, of which the unused ones are 0. */
typedef struct {
    double re[MOST_POWERS][PAIRS], im[MOST_POWERS][PAIRS];
} Powers;

static void take_powers_of_pairs(Powers *power, const cplx *base, int terms)
{
    double re[PAIRS], im[PAIRS];
    for (int j = 0; j < PAIRS; j++) re[j] = creal(base[j]), im[j] = cimag(base[j]);
    for (int j = 0; j < PAIRS; j++) power->re[0][j] = 1, power->im[0][j] = 0;
    for (int k = 0; k < terms; k++)
        for (int j = 0; j < PAIRS; j++) {
            power->re[k + 1][j] = power->re[k][j] * re[j] - power->im[k][j] * im[j];
            power->im[k + 1][j] = power->re[k][j] * im[j] + power->im[k][j] * re[j];
        }
}

/* Two complex numbers side by side times another one, and parts of both functions of a series. */
INLINE Four multiply_both(Four both, double re, double im)
{
    const Four crossed = {-im, im, -im, im};
    return both * re + SHUFFLE_FOUR(both, both, 1, 0, 3, 2) * crossed;
}

INLINE Four load_four(const double *from) { return *(const FourLoose *)from; }

INLINE Four load_both(const cplx *first, const cplx *second)
{
    const double *one = (const double *)first, *two = (const double *)second;
    return (Four){one[0], one[1], two[0], two[1]};
}

INLINE void add_both(cplx *first, cplx *second, Four value)
{
    double *one = (double *)first, *two = (double *)second;
    one[0] += value[0], one[1] += value[1];
    two[0] += value[2], two[1] += value[3];
}

/* The fields far from the sources, added to those of one pair's target. */
INLINE void add_far(const Carried *pair, const Powers *power, int j, double (*far)[COLUMNS], int terms, int used)
{
    const cplx *own = pair->moments, back = conj(pair->distance) / pair->distance;
    cplx *phi = pair->field, *psi = pair->field + terms + 1;
    if (own[0] != 0 || own[terms + 1] != 0) {
        const cplx logarithm = clog(pair->distance / pair->length);
        const cplx more[2] = {logarithm * own[0], logarithm * own[terms + 1]};
        for (int f = 0; f < 2; f++) {
            far[0][4 * j + 2 * f] += creal(more[f]);
            far[0][4 * j + 2 * f + 1] += cimag(more[f]);
        }
    }
    /* psi about the target: plus conj(distance) phi' */
    const Four straight = {0, 0, creal(back), creal(back)}, crossed = {0, 0, -cimag(back), cimag(back)};
    for (int l = 0; l <= used; l++) {
        Four value = load_four(far[l] + 4 * j);
        if (l < used) {
            const Four next = load_four(far[l + 1] + 4 * j) * (double)(l + 1);
            value += SHUFFLE_FOUR(next, next, 0, 1, 0, 1) * straight + SHUFFLE_FOUR(next, next, 1, 0, 1, 0) * crossed;
        }
        add_both(phi + l, psi + l, multiply_both(value, power->re[l][j], power->im[l][j]));
    }
}

/* Fields about the targets from the coefficients of the sources, added (theory, 40): of all terms that there are so many
 * of the fields from so many of the sources. weights: of those, with rows of zeros up to a multiple of WEIGHED. Real and
 * imaginary parts of both functions of each pair are side by side. */
static void carry_series(const Carried *pairs, int count, const double *weights, int terms, int sources, int fields)
{
    double seen[MOST_POWERS][COLUMNS], far[MOST_POWERS + WEIGHED][COLUMNS];
    cplx inner[PAIRS] = {0}, outer[PAIRS] = {0};
    Powers power;
    for (int j = 0; j < count; j++) {
        inner[j] = pairs[j].source / pairs[j].distance;
        outer[j] = pairs[j].target / pairs[j].distance;
    }
    if (count < PAIRS) memset(seen, 0, (sources + 1) * sizeof seen[0]);
    take_powers_of_pairs(&power, inner, sources);
    for (int j = 0; j < count; j++)
        for (int k = 0; k <= sources; k++) {
            const Four both = load_both(pairs[j].moments + k, pairs[j].moments + terms + 1 + k);
            const Four value = multiply_both(both, power.re[k][j], power.im[k][j]);
            *(FourLoose *)(seen[k] + 4 * j) = value;
        }
    for (int l = 0; l <= fields; l += WEIGHED)
        weigh_rows(weights + l * (sources + 1), (const double (*)[COLUMNS])seen, sources, far + l);
    take_powers_of_pairs(&power, outer, fields);
    for (int j = 0; j < count; j++) add_far(&pairs[j], &power, j, far, terms, fields);
}

#endif
