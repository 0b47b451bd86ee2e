// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "cell_link.h"

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include "assembly_cell/Step.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "calibration_link.h"
#include "goal_link.h"
#include "node_link.h"
#include "records/record_link.h"
#include "requests/async_requests.h"
#include "requests/service_request.h"
#include "sensor_link.h"

namespace assembly_cell::panel {

namespace {

ros::NodeHandle handle(ros::CallbackQueue& queue) {
  ros::NodeHandle nh;
  nh.setCallbackQueue(&queue);
  return nh;
}

}  // namespace

struct CellLink::Links {
  Links() { spinner.start(); }
  ~Links() { spinner.stop(); }

  template <class Service>
  void call(const std::string& label, const std::string& service,
            const typename Service::Request& request = {}) {
    callServiceAsync<Service>(requests, label, nh.resolveName(service), request);
  }

  ros::CallbackQueue queue;
  ros::NodeHandle nh{handle(queue)};
  SensorLink sensors{nh};
  GoalLink goals{nh};
  RecordLink records{nh};
  CalibrationLink calibration{nh, requests};
  NodeLink nodes{nh, requests};
  AsyncRequests requests;  // after the links: destroyed before them
  ros_bridge::GuardedSpinner spinner{1, &queue};
};

CellLink::CellLink() : links_(std::make_unique<Links>()) {}
CellLink::~CellLink() = default;

CellView CellLink::view() {
  CellView view;
  links_->sensors.show(view);
  links_->goals.show(view);
  links_->records.show(view);
  links_->nodes.show(view);
  view.calibration = links_->calibration.view();
  view.answers = links_->requests.answers();
  return view;
}

void CellLink::start(const GoalRequest& goal) { links_->goals.start(goal); }
void CellLink::cancel() { links_->goals.cancel(); }
void CellLink::retreat() { links_->goals.retreat(); }

void CellLink::zero(Sensor sensor) {
  const std::string name = kSensorNames[sensor];
  links_->call<std_srvs::Trigger>(name + " zero", name + "/driver/zero");
}

void CellLink::undoBias(Sensor sensor) {
  const std::string name = kSensorNames[sensor];
  links_->call<std_srvs::Trigger>(name + " undo", name + "/driver/undo_bias");
}

void CellLink::pause(bool paused) {
  std_srvs::SetBool::Request request;
  request.data = paused;
  links_->call<std_srvs::SetBool>(paused ? "pause" : "run", "peg_hole_simulator/pause", request);
}

void CellLink::step(std::uint32_t blocks) {
  Step::Request request;
  request.blocks = blocks;
  links_->call<Step>("step", "peg_hole_simulator/step", request);
}

void CellLink::reset() { links_->call<std_srvs::Trigger>("reset", "peg_hole_simulator/reset"); }

void CellLink::requestPlan(const std::string& plan) { links_->calibration.requestPlan(plan); }
void CellLink::startCalibration(const CalibrationRequest& request) {
  links_->calibration.start(request);
}
void CellLink::cancelCalibration() { links_->calibration.cancel(); }
void CellLink::confirmLoad(const Measured& measured) { links_->calibration.confirm(measured); }
void CellLink::removeLast() { links_->calibration.removeLast(); }
void CellLink::requestStored() { links_->calibration.requestStored(); }
void CellLink::loadCalibration(const std::string& id) { links_->calibration.load(id); }

}  // namespace assembly_cell::panel
