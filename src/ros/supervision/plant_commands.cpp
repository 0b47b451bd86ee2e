// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/plant_commands.h"

#include <cmath>

#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/publish_shared.h"

namespace assembly_cell::ros_bridge {
namespace {

// in lockstep a cell in one process sends 2000 commands a second: half a second of them
constexpr std::uint32_t kCommandQueue = 1000;

}  // namespace

// Latched: a node that connects later has the state of carrier and exciter.
PlantCommands::PlantCommands(ros::NodeHandle& nh)
    : carrier_pub_(
          nh.advertise<geometry_msgs::PoseStamped>("carrier_command", kCommandQueue, true)),
      exciter_pub_(nh.advertise<Exciter>("exciter", kCommandQueue, true)) {}

void PlantCommands::moveCarrier(const Pose& X_BC, const ros::Time& stamp) {
  commanded_ = X_BC;
  moved_ = true;
  ++count_;
  geometry_msgs::PoseStamped command = poseStamped(kCarrierBaseFrame, X_BC, stamp);
  command.header.seq = count_;
  publishShared(carrier_pub_, command);
}

void PlantCommands::drive(const ExciterParameters& drive, const ros::Time& stamp) {
  exciter_ = Exciter();
  exciter_.header.stamp = stamp;
  exciter_.header.frame_id = kPegFrame;
  exciter_.on = drive.amplitude > 0.0;
  exciter_.amplitude = drive.amplitude;
  exciter_.frequency = drive.frequency;
  exciter_.phase = drive.phase;
  exciter_.direction = static_cast<std::int8_t>(drive.direction);
  moved_ = true;
  ++count_;
  const ExciterParameters published = compensated(drive, errors_);
  Exciter command = exciter_;
  command.header.seq = count_;
  command.amplitude = published.amplitude;
  command.phase = published.phase;
  publishShared(exciter_pub_, command);
}

void PlantCommands::stopExciter(const ros::Time& stamp) {
  if (exciter_.on) drive(ExciterParameters{}, stamp);
}

void PlantCommands::repeat(const ros::Time& stamp) {
  if (exciter_.on) {
    const double passed = (stamp - exciter_.header.stamp).toSec();
    ExciterParameters again;
    again.amplitude = exciter_.amplitude;
    again.frequency = exciter_.frequency;
    again.phase = std::remainder(exciter_.phase + exciter_.frequency * passed, 2 * M_PI);
    again.direction = exciter_.direction;
    drive(again, stamp);
  }
  if (commanded_) moveCarrier(Pose(*commanded_), stamp);
}

}  // namespace assembly_cell::ros_bridge
