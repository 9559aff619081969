/* Twin of symtop/methods/runge_kutta/explicit.py; STAGES is the number of stages, AXIS, ATTITUDE or ANGLES the chart. */

#include "march.h"

#include "fields.h"

#define ENTRIES (STAGES > 1 ? STAGES * (STAGES - 1) / 2 : 1)

typedef struct { double a[ENTRIES], b[STAGES]; } Rule;
typedef struct { double unused; } Carry;

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)par, (void)rule, (void)state, (void)h;
    carry->unused = 0.0;
}

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
    *work = STAGES;
    return judge(state, step);
}

MARCH
