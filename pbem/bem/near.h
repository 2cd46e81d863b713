/* Products of rows of near elements, in blocks: in full, or as whole numbers of a unit of each row, which is half the
 * memory of doubles and of a row whose entries are of about one size nearly all of their digits.
 *
 * A product reads every entry once: memory tells its time. What follows is asked for ahead, as rows are too short for
 * the processor to see that it is a stream. A row's sum does not depend on the rows beside it.
 */
#ifndef PBEM_NEAR_H
#define PBEM_NEAR_H
#include "lanes.h"

/* So many bytes ahead, by lines of the cache. */
#define AHEAD 4096
#define LINE 64

typedef int32_t WideWhole __attribute__((vector_size(WIDE * sizeof(int32_t)), aligned(sizeof(int32_t)), may_alias));

/* Entries (rows, columns) of the rows (rows,) of a result in the columns (columns,) of v: `full`, or number times unit
 * (rows,). */
typedef struct {
    const int64_t *row, *column;
    const double *full, *unit;
    const int32_t *number;
    int64_t rows, columns;
} Block;

INLINE Wide load_entries(const double *full, const int32_t *number, int64_t at)
{
    if (number) return __builtin_convertvector(*(const WideWhole *)(number + at), Wide);
    return *(const WideLoose *)(full + at);
}

/* Sum over the columns of a row, of which full or number is not NULL, times x (columns,). */
INLINE double sum_row(const double *full, const int32_t *number, int64_t columns, const double *x)
{
    Wide even = {0}, odd = {0};
    double sum = 0;
    int64_t j = 0;
    for (; j + 2 * WIDE <= columns; j += 2 * WIDE) {
        const char *ahead = (number ? (const char *)(number + j) : (const char *)(full + j)) + AHEAD;
        __builtin_prefetch(ahead);
        if (2 * WIDE * (number ? sizeof *number : sizeof *full) > LINE) __builtin_prefetch(ahead + LINE);
        even += load_entries(full, number, j) * *(const WideLoose *)(x + j);
        odd += load_entries(full, number, j + WIDE) * *(const WideLoose *)(x + j + WIDE);
    }
    for (; j < columns; j++) sum += (number ? number[j] : full[j]) * x[j];
    even += odd;
    for (int lane = 0; lane < WIDE / 2; lane++) sum += even[lane] + even[lane + WIDE / 2];
    return sum;
}

/* out += block times v; x: room for its columns. */
static void add_block(const Block *b, const double *v, double *x, double *out)
{
    for (int64_t j = 0; j < b->columns; j++) x[j] = v[b->column[j]];
    if (b->number)
        for (int64_t i = 0; i < b->rows; i++)
            out[b->row[i]] += b->unit[i] * sum_row(NULL, b->number + i * b->columns, b->columns, x);
    else
        for (int64_t i = 0; i < b->rows; i++)
            out[b->row[i]] += sum_row(b->full + i * b->columns, NULL, b->columns, x);
}

#endif
