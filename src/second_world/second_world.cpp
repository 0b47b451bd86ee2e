// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/second_world/second_world.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/dynamics/simulation.h"
#include "boxes.h"

namespace assembly_cell {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kPeg = 0, kTurn = 3, kCarrier = 6;         // indices in the engine's velocities
constexpr int kPegQuaternion = 3, kCarrierPosition = 7;  // indices in its positions
constexpr double kMinSine =
    0.1;  // sine of the elevation of the peg's axis: angles are singular at 0
constexpr double kSameTime = 1e-9;  // rounding of sums of steps [s]
constexpr double kCreep =
    1e-3;  // slip speed below which a contact sticks, as soft friction creeps [m/s]
// The engine has a contact with each facet; those with nearly the same normal and position are
// merged.
constexpr double kSameNormal = 0.995, kSamePosition = 3e-3;  // [-], [m]

[[noreturn]] void onError(const char* message) {
  throw InputError(std::string("MuJoCo refuses: ") + message);
}
void onWarning(const char*) {
}  // counted in mjData; the default handler writes a file to the working directory

Matrix6 dampingOf(const CouplingParameters& coupling) {
  CouplingParameters damping;
  damping.stiffness = coupling.damping;
  return couplingStiffness(damping);
}

}  // namespace

struct MujocoSimulation::Engine {
  explicit Engine(const std::string& text);
  ~Engine() {
    mj_deleteData(d);
    mj_deleteModel(m);
  }
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  Matrix3d R() const { return quaternion().toRotationMatrix(); }
  Eigen::Quaterniond quaternion() const {
    const mjtNum* q = d->qpos + kPegQuaternion;
    return {q[0], q[1], q[2], q[3]};
  }
  Vector3d positions(int first) const { return Vector3d::Map(d->qpos + first); }
  Vector3d rates(int first) const { return Vector3d::Map(d->qvel + first); }
  // angular velocity of the peg, axes of `hole`
  Vector3d turn() const { return R() * rates(kTurn); }

  mjModel* m = nullptr;
  mjData* d = nullptr;
  int peg_geom = -1;
  std::vector<Box> boxes;
  std::vector<int> box_geoms;
  Matrix6 stiffness, damping;
};

MujocoSimulation::Engine::Engine(const std::string& text) {
  // the engine's parser has global state
  static std::mutex mutex;
  const std::lock_guard<std::mutex> lock(mutex);
  mju_user_error = onError;
  mju_user_warning = onWarning;
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  constexpr const char* kName = "second_world.xml";
  mj_makeEmptyFileVFS(files.get(), kName, static_cast<int>(text.size()));
  std::memcpy(files->filedata[mj_findFileVFS(files.get(), kName)], text.data(), text.size());
  char why[1000] = "";
  m = mj_loadXML(kName, files.get(), why, sizeof why);
  mj_deleteVFS(files.get());
  if (m == nullptr) onError(why);
  d = mj_makeData(m);
  peg_geom = mj_name2id(m, mjOBJ_GEOM, "peg");
  mj_kinematics(m, d);
  for (int g = 0; g < m->ngeom; ++g) {
    if (g == peg_geom) continue;
    box_geoms.push_back(g);
    using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    boxes.push_back({Rows::Map(d->geom_xmat + 9 * g), Vector3d::Map(d->geom_xpos + 3 * g),
                     Vector3d::Map(m->geom_size + 3 * g)});
  }
}

/// Present state of the coupling: both ends, and its load on the peg.
struct MujocoSimulation::Coupling {
  Pose carrier;        ///< X_H,carrier
  Vector3d end;        ///< the peg's coupling point from the carrier's origin [m]
  Vector3d force;      ///< on the peg there, axes of `hole` [N]
  Vector3d moment;     ///< [N·m]
  Vector6 deflection;  ///< carrier's axes
};

MujocoSimulation::MujocoSimulation(const Scenario& scenario, const SoftContact& contact)
    : scenario_(scenario),
      contact_(contact),
      commands_(scenario),
      engine_(std::make_unique<Engine>(mjcf(scenario, contact))) {
  engine_->stiffness = couplingStiffness(scenario.mechanism.coupling);
  engine_->damping = dampingOf(scenario.mechanism.coupling);
  const State start = Simulation(scenario).state();  // initial state
  const Kinematics k = kinematics(start);
  const Eigen::Quaterniond q(rotationFromEuler({start.q(3), start.q(4), start.q(5)}));
  mjData* d = engine_->d;
  Vector3d::Map(d->qpos) = fromThesisAxes(k.x);
  Eigen::Vector4d::Map(d->qpos + kPegQuaternion) << q.w(), q.x(), q.y(), q.z();
  Vector3d::Map(d->qpos + kCarrierPosition) = start.q.tail<3>();
  Vector3d::Map(d->qvel + kPeg) = fromThesisAxes(k.v);
  Vector3d::Map(d->qvel + kTurn) = q.conjugate() * fromThesisAxes(k.omega);
  Vector3d::Map(d->qvel + kCarrier) = start.v.tail<3>();
  evaluate();
}

