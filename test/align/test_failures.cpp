// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Every failure of an alignment, by a cell in which something is wrong; and the table of them in
// docs/reference/strategies.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/align/search/press_controller.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "assembly_cell/cell/start.h"
#include "scenarios.h"

using namespace assembly_cell;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// A cell in which something is wrong: commands and measurements may be changed.
class FaultyPlant : public Plant {
 public:
  explicit FaultyPlant(SimulatedPlant& plant) : plant_(plant) {}

  PlantBlock next(const PlantCommand& given) override {
    PlantCommand command = given;
    if (on_command) on_command(command);
    if (command.exciter) amplitude = command.exciter->amplitude;
    PlantBlock block = plant_.next(command);
    if (blocks++ == 0) start = block;
    force.setZero();
    for (const ContactReport& c : plant_.truth().contacts()) {
      if (!c.valid) continue;
      force += c.force;
      if (c.force.norm() > 0.5) point = c.point;
    }
    greatest = std::max(greatest, force.norm());
    if (on_block) on_block(block);
    return block;
  }
  TwinForceSensing* twinForce() override { return plant_.twinForce(); }

  Pose pegPose() { return plant_.truth().pegPose(); }

  // of the contacts now, and where the last of them was, in `hole`
  Vector3d force = Vector3d::Zero(), point = Vector3d::Zero();
  double greatest = 0.0, amplitude = 0.0;
  int blocks = 0;
  PlantBlock start;  // the first: hanging free
  std::function<void(PlantCommand&)> on_command;
  std::function<void(PlantBlock&)> on_block;

 private:
  SimulatedPlant& plant_;
};

struct Arrangement {
  Scenario scenario = cell();
  Mechanism nominal = scenario.mechanism;
  CellParameters sensors;
  AlignParameters parameters;
};

struct Case {
  AlignFailure failure;
  const char* strategy;
  std::function<void(Arrangement&)> arrange;
  std::function<void(FaultyPlant&)> spoil;
};

bool pressed(const FaultyPlant& plant) { return plant.force.norm() > 4.0; }

void forgetModes(FaultyPlant& plant, LocusMode forgotten) {
  plant.on_block = [forgotten](PlantBlock& b) {
    if (b.locus && b.locus->mode.mode == forgotten) b.locus->mode.mode = LocusMode::kUndecided;
  };
}

// A reading that comes after the double contact of an attempt.
void afterDouble(FaultyPlant& plant, const std::function<void(LocusReading&)>& change) {
  plant.on_block = [&plant, change, doubled = false](PlantBlock& b) mutable {
    // back at the height of the start: another attempt
    if (b.carrier.z > plant.start.carrier.z + 2e-3) doubled = false;
    if (!b.locus) return;
    if (doubled) change(*b.locus);
    if (b.locus->mode.mode == LocusMode::kSegment) doubled = true;
  };
}

