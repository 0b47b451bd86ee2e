// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/twin_force_history.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kStampRounding = 1e-9;  // [s]
// Variance of a channel without a calibration, of 1 N or 1 N m per volt: small against the scatter
// of samples, so that half or twice changes no decision. [N²]
constexpr double kPlainVariance = 1e-6;

const std::vector<double>& valuesOf(const WrenchSamples& m) { return m.wrench; }
const std::vector<double>& valuesOf(const DisplacementSamples& m) { return m.displacement; }
std::vector<double>& valuesOf(WrenchSamples& m) { return m.wrench; }
std::vector<double>& valuesOf(DisplacementSamples& m) { return m.displacement; }

template <class Message>
std::size_t sizeOf(const Message& message) {
  return valuesOf(message).size() / 6;
}

template <class Message>
bool usable(const Message& m) {
  return !valuesOf(m).empty();
}

template <class Message>
BlockMoments momentsOf(const Message& m) {
  return assembly_cell::momentsOf(valuesOf(m).data(), sizeOf(m));
}

template <class List>
bool reaches(const List& list, const ros::Time& until) {
  return !list.empty() && list.back()->header.stamp >= until;
}

// Nearest in time; null if the list is empty.
template <class List>
typename List::value_type nearest(const List& list, const ros::Time& stamp) {
  const auto distance = [&](const auto& m) { return std::abs((m->header.stamp - stamp).toSec()); };
  const auto best = std::min_element(
      list.begin(), list.end(),
      [&](const auto& one, const auto& other) { return distance(one) < distance(other); });
  return best == list.end() ? nullptr : *best;
}

template <class List>
void keep(List& list, const typename List::value_type& message) {
  // a clock that went back begins a new history
  if (!list.empty() && message->header.stamp < list.back()->header.stamp) list.clear();
  list.push_back(message);
  while ((list.back()->header.stamp - list.front()->header.stamp).toSec() >
         TwinForceHistory::kLength) {
    list.pop_front();
  }
}

bool saturated(const WrenchSamples& m) {
  return std::any_of(m.saturated.begin(), m.saturated.end(), [](auto bits) { return bits != 0; });
}

}  // namespace

ros::Time blockEnd(const WrenchSamples& block) {
  return later(block.header.stamp, block.period * (static_cast<double>(sizeOf(block)) - 1.0));
}

template <class Message>
boost::shared_ptr<const Message> withoutSamples(const Message& message) {
  MessageCheck frame;
  frame.stamp("header.stamp", message.header.stamp.toSec())
      .number("period", message.period, kPeriodField);
  if (!frame.good()) return nullptr;
  const auto out = boost::make_shared<Message>(message);
  valuesOf(*out).clear();
  return out;
}
template WrenchSamples::ConstPtr withoutSamples(const WrenchSamples&);
template DisplacementSamples::ConstPtr withoutSamples(const DisplacementSamples&);

void TwinForceHistory::add(Side side, const Wrench& wrench) { keep(wrenches_[side], wrench); }

void TwinForceHistory::add(const Displacement& displacement) { keep(displacements_, displacement); }

void TwinForceHistory::add(const geometry_msgs::PoseStamped::ConstPtr& carrier) {
  keep(carrier_, carrier);
}

void TwinForceHistory::add(Side side, const SensorCalibration& message) {
  const Calibration calibration = fromMessage(message, "calibration of " + sensorName(side));
  matrices_[side] = calibration.volts_to_wrench;
  gains_[side] = gainCovariance(calibration);
}

std::optional<std::uint32_t> TwinForceHistory::commonSequence() const {
  const std::deque<Wrench>&a = wrenches_.a, &b = wrenches_.b;
  if (a.empty() || b.empty()) return std::nullopt;
  const std::uint32_t sequence = a.back()->sequence;
  if (b.back()->sequence != sequence) return std::nullopt;
  const bool has_displacement =
      !displacements_.empty() && displacements_.back()->sequence == sequence;
  if (settings_.use_displacement && !has_displacement) return std::nullopt;
  return sequence;
}

ros::Time TwinForceHistory::lastWrench() const {
  return wrenches_.b.empty() ? ros::Time() : wrenches_.b.back()->header.stamp;
}

