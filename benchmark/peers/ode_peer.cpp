// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Open Dynamics Engine with the scene's forces on its bodies at each step. Contact points are the
// package's own exact ones: dynamics, contact forces and friction are the engine's.
#include <ode/ode.h>

#include <cstdio>
#include <memory>
#include <mutex>

#include "assembly_cell/geometry/contact_geometry.h"
#include "peer.h"

namespace assembly_cell::peers {
namespace {

using Eigen::Vector3d;

struct Choice {
  double step;  // [s]
  double erp;   // part of a penetration that a step takes out
};

struct World {
  World(const Scene& scene, const Choice& choice)
      : world(dWorldCreate()), group(dJointGroupCreate(0)) {
    dWorldSetGravity(world, 0.0, 0.0, 0.0);  // weight is one of the scene's forces
    dWorldSetERP(world, choice.erp);
    dWorldSetCFM(world, 1e-12);
    const Mechanism& m = scene.scenario.mechanism;
    const Bodies b = bodiesOf(scene.start);
    peg = body(m.peg.mass, m.peg.inertia_transverse, m.peg.inertia_axial);
    dMatrix3 R;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R[4 * i + j] = b.R(i, j);
    }
    dBodySetRotation(peg, R);
    dBodySetPosition(peg, b.p.x(), b.p.y(), b.p.z());
    dBodySetLinearVel(peg, b.v.x(), b.v.y(), b.v.z());
    dBodySetAngularVel(peg, b.omega.x(), b.omega.y(), b.omega.z());
    dBodySetGyroscopicMode(peg, 1);
    // x, y and yaw by three numbers: the engine has no such joint that keeps the angle
    carrier = body(m.carrier.mass, m.carrier.inertia, m.carrier.inertia);
    dBodySetPosition(carrier, b.carrier.x(), b.carrier.y(), 0.0);
    dBodySetLinearVel(carrier, b.carrier_rate.x(), b.carrier_rate.y(), 0.0);
    dBodySetAngularVel(carrier, 0.0, 0.0, b.carrier_rate.z());
    yaw = b.carrier.z();
  }
  ~World() {
    dJointGroupDestroy(group);
    dWorldDestroy(world);
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  dBodyID body(double mass, double across, double along) const {
    dMass inertia;
    dMassSetParameters(&inertia, mass, 0, 0, 0, across, across, along, 0, 0, 0);
    dBodyID made = dBodyCreate(world);
    dBodySetMass(made, &inertia);
    return made;
  }

  Bodies bodies() const {
    const auto vector = [](const dReal* v) { return Vector3d(v[0], v[1], v[2]); };
    const dReal* R = dBodyGetRotation(peg);
    Bodies b;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) b.R(i, j) = R[4 * i + j];
    }
    b.p = vector(dBodyGetPosition(peg));
    b.v = vector(dBodyGetLinearVel(peg));
    b.omega = vector(dBodyGetAngularVel(peg));
    b.carrier = vector(dBodyGetPosition(carrier));
    b.carrier.z() = yaw;
    b.carrier_rate = vector(dBodyGetLinearVel(carrier));
    b.carrier_rate.z() = dBodyGetAngularVel(carrier)[2];
    return b;
  }

  dWorldID world;
  dJointGroupID group;
  dBodyID peg{}, carrier{};
  double yaw = 0.0;
  ContactSet contacts;
};

void touch(const Scene& scene, const Bodies& b, World& w) {
  const Mechanism& m = scene.scenario.mechanism;
  const Vector3d bottom = b.p - m.peg.half_height * b.R.col(2);
  // thesis peg axes 1, 2 are y and −x in the peg's frame: their cross product is its axis
  const EdgeCircle edge{toThesisAxes(bottom), toThesisAxes(b.R.col(1)), toThesisAxes(-b.R.col(0)),
                        m.peg.radius};
  ContactShapes shapes;
  shapes.hole_radius = m.hole.radius;
  shapes.hole_depth = m.hole.depth;
  shapes.peg_length = 2.0 * m.peg.half_height;
  const ContactSlotMask valid = findContacts(edge, shapes, kEdgeEdgeSlots, w.contacts);
  for (int i = 0; i < kContactSlots; ++i) {
    const ContactPoint& c = w.contacts.slots[static_cast<std::size_t>(i)];
    if (!(valid >> i & 1u) || c.gap > 0.0) continue;
    dContact contact{};
    contact.surface.mode = dContactApprox1;
    contact.surface.mu = m.friction.sliding_coefficient;
    const Vector3d p = fromThesisAxes(c.p), n = fromThesisAxes(c.normal);
    for (int k = 0; k < 3; ++k) {
      contact.geom.pos[k] = p(k);
      contact.geom.normal[k] = n(k);
    }
    contact.geom.depth = -c.gap;
    dJointAttach(dJointCreateContact(w.world, w.group, &contact), w.peg, nullptr);
  }
}

Path run(const Scene& scene, const Choice& choice, World& w, long& steps) {
  Path path;
  double t = 0.0;
  for (int i = 0; i < kChecks; ++i) {
    const long n =
        std::max(1L, static_cast<long>(std::ceil((scene.check(i) - t) / choice.step - 1e-6)));
    const double h = (scene.check(i) - t) / static_cast<double>(n);
    for (long k = 0; k < n; ++k) {
      const Bodies b = w.bodies();
      const Applied f = applied(scene, b, t + static_cast<double>(k) * h);
      dBodyAddForce(w.peg, f.force.x(), f.force.y(), f.force.z());
      dBodyAddTorque(w.peg, f.torque.x(), f.torque.y(), f.torque.z());
      dBodyAddForce(w.carrier, f.carrier.x(), f.carrier.y(), 0.0);
      dBodyAddTorque(w.carrier, 0.0, 0.0, f.carrier.z());
      if (scene.touching) touch(scene, b, w);
      dWorldStep(w.world, h);
      w.yaw += h * dBodyGetAngularVel(w.carrier)[2];
      dJointGroupEmpty(w.group);
    }
    t = scene.check(i);
    steps += n;
    path[static_cast<std::size_t>(i)] = toThesisAxes(w.bodies().p);
  }
  return path;
}

}  // namespace

std::vector<Setting> odeSettings(const Scene& scene) {
  static std::once_flag once;
  std::call_once(once, [] { dInitODE2(0); });
  std::vector<Setting> all;
  for (const double step : {1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6, 2e-6}) {
    for (const double erp : {0.2, 0.8}) {
      if (!scene.touching && erp > 0.5) continue;
      char how[64];
      if (scene.touching) {
        std::snprintf(how, sizeof how, "step %.0e s, erp %g", step, erp);
      } else {
        std::snprintf(how, sizeof how, "step %.0e s", step);
      }
      const Choice choice{step, erp};
      all.push_back({"ODE", how, [&scene, choice] {
                       const auto world = std::make_shared<World>(scene, choice);
                       return [&scene, choice, world](long& steps) {
                         return run(scene, choice, *world, steps);
                       };
                     }});
    }
  }
  return all;
}

}  // namespace assembly_cell::peers
