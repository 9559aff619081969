/* Twin of symtop/methods/taylor/series_general.py with fixed steps; AXIS or ATTITUDE is the chart. */

#include <math.h>

#include "march.h"

#include "fields.h"

#define ORDER 16

typedef struct { double unused; } Rule;
typedef struct { double unused; } Carry;

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)par, (void)rule, (void)state, (void)h;
    carry->unused = 0.0;
}

#ifdef AXIS

#define SUMS 3

static inline void products(double *t, const double *a, const double *b) {
    t[0] = fma(-a[5], b[1], fma(a[4], b[2], t[0]));
    t[1] = fma(-a[3], b[2], fma(a[5], b[0], t[1]));
    t[2] = fma(-a[4], b[0], fma(a[3], b[1], t[2]));
}

static inline void slope(const Par *par, const double *t, const double *y, double *rate) {
    double inverse = 1.0 / par->I1;
    for (int m = 0; m < 3; m++) rate[m] = inverse * t[m];
    rate[3] = -par->mgl * y[1], rate[4] = par->mgl * y[0], rate[5] = 0.0;
}

#else

#define SUMS 6

static inline void products(double *t, const double *a, const double *b) {
    t[0] = fma(-a[6], b[3], fma(-a[5], b[2], fma(-a[4], b[1], t[0])));
    t[1] = fma(-a[6], b[2], fma(a[5], b[3], fma(a[4], b[0], t[1])));
    t[2] = fma(-a[4], b[3], fma(a[6], b[1], fma(a[5], b[0], t[2])));
    t[3] = fma(-a[5], b[1], fma(a[4], b[2], fma(a[6], b[0], t[3])));
    t[4] = fma(a[0], b[2], fma(a[1], b[3], t[4]));
    t[5] = fma(-a[0], b[1], fma(a[2], b[3], t[5]));
}

static inline void slope(const Par *par, const double *t, const double *y, double *rate) {
    double half = 0.5 / par->I1, turn = 0.5 * par->lean /* here the twist */, pull = 2.0 * par->mgl;
    rate[0] = half * t[0] - turn * y[3], rate[1] = half * t[1] + turn * y[2];
    rate[2] = half * t[2] - turn * y[1], rate[3] = half * t[3] + turn * y[0];
    rate[4] = -pull * t[5], rate[5] = pull * t[4], rate[6] = 0.0;
}

#endif

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    double c[ORDER + 1][DIM], rate[DIM];
    (void)rule, (void)carry;
    for (int m = 0; m < DIM; m++) c[0][m] = state[m];
    for (int n = 0; n < ORDER; n++) {
        double total[SUMS] = {0.0};
        for (int j = 0; j <= n; j++) products(total, c[j], c[n - j]);
        slope(par, total, c[n], rate);
        for (int m = 0; m < DIM; m++) c[n + 1][m] = rate[m] / (n + 1);
    }
    for (int m = 0; m < DIM; m++) step[m] = c[ORDER][m];
    for (int n = ORDER - 1; n > 0; n--)
        for (int m = 0; m < DIM; m++) step[m] = fma(h, step[m], c[n][m]);
    for (int m = 0; m < DIM; m++) step[m] = h * step[m];
    *work = 1;
    return judge(state, step);
}

MARCH
