/* The passes of the fast multipole method: from nodal values to coefficients of clusters, up the trees, from cluster to
 * cluster, down the trees, to values at points. Only geometry is stored; pbem/bem/farfield.py calls them.
 *
 * series.h moves coefficients between clusters, ends.h makes them and evaluates them. The formulas are those of
 * pbem/pages/theory.md, section 6.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include "ends.h"
#include "near.h"

#define MOST_BUFFERS 20

/* Buffers of a call's first arguments; the last of them is written to. */
typedef struct {
    Py_buffer b[MOST_BUFFERS];
    int count;
} Buffers;

static void release(Buffers *all)
{
    for (int i = 0; i < all->count; i++) PyBuffer_Release(&all->b[i]);
}

static int take_buffers(Buffers *all, PyObject *args, int count, int numbers)
{
    all->count = 0;
    if (PyTuple_GET_SIZE(args) != count + numbers) {
        PyErr_Format(PyExc_TypeError, "expected %d arguments", count + numbers);
        return 0;
    }
    for (int i = 0; i < count; i++) {
        const int flags = i == count - 1 ? PyBUF_WRITABLE : PyBUF_SIMPLE;
        if (PyObject_GetBuffer(PyTuple_GET_ITEM(args, i), &all->b[i], flags) < 0) return 0;
        all->count++;
    }
    return 1;
}

static Py_ssize_t take_number(PyObject *args, int at) { return PyLong_AsSsize_t(PyTuple_GET_ITEM(args, at)); }

static int has_items(const Buffers *all, int at, Py_ssize_t items, size_t size)
{
    if (all->b[at].len == items * (Py_ssize_t)size) return 1;
    PyErr_Format(PyExc_ValueError, "argument %d has %zd bytes, expected %zd", at, all->b[at].len, items * size);
    return 0;
}

/* Whether all numbers of an argument are from least on and below end. */
static int are_within(const Buffers *all, int at, int64_t least, int64_t end)
{
    const int64_t *number = all->b[at].buf;
    const Py_ssize_t count = all->b[at].len / (Py_ssize_t)sizeof *number;
    for (Py_ssize_t j = 0; j < count; j++)
        if (number[j] < least || number[j] >= end) {
            PyErr_Format(PyExc_IndexError, "argument %d has %lld in place %zd, expected %lld to %lld", at,
                         (long long)number[j], j, (long long)least, (long long)end - 1);
            return 0;
        }
    return 1;
}

/* Whether numbers of an argument rise from 0 on, up to end at most: where each of several ranges begins. */
static int are_ranges(const Buffers *all, int at, int64_t end)
{
    const int64_t *first = all->b[at].buf;
    const Py_ssize_t count = all->b[at].len / (Py_ssize_t)sizeof *first;
    if (!are_within(all, at, 0, end + 1)) return 0;
    for (Py_ssize_t j = 1; j < count; j++)
        if (first[j] < first[j - 1]) {
            PyErr_Format(PyExc_ValueError, "argument %d falls in place %zd, expected rising numbers", at, j);
            return 0;
        }
    return 1;
}

/* Whether parents, of which -1 is none, come before their children. */
static int come_before(const Buffers *all, int at)
{
    const int64_t *parent = all->b[at].buf;
    const Py_ssize_t count = all->b[at].len / (Py_ssize_t)sizeof *parent;
    for (Py_ssize_t j = 0; j < count; j++)
        if (parent[j] < -1 || parent[j] >= j) {
            PyErr_Format(PyExc_IndexError, "argument %d has %lld in place %zd, expected -1 to %zd", at,
                         (long long)parent[j], j, j - 1);
            return 0;
        }
    return 1;
}

static int check_terms(Py_ssize_t terms)
{
    if (terms > 0 && terms < MOST_POWERS - 1) return 1;
    if (!PyErr_Occurred()) PyErr_Format(PyExc_ValueError, "%zd terms; expected 1 to %d", terms, MOST_POWERS - 2);
    return 0;
}

