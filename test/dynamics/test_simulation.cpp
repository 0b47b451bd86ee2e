// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Outputs of a simulation, and its properties as a program: determinism, allocations, reasons to
// stop.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "allocations.h"
#include "assembly_cell/base/input_error.h"
#include "scenes.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

// ---- forces and deflections ----

Vector6 weightAbout(const Simulation& sim) {  // of the peg, about the origin of `hole`
  const Pose peg = sim.pegPose();
  const Scenario& s = sim.scenario();
  const Vector3d force(0, 0, -s.mechanism.peg.mass * s.mechanism.gravity);
  const Vector3d at = peg.p + s.mechanism.peg.half_height * peg.R.col(2);
  return (Vector6() << force, at.cross(force)).finished();
}

TEST(Simulation, AtRestTheCouplingCarriesContactAndWeight) {
  std::vector<Scenario> scenes = {onThePlane(0.05, 0.7), onTwoEdges(0.05, 1e-4)};
  scenes[0].rest.z -= 1e-4;
  scenes[0].rest.x += 1e-5;
  scenes[0].rest.yaw = 0.002;
  for (const Scenario& s : scenes) {
    Simulation sim(s);
    ASSERT_EQ(sim.advance(1.0), StopReason::kOk);
    ASSERT_LT(kineticSpeed(sim.state()), 1e-7);
    ASSERT_GE(closedContacts(sim), 1);
    const Vector6 in_hole = transformWrench(sim.carrierPose(), sim.couplingWrench());
    const Vector6 contact = -sim.holeWrench();
    EXPECT_GT(contact(2), 1.0);
    // what accelerations are left of settling, on 0.4 kg and 1e-4 kg m²
    EXPECT_LT((in_hole - contact - weightAbout(sim)).norm(), 1e-5);
    // the hole's wrench is that of the reported contacts
    Vector6 reported = Vector6::Zero();
    for (const ContactReport& c : sim.contacts()) {
      if (!c.valid) continue;
      reported.head<3>() += c.force;
      reported.tail<3>() += c.point.cross(c.force);
    }
    EXPECT_LT((contact - reported).norm(), 1e-12);
  }
}

// Six small deflections of an upright peg, one at a time: the peg drags sensor_b along.
TEST(Simulation, SignsOfWrenchAndDeflection) {
  Scenario s = load("cell", {"contact={law: none}", "gravity=0"});
  place(s, {0.001, -0.002, 0.01}, 0.0, 0.0);
  const State rest = Simulation(s).state();
  const double arm = s.mechanism.peg.coupling_height;
  const double small = 1e-6;
  const Vector6& k =
      s.mechanism.coupling.stiffness.diagonal;  // thesis order z, x, y, about z, x, y
  const double kx = k(1), ky = k(2), kz = k(0), cx = k(4), cy = k(5), cz = k(3);
  Matrix6 K = (Vector6() << kx, ky, kz, cx, cy, cz).finished().asDiagonal();
  K(0, 4) = K(4, 0) = s.mechanism.coupling.stiffness.k26;
  K(1, 3) = K(3, 1) = s.mechanism.coupling.stiffness.k35;
  for (int i = 0; i < 6; ++i) {
    State moved = rest;
    // translations of the coupling point x, y, z; rotations about it: the centre of mass hangs
    // below, so +x (theta) swings it to +y, +y (phi) to -x
    if (i < 3) moved.q(i == 2 ? 0 : i + 1) += small;
    if (i == 3) moved.q(4) += small, moved.q(2) += arm * std::sin(small);
    if (i == 4) moved.q(3) += small, moved.q(1) -= arm * std::sin(small);
    if (i == 5) moved.q(5) += small;
    Simulation sim(startedFrom(s, moved));
    const Vector6 expected = small * Vector6::Unit(i);
    // second order in 1e-6: arms times 1e-12
    EXPECT_LT((couplingDeflection(sim) - expected).norm(), 1e-12) << i;
    EXPECT_LT((sim.couplingWrench() - K * expected).norm(), 1e-7) << i;
    EXPECT_GT(sim.couplingWrench()(i), 0.0);
    // and the peg is pulled back: its acceleration is against the deflection
    ASSERT_EQ(sim.advance(sim.time() + 1e-6), StopReason::kOk);
    const int rate = i < 3 ? (i == 2 ? 0 : i + 1) : (i == 3 ? 4 : i == 4 ? 3 : 5);
    EXPECT_LT(sim.state().v(rate), 0.0) << i;
  }
}

