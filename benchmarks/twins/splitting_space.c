/* Twin of symtop/methods/splitting/space.py: on (e, L), or with -DATTITUDE on (q, L).

   DRIFTS is the number of drifts in the table. A processed method's maps and the spin that is added to a sample are
   no part of a step; the caller does them. */

#include "march.h"
#include "half_angle.h"

#ifdef ATTITUDE
#define PLACE 4
#else
#define PLACE 3
#endif
#define DIM (PLACE + 3)

typedef struct { double I1, mgl, twist; } Par;
typedef struct { double drift[DRIFTS], kick[DRIFTS + 1], bend[DRIFTS + 1], forces, turn, boost; } Rule;
typedef struct { double x, y, z; } Carry;

static inline void rotor(const Rule *rule, const double *L, double half, double *s, double *m) {
    double square = half * half * (L[0] * L[0] + L[1] * L[1] + L[2] * L[2]);
    if (rule->turn != 0.0) {
        double root = sqrt(1.0 + square);
        *s = half / root;
        *m = -square / (root * (1.0 + root));
    } else if (square < 1.0) {
        *s = half * series(square, SINE);
        *m = -square * series(square, COSINE);
    } else {
        double x = sqrt(square), sine = sin(0.5 * x), cosine = cos(0.5 * x);
        *s = half * (2.0 * sine * cosine / x);
        *m = -2.0 * sine * sine;
    }
}

#ifdef ATTITUDE

static inline Carry force(const double *state, const double *step) {
    double w = state[0] + step[0], x = state[1] + step[1], y = state[2] + step[2], z = state[3] + step[3];
    Carry axis = {2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z};
    return axis;
}

static inline void drift(const Rule *rule, const double *state, double *step, double half) {
    double w = state[0] + step[0], x = state[1] + step[1], y = state[2] + step[2], z = state[3] + step[3], s, m;
    double L[3] = {state[4] + step[4], state[5] + step[5], state[6] + step[6]};
    rotor(rule, L, half, &s, &m);
    m += 0.5 * (1.0 + m) * (1.0 - (w * w + x * x + y * y + z * z));
    step[0] += m * w - s * (L[0] * x + L[1] * y + L[2] * z);
    step[1] += m * x + s * (L[0] * w + L[1] * z - L[2] * y);
    step[2] += m * y + s * (L[1] * w + L[2] * x - L[0] * z);
    step[3] += m * z + s * (L[2] * w + L[0] * y - L[1] * x);
}

static inline int judge(const double *step) {
    return finite_outcome(step[0] + step[1] + step[2] + step[3] + step[4] + step[5]);
}

#else

static inline Carry force(const double *state, const double *step) {
    Carry axis = {state[0] + step[0], state[1] + step[1], state[2] + step[2]};
    return axis;
}

static inline void drift(const Rule *rule, const double *state, double *step, double half) {
    double x = state[0] + step[0], y = state[1] + step[1], z = state[2] + step[2], s, m;
    double L[3] = {state[3] + step[3], state[4] + step[4], state[5] + step[5]};
    rotor(rule, L, half, &s, &m);
    double w = 1.0 + m, twice = 2.0 * s;
    double cx = L[1] * z - L[2] * y, cy = L[2] * x - L[0] * z, cz = L[0] * y - L[1] * x;
    double r = s * (1.0 - (0.5 * w * w - 0.25) * (1.0 - (x * x + y * y + z * z)));
    step[0] += twice * (w * cx + r * (L[1] * cz - L[2] * cy));
    step[1] += twice * (w * cy + r * (L[2] * cx - L[0] * cz));
    step[2] += twice * (w * cz + r * (L[0] * cy - L[1] * cx));
}

static inline int judge(const double *step) {
    return finite_outcome(step[0] + step[1] + step[2] + step[3] + step[4]);
}

#endif

static inline void kick(const Carry *at, double *step, double pull, double bend) {
    double strength = pull - bend * at->z;
    step[PLACE] += -strength * at->y;
    step[PLACE + 1] += strength * at->x;
}

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    static const double nothing[DIM] = {0.0};
    (void)par, (void)rule, (void)h;
    *carry = force(state, nothing);
}

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    Carry now = *carry;
    (void)par, (void)h;
    for (int i = 0; i < DIM; i++) step[i] = 0.0;
    for (int i = 0; i < DRIFTS; i++) {
        if (rule->kick[i] != 0.0) kick(&now, step, rule->kick[i], rule->bend[i]);
        drift(rule, state, step, rule->drift[i]);
        if (rule->kick[i + 1] != 0.0) now = force(state, step);
    }
    if (rule->kick[DRIFTS] != 0.0) kick(&now, step, rule->kick[DRIFTS], rule->bend[DRIFTS]);
    else if (rule->kick[0] != 0.0) now = force(state, step);
    *carry = now;
    *work = (long)rule->forces;
    return judge(step);
}

MARCH
