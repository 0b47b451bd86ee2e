// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/node_watch.h"

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <memory>

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kPatience = 200;  // for an answer of another host [ms]

// Does somebody listen there?
bool listens(const std::string& host, std::uint32_t port) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) return false;
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> addresses(found, freeaddrinfo);
  for (const addrinfo* a = found; a != nullptr; a = a->ai_next) {
    const int fd = socket(a->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) continue;
    bool good = connect(fd, a->ai_addr, a->ai_addrlen) == 0;
    pollfd waiting{fd, POLLOUT, 0};
    if (!good && errno == EINPROGRESS && poll(&waiting, 1, kPatience) == 1) {
      int error = 0;
      socklen_t size = sizeof error;
      good = getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0;
    }
    close(fd);
    if (good) return true;
  }
  return false;
}

NodePresence presenceOf(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = node;
  if (!ros::master::execute("lookupNode", request, response, uri, false)) {
    return NodePresence::kUnknown;
  }
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return NodePresence::kUnknown;
  return listens(host, port) ? NodePresence::kListening : NodePresence::kGone;
}

}  // namespace

std::vector<TopicPublisher> publishersOf(const std::vector<std::string>& topics) {
  std::vector<TopicPublisher> out;
  XmlRpc::XmlRpcValue request, response, state;
  request[0] = ros::this_node::getName();
  const bool known = ros::master::execute("getSystemState", request, response, state, false);
  std::map<std::string, NodePresence> presence;
  for (const std::string& topic : topics) {
    TopicPublisher publisher{topic, "", NodePresence::kUnknown};
    for (int i = 0; known && i < state[0].size(); ++i) {
      if (std::string(state[0][i][0]) != topic) continue;
      for (int k = 0; k < state[0][i][1].size(); ++k) {
        const std::string node = state[0][i][1][k];
        const auto [entry, first] = presence.try_emplace(node, NodePresence::kUnknown);
        if (first) entry->second = presenceOf(node);
        if (!publisher.node.empty() && entry->second != NodePresence::kGone) continue;
        publisher.node = node;
        publisher.presence = entry->second;
        if (entry->second == NodePresence::kGone) break;
      }
    }
    out.push_back(publisher);
  }
  return out;
}

std::string describe(const std::vector<TopicPublisher>& publishers) {
  std::string out;
  for (const TopicPublisher& publisher : publishers) {
    out += (out.empty() ? "" : ", ") + publisher.topic.substr(publisher.topic[0] == '/' ? 1 : 0);
    if (publisher.node.empty()) {
      out += " (nobody publishes it: is its node running?)";
      continue;
    }
    out += " of " + publisher.node;
    out += publisher.presence == NodePresence::kGone ? " (gone)" : " (silent)";
  }
  return out;
}

}  // namespace assembly_cell::ros_bridge
