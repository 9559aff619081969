/* Twin of symtop/methods/runge_kutta/kahan.py: on (e, L), or with -DFRAME on (e, L, a). */

#include "march.h"

#include "vectors.h"

#ifdef FRAME
#define DIM 9
#else
#define DIM 6
#endif

typedef struct { double I1, mgl, twist; } Par;
typedef struct { double unused; } Rule;
typedef struct { double unused; } Carry;

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)par, (void)rule, (void)state, (void)h;
    carry->unused = 0.0;
}

static inline Vector image(double g, double c, Vector e, Vector L, Vector d) {
    Vector y = plus(scaled(1.0 - g * c * e.z, d), -g, cross(L, d));
    return (Vector){y.x, y.y, y.z + g * c * dot(e, d)};
}

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    Vector e = {state[0], state[1], state[2]}, L = {state[3], state[4], state[5]};
    Vector x = {1.0, 0.0, 0.0}, y = {0.0, 1.0, 0.0}, z = {0.0, 0.0, 1.0};
    double g = 0.5 * h / par->I1, c = 0.5 * h * par->mgl;
    Vector right = plus(scaled(2.0 * g, cross(L, e)), 2.0 * g * c * e.z, e);
    (void)rule, (void)carry;
    right.z = right.z - 2.0 * g * c * dot(e, e);
    Vector d = solved(image(g, c, e, L, x), image(g, c, e, L, y), image(g, c, e, L, z), right);
    Vector D = {-c * (2.0 * e.y + d.y), c * (2.0 * e.x + d.x), 0.0};
    step[0] = d.x, step[1] = d.y, step[2] = d.z, step[3] = D.x, step[4] = D.y, step[5] = D.z;
    *work = 1;
#ifdef FRAME
    Vector a = {state[6], state[7], state[8]}, half = scaled(0.5 * h / par->I1, L);
    right = plus(scaled(2.0, cross(half, a)), 0.5 * h / par->I1, cross(D, a));
    Vector turned = plus(plus(right, 1.0, cross(half, right)), dot(half, right), half);
    Vector b = scaled(1.0 / (1.0 + dot(half, half)), turned);
    step[6] = b.x, step[7] = b.y, step[8] = b.z;
    return finite_outcome(d.x + d.y + d.z + b.x + b.y + b.z);
#else
    return finite_outcome(d.x + d.y + d.z);
#endif
}

MARCH
