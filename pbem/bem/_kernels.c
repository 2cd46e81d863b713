/* Integrals of the elastic kernels over straight elements, in closed form.
 *
 * A point or vector of the plane is one complex number. An element has mid-point m, half-length h and unit direction e
 * (region on the left, outward normal -i e). Its coordinate is s in [-1, 1], in units of h, and a collocation point z
 * is seen from it at w = (z - m) conj(e) / h. Everything comes from the moments of a density s^k
 *
 *     c_k = int s^k / (s - w) ds,   d_k = dc_k/dw,   e_k = dd_k/dw,   n_k = int s^k ln|w - s| ds,
 *
 * by one complex logarithm and upward recursion near the element. Far from it the upward recursion loses digits like
 * |w|^k; there the highest moment is summed as a series in 1/w and the others follow by the downward recursion,
 * which is stable. A tip element carries the densities t^(k + 1/2), t in [0, 1] the distance from the tip in units
 * of the element's length; its moments obey recursions of the same kind.
 *
 * The potentials (Kolosov-Muskhelishvili) turn the moments into complex factors P, Q: a density a s^k contributes
 * P a + Q conj(a). Rows give the value at the point as  A u + B t, with u, t the nodal displacements and tractions.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "arcs.h"
#include "moments.h"

typedef struct {
    Py_ssize_t points, elements;
    const cplx *point, *normal, *start, *end, *center;
    const double *sweep;           /* angle through which an arc turns; 0 for a straight element */
    const int64_t *on;             /* element on which the point lies, or -1 */
    const double *on_local;        /* the point's coordinate s on that element */
    const double *local;           /* coordinates of an element's nodes */
    const int8_t *family;          /* BOUNDARY, TIP_AT_START, TIP_AT_END, CRACK */
    const double *shape;           /* coefficient of power k in shape j of a family: [(family * shapes + k) * shapes + j] */
    int order;
    double kappa, shear_modulus, log_length;
    double *displacement, *traction; /* outputs: row 2 i + component, column 2 (element * shapes + j) + component */
} Rows;

/* Write the real 2 x 2 block of a -> P a + Q conj(a). */
static inline void put_block(double *out, Py_ssize_t width, cplx P, cplx Q)
{
    out[0] = creal(P) + creal(Q);
    out[1] = cimag(Q) - cimag(P);
    out[width] = cimag(P) + cimag(Q);
    out[width + 1] = creal(P) - creal(Q);
}

/* From factors of powers to factors of nodal values; weight (per node) may be NULL. */
static void put_shapes(double *out, Py_ssize_t width, int shapes, const double *shape, const double *weight, const cplx *P,
                       const cplx *Q)
{
    for (int j = 0; j < shapes; j++) {
        cplx p = 0, q = 0;
        for (int k = 0; k < shapes; k++) {
            p += shape[k * shapes + j] * P[k];
            q += shape[k * shapes + j] * Q[k];
        }
        const double w = weight ? weight[j] : 1.0;
        put_block(out + 2 * j, width, w * p, w * q);
    }
}

typedef struct {
    cplx Pu[MAX_SHAPES], Qu[MAX_SHAPES], Pt[MAX_SHAPES], Qt[MAX_SHAPES];
} Factors;

/* Factors of the displacement at the point: -int T u for the density u, int U t for the density t. */
static void combine_displacement(const Rows *r, const Moments *m, double h, cplx e, int tractions, Factors *out)
{
    const double kappa = r->kappa, fu = 1 / (2 * M_PI * (kappa + 1));
    const double ft = -h / (4 * M_PI * r->shear_modulus * (kappa + 1)), log_h = log(h) - r->log_length;
    for (int k = 0; k <= r->order; k++) {
        out->Pu[k] = fu * ((kappa + 1) * cimag(m->c[k]) + I * (1 - kappa) * creal(m->c[k]));
        out->Qu[k] = fu * 2 * m->y * e * e * conj(m->d[k]);
        if (!tractions) continue;
        out->Pt[k] = ft * 2 * kappa * (m->n[k] + m->l[k] * log_h);
        out->Qt[k] = -ft * e * e * (m->l[k] - 2 * I * m->y * conj(m->c[k]));
    }
}

/* Factors of the traction on the normal N at the point. */
static void combine_traction(const Rows *r, const Moments *m, double h, cplx e, cplx N, int tractions, Factors *out)
{
    const double kappa = r->kappa, g = r->shear_modulus / (M_PI * (kappa + 1) * h), f = -1 / (2 * M_PI * (kappa + 1));
    const cplx e3 = e * e * e;
    for (int k = 0; k <= r->order; k++) {
        const cplx c = conj(m->c[k]), d = conj(m->d[k]);
        out->Pu[k] = g * I * (e * d * conj(N) - conj(e * d) * N);
        out->Qu[k] = g * (I * e * d * N + e3 * (I * d + 2 * m->y * conj(m->e[k])) * conj(N));
        if (!tractions) continue;
        out->Pt[k] = -f * (conj(e * c) * N + kappa * e * c * conj(N));
        out->Qt[k] = f * (-e * c * N + e3 * (2 * I * m->y * d - c) * conj(N));
    }
}

