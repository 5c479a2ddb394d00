// A Jackal in Open Dynamics Engine, as Gazebo simulates it: the reference that sim=skid is held to.
//
//   apt install libode-dev && g++ -O2 benchmarks/ode_jackal.cpp -lode -o ode_jackal
//   echo "2 0 1000" | ./ode_jackal wheel     (lines of v [m/s], omega [rad/s], time [ms])
//
// Writes x, y, yaw, vx (ahead), vy (left), omega of the base frame after each millisecond. Bodies: jackal_description's
// URDF with the BARN Challenge's UST-10. Contacts: two per wheel, mu 0.5, kp 1e7, kd 1, as ODEPhysics.cc sets them up.
// Wheel speeds: diff_drive_controller's ramp. Solver: quick step, 50 iterations, 1 ms.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ode/ode.h>

static const double STEP = 0.001, TRACK = 0.37559, BASE = 0.262, RADIUS = 0.098, WIDTH = 0.04, AXLE = 0.0345;
static const double FLOOR = RADIUS - AXLE;  // height of the base frame
static dWorldID world;
static dJointGroupID contacts;
static dBodyID chassis;
static dGeomID ground;
static const char* axes;

static void set(dReal* out, double x, double y, double z) { out[0] = x, out[1] = y, out[2] = z; }

static void touch(void*, dGeomID one, dGeomID other) {
    dContact found[4];
    int count = dCollide(one, other, 4, &found[0].geom, sizeof(dContact));
    const dReal* wheel = dBodyGetRotation(dGeomGetBody(one == ground ? other : one));
    const dReal* body = dBodyGetRotation(chassis);
    for (int i = 0; i < count; i++) {
        dSurfaceParameters& surface = found[i].surface;
        surface.mode = dContactMu2 | dContactSoftERP | dContactSoftCFM | dContactApprox1 | dContactFDir1;
        surface.mu = surface.mu2 = 0.5;
        surface.soft_erp = STEP * 1e7 / (STEP * 1e7 + 2), surface.soft_cfm = 1 / (STEP * 1e7 + 2);
        double level = std::hypot(body[0], body[4]);
        if (!strcmp(axes, "wheel")) set(found[i].fdir1, wheel[0], wheel[4], wheel[8]);
        if (!strcmp(axes, "world")) set(found[i].fdir1, 1, 0, 0);
        if (!strcmp(axes, "body")) set(found[i].fdir1, body[0] / level, body[4] / level, 0);
        dJointAttach(dJointCreateContact(world, contacts, &found[i]), dGeomGetBody(one), dGeomGetBody(other));
    }
}

int main(int argc, char** argv) {
    axes = argc > 1 ? argv[1] : "wheel";
    dInitODE();
    world = dWorldCreate();
    dSpaceID space = dSimpleSpaceCreate(0);
    contacts = dJointGroupCreate(0);
    dWorldSetGravity(world, 0, 0, -9.81);
    dWorldSetERP(world, 0.2), dWorldSetCFM(world, 0);
    dWorldSetQuickStepNumIterations(world, 50), dWorldSetQuickStepW(world, 1.3);
    dWorldSetContactMaxCorrectingVel(world, 100);
    ground = dCreatePlane(space, 0, 0, 1, 0);

    // Chassis 16.523 kg at (0.012, 0.002, 0.067) and lidar 1.1 kg at (0.055, 0, 0.2414), one rigid body.
    const double part[2][7] = {{16.523, 0.012, 0.002, 0.067, 0.3136, 0.3922, 0.4485},
                               {1.1, 0.055, 0, 0.2414, 0.003072, 0.003128, 0.001964}};
    double mass = part[0][0] + part[1][0], centre[3], inertia[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) centre[k] = (part[0][0] * part[0][k + 1] + part[1][0] * part[1][k + 1]) / mass;
    for (auto& p : part)
        for (int k = 0; k < 3; k++) {
            double a = p[(k + 1) % 3 + 1] - centre[(k + 1) % 3], b = p[(k + 2) % 3 + 1] - centre[(k + 2) % 3];
            inertia[k] += p[k + 4] + p[0] * (a * a + b * b);
        }
    dMass m;
    dMassSetParameters(&m, mass, 0, 0, 0, inertia[0], inertia[1], inertia[2], 0, 0, 0);
    chassis = dBodyCreate(world);
    dBodySetMass(chassis, &m);
    dBodySetPosition(chassis, centre[0], centre[1], FLOOR + centre[2]);
    dBodySetGyroscopicMode(chassis, 0);

    dJointID hinge[4];
    for (int i = 0; i < 4; i++) {
        double x = i < 2 ? BASE / 2 : -BASE / 2, y = i % 2 ? -TRACK / 2 : TRACK / 2;
        dBodyID wheel = dBodyCreate(world);
        dMassSetParameters(&m, 0.477, 0, 0, 0, 0.0013, 0.0024, 0.0013, 0, 0, 0);
        dBodySetMass(wheel, &m);
        dBodySetPosition(wheel, x, y, RADIUS);
        dBodySetFiniteRotationMode(wheel, 1), dBodySetGyroscopicMode(wheel, 0);
        dGeomID tread = dCreateCylinder(space, RADIUS, WIDTH);
        dGeomSetBody(tread, wheel);
        dMatrix3 lying;
        dRFromAxisAndAngle(lying, 1, 0, 0, M_PI / 2);
        dGeomSetOffsetRotation(tread, lying);
        hinge[i] = dJointCreateHinge(world, 0);
        dJointAttach(hinge[i], wheel, chassis);
        dJointSetHingeAnchor(hinge[i], x, y, RADIUS);
        dJointSetHingeAxis(hinge[i], 0, 1, 0);
        dJointSetHingeParam(hinge[i], dParamFMax, 1e16);
    }

    double v = 0, omega = 0, v_goal = 0, omega_goal = 0;
    int time = 500;  // the wheels settle on the floor first
    for (bool settled = false;; settled = true) {
        fflush(stdout);
        if (settled && scanf("%lf %lf %d", &v_goal, &omega_goal, &time) != 3) return 0;
        for (int k = 0; k < time; k++) {
            v += std::fmin(std::fmax(v_goal - v, -20 * STEP), 20 * STEP);
            omega += std::fmin(std::fmax(omega_goal - omega, -25 * STEP), 25 * STEP);
            for (int i = 0; i < 4; i++) {
                double tread = v + (i % 2 ? 1 : -1) * omega * TRACK * 1.5 / 2;
                dJointSetHingeParam(hinge[i], dParamVel, tread / RADIUS);
            }
            dSpaceCollide(space, 0, touch);
            dWorldQuickStep(world, STEP);
            dJointGroupEmpty(contacts);
            if (!settled) continue;
            const dReal *turned = dBodyGetRotation(chassis), *turning = dBodyGetAngularVel(chassis);
            dVector3 at, moving;
            dBodyGetRelPointPos(chassis, -centre[0], -centre[1], -centre[2], at);
            dBodyGetRelPointVel(chassis, -centre[0], -centre[1], -centre[2], moving);
            double yaw = std::atan2(turned[4], turned[0]), cos = std::cos(yaw), sin = std::sin(yaw);
            printf("%.5f %.5f %.5f %.5f %.5f %.5f\n", at[0], at[1], yaw, moving[0] * cos + moving[1] * sin,
                   moving[1] * cos - moving[0] * sin, turning[2]);
        }
    }
}