const Case kCases[] = {
    {AlignFailure::kForceLimit, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       // knocks against what is pressed
       plant.on_block = [&plant](PlantBlock& b) {
         if (pressed(plant)) b.wrench_b(2) += 60.0;
       };
     }},
    {AlignFailure::kForceLimit, "single_contact",
     [](Arrangement& s) { s.parameters.press_force = 12.0; },
     [](FaultyPlant& plant) {
       plant.on_block = [&plant](PlantBlock& b) {
         if (pressed(plant)) b.wrench_b(2) += 60.0;
       };
     }},
    {AlignFailure::kSensorSaturated, "double_contact", nullptr,
     [](FaultyPlant& plant) {
       plant.on_block = [&plant](PlantBlock& b) { b.saturated = b.saturated || pressed(plant); };
     }},
    // by itself, whatever is done
    {AlignFailure::kSensorSaturated, "twin_force", nullptr,
     [](FaultyPlant& plant) { plant.on_block = [](PlantBlock& b) { b.saturated = true; }; }},
    {AlignFailure::kJammed, "twin_force", [](Arrangement& s) { s.parameters.insert.depth = 0.03; },
     [](FaultyPlant& plant) {
       // a chip in the bore, 10 mm down
       plant.on_block = [&plant](PlantBlock& b) {
         if (plant.pegPose().p.z() < -0.01) b.wrench_b(2) += 20.0;
       };
     }},
    {AlignFailure::kInContact, "single_contact", nullptr,
     [](FaultyPlant& plant) {
       // glued before the start, pressed with 10 N
       plant.on_block = [&plant](PlantBlock& b) {
         b.wrench_b(2) += 10.0 - 3e4 * (b.carrier.z - plant.start.carrier.z);
       };
     }},
    {AlignFailure::kNotStill, "single_contact", nullptr,
     [](FaultyPlant& plant) {
       plant.on_block = [](PlantBlock& b) {
         b.wrench_b(0) += 2.0 * std::sin(2 * M_PI * 5.0 * b.time);
       };
     }},
    // a weight that isn't the peg's, and noise that contact would drown in
    {AlignFailure::kNotStill, "twin_force", [](Arrangement& s) { s.sensors.noise = 0.8; },
     [](FaultyPlant& plant) { plant.on_block = [](PlantBlock& b) { b.wrench_b(2) += 30.0; }; }},
    {AlignFailure::kNotArrived, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       // the drive stops at the first contact
       plant.on_command = [&plant, stopped = false](PlantCommand& c) mutable {
         stopped = stopped || pressed(plant);
         if (stopped) c.rest.reset();
       };
     }},
    {AlignFailure::kNoContact, "vibratory",
     [](Arrangement& s) {
       s.scenario = startAt(s.scenario, Vector2d(0.06, 0), Vector2d(0, 0), 0.05);
     },
     nullptr},
    {AlignFailure::kGaveWay, "twin_force",
     // a coupling that is ten times softer than nominal
     [](Arrangement& s) {
       s.scenario = cell({"coupling.stiffness.diagonal=[5.0e3, 5.0e4, 5.0e4, 50, 50, 50]"});
     },
     nullptr},
    {AlignFailure::kPressNotHeld, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       // each move under load shifts the reading, to and fro: no correction arrives
       auto shift = std::make_shared<double>(2.5);
       plant.on_command = [&plant, shift](PlantCommand& c) {
         if (c.rest && plant.force.z() > 8.0) *shift = -*shift;
       };
       plant.on_block = [&plant, shift](PlantBlock& b) {
         if (plant.force.z() > 8.0) b.wrench_b(2) += *shift;
       };
     }},
    {AlignFailure::kStuck, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       // glued from the first press on
       plant.on_block = [&plant, glue = -1.0](PlantBlock& b) mutable {
         if (glue == -1.0 && pressed(plant)) glue = b.carrier.z;
         if (glue > -1.0) b.wrench_b(2) -= 3e4 * std::max(0.0, b.carrier.z - glue);
       };
     }},
    {AlignFailure::kZeroShifted, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       // something clings to the peg from the first press on
       plant.on_block = [&plant, clings = false](PlantBlock& b) mutable {
         clings = clings || pressed(plant);
         if (clings) b.wrench_b(2) -= 3.0;
       };
     }},
    {AlignFailure::kWedged, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       plant.on_block = [&plant](PlantBlock& b) { b.wrench_b(0) += 2.0 * plant.force.z(); };
     }},
    {AlignFailure::kEdgeInHole, "single_contact", nullptr,
     [](FaultyPlant& plant) {
       // held by what it touches, within a millimetre
       plant.on_block = [&plant, held = -1.0](PlantBlock& b) mutable {
         if (plant.force.norm() > 0.5) held = b.carrier.z;
         if (b.carrier.z > held + 1e-3) held = -1.0;
         if (held > -1.0 && b.carrier.z > held + 1e-4) b.wrench_b(2) -= 2.0;
       };
     }},
    {AlignFailure::kBothEdges, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       // the line of action halfway to the axis at the bottom
       plant.on_block = [&plant](PlantBlock& b) {
         const Vector6 w = b.wrench_b - plant.start.wrench_b;
         const Vector3d at_bottom = Vector3d(0, 0, -0.08).cross(Vector3d(w.head<3>()));
         b.wrench_b.tail<3>() -= 0.5 * (w.tail<3>() - at_bottom);
       };
     }},
    {AlignFailure::kNotFree, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       // a cable that pulls on a tilted peg, once a contact was made
       plant.on_block = [&plant, made = false](PlantBlock& b) mutable {
         made = made || pressed(plant);
         const Eigen::Matrix3d turn =
             poseFromRest(b.carrier).R * poseFromRest(plant.start.carrier).R.transpose();
         if (made && turn.trace() < 3.0 - 4e-4) b.wrench_b(2) -= 3.0;
       };
     }},
    {AlignFailure::kTooUncertain, "single_contact",
     [](Arrangement& s) {
       s.sensors.bits = 10;
       s.parameters.exciter_amplitude = 0.05;
       s.parameters.press_force = 5.0;
     },
     nullptr},
    // steps of 10 bits in the zero of a light press
    {AlignFailure::kTooUncertain, "twin_force",
     [](Arrangement& s) {
       s.sensors.bits = 10;
       s.parameters.contact_force = 2.0;
     },
     nullptr},
    {AlignFailure::kNoReading, "vibratory", nullptr,
     [](FaultyPlant& plant) { plant.on_block = [](PlantBlock& b) { b.locus.reset(); }; }},
    {AlignFailure::kNoPlaneReading, "double_contact", nullptr,
     [](FaultyPlant& plant) {
       plant.on_command = [](PlantCommand& c) {
         if (c.exciter) c.exciter->amplitude = 0.0;
       };
     }},
    {AlignFailure::kNoHoleUnderEdge, "double_contact",
     [](Arrangement& s) {
       s.scenario = startAt(s.scenario, Vector2d(0.12, 0), Vector2d(0, 0), 0.002);
     },
     nullptr},
    {AlignFailure::kNoHoleUnderEdge, "single_contact",
     [](Arrangement& s) {
       s.scenario = startAt(s.scenario, Vector2d(0.12, 0), Vector2d(0, 0), 0.002);
       s.parameters.sweep_readings = 12;
     },
     nullptr},
    {AlignFailure::kOneEdgeOnly, "single_contact",
     [](Arrangement& s) {
       s.scenario = startAt(s.scenario, Vector2d(0.013, -0.003), Vector2d(0.01, 0.005), 0.003);
       s.parameters.sweep_readings = 40;
       s.parameters.rounds = 1;
     },
     [](FaultyPlant& plant) {
       // three quarters of the rim say nothing
       plant.on_block = [&plant](PlantBlock& b) {
         const bool hidden = plant.point.y() > 0.0 || plant.point.x() > 0.0;
         if (b.locus && hidden && plant.point.head<2>().norm() < 0.0256) {
           b.locus->mode.mode = LocusMode::kUndecided;
         }
       };
     }},
    {AlignFailure::kNotDouble, "double_contact", nullptr,
     [](FaultyPlant& plant) { forgetModes(plant, LocusMode::kSegment); }},
    {AlignFailure::kLostContact, "double_contact", nullptr,
     [](FaultyPlant& plant) {
       afterDouble(plant, [](LocusReading& r) { r.mode.mode = LocusMode::kNone; });
     }},
    {AlignFailure::kEdgeNotResolved, "double_contact", nullptr,
     [](FaultyPlant& plant) {
       afterDouble(plant, [](LocusReading& r) { r.mode.mode = LocusMode::kUndecided; });
     }},
    {AlignFailure::kNotSettled, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       // 0.5 N/s: within what counts as still from block to block, not over a window
       plant.on_block = [](PlantBlock& b) { b.wrench_b(2) += 0.5 * b.time; };
     }},
    {AlignFailure::kSensorSigns, "twin_force", nullptr,
     [](FaultyPlant& plant) { plant.on_block = [](PlantBlock& b) { b.wrench_a *= -1.0; }; }},
    {AlignFailure::kNoPose, "twin_force", nullptr,
     [](FaultyPlant& plant) {
       plant.on_block = [&plant](PlantBlock& b) { b.wrench_a = plant.start.wrench_a; };
     }},
    {AlignFailure::kNoHoleUnderEdge, "touch",
     [](Arrangement& s) { s.scenario.mechanism.hole.radius = 1e-3; }, nullptr},
    {AlignFailure::kNoHoleUnderEdge, "auto",
     [](Arrangement& s) { s.scenario.mechanism.hole.radius = 1e-3; }, nullptr},
    {AlignFailure::kNoContact, "auto",
     [](Arrangement& s) { s.scenario.mechanism.hole.radius = 0.05; }, nullptr},
    {AlignFailure::kNotSeated, "auto",
     [](Arrangement& s) {
       s.scenario.mechanism.hole.depth = 0.005;
       s.nominal.hole.depth = 0.04;
       s.parameters.insert.depth = 0.02;
     },
     nullptr},
    {AlignFailure::kTimeLimit, "touch", [](Arrangement& s) { s.parameters.time_limit = 5.0; },
     nullptr},
    {AlignFailure::kNotInserted, "twin_force",
     [](Arrangement& s) {
       s.parameters.rounds = 1;
       s.parameters.time_limit = 600.0;  // of all tries
     },
     [](FaultyPlant& plant) {
       // something lies in the hole
       plant.on_block = [&plant](PlantBlock& b) {
         if (plant.pegPose().p.z() < -5e-5) b.wrench_b(2) += 5.0;
       };
     }},
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.strategy << " " << toString(c.failure); }

