/* Rows of straight elements: several pairs at a time, those near each other apart. */
#ifndef PBEM_FILL_STRAIGHT_H
#define PBEM_FILL_STRAIGHT_H
#include "combine.h"

/* Groups of lanes that are done for one point after the other; pairs near each other that are done together. */
#define TILE (128 / LANES)
#define MOST_NEAR 256

static int round_up(int count, int step) { return (count + step - 1) / step * step; }

typedef struct {
    int count;
    int64_t point[MOST_NEAR];
    int group[MOST_NEAR], lane[MOST_NEAR];
} NearPairs;

/* Some groups of the elements: where the elements lie, their numbers, and the pairs that are near. */
typedef struct {
    int groups;
    Frame frame[TILE];
    int64_t element[TILE][LANES];
    NearPairs near;
} Tile;

/* A group's length is needed with the logarithm alone (theory, 16). */
APART void prepare_tile(const Rows *r, const Elements *of, Py_ssize_t first, int with_logarithm, Tile *tile)
{
    const Py_ssize_t left = (of->count - first + LANES - 1) / LANES;
    tile->groups = left < TILE ? (int)left : TILE;
    tile->near.count = 0;
    for (int g = 0; g < tile->groups; g++) {
        Frame *f = &tile->frame[g];
        for (int lane = 0; lane < LANES; lane++) {
            const Py_ssize_t at = first + g * LANES + lane, last = of->count - 1;
            const int64_t j = tile->element[g][lane] = of->index[at < last ? at : last];
            c_put(&f->m, lane, 0.5 * (r->end[j] + r->start[j]));
            c_put(&f->e, lane, 0.5 * (r->end[j] - r->start[j]));
        }
        const Lanes square = c_norm(f->e);
        for (int lane = 0; lane < LANES; lane++) f->h[lane] = sqrt(square[lane]);
        f->inverse_h = 1 / f->h;
        f->e = c_scale(f->inverse_h, f->e);
        if (!with_logarithm) continue;
        Lanes batch[FUNCTION_BATCH / LANES];
        for (int i = 0; i < FUNCTION_BATCH / LANES; i++) batch[i] = square;
        take_batch_of_logarithms((double *)batch);
        f->log_h = 0.5 * batch[0];
    }
}

/* A point beside a group's elements; row_H, row_G: where its rows begin. */
INLINE void turn_to_group(Variant v, double *row_H, double *row_G, const int64_t *element, Pairs *to)
{
    for (int lane = 0; lane < LANES; lane++) {
        to->H[lane] = row_H + 2 * (v.order + 1) * element[lane];
        to->G[lane] = v.tractions ? row_G + 2 * (v.order + 1) * element[lane] : NULL;
    }
}

/* The lanes of a group that are nearer than the limit join the near pairs, which are done in their own way. */
INLINE void note_near(NearPairs *near, Py_ssize_t point, int group, const int64_t *element, Lanes r2, double limit)
{
    for (int lane = 0; lane < LANES; lane++) {
        if (r2[lane] >= limit || is_repeated(element, lane)) continue;
        near->point[near->count] = point;
        near->group[near->count] = group;
        near->lane[near->count++] = lane;
    }
}

/* Near pairs side by side: their elements, points as these see them, and whether they lie off (1) or on them (0). */
typedef struct {
    Frame frame;
    Pairs pairs;
    Complex w;
    Lanes off;
} NearLanes;

INLINE void gather_pairs(Variant v, const Rows *r, const Tile *tile, int first, NearLanes *to)
{
    const NearPairs *near = &tile->near;
    to->pairs = no_pairs(v, r);
    for (int lane = 0; lane < LANES; lane++) {
        const int pair = first + lane < near->count ? first + lane : near->count - 1, from = near->lane[pair];
        const Frame *g = &tile->frame[near->group[pair]];
        const int64_t i = near->point[pair], j = tile->element[near->group[pair]][from];
        c_put(&to->frame.m, lane, g->m.re[from] + I * g->m.im[from]);
        c_put(&to->frame.e, lane, g->e.re[from] + I * g->e.im[from]);
        to->frame.h[lane] = g->h[from];
        to->frame.inverse_h[lane] = g->inverse_h[from];
        to->frame.log_h[lane] = g->log_h[from];
        to->off[lane] = r->on[i] != j;
        put_pair(v, r, i, j, lane, &to->pairs);
    }
    to->w = locate(&to->frame, to->pairs.z);
    to->w.im *= to->off; /* on the element the distance from its line is rounding */
}

/* Pairs near each other, by the closed form (theory, 21, 22). */
INLINE void fill_near_pairs(Variant v, const Rows *r, const Elements *of, Tile *tile)
{
    NearLanes all[MOST_NEAR / LANES];
    Lanes log_ratio[MOST_NEAR / LANES], log_ends[MOST_NEAR / LANES];
    Lanes along[MOST_NEAR / LANES], angle[MOST_NEAR / LANES];
    const int count = round_up(tile->near.count, FUNCTION_BATCH);
    for (int p = 0; p < count / LANES; p++) {
        gather_pairs(v, r, tile, p * LANES, &all[p]);
        const Complex w = all[p].w;
        const Lanes right = measure_end(w, 1), left = measure_end(w, -1);
        log_ratio[p] = right / left;
        log_ends[p] = right * left;
        along[p] = (w.re - 1) * (w.re + 1) + w.im * w.im;
        angle[p] = 2 * w.im;
    }
    take_logarithms((double *)log_ratio, count);
    if (has_logarithm(v)) take_logarithms((double *)log_ends, count);
    take_arguments((double *)angle, (const double *)along, count);
    for (int p = 0; p < count / LANES; p++) {
        const NearLanes *to = &all[p];
        LaneMoments m;
        /* no angle is subtended on the element */
        evaluate_near(v, to->w, 0.5 * log_ratio[p], to->off * angle[p], &m);
        if (has_logarithm(v)) find_logarithmic(v.order, 0.5 * log_ends[p], &m);
        store_straight(v, r, of, &to->frame, &m, &to->pairs);
    }
    tile->near.count = 0;
}

