// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/master_call.h"

#include <XmlRpcClient.h>
#include <ros/network.h>
#include <ros/this_node.h>

#include <chrono>

namespace assembly_cell::ros_bridge {

namespace {

class Client : private XmlRpc::XmlRpcClient {
 public:
  using XmlRpc::XmlRpcClient::XmlRpcClient;
  ~Client() override { close(); }

  bool call(const std::string& method, const XmlRpc::XmlRpcValue& parameters, double limit,
            XmlRpc::XmlRpcValue& response) {
    if (!executeNonBlock(method.c_str(), parameters)) return false;
    // returns when the response is there, or the connection has ended
    _disp.work(limit);
    return executeCheckDone(response) && !isFault();
  }
};

}  // namespace

std::optional<XmlRpc::XmlRpcValue> callNode(const std::string& uri, const std::string& method,
                                            const std::string& argument, double limit) {
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return std::nullopt;
  XmlRpc::XmlRpcValue parameters, response;
  parameters[0] = ros::this_node::getName();
  if (!argument.empty()) parameters[1] = argument;
  Client client(host.c_str(), static_cast<int>(port), "/");
  if (!client.call(method, parameters, limit, response)) return std::nullopt;
  using Value = XmlRpc::XmlRpcValue;
  const bool good = response.getType() == Value::TypeArray && response.size() == 3 &&
                    response[0].getType() == Value::TypeInt && static_cast<int>(response[0]) == 1;
  return good ? std::optional<Value>(response[2]) : std::nullopt;
}

std::optional<XmlRpc::XmlRpcValue> callMaster(const std::string& method,
                                              const std::string& argument, double limit) {
  return callNode(ros::master::getURI(), method, argument, limit);
}

std::optional<Registrations> registrations(double limit, const std::string& uri) {
  auto state = callNode(uri, "getSystemState", "", limit);
  if (!state) return std::nullopt;
  const auto read = [](XmlRpc::XmlRpcValue& list) {
    std::map<std::string, std::vector<std::string>> nodes;
    for (int i = 0; i < list.size(); ++i) {
      for (int k = 0; k < list[i][1].size(); ++k) nodes[list[i][0]].push_back(list[i][1][k]);
    }
    return nodes;
  };
  return Registrations{read((*state)[0]), read((*state)[1])};
}

}  // namespace assembly_cell::ros_bridge
