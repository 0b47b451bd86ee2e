// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/node_watch.h"

#include <netdb.h>
#include <poll.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <ros/xmlrpc_manager.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/process/master_call.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kPatience = 200;         // for a response of another host [ms]
constexpr double kMasterAnswer = 0.1;  // of the master, if its last response is there [s]
constexpr double kFirstAnswer = 1.0;   // otherwise [s]
constexpr double kServerAnswer = 0.5;  // of a node that serves an action already [s]

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

}  // namespace

// Only a refused connection means gone: a frozen process stops accepting when its backlog is full,
// and without a network nothing is known.
NodePresence presenceAt(const std::string& host, std::uint32_t port, double answer_within) {
  const int patience = static_cast<int>(1e3 * answer_within);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) {
    return NodePresence::kUnreachable;
  }
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> addresses(found, freeaddrinfo);
  std::set<NodePresence> seen;
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
    seen.insert(silent || mute          ? NodePresence::kMute
                : error == ECONNREFUSED ? NodePresence::kGone
                                        : NodePresence::kUnreachable);
  }
  for (const NodePresence presence : {NodePresence::kMute, NodePresence::kGone}) {
    if (seen.count(presence) != 0) return presence;
  }
  return NodePresence::kUnreachable;
}

namespace {

// Publishers and their addresses as the master had them. Its last response is used while it doesn't
// respond, and after it was restarted: then it has no registrations from before.
class Registry {
 public:
  static Registry& ofThisProcess() {
    static Registry registry;
    return registry;
  }

  // Requests the publishers of these topics; false if they aren't known.
  bool update(const std::vector<std::string>& topics, const std::string& master) {
    const std::lock_guard<std::mutex> turn(updating_);
    const auto begin = Clock::now();
    const double limit = has(topics) ? kMasterAnswer : kFirstAnswer;
    std::optional<Registrations> state = registrations(limit, master);
    if (!state || !hasThisNode(state->publishers["/rosout"])) return has(topics);
    std::map<std::string, std::vector<std::string>> nodes;
    for (const std::string& topic : topics) nodes[topic] = state->publishers[topic];
    std::map<std::string, std::string> addresses;
    for (const auto& entry : nodes) {
      for (const std::string& node : entry.second) addresses[node];
    }
    for (auto& [node, address] : addresses) {
      const double rest = limit - std::chrono::duration<double>(Clock::now() - begin).count();
      const auto found = rest > 0.0 ? callNode(master, "lookupNode", node, rest) : std::nullopt;
      if (found) address = static_cast<std::string>(XmlRpc::XmlRpcValue(*found));
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto& [topic, list] : nodes) nodes_[topic] = list;
    for (const auto& [node, address] : addresses) {
      if (!address.empty()) addresses_[node] = address;
    }
    return true;
  }

  std::vector<std::string> nodesOf(const std::string& topic) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = nodes_.find(topic);
    return found != nodes_.end() ? found->second : std::vector<std::string>();
  }

  NodePresence presenceOf(const std::string& node, double answer_within) const {
    std::string address, host;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const auto found = addresses_.find(node);
      if (found != addresses_.end()) address = found->second;
    }
    std::uint32_t port = 0;
    if (!ros::network::splitURI(address, host, port)) return NodePresence::kUnknown;
    return presenceAt(host, port, answer_within);
  }

 private:
  using Clock = std::chrono::steady_clock;

  bool has(const std::vector<std::string>& topics) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::all_of(topics.begin(), topics.end(),
                       [this](const std::string& topic) { return nodes_.count(topic) != 0; });
  }

  static bool hasThisNode(const std::vector<std::string>& nodes) {
    return std::find(nodes.begin(), nodes.end(), ros::this_node::getName()) != nodes.end();
  }

  std::mutex updating_;
  mutable std::mutex mutex_;
  std::map<std::string, std::vector<std::string>> nodes_;  // by topic
  std::map<std::string, std::string> addresses_;           // by node
};