MujocoSimulation::~MujocoSimulation() = default;

MujocoSimulation::Coupling MujocoSimulation::coupling() const {
  const Engine& e = *engine_;
  const RestMotion rest = restNow();
  const Vector6 at = rest.position, rate = rest.rate;
  const Vector3d going = e.rates(kCarrier);
  Coupling c;
  c.carrier = carrierPose();
  // phi about y, theta about the rotated x, yaw about the carrier's axis
  const Matrix3d by_phi = rotationFromEuler({at(5), M_PI / 2, 0.0});
  const Vector3d turn =
      rate(5) * Vector3d::UnitY() + rate(4) * by_phi.col(0) + going.z() * c.carrier.R.col(2);
  const Vector3d lever = scenario_.mechanism.peg.coupling_height * e.R().col(2);
  c.end = e.positions(kPeg) + lever - c.carrier.p;
  const Vector3d gliding = e.rates(kPeg) + e.turn().cross(lever) -
                           Vector3d(going.x(), going.y(), rate(2)) - turn.cross(c.end);
  const Matrix3d R_CH = c.carrier.R.transpose();
  Vector6 rates;
  rates << R_CH * gliding, R_CH * (e.turn() - turn);
  c.deflection << R_CH * c.end, vectorFromRotation(R_CH * e.R()).value;
  const Vector6 wrench = -(e.stiffness * c.deflection + e.damping * rates);
  c.force = c.carrier.R * wrench.head<3>();
  c.moment = c.carrier.R * wrench.tail<3>();
  return c;
}

// Accelerations, contacts and their forces at the present state.
void MujocoSimulation::evaluate() {
  Engine& e = *engine_;
  const Mechanism& mechanism = scenario_.mechanism;
  const Coupling c = coupling();
  const Matrix3d R = e.R();
  const Eigen::Vector2d drive = exciterForce(commands_.drive, time());
  // thesis peg axes: x is the second, y opposite to the first
  const Vector3d push = R * (scenario_.push + Vector3d(drive.y(), -drive.x(), 0.0));
  const Vector3d axis = R.col(2);
  mjtNum* on_peg = e.d->xfrc_applied + 6 * e.m->geom_bodyid[e.peg_geom];
  Vector3d::Map(on_peg) = c.force + push;
  Vector3d::Map(on_peg + 3) = c.moment + mechanism.peg.coupling_height * axis.cross(c.force) +
                              mechanism.peg.exciter_height * axis.cross(push);
  const RestMotion rest = restNow();
  const Vector6 &at = rest.position, &rate = rest.rate;
  const Vector3d off = e.positions(kCarrierPosition) - Vector3d(at(0), at(1), at(3));
  const Vector3d slip = e.rates(kCarrier) - Vector3d(rate(0), rate(1), rate(3));
  const Vector3d about = c.moment + c.end.cross(c.force);
  // an arm supports its own weight
  const Vector3d support = mechanism.carrier.mass * mechanism.gravity *
                           Vector3d(mechanism.up.x(), mechanism.up.y(), 0.0);
  Vector3d::Map(e.d->qfrc_applied + kCarrier) =
      support - Vector3d(c.force.x(), c.force.y(), about.dot(c.carrier.R.col(2))) -
      mechanism.carrier.stiffness.cwiseProduct(off) - mechanism.carrier.damping.cwiseProduct(slip);

  const Cylinder peg{e.positions(kPeg), axis, mechanism.peg.radius, mechanism.peg.half_height};
  for (std::size_t i = 0; i < e.boxes.size(); ++i) {
    const int near = mayTouch(e.boxes[i], peg) ? 1 : 0;
    e.m->geom_contype[e.box_geoms[i]] = e.m->geom_conaffinity[e.box_geoms[i]] = near;
  }
  mj_forward(e.m, e.d);
  stale_ = false;
}

