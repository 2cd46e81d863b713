/* Four pairs of point and element at a time: vectors of four doubles, and how their results are stored. */
#ifndef PBEM_LANES_H
#define PBEM_LANES_H
#include <math.h>
#include <stdint.h>
#include <string.h>

#define LANES 4
/* Orders and kinds of rows are constants of the callers: inlining makes straight code of loops over nodes. */
#define INLINE static inline __attribute__((always_inline))

typedef double Lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef double Pair __attribute__((vector_size(2 * sizeof(double))));

#ifdef __clang__
#define SHUFFLE(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
typedef int64_t LaneIndex __attribute__((vector_size(LANES * sizeof(int64_t))));
#define SHUFFLE(a, b, i, j, k, l) __builtin_shuffle(a, b, (LaneIndex){i, j, k, l})
#endif

/* Loops of a fixed number, apart from all others: the compiler gives them to the vector functions of the C library, and
 * the last digit of a value does not depend on how many there are. */
#define FUNCTION_BATCH 8
#define APART static __attribute__((noinline))

APART void take_batch_of_logarithms(double *values)
{
    for (int j = 0; j < FUNCTION_BATCH; j++) values[j] = log(values[j]);
}

APART void take_batch_of_arguments(double *y, const double *x)
{
    for (int j = 0; j < FUNCTION_BATCH; j++) y[j] = atan2(y[j], x[j]);
}

static void take_logarithms(double *values, int count)
{
    for (int p = 0; p < count; p += FUNCTION_BATCH) take_batch_of_logarithms(values + p);
}

/* Arguments of x + iy, into y. */
static void take_arguments(double *y, const double *x, int count)
{
    for (int p = 0; p < count; p += FUNCTION_BATCH) take_batch_of_arguments(y + p, x + p);
}

INLINE Lanes spread(double value) { return (Lanes){value, value, value, value}; }

INLINE double find_least(Lanes a)
{
    const double left = a[0] < a[1] ? a[0] : a[1], right = a[2] < a[3] ? a[2] : a[3];
    return left < right ? left : right;
}

/* The complex product (a + ib)(c + id) in lanes. */
#define MULTIPLY_REAL(a, b, c, d) ((a) * (c) - (b) * (d))
#define MULTIPLY_IMAGINARY(a, b, c, d) ((a) * (d) + (b) * (c))

INLINE void store_pair(double *out, Lanes a, int upper)
{
    const Pair half = upper ? (Pair){a[2], a[3]} : (Pair){a[0], a[1]};
    memcpy(out, &half, sizeof half);
}

/* One row of the blocks of every lane's element: x[node], y[node] side by side at the lane's own place. */
INLINE void store_row(int shapes, const Lanes *x, const Lanes *y, double *const *out, int64_t offset)
{
    Lanes even[LANES], odd[LANES]; /* of lanes 0 and 2, 1 and 3 */
    for (int node = 0; node < shapes; node++) {
        even[node] = SHUFFLE(x[node], y[node], 0, 4, 2, 6);
        odd[node] = SHUFFLE(x[node], y[node], 1, 5, 3, 7);
    }
    for (int node = 0; node + 1 < shapes; node += 2) {
        const Lanes whole[LANES] = {
            SHUFFLE(even[node], even[node + 1], 0, 1, 4, 5), SHUFFLE(odd[node], odd[node + 1], 0, 1, 4, 5),
            SHUFFLE(even[node], even[node + 1], 2, 3, 6, 7), SHUFFLE(odd[node], odd[node + 1], 2, 3, 6, 7)};
        for (int lane = 0; lane < LANES; lane++)
            memcpy(out[lane] + offset + 2 * node, &whole[lane], sizeof(Lanes));
    }
    if (shapes % 2) {
        const int node = shapes - 1;
        store_pair(out[0] + offset + 2 * node, even[node], 0);
        store_pair(out[1] + offset + 2 * node, odd[node], 0);
        store_pair(out[2] + offset + 2 * node, even[node], 1);
        store_pair(out[3] + offset + 2 * node, odd[node], 1);
    }
}

#endif
