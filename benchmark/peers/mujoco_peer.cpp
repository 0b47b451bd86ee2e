// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// MuJoCo with the scene's forces on its bodies at each stage of its integrators. Where parts touch
// the bore is a ring of boxes, as in the package's MuJoCo backend.
#include <mujoco/mujoco.h>

#include <cstdio>
#include <cstring>
#include <memory>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/second_world/second_world.h"
#include "boxes.h"
#include "peer.h"

namespace assembly_cell::peers {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Choice {
  mjtIntegrator integrator;
  double step;  // [s]
  SoftContact contact;
};

const Scene* acting = nullptr;  // of the callback, which has no place for it

// Peg (free) and carrier only: the engine has nothing else to go through.
std::string bodies(const Mechanism& m) {
  char text[1000];
  std::snprintf(
      text, sizeof text,
      "<mujoco><option gravity='0 0 0'/><worldbody><body name='peg'><freejoint/><inertial "
      "pos='0 0 0' mass='%.17g' diaginertia='%.17g %.17g %.17g'/></body><body><joint "
      "type='slide' axis='1 0 0'/><joint type='slide' axis='0 1 0'/><joint type='hinge' "
      "axis='0 0 1'/><inertial pos='0 0 0' mass='%.17g' diaginertia='%.17g %.17g "
      "%.17g'/></body></worldbody></mujoco>",
      m.peg.mass, m.peg.inertia_transverse, m.peg.inertia_transverse, m.peg.inertia_axial,
      m.carrier.mass, m.carrier.inertia, m.carrier.inertia, m.carrier.inertia);
  return text;
}

Bodies bodiesIn(const mjData* d) {
  Bodies b;
  b.R = Eigen::Quaterniond(d->qpos[3], d->qpos[4], d->qpos[5], d->qpos[6]).normalized();
  b.p = Vector3d::Map(d->qpos);
  b.v = Vector3d::Map(d->qvel);
  b.omega = b.R * Vector3d(Vector3d::Map(d->qvel + 3));
  b.carrier = Vector3d::Map(d->qpos + 7);
  b.carrier_rate = Vector3d::Map(d->qvel + 6);
  return b;
}

void act(const mjModel*, mjData* d) {
  const Bodies b = bodiesIn(d);
  const Applied f = applied(*acting, b, d->time);
  Vector3d::Map(d->qfrc_passive) += f.force;
  Vector3d::Map(d->qfrc_passive + 3) += b.R.transpose() * f.torque;
  Vector3d::Map(d->qfrc_passive + 6) += f.carrier;
}

struct Engine {
  Engine(const Scene& scene, const Choice& choice);
  ~Engine() {
    mj_deleteData(d);
    mj_deleteModel(m);
  }
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  // which boxes can't touch: the engine would try each of hundreds
  void cull(const Mechanism& mechanism) const {
    const Cylinder peg{Vector3d::Map(d->qpos), bodiesIn(d).R.col(2), mechanism.peg.radius,
                       mechanism.peg.half_height};
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      m->geom_contype[geoms[i]] = m->geom_conaffinity[geoms[i]] = mayTouch(boxes[i], peg) ? 1 : 0;
    }
  }

  mjModel* m = nullptr;
  mjData* d = nullptr;
  std::vector<Box> boxes;
  std::vector<int> geoms;
};

Engine::Engine(const Scene& scene, const Choice& choice) {
  mju_user_warning = [](const char*) {};  // an unstable step shows in the error
  const std::string text =
      scene.touching ? mjcf(scene.scenario, choice.contact) : bodies(scene.scenario.mechanism);
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  mj_makeEmptyFileVFS(files.get(), "peer.xml", static_cast<int>(text.size()));
  std::memcpy(files->filedata[mj_findFileVFS(files.get(), "peer.xml")], text.data(), text.size());
  char why[1000] = "";
  m = mj_loadXML("peer.xml", files.get(), why, sizeof why);
  mj_deleteVFS(files.get());
  if (m == nullptr) throw InputError(std::string("MuJoCo refuses the scene: ") + why);
  m->opt.timestep = choice.step;
  m->opt.integrator = choice.integrator;
  m->opt.gravity[2] = 0.0;  // weight is one of the scene's forces
  d = mj_makeData(m);
  const Bodies b = bodiesOf(scene.start);
  const Eigen::Quaterniond q(b.R);
  mj_kinematics(m, d);
  const int peg = mj_name2id(m, mjOBJ_GEOM, "peg");
  for (int g = 0; g < m->ngeom; ++g) {
    if (g == peg) continue;
    using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    geoms.push_back(g);
    boxes.push_back({Rows::Map(d->geom_xmat + 9 * g), Vector3d::Map(d->geom_xpos + 3 * g),
                     Vector3d::Map(m->geom_size + 3 * g)});
  }
  Vector3d::Map(d->qpos) = b.p;
  Eigen::Vector4d::Map(d->qpos + 3) << q.w(), q.x(), q.y(), q.z();
  Vector3d::Map(d->qpos + 7) = b.carrier;
  Vector3d::Map(d->qvel) = b.v;
  Vector3d::Map(d->qvel + 3) = b.R.transpose() * b.omega;
  Vector3d::Map(d->qvel + 6) = b.carrier_rate;
}

Path run(const Scene& scene, const Choice& choice, Engine& engine, long& steps) {
  acting = &scene;
  mjcb_passive = act;
  Path path;
  for (int i = 0; i < kChecks; ++i) {
    // equal steps, so that each check is the end of one
    const double span = scene.check(i) - engine.d->time;
    const long n = std::max(1L, static_cast<long>(std::ceil(span / choice.step - 1e-6)));
    engine.m->opt.timestep = span / static_cast<double>(n);
    for (long k = 0; k < n; ++k) {
      if (scene.touching) engine.cull(scene.scenario.mechanism);
      mj_step(engine.m, engine.d);
    }
    steps += n;
    path[static_cast<std::size_t>(i)] = toThesisAxes(Vector3d::Map(engine.d->qpos));
  }
  mjcb_passive = nullptr;
  return path;
}

void add(const Scene& scene, const Choice& choice, std::vector<Setting>& all) {
  char how[96];
  const char* name = choice.integrator == mjINT_RK4 ? "RK4" : "Euler";
  if (scene.touching) {
    std::snprintf(how, sizeof how, "%s, step %.0e s, impedance %g", name, choice.step,
                  choice.contact.impedance);
  } else {
    std::snprintf(how, sizeof how, "%s, step %.0e s", name, choice.step);
  }
  all.push_back({"MuJoCo", how, [&scene, choice] {
                   const auto engine = std::make_shared<Engine>(scene, choice);
                   return [&scene, choice, engine](long& steps) {
                     return run(scene, choice, *engine, steps);
                   };
                 }});
}

}  // namespace

std::vector<Setting> mujocoSettings(const Scene& scene) {
  std::vector<Setting> all;
  for (const mjtIntegrator integrator : {mjINT_RK4, mjINT_EULER}) {
    for (const double step : {1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5}) {
      Choice choice{integrator, step, {}};
      if (!scene.touching) {
        add(scene, choice, all);
        continue;
      }
      for (const double impedance : {0.9, 0.99, 0.9999}) {
        choice.contact.impedance = impedance;
        choice.contact.time_step = step;
        choice.contact.contact_time = 2.0 * step;  // the stiffest that the engine takes
        add(scene, choice, all);
      }
    }
  }
  return all;
}

}  // namespace assembly_cell::peers
