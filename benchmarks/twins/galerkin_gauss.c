/* Twin of symtop/methods/lagrangian/galerkin_gauss.py. */

#include "march.h"
#include "galerkin_node.h"

#define DIM 6
#define SMALLEST 1e-18
#define ROUNDING 1e-12

typedef struct {
    double c[NODES], b[NODES], reach[NODES][NODES], last[NODES], predict[NODES][NODES], tolerance, iterations;
} Rule;
typedef struct { double forces[NODES]; } Carry;
typedef struct {
    double forces[NODES], stiffness[NODES], souths[NODES], norths[NODES], rolls[NODES];
    double souths_by[NODES], norths_by[NODES], rolls_by[NODES];
} Trial;

static inline double reached(const Rule *rule, const double *forces, int i) {
    double total = 0.0;
    for (int j = 0; j < NODES; j++) total += rule->reach[i][j] * forces[j];
    return total;
}

static inline Trial evaluate(
    const Par *par, const Rule *rule, double theta, double momentum, double h, double lever, const double *forces
) {
    Trial found;
    for (int i = 0; i < NODES; i++) {
        double force = h * reached(rule, forces, i), b = rule->b[i];
        Node at = node(par, theta + lever * (rule->c[i] * momentum + force));
        Pull there = pull(par, &at, par->south, par->north);
        double precession = at.d * par->south + at.a * par->north, bend = there.south + there.north;
        found.forces[i] = -there.slope;
        found.stiffness[i] = there.stiffness;
        found.souths[i] = b * at.d;
        found.norths[i] = b * at.a;
        found.rolls[i] = b * (precession * at.cosine);
        found.souths_by[i] = b * (at.d * at.tangent);
        found.norths_by[i] = -b * (at.a / at.tangent);
        found.rolls_by[i] = b * (bend * at.cosine - precession * at.sine);
    }
    return found;
}

static inline void correct(
    const Rule *rule, const Trial *found, const double *forces, double scale, double *change
) {
    double rows[NODES][NODES + 1], inverse[NODES];
    for (int i = 0; i < NODES; i++) {
        double stiffness = scale * found->stiffness[i];
        for (int j = 0; j < NODES; j++) rows[i][j] = stiffness * rule->reach[i][j];
        rows[i][i] = rows[i][i] + 1.0;
        rows[i][NODES] = found->forces[i] - forces[i];
    }
    for (int k = 0; k < NODES - 1; k++) {
        inverse[k] = 1.0 / rows[k][k];
        for (int i = k + 1; i < NODES; i++) {
            double factor = rows[i][k] * inverse[k];
            for (int j = k + 1; j <= NODES; j++) rows[i][j] = rows[i][j] - factor * rows[k][j];
        }
    }
    change[NODES - 1] = rows[NODES - 1][NODES] / rows[NODES - 1][NODES - 1];
    for (int k = NODES - 2; k >= 0; k--) {
        double value = rows[k][NODES];
        for (int j = k + 1; j < NODES; j++) value -= rows[k][j] * change[j];
        change[k] = value * inverse[k];
    }
}

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    Node at = node(par, state[0]);
    double force = -pull(par, &at, par->south, par->north).slope;
    (void)rule, (void)h;
    for (int i = 0; i < NODES; i++) carry->forces[i] = force;
}

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    double theta = state[0], momentum = state[1], lever = h / par->I1, scale = lever * h;
    double forces[NODES], change[NODES], turned[NODES], size = INFINITY, last;
    for (int i = 0; i < NODES; i++) {
        double ahead = 0.0;
        for (int j = 0; j < NODES; j++) ahead += rule->predict[i][j] * carry->forces[j];
        forces[i] = ahead;
    }
    Trial found = evaluate(par, rule, theta, momentum, h, lever, forces);
    long effort = 1, most = (long)rule->iterations;
    int converged;
    for (;;) {
        correct(rule, &found, forces, scale, change);
        double largest = 0.0;
        last = size;
        size = 0.0;
        for (int i = 0; i < NODES; i++) {
            turned[i] = scale * reached(rule, change, i);
            size += fabs(turned[i]);
            forces[i] = forces[i] + change[i];
            largest = fmax(largest, fabs(forces[i]));
        }
        double enough = rule->tolerance * (fabs(lever * momentum) + scale * largest) + SMALLEST;
        converged = size <= enough || (0.5 * last <= size && size <= ROUNDING);
        if (converged || effort >= most) break;
        if (effort == most / 2)
            for (int i = 0; i < NODES; i++) forces[i] = 0.0;
        found = evaluate(par, rule, theta, momentum, h, lever, forces);
        effort++;
    }
    double south = 0.0, north = 0.0, roll = 0.0, kick = 0.0, bend = 0.0;
    for (int i = 0; i < NODES; i++) {
        south += found.souths[i] + found.souths_by[i] * turned[i];
        north += found.norths[i] + found.norths_by[i] * turned[i];
        roll += found.rolls[i] + found.rolls_by[i] * turned[i];
        kick += rule->b[i] * forces[i];
        bend += rule->last[i] * forces[i];
        carry->forces[i] = forces[i];
    }
    step[0] = lever * (momentum + h * bend);
    step[1] = h * kick;
    step[4] = h * south;
    step[5] = h * north;
    step[2] = step[4] * par->south + step[5] * par->north;
    step[3] = h * (par->p_psi / par->I3 - roll);
    *work = effort;
    return converged ? chart_outcome(theta + step[0]) : 2;
}

MARCH