class Failures : public testing::TestWithParam<Case> {};

}  // namespace

TEST_P(Failures, AreNamedWithTheExciterOff) {
  const Case& given = GetParam();
  Arrangement s;
  s.parameters.strategy = given.strategy;
  if (given.arrange) given.arrange(s);
  SimulatedPlant simulated(s.scenario, s.nominal, s.sensors);
  FaultyPlant plant(simulated);
  if (given.spoil) given.spoil(plant);
  std::string trace;
  const AlignResult result =
      align(plant, s.nominal, s.parameters,
            [&trace](const AlignProgress& now) { trace += now.state + ": " + now.message + "\n"; });
  EXPECT_FALSE(result.success);
  EXPECT_STREQ(toString(result.failure), toString(given.failure)) << result.reason << "\n" << trace;
  EXPECT_EQ(result.reason.rfind(toString(result.failure) + std::string(": "), 0), 0u);
  EXPECT_EQ(plant.amplitude, 0.0);
  EXPECT_LT(plant.greatest, s.parameters.force_limit);
  // and the peg free, unless it can't be moved
  if (given.failure != AlignFailure::kNotArrived) {
    EXPECT_LT(plant.force.norm(), 0.1);
  }
}

INSTANTIATE_TEST_SUITE_P(One, Failures, testing::ValuesIn(kCases), [](const auto& test) {
  return std::string(test.param.strategy) + "_" + toString(test.param.failure);
});

