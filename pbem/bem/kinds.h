/* Rows of straight elements: sorted by kind, several at a time, the near ones apart. */
#ifndef PBEM_KINDS_H
#define PBEM_KINDS_H
#include <stdlib.h>

#include "combine.h"

typedef struct {
    Py_ssize_t points, elements;
    const cplx *point, *normal, *start, *end, *center;
    const double *sweep;           /* angle through which an arc turns; 0 for a straight element */
    const int64_t *on;             /* element on which the point lies, or -1 */
    const double *on_local;        /* the point's coordinate s on that element */
    const double *local;           /* coordinates of an element's nodes */
    const int8_t *family;          /* BOUNDARY, TIP_AT_START, TIP_AT_END, CRACK */
    const double *shape;           /* coefficient of power k in a family's shape j: [(family * shapes + k) * shapes + j] */
    int order;
    double kappa, shear_modulus, log_length;
    double *displacement, *traction; /* outputs: row 2 i + component, column 2 (element * shapes + j) + component */
} Rows;

/* The straight elements of one family, by groups of lanes; the last one repeats where the number is not divisible. */
typedef struct {
    Py_ssize_t groups;
    int family;
    Factor factor;
    Frame *frame;
    int64_t (*element)[LANES];
} Kind;

/* Groups that are done for one point after the other; pairs near each other that are done together. */
#define TILE (128 / LANES)
#define MOST_NEAR 256

typedef struct {
    int count;
    int64_t point[MOST_NEAR], group[MOST_NEAR];
    int lane[MOST_NEAR];
} NearPairs;

static int round_up(int count, int step) { return (count + step - 1) / step * step; }

static int is_repeated(const int64_t *element, int lane) { return lane && element[lane] == element[lane - 1]; }

static double *locate_block(const Rows *r, double *out, Py_ssize_t point, int64_t element)
{
    const Py_ssize_t shapes = r->order + 1;
    return out ? out + 2 * shapes * (2 * point * r->elements + element) : NULL;
}

/* Some of the near pairs side by side: their elements, points, normals and the places of their rows. */
typedef struct {
    Frame frame;
    Lanes x, y, off, Nx, Ny; /* off: 0 on the element, otherwise 1 */
    double *H[LANES], *G[LANES];
} NearLanes;

INLINE void gather_pairs(const Rows *r, const Kind *kind, const NearPairs *near, int first, NearLanes *to)
{
    Lanes zx = spread(0), zy = zx, Nx = zx, Ny = zx, off = zx;
    Frame f = {zx, zx, zx, zx, zx, zx, zx};
    for (int lane = 0; lane < LANES; lane++) {
        const int pair = first + lane < near->count ? first + lane : near->count - 1, from = near->lane[pair];
        const Frame *g = &kind->frame[near->group[pair]];
        const int64_t i = near->point[pair], j = kind->element[near->group[pair]][from];
        f.mx[lane] = g->mx[from];
        f.my[lane] = g->my[from];
        f.ex[lane] = g->ex[from];
        f.ey[lane] = g->ey[from];
        f.h[lane] = g->h[from];
        f.inverse_h[lane] = g->inverse_h[from];
        f.log_h[lane] = g->log_h[from];
        zx[lane] = creal(r->point[i]);
        zy[lane] = cimag(r->point[i]);
        Nx[lane] = r->normal ? creal(r->normal[i]) : 0;
        Ny[lane] = r->normal ? cimag(r->normal[i]) : 0;
        off[lane] = r->on[i] != j;
        to->H[lane] = locate_block(r, r->displacement, i, j);
        to->G[lane] = locate_block(r, r->traction, i, j);
    }
    locate(&f, zx, zy, &to->x, &to->y);
    to->y *= off; /* on the element the distance from its line is rounding */
    to->off = off;
    to->frame = f;
    to->Nx = Nx;
    to->Ny = Ny;
}

/* Pairs near each other, by the closed form. */
INLINE void fill_near_pairs(int order, int tractions, int stress, const Rows *r, const Kind *kind, NearPairs *near)
{
    NearLanes all[MOST_NEAR / LANES];
    Lanes log_ratio[MOST_NEAR / LANES], log_ends[MOST_NEAR / LANES];
    Lanes along[MOST_NEAR / LANES], angle[MOST_NEAR / LANES];
    const int count = round_up(near->count, FUNCTION_BATCH);
    for (int p = 0; p < count / LANES; p++) {
        gather_pairs(r, kind, near, p * LANES, &all[p]);
        const Lanes x = all[p].x, y = all[p].y;
        const Lanes right = (x - 1) * (x - 1) + y * y, left = (x + 1) * (x + 1) + y * y;
        log_ratio[p] = right / left;
        log_ends[p] = right * left;
        along[p] = (x - 1) * (x + 1) + y * y;
        angle[p] = 2 * y;
    }
    take_logarithms((double *)log_ratio, count);
    if (tractions && !stress) take_logarithms((double *)log_ends, count);
    take_arguments((double *)angle, (const double *)along, count);
    for (int p = 0; p < count / LANES; p++) {
        NearLanes *to = &all[p];
        LaneMoments m;
        /* no angle is subtended on the element */
        evaluate_near(order, stress, to->x, to->y, 0.5 * log_ratio[p], to->off * angle[p], &m);
        if (tractions && !stress) find_logarithmic(order, 0.5 * log_ends[p], &m);
        store_pairs(order, tractions, stress, &kind->factor, &to->frame, to->Nx, to->Ny, &m,
                    2 * r->elements * (order + 1), to->H, to->G);
    }
    near->count = 0;
}

