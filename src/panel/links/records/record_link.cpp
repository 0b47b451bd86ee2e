// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "record_link.h"

#include "assembly_cell/AssemblePegActionFeedback.h"
#include "assembly_cell/AssemblyRecord.h"
#include "assembly_cell/AssemblyVerdict.h"
#include "assembly_cell/RecorderState.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell::panel {

namespace {

constexpr std::size_t kMaxParts = 20;
constexpr std::size_t kMaxVerdict = 300;  // characters of a text
constexpr std::size_t kMaxPoints = 5000;  // of a growing curve

}  // namespace

RecordLink::RecordLink(const ros::NodeHandle& nh) : topics_{nh, mutex_} {
  subs_.push_back(topics_.subscribeChecked<SupervisorState>(
      "assembly_supervisor/state", [this](const SupervisorState& state) {
        if (state.goal == "assemble" && goal_ != state.goal) {
          record_.curve.clear();
          record_.state = RecordState::kGrowing;
        }
        goal_ = state.goal;
      }));
  subs_.push_back(topics_.subscribeChecked<AssemblePegActionFeedback>(
      "assemble/feedback", [this](const AssemblePegActionFeedback& message) {
        if (!(message.feedback.depth > 0.0) || record_.curve.size() >= kMaxPoints) return;
        record_.curve.push_back({message.feedback.depth, message.feedback.axial});
      }));
  subs_.push_back(
      topics_.subscribeChecked<AssemblyRecord>("run_record", [this](const AssemblyRecord& run) {
        record_.curve.clear();
        for (std::size_t i = 0; i < run.curve_depth.size(); ++i) {
          record_.curve.push_back({run.curve_depth[i], run.curve_axial[i]});
        }
        record_.state = RecordState::kNoRules;
      }));
  subs_.push_back(topics_.subscribeChecked<AssemblyVerdict>(
      "run_verdict", [this](const AssemblyVerdict& verdict) {
        PartView part;
        part.id = verdict.id;
        part.serial = printable(verdict.serial);
        part.verdict = printable(
            verdict.stored ? verdict.message : "not recorded: " + verdict.message, kMaxVerdict);
        part.state = !verdict.stored            ? RecordState::kNotStored
                     : verdict.verdicts.empty() ? RecordState::kNoRules
                     : verdict.passed           ? RecordState::kGood
                                                : RecordState::kBad;
        record_.state = part.state;
        record_.parts.insert(record_.parts.begin(), part);
        if (record_.parts.size() > kMaxParts) record_.parts.pop_back();
      }));
  state_sub_ =
      topics_.subscribeChecked<RecorderState>("recorder_state", [this](const RecorderState& state) {
        record_.writable = state.writable;
        record_.reason = printable(state.reason, kMaxVerdict);
        record_.serial = printable(state.serial);
        record_.program = printable(state.program);
        record_.band.clear();
        for (std::size_t i = 0; i < state.band_depth.size(); ++i) {
          record_.band.push_back({state.band_depth[i], state.band_low[i], state.band_high[i]});
        }
      });
}

void RecordLink::show(CellView& view) const {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    view.record = record_;
  }
  view.record.there = state_sub_.getNumPublishers() > 0;
}

}  // namespace assembly_cell::panel
