// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/records/recorder_node.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/serialization.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <utility>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/records/band.h"
#include "assembly_cell/ros/bridge/diagnostics.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/node_watch.h"
#include "assembly_cell/ros/records/record_messages.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kPeriod = 1.0;  // of state and diagnostics, wall clock [s]

std::string hostName() {
  std::array<char, 256> name{};
  gethostname(name.data(), name.size() - 1);
  return name.data();
}

std::string digestOf(SensorCalibration calibration) {
  calibration.header = std_msgs::Header();
  const ros::SerializedMessage bytes = ros::serialization::serializeMessage(calibration);
  return crcText(std::string(bytes.buf.get(), bytes.buf.get() + bytes.num_bytes));
}

// The file and a digest of its content. Throws InputError.
std::string fileWithDigest(const std::string& path) {
  std::ostringstream content;
  const std::ifstream file(path, std::ios::binary);
  if (file) content << file.rdbuf();
  if (!file || !content) {
    throw InputError("~simulation_mismatch '" + printable(path, 500) +
                     "' can't be read: give the file of the simulator");
  }
  return path + " " + crcText(content.str());
}

// Verdicts of all rules in one line.
std::string summary(const Run& run) {
  std::size_t failed = 0;
  const RunVerdict* first = nullptr;
  for (const RunVerdict& verdict : run.verdicts) {
    if (verdict.passed) continue;
    if (first == nullptr) first = &verdict;
    ++failed;
  }
  const std::size_t count = run.verdicts.size();
  if (count == 0) return "no rules for program " + run.program;
  if (first == nullptr) return text("good by %zu rule%s", count, count == 1 ? "" : "s");
  return text("NOT good by %zu of %zu rules: ", failed, count) + first->text;
}

RuleVerdict toMessage(const RunVerdict& verdict) {
  RuleVerdict message;
  message.rule = verdict.rule;
  message.kind = verdict.kind;
  message.passed = verdict.passed;
  message.margin = std::isfinite(verdict.margin) ? verdict.margin : 0.0;
  message.depth = std::isfinite(verdict.depth) ? verdict.depth : -1.0;
  message.quantity = verdict.quantity;
  message.text = verdict.text;
  return message;
}

}  // namespace

void fields(FieldList& f, RecorderSettings::Simulation& s) {
  f.text("seed", s.seed, "Seed of a simulated cell, for the record; empty: a real cell.");
  f.text("world", s.world, "What simulates it.");
  f.text("mismatch", s.mismatch, "File of its model errors.");
}

void fields(FieldList& f, RecorderSettings& s) {
  f.text("store", s.store, "File of the records.")
      .derived("~/.ros/assembly_cell/records.db, or below ROS_HOME");
  f.text("station", s.station, "Name of this cell in the records.").derived("name of the host");
  f.section("simulation", s.simulation);
}

RecorderNode::RecorderNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : name_(pnh.getNamespace().substr(1)) {
  Parameters parameters(pnh);
  parameters.read(fieldsOf(settings_));
  rules_ = RunRules(parameters.texts("rules", std::vector<std::string>{}));
  parameters.refuseUnknown();
  if (settings_.store.empty()) settings_.store = defaultRunStore();
  if (settings_.station.empty()) settings_.station = hostName();
  const auto [seed, world, mismatch] = settings_.simulation;
  if (!seed.empty()) simulation_["seed"] = seed;
  if (!world.empty()) simulation_["world"] = world;
  if (!mismatch.empty()) simulation_["mismatch"] = fileWithDigest(mismatch);

  const std::string who = "records of this cell are stored by ";
  refuseSecondPublisher(nh, "recorder_state", who);
  state_.store = settings_.store;
  state_pub_ = LatestPublisher<RecorderState>(nh, "recorder_state", 10);
  refuseSecondPublisher(nh, "recorder_state", who);
  verdict_pub_ = nh.advertise<AssemblyVerdict>("run_verdict", 10);
  diagnostics_pub_ = nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  part_server_ = pnh.advertiseService("set_part", &RecorderNode::setPart, this);
  for (const char* sensor : {"sensor_a", "sensor_b"}) {
    subs_.push_back(subscribeChecked<SensorCalibration>(
        nh, std::string(sensor) + "/calibration", 10,
        [this, sensor](const SensorCalibration::ConstPtr& calibration) {
          calibrations_[sensor] = calibration->id + " " + digestOf(*calibration);
        }));
  }
  checkStore();
  subs_.push_back(subscribeChecked<AssemblyRecord>(
      nh, "run_record", 100, [this](const AssemblyRecord::ConstPtr& record) { onRecord(*record); },
      ros::TransportHints().tcpNoDelay()));
  timer_ = nh.createWallTimer(ros::WallDuration(kPeriod),
                              [this](const ros::WallTimerEvent&) { checkStore(); });
}