PyDoc_STRVAR(sum_doc,
"sum_moments(begin, points, shapes, number, family, x, y, dx, dy, weight, shape, length, crowd, first, center, radius,\n"
"            kappa, shear_modulus, v, out, nodes, terms)\n\n"
"Coefficients out (k, 2, terms + 1) complex128 of clusters with the elements first[j] .. first[j + 1] - 1.\n"
"See ends.h for the elements; center .. shear_modulus (k,); v = (u, t) of all nodes; nodes: of an element.");

enum { BEGIN, POINTS, SHAPES, NUMBER, FAMILY, X, Y, DX, DY, WEIGHT, SHAPE, LENGTH, CROWD, FIRST, CENTER, RADIUS, KAPPA,
       MODULUS, VALUES, SUMS_OUT, SUMS_BUFFERS };

/* Whether the integration points and nodes of all elements are there. */
static int has_elements(const Buffers *all, const Elements *e, Py_ssize_t m)
{
    const Py_ssize_t points = all->b[X].len / (Py_ssize_t)sizeof(double);
    const Py_ssize_t weights = all->b[WEIGHT].len / (Py_ssize_t)sizeof(double);
    for (int i = X; i < WEIGHT; i++)
        if (!has_items(all, i, points, sizeof(double))) return 0;
    if (!has_items(all, SHAPE, e->nodes * weights, sizeof(double)) ||
        !are_within(all, POINTS, 0, points + 1) || !are_within(all, BEGIN, 0, points + 1) ||
        !are_within(all, SHAPES, 0, e->nodes * weights + 1) || !are_within(all, NUMBER, 0, e->all_nodes / e->nodes))
        return 0;
    for (Py_ssize_t at = 0; at < m; at++)
        if (e->points[at] % LANES || e->begin[at] > points - e->points[at] ||
            e->shapes[at] > e->nodes * (weights - e->points[at])) {
            PyErr_Format(PyExc_IndexError, "integration points of element %zd are not there", at);
            return 0;
        }
    return 1;
}

static PyObject *py_sum_moments(PyObject *Py_UNUSED(self), PyObject *args)
{
    Buffers all;
    PyObject *result = NULL;
    if (!take_buffers(&all, args, SUMS_BUFFERS, 2)) goto end;
    const Py_buffer *b = all.b;
    const Py_ssize_t nodes = take_number(args, SUMS_BUFFERS), terms = take_number(args, SUMS_BUFFERS + 1);
    const Py_ssize_t count = b[CENTER].len / (Py_ssize_t)sizeof(cplx), m = b[FAMILY].len;
    if (!check_terms(terms)) goto end;
    if (nodes < 1 || nodes > 4) {
        PyErr_SetString(PyExc_ValueError, "an element has 1 to 4 shapes");
        goto end;
    }
    for (int i = BEGIN; i < FAMILY; i++)
        if (!has_items(&all, i, m, sizeof(int64_t))) goto end;
    for (int i = RADIUS; i < VALUES; i++)
        if (!has_items(&all, i, count, sizeof(double))) goto end;
    if (!has_items(&all, LENGTH, m, sizeof(double)) || !has_items(&all, CROWD, nodes * m, sizeof(double)) ||
        !has_items(&all, FIRST, count + 1, sizeof(int64_t)) ||
        !has_items(&all, SUMS_OUT, 2 * (terms + 1) * count, sizeof(cplx)))
        goto end;
    const Elements e = {
        .begin = b[BEGIN].buf, .points = b[POINTS].buf, .shapes = b[SHAPES].buf, .number = b[NUMBER].buf,
        .family = b[FAMILY].buf, .x = b[X].buf, .y = b[Y].buf, .dx = b[DX].buf, .dy = b[DY].buf,
        .weight = b[WEIGHT].buf, .shape = b[SHAPE].buf, .length = b[LENGTH].buf, .crowd = b[CROWD].buf,
        .nodes = (int)nodes, .all_nodes = b[VALUES].len / (4 * (Py_ssize_t)sizeof(double)),
    };
    if (!has_elements(&all, &e, m) || !are_ranges(&all, FIRST, m)) goto end;
    const int64_t *first = b[FIRST].buf;
    const cplx *center = b[CENTER].buf;
    const double *radius = b[RADIUS].buf, *kappa = b[KAPPA].buf, *modulus = b[MODULUS].buf, *v = b[VALUES].buf;
    cplx *out = b[SUMS_OUT].buf;
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t j = 0; j < count; j++) {
        const Circle c = {center[j], radius[j], kappa[j], modulus[j]};
        sum_moments(&e, first[j], first[j + 1], v, c, (int)terms, out + j * 2 * (terms + 1));
    }
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&all);
    return result;
}

