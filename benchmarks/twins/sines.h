/* Twin of symtop/core/sines.py: sine and cosine by polynomials, without a call and without a branch. */

#include <math.h>

static const double SINE[] = {
    -0.1666666666666663,    0.00833333333332184,     -0.00019841269829358203,
    2.7557313538206325e-06, -2.5050734298833298e-08, 1.5895424920929918e-10,
};
static const double COSINE[] = {
    0.041666666666666595,   -0.0013888888888873422, 2.480158728908732e-05,
    -2.755731424937183e-07, 2.087571063268065e-09,  -1.1359056871745034e-11,
};
#define TO_QUADRANTS 0.6366197723675814
#define QUARTER 1.5707963267948966
#define QUARTER_LOW 6.123233995736766e-17
#define UNITS 6755399441055744.0
#define FOURS 27021597764222976.0
#define DIAGONAL 0.7071067811865476

static inline void sines(double x, double *s, double *c) {
    double n = fma(x, TO_QUADRANTS, UNITS) - UNITS, near = fma(-n, QUARTER, x);
    double r = fma(-n, QUARTER_LOW, near), t = fma(-n, QUARTER_LOW, near - r), z = r * r, z2 = z * z;
    double tail = fma(fma(SINE[5], z, SINE[4]), z2, fma(SINE[3], z, SINE[2]));
    double odd = r + fma(r * z, fma(tail, z2, fma(SINE[1], z, SINE[0])), t);
    tail = fma(fma(COSINE[5], z, COSINE[4]), z2, fma(COSINE[3], z, COSINE[2]));
    double w = fma(-0.5, z, 1.0), rest = fma(-r, t, fma(-0.5, z, 1.0 - w));
    double even = w + fma(z2, fma(tail, z2, fma(COSINE[1], z, COSINE[0])), rest);
    int lost = fabs(r) > 1.0;
    odd = lost ? DIAGONAL : odd;
    even = lost ? DIAGONAL : even;
    double quadrant = n - ((n + FOURS) - FOURS);
    int aside = fabs(quadrant) == 1.0, opposite = fabs(quadrant) == 2.0;
    double sine = aside ? even : odd, cosine = aside ? odd : even;
    *s = opposite | (quadrant == -1.0) ? -sine : sine;
    *c = opposite | (quadrant == 1.0) ? -cosine : cosine;
}
