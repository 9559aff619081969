/* Twin of symtop/methods/lagrangian/exact_discrete.py. The maps between chi and Z, and the phases, are no part of a step; the
   caller does them. */

#include "march.h"

#define DIM 8

typedef struct { double I1, twist, kappa, b1, b2, g2, g3; } Par;
typedef struct { double aD1, D1, r1, q1, turn1, aD2, D2, r2, q2, turn2, kappa, half_turns, parts; } Rule;
typedef struct { double s1, s2, f1, f2, low[DIM]; } Carry;

static inline double inverse(double s) { return 2.82843 - 1.88562 * s; }

static inline void forces(const Rule *rule, double s1, double s2, Carry *carry) {
    double w = 1.0 / (rule->D1 - rule->kappa * s1);
    carry->f1 = (rule->aD1 + rule->kappa * s1) * w, carry->f2 = (rule->aD2 - rule->kappa * s2) * w;
}

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)par, (void)h;
    carry->s1 = state[0] * state[0] + state[1] * state[1], carry->s2 = state[2] * state[2] + state[3] * state[3];
    forces(rule, carry->s1, carry->s2, carry);
    memset(carry->low, 0, sizeof carry->low);
}

/* (high + low) + (more + late): what was added to `high`; `late` joins what is left */
static inline double sum(double *high, double *left, double low, double more, double late) {
    double addend = more + low, total = *high + addend, virtual_part = total - *high;
    *left = (((*high - (total - virtual_part)) + (addend - virtual_part)) + ((more - addend) + low)) + late;
    *high = total;
    return addend;
}

/* the same for (high + low) + f (x + under) */
static inline double kick(double *high, double *left, double low, double f, double x, double under) {
    double small = f * under + low, addend = fma(f, x, small), total = *high + addend, virtual_part = total - *high;
    double push = f * x, rest = fma(f, x, -push) + ((push - addend) + small);
    *left = ((*high - (total - virtual_part)) + (addend - virtual_part)) + rest;
    *high = total;
    return addend;
}

/* one application of the map: `state` becomes what it leads to, `step` the increment */
static inline void part(const Rule *rule, double *state, Carry *carry, double *step) {
    double *x = state, *u = state + 4, *lx = carry->low, *lu = carry->low + 4, p[4];
    double s1 = carry->s1, s2 = carry->s2, f1 = carry->f1, f2 = carry->f2;
    int longer = s1 >= s2;
    double lack = longer ? (1.0 - s1) - s2 : (1.0 - s2) - s1;
    lack = fabs(lack) > 2e-15 ? 0.5 * lack : 0.0;
    double out1 = x[0] * u[0] + x[1] * u[1] - f1 * s1, out2 = x[2] * u[2] + x[3] * u[3] - f2 * s2;
    double swell = out1 * rule->q1 + out2 * rule->q2;
    double e1 = longer ? lack * inverse(s1) : 0.0, e2 = longer ? 0.0 : lack * inverse(s2);
    double c1 = longer ? swell * rule->r1 * inverse(s1) : 0.0, c2 = longer ? 0.0 : swell * rule->r2 * inverse(s2);
    c1 = 2.0 * e1 * f1 - c1, c2 = 2.0 * e2 * f2 - c2;
    for (int i = 0; i < 4; i++) {
        double e = i < 2 ? e1 : e2, c = i < 2 ? c1 : c2;
        p[i] = c * x[i] - e * u[i];
        step[i] = sum(&x[i], &lx[i], lx[i] + (e * x[i] + p[i]), u[i], lu[i]);
    }
    s1 = x[0] * x[0] + x[1] * x[1], s2 = x[2] * x[2] + x[3] * x[3];
    longer = s1 >= s2;
    carry->s1 = s1, carry->s2 = s2;
    forces(rule, longer ? 1.0 - s2 : s1, longer ? s2 : 1.0 - s1, carry);
    for (int i = 0; i < 4; i++) {
        double f = i < 2 ? carry->f1 : carry->f2;
        step[4 + i] = kick(&u[i], &lu[i], lu[i] + p[i], f + f, x[i], lx[i]);
    }
}

static int increment(const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work) {
    double after[DIM], more[DIM];
    (void)par, (void)h;
    memcpy(after, state, sizeof after);
    part(rule, after, carry, step);
    for (*work = 1; *work < rule->parts; (*work)++) part(rule, after, carry, more);
    for (int i = 0; *work > 1 && i < DIM; i++) {
        step[i] = after[i] - state[i];
        carry->low[i] = carry->low[i] + (after[i] - (state[i] + step[i]));
    }
    return finite_outcome(step[0] + step[2]);
}

#undef ADD
#define ADD(high, low, increment) (*(high) = *(high) + (increment), *(low) = 0.0) /* the carry has what it rounds off */

MARCH
