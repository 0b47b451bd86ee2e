// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The MuJoCo backend against closed forms, the engine without what this package adds, and
// the exact contacts.
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/dynamics/simulation.h"
#include "assembly_cell/second_world/second_world.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

Scenario cellScenario(const std::vector<std::string>& overrides = {}) {
  return loadScenario(ASSEMBLY_CELL_SOURCE_DIR "/config/scenarios/cell.yaml", overrides);
}

// upright, so high over the plane and so far from the hole's axis, the coupling without load: z is
// a lone damped oscillator
Scenario upright(double height, double x = 0.0, const std::vector<std::string>& more = {}) {
  Scenario s = cellScenario(more);
  s.rest = RestPose{};
  s.rest.x = s.initial.carrier_x = x;
  s.rest.z = height + s.mechanism.peg.half_height + s.mechanism.peg.coupling_height;
  s.initial.carrier_y = 0.0;
  s.initial.position = Vector3d(x, 0.0, height + s.mechanism.peg.half_height);
  s.initial.euler = EulerAngles{0.0, M_PI / 2, 0.0};
  return s;
}

// greatest difference from m z'' + c z' + k z = -m g after 30 ms [m]
double swingError(double time_step) {
  const Scenario s = upright(0.01);
  SoftContact contact;
  contact.time_step = time_step;
  MujocoSimulation world(s, contact);
  const double m = s.mechanism.peg.mass, k = s.mechanism.coupling.stiffness.diagonal(0);
  const double c = s.mechanism.coupling.damping.diagonal(0), sag = m * s.mechanism.gravity / k;
  const double decay = c / (2 * m), omega = std::sqrt(k / m - decay * decay);
  double error = 0.0;
  for (int i = 1; i <= 150; ++i) {
    const double t = i * 2e-4;
    EXPECT_EQ(world.advance(t), StopReason::kOk);
    EXPECT_NEAR(world.time(), t, 1e-12);
    const double z = -sag + sag * std::exp(-decay * t) *
                                (std::cos(omega * t) + decay / omega * std::sin(omega * t));
    error = std::max(error, std::abs(world.pegPose().p.z() - 0.01 - z));
  }
  return error / sag;
}

// Semi-implicit Euler: of the order of omega h / 2 of the amplitude, and half of it at half a step.
TEST(MujocoSimulation, FreeSwingIsTheClosedForm) {
  const double coarse = swingError(2e-4), fine = swingError(5e-5);
  EXPECT_LT(coarse, 0.5 * 356 * 2e-4 * 1.5);
  EXPECT_LT(fine, 0.35 * coarse);
}

// A cell on its side: the hanging peg of both simulators, to the backend's own step error.
TEST(MujocoSimulation, SidewaysGravityHangsThePegAsInSimulation) {
  for (const char* gravity : {"[0, -9.8, 0]", "[6, 0, 7]"}) {
    const Scenario s =
        upright(0.01, 0.0, {std::string("gravity=") + gravity, "coupling.axes=carrier"});
    MujocoSimulation mujoco(s, SoftContact());
    Simulation exact(s);
    ASSERT_EQ(mujoco.advance(3.0), StopReason::kOk);
    ASSERT_EQ(exact.advance(3.0), StopReason::kOk);
    const Vector3d sag = exact.pegPose().p - Vector3d(0.0, 0.0, 0.01);
    EXPECT_GT(sag.norm(), 5e-5);
    EXPECT_LT((mujoco.pegPose().p - exact.pegPose().p).norm(), 1e-3 * sag.norm()) << gravity;
  }
}

// Forced by the exciter through the whole mechanism: as the exact simulation, which has closed
// forms and peers of its own, for the steady state.
TEST(MujocoSimulation, ExciterMovesThePegAsInSimulation) {
  const Scenario s = cellScenario();
  const auto amplitude = [](SimulatorBackend& world) {
    ExciterParameters drive;
    drive.amplitude = 4.0;
    drive.frequency = 2 * M_PI * 100;  // ten periods are 500 samples
    world.setExciter(drive, 0.0);
    std::complex<double> sum = 0.0;
    for (int i = 1; i <= 3000; ++i) {
      const double t = i * 2e-4;
      EXPECT_EQ(world.advance(t), StopReason::kOk);
      if (i > 2500) sum += std::polar(1.0, -drive.frequency * t) * world.couplingWrench().x();
    }
    return sum / 250.0;
  };
  Simulation first(s);
  SoftContact fine;
  fine.time_step = 2e-5;
  MujocoSimulation second(s, fine);
  const std::complex<double> a = amplitude(first), b = amplitude(second);
  EXPECT_GT(std::abs(a), 1.0);
  // the half step between force and motion: 0.5 * omega * h of phase; angles' squares 1e-4
  EXPECT_LT(std::abs(b / a - 1.0), 0.5 * 628 * 2e-5 + 5e-3);
}

