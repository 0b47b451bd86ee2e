// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/sensor_display.h"

#include "assembly_cell/DisplacementWithCovariance.h"
#include "assembly_cell/WrenchWithCovariance.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/sensor/wrench_range.h"

namespace assembly_cell::ros_bridge {

SensorDisplay::SensorDisplay(ros::NodeHandle& nh, std::uint32_t queue,
                             const DriverSettings& settings)
    : settings_(settings) {
  wrench_raw_pub_ = nh.advertise<geometry_msgs::WrenchStamped>("wrench_raw", queue);
  wrench_pub_ = nh.advertise<geometry_msgs::WrenchStamped>("wrench", queue);
  wrench_covariance_pub_ = nh.advertise<WrenchWithCovariance>("wrench_with_covariance", queue);
  if (settings.publish_displacement) {
    displacement_pub_ = nh.advertise<DisplacementWithCovariance>("displacement", queue);
  }
}

bool SensorDisplay::hasSubscribers() const {
  return wrench_pub_.getNumSubscribers() > 0 || wrench_raw_pub_.getNumSubscribers() > 0;
}

void SensorDisplay::publish(const SensorPipeline::Average& average, const ros::Time& end,
                            const SensorPipeline& pipeline) {
  geometry_msgs::WrenchStamped message;
  message.header.stamp = end;
  message.header.frame_id = settings_.frame_id;
  message.wrench = toWrench(cutWrench(average.wrench));
  wrench_raw_pub_.publish(message);
  message.wrench = toWrench(cutWrench(average.wrench - pipeline.bias()));
  wrench_pub_.publish(message);
  publishCovariances(message, average.volts, pipeline.calibration());
}

void SensorDisplay::publishCovariances(const geometry_msgs::WrenchStamped& wrench,
                                       const Vector6& volts, const Calibration& calibration) {
  // of one sample: an average doesn't reduce the converter's rounding
  const Matrix6 strain = calibration.noise.cwiseAbs2().asDiagonal();
  // a covariance that overflows is not published
  if (wrench_covariance_pub_.getNumSubscribers() > 0) {
    const Matrix6 covariance = wrenchCovariance(calibration, volts, strain);
    WrenchWithCovariance message;
    message.header = wrench.header;
    message.wrench = wrench.wrench;
    Matrix6::Map(message.covariance.data()) = covariance;
    if (covariance.allFinite()) wrench_covariance_pub_.publish(message);
  }
  if (settings_.publish_displacement && displacement_pub_.getNumSubscribers() > 0) {
    const Vector6 displacement = cutDisplacement(displacementFromVolts(calibration, volts));
    const Matrix6 covariance = displacementCovariance(calibration, volts, strain);
    DisplacementWithCovariance message;
    message.header = wrench.header;
    Vector6::Map(message.displacement.data()) = displacement;
    Matrix6::Map(message.covariance.data()) = covariance;
    if (displacement.allFinite() && covariance.allFinite()) displacement_pub_.publish(message);
  }
}

}  // namespace assembly_cell::ros_bridge
