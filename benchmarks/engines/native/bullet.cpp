/* Bullet, in the precision that it is compiled for: a rigid body, whose SETTING is "default" (implicit gyroscopic term in
   body axes), "explicit" or "flags 0" (none), or a "multibody". */
#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include "top.h"

static btVector3 vector(const double *v) { return btVector3(btScalar(v[0]), btScalar(v[1]), btScalar(v[2])); }

static btVector3 torque(const Top &top, const btMatrix3x3 &R) {
    const btVector3 e = R.getColumn(2);
    return btVector3(btScalar(-top.mgl) * e.y(), btScalar(top.mgl) * e.x(), btScalar(0));
}

static void print(const btQuaternion &q, const btVector3 &w) { print(q.w(), q.x(), q.y(), q.z(), w.x(), w.y(), w.z()); }

static void rigid(const Top &top, btDynamicsWorld &world, const btQuaternion &start, btCollisionShape &shape) {
    const btVector3 moments(btScalar(top.across), btScalar(top.across), btScalar(top.I3));
    btRigidBody::btRigidBodyConstructionInfo plan(btScalar(1), nullptr, &shape, moments);
    plan.m_startWorldTransform = btTransform(start, vector(top.place));
    btRigidBody body(plan);
    body.setDamping(btScalar(0), btScalar(0));
    if (top.setting == "explicit") body.setFlags(BT_ENABLE_GYROSCOPIC_FORCE_EXPLICIT);
    if (top.setting == "flags 0") body.setFlags(0);
    body.setActivationState(DISABLE_DEACTIVATION);
    body.setAngularVelocity(vector(top.w));
    body.setLinearVelocity(vector(top.speed));
    world.addRigidBody(&body, 0, 0); /* it collides with nothing */
    btPoint2PointConstraint joint(body, btVector3(btScalar(0), btScalar(0), btScalar(-top.arm)));
    if (top.pinned) world.addConstraint(&joint);
    for (long k = 0; k <= top.steps; k++) {
        const btTransform &at = body.getWorldTransform();
        print(at.getRotation(), body.getAngularVelocity());
        if (k == top.steps) break;
        if (!top.pinned) body.applyTorque(torque(top, at.getBasis()));
        world.stepSimulation(btScalar(top.h), 0, btScalar(top.h));
    }
    if (top.pinned) world.removeConstraint(&joint);
    world.removeRigidBody(&body);
}

static void multibody(const Top &top, btMultiBodyDynamicsWorld &world, const btQuaternion &start) {
    const btVector3 moments(btScalar(top.I1), btScalar(top.I1), btScalar(top.I3));
    btMultiBody body(0, btScalar(1), moments, false, false);
    body.finalizeMultiDof();
    body.setBaseWorldTransform(btTransform(start, btVector3(0, 0, 0)));
    body.setBaseOmega(vector(top.w));
    body.setLinearDamping(btScalar(0));
    body.setAngularDamping(btScalar(0));
    body.setMaxCoordinateVelocity(btScalar(1e9));
    world.addMultiBody(&body);
    for (long k = 0; k <= top.steps; k++) {
        const btQuaternion q = body.getWorldToBaseRot().inverse();
        print(q, body.getBaseOmega());
        if (k == top.steps) break;
        body.addBaseTorque(torque(top, btMatrix3x3(q)));
        world.stepSimulation(btScalar(top.h), 0, btScalar(top.h));
    }
    world.removeMultiBody(&body);
}

int main(int, char **words) {
    const Top top(words);
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    btMultiBodyConstraintSolver solver;
    btMultiBodyDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    world.setGravity(btVector3(btScalar(0), btScalar(0), btScalar(top.gravity)));
    btSphereShape shape(btScalar(0.01));
    const btQuaternion start(btScalar(top.q[1]), btScalar(top.q[2]), btScalar(top.q[3]), btScalar(top.q[0]));
    if (top.setting == "multibody")
        multibody(top, world, start);
    else
        rigid(top, world, start, shape);
    return 0;
}