// Commanded motion plus the deflection of the carrier.
RestMotion MujocoSimulation::restNow() const {
  RestMotion rest = commands_.restAt(time());
  rest.position.head<3>() += deflection_;
  rest.rate.head<3>() += deflection_rate_;
  return rest;
}

// Deflection after the next step of length h [s], from the present force.
void MujocoSimulation::updateDeflection(double h) {
  const Vector3d way =
      -scenario_.imperfections.compliance.cwiseProduct(coupling().force) - deflection_;
  const Vector3d step = -std::expm1(-h / kComplianceLag) * way;
  deflection_rate_ = step / h;
  deflection_ += step;
}

void MujocoSimulation::step(double h) {
  Engine& e = *engine_;
  if (stale_) evaluate();
  if (isCompliant(scenario_)) updateDeflection(h);
  e.m->opt.timestep = h;
  mj_Euler(e.m, e.d);
  ++steps_;
  const auto finite = [](const mjtNum* values, int n) {
    return std::all_of(values, values + n, [](double v) { return std::isfinite(v); });
  };
  if (!finite(e.d->qpos, e.m->nq) || !finite(e.d->qvel, e.m->nv)) {
    stop_ = StopReason::kNonFinite;
  } else if (e.R()(2, 2) < kMinSine) {
    stop_ = StopReason::kSingular;
  } else {
    evaluate();
    const mjWarningStat* w = e.d->warning;
    if (w[mjWARN_CONTACTFULL].number + w[mjWARN_CNSTRFULL].number > 0) {
      stop_ = StopReason::kEventLimit;
    }
  }
}

StopReason MujocoSimulation::advance(double t_end, std::int64_t attempts) {
  while (stop_ == StopReason::kOk && attempts-- > 0 && time() < t_end - kSameTime) {
    // equal steps of at most time_step
    const double left = t_end - time();
    step(left / std::ceil(left / contact_.time_step - 1e-6));
  }
  return stop_;
}

double MujocoSimulation::time() const { return engine_->d->time; }

Commands& MujocoSimulation::changeCommands() {
  stale_ = true;
  return commands_;
}

void MujocoSimulation::setExciter(const ExciterParameters& exciter, double t_ref) {
  commands_.drive.exciter = exciter;
  commands_.drive.t_ref = t_ref;
  stale_ = true;
}

void MujocoSimulation::setFriction(const FrictionParameters& friction) {
  scenario_.mechanism.friction = friction;
  mjModel& m = *engine_->m;
  for (int g = 0; g < m.ngeom; ++g) m.geom_friction[3 * g] = friction.sliding_coefficient;
  stale_ = true;
}

namespace {

struct EngineContact {
  Vector3d point, normal, force, tangential;  // normal and force on the peg
  double gap;
  bool chamfer;  // of a box of the chamfer
};

EngineContact contactOf(const mjModel* m, const mjData* d, int i, int peg_geom) {
  const mjContact& c = d->contact[i];
  mjtNum local[6];
  mj_contactForce(m, d, i, local);
  using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Matrix3d frame = Rows::Map(c.frame).transpose();  // columns: normal, two tangents
  const double sign = c.geom2 == peg_geom ? 1.0 : -1.0;   // the normal points to the second body
  EngineContact out;
  out.point = Vector3d::Map(c.pos);
  out.normal = sign * frame.col(0);
  out.force = sign * (frame * Vector3d::Map(local));
  out.gap = c.dist;
  const char* of_block = mj_id2name(m, mjOBJ_GEOM, sign > 0.0 ? c.geom1 : c.geom2);
  out.chamfer = of_block != nullptr && std::string(of_block).rfind("chamfer", 0) == 0;
  // tangential velocity of the peg's point
  const Vector3d lever = out.point - Vector3d::Map(d->qpos);
  const Eigen::Quaterniond q(d->qpos[3], d->qpos[4], d->qpos[5], d->qpos[6]);
  const Vector3d v =
      Vector3d::Map(d->qvel) + (q * Vector3d(Vector3d::Map(d->qvel + 3))).cross(lever);
  out.tangential = v - out.normal.dot(v) * out.normal;
  return out;
}

// Feature of a contact; above_bottom: height of its point above the peg's bottom edge [m].
ContactFeature featureOf(const EngineContact& c, double above_bottom) {
  constexpr double kAtEdge = 2e-4,
                   kAcross =
                       0.1;  // distance from an edge [m]; vertical component of a wall's normal
  if (c.chamfer && c.normal.z() > kAcross && above_bottom < kAtEdge) {
    return ContactFeature::kEdgeCone;
  }
  if (c.normal.z() > 0.9) {
    return c.point.z() < -kAtEdge || above_bottom < kAtEdge ? ContactFeature::kEdgePlane
                                                            : ContactFeature::kRimFace;
  }
  const bool at_rim = c.point.z() > -kAtEdge, at_edge = above_bottom < kAtEdge;
  return at_rim && at_edge ? ContactFeature::kEdgeEdge
         : at_rim          ? ContactFeature::kRimSide
                           : ContactFeature::kEdgeWall;
}

}  // namespace

