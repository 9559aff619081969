/* Twin of symtop/methods/lagrangian/galerkin.py. */

#include "march.h"
#include "galerkin_node.h"

#define DIM 4
#define SMALLEST 1e-18
#define ROUNDING 1e-12

typedef struct { double tolerance, iterations; } Rule;
typedef struct { double V0[4], Vm[4]; } Carry;
typedef struct { double value, by_m, by_1; } Jet;
typedef struct { Jet V0, Vm, V1, plus, minus; } Trial;

static inline double follow(Jet jet, double fix_m, double fix_1) {
    return jet.value + jet.by_m * fix_m + jet.by_1 * fix_1;
}

static inline Trial evaluate(const Par *par, const Node *start, double theta_m, double theta_1) {
    Node middle = node(par, theta_m), end = node(par, theta_1);
    double k = 0.5 * (1.0 / par->I3 - 1.0 / par->I1);
    double S = 3.0 * k + 2.0 * (start->d + middle.d + end.d), N = 3.0 * k + 2.0 * (start->a + middle.a + end.a);
    double inverse = 1.0 / (S * N - 9.0 * k * k), K = 3.0 * k * inverse;
    S = S * inverse;
    N = N * inverse;
    double load_s = 2.0 * ((middle.d - start->d) + (middle.d - end.d)) * par->south;
    double load_n = 2.0 * ((middle.a - start->a) + (middle.a - end.a)) * par->north;
    double e_s = N * load_s + K * load_n, e_n = K * load_s + S * load_n;
    double south = par->south - 0.5 * e_s, north = par->north - 0.5 * e_n;
    Pull first = pull(par, start, par->south + e_s, par->north + e_n);
    Pull inner = pull(par, &middle, south, north);
    Pull last = pull(par, &end, par->south + e_s, par->north + e_n);
    double es_m = 4.0 * (N * inner.south + K * inner.north), en_m = 4.0 * (K * inner.south + S * inner.north);
    double es_1 = -2.0 * (N * last.south + K * last.north), en_1 = -2.0 * (K * last.south + S * last.north);
    double b_s = k + 2.0 * middle.d, b_n = k + 2.0 * middle.a;
    Trial found = {
        {first.slope, first.south * es_m + first.north * en_m, first.south * es_1 + first.north * en_1},
        {inner.slope, inner.stiffness - 0.5 * (inner.south * es_m + inner.north * en_m),
         -0.5 * (inner.south * es_1 + inner.north * en_1)},
        {last.slope, last.south * es_m + last.north * en_m, last.stiffness + last.south * es_1 + last.north * en_1},
        {b_s * south - k * north, 2.0 * inner.south - 0.5 * (b_s * es_m - k * en_m), -0.5 * (b_s * es_1 - k * en_1)},
        {b_n * north - k * south, 2.0 * inner.north - 0.5 * (b_n * en_m - k * es_m), -0.5 * (b_n * en_1 - k * es_1)},
    };
    return found;
}

static inline void correct(const Trial *found, double m, double d, double flight, double scale, double *fix) {
    const Jet *V0 = &found->V0, *Vm = &found->Vm;
    double gap = flight - d - scale * (V0->value + 2.0 * Vm->value) / 6.0;
    double bow = 0.5 * d - m + scale * Vm->value / 8.0;
    double gap_m = scale * (V0->by_m + 2.0 * Vm->by_m) / 6.0, gap_d = 1.0 + scale * (V0->by_1 + 2.0 * Vm->by_1) / 6.0;
    double bow_m = 1.0 - scale * Vm->by_m / 8.0, bow_d = -0.5 - scale * Vm->by_1 / 8.0;
    double inverse = 1.0 / (gap_d * bow_m - gap_m * bow_d);
    fix[0] = (bow * gap_d - gap * bow_d) * inverse;
    fix[1] = (gap * bow_m - bow * gap_m) * inverse;
}

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    Node at = node(par, state[0]);
    double V = pull(par, &at, par->south, par->north).slope;
    (void)rule, (void)h;
    for (int i = 0; i < 4; i++) carry->V0[i] = carry->Vm[i] = V;
}

static inline double predicted(const double *past) { return 4.0 * (past[0] + past[2]) - 6.0 * past[1] - past[3]; }

static inline void shift(double *past, double newest) {
    past[3] = past[2];
    past[2] = past[1];
    past[1] = past[0];
    past[0] = newest;
}

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    double theta = state[0], flight = h * state[1] / par->I1, scale = h * h / par->I1, fix[2];
    Node start = node(par, theta);
    double V0 = predicted(carry->V0), Vm = predicted(carry->Vm);
    double d = flight - scale * (V0 + 2.0 * Vm) / 6.0, m = 0.5 * d + scale * Vm / 8.0;
    Trial found = evaluate(par, &start, theta + m, theta + d);
    long effort = 1, most = (long)rule->iterations;
    int outcome = 2;
    double size = INFINITY, last;
    for (;;) {
        correct(&found, m, d, flight, scale, fix);
        double reach = fabs(flight) + scale * (fabs(found.V0.value) + fabs(found.Vm.value));
        last = size;
        size = fabs(fix[0]) + fabs(fix[1]);
        if (size <= rule->tolerance * reach + SMALLEST || (0.5 * last <= size && size <= ROUNDING)) {
            d += fix[1];
            outcome = chart_outcome(theta + d);
            break;
        }
        if (effort >= most) break;
        m = m + fix[0];
        d = d + fix[1];
        if (effort == most / 2) {
            m = 0.5 * flight;
            d = flight;
        }
        found = evaluate(par, &start, theta + m, theta + d);
        effort++;
    }
    V0 = follow(found.V0, fix[0], fix[1]);
    Vm = follow(found.Vm, fix[0], fix[1]);
    double V1 = follow(found.V1, fix[0], fix[1]);
    double plus = follow(found.plus, fix[0], fix[1]), minus = follow(found.minus, fix[0], fix[1]);
    step[0] = d;
    step[1] = -h * (V0 + 4.0 * Vm + V1) / 6.0;
    step[2] = 0.5 * h * (plus + minus);
    step[3] = 0.5 * h * (plus - minus);
    shift(carry->V0, V0);
    shift(carry->Vm, Vm);
    *work = effort;
    return outcome;
}

MARCH
