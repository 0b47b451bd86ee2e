// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/live_settings.h"

#include <dynamic_reconfigure/ConfigDescription.h>
#include <dynamic_reconfigure/Reconfigure.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

using dynamic_reconfigure::Config;
using dynamic_reconfigure::Reconfigure;

namespace {

constexpr char kGroup[] = "Default";      // that clients expect
constexpr std::size_t kMaxRequest = 200;  // values of a request
constexpr double kLogPeriod = 1.0;        // of changes, wall clock [s]
constexpr double kSwitchOn = 0.5;         // of a switch's value

/// One value of a request.
struct Requested {
  std::string name;
  enum Kind { kNumber, kSwitch, kText } kind;
  double value;
};

std::vector<Requested> listed(const Config& request) {
  std::vector<Requested> all;
  for (const auto& b : request.bools)
    all.push_back({b.name, Requested::kSwitch, b.value ? 1.0 : 0.0});
  for (const auto& i : request.ints) all.push_back({i.name, Requested::kNumber, 1.0 * i.value});
  for (const auto& d : request.doubles) all.push_back({d.name, Requested::kNumber, d.value});
  for (const auto& s : request.strs) all.push_back({s.name, Requested::kText, 0.0});
  return all;
}

std::string knownNames(const LiveValues& values) {
  std::string names;
  for (const LiveSetting& setting : values) names += (names.empty() ? "" : ", ") + setting.name;
  return names;
}

// Sets the value. Empty, or why it is refused.
std::string setValue(const Requested& requested, const std::string& name, LiveSetting& setting,
                     std::string& cut) {
  if (setting.is_switch) {
    if (requested.kind != Requested::kSwitch) return name + " is a switch: give true or false";
    setting.value = requested.value;
    return {};
  }
  if (requested.kind != Requested::kNumber) return name + " is no number: give one";
  if (std::isfinite(requested.value) && setting.lowers_only &&
      requested.value > setting.range.high) {
    cut = text("%s is %g: more than %g, the value at the start, needs a restart; %g is set",
               name.c_str(), requested.value, setting.range.high, setting.range.high);
    setting.value = setting.range.high;
    return {};
  }
  const std::string wrong = outside(requested.value, setting.range);
  if (!wrong.empty()) return name + " is " + wrong;
  setting.value = requested.value;
  return {};
}

Config configOf(const LiveValues& values, double (*of)(const LiveSetting&)) {
  Config config;
  for (const LiveSetting& setting : values) {
    if (setting.is_switch) {
      config.bools.emplace_back();
      config.bools.back().name = setting.name;
      config.bools.back().value = of(setting) > kSwitchOn;
    } else {
      config.doubles.emplace_back();
      config.doubles.back().name = setting.name;
      config.doubles.back().value = of(setting);
    }
  }
  config.groups.emplace_back();
  config.groups.back().name = kGroup;
  config.groups.back().state = true;
  return config;
}

Config activeConfig(const LiveValues& values) {
  return configOf(values, [](const LiveSetting& setting) { return setting.value; });
}

}  // namespace

LiveSetting liveNumber(const std::string& name, double value, const Range& range,
                       const std::string& description) {
  return {name, description, range, value, false, false};
}

LiveSetting liveSwitch(const std::string& name, bool value, const std::string& description) {
  return {name, description, {0.0, 1.0}, value ? 1.0 : 0.0, true, false};
}

LiveSetting liveLimit(const std::string& name, double value, double min,
                      const std::string& description) {
  return {name, description, {min, value}, value, false, true};
}

LiveValues liveValues(const FieldList& fields, const std::string& when) {
  LiveValues values;
  for (const Field& field : fields) {
    if (field.change == Field::Change::kRestart) continue;
    const std::string name = parameterName(field.path);
    const std::string unit = *field.range.unit == '\0' ? "" : text(" [%s]", field.range.unit);
    const std::string description = std::string(field.description) + unit + "; " + when;
    if (field.kind == Field::Kind::kFlag) {
      values.push_back(liveSwitch(name, *field.flag, description));
    } else if (field.change == Field::Change::kLower) {
      values.push_back(liveLimit(name, *field.numbers, field.range.low, description));
    } else {
      values.push_back(liveNumber(name, *field.numbers, field.range, description));
    }
  }
  return values;
}

void put(const LiveValues& values, const FieldList& fields) {
  for (const Field& field : fields) {
    if (field.change == Field::Change::kRestart) continue;
    const double value = valueOf(values, parameterName(field.path));
    if (field.kind == Field::Kind::kFlag) {
      *field.flag = value > kSwitchOn;
    } else {
      *field.numbers = value;
    }
  }
}

double valueOf(const LiveValues& values, std::string_view name) {
  for (const LiveSetting& setting : values) {
    if (setting.name == name) return setting.value;
  }
  throw std::logic_error("no live setting " + std::string(name));
}

