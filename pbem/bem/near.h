/* Products of rows whose entries are whole numbers of a unit of each row: half the memory of doubles, and of a row whose
 * entries are of about one size nearly all of their digits. */
#ifndef PBEM_NEAR_H
#define PBEM_NEAR_H
#include <stdint.h>

/* out (rows,) += unit (rows,) times (number (rows, columns) times x (columns,)) */
static void add_whole_rows(const int32_t *number, const double *unit, const double *x, int64_t rows, int64_t columns,
                           double *out)
{
    for (int64_t i = 0; i < rows; i++) {
        const int32_t *own = number + i * columns;
        double sum = 0;
        for (int64_t j = 0; j < columns; j++) sum += own[j] * x[j];
        out[i] += unit[i] * sum;
    }
}

#endif
