// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "errands.h"

namespace assembly_cell::panel {

/// Calls a service (resolved name) in a thread of its own; `then`, in that thread, gets what it
/// answers. Abandoned, the connection is dropped, which ends the call whatever the server does.
/// False when a call of this name is under way.
template <class Service>
bool beginServiceErrand(Errands& errands, const std::string& name, const std::string& service,
                        const typename Service::Request& request,
                        std::function<void(const typename Service::Response&)> then = nullptr) {
  struct Line {
    std::mutex mutex;
    ros::ServiceClient client;
    bool abandoned = false;
  };
  const auto line = std::make_shared<Line>();
  const auto call = [line, service, request, then = std::move(then)] {
    Answer answer;
    answer.state = Answer::State::kBad;
    constexpr bool kPersistent = true;  // see ros/service_call.h
    ros::ServiceClient client = ros::NodeHandle().serviceClient<Service>(service, kPersistent);
    {
      const std::lock_guard<std::mutex> lock(line->mutex);
      line->client = client;
      if (line->abandoned) client.shutdown();
    }
    Service answered;
    answered.request = request;
    if (client.call(answered)) {
      answer.text = answered.response.message;
      if (answered.response.success) answer.state = Answer::State::kGood;
      if (then) then(answered.response);
      return answer;
    }
    const std::lock_guard<std::mutex> lock(line->mutex);
    answer.text = line->abandoned ? "given up: " + service + " has not answered"
                                  : service + " is not there, or ended before it answered";
    return answer;
  };
  const auto abandon = [line] {
    const std::lock_guard<std::mutex> lock(line->mutex);
    line->abandoned = true;
    line->client.shutdown();
  };
  return errands.begin(name, call, abandon);
}

}  // namespace assembly_cell::panel