// Pressed flat beside the hole by the coupling's spring.
TEST(MujocoSimulation, StaticPressIsTheSpring) {
  const Scenario s = upright(0.0005, 0.06);
  MujocoSimulation world(s, SoftContact{});
  RestPose rest = s.rest;
  const double press = 2e-4;
  rest.z = 0.08 - press;
  world.setRestTarget(rest);
  ASSERT_EQ(world.advance(1.0), StopReason::kOk);
  const double k = s.mechanism.coupling.stiffness.diagonal(0), force = k * press;
  const double weight = s.mechanism.peg.mass * s.mechanism.gravity;
  const double depth = -world.pegPose().p.z();  // of the soft contact
  EXPECT_GT(depth, 0.0);
  EXPECT_LT(depth, 1e-6);
  // the engine's solver leaves 1e-5 of it
  EXPECT_NEAR(world.holeWrench()(2), -(force - k * depth) - weight, 1e-5 * force);
  EXPECT_NEAR(world.couplingWrench()(2), k * (press - depth), 1e-5 * force);
}

// Tilted by 3.4 degrees, pressed on one point and shaken: what the accelerometers of both worlds
// see of it, at the coupling and near the edge.
Eigen::Vector4cd shaken(SimulatorBackend& world, RestPose rest) {
  constexpr double kRate = 2 * M_PI * 70;  // 14 periods are 1000 samples
  world.setRestTarget(rest);
  EXPECT_EQ(world.advance(2.5), StopReason::kOk);
  for (int i = 0; i < 200 && world.holeWrench()(2) > -12.0; ++i) {
    rest.z -= 1e-4;
    world.setRestTarget(rest);
    EXPECT_EQ(world.advance(world.time() + 0.03), StopReason::kOk);
  }
  ExciterParameters drive;
  drive.amplitude = 1.0;
  drive.frequency = kRate;
  world.setExciter(drive, world.time());
  const double start = world.time() + 0.5;
  EXPECT_EQ(world.advance(start), StopReason::kOk);
  Eigen::Vector4cd sum = Eigen::Vector4cd::Zero();
  for (int i = 1; i <= 1000; ++i) {
    EXPECT_EQ(world.advance(start + i * 2e-4), StopReason::kOk);
    Eigen::Vector4d measured;
    measured << world.specificForce(0.05), world.specificForce(-0.02);
    sum += std::polar(1.0 / 500, -kRate * (0.5 + i * 2e-4)) * measured;
  }
  return sum;
}

TEST(MujocoSimulation, ShakesOnAPointAsInSimulation) {
  const std::string law =
      "contact={law: rigid, restitution: 0, features: [edge_edge, edge_plane, edge_wall, "
      "rim_side]}";
  const Scenario turning = cellScenario({law, "coupling.axes=carrier"});
  RestPose rest;
  rest.x = 0.08;
  rest.z = 0.09;
  rest.theta = M_PI / 2 + 0.06;
  SoftContact fine;
  fine.time_step = 5e-5;
  MujocoSimulation second(turning, fine);
  Simulation first(turning), fixed(cellScenario({law}));
  const Eigen::Vector4cd a = shaken(first, rest), b = shaken(second, rest);
  EXPECT_GT(a.norm(), 5.0);
  // half a step between force and motion, 440 * 2.5e-5, and the contact's softness
  EXPECT_LT((a - b).norm(), 0.015 * a.norm());
  // and it sees the coupling's axes: those of `hole` are another mechanism
  EXPECT_GT((shaken(fixed, rest) - b).norm(), 0.03 * a.norm());
}

