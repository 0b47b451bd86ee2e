// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/goal_runner.h"

#include <optional>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/base/input_error.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kReleaseTimeout = 5.0;  // cell time [s]

}  // namespace

void freePeg(RosPlant& plant, const PegRelease& release, bool was_free) {
  plant.recover(kReleaseTimeout);
  GuardedCarrier carrier(plant, release.limits);
  releasePeg(carrier, release.mechanism,
             was_free ? std::optional(restFromPose(plant.state().start)) : std::nullopt);
}

bool GoalRunner::hasBegun(AlignFailure failure) const {
  return plant_.state().has_moved || failure != AlignFailure::kCancelled;
}

GoalEnd GoalRunner::run(const std::string& name, bool needs_free_peg, const PegRelease& release,
                        const std::function<void(GoalEnd&)>& goal) {
  GoalEnd end;
  bool was_free = false;
  const ros::Time before = plant_.state().stamp;
  try {
    state_.update([&](SupervisorState& state) {
      if (needs_free_peg && state.stuck) {
        throw InputError("in_contact: the peg got stuck (" + state.reason +
                         "): call the action retreat first");
      }
      state.goal = name;
      was_free = !state.in_contact;
      return true;
    });
    goal(end);
  } catch (...) {
    setException(end);
  }
  const RosPlant::State plant = plant_.state();
  if (plant.stamp != before) end.time = plant.time;
  leave(end, release, was_free);
  return end;
}

void GoalRunner::setException(GoalEnd& end) const {
  end.failed = true;
  end.pressing = false;
  // bad input is mostly found before anything moves
  end.begun = plant_.state().has_moved;
  try {
    throw;
  } catch (const InputError& error) {
    end.reason = error.what();
  } catch (const PlantError& error) {
    end.begun = hasBegun(error.failure);
    end.failure = error.failure;
    end.contacts = error.contacts;
    end.reason = error.what();
  } catch (const AlignError& error) {
    end.begun = true;
    end.failure = error.failure;
    end.stuck = error.failure == AlignFailure::kInContact || error.failure == AlignFailure::kStuck;
    end.reason = error.what();
  } catch (const std::exception& error) {
    end.begun = true;
    end.reason = error.what();
  }
}

void GoalRunner::leave(const GoalEnd& end, const PegRelease& release, bool was_free) {
  bool in_contact = end.failed || end.pressing, stuck = end.stuck;
  bool is_shown = true;  // freed by its load alone it may still be between walls
  std::string reason = end.reason;
  if (end.begun && !end.freed && !plant_.state().has_data) {
    reason = "not known, no data to detect contact by: " + reason;
  } else if (end.begun && !end.freed) {
    try {
      freePeg(plant_, release, was_free && !end.stuck);
      in_contact = stuck = false;
      is_shown = end.shown;
    } catch (const AlignError& error) {
      // with a saturated sensor nothing is known: the next goal checks for contact
      stuck = error.failure != AlignFailure::kSensorSaturated;
      reason = error.what();
    } catch (const std::exception& error) {
      reason = error.what();
    }
  }
  plant_.end(end.begun && in_contact);
  state_.update([&](SupervisorState& state) {
    state.goal.clear();
    // a failed goal that moved nothing leaves the rest as it was
    if (end.failed && !end.begun) return true;
    const bool stays_unknown = !is_shown && !isKnown(state);
    state.in_contact = in_contact || stays_unknown;
    state.stuck = stuck;
    state.reason = stays_unknown ? notKnown(reason) : reason;
    return true;
  });
}

}  // namespace assembly_cell::ros_bridge
