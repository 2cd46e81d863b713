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
#include <complex.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

typedef double complex cplx;

#define MAX_ORDER 3
#define MAX_SHAPES (MAX_ORDER + 1)
enum { NO_TIP = 0, TIP_AT_START = 1, TIP_AT_END = 2 };

typedef struct {
    cplx c[MAX_SHAPES + 1], d[MAX_SHAPES], e[MAX_SHAPES];
    double n[MAX_SHAPES], l[MAX_SHAPES]; /* l_k = int s^k ds */
    double y;                            /* Im w, in units of h */
} Moments;

/* Beyond this |w|^2 the series in 1/w is used; at it, upward recursion to k = 4 loses a factor of about 40. */
static const double FAR_SQUARED = 6.25;

/* Terms of a series in q = 1/|w|^2 (or 1/|w|) that reach rounding: the least K with q^K < 1e-17. */
static int count_terms(double inverse_ratio)
{
    return 1 + (int)(39.2 / log(inverse_ratio));
}

static void evaluate_moments(cplx w, int on_element, int order, Moments *m)
{
    const double x = creal(w), y = on_element ? 0.0 : cimag(w);
    const double r2 = x * x + y * y;
    /* |w^2 - 1|^2 = |w - 1|^2 |w + 1|^2, without cancellation near the ends */
    const double right = (x - 1) * (x - 1) + y * y, left = (x + 1) * (x + 1) + y * y;
    const double log_ends = 0.5 * log(right * left);
    const int top = order + 1;
    m->y = y;
    w = x + I * y;
    for (int k = 0; k <= order; k++) m->l[k] = (k % 2) ? 0.0 : 2.0 / (k + 1);

    if (r2 < FAR_SQUARED) {
        /* |w|^2 - 1, without cancellation near the ends */
        const double angle = on_element ? 0.0 : atan2(2 * y, (x - 1) * (x + 1) + y * y);
        const cplx below = 1 / (w - 1), above = 1 / (w + 1);
        m->c[0] = 0.5 * log(right / left) + I * angle;
        m->d[0] = below - above;
        m->e[0] = above * above - below * below;
        for (int k = 0; k < top; k++) {
            const double l = (k % 2) ? 0.0 : 2.0 / (k + 1);
            m->c[k + 1] = w * m->c[k] + l;
        }
        for (int k = 0; k < order; k++) {
            m->d[k + 1] = w * m->d[k] + m->c[k];
            m->e[k + 1] = w * m->e[k] + 2 * m->d[k];
        }
    } else {
        const cplx v = conj(w) / r2, v2 = v * v;
        const int terms = count_terms(r2);
        cplx c = 0, d = 0, e = 0;
        /* c_top = - sum over j = top (mod 2), j += 2 of 2/(top + j + 1) v^(j + 1); Horner in v^2 */
        const int first = top % 2;
        for (int i = terms; i >= 0; i--) {
            const int j = first + 2 * i;
            const double a = -2.0 / (top + j + 1);
            c = c * v2 + a;
            d = d * v2 - a * (j + 1);
            e = e * v2 + a * (j + 1) * (j + 2);
        }
        const cplx lead = first ? v2 : v;
        m->c[top] = c * lead;
        cplx d_above = d * lead * v, e_above = e * lead * v2;
        for (int k = order; k >= 0; k--) {
            const double l = (k % 2) ? 0.0 : 2.0 / (k + 1);
            m->c[k] = v * (m->c[k + 1] - l);
            m->d[k] = d_above = v * (d_above - m->c[k]);
            m->e[k] = e_above = v * (e_above - 2 * m->d[k]);
        }
    }
    for (int k = 0; k <= order; k++) {
        const double ends = (k % 2) ? creal(m->c[0]) : log_ends;
        m->n[k] = (ends - creal(m->c[k + 1])) / (k + 1);
    }
}