// Hanging in the upright coupling: deflected down by weight over stiffness, and nothing else.
TEST(Simulation, HangingPegDeflectsTheCoupling) {
  Scenario s = load("cell", {"contact={law: none}"});
  place(s, {0, 0, 0.01}, 0.0, 0.0);
  s.mechanism.coupling.damping.diagonal(0) = 280;
  Simulation sim(s);
  ASSERT_EQ(sim.advance(0.5), StopReason::kOk);
  const double weight = s.mechanism.peg.mass * s.mechanism.gravity;
  Vector6 deflection = Vector6::Zero(), wrench = Vector6::Zero();
  deflection(2) = -weight / s.mechanism.coupling.stiffness.diagonal(0);
  wrench(2) = -weight;
  // settled: the time constant is 3 ms
  EXPECT_LT((couplingDeflection(sim) - deflection).norm(), 1e-11);
  EXPECT_LT((sim.couplingWrench() - wrench).norm(), 1e-6);
}

// Release in the upright coupling of a compliant carrier: deflection X, its rate and the carrier
// deflection w by the eigenvalues of their linear equations. F = k (X - w) + c (X' - w') on the
// carrier, and kComplianceLag w' = C F - w.
TEST(Simulation, CarrierDeflectionHasItsClosedForm) {
  for (const char* axes : {"hole", "carrier"}) {
    for (const char* solver : {"dopri5", "dop853", "hamming", "rk4"}) {
      Scenario s = load("cell", {"contact={law: none}", std::string("coupling.axes=") + axes,
                                 std::string("solver.integrator=") + solver});
      s.solver.tolerance = 1e-12;
      s.solver.step = 2e-5;
      place(s, {0, 0, 0.01}, 0.0, 0.0);
      const double compliance = 2e-5;
      s.imperfections.compliance = {0.0, 0.0, compliance};
      Simulation sim(s);
      const double m = s.mechanism.peg.mass, k = s.mechanism.coupling.stiffness.diagonal(0),
                   c = s.mechanism.coupling.damping.diagonal(0), weight = m * s.mechanism.gravity;
      const double start = sim.state().q(0);
      ASSERT_NEAR(couplingDeflection(sim)(2), 0.0, 1e-15);
      // w' = by (X, X', w)
      const Eigen::RowVector3d by =
          Eigen::RowVector3d(compliance * k, compliance * c, -compliance * k - 1.0) /
          (kComplianceLag + compliance * c);
      Eigen::Matrix3d A;
      A << 0, 1, 0, (Eigen::RowVector3d(-k, -c, k) + c * by) / m, by;
      const Vector3d end = {-weight * (1 / k + compliance), 0, -weight * compliance};
      const Eigen::EigenSolver<Eigen::Matrix3d> modes(A);
      const Eigen::Vector3cd from =
          modes.eigenvectors().partialPivLu().solve((-end).cast<std::complex<double>>());
      for (const double t : {0.001, 0.004, 0.01, 0.03}) {
        ASSERT_EQ(sim.advance(t), StopReason::kOk);
        const Eigen::Vector3cd at =
            modes.eigenvectors() *
            from.cwiseProduct((modes.eigenvalues() * t).array().exp().matrix());
        const Vector3d expected = end + at.real();
        EXPECT_NEAR(sim.state().q(0) - start, expected(0), 1e-11) << axes << ", " << solver;
        EXPECT_NEAR(sim.restShift()(2), expected(2), 1e-11) << axes << ", " << solver;
      }
    }
  }
}

