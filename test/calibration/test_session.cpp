// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/two_sensor/session.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "assembly_cell/calibration/common/store.h"
#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/calibration/two_sensor/rig.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;
using Failure = CalibrationFailure;

class Session : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    RigSettings settings;
    settings.nonlinearity = 0.0;
    CalibrationRig rig(settings);
    header_ = rig.description();
    for (const PlanName name : {PlanName::kRecommended, PlanName::kDisplacement}) {
      auto& part = name == PlanName::kRecommended ? force_ : displacement_;
      part = header_;
      for (const LoadRequest& step : makePlan(name, header_)) {
        part.observations.push_back(rig.measure(step));
      }
    }
  }

  static void solve(CalibrationSession& session) {
    session.solve(solveSettings(session.observations()));
  }
  static MaybePerSide<ActiveCalibration> both(const MaybePerSide<Calibration>& saved) {
    MaybePerSide<ActiveCalibration> out;
    for (const Side side : kSides) out[side] = ActiveCalibration{*saved[side], ""};
    return out;
  }
  template <typename Work>
  static Failure failureOf(const Work& work) {
    try {
      work();
    } catch (const CalibrationError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
      return error.code;
    }
    return Failure::kNone;
  }

  static ObservationSet header_, force_, displacement_;
  const test::TemporaryFolder folder_;
  const std::string store_ = folder_.path();
};
ObservationSet Session::header_, Session::force_, Session::displacement_;

// Every refusal has a code of its own, and leaves the store as it was.
TEST_F(Session, RefusesByCode) {
  CalibrationSession empty(store_, header_);
  EXPECT_EQ(failureOf([&] { solve(empty); }), Failure::kNothingToSolve);
  EXPECT_EQ(failureOf([&] { empty.save("x"); }), Failure::kNotSolved);
  EXPECT_EQ(failureOf([&] { empty.load("x", {true, true}); }), Failure::kUnknownId);

  CalibrationSession moved(store_, displacement_);
  solve(moved);
  EXPECT_EQ(failureOf([&] { moved.save("x"); }), Failure::kNoWrench);
  EXPECT_TRUE(moved.stored(Side::kA).empty());

  CalibrationSession few(store_, force_);
  while (few.observations().observations.size() > 5) few.removeLast();
  solve(few);
  EXPECT_EQ(failureOf([&] { few.save("x"); }), Failure::kNotAccepted);

  CalibrationSession whole(store_, force_);
  solve(whole);
  whole.save("x");
  EXPECT_EQ(failureOf([&] { whole.save("x"); }), Failure::kIdTaken);
  whole.add(force_.observations[0]);
  EXPECT_EQ(failureOf([&] { whole.save("y"); }), Failure::kNotSolved);
  EXPECT_THROW(whole.load("../x", {true, true}), InputError);

  fs::copy_file(store_ + "/sensor_a/x.yaml", store_ + "/sensor_a/renamed.yaml");
  fs::copy_file(store_ + "/sensor_b/x.yaml", store_ + "/sensor_a/foreign.yaml");
  EXPECT_EQ(failureOf([&] { whole.load("renamed", {true, false}); }), Failure::kRenamed);
  EXPECT_EQ(failureOf([&] { whole.load("foreign", {true, false}); }), Failure::kForeign);
}