/* All points against groups first .. last - 1 of a kind with polynomial shapes. */
INLINE void fill_tile(int order, int tractions, int stress, const Rows *r, const Kind *kind, Py_ssize_t first,
                      Py_ssize_t last, NearPairs *near)
{
    const int64_t width = 2 * r->elements * (order + 1);
    const int count = (int)(last - first);
    Lanes x[TILE], y[TILE], ends[TILE], logs[TILE];
    for (Py_ssize_t i = 0;; i++) {
        /* called at one place: two copies would differ in rounding */
        if (near->count > MOST_NEAR - TILE * LANES || (i == r->points && near->count))
            fill_near_pairs(order, tractions, stress, r, kind, near);
        if (i == r->points) return;
        const Lanes zx = spread(creal(r->point[i])), zy = spread(cimag(r->point[i]));
        const Lanes Nx = spread(stress ? creal(r->normal[i]) : 0), Ny = spread(stress ? cimag(r->normal[i]) : 0);
        double *H0 = locate_block(r, r->displacement, i, 0), *G0 = locate_block(r, r->traction, i, 0);
        for (int g = 0; g < count; g++) {
            locate(&kind->frame[first + g], zx, zy, &x[g], &y[g]);
            ends[g] = measure_ends(x[g], y[g]);
        }
        if (tractions && !stress) {
            memcpy(logs, ends, count * sizeof(Lanes));
            const int full = round_up(count * LANES, FUNCTION_BATCH);
            for (int g = count; g < full / LANES; g++) logs[g] = spread(1);
            take_logarithms((double *)logs, full);
        }
        for (int g = 0; g < count; g++) {
            const int64_t *element = kind->element[first + g];
            const Lanes r2 = x[g] * x[g] + y[g] * y[g];
            const int has_near = find_least(r2) < FAR_SQUARED;
            const double nearest = has_near ? find_least_beyond(r2, FAR_SQUARED) : find_least(r2);
            if (!has_near || nearest != INFINITY) {
                LaneMoments m;
                double *H[LANES], *G[LANES];
                for (int lane = 0; lane < LANES; lane++) {
                    H[lane] = H0 + 2 * (order + 1) * element[lane];
                    G[lane] = tractions ? G0 + 2 * (order + 1) * element[lane] : NULL;
                }
                evaluate_far(order, stress, choose_terms(term_limit, nearest), x[g], y[g], ends[g], &m);
                if (tractions && !stress) find_logarithmic(order, 0.5 * logs[g], &m);
                store_pairs(order, tractions, stress, &kind->factor, &kind->frame[first + g], Nx, Ny, &m, width, H, G);
            }
            if (has_near) /* done once more, in their own way */
                for (int lane = 0; lane < LANES; lane++) {
                    if (r2[lane] >= FAR_SQUARED || is_repeated(element, lane)) continue;
                    near->point[near->count] = i;
                    near->group[near->count] = first + g;
                    near->lane[near->count++] = lane;
                }
        }
    }
}

/* All points against a group of tip elements; fill_near does the pairs that are too near for the series. */
INLINE void fill_tip_group(int order, int stress, const Rows *r, const Kind *kind, Py_ssize_t group,
                           void (*fill_near)(const Rows *, Py_ssize_t, Py_ssize_t))
{
    const int64_t width = 2 * r->elements * (order + 1);
    const int64_t *element = kind->element[group];
    for (Py_ssize_t i = 0; i < r->points; i++) {
        Lanes x, y;
        LaneMoments m;
        double *H[LANES];
        for (int lane = 0; lane < LANES; lane++) H[lane] = locate_block(r, r->displacement, i, element[lane]);
        locate(&kind->frame[group], spread(creal(r->point[i])), spread(cimag(r->point[i])), &x, &y);
        locate_from_tip(kind->family, &x, &y);
        const Lanes r2 = x * x + y * y;
        const int has_near = find_least(r2) < FAR_TIP_SQUARED;
        const double nearest = has_near ? find_least_beyond(r2, FAR_TIP_SQUARED) : find_least(r2);
        if (!has_near || nearest != INFINITY) {
            evaluate_far_tip(order, stress, choose_terms(tip_term_limit, sqrt(nearest)), kind->family, x, y, &m);
            store_pairs(order, 0, stress, &kind->factor, &kind->frame[group], spread(stress ? creal(r->normal[i]) : 0),
                        spread(stress ? cimag(r->normal[i]) : 0), &m, width, H, H);
        }
        if (has_near)
            for (int lane = 0; lane < LANES; lane++)
                if (r2[lane] < FAR_TIP_SQUARED && !is_repeated(element, lane)) fill_near(r, i, element[lane]);
    }
}