PyDoc_STRVAR(lift_doc,
"lift(parent, center, radius, moments, terms)\n\n"
"Add up coefficients (k, 2, terms + 1) of clusters, parents before children, in those of their parents (-1: none).");

static PyObject *py_lift(PyObject *Py_UNUSED(self), PyObject *args)
{
    Buffers all;
    PyObject *result = NULL;
    if (!take_buffers(&all, args, 4, 1)) goto end;
    const Py_ssize_t terms = take_number(args, 4), count = all.b[0].len / (Py_ssize_t)sizeof(int64_t);
    if (!check_terms(terms) || !has_items(&all, 1, count, sizeof(cplx)) || !has_items(&all, 2, count, sizeof(double)) ||
        !has_items(&all, 3, 2 * (terms + 1) * count, sizeof(cplx)) || !come_before(&all, 0))
        goto end;
    const int64_t *parent = all.b[0].buf;
    const cplx *center = all.b[1].buf;
    const double *radius = all.b[2].buf;
    cplx *moments = all.b[3].buf;
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t j = count - 1; j >= 0; j--) {
        const int64_t above = parent[j];
        if (above >= 0)
            lift_series(moments + j * 2 * (terms + 1), moments + above * 2 * (terms + 1), center[j] - center[above],
                        radius[j], radius[above], (int)terms);
    }
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&all);
    return result;
}

PyDoc_STRVAR(lower_doc,
"lower(parent, wanted, center, radius, fields, terms)\n\n"
"Add the fields (k, 2, terms + 1) of parents to those of their children, of clusters that are wanted (k,) bool.");

static PyObject *py_lower(PyObject *Py_UNUSED(self), PyObject *args)
{
    Buffers all;
    PyObject *result = NULL;
    if (!take_buffers(&all, args, 5, 1)) goto end;
    const Py_ssize_t terms = take_number(args, 5), count = all.b[0].len / (Py_ssize_t)sizeof(int64_t);
    if (!check_terms(terms) || !has_items(&all, 1, count, 1) || !has_items(&all, 2, count, sizeof(cplx)) ||
        !has_items(&all, 3, count, sizeof(double)) || !has_items(&all, 4, 2 * (terms + 1) * count, sizeof(cplx)) ||
        !come_before(&all, 0))
        goto end;
    const int64_t *parent = all.b[0].buf;
    const char *wanted = all.b[1].buf;
    const cplx *center = all.b[2].buf;
    const double *radius = all.b[3].buf;
    cplx *fields = all.b[4].buf;
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t j = 0; j < count; j++) {
        const int64_t above = parent[j];
        if (above >= 0 && wanted[j])
            lower_series(fields + above * 2 * (terms + 1), fields + j * 2 * (terms + 1), center[j] - center[above],
                         radius[j], radius[above], (int)terms);
    }
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&all);
    return result;
}

PyDoc_STRVAR(carry_doc,
"carry(target, source, target_center, target_radius, length, source_center, source_radius, weights, moments, fields,\n"
"      terms)\n\n"
"Add to the fields of targets (n,) what the coefficients of the sources (n,) make there. length: unit of the logarithm\n"
"of each target cluster; weights (r, terms + 1): see pbem/bem/expansion.py, and rows of zeros up to a multiple of 4.");

