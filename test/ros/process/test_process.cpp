// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <future>
#include <iostream>
#include <string>

#include "assembly_cell/ros/process/log_relay.h"
#include "assembly_cell/ros/process/master_call.h"
#include "assembly_cell/ros/process/node_watch.h"
#include "cell_fixture.h"

namespace assembly_cell::ros_bridge::process_test {
namespace {

using test::Child;
using test::executable;
using test::waitFor;

// A server that accepts connections and never responds, as a frozen process does.
class MuteServer {
 public:
  MuteServer() : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    const bool good = bind(socket_, reinterpret_cast<sockaddr*>(&address), size) == 0 &&
                      listen(socket_, 10) == 0 &&
                      getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size) == 0;
    port_ = good ? ntohs(address.sin_port) : 0;
  }
  ~MuteServer() { close(socket_); }
  MuteServer(const MuteServer&) = delete;
  MuteServer& operator=(const MuteServer&) = delete;
  std::string uri() const { return "http://127.0.0.1:" + std::to_string(port_) + "/"; }
  std::uint32_t port() const { return port_; }

 private:
  const int socket_;
  std::uint32_t port_ = 0;
};

// ---- logging ----

// Standard error is a pipe that is read by read() only.
class LogRelayTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(pipe(pipe_), 0);
    before_ = dup(STDERR_FILENO);
    dup2(pipe_[1], STDERR_FILENO);
    fcntl(pipe_[0], F_SETFL, O_NONBLOCK);
  }
  void TearDown() override {
    dup2(before_, STDERR_FILENO);
    for (const int file : {before_, pipe_[0], pipe_[1]}) close(file);
  }
  void read() {
    std::array<char, 4096> buffer{};
    ssize_t n = 0;
    while ((n = ::read(pipe_[0], buffer.data(), buffer.size())) > 0) {
      text_.append(buffer.data(), static_cast<std::size_t>(n));
    }
  }

  int pipe_[2] = {-1, -1};
  int before_ = -1;
  std::string text_;
};

TEST_F(LogRelayTest, ATerminalThatDoesNotReadStopsNoCallerAndTheLossIsCounted) {
  {
    const LogRelay relay;
    // more than both pipes hold; without the relay this never ends
    for (int i = 0; i < 20000; ++i) std::fprintf(stderr, "line %d of a control loop\n", i);
    const auto has_last = [this] {
      std::cerr << "last line\n";
      read();
      return text_.find("last line\n") != std::string::npos;
    };
    EXPECT_TRUE(waitFor(has_last));
  }
  read();
  EXPECT_EQ(text_.compare(0, 5, "line "), 0);
  EXPECT_NE(text_.find(" lines lost here: the terminal"), std::string::npos);
  EXPECT_NE(text_.find("line 100 of a control loop\nline 101 of"), std::string::npos);
}

TEST_F(LogRelayTest, LinesArriveBeforeTheProcessEnds) {
  {
    const LogRelay relay;
    std::fprintf(stderr, "refused: the reason\n");
  }
  read();
  EXPECT_EQ(text_, "refused: the reason\n");
}

// A node whose output is never read works on.
TEST(ProcessTest, ANodeWithAFullTerminalWorksOn) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  fcntl(ends[1], F_SETFL, O_NONBLOCK);
  const std::string rubbish(4096, 'x');
  while (write(ends[1], rubbish.data(), rubbish.size()) > 0) {
  }
  fcntl(ends[1], F_SETFL, 0);
  const std::string out = "/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(ends[1]);
  Child node({"/bin/sh", "-c", "exec " + executable("contact_markers") + " >" + out + " 2>&1"});
  const auto is_there = [] {
    const auto found = publishersOf({ros::names::resolve("markers")}, 1.0);
    return found.front().presence == NodePresence::kListening;
  };
  EXPECT_TRUE(waitFor(is_there));
  node.signal(SIGINT);
  EXPECT_EQ(node.wait(), 0);
  close(ends[0]);
  close(ends[1]);
}

// ---- the start of a process ----

