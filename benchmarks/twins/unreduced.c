/* Twin of symtop/methods/lagrangian/unreduced.py; NODES is the number of nodes of the rule. */

#include "march.h"

#define DIM 6
#define LEAST (0.25 * 2.220446049250313e-16)

typedef struct { double I1, I3, mgl, c_phi, c_psi; } Par;
typedef struct { double nodes[NODES], weights[NODES], tolerance, iterations; } Rule;
typedef struct { double past[3][3]; } Carry;
typedef struct { double before, after, stiffness, before_v, before_u, after_v, after_u, across, mixed; } Sums;

static inline Sums node_sums(const Par *par, const Rule *rule, double theta, double w, double v, double u, double h) {
    Sums t = {0};
    double spread = par->I1 - par->I3;
    for (int i = 0; i < NODES; i++) {
        double a = rule->nodes[i], share = rule->weights[i], place = theta + a * (h * w);
        double s = sin(place), c = cos(place), left = share * (1.0 - a), right = share * a;
        double bracket = v * (spread * v * c - par->I3 * u) + par->mgl;
        double force_v = s * (2.0 * spread * v * c - par->I3 * u), force_u = -par->I3 * s * v;
        t.before += left * s * bracket;
        t.after += right * s * bracket;
        t.stiffness += left * a * (c * bracket - spread * v * v * s * s);
        t.before_v += left * force_v;
        t.before_u += left * force_u;
        t.after_v += right * force_v;
        t.after_u += right * force_u;
        t.across += share * (par->I1 * s * s + par->I3 * c * c);
        t.mixed += share * par->I3 * c;
    }
    return t;
}

static inline void solve(const double *one, const double *two, const double *three, const double *b, double *x) {
    double upper = two[2] / three[2], lower = one[2] / three[2];
    double pivot = two[1] - upper * three[1], middle = one[1] - lower * three[1];
    double rest = b[1] - upper * b[2], factor = middle / pivot, slope = two[0] - upper * three[0];
    x[0] = (b[0] - lower * b[2] - factor * rest) / (one[0] - lower * three[0] - factor * slope);
    x[1] = (rest - slope * x[0]) / pivot;
    x[2] = (b[2] - three[0] * x[0] - three[1] * x[1]) / three[2];
}

static inline void rates(const Par *par, const double *state, double *rate) {
    double s = sin(state[0]), c = cos(state[0]), precession = (state[4] - state[5] * c) / (par->I1 * s * s);
    rate[0] = state[3] / par->I1;
    rate[1] = precession;
    rate[2] = state[5] / par->I3 - precession * c;
}

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)rule, (void)h;
    for (int i = 0; i < 3; i++) rates(par, state, carry->past[i]);
}

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    double theta = state[0], rate[3], last = INFINITY;
    const double *momentum = state + 3;
    long effort = 0, most = (long)rule->iterations;
    int outcome = 2;
    for (int i = 0; i < 3; i++) rate[i] = 3.0 * (carry->past[0][i] - carry->past[1][i]) + carry->past[2][i];
    Sums t = node_sums(par, rule, theta, rate[0], rate[1], rate[2], h);
    while (effort < most) {
        effort++;
        double across = t.across + 0.5 * h * par->c_phi, along = par->I3 + 0.5 * h * par->c_psi;
        double right[3] = {
            momentum[0] - par->I1 * rate[0] + h * t.before,
            momentum[1] - across * rate[1] - t.mixed * rate[2],
            momentum[2] - t.mixed * rate[1] - along * rate[2],
        };
        double one[3] = {par->I1 - h * h * t.stiffness, -h * t.before_v, -h * t.before_u};
        double two[3] = {h * t.after_v, across, t.mixed}, three[3] = {h * t.after_u, t.mixed, along}, fix[3];
        solve(one, two, three, right, fix);
        double change = fabs(fix[0]) + fabs(fix[1]) + fabs(fix[2]);
        double size = fabs(rate[0]) + fabs(rate[1]) + fabs(rate[2]);
        if (change <= LEAST * size || (0.5 * last <= change && change <= rule->tolerance * size)) {
            outcome = chart_outcome(theta + h * rate[0]);
            break;
        }
        last = change;
        for (int i = 0; i < 3; i++) rate[i] = rate[i] + fix[i];
        if (effort == most / 2) rates(par, state, rate);
        t = node_sums(par, rule, theta, rate[0], rate[1], rate[2], h);
    }
    for (int i = 0; i < 3; i++) step[i] = h * rate[i];
    step[3] = par->I1 * rate[0] + h * t.after - momentum[0];
    step[4] = t.across * rate[1] + t.mixed * rate[2] - 0.5 * h * par->c_phi * rate[1] - momentum[1];
    step[5] = t.mixed * rate[1] + par->I3 * rate[2] - 0.5 * h * par->c_psi * rate[2] - momentum[2];
    for (int i = 0; i < 3; i++) {
        carry->past[2][i] = carry->past[1][i];
        carry->past[1][i] = carry->past[0][i];
        carry->past[0][i] = rate[i];
    }
    *work = effort;
    return outcome;
}

MARCH