// A move takes as long as it takes while the carrier comes nearer.
TEST(SlowCarrier, IsWaitedFor) {
  Arrangement s;
  s.scenario = cell({"carrier.max_speed=0.007"});
  s.parameters.strategy = "twin_force";
  for (const double x : {0.008, 0.014}) {
    const Scenario from = startAt(s.scenario, Vector2d(x, 0), Vector2d(0.01, 0), 0.003);
    SimulatedPlant plant(from, from.mechanism, s.sensors);
    const AlignResult result = align(plant, from.mechanism, s.parameters, nullptr);
    EXPECT_TRUE(result.success) << x << ": " << result.reason;
  }
}

// One that is slower than a press, or can't end it, is refused instead of blaming the contact.
TEST(SlowCarrier, IsRefusedByName) {
  Arrangement s;
  for (const std::string key : {"max_speed", "max_acceleration"}) {
    Mechanism slow = s.nominal;
    (key == "max_speed" ? slow.carrier.max_speed : slow.carrier.max_acceleration) = 1e-3;
    try {
      checkGoal(slow, s.parameters);
      FAIL() << key;
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).rfind("carrier." + key + ": 0.001: ", 0), 0U)
          << error.what();
    }
  }
}

// A peg whose goals fail in the air isn't raised by them.
TEST(Hanging, StaysWhereAGoalThatFailsFindsIt) {
  Arrangement s;
  s.sensors.bits = 10;
  s.parameters.strategy = "single_contact";
  s.parameters.exciter_amplitude = 0.05;
  s.parameters.press_force = 5.0;
  SimulatedPlant plant(s.scenario, s.nominal, s.sensors);
  const double before = plant.truth().carrier().z;
  for (int i = 0; i < 3; ++i) {
    const AlignResult result = align(plant, s.nominal, s.parameters, nullptr);
    EXPECT_EQ(result.failure, AlignFailure::kTooUncertain) << result.reason;
    EXPECT_NEAR(plant.truth().carrier().z, before, 1e-4);
  }
}