TEST(ProcessTest, TooFewOpenFilesAreNamed) {
  Child node({"/bin/sh", "-c", "ulimit -n 64; exec " + executable("contact_markers")});
  EXPECT_EQ(node.wait(), 1);
  EXPECT_EQ(node.lines("contact_markers: at most 64 open files are allowed").size(), 1U)
      << node.output();
}

TEST(ProcessTest, AMasterThatDoesNotRespondIsNamed) {
  const MuteServer frozen;
  for (const std::string program : {"contact_markers", "report"}) {
    Child node({executable(program)}, {"ROS_MASTER_URI=" + frozen.uri()});
    EXPECT_EQ(node.wait(), 1);
    EXPECT_EQ(node.lines(frozen.uri() + " doesn't respond within 5 s").size(), 1U) << node.output();
  }
}

// ---- absent nodes ----

double secondsOf(const std::function<void()>& call) {
  const auto begin = std::chrono::steady_clock::now();
  call();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

TEST(NodeWatchTest, ACallOfAFrozenMasterEnds) {
  const MuteServer frozen;
  std::optional<XmlRpc::XmlRpcValue> found;
  // 10 times the limit, for a busy machine
  EXPECT_LT(secondsOf([&] { found = callNode(frozen.uri(), "getSystemState", "", 0.2); }), 2.0);
  EXPECT_FALSE(found);
  EXPECT_TRUE(callMaster("getSystemState", "", 10.0));
  EXPECT_EQ(presenceAt("127.0.0.1", frozen.port(), 0.2), NodePresence::kMute);
}

TEST(NodeWatchTest, OnlyARefusedConnectionMeansGone) {
  std::uint32_t port = 0;
  {
    const MuteServer ended;
    port = ended.port();
  }
  EXPECT_EQ(presenceAt("127.0.0.1", port, 0.2), NodePresence::kGone);
  // no route to it, or no name server
  EXPECT_EQ(presenceAt("no.such.host.invalid", port, 0.2), NodePresence::kUnreachable);
  EXPECT_EQ(describe({{"/sensor_b/wrench_samples", "/driver", NodePresence::kUnreachable}}),
            "sensor_b/wrench_samples of /driver (unreachable: is the network up?)");
}

TEST(NodeWatchTest, ADeadNodeIsNamedWithoutAMaster) {
  ros::NodeHandle nh;
  const std::string topic = nh.resolveName("markers");
  Child node({executable("contact_markers")});
  const auto presence = [&] { return publishersOf({topic}, 1.0).front().presence; };
  ASSERT_TRUE(waitFor([&] { return presence() == NodePresence::kListening; }));
  node.signal(SIGKILL);
  node.wait();
  const MuteServer frozen;
  const std::string master = ros::master::getURI();
  std::vector<TopicPublisher> found;
  EXPECT_LT(secondsOf([&] { found = publishersOf({topic}, 0.2, frozen.uri()); }), 2.0);
  EXPECT_EQ(describe(found), topic.substr(1) + " of /contact_markers (gone)");
  EXPECT_EQ(describe(publishersOf({"/never/seen"}, 0.2, frozen.uri())),
            "never/seen (the ROS master doesn't respond)");
}

TEST(NodeWatchTest, ASecondServerOfAnActionIsRefused) {
  ros::NodeHandle nh;
  ros::Publisher own = nh.advertise<std_msgs::String>("watched/status", 1);
  EXPECT_NO_THROW(refuseSecondServer(nh, "watched"));
  Child other({"rostopic", "pub", "-l", ros::names::resolve("watched/status"), "std_msgs/String",
               "data: x"});
  const auto refusal = [&]() -> std::string {
    try {
      refuseSecondServer(nh, "watched");
      return "";
    } catch (const std::exception& error) {
      return error.what();
    }
  };
  ASSERT_TRUE(waitFor([&] { return !refusal().empty(); }));
  EXPECT_EQ(refusal().find("action /watched is served by /rostopic_"), 0U) << refusal();
  // killed, it stays registered
  other.signal(SIGKILL);
  other.wait();
  EXPECT_EQ(refusal(), "");
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::process_test