LiveChange applied(const LiveValues& values, const Config& request, const std::string& prefix,
                   const std::set<std::string>& restart) {
  LiveChange change{values, {}, {}};
  const std::size_t count = request.bools.size() + request.ints.size() + request.doubles.size() +
                            request.strs.size() + request.groups.size();
  if (count > kMaxRequest) {
    change.refusal = text("%zu values: give %zu at most", count, kMaxRequest);
    return change;
  }
  std::set<std::string> seen;
  for (const Requested& requested : listed(request)) {
    const std::string name = "parameter " + prefix + printable(requested.name);
    const auto setting =
        std::find_if(change.values.begin(), change.values.end(),
                     [&](const LiveSetting& s) { return s.name == requested.name; });
    if (!seen.insert(requested.name).second) {
      change.refusal = name + " is given twice: give it once";
    } else if (setting != change.values.end()) {
      change.refusal = setValue(requested, name, *setting, change.cut);
    } else if (restart.count(requested.name) != 0) {
      change.refusal =
          name + " needs a restart: set it before the node starts; live are " + knownNames(values);
    } else {
      change.refusal = name + " is unknown: live are " + knownNames(values);
    }
    if (!change.refusal.empty()) {
      change.values = values;
      change.cut.clear();
      return change;
    }
  }
  return change;
}

/// The service. Unlike roscpp's, its error has the reason of a refusal, and not every refusal is
/// logged.
struct LiveCall : ros::ServiceCallbackHelper {
  explicit LiveCall(LiveSettings& of) : settings(of) {}

  bool call(ros::ServiceCallbackHelperCallParams& params) override {
    std::string why = "the request can't be read";
    Reconfigure::Response response;
    guarded(settings.service_.getService(), [&] {
      Reconfigure::Request request;
      ros::serialization::deserializeMessage(params.request, request);
      why = settings.apply(request.config, (*params.connection_header)["callerid"]);
      response.config = activeConfig(settings.now());
    });
    params.response = why.empty() ? ros::serialization::serializeServiceResponse(true, response)
                                  : ros::serialization::serializeServiceResponse(false, why);
    // roscpp sends the response; false would send an error without a text
    return true;
  }

  LiveSettings& settings;
};

LiveSettings::LiveSettings(const ros::NodeHandle& pnh, LiveValues values,
                           const std::set<std::string>& restart, Check check)
    : nh_(pnh), restart_(restart), check_(std::move(check)), values_(std::move(values)) {
  nh_.setCallbackQueue(&queue_);
  description_pub_ =
      nh_.advertise<dynamic_reconfigure::ConfigDescription>("parameter_descriptions", 1, true);
  update_pub_ = nh_.advertise<Config>("parameter_updates", 1, true);
  describe();
  update_pub_.publish(activeConfig(values_));
  ros::AdvertiseServiceOptions options;
  options.service = "set_parameters";
  options.md5sum = ros::service_traits::md5sum<Reconfigure>();
  options.datatype = ros::service_traits::datatype<Reconfigure>();
  options.req_datatype = ros::message_traits::datatype<Reconfigure::Request>();
  options.res_datatype = ros::message_traits::datatype<Reconfigure::Response>();
  options.callback_queue = &queue_;
  options.helper = boost::make_shared<LiveCall>(*this);
  service_ = nh_.advertiseService(options);
  spinner_.start();
}

LiveSettings::~LiveSettings() {
  service_.shutdown();
  spinner_.stop();
}

LiveValues LiveSettings::now() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return values_;
}

double LiveSettings::number(std::string_view name) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return valueOf(values_, name);
}

std::string LiveSettings::apply(const Config& request, const std::string& caller) {
  const std::string prefix = nh_.getNamespace() + "/";
  const LiveValues before = now();
  LiveChange change = applied(before, request, prefix, restart_);
  if (change.refusal.empty() && check_) {
    try {
      check_(change.values);
    } catch (const InputError& error) {
      change.refusal = "parameters " + nh_.getNamespace() + ": " + error.what();
    }
  }
  if (!change.refusal.empty() || !change.cut.empty()) {
    IncomingLog::ofThisProcess().refuse(service_.getService(), caller, change.refusal + change.cut);
  }
  if (!change.refusal.empty()) return change.refusal;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    values_ = change.values;
  }
  std::string changes;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const LiveSetting& setting = change.values[i];
    if (setting.value == before[i].value) continue;
    changes += text("%s%s %g, was %g", changes.empty() ? "" : "; ", setting.name.c_str(),
                    setting.value, before[i].value);
    if (setting.is_switch) {
      nh_.setParam(setting.name, setting.value > kSwitchOn);
    } else {
      nh_.setParam(setting.name, setting.value);
    }
  }
  if (changes.empty()) return {};
  update_pub_.publish(activeConfig(change.values));
  if (const auto time = ros::WallTime::now(); (time - logged_).toSec() >= kLogPeriod) {
    logged_ = time;
    ROS_INFO("set by %s: %s", caller.c_str(), changes.c_str());
  }
  return {};
}

void LiveSettings::describe() {
  dynamic_reconfigure::ConfigDescription description;
  description.groups.emplace_back();
  dynamic_reconfigure::Group& group = description.groups.back();
  group.name = kGroup;
  for (const LiveSetting& setting : values_) {
    group.parameters.emplace_back();
    group.parameters.back().name = setting.name;
    group.parameters.back().type = setting.is_switch ? "bool" : "double";
    group.parameters.back().description = setting.description;
  }
  description.min = configOf(values_, [](const LiveSetting& s) { return s.range.low; });
  description.max = configOf(values_, [](const LiveSetting& s) { return s.range.high; });
  description.dflt = activeConfig(values_);
  description_pub_.publish(description);
}

}  // namespace assembly_cell::ros_bridge
