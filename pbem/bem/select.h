/* The one place where order, equation and kind of element select code.
 *
 * Rows are filled by one of few functions, each compiled once for every variant: a straight loop for that order, that
 * equation and those densities. Another kind of curved element is a header like arcs.h and a line in KINDS; where its
 * integrals are closed in another way, a function that fills its rows and a line in FILLS.
 */
#ifndef PBEM_SELECT_H
#define PBEM_SELECT_H
#include <stdlib.h>

#include "arcs.h"
#include "fill_curves.h"
#include "fill_straight.h"

/*       kind          its elements, if not of a line above          filled by      functions of the curve */
#define KINDS(LINE)                                                                                    \
    LINE(STRAIGHT,     r->sweep[j] == 0 && !is_tip(r->family[j]),    fill_straight, NULL)              \
    LINE(STRAIGHT_TIP, r->sweep[j] == 0,                             fill_tips,     NULL)              \
    LINE(ARC,          1,                                            fill_curves,   &ARCS)

/*       function       densities */
#define FILLS(LINE)                                                                                    \
    LINE(fill_straight, WITH_TRACTIONS)                                                                \
    LINE(fill_tips,     JUMPS)                                                                         \
    LINE(fill_curves,   WITH_TRACTIONS)

#define WITH_TRACTIONS(LINE, fill) JUMPS(LINE, fill) EACH_EQUATION(LINE, fill, 1)
#define JUMPS(LINE, fill) EACH_EQUATION(LINE, fill, 0)
#define EACH_EQUATION(LINE, fill, tractions)                                                           \
    EACH_ORDER(LINE, fill, tractions, DISPLACEMENT_EQUATION)                                           \
    EACH_ORDER(LINE, fill, tractions, TRACTION_EQUATION)
#define EACH_ORDER(LINE, fill, tractions, equation)                                                    \
    LINE(fill, tractions, equation, 0)                                                                 \
    LINE(fill, tractions, equation, 1)                                                                 \
    LINE(fill, tractions, equation, 2)                                                                 \
    LINE(fill, tractions, equation, 3)

typedef int Fill(const Rows *, const Elements *);

#define DEFINE(fill, tractions, equation, order)                                                       \
    static int fill##_##tractions##_##equation##_##order(const Rows *r, const Elements *of)            \
    {                                                                                                  \
        return fill((Variant){order, equation, tractions}, r, of);                                     \
    }
#define DEFINE_ALL(fill, densities) densities(DEFINE, fill)
FILLS(DEFINE_ALL)

#define ENTER(fill, tractions, equation, order)                                                        \
    [tractions][equation][order] = fill##_##tractions##_##equation##_##order,
#define ENTER_ALL(fill, densities)                                                                     \
    static Fill *const fill##_variants[2][EQUATIONS][MAX_SHAPES] = {densities(ENTER, fill)};
FILLS(ENTER_ALL)

#define NAME(kind, holds, fill, curve) kind,
enum { KINDS(NAME) KIND_COUNT };

#define FIND(kind, holds, fill, curve)                                                                 \
    if (holds) return kind;
static int find_kind(const Rows *r, Py_ssize_t j) { KINDS(FIND) return KIND_COUNT; }

#define LIST(kind, holds, fill, curve) {fill##_variants, curve},
static const struct {
    Fill *const (*variants)[EQUATIONS][MAX_SHAPES];
    const CurveKind *curve;
} kinds[] = {KINDS(LIST)};

static Elements select_elements(const Rows *r, int kind, int family, int64_t *index)
{
    const int shapes = r->order + 1;
    const double *shape = r->shape + family * shapes * shapes;
    Elements to = {.family = family, .index = index, .curve = kinds[kind].curve};
    for (Py_ssize_t j = 0; j < r->elements; j++)
        if (r->family[j] == family && find_kind(r, j) == kind) index[to.count++] = j;
    memcpy(to.shape, shape, shapes * shapes * sizeof(double));
    for (int j = 0; j < shapes; j++)
        for (int k = 0; k < shapes; k++) to.integral[j] += shape[k * shapes + j] * integrate_power(k);
    return to;
}

/* Returns 0 if memory is short. */
static int fill_rows(const Rows *r)
{
    const Equation equation = r->normal ? TRACTION_EQUATION : DISPLACEMENT_EQUATION;
    int64_t *index = malloc((r->elements + 1) * sizeof *index);
    Py_ssize_t count[KIND_COUNT][FAMILIES] = {{0}};
    int enough = index != NULL;
    for (Py_ssize_t j = 0; j < r->elements; j++) count[find_kind(r, j)][r->family[j]]++;
    for (int kind = 0; kind < KIND_COUNT; kind++)
        for (int family = 0; family < FAMILIES; family++) {
            if (!enough || !count[kind][family]) continue;
            const Elements elements = select_elements(r, kind, family, index);
            const int tractions = r->traction && family == BOUNDARY;
            enough = kinds[kind].variants[tractions][equation][r->order](r, &elements);
        }
    free(index);
    return enough;
}

#endif
