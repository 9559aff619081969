/* Twin of symtop/methods/exact_discrete.py. The maps between chi and Z, and the phases, are no part of a step; the
   caller does them. */

#include "march.h"

#define DIM 8

typedef struct { double I1, twist, kappa, b1, b2, g2, g3; } Par;
typedef struct { double aD1, D1, r1, q1, turn1, aD2, D2, r2, q2, turn2, kappa, half_turns, parts; } Rule;
typedef struct { double s1, s2, f1, f2; } Carry;

static inline double inverse(double s) { return 2.82843 - 1.88562 * s; }

static inline void forces(const Rule *rule, double s1, double s2, Carry *carry) {
    double w = 1.0 / (rule->D1 - rule->kappa * s1);
    carry->f1 = (rule->aD1 + rule->kappa * s1) * w, carry->f2 = (rule->aD2 - rule->kappa * s2) * w;
}

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)par, (void)h;
    carry->s1 = state[0] * state[0] + state[1] * state[1], carry->s2 = state[2] * state[2] + state[3] * state[3];
    forces(rule, carry->s1, carry->s2, carry);
}

static inline void part(const Rule *rule, const double *state, Carry *carry, double *step) {
    const double *q = state + 4;
    double z[4], k[4], s1 = carry->s1, s2 = carry->s2;
    int first = s1 >= s2;
    double lack = first ? (1.0 - s1) - s2 : (1.0 - s2) - s1;
    lack = fabs(lack) > 2e-15 ? 0.5 * 0.5 * lack : 0.0;
    double swell = 0.5 * ((state[0] * q[0] + state[1] * q[1]) * rule->q1 + (state[2] * q[2] + state[3] * q[3]) * rule->q2);
    double e1 = first ? lack * inverse(s1) : 0.0, e2 = first ? 0.0 : lack * inverse(s2);
    double c1 = first ? swell * rule->r1 * inverse(s1) : 0.0, c2 = first ? 0.0 : swell * rule->r2 * inverse(s2);
    for (int i = 0; i < 4; i++) {
        double f = i < 2 ? carry->f1 : carry->f2, e = i < 2 ? e1 : e2, c = i < 2 ? c1 : c2;
        double p = e * (f * state[i] - q[i]) - c * state[i];
        step[i] = q[i] + fma(f, state[i], e * state[i] + p);
        k[i] = fma(f, state[i], p);
        z[i] = state[i] + step[i];
    }
    s1 = z[0] * z[0] + z[1] * z[1], s2 = z[2] * z[2] + z[3] * z[3];
    first = s1 >= s2;
    carry->s1 = s1, carry->s2 = s2;
    forces(rule, first ? 1.0 - s2 : s1, first ? s2 : 1.0 - s1, carry);
    for (int i = 0; i < 4; i++) step[4 + i] = fma(i < 2 ? carry->f1 : carry->f2, z[i], k[i]);
}

static int increment(const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work) {
    (void)par, (void)h;
    part(rule, state, carry, step);
    for (*work = 1; *work < rule->parts; (*work)++) {
        double moved[DIM], more[DIM];
        for (int i = 0; i < DIM; i++) moved[i] = state[i] + step[i];
        part(rule, moved, carry, more);
        for (int i = 0; i < DIM; i++) step[i] = step[i] + more[i];
    }
    return finite_outcome(step[0] + step[2]);
}

MARCH