RunStore& RecorderNode::open() {
  if (!store_) store_.emplace(settings_.store, RunStore::Access::kWrite);
  return *store_;
}

void RecorderNode::setComplaint(const std::string& why) {
  if (!why.empty()) store_.reset();
  if (!why.empty() && why != state_.reason) ROS_ERROR("no run can be stored: %s", why.c_str());
  if (why.empty() && !state_.reason.empty()) ROS_INFO("runs can be stored again");
  state_.reason = why;
  state_.writable = why.empty();
}

void RecorderNode::checkStore() {
  try {
    open().checkWritable();
    setComplaint("");
  } catch (const std::exception& error) {
    setComplaint(error.what());
  }
  publishState();
}

void RecorderNode::complete(Run& run, const std::string& scenario) const {
  if (run.serial.empty()) run.serial = state_.serial;
  if (run.program.empty()) run.program = program_.empty() ? scenario : program_;
  run.station = settings_.station;
  run.calibrations.insert(calibrations_.begin(), calibrations_.end());
  run.simulation = simulation_;
}

AssemblyVerdict RecorderNode::store(Run& run) {
  AssemblyVerdict message;
  try {
    run.verdicts = rules_.evaluate(run);
    open().append(run);
    setComplaint("");
    message.stored = true;
    message.id = run.id;
    message.message = summary(run);
  } catch (const std::exception& error) {
    setComplaint(error.what());
    message.message = error.what();
  }
  message.serial = run.serial;
  message.program = run.program;
  message.passed = true;
  for (const RunVerdict& verdict : run.verdicts) {
    message.verdicts.push_back(toMessage(verdict));
    message.passed = message.passed && verdict.passed;
  }
  return message;
}

void RecorderNode::onRecord(const AssemblyRecord& record) {
  Run run = fromMessage(record);
  complete(run, record.scenario);
  AssemblyVerdict verdict = store(run);
  verdict.header = record.header;
  verdict.goal_id = record.goal_id;
  publishShared(verdict_pub_, verdict);
  if (verdict.stored) {
    // the serial number was that of this part
    if (record.serial.empty()) state_.serial.clear();
    state_.last_id = run.id;
    state_.program = program_.empty() ? run.program : program_;
  }
  publishState();
}

bool RecorderNode::setPart(SetPart::Request& request, SetPart::Response& response) {
  const MessageCheck check =
      MessageCheck().name("serial", request.serial).name("program", request.program);
  response.success = check.good();
  response.message = check.text();
  if (!check.good()) return true;
  state_.serial = request.serial;
  state_.program = program_ = request.program;
  response.message =
      "serial: " + (request.serial.empty() ? "a running number" : request.serial) +
      ", program: " + (request.program.empty() ? "the scenario's name" : request.program);
  publishState();
  return true;
}

void RecorderNode::setBand() {
  state_.band_depth.clear();
  state_.band_low.clear();
  state_.band_high.clear();
  const Band* band = rules_.band(state_.program);
  if (band == nullptr || band->over_time) return;
  for (const BandChannel& channel : band->channels) {
    if (channel.quantity != "axial") continue;
    for (std::size_t cell = 0; cell < band->cells(); ++cell) {
      state_.band_depth.push_back(band->from + band->step * (static_cast<double>(cell) + 0.5));
      state_.band_low.push_back(band->lowest(channel, cell));
      state_.band_high.push_back(band->highest(channel, cell));
    }
  }
}

void RecorderNode::publishState() {
  const ros::WallTime now = ros::WallTime::now();
  state_.header.stamp = ros::Time(now.sec, now.nsec);
  setBand();
  state_pub_.publish(state_);
  using Status = diagnostic_msgs::DiagnosticStatus;
  Status status;
  status.name = name_ + ": store";
  status.hardware_id = "cell";
  status.level = state_.writable ? Status::OK : Status::ERROR;
  status.message = state_.writable ? "writable" : state_.reason;
  publishStatus(diagnostics_pub_, status,
                {{"Store", state_.store}, {"Last record", std::to_string(state_.last_id)}});
}

}  // namespace assembly_cell::ros_bridge
