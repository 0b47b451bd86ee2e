// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/markers/rim_view.h"

#include <geometry_msgs/TransformStamped.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>

#include <cstdint>

#include "assembly_cell/ros/bridge/conversions.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr char kRimCameraFrame[] = "rim_camera";
constexpr std::uint32_t kPixels = 240;  // of each side
constexpr std::uint8_t kGround = 245;   // grey, as rviz/cell.rviz has it
// above the plane, in radii of the hole: so far that an edge deep in the bore looks no smaller than
// the rim. A radius of 1 m is within the 100 m that rviz's display Camera shows.
constexpr double kHeight = 90.0;
constexpr double kSeen = 1.5;    // from the middle to each side, in radii of the hole
constexpr double kPeriod = 0.5;  // wall clock [s]

geometry_msgs::TransformStamped frameAbove(const std::string& hole, double height) {
  geometry_msgs::TransformStamped frame;
  frame.header.frame_id = hole;
  frame.child_frame_id = kRimCameraFrame;
  frame.transform.translation.z = height;
  frame.transform.rotation.x = 1.0;  // half a turn about x: z looks down
  return frame;
}

sensor_msgs::CameraInfo intrinsics(const std_msgs::Header& header) {
  sensor_msgs::CameraInfo info;
  info.header = header;
  info.width = info.height = kPixels;
  info.distortion_model = "plumb_bob";
  info.D.assign(5, 0.0);
  const double focal = 0.5 * kPixels * kHeight / kSeen, middle = 0.5 * kPixels;
  info.K = {focal, 0.0, middle, 0.0, focal, middle, 0.0, 0.0, 1.0};
  info.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  info.P = {focal, 0.0, middle, 0.0, 0.0, focal, middle, 0.0, 0.0, 0.0, 1.0, 0.0};
  return info;
}

}  // namespace

RimView::RimView(ros::NodeHandle& nh)
    : image_pub_(nh.advertise<sensor_msgs::Image>("rim_view/image", 1)),
      info_pub_(nh.advertise<sensor_msgs::CameraInfo>("rim_view/camera_info", 1)) {}

RimView::~RimView() = default;

void RimView::update(const std::string& hole_frame, double hole_radius) {
  const ros::WallTime now = ros::WallTime::now();
  if (hole_radius <= 0.0 || image_pub_.getNumSubscribers() == 0 ||
      (now - sent_).toSec() < kPeriod) {
    return;
  }
  sent_ = now;
  if (!frame_) frame_.emplace();
  if (parent_ != hole_frame) {
    parent_ = hole_frame;
    frame_->send({frameAbove(hole_frame, kHeight * hole_radius)});
  }
  sensor_msgs::Image image;  // no stamp: with the latest transforms
  image.header.frame_id = kRimCameraFrame;
  image.width = image.height = image.step = kPixels;
  image.encoding = sensor_msgs::image_encodings::MONO8;
  image.data.assign(kPixels * kPixels, kGround);
  image_pub_.publish(image);
  info_pub_.publish(intrinsics(image.header));
}

}  // namespace assembly_cell::ros_bridge