// The same static presses in both worlds: where they touch and with what force.
struct Press {
  const char* name;
  double x, y, tilt_x, tilt_y, down;
};
class BothBackends : public testing::TestWithParam<Press> {};

TEST_P(BothBackends, TouchAtTheSamePosition) {
  const Press& at = GetParam();
  // the viscous law keeps what a contact sank in while it came to rest
  const Scenario s =
      cellScenario({"contact={law: rigid, restitution: 0, features: [edge_edge, edge_plane, "
                    "edge_wall, rim_side]}"});
  // hanging where it starts, the carrier goes to the place above and down
  const auto settle = [&](SimulatorBackend& world) {
    RestPose rest;
    rest.x = at.x;
    rest.y = at.y;
    rest.theta = M_PI / 2 + at.tilt_x;
    rest.phi = at.tilt_y;
    rest.z = 0.087;
    world.setRestTarget(rest);
    EXPECT_EQ(world.advance(1.5), StopReason::kOk);
    rest.z = 0.08 - at.down;
    world.setRestTarget(rest);
    EXPECT_EQ(world.advance(4.0), StopReason::kOk);
    EXPECT_TRUE(world.atRest());
  };
  Simulation first(s);
  MujocoSimulation second(s, SoftContact{});
  settle(first);
  settle(second);
  const Vector6 a = first.holeWrench(), b = second.holeWrench();
  EXPECT_GT(a.head<3>().norm(), 2.0);
  // springs of Euler angles against those of the rotation vector: the square of the tilt, and
  // facets
  EXPECT_LT((a - b).head<3>().norm(), 0.005 * a.head<3>().norm()) << at.name;
  const Vector3d apart = first.pegPose().p - second.pegPose().p;
  EXPECT_LT(std::abs(apart.z()), 5e-6) << at.name;
  // soft friction lets the peg creep to less shear
  EXPECT_LT(apart.head<2>().norm(), 2e-5) << at.name;
  // the line of the force: where it goes through the plane
  const auto through = [](const Vector6& w) { return Eigen::Vector2d(-w(4) / w(2), w(3) / w(2)); };
  EXPECT_LT((through(a) - through(b)).norm(), 6e-4) << at.name;  // a facet is 0.62 mm wide
}

INSTANTIATE_TEST_SUITE_P(, BothBackends,
                         testing::Values(Press{"face", 0.052, 0.01, 0.02, 0.01, 0.0002},
                                         Press{"rim", 0.004, -0.003, 0.012, 0.02, 0.0006},
                                         Press{"far_rim", -0.012, 0.006, -0.015, 0.004, 0.0005}),
                         [](const testing::TestParamInfo<Press>& press) {
                           return std::string(press.param.name);
                         });

// The boxes that are left out would not have touched: the engine alone, with all of them.
TEST(MujocoSimulation, SkipsOnlySeparatedBoxes) {
  SoftContact contact;
  contact.facets = 64;
  std::mt19937 random(5);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
  };
  int touching = 0;
  for (int i = 0; i < 24; ++i) {
    Scenario s = upright(0.01);
    const double reach = i % 3 == 0 ? 1e-4 : i % 3 == 1 ? 0.01 : 0.05;
    s.initial.position =
        Vector3d(uniform(-reach, reach), uniform(-reach, reach), uniform(-0.01, 0.002) + 0.03);
    s.initial.euler = {uniform(-0.05, 0.05), M_PI / 2 + uniform(-0.05, 0.05), 0.0};
    const MujocoSimulation world(s, contact);

    const std::string path = test::temporaryFile("skips_only.xml");
    std::ofstream(path) << mjcf(s, contact);
    char why[500] = "";
    mjModel* m = mj_loadXML(path.c_str(), nullptr, why, sizeof why);
    ASSERT_NE(m, nullptr) << why;
    mjData* d = mj_makeData(m);
    const Pose X_HP = world.pegPose();
    const Vector3d centre = X_HP.p + s.mechanism.peg.half_height * X_HP.R.col(2);
    Vector3d::Map(d->qpos) = centre;
    const Eigen::Quaterniond q(X_HP.R);
    Eigen::Vector4d::Map(d->qpos + 3) << q.w(), q.x(), q.y(), q.z();
    mj_fwdPosition(m, d);
    EXPECT_EQ(world.contactCount(), d->ncon) << "scene " << i;
    touching += d->ncon > 0 ? 1 : 0;
    mj_deleteData(d);
    mj_deleteModel(m);
  }
  EXPECT_GT(touching, 8);
}

