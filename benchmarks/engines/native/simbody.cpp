/* Simbody: a ball joint and gravity, by an integrator at a fixed step; SETTING is the name of its class. */
#include <Simbody.h>

#include <memory>

#include "top.h"

using namespace SimTK;

static Integrator *integrator(const std::string &name, const System &system, double h) {
    if (name == "SemiExplicitEuler") return new SemiExplicitEulerIntegrator(system, h);
    if (name == "Verlet") return new VerletIntegrator(system);
    if (name == "RungeKuttaMerson") return new RungeKuttaMersonIntegrator(system);
    std::exit(2);
}

int main(int, char **words) {
    const Top top(words);
    MultibodySystem system;
    SimbodyMatterSubsystem matter(system);
    GeneralForceSubsystem forces(system);
    Force::UniformGravity gravity(forces, matter, Vec3(0, 0, top.gravity));
    Body::Rigid body(MassProperties(1, Vec3(0, 0, top.arm), Inertia(top.I1, top.I1, top.I3)));
    MobilizedBody::Ball made(matter.Ground(), Transform(), body, Transform());
    system.realizeTopology();
    State start = system.getDefaultState();
    system.realizeModel(start);
    made.setQToFitRotation(start, Rotation(Quaternion(Vec4(top.q[0], top.q[1], top.q[2], top.q[3]))));
    made.setUToFitAngularVelocity(start, Vec3(top.w[0], top.w[1], top.w[2]));
    const std::unique_ptr<Integrator> method(integrator(top.setting, system, top.h));
    method->setFixedStepSize(top.h);
    TimeStepper stepper(system, *method);
    stepper.initialize(start);
    for (long k = 0; k <= top.steps; k++) {
        if (k > 0) stepper.stepTo(double(k) * top.h);
        const State &now = stepper.getState();
        system.realize(now, Stage::Velocity);
        const Vec4 q = made.getBodyRotation(now).convertRotationToQuaternion().asVec4();
        const Vec3 w = made.getBodyAngularVelocity(now);
        print(q[0], q[1], q[2], q[3], w[0], w[1], w[2]);
    }
    return 0;
}