enum { TARGET, SOURCE, TARGET_CENTER, TARGET_RADIUS, UNIT, SOURCE_CENTER, SOURCE_RADIUS, WEIGHTS, MOMENTS, FIELDS,
       CARRY_BUFFERS };

static PyObject *py_carry(PyObject *Py_UNUSED(self), PyObject *args)
{
    Buffers all;
    PyObject *result = NULL;
    if (!take_buffers(&all, args, CARRY_BUFFERS, 1)) goto end;
    const Py_buffer *b = all.b;
    const Py_ssize_t terms = take_number(args, CARRY_BUFFERS), size = 2 * (terms + 1);
    const Py_ssize_t pairs = b[TARGET].len / (Py_ssize_t)sizeof(int64_t);
    const Py_ssize_t targets = b[TARGET_CENTER].len / (Py_ssize_t)sizeof(cplx);
    const Py_ssize_t sources = b[SOURCE_CENTER].len / (Py_ssize_t)sizeof(cplx);
    if (!check_terms(terms) || !has_items(&all, SOURCE, pairs, sizeof(int64_t)) ||
        !has_items(&all, TARGET_RADIUS, targets, sizeof(double)) || !has_items(&all, UNIT, targets, sizeof(double)) ||
        !has_items(&all, SOURCE_RADIUS, sources, sizeof(double)) ||
        !has_items(&all, WEIGHTS, (terms / WEIGHED + 1) * WEIGHED * (terms + 1), sizeof(double)) ||
        !has_items(&all, MOMENTS, size * sources, sizeof(cplx)) ||
        !has_items(&all, FIELDS, size * targets, sizeof(cplx)) || !are_within(&all, TARGET, 0, targets) ||
        !are_within(&all, SOURCE, 0, sources))
        goto end;
    const int64_t *target = b[TARGET].buf, *source = b[SOURCE].buf;
    const cplx *to = b[TARGET_CENTER].buf, *from = b[SOURCE_CENTER].buf, *moments = b[MOMENTS].buf;
    const double *own = b[TARGET_RADIUS].buf, *other = b[SOURCE_RADIUS].buf, *length = b[UNIT].buf;
    cplx *fields = b[FIELDS].buf;
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t begin = 0; begin < pairs; begin += PAIRS) {
        const int count = pairs - begin < PAIRS ? (int)(pairs - begin) : PAIRS;
        Carried each[PAIRS];
        for (int j = 0; j < count; j++) {
            const int64_t t = target[begin + j], s = source[begin + j];
            each[j] = (Carried){moments + s * size, fields + t * size, to[t] - from[s], other[s], own[t], length[t]};
        }
        carry_series(each, count, b[WEIGHTS].buf, (int)terms);
    }
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&all);
    return result;
}

PyDoc_STRVAR(evaluate_doc,
"evaluate(cluster, first, point, normal, center, radius, kappa, shear_modulus, fields, out, terms)\n\n"
"Displacement, or traction on the normal where that is not 0, at the points first[j] .. first[j + 1] - 1 in cluster[j]\n"
"(k,), complex128, from the fields of all clusters, whose center and radius are given; kappa, shear_modulus (k,).");

enum { CLUSTER, AT, POINT, NORMAL, ALL_CENTER, ALL_RADIUS, OWN_KAPPA, OWN_MODULUS, FIELD, OUT, EVALUATE_BUFFERS };

