/* Products with many blocks of near rows in one call: the blocks are looked at once, and kept (see near.h). */
#ifndef PBEM_TIED_BLOCKS_H
#define PBEM_TIED_BLOCKS_H
#include "buffers.h"
#include "near.h"

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

#endif
