/* The passes of the fast multipole method: from nodal values to coefficients of clusters, up the trees, from cluster to
 * cluster, down the trees, to values at points. Only geometry is stored; pbem/bem/farfield.py calls them.
 *
 * series.h moves coefficients between clusters, ends.h makes them and evaluates them. The formulas are those of
 * pbem/pages/theory.md, section 6. packing.h has the entries of near rows that are weak, tied_blocks.h the products
 * of these, combinations.h what near rows and the laws of pairs make of each other.
 */
#include "buffers.h"
#include "combinations.h"
#include "ends.h"
#include "packing.h"
#include "tied_blocks.h"

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
"      terms, source_terms, target_terms)\n\n"
"Add to the fields of targets (n,) what the coefficients of the sources (n,) make there; so many terms of both count.\n"
"length: unit of the logarithm of each target cluster; weights (target_terms + 1, source_terms + 1): see\n"
"pbem/bem/expansion.py, and rows of zeros up to a multiple of 4.");

enum { TARGET, SOURCE, TARGET_CENTER, TARGET_RADIUS, UNIT, SOURCE_CENTER, SOURCE_RADIUS, WEIGHTS, MOMENTS, FIELDS,
       CARRY_BUFFERS };

static PyObject *py_carry(PyObject *Py_UNUSED(self), PyObject *args)
{
    Buffers all;
    PyObject *result = NULL;
    if (!take_buffers(&all, args, CARRY_BUFFERS, 3)) goto end;
    const Py_buffer *b = all.b;
    const Py_ssize_t terms = take_number(args, CARRY_BUFFERS), size = 2 * (terms + 1);
    const Py_ssize_t seen = take_number(args, CARRY_BUFFERS + 1), kept = take_number(args, CARRY_BUFFERS + 2);
    const Py_ssize_t pairs = b[TARGET].len / (Py_ssize_t)sizeof(int64_t);
    const Py_ssize_t targets = b[TARGET_CENTER].len / (Py_ssize_t)sizeof(cplx);
    const Py_ssize_t sources = b[SOURCE_CENTER].len / (Py_ssize_t)sizeof(cplx);
    if (!check_terms(terms) || !check_terms(seen) || !check_terms(kept)) goto end;
    if (seen > terms || kept > terms) {
        PyErr_Format(PyExc_ValueError, "%zd and %zd terms of %zd", seen, kept, terms);
        goto end;
    }
    if (!has_items(&all, SOURCE, pairs, sizeof(int64_t)) ||
        !has_items(&all, TARGET_RADIUS, targets, sizeof(double)) || !has_items(&all, UNIT, targets, sizeof(double)) ||
        !has_items(&all, SOURCE_RADIUS, sources, sizeof(double)) ||
        !has_items(&all, WEIGHTS, (kept / WEIGHED + 1) * WEIGHED * (seen + 1), sizeof(double)) ||
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
        carry_series(each, count, b[WEIGHTS].buf, (int)terms, (int)seen, (int)kept);
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

static PyMethodDef methods[] = {
    {"tie_blocks", py_tie_blocks, METH_VARARGS, tie_doc},
    {"add_blocks", py_add_blocks, METH_VARARGS, blocks_doc},
    {"sum_moments", py_sum_moments, METH_VARARGS, sum_doc},
    {"lift", py_lift, METH_VARARGS, lift_doc},
    {"carry", py_carry, METH_VARARGS, carry_doc},
    {"lower", py_lower, METH_VARARGS, lower_doc},
    {"evaluate", py_evaluate, METH_VARARGS, evaluate_doc},
    {"add_combined", py_add_combined, METH_VARARGS, combined_doc},
    {"combine_pairs", py_combine_pairs, METH_VARARGS, pairs_doc},
    {"compare_columns", py_compare_columns, METH_VARARGS, compare_doc},
    {"pack_columns", py_pack_columns, METH_VARARGS, pack_doc},
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
