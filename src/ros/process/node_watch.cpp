// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/node_watch.h"

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

constexpr int kPatience = 200;  // for a response of another host [ms]

constexpr char kBody[] =
    "<?xml version=\"1.0\"?><methodCall><methodName>getPid</methodName><params><param><value>"
    "<string>/</string></value></param></params></methodCall>";

bool waitUntil(int fd, short events, int patience) {
  pollfd waiting{fd, events, 0};
  return poll(&waiting, 1, patience) == 1;
}

// Is there any response to a request within `patience` [ms]?
bool answers(int fd, const std::string& host, int patience) {
  const std::string request =
      "POST /RPC2 HTTP/1.1\r\nHost: " + host +
      "\r\nContent-Type: text/xml\r\nContent-length: " + std::to_string(sizeof kBody - 1) +
      "\r\n\r\n" + kBody;
  if (send(fd, request.data(), request.size(), MSG_NOSIGNAL) < 0) return false;
  return waitUntil(fd, POLLIN, patience);
}

// State of the process at an address; patience > 0: it must respond within this time [ms]. Only a
// refused connection means gone: a frozen process stops accepting when its backlog is full.
NodePresence presenceAt(const std::string& host, std::uint32_t port, int patience) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) {
    return NodePresence::kGone;
  }
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> addresses(found, freeaddrinfo);
  NodePresence presence = NodePresence::kGone;
  for (const addrinfo* a = found; a != nullptr; a = a->ai_next) {
    const int fd = socket(a->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) continue;
    bool connected = connect(fd, a->ai_addr, a->ai_addrlen) == 0;
    int error = connected ? 0 : errno;
    if (error == EINPROGRESS && waitUntil(fd, POLLOUT, kPatience)) {
      socklen_t size = sizeof error;
      connected = getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0;
    }
    const bool silent = error == EINPROGRESS || error == EAGAIN;
    const bool mute = connected && patience > 0 && !answers(fd, host, patience);
    close(fd);
    if (connected && !mute) return NodePresence::kListening;
    if (silent || mute) presence = NodePresence::kMute;
  }
  return presence;
}

NodePresence presenceOf(const std::string& node, int patience) {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = node;
  if (!ros::master::execute("lookupNode", request, response, uri, false)) {
    return NodePresence::kUnknown;
  }
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return NodePresence::kUnknown;
  return presenceAt(host, port, patience);
}

// Of several publishers those that are gone, or mute, otherwise all.
void add(TopicPublisher& publisher, const std::string& node, NodePresence presence) {
  const auto rank = [](NodePresence p) { return static_cast<int>(p); };
  if (!publisher.node.empty() && rank(presence) > rank(publisher.presence)) return;
  const bool alone = publisher.node.empty() || rank(presence) < rank(publisher.presence);
  publisher.node = alone ? node : publisher.node + " and " + node;
  publisher.presence = presence;
}

}  // namespace

std::vector<TopicPublisher> publishersOf(const std::vector<std::string>& topics,
                                         double answer_within) {
  const int patience = static_cast<int>(1e3 * answer_within);
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
        if (first) entry->second = presenceOf(node, patience);
        add(publisher, node, entry->second);
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
      out += " (no publisher: is its node running?)";
      continue;
    }
    out += " of " + publisher.node;
    out += publisher.presence == NodePresence::kGone ? " (gone)" : " (silent)";
  }
  return out;
}

}  // namespace assembly_cell::ros_bridge