/* Moments of t^(k + 1/2) seen from the tip; brought to the element's own coordinate, units and direction. */
static void evaluate_tip_moments(cplx w, int on_element, int order, int tip, Moments *m)
{
    const double sign = tip == TIP_AT_START ? 1.0 : -1.0;
    m->y = on_element ? 0.0 : cimag(w);
    /* distance from the tip over the length: (1 + w)/2 at the start; at the end the axis is reversed, (1 - w)/2 */
    const cplx q = 0.5 * (1 + sign * (creal(w) + I * m->y));
    const double r2 = creal(q) * creal(q) + cimag(q) * cimag(q);
    if (r2 < 4.0) {
        const cplx root = csqrt(q), sum = root + 1;
        /* q - 1 = (root - 1)(root + 1), without cancellation near the other end */
        const cplx rest = 0.5 * (sign * (creal(w) + I * m->y) - 1), ratio = rest / (sum * sum);
        const cplx logarithm = on_element ? log(-creal(ratio)) : clog(ratio);
        m->c[0] = 2 + root * logarithm;
        m->d[0] = logarithm / (2 * root) + 1 / rest;
        m->e[0] = -logarithm / (4 * q * root) + 1 / (2 * q * rest) - 1 / (rest * rest);
        for (int k = 0; k < order; k++) {
            m->c[k + 1] = q * m->c[k] + 1 / (k + 1.5);
            m->d[k + 1] = q * m->d[k] + m->c[k];
            m->e[k + 1] = q * m->e[k] + 2 * m->d[k];
        }
    } else {
        const cplx v = conj(q) / r2;
        const int terms = count_terms(sqrt(r2));
        cplx c = 0, d = 0, e = 0;
        for (int j = terms; j >= 0; j--) {
            const double a = -1.0 / (order + j + 1.5);
            c = c * v + a;
            d = d * v - a * (j + 1);
            e = e * v + a * (j + 1) * (j + 2);
        }
        m->c[order] = c * v;
        m->d[order] = d * v * v;
        m->e[order] = e * v * v * v;
        for (int k = order - 1; k >= 0; k--) {
            m->c[k] = v * (m->c[k + 1] - 1 / (k + 1.5));
            m->d[k] = v * (m->d[k + 1] - m->c[k]);
            m->e[k] = v * (m->e[k + 1] - 2 * m->d[k]);
        }
    }
    for (int k = 0; k <= order; k++) {
        m->c[k] *= sign;
        m->d[k] *= 0.5;
        m->e[k] *= 0.25 * sign;
    }
}

