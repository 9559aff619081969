/* The Open Dynamics Engine; SETTING is "default", "finite rotation" or "no gyroscopic mode". */
#include <ode/ode.h>

#include "top.h"

int main(int, char **words) {
    const Top top(words);
    dInitODE2(0);
    dWorldID world = dWorldCreate();
    dBodyID body = dBodyCreate(world);
    dMass mass;
    dMassSetParameters(&mass, 1.0, 0.0, 0.0, 0.0, top.across, top.across, top.I3, 0.0, 0.0, 0.0);
    dBodySetMass(body, &mass);
    const dQuaternion start = {top.q[0], top.q[1], top.q[2], top.q[3]};
    dBodySetQuaternion(body, start);
    dBodySetAngularVel(body, top.w[0], top.w[1], top.w[2]);
    dBodySetGyroscopicMode(body, top.setting != "no gyroscopic mode");
    dBodySetFiniteRotationMode(body, top.setting == "finite rotation");
    dBodySetAutoDisableFlag(body, 0);
    if (top.pinned) {
        dBodySetPosition(body, top.place[0], top.place[1], top.place[2]);
        dBodySetLinearVel(body, top.speed[0], top.speed[1], top.speed[2]);
        dWorldSetGravity(world, 0.0, 0.0, top.gravity);
        dJointID joint = dJointCreateBall(world, nullptr);
        dJointAttach(joint, body, nullptr);
        dJointSetBallAnchor(joint, 0.0, 0.0, 0.0);
        dWorldSetCFM(world, 0.0);
    }
    for (long k = 0; k <= top.steps; k++) {
        const dReal *q = dBodyGetQuaternion(body), *w = dBodyGetAngularVel(body), *R = dBodyGetRotation(body);
        print(q[0], q[1], q[2], q[3], w[0], w[1], w[2]);
        if (k == top.steps) break;
        if (!top.pinned) dBodyAddTorque(body, -top.mgl * R[6], top.mgl * R[2], 0.0);
        dWorldStep(world, top.h);
    }
    return 0;
}
