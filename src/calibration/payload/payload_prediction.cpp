// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "payload_parts.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "bias_series.h"

namespace assembly_cell {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

void checkIdentified(const PayloadModel& model) {
  if (model.refusal || model.order.empty()) {
    throw InputError("payload: not identified: " + model.refusal.text);
  }
}

std::size_t recordingAt(const PayloadModel& model, double order) {
  std::size_t recording = 0;
  while (recording + 1 < model.starts.size() && order >= model.order[model.starts[recording + 1]]) {
    ++recording;
  }
  return recording;
}

}  // namespace

Functional biasFunctional(const PayloadModel& model, std::size_t axis, double order,
                          double temperature) {
  const BiasGroup& group = model.group[axis / 3];
  const BiasComponent& b = group.component[axis % 3];
  const std::size_t recording = recordingAt(model, order);
  Functional f;
  f.row = VectorXd::Zero(group.effects.size());
  const int lead = b.temperature ? 1 : 0;
  if (b.temperature && std::isfinite(temperature)) {
    f.row[b.first_effect] = temperature - model.temperature_mean;
  }
  bias_series::fillOwnEffects(b.shape, model.order, model.starts, order, recording,
                              f.row.segment(b.first_effect + lead, b.own_effects - lead));
  f.kernel = VectorXd::Zero(model.order.size());
  if (b.ratio > 0.0) {
    const double origin = model.order[model.starts[recording]];
    const std::size_t end =
        recording + 1 < model.starts.size() ? model.starts[recording + 1] : model.order.size();
    for (std::size_t i = model.starts[recording]; i < end; ++i) {
      f.kernel[i] = b.ratio * bias_series::covariance(b.shape, order, model.order[i], origin);
    }
    f.variance = b.ratio * bias_series::covariance(b.shape, order, order, origin);
  }
  return f;
}

Estimate evaluate(const PayloadModel& model, std::size_t axis, const Functional& f) {
  const BiasGroup& group = model.group[axis / 3];
  const BiasComponent& b = group.component[axis % 3];
  const double value = f.row.dot(group.effects) + f.kernel.dot(b.weighted);
  const VectorXd k = b.whitener * f.kernel;
  const VectorXd rest = f.row - b.design.transpose() * (b.whitener.transpose() * k);
  const double own = std::max(f.variance - k.squaredNorm(), 0.0) * b.noise * b.noise;
  return {value, std::max(rest.dot(group.covariance * rest), 0.0) + own};
}

Estimate biasChange(const PayloadModel& model, std::size_t axis, std::size_t from, std::size_t to) {
  const double temperature = model.temperature_mean;
  const Functional f0 = biasFunctional(model, axis, model.order[from], temperature);
  const Functional f1 = biasFunctional(model, axis, model.order[to], temperature);
  Functional d;
  d.row = f1.row - f0.row;
  d.kernel = f1.kernel - f0.kernel;
  d.variance = f1.variance + f0.variance - 2.0 * f1.kernel[from];
  return evaluate(model, axis, d);
}

std::optional<std::size_t> smallestBreak(const PayloadModel& model, double limit) {
  std::optional<std::size_t> place;
  for (std::size_t r = 1; r < model.starts.size(); ++r) {
    const std::size_t start = model.starts[r];
    double size = 0.0;
    for (std::size_t axis = 0; axis < 6; ++axis) {
      const auto biasAt = [&](std::size_t i) {
        const double temperature = model.temperature_mean;
        return evaluate(model, axis, biasFunctional(model, axis, model.order[i], temperature))
            .value;
      };
      const double noise = model.group[axis / 3].component[axis % 3].noise;
      size = std::max(size, std::abs(biasAt(start) - biasAt(start - 1)) / noise);
    }
    if (size >= limit) continue;
    limit = size;
    place = start;
  }
  return place;
}

PredictedWrench predictBias(const PayloadModel& model, double order, double temperature) {
  checkIdentified(model);
  PredictedWrench out;
  for (std::size_t axis = 0; axis < 6; ++axis) {
    const Estimate bias = evaluate(model, axis, biasFunctional(model, axis, order, temperature));
    out.wrench[axis] = bias.value;
    out.sd[axis] = std::sqrt(bias.variance);
  }
  return out;
}

PredictedWrench predictWrench(const PayloadModel& model, const StaticPose& pose) {
  checkIdentified(model);
  PredictedWrench out;
  const Vector3d load = pose.R.transpose() * model.gravity;
  const Matrix3d lever = -skew(load);
  for (std::size_t axis = 0; axis < 6; ++axis) {
    Functional f = biasFunctional(model, axis, pose.order, pose.temperature);
    f.row.head<3>() = axis < 3 ? Vector3d(pose.R.col(axis)) : Vector3d(lever.row(axis - 3));
    const Estimate reading = evaluate(model, axis, f);
    const double noise = model.group[axis / 3].component[axis % 3].noise;
    out.wrench[axis] = reading.value;
    out.sd[axis] = std::sqrt(reading.variance + noise * noise);
  }
  if (model.axes == WrenchAxes::kSensor) return out;
  out.wrench.head<3>() = (pose.R * out.wrench.head<3>()).eval();
  out.wrench.tail<3>() = (pose.R * out.wrench.tail<3>()).eval();
  const Matrix3d squares = pose.R.cwiseAbs2();
  out.sd.head<3>() = (squares * out.sd.head<3>().cwiseAbs2()).cwiseSqrt().eval();
  out.sd.tail<3>() = (squares * out.sd.tail<3>().cwiseAbs2()).cwiseSqrt().eval();
  return out;
}

}  // namespace assembly_cell
