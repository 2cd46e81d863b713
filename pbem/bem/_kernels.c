/* Integrals of the elastic kernels over straight elements and arcs, in closed form.
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
 * Pairs are done several at a time, in the lanes of vectors (lanes.h) and complex numbers of these (complex_lanes.h).
 * moments.h has the moments of one pair, straight.h those of several; combine.h makes factors of the nodes of them, and
 * fill_straight.h goes over all pairs of straight elements. fill_curves.h does so for curved ones, by Gauss points
 * (rules.h) or the closed form of their kind (curves.h says what a kind is; arcs.h has circular arcs). select.h has the
 * table by which order, equation and kind of element select code.
 *
 * The potentials (Kolosov-Muskhelishvili) turn the moments into complex factors P, Q: a density a s^k contributes
 * P a + Q conj(a). Rows give the value at the point as  A u + B t, with u, t the nodal displacements and tractions.
 *
 * Numbers such as (theory, 21) are those of the formulas in pbem/pages/theory.md.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include "select.h"

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
"point, normal (n), start, end, center (m): complex128; on: int64 (n); on_local: float64 (n); sweep: float64 (m), 0\n"
"for a straight element; family: int8 (m): 0 boundary, 1, 2 tip at start or end, 3 crack; local: float64 (shapes), of\n"
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

static PyObject *rows(PyObject *Py_UNUSED(self), PyObject *args)
{
    PyObject *normal, *traction, *result = NULL;
    Py_buffer b[BUFFERS];
    double kappa, shear_modulus, length;
    memset(b, 0, sizeof b);
    if (!PyArg_ParseTuple(args, "y*y*y*y*y*y*y*y*y*y*dddw*OO", &b[POINT], &b[ON], &b[ON_LOCAL], &b[START], &b[END],
                          &b[CENTER], &b[SWEEP], &b[FAMILY], &b[LOCAL], &b[SHAPE], &kappa, &shear_modulus, &length,
                          &b[OUT], &normal, &traction))
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
        .local = b[LOCAL].buf, .family = b[FAMILY].buf, .shape = b[SHAPE].buf, .order = (int)shapes - 1,
        .kappa = kappa, .shear_modulus = shear_modulus,
        .f = 1 / (2 * M_PI * (kappa + 1)), .ft = 1 / (4 * M_PI * shear_modulus * (kappa + 1)),
        .log_length = log(length), .displacement = b[OUT].buf, .traction = b[TRACTION].buf,
    };
    for (Py_ssize_t j = 0; j < m; j++)
        if (fabs(r.sweep[j]) > ARC_LARGEST) {
            PyErr_SetString(PyExc_ValueError, "an element turns by more than half a circle");
            goto end;
        }
    int enough;
    Py_BEGIN_ALLOW_THREADS
    enough = fill_rows(&r);
    Py_END_ALLOW_THREADS
    if (!enough) {
        PyErr_NoMemory();
        goto end;
    }
    result = Py_NewRef(Py_None);
end:
    for (int i = 0; i < BUFFERS; i++)
        if (b[i].obj) PyBuffer_Release(&b[i]);
    return result;
}

static PyMethodDef methods[] = {{"rows", rows, METH_VARARGS, rows_doc}, {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_kernels", "Closed-form integrals of the elastic kernels.", 0, methods,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__kernels(void)
{
    prepare_series();
    prepare_gauss();
    return PyModule_Create(&module);
}