// Pushed along all axes, at rest: the carrier deflection is its compliance times the coupling's
// force.
TEST(Simulation, CarrierDeflectionAtRestIsComplianceTimesForce) {
  Scenario s = load("cell", {"contact={law: none}"});
  place(s, {0, 0, 0.01}, 0.02, 0.5);
  s.push = {0.7, -1.1, 0.4};
  s.imperfections.compliance = {1e-5, 2e-5, 3e-5};
  Simulation sim(s);
  ASSERT_EQ(sim.advance(4.0), StopReason::kOk);
  const Vector3d force = sim.carrierPose().R * sim.couplingWrench().head<3>();
  const Vector6 shift = sim.restShift();
  // what is left of the swing, of 2 N
  EXPECT_LT((shift.head<3>() - s.imperfections.compliance.cwiseProduct(force)).norm(), 1e-11);
  EXPECT_GT(std::abs(force.x()), 0.5);
  // the carrier's springs hold what the coupling pulls, from where they have gone
  const RestPose carrier = sim.carrier();
  EXPECT_NEAR(carrier.x, s.rest.x + shift(0) + force.x() / s.mechanism.carrier.stiffness(0), 1e-11);
  EXPECT_NEAR(carrier.z, s.rest.z + shift(2), 1e-15);
}

TEST(Simulation, PosesAreThoseOfTheScenario) {
  Scenario s = load("cell");
  place(s, {0.003, -0.004, 0.02}, 0.3, 2.0);
  s.initial.carrier_yaw = s.rest.yaw = 0.1;
  Simulation sim(s);
  const Vector3d axis(std::sin(0.3) * std::cos(2.0), std::sin(0.3) * std::sin(2.0), std::cos(0.3));
  EXPECT_LT((sim.pegPose().p - Vector3d(0.003, -0.004, 0.02)).norm(), 1e-16);
  EXPECT_LT((sim.pegPose().R.col(2) - axis).norm(), 1e-15);
  EXPECT_LT((sim.carrierPose().p - Vector3d(s.rest.x, s.rest.y, s.rest.z)).norm(), 1e-16);
  EulerAngles tilted = s.initial.euler;
  tilted.psi = 0.1;
  EXPECT_LT((sim.carrierPose().R - rotationFromEuler(tilted)).norm(), 1e-15);
}

TEST(Simulation, RestTargetIsReachedByTheCarrier) {
  Scenario s = load("cell", {"contact={law: none}"});
  Simulation sim(s);
  RestPose target = s.rest;
  target.x += 0.002;
  target.z -= 0.001;
  target.yaw += 0.01;
  target.theta -= 0.02;
  sim.setRestTarget(target);
  EXPECT_GT((restVector(sim.rest()) - restVector(target)).norm(), 0.01);
  ASSERT_EQ(sim.advance(0.5), StopReason::kOk);
  EXPECT_LT((restVector(sim.rest()) - restVector(target)).norm(), 1e-15);
  ASSERT_EQ(sim.advance(1.0), StopReason::kOk);
  // the load of the carrier's springs is the moment of the hanging peg only
  EXPECT_NEAR(sim.carrierPose().p.x(), target.x, 1e-6);
  EXPECT_NEAR(sim.state().q(8), target.yaw, 1e-5);
}

// ---- properties of the program ----

TEST(Simulation, SameCallsGiveTheSameBits) {
  std::vector<State> ends;
  for (int run = 0; run < 2; ++run) {
    Simulation sim(onTwoEdges(0.05, 1e-4));
    EXPECT_EQ(sim.advance(0.02), StopReason::kOk);
    sim.setExciter({1.0, 770, 0.0, 1}, sim.time());
    RestPose target = sim.rest();
    target.x -= 0.001;
    sim.setRestTarget(target);
    for (int i = 1; i <= 500; ++i) {
      EXPECT_EQ(sim.advance(0.02 + 2e-4 * i), StopReason::kOk);
      if (run == 0 && i % 7 == 0) sim.contacts();  // looking does not disturb
    }
    ends.push_back(sim.state());
  }
  EXPECT_EQ(std::memcmp(ends[0].q.data(), ends[1].q.data(), 9 * sizeof(double)), 0);
  EXPECT_EQ(std::memcmp(ends[0].v.data(), ends[1].v.data(), 9 * sizeof(double)), 0);
}

