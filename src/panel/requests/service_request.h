// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "async_requests.h"

namespace assembly_cell::panel {

/// Calls a service (resolved name) in a thread of its own; `then` receives the response in that
/// thread. When the call is abandoned its connection is closed, which ends it in any case. False
/// when a call of this name is running.
template <class Service>
bool callServiceAsync(AsyncRequests& requests, const std::string& name, const std::string& service,
                      const typename Service::Request& request,
                      std::function<void(const typename Service::Response&)> then = nullptr) {
  struct Connection {
    std::mutex mutex;
    ros::ServiceClient client;
    bool abandoned = false;
  };
  const auto connection = std::make_shared<Connection>();
  const auto call = [connection, service, request, then = std::move(then)] {
    Answer answer;
    answer.state = Answer::State::kBad;
    constexpr bool kPersistent = true;  // see ros/bridge/service_call.h
    ros::ServiceClient client = ros::NodeHandle().serviceClient<Service>(service, kPersistent);
    {
      const std::lock_guard<std::mutex> lock(connection->mutex);
      connection->client = client;
      if (connection->abandoned) client.shutdown();
    }
    Service exchange;
    exchange.request = request;
    if (client.call(exchange)) {
      answer.text = exchange.response.message;
      if (exchange.response.success) answer.state = Answer::State::kGood;
      if (then) then(exchange.response);
      return answer;
    }
    const std::lock_guard<std::mutex> lock(connection->mutex);
    answer.text = connection->abandoned ? "abandoned: " + service + " has not answered"
                                        : service + " is not there, or ended before it answered";
    return answer;
  };
  const auto abandon = [connection] {
    const std::lock_guard<std::mutex> lock(connection->mutex);
    connection->abandoned = true;
    connection->client.shutdown();
  };
  return requests.start(name, call, abandon);
}

}  // namespace assembly_cell::panel