// The displacement outlives a later calibration of the forces: in what is saved, and in what is
// loaded from a file without one, also in the next session of this store.
TEST_F(Session, NeverLosesTheDisplacement) {
  ObservationSet all = force_;
  all.observations.insert(all.observations.end(), displacement_.observations.begin(),
                          displacement_.observations.end());
  CalibrationSession first(store_, all);
  solve(first);
  const auto whole = first.save("whole");
  ASSERT_FALSE(whole.a->volts_to_displacement.isZero(0.0));
  const auto loaded = first.load("whole", {true, true});
  EXPECT_EQ(loaded.b->calibration.volts_to_displacement, whole.b->volts_to_displacement);
  EXPECT_EQ(loaded.b->calibration.volts_to_wrench, whole.b->volts_to_wrench);
  EXPECT_TRUE(loaded.b->displacement_of.empty());
  first.activate(loaded);

  CalibrationSession second(store_, force_);
  ASSERT_TRUE(second.active().a.has_value());
  solve(second);
  const auto later = second.save("later");
  EXPECT_EQ(later.a->volts_to_displacement, whole.a->volts_to_displacement);
  EXPECT_EQ(later.a->displacement_products, whole.a->displacement_products);
  EXPECT_EQ(loadCalibration(store_ + "/sensor_a/later.yaml").displacement_covariance,
            whole.a->displacement_covariance);

  // a file of forces alone, made in another store
  const std::string other = store_ + "/other";
  CalibrationSession elsewhere(other, force_);
  solve(elsewhere);
  const auto bare = elsewhere.save("bare");
  EXPECT_TRUE(bare.a->volts_to_displacement.isZero(0.0));
  for (const char* sensor : {"/sensor_a/", "/sensor_b/"}) {
    fs::copy_file(other + sensor + "bare.yaml", store_ + sensor + "bare.yaml");
  }
  const auto kept = second.load("bare", {true, true});
  EXPECT_EQ(kept.a->displacement_of, "whole");
  EXPECT_EQ(kept.a->calibration.volts_to_displacement, whole.a->volts_to_displacement);
  second.activate(kept);
  CalibrationSession third(store_, force_);
  EXPECT_TRUE(third.warnings().empty());
  ASSERT_TRUE(third.active().a.has_value());
  EXPECT_EQ(third.active().a->calibration.id, "bare");
  EXPECT_EQ(third.active().a->calibration.volts_to_displacement, whole.a->volts_to_displacement);
  solve(third);
  EXPECT_EQ(third.save("next").b->volts_to_displacement, whole.b->volts_to_displacement);

  // the fallback counts where no calibration is active
  CalibrationSession fresh(store_ + "/new", force_);
  solve(fresh);
  EXPECT_EQ(fresh.save("x", {*whole.a, *whole.b}).a->volts_to_displacement,
            whole.a->volts_to_displacement);
}

// A truncated in_force.yaml: a warning names each sensor whose active calibration is lost.
TEST_F(Session, AFileOfActiveCalibrationsThatWasCutIsNamed) {
  CalibrationSession session(store_, force_);
  solve(session);
  session.activate(both(session.save("whole")));
  const std::string path = store_ + "/in_force.yaml";
  std::stringstream whole;
  whole << std::ifstream(path).rdbuf();
  const std::string text = whole.str();
  for (std::size_t size = 0; size + 1 < text.size(); ++size) {
    std::ofstream(path) << text.substr(0, size);
    const CalibrationSession cut(store_, force_);
    std::size_t named = 0;
    for (const std::string& warning : cut.warnings()) {
      named += warning.find("in_force.yaml' is damaged") != std::string::npos ? 1 : 0;
    }
    const auto active = cut.active();
    EXPECT_EQ(named, (active.a ? 0U : 1U) + (active.b ? 0U : 1U)) << text.substr(0, size);
    if (active.b) {
      EXPECT_EQ(active.b->calibration.id, "whole");
    }
  }
  // a sensor that has none is no damage
  CalibrationSession other(store_ + "/other", force_);
  solve(other);
  MaybePerSide<ActiveCalibration> one = both(other.save("one"));
  one.b.reset();
  other.activate(one);
  const CalibrationSession next(store_ + "/other", force_);
  EXPECT_TRUE(next.warnings().empty());
  EXPECT_TRUE(next.active().a);
  EXPECT_FALSE(next.active().b);
}

// A journal's observations are there in the next session, to the last bit.
TEST_F(Session, GoesOnFromItsJournal) {
  {
    CalibrationSession session(store_, header_);
    EXPECT_FALSE(session.openJournal());
    for (std::size_t i = 0; i < 4; ++i) session.add(force_.observations[i]);
    EXPECT_EQ(session.removeLast().stamp, force_.observations[3].stamp);
  }
  CalibrationSession session(store_, header_);
  session.openJournal();
  ASSERT_EQ(session.observations().observations.size(), 3u);
  EXPECT_EQ(session.observations().observations[2].reading.a->volts,
            force_.observations[2].reading.a->volts);
  session.clear();
  EXPECT_TRUE(session.observations().observations.empty());
  EXPECT_EQ(readObservations(store_ + "/observations.yaml.previous").observations.size(), 3u);
  session.activate({});
}

}  // namespace
}  // namespace assembly_cell