/* The same two for an arc. */
static void combine_arc_displacement(const Rows *r, const ArcMoments *m, int tractions, Factors *out)
{
    const double kappa = r->kappa, fu = 1 / (2 * M_PI * (kappa + 1)), ft = -1 / (4 * M_PI * r->shear_modulus * (kappa + 1));
    for (int k = 0; k <= r->order; k++) {
        out->Pu[k] = fu * ((kappa + 1) * cimag(m->c[k]) + I * (1 - kappa) * creal(m->c[k]));
        out->Qu[k] = fu * I * conj(m->q[k]);
        if (!tractions) continue;
        out->Pt[k] = ft * 2 * kappa * (m->n[k] - m->l[k] * r->log_length);
        out->Qt[k] = -ft * conj(m->s[k]);
    }
}

static void combine_arc_traction(const Rows *r, const ArcMoments *m, cplx N, int tractions, Factors *out)
{
    const double kappa = r->kappa, g = r->shear_modulus / (M_PI * (kappa + 1)), f = -1 / (2 * M_PI * (kappa + 1));
    for (int k = 0; k <= r->order; k++) {
        const cplx d = m->d[k], x = m->x[k];
        out->Pu[k] = g * I * (conj(d * N) - d * N);
        out->Qu[k] = g * I * (conj(d) * N + conj(m->dq[k] * N));
        if (!tractions) continue;
        out->Pt[k] = -f * (x * N + kappa * conj(x * N));
        out->Qt[k] = -f * (conj(x) * N + conj(m->y[k] * N));
    }
}

static void evaluate_straight(const Rows *r, Py_ssize_t i, Py_ssize_t j, int tractions, Factors *out)
{
    const cplx half = 0.5 * (r->end[j] - r->start[j]), middle = 0.5 * (r->end[j] + r->start[j]);
    const double h = cabs(half);
    const cplx e = half / h, w = (r->point[i] - middle) * conj(e) / h;
    Moments m;
    if (is_tip(r->family[j]))
        evaluate_tip_moments(w, r->on[i] == j, r->order, r->family[j], &m);
    else
        evaluate_moments(w, r->on[i] == j, r->order, &m);
    if (r->normal)
        combine_traction(r, &m, h, e, r->normal[i], tractions, out);
    else
        combine_displacement(r, &m, h, e, tractions, out);
}

static void evaluate_arc(const Rows *r, const Arc *arc, Py_ssize_t i, Py_ssize_t j, int tractions, Factors *out)
{
    ArcMoments m;
    evaluate_arc_moments(arc, r->point[i], r->on[i] == j, r->on_local[i], &m);
    if (r->normal)
        combine_arc_traction(r, &m, r->normal[i], tractions, out);
    else
        combine_arc_displacement(r, &m, tractions, out);
}

/* arcs: one for every element, prepared where the element is an arc. */
static void fill_rows(const Rows *r, const Arc *arcs)
{
    const int shapes = r->order + 1;
    const Py_ssize_t width = 2 * r->elements * shapes;
    for (Py_ssize_t i = 0; i < r->points; i++) {
        for (Py_ssize_t j = 0; j < r->elements; j++) {
            const int family = r->family[j], tractions = r->traction && family == BOUNDARY, is_arc = r->sweep[j] != 0;
            const double *shape = r->shape + family * shapes * shapes;
            const Py_ssize_t at = 2 * i * width + 2 * j * shapes;
            Factors f;
            if (is_arc)
                evaluate_arc(r, &arcs[j], i, j, tractions, &f);
            else
                evaluate_straight(r, i, j, tractions, &f);
            put_shapes(r->displacement + at, width, shapes, shape, NULL, f.Pu, f.Qu);
            if (tractions)
                put_shapes(r->traction + at, width, shapes, shape, is_arc ? arcs[j].node_weight : NULL, f.Pt, f.Qt);
        }
    }
}

/* Prepared arcs, one slot an element; NULL if there are none (*count is 0) or memory is short. */
static Arc *prepare_arcs(const Rows *r, Py_ssize_t *count)
{
    *count = 0;
    for (Py_ssize_t j = 0; j < r->elements; j++) *count += r->sweep[j] != 0;
    Arc *arcs = *count ? malloc(r->elements * sizeof(Arc)) : NULL;
    for (Py_ssize_t j = 0; arcs && j < r->elements; j++)
        if (r->sweep[j] != 0)
            prepare_arc(&arcs[j], r->start[j], r->center[j], r->sweep[j], r->order, r->family[j], r->local);
    return arcs;
}

static int has_length(const Py_buffer *b, Py_ssize_t bytes, const char *name)
{
    if (b->len == bytes) return 1;
    PyErr_Format(PyExc_ValueError, "%s has %zd bytes, expected %zd", name, b->len, bytes);
    return 0;
}