static PyObject *py_evaluate(PyObject *Py_UNUSED(self), PyObject *args)
{
    Buffers all;
    PyObject *result = NULL;
    if (!take_buffers(&all, args, EVALUATE_BUFFERS, 1)) goto end;
    const Py_buffer *b = all.b;
    const Py_ssize_t terms = take_number(args, EVALUATE_BUFFERS), count = b[CLUSTER].len / (Py_ssize_t)sizeof(int64_t);
    const Py_ssize_t clusters = b[ALL_CENTER].len / (Py_ssize_t)sizeof(cplx);
    const Py_ssize_t points = b[POINT].len / (Py_ssize_t)sizeof(cplx);
    if (!check_terms(terms) || !has_items(&all, AT, count + 1, sizeof(int64_t)) ||
        !has_items(&all, NORMAL, points, sizeof(cplx)) || !has_items(&all, ALL_RADIUS, clusters, sizeof(double)) ||
        !has_items(&all, OWN_KAPPA, count, sizeof(double)) || !has_items(&all, OWN_MODULUS, count, sizeof(double)) ||
        !has_items(&all, FIELD, 2 * (terms + 1) * clusters, sizeof(cplx)) ||
        !has_items(&all, OUT, points, sizeof(cplx)) || !are_within(&all, CLUSTER, 0, clusters) ||
        !are_ranges(&all, AT, points))
        goto end;
    const int64_t *cluster = b[CLUSTER].buf, *first = b[AT].buf;
    const cplx *point = b[POINT].buf, *normal = b[NORMAL].buf, *center = b[ALL_CENTER].buf, *fields = b[FIELD].buf;
    const double *radius = b[ALL_RADIUS].buf, *kappa = b[OWN_KAPPA].buf, *modulus = b[OWN_MODULUS].buf;
    cplx *out = b[OUT].buf;
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t j = 0; j < count; j++) {
        const int64_t at = cluster[j], from = first[j];
        const Circle c = {center[at], radius[at], kappa[j], modulus[j]};
        evaluate_series(fields + at * 2 * (terms + 1), point + from, normal + from, first[j + 1] - from, c, (int)terms,
                        out + from);
    }
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&all);
    return result;
}

/* Blocks of near rows, and the buffers that they are in: row, column, entries and perhaps unit of each. */
typedef struct {
    Py_ssize_t count, buffers, values, rows, widest;
    Block *block;
    Py_buffer *buffer;
} Tied;

#define TIED "pbem.bem._expansions.Tied"

static void release_tied(Tied *tied)
{
    for (Py_ssize_t i = 0; i < tied->buffers; i++) PyBuffer_Release(&tied->buffer[i]);
    PyMem_Free(tied->buffer);
    PyMem_Free(tied->block);
    PyMem_Free(tied);
}

static void destroy_tied(PyObject *capsule) { release_tied(PyCapsule_GetPointer(capsule, TIED)); }

static int tie_block(Tied *tied, PyObject *given)
{
    Block *b = &tied->block[tied->count];
    const Py_buffer *own = &tied->buffer[tied->buffers];
    const Py_ssize_t parts = PyTuple_Check(given) ? PyTuple_GET_SIZE(given) : 0;
    if (parts != 3 && parts != 4) {
        PyErr_SetString(PyExc_TypeError, "expected (rows, columns, entries) or (rows, columns, numbers, unit)");
        return 0;
    }
    for (Py_ssize_t i = 0; i < parts; i++, tied->buffers++)
        if (PyObject_GetBuffer(PyTuple_GET_ITEM(given, i), &tied->buffer[tied->buffers], PyBUF_SIMPLE) < 0) return 0;
    const Buffers all = {.b = {own[0], own[1]}, .count = 2};
    const size_t size = parts == 4 ? sizeof(int32_t) : sizeof(double);
    *b = (Block){
        .row = own[0].buf, .column = own[1].buf, .full = parts == 3 ? own[2].buf : NULL,
        .number = parts == 4 ? own[2].buf : NULL, .unit = parts == 4 ? own[3].buf : NULL,
        .rows = own[0].len / (Py_ssize_t)sizeof(int64_t), .columns = own[1].len / (Py_ssize_t)sizeof(int64_t),
    };
    if (!are_within(&all, 0, 0, tied->rows) || !are_within(&all, 1, 0, tied->values)) return 0;
    if (own[2].len != b->rows * b->columns * (Py_ssize_t)size ||
        (parts == 4 && own[3].len != b->rows * (Py_ssize_t)sizeof(double))) {
        PyErr_Format(PyExc_ValueError, "block %zd has not as many entries as rows times columns", tied->count);
        return 0;
    }
    if (b->columns > tied->widest) tied->widest = b->columns;
    tied->count++;
    return 1;
}