// Adds a publisher: where several differ, only those that are gone, or those that do not answer.
void add(TopicPublisher& publisher, const std::string& node, NodePresence presence) {
  const auto rank = [](NodePresence p) { return static_cast<int>(p); };
  if (!publisher.node.empty() && rank(presence) > rank(publisher.presence)) return;
  const bool alone = publisher.node.empty() || rank(presence) < rank(publisher.presence);
  publisher.node = alone ? node : publisher.node + " and " + node;
  publisher.presence = presence;
}

// False if this host has no network, not even to itself: then no other node is to blame.
bool reachesItself() {
  std::string host;
  std::uint32_t port = 0;
  return !ros::network::splitURI(ros::XMLRPCManager::instance()->getServerURI(), host, port) ||
         presenceAt(host, port, 0.0) == NodePresence::kListening;
}

}  // namespace

void rememberPublishers(const std::vector<std::string>& topics) {
  Registry::ofThisProcess().update(topics, ros::master::getURI());
}

std::vector<TopicPublisher> publishersOf(const std::vector<std::string>& topics,
                                         double answer_within, const std::string& master) {
  Registry& registry = Registry::ofThisProcess();
  std::future<bool> has_network = std::async(std::launch::async, reachesItself);
  const bool known = registry.update(topics, master);
  std::map<std::string, std::future<NodePresence>> pending;
  for (const std::string& topic : topics) {
    for (const std::string& node : registry.nodesOf(topic)) {
      if (pending.count(node) != 0) continue;
      pending[node] = std::async(std::launch::async, [&registry, node, answer_within] {
        return registry.presenceOf(node, answer_within);
      });
    }
  }
  std::map<std::string, NodePresence> presence;
  for (auto& [node, found] : pending) presence[node] = found.get();
  const auto is_mute = [](const auto& entry) { return entry.second == NodePresence::kMute; };
  if (std::any_of(presence.begin(), presence.end(), is_mute) && !has_network.get()) {
    for (auto& entry : presence) {
      if (is_mute(entry)) entry.second = NodePresence::kUnreachable;
    }
  }
  std::vector<TopicPublisher> out;
  for (const std::string& topic : topics) {
    TopicPublisher publisher{topic, "", known ? NodePresence::kUnknown : NodePresence::kNoMaster};
    for (const std::string& node : registry.nodesOf(topic)) add(publisher, node, presence.at(node));
    out.push_back(publisher);
  }
  return out;
}

void refuseSecondPublisher(const ros::NodeHandle& nh, const std::string& name,
                           const std::string& what) {
  const std::string topic = nh.resolveName(name);
  Registry& registry = Registry::ofThisProcess();
  registry.update({topic}, ros::master::getURI());
  for (const std::string& node : registry.nodesOf(topic)) {
    if (node == ros::this_node::getName()) continue;
    const NodePresence presence = registry.presenceOf(node, kServerAnswer);
    if (presence != NodePresence::kListening && presence != NodePresence::kMute) continue;
    throw InputError(what + node +
                     " already: end that node first, or start this one in another namespace");
  }
}

void refuseSecondServer(const ros::NodeHandle& nh, const std::string& action) {
  refuseSecondPublisher(nh, action + "/status",
                        "action " + nh.resolveName(action) + " is served by ");
}

std::string describe(const std::vector<TopicPublisher>& publishers) {
  std::string out;
  for (const TopicPublisher& publisher : publishers) {
    out += (out.empty() ? "" : ", ") + publisher.topic.substr(publisher.topic[0] == '/' ? 1 : 0);
    if (publisher.presence == NodePresence::kNoMaster) {
      out += " (the ROS master doesn't respond)";
      continue;
    }
    if (publisher.node.empty()) {
      out += " (no publisher: is its node running?)";
      continue;
    }
    out += " of " + publisher.node;
    out += publisher.presence == NodePresence::kGone          ? " (gone)"
           : publisher.presence == NodePresence::kUnreachable ? " (unreachable: is the network up?)"
                                                              : " (silent)";
  }
  return out;
}

}  // namespace assembly_cell::ros_bridge
