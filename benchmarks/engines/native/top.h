/* The top that a driver steps, read from its words: SETTING HELD I1 I3 mgl qw qx qy qz wx wy wz h steps.

   A driver prints a line "qw qx qy qz wx wy wz" for the start and for each step. A free body gets the torque mgl k x e
   of its attitude before each step; on a ball joint, the arm and the gravity are those of benchmarks/engines/common.py. */
#pragma once

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

struct Top {
    std::string setting;
    bool pinned;
    double I1, I3, mgl, q[4], w[3], h;
    long steps;
    double arm, across, gravity, e[3], place[3], speed[3]; /* of the centre; e is the axis */

    explicit Top(char **words)
        : setting(words[1]), pinned(std::strcmp(words[2], "free") != 0), I1(std::atof(words[3])),
          I3(std::atof(words[4])), mgl(std::atof(words[5])), h(std::atof(words[13])), steps(std::atol(words[14])) {
        for (int i = 0; i < 4; i++) q[i] = std::atof(words[6 + i]);
        for (int i = 0; i < 3; i++) w[i] = std::atof(words[10 + i]);
        arm = pinned ? 0.1 * std::sqrt(I1) : 0.0;
        across = I1 - arm * arm;
        gravity = pinned ? -mgl / arm : 0.0;
        e[0] = 2.0 * (q[1] * q[3] + q[0] * q[2]);
        e[1] = 2.0 * (q[2] * q[3] - q[0] * q[1]);
        e[2] = q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3];
        for (int i = 0; i < 3; i++) place[i] = arm * e[i];
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            speed[i] = w[j] * place[k] - w[k] * place[j];
        }
    }
};

inline void print(double qw, double qx, double qy, double qz, double wx, double wy, double wz) {
    std::printf("%.17g %.17g %.17g %.17g %.17g %.17g %.17g\n", qw, qx, qy, qz, wx, wy, wz);
}
