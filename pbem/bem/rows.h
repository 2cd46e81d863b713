/* What is asked for: rows of points on elements; the variants of the code that fills them; how blocks are stored. */
#ifndef PBEM_ROWS_H
#define PBEM_ROWS_H
#include "complex_lanes.h"
#include "moments.h"

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
    double f, ft; /* 1/(2 pi (kappa + 1)) and f/(2 G) */
    double *displacement, *traction; /* outputs: row 2 i + component, column 2 (element * shapes + j) + component */
} Rows;

/* Rows give the displacement at the points, or the traction on the normals there (theory, 7, 8). */
typedef enum { DISPLACEMENT_EQUATION, TRACTION_EQUATION, EQUATIONS } Equation;

/* What a copy of the code is compiled for: constants wherever a function that takes them is inlined. */
typedef struct {
    int order;
    Equation equation;
    int tractions; /* whether the elements carry tractions besides displacements */
} Variant;

/* The integral of U has the logarithm. */
INLINE int has_logarithm(Variant v) { return v.tractions && v.equation == DISPLACEMENT_EQUATION; }

/* Elements of one kind and family, by groups of lanes: the last one repeats where the number is not divisible. */
typedef struct {
    Py_ssize_t count;
    int family;
    const int64_t *index;
    const struct CurveKind *curve;         /* of curved elements, see curves.h */
    double shape[MAX_SHAPES * MAX_SHAPES]; /* coefficient of power k in the shape of node j: [k * shapes + j] */
    double integral[MAX_SHAPES];           /* of the shapes over [-1, 1] */
} Elements;

INLINE int is_repeated(const int64_t *element, int lane) { return lane && element[lane] == element[lane - 1]; }

/* Pairs of point and element side by side: points, normals, and where their blocks are. */
typedef struct {
    Complex z, N;
    double *H[LANES], *G[LANES];
    int64_t width; /* of a row */
} Pairs;

INLINE Pairs no_pairs(Variant v, const Rows *r)
{
    return (Pairs){.z = c_real(spread(0)), .N = c_real(spread(0)), .width = 2 * (v.order + 1) * r->elements};
}

INLINE Pairs spread_point(Variant v, const Rows *r, Py_ssize_t i)
{
    Pairs to = no_pairs(v, r);
    to.z = c_spread(r->point[i]);
    if (v.equation == TRACTION_EQUATION) to.N = c_spread(r->normal[i]);
    return to;
}

static double *locate_block(const Rows *r, double *out, Py_ssize_t point, int64_t element)
{
    const Py_ssize_t shapes = r->order + 1;
    return out ? out + 2 * shapes * (2 * point * r->elements + element) : NULL;
}

INLINE void put_pair(Variant v, const Rows *r, Py_ssize_t point, int64_t element, int lane, Pairs *to)
{
    c_put(&to->z, lane, r->point[point]);
    c_put(&to->N, lane, v.equation == TRACTION_EQUATION ? r->normal[point] : 0);
    to->H[lane] = locate_block(r, r->displacement, point, element);
    to->G[lane] = locate_block(r, r->traction, point, element);
}

/* A row's factors for every node of an element: a density a contributes P a + Q conj(a). */
typedef struct {
    Complex P[MAX_SHAPES], Q[MAX_SHAPES];
} Factors;

INLINE void store_factors(Variant v, const Factors *f, double *const *out, int64_t width)
{
    const int shapes = v.order + 1;
    Lanes xx[MAX_SHAPES], xy[MAX_SHAPES], yx[MAX_SHAPES], yy[MAX_SHAPES];
#pragma GCC unroll 4
    for (int j = 0; j < shapes; j++) {
        xx[j] = f->P[j].re + f->Q[j].re;
        xy[j] = f->Q[j].im - f->P[j].im;
        yx[j] = f->Q[j].im + f->P[j].im;
        yy[j] = f->P[j].re - f->Q[j].re;
    }
    store_row(shapes, xx, xy, out, 0);
    store_row(shapes, yx, yy, out, width);
}

/* From values for the powers to values for the nodal shapes, in place: real ones, complex ones. */
INLINE void shape_real(int shapes, const double *shape, Lanes *m)
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

INLINE void shape_complex(int shapes, const double *shape, Complex *m)
{
    Complex sum[MAX_SHAPES];
#pragma GCC unroll 4
    for (int node = 0; node < shapes; node++) {
        sum[node] = c_scale(shape[node], m[0]);
#pragma GCC unroll 4
        for (int k = 1; k < shapes; k++) sum[node] = c_add(sum[node], c_scale(shape[k * shapes + node], m[k]));
    }
#pragma GCC unroll 4
    for (int node = 0; node < shapes; node++) m[node] = sum[node];
}

#endif