// A peg that a move left pressed, anywhere, tilted, on rim or face: the force is no zero and
// friction no wall. With the sensor's zero as designed and with another.
TEST(Pressed, IsFreedFirstAndAligned) {
  std::mt19937_64 engine(18);
  const auto uniform = [&engine](double low, double high) {
    return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
  };
  const char* const strategies[] = {"twin_force", "double_contact", "single_contact", "vibratory"};
  for (int i = 0; i < 16; ++i) {
    const double azimuth = uniform(-M_PI, M_PI), offset = uniform(0.0, 0.015);
    Arrangement s;
    s.sensors.seed = 100 + static_cast<std::uint64_t>(i);
    const double tilt_y = uniform(-0.03, 0.03), tilt_x = uniform(-0.03, 0.03);
    s.scenario = startAt(s.scenario, offset * Vector2d(std::cos(azimuth), std::sin(azimuth)),
                         Vector2d(tilt_x, tilt_y), 0.003);
    s.parameters.strategy = strategies[i % 4];
    SimulatedPlant simulated(s.scenario, s.nominal, s.sensors);
    FaultyPlant plant(simulated);
    if (i % 8 > 3) {
      plant.on_block = [](PlantBlock& b) { b.wrench_b.head<3>() += Vector3d(1.0, -2.0, 4.0); };
    }
    PressLimits limits;
    limits.force = 60.0;
    const double force = uniform(5.0, 40.0);
    GuardedCarrier carrier(plant, limits);
    carrier.tare();
    PressController before(carrier);
    before.approach(-1.0);
    try {
      before.hold(force, 0.05);
    } catch (const AlignError&) {
      // wherever that has left it
    }
    const AlignResult result = align(plant, s.nominal, s.parameters);
    const Pose end = plant.pegPose();
    EXPECT_TRUE(result.success) << i << " " << s.parameters.strategy << " pressed with " << force
                                << " N: " << result.reason;
    EXPECT_EQ(result.success, edgeReach(end, s.nominal.peg.radius) <= s.nominal.hole.radius)
        << i << " " << s.parameters.strategy << " pressed with " << force << " N, "
        << end.p.transpose();
  }
}

// Failures of the plant itself pass through every strategy.
TEST(PlantFailures, PassThrough) {
  for (const AlignFailure failure :
       {AlignFailure::kCancelled, AlignFailure::kNoData, AlignFailure::kStopped}) {
    for (const char* strategy :
         {"single_contact", "double_contact", "vibratory", "twin_force", "touch", "auto"}) {
      SimulatedPlant simulated(cell(), cell().mechanism, CellParameters{});
      FaultyPlant plant(simulated);
      plant.on_block = [&](PlantBlock&) {
        if (pressed(plant)) throw PlantError(failure, "gone");
      };
      AlignParameters parameters;
      parameters.strategy = strategy;
      try {
        align(plant, cell().mechanism, parameters);
        ADD_FAILURE() << strategy;
      } catch (const PlantError& error) {
        EXPECT_EQ(error.failure, failure);
      }
    }
  }
}

// The failure reports the number of contacts before it, over all strategies that were tried.
TEST(PlantFailures, CountTheReadings) {
  for (const char* strategy : {"single_contact", "vibratory", "twin_force", "touch"}) {
    SimulatedPlant simulated(cell(), cell().mechanism, CellParameters{});
    FaultyPlant plant(simulated);
    AlignParameters parameters;
    parameters.strategy = strategy;
    const bool two = parameters.strategy == "vibratory";
    if (two) forgetModes(plant, LocusMode::kSegment);
    const auto spoil = plant.on_block;
    int before = 0, reported = 0;
    bool first = two;
    plant.on_block = [&](PlantBlock& block) {
      if (spoil) spoil(block);
      if (!first && reported >= 2) throw PlantError(AlignFailure::kCancelled, "gone");
    };
    try {
      align(plant, cell().mechanism, parameters, [&](const AlignProgress& now) {
        reported = now.contacts;
        if (now.state != "single_contact") return;
        first = false;
        before = std::exchange(reported, 0);
      });
      ADD_FAILURE() << strategy;
    } catch (const PlantError& error) {
      EXPECT_EQ(before > 0, two) << strategy;
      EXPECT_EQ(error.contacts, before + reported) << strategy;
    }
  }
}

