/* C twins of the fixed-step kernels: the same arithmetic in the same order, for benchmarks only.
   Each advances a state n steps and writes the final state back, so that nothing is optimised away. */

#include <math.h>

typedef struct { double I1, I3, mgl, p_psi, north, south; } reduced;

static void add(double *high, double *low, double increment) { /* Knuth's two-sum, as the Python loop does it */
    double addend = increment + *low, total = *high + addend, virtual_part = total - *high;
    *low = (*high - (total - virtual_part)) + (addend - virtual_part);
    *high = total;
}

static void force(const reduced *top, double theta, double *slope, double *rate, double *turn) {
    double s = sin(0.5 * theta), c = cos(0.5 * theta);
    double up = top->north / (s * s), down = top->south / (c * c), tilt = s * c;
    *slope = tilt * ((up + down) * (down - up) / (8.0 * top->I1) - 2.0 * top->mgl);
    *rate = (up + down) / (4.0 * top->I1);
    *turn = *rate * (c * c - s * s);
}

/* kick-drift-kick on (theta, p_theta, phi, psi); returns the number of steps done inside (0, pi) */
long stormer_verlet(const reduced *top, double *state, double h, long n) {
    double low[4] = {0.0, 0.0, 0.0, 0.0}, slope, rate, turn;
    double theta = state[0], p = state[1], phi = state[2], psi = state[3], spin = top->p_psi / top->I3;
    long k;
    force(top, theta, &slope, &rate, &turn);
    for (k = 0; k < n; k++) {
        double half = 0.5 * h, dp = -half * slope, dphi = half * rate, dpsi = half * (spin - turn);
        double dtheta = h * (p + dp) / top->I1, next = theta + dtheta;
        force(top, next, &slope, &rate, &turn);
        dp -= half * slope;
        dphi += half * rate;
        dpsi += half * (spin - turn);
        if (!(next > 0.0 && next < M_PI)) break;
        add(&theta, &low[0], dtheta);
        add(&p, &low[1], dp);
        add(&phi, &low[2], dphi);
        add(&psi, &low[3], dpsi);
    }
    state[0] = theta; state[1] = p; state[2] = phi; state[3] = psi;
    return k;
}