PyDoc_STRVAR(tie_doc,
"tie_blocks(blocks, values, rows)\n\n"
"What add_blocks takes, for a list of tuples of arrays: rows (r,) and columns (n,) int64, and entries (r, n) float64, or\n"
"numbers (r, n) int32 with the unit of each row (r,) float64. They are kept until the result is dropped.\n"
"values, rows: lengths of v and of the result.");

static PyObject *py_tie_blocks(PyObject *Py_UNUSED(self), PyObject *args)
{
    PyObject *blocks;
    Py_ssize_t values, rows;
    if (!PyArg_ParseTuple(args, "O!nn", &PyList_Type, &blocks, &values, &rows)) return NULL;
    const Py_ssize_t count = PyList_GET_SIZE(blocks);
    Tied *tied = PyMem_Calloc(1, sizeof *tied);
    if (!tied) return PyErr_NoMemory();
    *tied = (Tied){.values = values, .rows = rows, .block = PyMem_Calloc(count + 1, sizeof *tied->block),
                   .buffer = PyMem_Calloc(4 * count + 1, sizeof *tied->buffer)};
    int whole = tied->block && tied->buffer;
    if (!whole) PyErr_NoMemory();
    for (Py_ssize_t at = 0; whole && at < count; at++) whole = tie_block(tied, PyList_GET_ITEM(blocks, at));
    PyObject *result = whole ? PyCapsule_New(tied, TIED, destroy_tied) : NULL;
    if (!result) release_tied(tied);
    return result;
}

PyDoc_STRVAR(blocks_doc, "add_blocks(tied, v, out)\n\nout += the blocks of tie_blocks times v.");

static PyObject *py_add_blocks(PyObject *Py_UNUSED(self), PyObject *args)
{
    Buffers all = {.count = 0};
    PyObject *result = NULL, *parts = NULL;
    const Tied *tied = PyTuple_GET_SIZE(args) ? PyCapsule_GetPointer(PyTuple_GET_ITEM(args, 0), TIED) : NULL;
    if (!tied) {
        if (!PyErr_Occurred()) PyErr_SetString(PyExc_TypeError, "expected what tie_blocks gave");
        return NULL;
    }
    parts = PyTuple_GetSlice(args, 1, PyTuple_GET_SIZE(args));
    if (!parts || !take_buffers(&all, parts, 2, 0) || !has_items(&all, 0, tied->values, sizeof(double)) ||
        !has_items(&all, 1, tied->rows, sizeof(double)))
        goto end;
    double *x = PyMem_Calloc(tied->widest + 1, sizeof *x);
    if (!x) {
        PyErr_NoMemory();
        goto end;
    }
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t at = 0; at < tied->count; at++) add_block(&tied->block[at], all.b[0].buf, x, all.b[1].buf);
    Py_END_ALLOW_THREADS
    PyMem_Free(x);
    result = Py_NewRef(Py_None);
end:
    release(&all);
    Py_XDECREF(parts);
    return result;
}

static PyMethodDef methods[] = {
    {"tie_blocks", py_tie_blocks, METH_VARARGS, tie_doc},
    {"add_blocks", py_add_blocks, METH_VARARGS, blocks_doc},
    {"sum_moments", py_sum_moments, METH_VARARGS, sum_doc},
    {"lift", py_lift, METH_VARARGS, lift_doc},
    {"carry", py_carry, METH_VARARGS, carry_doc},
    {"lower", py_lower, METH_VARARGS, lower_doc},
    {"evaluate", py_evaluate, METH_VARARGS, evaluate_doc},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_expansions", "The passes of the fast multipole method.", 0, methods, NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__expansions(void)
{
    prepare_binomials();
    return PyModule_Create(&module);
}
