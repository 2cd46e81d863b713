/* Combinations of the columns, and of rows and columns, of dense matrices: constraint maps and laws have few entries in
 * each column, so that a product with them reads every row once.
 */
#ifndef PBEM_COMBINATIONS_H
#define PBEM_COMBINATIONS_H
#include "buffers.h"

/* out[row[i], j] += sum of factor[k] * matrix[i, place[k]], k from first[j] to first[j + 1] - 1; each row for itself. */
static void add_combined(const double *matrix, Py_ssize_t rows, Py_ssize_t width, const int64_t *row,
                         const int64_t *first, const int64_t *place, const double *factor, Py_ssize_t columns,
                         double *out)
{
    for (Py_ssize_t i = 0; i < rows; i++) {
        const double *from = matrix + i * width;
        double *to = out + row[i] * columns;
        for (Py_ssize_t j = 0; j < columns; j++) {
            double sum = 0;
            for (int64_t k = first[j]; k < first[j + 1]; k++) sum += factor[k] * from[place[k]];
            to[j] += sum;
        }
    }
}

/* Columns are combined in one order whatever their number, as sums must not depend on the ranks. */
PyDoc_STRVAR(combined_doc,
"add_combined(matrix, row, first, place, factor, out)\n\n"
"out[row[i], j] += sum of factor[k] * matrix[i, place[k]] for k from first[j] on, below first[j + 1]. matrix (m, w)\n"
"and out (r, n): float64 in C order; row (m,), first (n + 1,), place (k,): int64; factor (k,): float64.");

static PyObject *py_add_combined(PyObject *Py_UNUSED(self), PyObject *args)
{
    enum { MATRIX, ROW, FIRST, PLACE, FACTOR, OUT, COUNT };
    Buffers all;
    PyObject *result = NULL;
    if (!take_buffers(&all, args, COUNT, 0)) goto end;
    const Py_buffer *b = all.b;
    const Py_ssize_t rows = b[ROW].len / (Py_ssize_t)sizeof(int64_t);
    const Py_ssize_t columns = b[FIRST].len / (Py_ssize_t)sizeof(int64_t) - 1;
    const Py_ssize_t entries = b[PLACE].len / (Py_ssize_t)sizeof(int64_t);
    if (columns < 0) {
        PyErr_SetString(PyExc_ValueError, "first needs one place more than there are columns");
        goto end;
    }
    const Py_ssize_t width = rows ? b[MATRIX].len / (Py_ssize_t)sizeof(double) / rows : 0;
    const Py_ssize_t there = columns ? b[OUT].len / (Py_ssize_t)sizeof(double) / columns : 0;
    if (!has_items(&all, MATRIX, rows * width, sizeof(double)) || !has_items(&all, FACTOR, entries, sizeof(double)) ||
        !has_items(&all, OUT, there * columns, sizeof(double)) || !are_within(&all, ROW, 0, columns ? there : INT64_MAX) ||
        !are_within(&all, PLACE, 0, width) || !are_ranges(&all, FIRST, entries))
        goto end;
    Py_BEGIN_ALLOW_THREADS
    add_combined(b[MATRIX].buf, rows, width, b[ROW].buf, b[FIRST].buf, b[PLACE].buf, b[FACTOR].buf, columns,
                 b[OUT].buf);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
end:
    release(&all);
    return result;
}

/* out[i, j] = sum of weight[i, a] factor[j, b] matrix[row[i, a], column[j, b]], a and b from 0 to 1. */
static void combine_pairs(const float *matrix, Py_ssize_t width, const int64_t *row, const float *weight,
                          const int64_t *column, const float *factor, Py_ssize_t count, float *line, float *out)
{
    for (Py_ssize_t i = 0; i < count; i++) {
        const float *first = matrix + row[2 * i] * width, *second = matrix + row[2 * i + 1] * width;
        const float w = weight[2 * i], v = weight[2 * i + 1];
        for (Py_ssize_t j = 0; j < width; j++) line[j] = w * first[j] + v * second[j];
        float *to = out + i * count;
        for (Py_ssize_t j = 0; j < count; j++)
            to[j] = factor[2 * j] * line[column[2 * j]] + factor[2 * j + 1] * line[column[2 * j + 1]];
    }
}

PyDoc_STRVAR(pairs_doc,
"combine_pairs(matrix, row, weight, column, factor, out)\n\n"
"out[i, j] = sum over a, b of weight[i, a] factor[j, b] matrix[row[i, a], column[j, b]]. matrix (m, m), weight, factor\n"
"(n, 2), out (n, n): float32 in C order; row, column (n, 2): int64.");

static PyObject *py_combine_pairs(PyObject *Py_UNUSED(self), PyObject *args)
{
    enum { MATRIX, ROW, WEIGHT, COLUMN, FACTOR, OUT, COUNT };
    Buffers all;
    PyObject *result = NULL;
    if (!take_buffers(&all, args, COUNT, 0)) goto end;
    const Py_buffer *b = all.b;
    const Py_ssize_t count = b[ROW].len / (Py_ssize_t)(2 * sizeof(int64_t));
    Py_ssize_t width = 0;
    while (width * width * (Py_ssize_t)sizeof(float) < b[MATRIX].len) width++;
    if (!has_items(&all, MATRIX, width * width, sizeof(float)) || !has_items(&all, ROW, 2 * count, sizeof(int64_t)) ||
        !has_items(&all, WEIGHT, 2 * count, sizeof(float)) || !has_items(&all, COLUMN, 2 * count, sizeof(int64_t)) ||
        !has_items(&all, FACTOR, 2 * count, sizeof(float)) || !has_items(&all, OUT, count * count, sizeof(float)) ||
        !are_within(&all, ROW, 0, width) || !are_within(&all, COLUMN, 0, width))
        goto end;
    float *line = PyMem_Malloc((width + 1) * sizeof *line);
    if (!line) {
        PyErr_NoMemory();
        goto end;
    }
    Py_BEGIN_ALLOW_THREADS
    combine_pairs(b[MATRIX].buf, width, b[ROW].buf, b[WEIGHT].buf, b[COLUMN].buf, b[FACTOR].buf, count, line,
                  b[OUT].buf);
    Py_END_ALLOW_THREADS
    PyMem_Free(line);
    result = Py_NewRef(Py_None);
end:
    release(&all);
    return result;
}

#endif
