/* The arrays that a call from Python gives, and whether they hold what is asked of them. */
#ifndef PBEM_BUFFERS_H
#define PBEM_BUFFERS_H
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>

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

#endif