std::array<ContactReport, kSlots> MujocoSimulation::contacts() const {
  const Engine& e = *engine_;
  struct Merged {
    EngineContact c;
    double weight;
  };
  std::vector<Merged> merged;
  for (int i = 0; i < e.d->ncon; ++i) {
    const EngineContact c = contactOf(e.m, e.d, i, e.peg_geom);
    const double weight = c.force.norm();
    const auto same = std::find_if(merged.begin(), merged.end(), [&](const Merged& other) {
      return other.c.normal.dot(c.normal) > kSameNormal &&
             (other.c.point - c.point).norm() < kSamePosition;
    });
    if (same == merged.end()) {
      merged.push_back({c, weight});
      continue;
    }
    const double all = same->weight + weight, part = all > 0.0 ? weight / all : 0.0;
    same->c.point += part * (c.point - same->c.point);
    same->c.normal = (same->c.normal + part * (c.normal - same->c.normal)).normalized();
    same->c.tangential += part * (c.tangential - same->c.tangential);
    same->c.force += c.force;
    same->c.gap = std::min(same->c.gap, c.gap);
    same->weight = all;
  }
  std::sort(merged.begin(), merged.end(),
            [](const Merged& a, const Merged& b) { return a.weight > b.weight; });
  std::array<ContactReport, kSlots> report;
  const Pose X_HP = pegPose();
  for (std::size_t i = 0; i < std::min<std::size_t>(kSlots, merged.size()); ++i) {
    const EngineContact& c = merged[i].c;
    ContactReport& r = report[i];
    r.feature = featureOf(c, X_HP.R.col(2).dot(c.point - X_HP.p));
    r.valid = true;
    if (merged[i].weight > 0.0) {
      r.state = c.tangential.norm() < kCreep ? ContactReport::kStick : ContactReport::kSlip;
    }
    r.point = c.point;
    r.normal = c.normal;
    r.force = c.force;
    r.gap = c.gap;
  }
  return report;
}

int MujocoSimulation::contactCount() const { return engine_->d->ncon; }

Vector6 MujocoSimulation::couplingWrench() const {
  const Coupling c = coupling();
  const Matrix3d R_CH = c.carrier.R.transpose();
  Vector6 w;
  w << -(R_CH * c.force), -(R_CH * (c.moment + c.end.cross(c.force)));
  return w;
}

Vector6 MujocoSimulation::holeWrench() const {
  const Engine& e = *engine_;
  Vector6 w = Vector6::Zero();
  for (int i = 0; i < e.d->ncon; ++i) {
    const EngineContact c = contactOf(e.m, e.d, i, e.peg_geom);
    w.head<3>() -= c.force;
    w.tail<3>() -= c.point.cross(c.force);
  }
  return w;
}

Eigen::Vector2d MujocoSimulation::specificForce(double height) const {
  const Engine& e = *engine_;
  const Matrix3d R = e.R();
  const Vector3d arm = height * R.col(2), turn = e.turn();
  const Vector3d turning = R * Vector3d(Vector3d::Map(e.d->qacc + kTurn));
  Vector3d specific_force =
      Vector3d::Map(e.d->qacc + kPeg) + turning.cross(arm) + turn.cross(turn.cross(arm));
  specific_force += scenario_.mechanism.gravity * scenario_.mechanism.up;
  return {R.col(0).dot(specific_force), R.col(1).dot(specific_force)};
}

Pose MujocoSimulation::pegPose() const {
  const Matrix3d R = engine_->R();
  return {R, engine_->positions(kPeg) - scenario_.mechanism.peg.half_height * R.col(2)};
}

Pose MujocoSimulation::carrierPose() const { return poseFromRest(carrier()); }

RestPose MujocoSimulation::carrier() const {
  RestPose pose = rest();
  const Vector3d place = engine_->positions(kCarrierPosition);
  pose.x = place.x();
  pose.y = place.y();
  pose.yaw = place.z();
  return pose;
}

}  // namespace assembly_cell