TEST(Simulation, AdvanceDoesNotAllocate) {
#if defined(ASSEMBLY_CELL_SANITIZED)
  GTEST_SKIP() << "the sanitizer has its own malloc";
#else
  std::vector<Scenario> scenes = {
      onTwoEdges(0.05, 1e-4),
      onTwoEdges(0.05, 1e-4),
      onTwoEdges(0.05, 1e-4),
      load("cell", {"contact={law: none}"}),
      load("impact", {"contact.law=rigid"}),
      load("impact", {"contact.law=rigid", "contact.restitution=0.5"}),
      load("impact", {"contact.law=rigid", "solver.integrator=hamming"}),
      load("impact", {"contact.law=rigid", "solver.integrator=dop853"})};
  scenes[1].contact.stationary_rows = false;
  scenes[2].contact.law = ContactLaw::kSpringDashpot;
  scenes[2].contact.stiffness = 1e5;
  scenes[2].contact.damping = 200;
  for (const Scenario& s : scenes) {
    Simulation sim(s);
    sim.setExciter({1.0, 770, 0.0, 1}, 0.0);
    RestPose target = sim.rest();
    target.y += 1e-4;
    const std::uint64_t before = test::allocationsOfThisThread();
    sim.setRestTarget(target);
    const StopReason reason = sim.advance(0.05);
    sim.contacts();
    const double sum =
        sim.couplingWrench().sum() + sim.holeWrench().sum() + sim.pegPose().p.sum() + sim.energy();
    const std::uint64_t after = test::allocationsOfThisThread();
    EXPECT_EQ(after - before, 0u);
    EXPECT_EQ(reason, StopReason::kOk);
    EXPECT_TRUE(std::isfinite(sum));
  }
  // the counter counts: vectors and Eigen's own storage
  const std::uint64_t before = test::allocationsOfThisThread();
  const std::vector<double> one(100);
  const Eigen::VectorXd two(100);
  // looked at, or the compiler may leave them out
  const void* volatile seen = one.data();
  seen = two.data();
  EXPECT_GE(test::allocationsOfThisThread() - before, seen != nullptr ? 2u : 3u);
#endif
}

TEST(Simulation, StopsWithAReason) {
  const Scenario cell = load("cell");
  const State good = Simulation(cell).state();

  State horizontal = good;
  horizontal.q(4) = 0.09;
  Simulation flat(startedFrom(cell, horizontal));
  EXPECT_EQ(flat.advance(0.1), StopReason::kSingular);
  EXPECT_EQ(flat.time(), 0.0);

  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (int i = 0; i < 9; ++i) {
      State broken = good;
      (i % 2 ? broken.q : broken.v)(i) = bad;
      Simulation sim(startedFrom(cell, broken));
      EXPECT_EQ(sim.advance(0.1), StopReason::kNonFinite);
      EXPECT_EQ(sim.stopReason(), StopReason::kNonFinite);
    }
  }
  EXPECT_EQ(Simulation(startedFrom(cell, good)).advance(0.01), StopReason::kOk);

  // turning over on the way: thrown about x without a coupling to hold it, seen at a step's end
  Scenario thrown = load("cell", {"contact={law: none}", "gravity=0", "solver.max_step=2e-4"});
  thrown.mechanism.coupling = CouplingParameters{};
  thrown.initial.euler_rates = Vector3d(0, 20, 0);
  Simulation turning(thrown);
  EXPECT_EQ(turning.advance(1.0), StopReason::kSingular);
  EXPECT_NEAR(turning.time(), (3.14159265358979 - 0.1 - thrown.initial.euler.theta) / 20, 3e-4);

  // the lowest point reaches the plane in a run without this contact
  Scenario excluded = onThePlane(0.1);
  excluded.initial.position.z() += 1e-4;
  excluded.initial.velocity.z() = -0.1;
  excluded.contact.features &= ~kEdgePlaneSlots;
  Simulation falling(excluded);
  EXPECT_EQ(falling.advance(0.1), StopReason::kEdgePlane);
  EXPECT_GT(falling.time(), 0.8e-3);
  EXPECT_LT(falling.time(), 1.5e-3);
}

TEST(Simulation, NamesWhatIsNotAvailable) {
  const auto error = [](const std::vector<std::string>& overrides) -> std::string {
    try {
      Simulation sim(load("cell", overrides));
    } catch (const InputError& e) {
      return e.what();
    }
    return "accepted";
  };
  EXPECT_NE(error({"solver.integrator=euler"}).find("solver.integrator"), std::string::npos);
  EXPECT_NE(error({"solver.integrator=rk4"}).find("solver.step"), std::string::npos);
  EXPECT_NE(error({"initial.close=true", "initial.peg.position=[0, 0, 0.1]",
                   "initial.peg.euler=[0, 1.5707963267948966, 0]", "contact.features=[edge_edge]"})
                .find("initial.close"),
            std::string::npos);
}