// A bore that leans by half a degree is free down to its bottom for a peg that leans as it does,
// all round and with a chamfer as well, and ends by its clearance aside.
TEST(MujocoSimulation, InclinedBoreIsFree) {
  constexpr double kLean = 8.727e-3, kDeep = 0.055;
  for (const double chamfer : {0.0, 5e-4}) {
    SoftContact contact;
    contact.chamfer = chamfer;
    for (int i = 0; i < 8; ++i) {
      const double a = 0.3 + i * M_PI / 4;
      const auto contacts = [&](double aside) {
        Scenario s = upright(0.0);
        const Eigen::Vector2d lean = kLean * Eigen::Vector2d(std::cos(a), std::sin(a));
        s.imperfections.bore_lean = lean;
        const Vector3d axis = Vector3d(lean.x(), lean.y(), 1.0).normalized();
        const Vector3d off = aside * Vector3d(std::cos(a), std::sin(a), 0.0);
        s.initial.position =
            -kDeep * Vector3d(lean.x(), lean.y(), 1.0) + s.mechanism.peg.half_height * axis + off;
        s.initial.euler = {std::atan2(axis.x(), axis.z()), M_PI / 2 - std::asin(axis.y()), 0.0};
        return MujocoSimulation(s, contact).contactCount();
      };
      EXPECT_EQ(contacts(0.0), 0) << "azimuth " << a << ", chamfer " << chamfer;
      EXPECT_GT(contacts(1.2e-4), 0) << "azimuth " << a << ", chamfer " << chamfer;
      EXPECT_GT(contacts(-1.2e-4), 0) << "azimuth " << a << ", chamfer " << chamfer;
    }
  }
}

// The scenario's chamfer, at an angle of its own, in a bore that leans: an upright peg whose edge
// is 2 mm deep is free as far as the cone is wide there, by the closed form, and not farther.
// Facets: 1 µm.
TEST(MujocoSimulation, ChamferOfTheScenarioIsTheCone) {
  constexpr double kWidth = 2e-3, kAngle = 0.4, kDepth = 2e-3, kLean = 8.727e-3;
  const auto contacts = [&](double aside, double lean) {
    Scenario s = upright(-kDepth, aside);
    s.mechanism.hole.chamfer_width = kWidth;
    s.mechanism.hole.chamfer_angle = kAngle;
    s.imperfections.bore_lean = {lean, 0.0};
    return MujocoSimulation(s, SoftContact{}).contactCount();
  };
  const Scenario s = upright(0.0);
  const double deep = kWidth / std::tan(kAngle);
  const double clearance = s.mechanism.hole.radius - s.mechanism.peg.radius;
  for (const double lean : {0.0, kLean}) {
    // from the mouth to the bore's rim, whose axis is off by its depth's lean
    const double share = kDepth / deep;
    for (const double side : {1.0, -1.0}) {
      const double cone = clearance + kWidth - share * (kWidth + side * deep * lean);
      EXPECT_EQ(contacts(side * (cone - 5e-6), lean), 0) << side << " " << lean;
      EXPECT_GT(contacts(side * (cone + 5e-6), lean), 0) << side << " " << lean;
    }
  }
}

TEST(MujocoSimulation, ChamferGuidesThePegIn) {
  // 0.6 mm off the middle, straight down: onto the face without a chamfer, into the hole with one
  const auto lowered = [](double chamfer) {
    const Scenario s = upright(0.0005, 0.0006);
    SoftContact contact;
    contact.chamfer = chamfer;
    MujocoSimulation world(s, contact);
    RestPose rest = s.rest;
    rest.z = 0.0785;
    world.setRestTarget(rest);
    EXPECT_EQ(world.advance(0.4), StopReason::kOk);
    return -world.pegPose().p.z();
  };
  EXPECT_LT(lowered(0.0), 1e-4);
  EXPECT_GT(lowered(0.001), 1e-3);
}

}  // namespace
}  // namespace assembly_cell