/* A variant of a function for every order and every sort of rows, so that each is compiled with constants. */
#define DISPATCH(order, call)                                                                                          \
    switch (order) {                                                                                                   \
    case 0: call(0); break;                                                                                            \
    case 1: call(1); break;                                                                                            \
    case 2: call(2); break;                                                                                            \
    default: call(3);                                                                                                  \
    }

static void fill_kind(const Rows *r, const Kind *kind, Py_ssize_t first, Py_ssize_t last, NearPairs *near)
{
    const int tractions = r->traction && kind->family == BOUNDARY;
#define FILL_STRESS_BOTH(order) fill_tile(order, 1, 1, r, kind, first, last, near)
#define FILL_STRESS_ONE(order) fill_tile(order, 0, 1, r, kind, first, last, near)
#define FILL_BOTH(order) fill_tile(order, 1, 0, r, kind, first, last, near)
#define FILL_ONE(order) fill_tile(order, 0, 0, r, kind, first, last, near)
    if (r->normal && tractions)
        DISPATCH(r->order, FILL_STRESS_BOTH)
    else if (r->normal)
        DISPATCH(r->order, FILL_STRESS_ONE)
    else if (tractions)
        DISPATCH(r->order, FILL_BOTH)
    else
        DISPATCH(r->order, FILL_ONE)
}

static void fill_tips(const Rows *r, const Kind *kind, Py_ssize_t group,
                      void (*fill_near)(const Rows *, Py_ssize_t, Py_ssize_t))
{
#define FILL_TIP_STRESS(order) fill_tip_group(order, 1, r, kind, group, fill_near)
#define FILL_TIP(order) fill_tip_group(order, 0, r, kind, group, fill_near)
    if (r->normal)
        DISPATCH(r->order, FILL_TIP_STRESS)
    else
        DISPATCH(r->order, FILL_TIP)
}

/* The straight elements of a family; frame NULL if there are none or memory is short. */
static Kind prepare_kind(const Rows *r, int family)
{
    const int with_logarithm = r->traction && !r->normal;
    const int shapes = r->order + 1;
    Kind kind = {.family = family, .factor = {.kappa = r->kappa, .shear_modulus = r->shear_modulus,
                                              .log_length = r->log_length}};
    Py_ssize_t count = 0;
    for (Py_ssize_t j = 0; j < r->elements; j++) count += r->sweep[j] == 0 && r->family[j] == family;
    if (!count) return kind;
    memcpy(kind.factor.shape, r->shape + family * shapes * shapes, shapes * shapes * sizeof(double));
    for (int j = 0; j < shapes; j++)
        for (int k = 0; k < shapes; k++) kind.factor.integral[j] += kind.factor.shape[k * shapes + j] * integrate_power(k);
    kind.groups = (count + LANES - 1) / LANES;
    kind.frame = aligned_alloc(sizeof(Lanes), kind.groups * sizeof(Frame));
    kind.element = malloc(kind.groups * sizeof *kind.element);
    if (!kind.frame || !kind.element) return kind;
    Py_ssize_t at = 0;
    for (Py_ssize_t j = 0; j < r->elements; j++) {
        if (r->sweep[j] != 0 || r->family[j] != family) continue;
        do {
            Frame *f = &kind.frame[at / LANES];
            const int lane = at % LANES;
            f->mx[lane] = 0.5 * (creal(r->end[j]) + creal(r->start[j]));
            f->my[lane] = 0.5 * (cimag(r->end[j]) + cimag(r->start[j]));
            f->ex[lane] = 0.5 * (creal(r->end[j]) - creal(r->start[j]));
            f->ey[lane] = 0.5 * (cimag(r->end[j]) - cimag(r->start[j]));
            kind.element[at / LANES][lane] = j;
            at++;
        } while (at >= count && at % LANES);
    }
    for (Py_ssize_t group = 0; group < kind.groups; group++) {
        Frame *f = &kind.frame[group];
        const Lanes square = f->ex * f->ex + f->ey * f->ey;
        for (int lane = 0; lane < LANES; lane++) f->h[lane] = sqrt(square[lane]);
        f->inverse_h = 1 / f->h;
        f->ex *= f->inverse_h;
        f->ey *= f->inverse_h;
        if (with_logarithm && family == BOUNDARY) {
            Lanes batch[FUNCTION_BATCH / LANES];
            for (int i = 0; i < FUNCTION_BATCH / LANES; i++) batch[i] = square;
            take_batch_of_logarithms((double *)batch);
            f->log_h = 0.5 * batch[0];
        }
    }
    return kind;
}

static void release_kind(Kind *kind)
{
    free(kind->frame);
    free(kind->element);
}

#endif
