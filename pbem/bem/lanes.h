/* Several pairs of point and element at a time: vectors of doubles, and how their results are stored.
 *
 * Four lanes where the processor has registers of that length, otherwise two.
 */
#ifndef PBEM_LANES_H
#define PBEM_LANES_H
#include <math.h>
#include <stdint.h>
#include <string.h>

#ifdef __AVX__
#define LANES 4
#else
#define LANES 2
#endif
/* Orders and kinds of rows are constants of the callers: inlining makes straight code of loops over nodes. */
#define INLINE static inline __attribute__((always_inline))

typedef double Lanes __attribute__((vector_size(LANES * sizeof(double))));

typedef int64_t LaneIndex __attribute__((vector_size(LANES * sizeof(double))));

#ifdef __clang__
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (LaneIndex){__VA_ARGS__})
#endif

/* As many as a register holds, for sums over much memory; and four, whatever the registers are. */
#ifdef __AVX512F__
#define WIDE 8
#else
#define WIDE LANES
#endif

typedef double Wide __attribute__((vector_size(WIDE * sizeof(double))));
typedef double Four __attribute__((vector_size(4 * sizeof(double))));

/* The same anywhere in memory: arrays of vectors that are copied as a whole stay in memory. */
typedef double WideLoose __attribute__((vector_size(WIDE * sizeof(double)), aligned(sizeof(double)), may_alias));
typedef double FourLoose __attribute__((vector_size(4 * sizeof(double)), aligned(sizeof(double)), may_alias));

#ifdef __clang__
#define SHUFFLE_FOUR(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
typedef int64_t FourIndex __attribute__((vector_size(4 * sizeof(double))));
#define SHUFFLE_FOUR(a, b, ...) __builtin_shuffle(a, b, (FourIndex){__VA_ARGS__})
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

static inline void take_logarithms(double *values, int count)
{
    for (int p = 0; p < count; p += FUNCTION_BATCH) take_batch_of_logarithms(values + p);
}

/* Arguments of x + iy, into y. */
static inline void take_arguments(double *y, const double *x, int count)
{
    for (int p = 0; p < count; p += FUNCTION_BATCH) take_batch_of_arguments(y + p, x + p);
}

INLINE Lanes spread(double value) { return (Lanes){0} + value; }

#if LANES == 4
INLINE double find_least(Lanes a)
{
    const double left = a[0] < a[1] ? a[0] : a[1], right = a[2] < a[3] ? a[2] : a[3];
    return left < right ? left : right;
}

/* Pairs (x, y) of the even lanes, of the odd lanes. */
INLINE Lanes pair_even(Lanes x, Lanes y) { return SHUFFLE(x, y, 0, 4, 2, 6); }
INLINE Lanes pair_odd(Lanes x, Lanes y) { return SHUFFLE(x, y, 1, 5, 3, 7); }

/* The pairs a and b side by side, for every other lane from the first of out on. */
INLINE void store_joined(double *const *out, int64_t at, Lanes a, Lanes b)
{
    const Lanes first = SHUFFLE(a, b, 0, 1, 4, 5), second = SHUFFLE(a, b, 2, 3, 6, 7);
    memcpy(out[0] + at, &first, sizeof first);
    memcpy(out[2] + at, &second, sizeof second);
}

typedef double Pair __attribute__((vector_size(2 * sizeof(double))));

INLINE void store_single(double *const *out, int64_t at, Lanes a)
{
    const Pair first = {a[0], a[1]}, second = {a[2], a[3]};
    memcpy(out[0] + at, &first, sizeof first);
    memcpy(out[2] + at, &second, sizeof second);
}
#else
INLINE double find_least(Lanes a) { return a[0] < a[1] ? a[0] : a[1]; }
INLINE Lanes pair_even(Lanes x, Lanes y) { return SHUFFLE(x, y, 0, 2); }
INLINE Lanes pair_odd(Lanes x, Lanes y) { return SHUFFLE(x, y, 1, 3); }
INLINE void store_single(double *const *out, int64_t at, Lanes a) { memcpy(out[0] + at, &a, sizeof a); }

INLINE void store_joined(double *const *out, int64_t at, Lanes a, Lanes b)
{
    store_single(out, at, a);
    store_single(out, at + 2, b);
}
#endif

/* The least of the values that are not below the limit; infinity if there are none. */
INLINE double find_least_beyond(Lanes a, double limit)
{
    double least = INFINITY;
    for (int lane = 0; lane < LANES; lane++)
        if (a[lane] >= limit && a[lane] < least) least = a[lane];
    return least;
}

/* One row of the blocks of every lane's element: x[node], y[node] side by side at the lane's own place. */
INLINE void store_row(int shapes, const Lanes *x, const Lanes *y, double *const *out, int64_t offset)
{
#pragma GCC unroll 2
    for (int node = 0; node + 1 < shapes; node += 2) {
        const int64_t at = offset + 2 * node;
        store_joined(out, at, pair_even(x[node], y[node]), pair_even(x[node + 1], y[node + 1]));
        store_joined(out + 1, at, pair_odd(x[node], y[node]), pair_odd(x[node + 1], y[node + 1]));
    }
    if (shapes % 2) {
        const int node = shapes - 1;
        store_single(out, offset + 2 * node, pair_even(x[node], y[node]));
        store_single(out + 1, offset + 2 * node, pair_odd(x[node], y[node]));
    }
}

#endif