std::vector<TwinForceHistory::Wrench> TwinForceHistory::select(const BlockWindow& window,
                                                               const ros::Time& after) const {
  const bool named = window.isNamed();
  std::vector<Wrench> out;
  double covered = 0.0;
  bool complete = false;
  for (const Wrench& b : wrenches_.b) {
    const ros::Duration half(0.5 * b->period);
    const ros::Time end = blockEnd(*b);
    if (!complete &&
        (named ? end >= later(window.first, -0.5 * b->period) && end <= window.last + half
               : b->header.stamp > after)) {
      if (!usable(*b)) throw InputError("sensor_b: a block is not one of finite samples");
      covered += b->period * static_cast<double>(sizeOf(*b));
      out.push_back(b);
    }
    // blocks that the caller has missed count, too
    complete = named ? end >= later(window.last, -0.5 * b->period) && out.size() >= window.blocks
                     : covered >= window.duration - kStampRounding;
  }
  if (!complete) out.clear();
  return out;
}

const char* TwinForceHistory::missing(const Wrench& last) const {
  const ros::Time stamp = later(last->header.stamp, -(settings_.time_limit + kStampRounding));
  if (!reaches(wrenches_.a, stamp)) return "wrench of sensor_a";
  if (settings_.use_displacement && !reaches(displacements_, stamp)) {
    return "displacement of sensor_b";
  }
  if (!reaches(carrier_, blockEnd(*last) - ros::Duration(0.5 * last->period)))
    return "carrier_pose";
  return nullptr;
}

Vector6 TwinForceHistory::displacementOf(const Wrench& b) const {
  if (!settings_.use_displacement) return Vector6::Zero();
  const Displacement d = nearest(displacements_, b->header.stamp);
  if (std::abs((d->header.stamp - b->header.stamp).toSec()) >
      settings_.time_limit + kStampRounding) {
    throw InputError("not simultaneous: no displacement goes with the wrench of sensor_b");
  }
  if (!usable(*d)) {
    throw InputError("sensor_b: a block of displacements is not one of finite samples");
  }
  return momentsOf(*d).mean;
}

PlantBlock TwinForceHistory::blockOf(const Wrench& b, const ros::Time& origin,
                                     double& time_difference) const {
  const Wrench a = nearest(wrenches_.a, b->header.stamp);
  const double difference = std::abs((a->header.stamp - b->header.stamp).toSec());
  if (difference > settings_.time_limit + kStampRounding) {
    throw InputError(
        text("not simultaneous: the wrenches of both sensors are %.3g s apart, more than %g s",
             difference, settings_.time_limit));
  }
  time_difference = std::max(time_difference, difference);
  if (!usable(*a)) throw InputError("sensor_a: a block is not one of finite samples");
  for (const auto& [samples, sensor] : {std::make_pair(a, "sensor_a"), {b, "sensor_b"}}) {
    if (saturated(*samples)) {
      throw InputError(text("saturated: a channel of %s is at its limit; press less", sensor));
    }
  }
  const BlockMoments moments_a = momentsOf(*a), moments_b = momentsOf(*b);
  const auto rounding = [this](const std::optional<Matrix6>& S) {
    return S ? roundingCovariance(*S, settings_.converter_step)
             : Matrix6(kPlainVariance * Matrix6::Identity());
  };
  PlantBlock out;
  out.time = (blockEnd(*b) - origin).toSec();
  out.wrench_a = moments_a.mean;
  out.wrench_b = moments_b.mean;
  out.covariance_a = moments_a.covariance;
  out.covariance_b = moments_b.covariance;
  out.rounding_a = rounding(matrices_.a);
  out.rounding_b = rounding(matrices_.b);
  out.samples = std::min(moments_a.count, moments_b.count);
  out.displacement_b = displacementOf(b);
  // the carrier at the block's end
  const ros::Time end = blockEnd(*b) + ros::Duration(0.5 * b->period);
  geometry_msgs::PoseStamped::ConstPtr carrier = carrier_.front();
  for (const auto& pose : carrier_) {
    if (pose->header.stamp <= end) carrier = pose;
  }
  out.carrier = restFromPose(fromPose(carrier->pose, "carrier_pose"));
  return out;
}

std::optional<TwinForceHistory::Now> TwinForceHistory::now() const {
  if (carrier_.empty()) return std::nullopt;
  Now out;
  out.stamp = carrier_.back()->header.stamp;
  out.carrier = restFromPose(fromPose(carrier_.back()->pose, "carrier_pose"));
  if (!displacements_.empty() && usable(*displacements_.back()))
    out.displacement = momentsOf(*displacements_.back()).mean;
  return out;
}

}  // namespace assembly_cell::ros_bridge