// Reported as aligned, and half a clearance too far; or in the bore that leans there.
TEST(PlantFailures, TheEvaluatorNamesAnEdgeOutside) {
  Scenario truth = cell();
  AlignTrial trial;
  trial.result.success = true;
  trial.X_HP.p = Eigen::Vector3d(1.5e-4, 0.0, -5e-4);
  AlignTrial leaning = trial;
  evaluateEnd(truth, {}, trial);
  truth.imperfections.bore_lean = {-0.3, 0.0};
  evaluateEnd(truth, {}, leaning);
  EXPECT_TRUE(leaning.success);
  EXPECT_FALSE(leaning.false_success);
  EXPECT_TRUE(trial.false_success);
  EXPECT_FALSE(trial.success);
  EXPECT_EQ(trial.result.failure, AlignFailure::kEdgeOutside) << trial.result.reason;
  EXPECT_EQ(trial.status, "edge_outside");
}

// Reported as seated, and half a millimetre short of it; or 0.1 mm, within the error of the plane.
TEST(PlantFailures, TheEvaluatorNamesAPegThatIsNotSeated) {
  AlignTrial there;
  there.result.success = true;
  there.X_HP.p = Eigen::Vector3d(0.0, 0.0, -0.0399);
  AlignTrial above = there;
  above.X_HP.p.z() = -0.0395;
  AlignTrial leans = there;  // on the lowest point of its edge, 0.15 mm below its middle
  leans.X_HP.R = rotationFromVector({Eigen::Vector3d(0.006, 0.0, 0.0)});
  leans.X_HP.p = Eigen::Vector3d(0.0, 0.0, -0.0397);
  InsertParameters insert;
  insert.depth = 0.04;
  evaluateEnd(cell(), insert, there);
  evaluateEnd(cell(), insert, above);
  evaluateEnd(cell(), insert, leans);
  EXPECT_TRUE(there.success);
  EXPECT_TRUE(leans.success);
  EXPECT_TRUE(above.false_success);
  EXPECT_FALSE(above.success);
  EXPECT_EQ(above.status, "not_seated");
}

// a strategy that follows a failed one is named in the progress
TEST(FailureTraits, NoStrategyFollowsInAutoWhenTheTimeIsUp) {
  Arrangement s;
  s.parameters.strategy = "auto";
  s.parameters.time_limit = 5.0;
  SimulatedPlant plant(s.scenario, s.nominal, s.sensors);
  std::set<std::string> states;
  const AlignResult result = align(plant, s.nominal, s.parameters,
                                   [&](const AlignProgress& now) { states.insert(now.state); });
  EXPECT_EQ(result.failure, AlignFailure::kTimeLimit) << result.reason;
  EXPECT_EQ(states.count("twin_force") + states.count("vibratory"), 0U);
}

// names of the table in docs/reference/strategies.md are those of the enumeration, and every one
// but the plant's and the evaluator's has a case above
TEST(FailureTable, ListsEveryNameAndNoOther) {
  using Names = std::multiset<std::string>;
  std::ifstream page(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/docs/reference/strategies.md");
  Names listed, named;
  bool within = false;
  for (std::string line; std::getline(page, line);) {
    if (line.rfind("## ", 0) == 0) within = line == "## Failures";
    if (within && line.rfind("| `", 0) == 0) listed.insert(line.substr(3, line.find('`', 3) - 3));
  }
  for (int i = 1; i < static_cast<int>(AlignFailure::kCount); ++i) {
    named.insert(toString(static_cast<AlignFailure>(i)));
  }
  std::set<std::string> reached = {
      "cancelled",  "no_data",         "stopped",  "edge_outside",
      "not_seated", "wrong_mechanism", "too_tight"};  // test_clearance.cpp
  for (const Case& c : kCases) reached.insert(toString(c.failure));
  const auto without = [](const auto& all, const auto& others) {
    Names rest;
    std::set_difference(all.begin(), all.end(), others.begin(), others.end(),
                        std::inserter(rest, rest.end()));
    return rest;
  };
  EXPECT_EQ(without(listed, named), Names()) << "rows of strategies.md that are no failure";
  EXPECT_EQ(without(named, listed), Names()) << "failures without a row in strategies.md";
  EXPECT_EQ(without(named, reached), Names()) << "failures without a case in kCases";
  EXPECT_EQ(without(reached, named), Names()) << "names of tests elsewhere that are no failure";
}
