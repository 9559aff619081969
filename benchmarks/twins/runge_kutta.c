/* Twin of symtop/methods/runge_kutta/explicit.py, or projected.py; STAGES is the number of stages, AXIS, ATTITUDE or ANGLES
   the chart, which is that of the axis if steps are PROJECTED. */

#include "march.h"

#include "fields.h"

#define ENTRIES (STAGES > 1 ? STAGES * (STAGES - 1) / 2 : 1)

typedef struct { double a[ENTRIES], b[STAGES]; } Rule;
typedef struct { double unused; } Carry;

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)par, (void)rule, (void)state, (void)h;
    carry->unused = 0.0;
}

#ifdef PROJECTED
#define SMALL 1e-8

static inline double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline double product(const Par *par, const double *u, const double *v) {
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2] + par->weight * (u[3] * v[3] + u[4] * v[4]);
}

static inline void take(double *u, double part, const double *v) {
    for (int m = 0; m < 5; m++) u[m] = u[m] - part * v[m];
}

static inline double inverse(double own, double whole) { return own > SMALL * whole ? 1.0 / own : 0.0; }

static inline void project(const Par *par, const double *state, double *step) {
    double end[DIM], a = 1.0 / par->I1;
    for (int m = 0; m < DIM; m++) end[m] = state[m] + step[m];
    const double one[5] = {end[0], end[1], end[2], 0.0, 0.0}, two[5] = {end[3], end[4], end[5], end[0], end[1]};
    const double three[5] = {0.0, 0.0, par->mgl, a * end[3], a * end[4]};
    double c2[5], c3[5], i1 = 1.0 / product(par, one, one), p21 = product(par, two, one);
    for (int m = 0; m < 5; m++) c2[m] = two[m], c3[m] = three[m];
    take(c2, p21 * i1, one);
    double i2 = inverse(product(par, c2, c2), product(par, two, two));
    double p31 = product(par, three, one), p32 = product(par, three, c2);
    take(c3, p31 * i1, one);
    take(c3, p32 * i2, c2);
    double i3 = inverse(product(par, c3, c3), product(par, three, three));
    for (int pass = 0; pass < 2; pass++) {
        const double *e = end, *L = end + 3;
        double t1 = 0.5 * (1.0 - dot(e, e)) * i1, t2 = (par->p_psi - dot(L, e) - p21 * t1) * i2;
        double t3 = (par->energy - 0.5 * a * dot(L, L) - par->mgl * e[2] - p31 * t1 - p32 * t2) * i3;
        double moved[5] = {0.0, 0.0, 0.0, 0.0, 0.0};
        take(moved, -t1, one);
        take(moved, -t2, c2);
        take(moved, -t3, c3);
        for (int m = 0; m < 5; m++) step[m] = step[m] + (m < 3 ? moved[m] : par->weight * moved[m]);
        for (int m = 0; m < DIM; m++) end[m] = state[m] + step[m];
    }
}
#endif

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    double slopes[STAGES][DIM], place[DIM];
    int row = 0;
    (void)carry;
    field(par, state, slopes[0]);
    for (int i = 1; i < STAGES; i++) {
        for (int m = 0; m < DIM; m++) place[m] = state[m];
        for (int j = 0; j < i; j++) {
            double weight = h * rule->a[row + j];
            for (int m = 0; m < DIM; m++) place[m] = place[m] + weight * slopes[j][m];
        }
        row += i;
        field(par, place, slopes[i]);
    }
    for (int m = 0; m < DIM; m++) step[m] = 0.0;
    for (int i = 0; i < STAGES; i++) {
        double weight = h * rule->b[i];
        for (int m = 0; m < DIM; m++) step[m] = step[m] + weight * slopes[i][m];
    }
#ifdef PROJECTED
    project(par, state, step);
#endif
    *work = STAGES;
    return judge(state, step);
}

MARCH