PyDoc_STRVAR(rows_doc,
"rows(point, on, on_local, start, end, center, sweep, family, local, shape, kappa,\n"
"     shear_modulus, length, displacement, normal, traction)\n\n"
"Fill displacement and traction (float64, (2 n, 2 m shapes), C order) so that the displacement at the points (normal\n"
"is None), or the traction on the normals there, is displacement @ u + traction @ t. traction may be None.\n"
"point, normal (n), start, end, center (m): complex128; on: int64 (n); on_local: float64 (n); sweep: float64 (m), 0 for\n"
"a straight element; family: int8 (m): 0 boundary, 1, 2 tip at start or end, 3 crack; local: float64 (shapes), of\n"
"boundary elements; shape: float64 (4, shapes, shapes), family by power by node.\n"
"length: unit of the logarithm of the displacement kernel.");

enum { POINT, ON, ON_LOCAL, START, END, CENTER, SWEEP, FAMILY, LOCAL, SHAPE, OUT, NORMAL, TRACTION, BUFFERS };

static int check_lengths(const Py_buffer *b, Py_ssize_t n, Py_ssize_t m, Py_ssize_t shapes)
{
    const Py_ssize_t square = FAMILIES * shapes * shapes * sizeof(double), full = 4 * n * m * shapes * sizeof(double);
    return has_length(&b[ON], n * sizeof(int64_t), "on") && has_length(&b[ON_LOCAL], n * sizeof(double), "on_local") &&
           has_length(&b[END], m * sizeof(cplx), "end") && has_length(&b[CENTER], m * sizeof(cplx), "center") &&
           has_length(&b[SWEEP], m * sizeof(double), "sweep") && has_length(&b[FAMILY], m, "family") &&
           has_length(&b[SHAPE], square, "shape") && has_length(&b[OUT], full, "displacement") &&
           (!b[NORMAL].buf || has_length(&b[NORMAL], n * sizeof(cplx), "normal")) &&
           (!b[TRACTION].buf || has_length(&b[TRACTION], full, "traction"));
}

static PyObject *rows(PyObject *self, PyObject *args)
{
    PyObject *normal, *traction, *result = NULL;
    Py_buffer b[BUFFERS];
    double kappa, shear_modulus, length;
    memset(b, 0, sizeof b);
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*y*y*y*y*y*dddw*OO", &b[POINT], &b[ON], &b[ON_LOCAL], &b[START], &b[END],
                          &b[CENTER], &b[SWEEP], &b[FAMILY], &b[LOCAL], &b[SHAPE], &kappa, &shear_modulus, &length, &b[OUT], &normal, &traction))
        return NULL;
    if (normal != Py_None && PyObject_GetBuffer(normal, &b[NORMAL], PyBUF_SIMPLE) < 0) goto end;
    if (traction != Py_None && PyObject_GetBuffer(traction, &b[TRACTION], PyBUF_WRITABLE) < 0) goto end;
    const Py_ssize_t n = b[POINT].len / sizeof(cplx), m = b[START].len / sizeof(cplx);
    const Py_ssize_t shapes = b[LOCAL].len / sizeof(double);
    if (shapes < 1 || shapes > MAX_SHAPES) {
        PyErr_SetString(PyExc_ValueError, "an element has 1 to 4 shapes");
        goto end;
    }
    if (!check_lengths(b, n, m, shapes)) goto end;
    const Rows r = {
        .points = n, .elements = m, .point = b[POINT].buf, .normal = b[NORMAL].buf, .start = b[START].buf,
        .end = b[END].buf, .center = b[CENTER].buf, .sweep = b[SWEEP].buf, .on = b[ON].buf, .on_local = b[ON_LOCAL].buf,
        .local = b[LOCAL].buf, .family = b[FAMILY].buf, .shape = b[SHAPE].buf, .order = (int)shapes - 1, .kappa = kappa, .shear_modulus = shear_modulus,
        .log_length = log(length), .displacement = b[OUT].buf, .traction = b[TRACTION].buf,
    };
    for (Py_ssize_t j = 0; j < m; j++)
        if (fabs(r.sweep[j]) > ARC_LARGEST) {
            PyErr_SetString(PyExc_ValueError, "an element turns by more than half a circle");
            goto end;
        }
    Py_ssize_t count;
    Arc *arcs = prepare_arcs(&r, &count);
    if (count && !arcs) {
        PyErr_NoMemory();
        goto end;
    }
    Py_BEGIN_ALLOW_THREADS
    fill_rows(&r, arcs);
    Py_END_ALLOW_THREADS
    free(arcs);
    result = Py_NewRef(Py_None);
end:
    for (int i = 0; i < BUFFERS; i++)
        if (b[i].obj) PyBuffer_Release(&b[i]);
    return result;
}

static PyMethodDef methods[] = {{"rows", rows, METH_VARARGS, rows_doc}, {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_kernels", "Closed-form integrals of the elastic kernels over straight elements.", 0, methods,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__kernels(void) { return PyModule_Create(&module); }
