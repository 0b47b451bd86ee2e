// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/bag_check.h"

#include <fcntl.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kStuck = 10;                  // CPU time without another message [s]
constexpr rlim_t kMaxMemory = 8ull << 30u;  // a damaged length may be any number [bytes]
constexpr char kReason[] = "--reason";      // for damageOf(): prints the damage without context
constexpr char kRemedy[] = ": give a whole bag, or repair it with `rosbag reindex`";

// CPU time of the process: a busy machine may take longer by the clock
void winUp() {
  const itimerval timer{{0, 0}, {kStuck, 0}};
  setitimer(ITIMER_VIRTUAL, &timer, nullptr);
}

// Exit code of the program, which may crash or hang: 0, or 1 with the reason.
int readWhole(const std::string& path) {
  const rlimit memory{kMaxMemory, kMaxMemory};
  setrlimit(RLIMIT_AS, &memory);
  try {
    winUp();
    const rosbag::Bag bag(path, rosbag::bagmode::Read);
    rosbag::View all(bag);
    std::vector<std::uint8_t> data;
    for (const rosbag::MessageInstance& message : all) {
      winUp();
      data.resize(message.size());
      ros::serialization::OStream stream(data.data(), static_cast<std::uint32_t>(data.size()));
      message.write(stream);
    }
    return 0;
  } catch (const std::exception& error) {
    std::puts(printable(error.what(), 200).c_str());
    return 1;
  }
}

// The damage of a bag; empty: none. Throws InputError, with `what`, if no process can be started to
// read it.
std::string damageOf(const std::string& path, const std::string& what) {
  const std::string program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "check_bag";
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) {
    throw InputError(what + " can't be read: no pipe: " + std::strerror(errno));
  }
  const pid_t child = fork();
  if (child == 0) {
    dup2(ends[1], STDOUT_FILENO);
    const int silent = open("/dev/null", O_WRONLY);
    dup2(silent, STDERR_FILENO);
    execl(program.c_str(), program.c_str(), kReason, path.c_str(), static_cast<char*>(nullptr));
    _exit(127);
  }
  close(ends[1]);
  std::string said;
  std::array<char, 512> buffer{};
  ssize_t n = 0;
  while ((n = read(ends[0], buffer.data(), buffer.size())) > 0 || (n < 0 && errno == EINTR)) {
    if (n > 0) said.append(buffer.data(), static_cast<std::size_t>(n));
  }
  close(ends[0]);
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (child > 0 && WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
  if (child < 0 || (WIFEXITED(status) && WEXITSTATUS(status) == 127)) {
    throw InputError(what + " can't be read: the program " + program + " can't be run");
  }
  while (!said.empty() && said.back() == '\n') said.pop_back();
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGVTALRM) said = "it has no end";
  return said.empty() ? "it is damaged" : printable(said, 200);
}

}  // namespace

int runBagCheck(int argc, char** argv) {
  if (argc == 3 && std::strcmp(argv[1], kReason) == 0) return readWhole(argv[2]);
  const bool asked = argc == 2 && std::strcmp(argv[1], "--help") == 0;
  if (argc != 2 || asked) {
    std::fputs(
        "usage: check_bag FILE    reads every message of a bag; exit: 0 whole, 1 damaged, 2 bad "
        "arguments\n",
        asked ? stdout : stderr);
    return asked ? 0 : 2;
  }
  const std::string path = argv[1], shown = printable(path, 1000);
  std::error_code none;
  const bool folder = std::filesystem::is_directory(path, none);
  if (folder || ::access(path.c_str(), R_OK) != 0) {
    std::fprintf(stderr, "check_bag: %s: %s: give a bag that can be read\n", shown.c_str(),
                 folder ? "this is a folder" : std::strerror(errno));
    return 2;
  }
  try {
    const std::string damage = damageOf(path, shown);
    if (damage.empty()) return 0;
    std::fprintf(stderr, "check_bag: %s: %s%s\n", shown.c_str(), damage.c_str(), kRemedy);
  } catch (const InputError& error) {
    std::fprintf(stderr, "check_bag: %s\n", error.what());
  }
  return 1;
}

void checkBag(const std::string& path, const std::string& what) {
  const std::string damage = damageOf(path, what);
  if (!damage.empty()) throw InputError(what + " can't be read: " + damage + kRemedy);
}

}  // namespace assembly_cell::ros_bridge
