/* A node of the Galerkin integrators: node_at and pull_at of symtop/methods/lagrangian/galerkin.py. */

#include "sines.h"

typedef struct { double I1, I3, mgl, p_psi, north, south; } Par;
typedef struct { double d, a, tangent, sine, cosine; } Node;
typedef struct { double slope, stiffness, south, north; } Pull;

static inline Node node(const Par *par, double theta) {
    double sin_x, cos_x;
    sines(0.5 * theta, &sin_x, &cos_x);
    double low = sin_x * sin_x, high = cos_x * cos_x;
    Node found = {0.25 / (par->I1 * high), 0.25 / (par->I1 * low), sin_x / cos_x, 2.0 * sin_x * cos_x, high - low};
    return found;
}

static inline Pull pull(const Par *par, const Node *at, double south, double north) {
    double D = at->d * south, A = at->a * north;
    double bracket = par->I1 * (D - A) * (D + A) - par->mgl;
    double by_south = D * at->tangent, by_north = -A / at->tangent;
    double bend = 2.0 * par->I1 * at->sine * (D * by_south - A * by_north);
    Pull found = {at->sine * bracket, at->cosine * bracket + bend, by_south, by_north};
    return found;
}