// A carrier moved from outside: each block ends with the commanded position, rate and acceleration,
// along one quintic; here those of a sine.
TEST(Simulation, FollowsAnExternalMotion) {
  constexpr double kBlock = 0.02, kSize = 1e-3, kRate = 20.0;  // [s], [m], [rad/s]
  const RestMotion start;
  RestProfile profile = restProfile(restPose(start.position));
  const auto sine = [&](double t) {
    RestMotion m;
    m.position(2) = kSize * (t - std::sin(kRate * t) / kRate);
    m.rate(2) = kSize * (1.0 - std::cos(kRate * t));
    m.acceleration(2) = kSize * kRate * std::sin(kRate * t);
    return m;
  };
  for (int block = 0; block < 20; ++block) {
    const double t = block * kBlock;
    profile = followProfile(restMotion(profile, t), t, sine(t + kBlock), t + kBlock);
    for (const double share : {0.0, 0.3, 0.7, 1.0}) {
      const RestMotion m = restMotion(profile, t + share * kBlock), r = sine(t + share * kBlock);
      // remainder of the quintic through both ends: kSize kRate^5 T^6 / (6! 64) < 1e-10 m
      EXPECT_NEAR(m.position(2), r.position(2), 1e-10);
      EXPECT_NEAR(m.rate(2), r.rate(2), 1e-7);
      EXPECT_NEAR(m.acceleration(2), r.acceleration(2), 1e-4);
    }
  }
}

bool slipsAnywhere(const Simulation& sim) {
  const auto contacts = sim.contacts();
  return std::any_of(contacts.begin(), contacts.end(), [](const ContactReport& c) {
    return c.valid && c.state == ContactReport::kSlip;
  });
}

// Coulomb's law where slip begins, from the reported forces and accelerations alone: the point of
// contact is accelerated opposite to its friction. Contact of the peg's side with the rim, where
// its inverse mass across (it spins about its axis) is more than twice that up and down.
TEST(Simulation, SlipBeginsAgainstItsFriction) {
  State start;
  start.q << 0.03079837, -0.00174211, 0.00028532, -0.05427963, 1.56181618, 0.0002, -0.00451208,
      0.00074351, 0.00018215;
  Scenario s = startedFrom(load("cell"), start);
  const RestPose rest = {-0.00452373, 0.00074538, 0.08078776, 0.00018039, 1.56237237, -0.05081175};
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  int slips = 0;
  for (int i = 0; i < 100; ++i) {
    Vector6 way;
    for (double& x : way) x = unit(generator);
    const auto load = [&](double by) {
      s.rest = rest;
      s.rest.x += 1e-3 * by * way(0);
      s.rest.y += 1e-3 * by * way(1);
      s.rest.z += 1e-3 * by * way(2);
      s.rest.yaw += 0.01 * by * way(3);
      s.rest.theta += 0.01 * by * way(4);
      s.rest.phi += 0.01 * by * way(5);
      return Simulation(s);
    };
    // of the loads along one way the least that the point doesn't bear
    double by = 1e-3;
    while (by < 1.0 && !slipsAnywhere(load(by))) by *= 1.1;
    const Simulation sim = load(by);
    for (const ContactReport& c : sim.contacts()) {
      if (!c.valid || c.state != ContactReport::kSlip) continue;
      const Kinematics k = kinematics(sim.state());
      const Vector9& rate = sim.acceleration();
      // from rest: no centripetal part
      const Eigen::Vector3d turn = fromThesisAxes(k.Re * rate.segment<3>(3));
      Eigen::Vector3d a =
          fromThesisAxes(rate.head<3>()) + turn.cross(c.point - fromThesisAxes(k.x));
      a -= c.normal * c.normal.dot(a);
      const Eigen::Vector3d friction = c.force - c.normal * c.normal.dot(c.force);
      ++slips;
      EXPECT_LT(a.dot(friction), -(1.0 - 1e-9) * a.norm() * friction.norm()) << i;
    }
  }
  EXPECT_GT(slips, 50);
}

}  // namespace
}  // namespace assembly_cell