typedef struct {
    Py_ssize_t points, elements;
    const cplx *point, *normal, *start, *end;
    const int64_t *on;             /* element on which the point lies, or -1 */
    const int8_t *tip;             /* NO_TIP, TIP_AT_START, TIP_AT_END */
    const double *shape, *shape_tip_start, *shape_tip_end; /* coefficient of power k in shape j: [k * shapes + j] */
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

static void put_shapes(double *out, Py_ssize_t width, int shapes, const double *shape, const cplx *P, const cplx *Q)
{
    for (int j = 0; j < shapes; j++) {
        cplx p = 0, q = 0;
        for (int k = 0; k < shapes; k++) {
            p += shape[k * shapes + j] * P[k];
            q += shape[k * shapes + j] * Q[k];
        }
        put_block(out + 2 * j, width, p, q);
    }
}

/* Factors of the displacement at the point: -int T u for the density u, int U t for the density t. */
static void combine_displacement(const Rows *r, const Moments *m, double h, cplx e, cplx *Pu, cplx *Qu, cplx *Pt, cplx *Qt)
{
    const double kappa = r->kappa, fu = 1 / (2 * M_PI * (kappa + 1));
    const double ft = -h / (4 * M_PI * r->shear_modulus * (kappa + 1)), log_h = log(h) - r->log_length;
    for (int k = 0; k <= r->order; k++) {
        Pu[k] = fu * ((kappa + 1) * cimag(m->c[k]) + I * (1 - kappa) * creal(m->c[k]));
        Qu[k] = fu * 2 * m->y * e * e * conj(m->d[k]);
        if (!Pt) continue;
        Pt[k] = ft * 2 * kappa * (m->n[k] + m->l[k] * log_h);
        Qt[k] = -ft * e * e * (m->l[k] - 2 * I * m->y * conj(m->c[k]));
    }
}

/* Factors of the traction on the normal N at the point. */
static void combine_traction(const Rows *r, const Moments *m, double h, cplx e, cplx N, cplx *Pu, cplx *Qu, cplx *Pt, cplx *Qt)
{
    const double kappa = r->kappa, g = r->shear_modulus / (M_PI * (kappa + 1) * h), f = -1 / (2 * M_PI * (kappa + 1));
    const cplx e3 = e * e * e;
    for (int k = 0; k <= r->order; k++) {
        const cplx c = conj(m->c[k]), d = conj(m->d[k]);
        Pu[k] = g * I * (e * d * conj(N) - conj(e * d) * N);
        Qu[k] = g * (I * e * d * N + e3 * (I * d + 2 * m->y * conj(m->e[k])) * conj(N));
        if (!Pt) continue;
        Pt[k] = -f * (conj(e * c) * N + kappa * e * c * conj(N));
        Qt[k] = f * (-e * c * N + e3 * (2 * I * m->y * d - c) * conj(N));
    }
}

static void fill_rows(const Rows *r)
{
    const int shapes = r->order + 1;
    const Py_ssize_t width = 2 * r->elements * shapes;
    for (Py_ssize_t i = 0; i < r->points; i++) {
        for (Py_ssize_t j = 0; j < r->elements; j++) {
            const cplx half = 0.5 * (r->end[j] - r->start[j]), middle = 0.5 * (r->end[j] + r->start[j]);
            const double h = cabs(half);
            const cplx e = half / h, w = (r->point[i] - middle) * conj(e) / h;
            const int on_element = r->on[i] == j, tip = r->tip[j];
            Moments m;
            cplx Pu[MAX_SHAPES], Qu[MAX_SHAPES], Pt[MAX_SHAPES], Qt[MAX_SHAPES];
            const int tractions = r->traction && tip == NO_TIP;
            if (tip == NO_TIP)
                evaluate_moments(w, on_element, r->order, &m);
            else
                evaluate_tip_moments(w, on_element, r->order, tip, &m);
            if (r->normal)
                combine_traction(r, &m, h, e, r->normal[i], Pu, Qu, tractions ? Pt : NULL, tractions ? Qt : NULL);
            else
                combine_displacement(r, &m, h, e, Pu, Qu, tractions ? Pt : NULL, tractions ? Qt : NULL);
            const Py_ssize_t at = 2 * i * width + 2 * j * shapes;
            const double *shape = tip == NO_TIP ? r->shape : tip == TIP_AT_START ? r->shape_tip_start : r->shape_tip_end;
            put_shapes(r->displacement + at, width, shapes, shape, Pu, Qu);
            if (tractions) put_shapes(r->traction + at, width, shapes, shape, Pt, Qt);
        }
    }
}

static int has_length(const Py_buffer *b, Py_ssize_t bytes, const char *name)
{
    if (b->len == bytes) return 1;
    PyErr_Format(PyExc_ValueError, "%s has %zd bytes, expected %zd", name, b->len, bytes);
    return 0;
}

PyDoc_STRVAR(rows_doc,
"rows(point, normal, on, start, end, tip, shape, shape_tip_start, shape_tip_end, kappa, shear_modulus, length,\n"
"     displacement, traction)\n\n"
"Fill displacement and traction (float64, (2 n, 2 m shapes), C order) so that the displacement at the points (normal\n"
"is None), or the traction on the normals there, is displacement @ u + traction @ t. traction may be None.\n"
"point, normal, start, end: complex128; on: int64; tip: int8; shape*: float64 (shapes, shapes), power by shape.\n"
"length: unit of the logarithm of the displacement kernel.");

static PyObject *rows(PyObject *self, PyObject *args)
{
    PyObject *normal_object, *traction_object, *result = NULL;
    Py_buffer b[11];
    double kappa, shear_modulus, length;
    memset(b, 0, sizeof b);
    if (!PyArg_ParseTuple(args, "y*Oy*y*y*y*y*y*y*dddw*O", &b[0], &normal_object, &b[2], &b[3], &b[4], &b[5], &b[6],
                          &b[7], &b[8], &kappa, &shear_modulus, &length, &b[9], &traction_object))
        return NULL;
    if (normal_object != Py_None && PyObject_GetBuffer(normal_object, &b[1], PyBUF_SIMPLE) < 0) goto end;
    if (traction_object != Py_None && PyObject_GetBuffer(traction_object, &b[10], PyBUF_WRITABLE) < 0) goto end;
    const Py_ssize_t n = b[0].len / sizeof(cplx), m = b[3].len / sizeof(cplx);
    const int shapes = (int)lround(sqrt((double)(b[6].len / sizeof(double))));
    if (shapes < 1 || shapes > MAX_SHAPES) {
        PyErr_SetString(PyExc_ValueError, "an element has 1 to 4 shapes");
        goto end;
    }
    const Py_ssize_t square = shapes * shapes * sizeof(double), full = 4 * n * m * shapes * sizeof(double);
    if (!has_length(&b[2], n * sizeof(int64_t), "on") || !has_length(&b[4], m * sizeof(cplx), "end") ||
        !has_length(&b[5], m, "tip") || !has_length(&b[6], square, "shape") ||
        !has_length(&b[7], square, "shape_tip_start") || !has_length(&b[8], square, "shape_tip_end") ||
        !has_length(&b[9], full, "displacement") || (b[1].buf && !has_length(&b[1], n * sizeof(cplx), "normal")) ||
        (b[10].buf && !has_length(&b[10], full, "traction")))
        goto end;
    const Rows r = {
        .points = n, .elements = m, .point = b[0].buf, .normal = b[1].buf, .on = b[2].buf, .start = b[3].buf,
        .end = b[4].buf, .tip = b[5].buf, .shape = b[6].buf, .shape_tip_start = b[7].buf, .shape_tip_end = b[8].buf,
        .order = shapes - 1, .kappa = kappa, .shear_modulus = shear_modulus, .log_length = log(length),
        .displacement = b[9].buf, .traction = b[10].buf,
    };
    Py_BEGIN_ALLOW_THREADS
    fill_rows(&r);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    for (int i = 0; i < 11; i++)
        if (b[i].obj) PyBuffer_Release(&b[i]);
    return result;
}

static PyMethodDef methods[] = {{"rows", rows, METH_VARARGS, rows_doc}, {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_kernels", "Closed-form integrals of the elastic kernels over straight elements.", 0, methods,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__kernels(void) { return PyModule_Create(&module); }
