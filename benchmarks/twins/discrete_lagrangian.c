/* Twin of symtop/methods/lagrangian/discrete_lagrangian.py; NODES is the number of nodes of the rule. */

#include "march.h"
#include "sines.h"

#define DIM 4
#define SMALLEST 1e-18
#define ROUNDING 1e-12

typedef struct { double I1, I3, mgl, p_psi, north, south; } Par;
typedef struct { double nodes[NODES], weights[NODES], tolerance, iterations; } Rule;
typedef struct { double W0[4]; } Carry;
typedef struct { double up, down, C, S, Y, P0, P1, Q0, Q1, dP0, dP1, dQ0, dQ1; } Sums;
typedef struct { double v, W0, W1, v_slope, W0_slope, W1_slope; } Forces;

static inline Sums node_sums(const Rule *rule, double theta, double d, double sin_start, double cos_start) {
    Sums t = {0};
    double first = 0.0, shift = 0.0, square = 0.0;
    for (int i = 0; i < NODES; i++) {
        double a = rule->nodes[i], w = rule->weights[i], sin_x = sin_start, cos_x = cos_start;
        if (a != 0.0) sines(0.5 * (theta + a * d), &sin_x, &cos_x);
        double low = sin_x * sin_x, high = cos_x * cos_x, s = 2.0 * sin_x * cos_x, c = high - low;
        if (i == 0) first = low;
        double gap = low - first;
        shift += w * gap;
        square += w * gap * gap;
        t.up += w * high;
        t.down += w * low;
        t.S += w * s * s;
        double left = w * (1.0 - a), right = w * a, twice = (c - s) * (c + s);
        t.P0 += left * s;
        t.P1 += right * s;
        t.Q0 += left * s * c;
        t.Q1 += right * s * c;
        t.dP0 += left * a * c;
        t.dP1 += right * a * c;
        t.dQ0 += left * a * twice;
        t.dQ1 += right * a * twice;
    }
    t.C = t.up - t.down;
    t.Y = 4.0 * (square - shift * shift);
    return t;
}

static inline void start_trig(const Rule *rule, double theta, double *s, double *c) {
    *s = *c = 0.0;
    if (rule->nodes[0] == 0.0) sines(0.5 * theta, s, c);
}

static inline Forces forces(const Par *par, const Sums *t) {
    double spread = par->I1 - par->I3, inverse = 1.0 / (par->I1 * t->S + par->I3 * t->Y);
    double v = (par->north * t->up + par->south * t->down) * inverse;
    double v_slope = (par->p_psi * t->P1 - 2.0 * v * (spread * t->Q1 + par->I3 * t->C * t->P1)) * inverse;
    double bracket = v * (par->p_psi - v * par->I3 * t->C) - par->mgl;
    double bracket_slope = v_slope * (par->p_psi - 2.0 * v * par->I3 * t->C) + v * v * par->I3 * t->P1;
    double square = spread * v * v, square_slope = 2.0 * spread * v * v_slope;
    Forces f = {
        v,
        bracket * t->P0 - square * t->Q0,
        bracket * t->P1 - square * t->Q1,
        v_slope,
        bracket_slope * t->P0 + bracket * t->dP0 - square_slope * t->Q0 - square * t->dQ0,
        bracket_slope * t->P1 + bracket * t->dP1 - square_slope * t->Q1 - square * t->dQ1,
    };
    return f;
}

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    double s, c;
    (void)h;
    start_trig(rule, state[0], &s, &c);
    Sums sums = node_sums(rule, state[0], 0.0, s, c);
    double W0 = forces(par, &sums).W0;
    for (int i = 0; i < 4; i++) carry->W0[i] = W0;
}

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    double theta = state[0], lever = h / par->I1, flight = lever * state[1], scale = lever * h, s, c, correction;
    double size = INFINITY, last;
    double *past = carry->W0;
    start_trig(rule, theta, &s, &c);
    double d = flight - scale * (4.0 * (past[0] + past[2]) - 6.0 * past[1] - past[3]);
    Sums sums = node_sums(rule, theta, d, s, c);
    Forces force = forces(par, &sums);
    long effort = 1, most = (long)rule->iterations;
    int outcome = 2;
    for (;;) {
        correction = (lever * (state[1] - h * force.W0) - d) / (1.0 + scale * force.W0_slope);
        last = size;
        size = fabs(correction);
        if (size <= rule->tolerance * (fabs(flight) + fabs(scale * force.W0)) + SMALLEST ||
            (0.5 * last <= size && size <= ROUNDING)) {
            d += correction;
            outcome = chart_outcome(theta + d);
            break;
        }
        if (effort >= most) break;
        d = effort == most / 2 ? flight : d + correction;
        sums = node_sums(rule, theta, d, s, c);
        force = forces(par, &sums);
        effort++;
    }
    double kick0 = fma(h, force.W0, h * (force.W0_slope * correction));
    double kick1 = fma(h, force.W1, h * (force.W1_slope * correction));
    double turn = fma(h, force.v, h * (force.v_slope * correction)), C = sums.C - sums.P1 * correction;
    step[0] = lever * (state[1] - kick0);
    step[1] = -(kick0 + kick1);
    step[2] = turn;
    step[3] = fma(h, par->p_psi / par->I3, -(turn * C));
    past[3] = past[2];
    past[2] = past[1];
    past[1] = past[0];
    past[0] = force.W0 + force.W0_slope * correction;
    *work = effort;
    return outcome;
}

MARCH