/* The same for tip elements (theory, 24). */
INLINE void fill_near_tips(Variant v, const Rows *r, const Elements *of, Tile *tile)
{
    for (int p = 0; p < tile->near.count; p += LANES) {
        NearLanes to;
        LaneMoments m;
        gather_pairs(v, r, tile, p, &to);
        for (int lane = 0; lane < LANES; lane++)
            put_near_tip(v.order, of->family, to.w.re[lane] + I * to.w.im[lane], to.off[lane] == 0, lane, &m);
        store_straight(v, r, of, &to.frame, &m, &to.pairs);
    }
    tile->near.count = 0;
}

/* The least distance from which the series is summed; infinity if all lanes are near. */
INLINE double find_nearest(Lanes r2, double limit, int has_near)
{
    return has_near ? find_least_beyond(r2, limit) : find_least(r2);
}

/* All points against the groups of a tile with polynomial shapes. */
INLINE void fill_tile(Variant v, const Rows *rows, const Elements *of, Tile *tile)
{
    const Rows copy = *rows, *r = &copy; /* which no store into the rows can change: constants stay in registers */
    const int groups = tile->groups;
    Complex w[TILE];
    Lanes ends[TILE], logs[TILE];
    for (Py_ssize_t i = 0;; i++) {
        /* called at one place: two copies would differ in rounding */
        if (tile->near.count > MOST_NEAR - TILE * LANES || (i == r->points && tile->near.count))
            fill_near_pairs(v, r, of, tile);
        if (i == r->points) return;
        Pairs pairs = spread_point(v, r, i);
        double *row_H = locate_block(r, r->displacement, i, 0), *row_G = locate_block(r, r->traction, i, 0);
        for (int g = 0; g < groups; g++) {
            w[g] = locate(&tile->frame[g], pairs.z);
            ends[g] = measure_ends(w[g]);
        }
        if (has_logarithm(v)) {
            memcpy(logs, ends, groups * sizeof(Lanes));
            const int full = round_up(groups * LANES, FUNCTION_BATCH);
            for (int g = groups; g < full / LANES; g++) logs[g] = spread(1);
            take_logarithms((double *)logs, full);
        }
        for (int g = 0; g < groups; g++) {
            const Lanes r2 = c_norm(w[g]);
            const int has_near = find_least(r2) < FAR_SQUARED;
            const double nearest = find_nearest(r2, FAR_SQUARED, has_near);
            if (!has_near || nearest != INFINITY) {
                LaneMoments m;
                turn_to_group(v, row_H, row_G, tile->element[g], &pairs);
                evaluate_far(v, choose_terms(term_limit, nearest), w[g], ends[g], &m);
                if (has_logarithm(v)) find_logarithmic(v.order, 0.5 * logs[g], &m);
                store_straight(v, r, of, &tile->frame[g], &m, &pairs);
            }
            if (has_near) note_near(&tile->near, i, g, tile->element[g], r2, FAR_SQUARED);
        }
    }
}

/* The same with the shapes of tips. */
INLINE void fill_tip_tile(Variant v, const Rows *rows, const Elements *of, Tile *tile)
{
    const Rows copy = *rows, *r = &copy; /* which no store into the rows can change: constants stay in registers */
    for (Py_ssize_t i = 0;; i++) {
        if (tile->near.count > MOST_NEAR - TILE * LANES || (i == r->points && tile->near.count))
            fill_near_tips(v, r, of, tile);
        if (i == r->points) return;
        Pairs pairs = spread_point(v, r, i);
        double *row_H = locate_block(r, r->displacement, i, 0);
        for (int g = 0; g < tile->groups; g++) {
            const Complex q = locate_from_tip(of->family, locate(&tile->frame[g], pairs.z));
            const Lanes r2 = c_norm(q);
            const int has_near = find_least(r2) < FAR_TIP_SQUARED;
            const double nearest = find_nearest(r2, FAR_TIP_SQUARED, has_near);
            if (!has_near || nearest != INFINITY) {
                LaneMoments m;
                turn_to_group(v, row_H, NULL, tile->element[g], &pairs);
                evaluate_far_tip(v, choose_terms(tip_term_limit, sqrt(nearest)), of->family, q, &m);
                store_straight(v, r, of, &tile->frame[g], &m, &pairs);
            }
            if (has_near) note_near(&tile->near, i, g, tile->element[g], r2, FAR_TIP_SQUARED);
        }
    }
}

/* All points against straight elements; the two below are lines of the table in select.h. */
INLINE int fill_straight(Variant v, const Rows *r, const Elements *of)
{
    Tile tile;
    for (Py_ssize_t first = 0; first < of->count; first += TILE * LANES) {
        prepare_tile(r, of, first, has_logarithm(v), &tile);
        fill_tile(v, r, of, &tile);
    }
    return 1;
}

INLINE int fill_tips(Variant v, const Rows *r, const Elements *of)
{
    Tile tile;
    for (Py_ssize_t first = 0; first < of->count; first += TILE * LANES) {
        prepare_tile(r, of, first, 0, &tile);
        fill_tip_tile(v, r, of, &tile);
    }
    return 1;
}

#endif
