// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/parameters.h"

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr double kLongestGoal = 1e5;  // [s]
constexpr double kMinForce = 2.0;     // of a contact that is held [N]
constexpr double kSameDepth = 1e-3;   // of two measurements of one depth [m]

void check(bool good, const char* name, double value, const std::string& remedy) {
  if (!good) throw InputError(std::string(name) + text(": value %g: ", value) + remedy);
}

}  // namespace

void fields(FieldList& f, InsertParameters& p) {
  f.number("force", p.force, {kMinForce, 1000, "N"},
           "assemble: contact force at which the peg stops, below force_limit.")
      .live();
  f.number("speed", p.speed, positive("m/s", 0.1),
           "assemble: speed of the descent without resistance.");
  f.number("exciter", p.exciter, notNegative("N", 1000),
           "assemble: exciting force during the descent; 0: off.");
  f.number(
      "time_limit", p.time_limit, notNegative("s", kLongestGoal),
      "assemble: longest insertion after the alignment, cell time; 0: 30 s, more for a late arm "
      "or a deep hole.");
}

void alignFields(FieldList& f, AlignParameters& p) {
  f.choice("strategy", p.strategy, strategyNames(), "Strategy of a goal that names none.");
  f.number("press_force", p.press_force, notNegative("N", 1000),
           "Contact force while a locus is measured, 2 N to force_limit; 0: as little as makes the "
           "direction exact, up to 3/4 of force_limit.")
      .live();
  f.number("press_tolerance", p.press_tolerance, positive("", 0.5),
           "Tolerance of press_force, a fraction of it.");
  f.number("force_limit", p.force_limit, {kMinForce, 1000, "N"},
           "Contact force above which a goal is aborted.")
      .live(Field::Change::kLower);
  f.number("time_limit", p.time_limit, notNegative("s", kLongestGoal),
           "Longest alignment, cell time; 0: 60 s, more for shaken strategies, baselines, a small "
           "or large peg, one that swings for long or a late arm.");
  f.number("descent_limit", p.descent_limit, positive("m", 1),
           "Descent without contact below the lowest start; scaled with the peg.");
  f.number("approach_step", p.approach_step, positive("m", 0.01),
           "Descent in one block before contact.");
  f.number(
      "arm_delay", p.arm_delay, {0.0, 1.0, "s"},
      "Time from a contact to the arm's reaction: descents are as slow as it and the mount need; "
      "0: arm.delay of the scenario, or no arm.");
  f.number("exciter_amplitude", p.exciter_amplitude, notNegative("N", 1000),
           "Amplitude of the exciting force; 0: as much as friction holds at the press force.");
  f.number("exciter_frequency", p.exciter_frequency, notNegative("rad/s", 1e5),
           "Frequency of the exciting force; 0: where the direction of contact has the smallest "
           "standard "
           "deviation.");
  f.integer("exciter_direction", p.exciter_direction, -1, 1,
            "Rotation of the exciting force; 1: anticlockwise from above, -1: clockwise.");
  f.number("shake", p.shake, {1, 5},
           "Exciting force while the contact settles, in multiples of its amplitude.");
  f.number("settle", p.settle, notNegative("s", 60),
           "Time to settle after that, before a measurement.");
  f.number("window", p.window, positive("s", 60), "Longest measurement of a locus.").live();
  f.number("sweep_tilt", p.sweep_tilt, positive("rad", 0.14), "Commanded tilt of the sweep.");
  f.integer("sweep_readings", p.sweep_readings, 8, 360,
            "Largest number of locus measurements of a round, with those of the plane.");
  f.number("direction_limit", p.direction_limit, positive("rad", 1),
           "Expected standard deviation of a measured direction beyond which nothing is tried.");
  f.number("lift", p.lift, positive("m", 0.01), "Height above the touch before a rotation.");
  f.number("insertion_depth", p.insertion_depth, positive("m", 0.01),
           "Depth of the edge below the plane that counts as aligned.");
  f.number("insertion_force", p.insertion_force, positive("N", 1000),
           "Contact force during the entry that means not aligned; below force_limit.");
  f.integer("rounds", p.rounds, 1, 10,
            "Largest number of sweeps of one attempt; twin_force: of attempts to enter.");
  f.number("contact_force", p.contact_force, {kMinForce, 1000, "N"},
           "twin_force: force of each contact, below force_limit.")
      .live();
  f.number("contact_tilt", p.contact_tilt, {0.02, 0.14, "rad"},
           "twin_force: tilt of the peg against the plane.");
  f.number("contact_window", p.contact_window, {0.02, 60, "s"},
           "twin_force: averaging time, hanging free and pressed.");
  f.number("settled_force", p.settled_force, positive("N", 10),
           "twin_force: largest difference between the halves of a settled window.");
  f.integer("fewest_contacts", p.fewest_contacts, 2, 30,
            "twin_force: smallest number of contacts before the peg is moved over the hole.");
  f.integer("most_contacts", p.most_contacts, 2, 30,
            "twin_force: largest number of contacts of one attempt, at least fewest_contacts.");
  f.number("required_position", p.required_position, positive("m", 0.01),
           "twin_force: sufficient standard deviation of the hole's position, per axis.");
  f.number("required_rotation", p.required_rotation, positive("rad", 0.1),
           "twin_force: sufficient standard deviation of the hole's axis.");
}

void fields(FieldList& f, AlignParameters& p) {
  alignFields(f, p);
  f.section("insert", p.insert);
}

void checkParameters(const AlignParameters& parameters) {
  AlignParameters p = parameters;
  checkFields(fieldsOf(p));
  const auto belowLimit = [&](const char* name, double force) {
    check(force < p.force_limit, name, force,
          text("give less than force_limit, %g N", p.force_limit));
  };
  check(p.press_force == 0.0 || p.press_force >= kMinForce, "press_force", p.press_force,
        text("give at least %g N, or 0 to choose it", kMinForce));
  belowLimit("press_force", p.press_force);
  check(p.exciter_direction != 0, "exciter_direction", 0.0, "give 1 or -1");
  belowLimit("insertion_force", p.insertion_force);
  belowLimit("contact_force", p.contact_force);
  check(p.most_contacts >= p.fewest_contacts, "most_contacts", p.most_contacts,
        text("give at least fewest_contacts, %d", p.fewest_contacts));
  belowLimit("insert.force", p.insert.force);
  const Range depth = notNegative("m", 1);
  check(depth.contains(p.insert.depth), "insert.depth", p.insert.depth, remedy(depth));
  check(depth.contains(p.inserted), "inserted", p.inserted, remedy(depth));
  check(!(p.insert.depth > 0) || p.insert.depth > p.inserted - kSameDepth, "insert.depth",
        p.insert.depth, text("the peg is %g m deep already; retreat first", p.inserted));
}

}  // namespace assembly_cell
