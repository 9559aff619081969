/* Twin of symtop/methods/splitting/angles.py; DRIFTS is the number of drifts in the table. */

#include "march.h"
#include "sines.h"

#define DIM 4

typedef struct { double I1, I3, mgl, p_psi, north, south; } Par;
typedef struct { double drift[DRIFTS], kick[DRIFTS + 1], bend[DRIFTS + 1], forces, turn, boost; } Rule;
typedef struct { double slope, rate, turn; } Carry;

static inline Carry force(const Par *par, double theta) {
    double s, c;
    sines(0.5 * theta, &s, &c);
    double up = par->north / (s * s), down = par->south / (c * c), tilt = s * c;
    double slope = tilt * ((up + down) * (down - up) / (8.0 * par->I1) - 2.0 * par->mgl);
    double rate = (up + down) / (4.0 * par->I1);
    Carry found = {slope, rate, rate * (c * c - s * s)};
    return found;
}

static inline void kick(const Par *par, const Carry *now, double *step, double tau) {
    step[1] = step[1] - tau * now->slope;
    step[2] = step[2] + tau * now->rate;
    step[3] = step[3] + tau * (par->p_psi / par->I3 - now->turn);
}

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)rule, (void)h;
    *carry = force(par, state[0]);
}

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    Carry now = *carry;
    (void)h;
    for (int i = 0; i < DIM; i++) step[i] = 0.0;
    for (int i = 0; i < DRIFTS; i++) {
        if (rule->kick[i] != 0.0) kick(par, &now, step, rule->kick[i]);
        step[0] = step[0] + rule->drift[i] * (state[1] + step[1]);
        if (rule->kick[i + 1] != 0.0) now = force(par, state[0] + step[0]);
    }
    if (rule->kick[DRIFTS] != 0.0) kick(par, &now, step, rule->kick[DRIFTS]);
    else if (rule->kick[0] != 0.0) now = force(par, state[0] + step[0]);
    *carry = now;
    *work = (long)rule->forces;
    return chart_outcome(state[0] + step[0]);
}

MARCH
