/* Which columns of near rows are weak, and these as whole numbers of a unit of each row: see pbem/bem/near.py. */
#ifndef PBEM_PACKING_H
#define PBEM_PACKING_H
#include "buffers.h"
#include <float.h>
#include <math.h>

/* The largest size of some entries; NaN where one of them is. */
static double find_largest(const double *entry, Py_ssize_t count)
{
    double largest = 0, sum = 0;
    for (Py_ssize_t k = 0; k < count; k++) {
        const double size = fabs(entry[k]);
        largest = size > largest ? size : largest;
        sum += size;
    }
    return sum != sum ? sum : largest;
}

/* part[j]: over all rows, the largest entry of the columns begin[j] .. begin[j + 1] - 1, as a part of the largest that
 * its row has in all of these. of_column (begin[groups],): for the parts of columns. */
static void compare_columns(const double *near, Py_ssize_t rows, Py_ssize_t columns, const int64_t *begin,
                            Py_ssize_t groups, double *of_column, double *part)
{
    const int64_t first = begin[0], last = begin[groups];
    for (int64_t k = first; k < last; k++) of_column[k] = 0;
    for (Py_ssize_t i = 0; i < rows; i++) {
        const double *row = near + i * columns, largest = find_largest(row + first, last - first);
        const double unit = largest != 0 ? largest : 1;
        for (int64_t k = first; k < last; k++) {
            const double size = fabs(row[k]) / unit;
            of_column[k] = size > of_column[k] || size != size ? size : of_column[k];
        }
    }
    for (Py_ssize_t j = 0; j < groups; j++) part[j] = find_largest(of_column + begin[j], begin[j + 1] - begin[j]);
}

PyDoc_STRVAR(compare_doc,
"compare_columns(near, begin, part, rows)\n\n"
"part (g,): over all rows of near (r, n), the largest size of an entry of the columns begin[j] .. begin[j + 1] - 1 as\n"
"a part of the largest that its row has from begin[0] on, below begin[g]; NaN where that is no number.\n"
"near, part: float64; begin (g + 1,): int64; rows: r.");

static PyObject *py_compare_columns(PyObject *Py_UNUSED(self), PyObject *args)
{
    enum { NEAR, COLUMNS_BEGIN, PART, COUNT };
    Buffers all;
    PyObject *result = NULL;
    double *of_column = NULL;
    if (!take_buffers(&all, args, COUNT, 1)) goto end;
    const Py_ssize_t rows = take_number(args, COUNT);
    const Py_ssize_t groups = all.b[PART].len / (Py_ssize_t)sizeof(double);
    const Py_ssize_t columns = rows > 0 ? all.b[NEAR].len / (Py_ssize_t)sizeof(double) / rows : 0;
    if (rows < 0) {
        if (!PyErr_Occurred()) PyErr_Format(PyExc_ValueError, "%zd rows; expected none or more", rows);
        goto end;
    }
    if (!has_items(&all, NEAR, rows * columns, sizeof(double)) ||
        !has_items(&all, COLUMNS_BEGIN, groups + 1, sizeof(int64_t)) || !are_ranges(&all, COLUMNS_BEGIN, columns))
        goto end;
    if (!(of_column = PyMem_Malloc((columns + 1) * sizeof *of_column))) {
        PyErr_NoMemory();
        goto end;
    }
    Py_BEGIN_ALLOW_THREADS
    compare_columns(all.b[NEAR].buf, rows, columns, all.b[COLUMNS_BEGIN].buf, groups, of_column,
                    all.b[PART].buf);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    PyMem_Free(of_column);
    release(&all);
    return result;
}

/* number[i, k] = near[i, column[k]] / unit[i], to the nearest, and unit[i] = the largest of these over most. line
 * (count,): for a row. */
static void pack_columns(const double *near, Py_ssize_t rows, Py_ssize_t columns, const int64_t *column,
                         Py_ssize_t count, double most, double *line, double *unit, int32_t *number)
{
    for (Py_ssize_t i = 0; i < rows; i++) {
        for (Py_ssize_t k = 0; k < count; k++) line[k] = near[i * columns + column[k]];
        const double least = find_largest(line, count) / most;
        unit[i] = least > DBL_MIN ? least : DBL_MIN;
        for (Py_ssize_t k = 0; k < count; k++) number[i * count + k] = (int32_t)rint(line[k] / unit[i]);
    }
}

PyDoc_STRVAR(pack_doc,
"pack_columns(near, column, unit, number, most)\n\n"
"Columns (k,) int64 of near (r, n) float64 as number (r, k) int32 times unit (r,) float64; sizes of numbers: at most\n"
"`most`.");

static PyObject *py_pack_columns(PyObject *Py_UNUSED(self), PyObject *args)
{
    enum { NEAR, COLUMN, UNIT, NUMBER, COUNT };
    Buffers all;
    PyObject *result = NULL;
    double *line = NULL;
    if (!take_buffers(&all, args, COUNT, 1)) goto end;
    const Py_ssize_t rows = all.b[UNIT].len / (Py_ssize_t)sizeof(double), most = take_number(args, COUNT);
    const Py_ssize_t count = all.b[COLUMN].len / (Py_ssize_t)sizeof(int64_t);
    const Py_ssize_t columns = rows ? all.b[NEAR].len / (Py_ssize_t)sizeof(double) / rows : 0;
    if (most < 1 || most > INT32_MAX) {
        if (!PyErr_Occurred()) PyErr_Format(PyExc_ValueError, "numbers of up to %zd; expected 1 to 2^31 - 1", most);
        goto end;
    }
    if (!has_items(&all, NEAR, rows * columns, sizeof(double)) ||
        !has_items(&all, NUMBER, rows * count, sizeof(int32_t)) || !are_within(&all, COLUMN, 0, columns))
        goto end;
    if (!(line = PyMem_Malloc((count + 1) * sizeof *line))) {
        PyErr_NoMemory();
        goto end;
    }
    Py_BEGIN_ALLOW_THREADS
    pack_columns(all.b[NEAR].buf, rows, columns, all.b[COLUMN].buf, count, (double)most, line, all.b[UNIT].buf,
                 all.b[NUMBER].buf);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    PyMem_Free(line);
    release(&all);
    return result;
}

#endif
