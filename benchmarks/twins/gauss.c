/* Twin of symtop/methods/runge_kutta/gauss.py on (e, L), with -DAXIS, or on (e, L, a), with -DFRAME.

   The Python kernel is compiled once for all numbers of stages, and so is this: the number is read from the table.
   It is the twin of the sweep: where sweeps do not converge and Python goes on with Newton, this ends. */

#include "march.h"

#include "fields.h"

#define MOST 6
#define SWEEPS 100
#define FARTHEST 1e3
#define PACE 0.68
#define STILL 5 /* L_z has no slope: its increments stay zero */
#define ROUND_OFF 1e-14

typedef struct { double stages, mu[MOST][MOST], b[MOST], predict[MOST][MOST]; } Rule;
typedef struct { double L[MOST][DIM], next[MOST][DIM], weights[MOST], scale; } Carry;

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    int stages = (int)rule->stages;
    double slope[DIM], inner = 0.0;
    for (int i = 0; i < stages; i++) carry->weights[i] = h * rule->b[i];
    if (stages > 2) {
        for (int i = 1; i < stages - 1; i++) inner += carry->weights[i];
        carry->weights[0] = carry->weights[stages - 1] = 0.5 * (h - inner);
    }
    double momentum = sqrt(state[3] * state[3] + state[4] * state[4] + state[5] * state[5]);
    momentum += sqrt(par->I1 * fabs(par->mgl));
    carry->scale = momentum > 0.0 ? 1.0 / momentum : 1.0;
    field(par, state, slope);
    for (int i = 0; i < stages; i++)
        for (int m = 0; m < DIM; m++) carry->L[i][m] = carry->weights[i] * slope[m];
}

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    int stages = (int)rule->stages, outcome = 2;
    double last = INFINITY;
    long effort = 0;
    (void)h;
    for (int i = 0; i < stages; i++) {
        for (int m = 0; m < DIM; m++) carry->next[i][m] = 0.0;
        for (int j = 0; j < stages; j++)
            for (int m = 0; m < DIM; m++)
                if (m != STILL) carry->next[i][m] += rule->predict[i][j] * carry->L[j][m];
    }
    for (int i = 0; i < stages; i++)
        for (int m = 0; m < DIM; m++) carry->L[i][m] = carry->next[i][m];
    while (effort < SWEEPS) {
        double gap = 0.0, gap_momentum = 0.0, correction;
        for (int i = 0; i < stages; i++) {
            double place[DIM] = {0.0}, slope[DIM];
            for (int j = 0; j < stages; j++)
                for (int m = 0; m < DIM; m++)
                    if (m != STILL) place[m] += rule->mu[i][j] * carry->L[j][m];
            for (int m = 0; m < DIM; m++) place[m] = state[m] + place[m];
            field(par, place, slope);
            for (int m = 0; m < DIM; m++) {
                if (m == STILL) continue;
                double value = carry->weights[i] * slope[m];
                double change = fabs(value - carry->L[i][m]), *largest = 3 <= m && m < 6 ? &gap_momentum : &gap;
                *largest = change > *largest ? change : *largest;
                carry->L[i][m] = value;
            }
        }
        effort++;
        gap_momentum *= carry->scale;
        correction = gap_momentum > gap ? gap_momentum : gap;
        if (!(0.0 < correction && correction < last)) {
            if (correction < ROUND_OFF) {
                outcome = 0;
                break;
            }
            if (!(correction <= FARTHEST * pow(PACE, (double)effort))) break;
        }
        last = correction;
    }
    for (int m = 0; m < DIM; m++) step[m] = 0.0;
    for (int i = 0; i < stages; i++)
        for (int m = 0; m < DIM; m++) step[m] += carry->L[i][m];
    *work = effort;
    return isfinite(step[0]) ? outcome : 2;
}

MARCH
