/* Complex numbers in the lanes of vectors, so that a line of code reads as a formula of the page of theory.
 *
 * All functions are inlined and the struct vanishes: a product is two multiplications and two fused ones. Halves of a
 * result that nobody reads cost nothing: c_mul(a, b).im is Im(a b) alone.
 */
#ifndef PBEM_COMPLEX_LANES_H
#define PBEM_COMPLEX_LANES_H
#include <complex.h>

#include "lanes.h"

typedef double complex cplx;

typedef struct {
    Lanes re, im;
} Complex;

/* Real factors and terms may be scalars or lanes. */
#define AS_LANES(a) ((Lanes){0} + (a))
#define c_make(re, im) ((Complex){AS_LANES(re), AS_LANES(im)})
#define c_scale(a, z) c_scale_lanes(AS_LANES(a), z)
#define c_shift(z, a) c_shift_lanes(z, AS_LANES(a))

INLINE Complex c_real(Lanes a) { return (Complex){a, spread(0)}; }
INLINE Complex c_spread(cplx z) { return c_make(creal(z), cimag(z)); }
INLINE Complex c_add(Complex a, Complex b) { return (Complex){a.re + b.re, a.im + b.im}; }
INLINE Complex c_sub(Complex a, Complex b) { return (Complex){a.re - b.re, a.im - b.im}; }
INLINE Complex c_neg(Complex a) { return (Complex){-a.re, -a.im}; }
INLINE Complex c_conj(Complex a) { return (Complex){a.re, -a.im}; }
INLINE Complex c_times_i(Complex a) { return (Complex){-a.im, a.re}; }
INLINE Complex c_scale_lanes(Lanes a, Complex z) { return (Complex){a * z.re, a * z.im}; }
INLINE Complex c_shift_lanes(Complex z, Lanes a) { return (Complex){z.re + a, z.im}; }
INLINE Complex c_mul(Complex a, Complex b) { return (Complex){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }
/* a conj(b) */
INLINE Complex c_mul_conj(Complex a, Complex b)
{
    return (Complex){a.re * b.re + a.im * b.im, a.im * b.re - a.re * b.im};
}

INLINE Complex c_square(Complex a) { return (Complex){a.re * a.re - a.im * a.im, 2 * a.re * a.im}; }
/* |a|^2 */
INLINE Lanes c_norm(Complex a) { return a.re * a.re + a.im * a.im; }
INLINE Complex c_inverse(Complex a) { return c_scale_lanes(1 / c_norm(a), c_conj(a)); }

INLINE void c_put(Complex *a, int lane, cplx z)
{
    a->re[lane] = creal(z);
    a->im[lane] = cimag(z);
}

#endif
