// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/sensor/devices/netft_configuration.h"
#include "device_codecs.h"

namespace assembly_cell {

/// Devices for tests and for trying the driver without hardware: they speak the devices' protocols
/// on loopback, on pseudo-terminals and in a folder like sysfs.

/// What every emulator measures: channel k of sample n, [N] or [N·m]; small whole numbers of 0.01,
/// exact in every format and different for neighbours, so that a test knows a sample by its number.
double emulatedValue(std::uint64_t n, std::size_t channel);

/// From 0 to 1, evenly.
double chance(std::mt19937_64& random);

/// Calls `emit` every millisecond with the number of samples that are due at a rate [Hz].
void emitAtRate(double rate, const std::atomic<bool>& stop,
                const std::function<void(std::size_t)>& emit);

/// What a link does to records. Chances are of one record; a reordered one goes out after the next
/// 1 … 4.
struct LinkFaults {
  double loss = 0.0;
  double duplication = 0.0;
  double reordering = 0.0;
};

/// A Net F/T box on loopback: RDT over UDP, its configuration over HTTP. Records go out at a rate,
/// or one by one on request of a test.
class NetftEmulator {
 public:
  struct Options {
    std::string bind_address = "127.0.0.1";
    int port = 0;       ///< 0: any free one
    int http_port = 0;  ///< 0: any free one; −1: no HTTP
    double rate = 0.0;  ///< [Hz]; 0: records go out by emit() alone
    NetftConfiguration configuration{1e6, 1e6, "N", "Nm", true, 7000.0, "EMU-1", "1"};
    LinkFaults faults;
    std::uint64_t seed = 1;
    std::uint32_t first_sequence = 1;  ///< of a stream
    std::array<double, 6> load{};      ///< added to the samples [N], [N·m]; what a bias takes away
    std::function<std::array<double, 6>()> measure;  ///< load of each sample; none: `load`
    double amplitude = 1.0;                          ///< of the samples
    bool onrobot = false;  ///< an OnRobot HEX box: bias by a sample count of 255, off by 0
  };

  /// Throws SourceError when a port can't be had.
  explicit NetftEmulator(const Options& options);
  ~NetftEmulator();

  int port() const { return port_; }
  int httpPort() const { return http_port_; }

  /// Sends the next `count` records to the client, with the link's faults. Counts nothing while no
  /// client has asked for a stream, and returns false.
  bool emit(std::size_t count);
  /// Sends what the link still holds back.
  void flush();
  /// Sends a datagram as it is.
  bool sendRaw(const std::vector<std::uint8_t>& data);
  /// A record as emit() would make it, without sending it.
  RdtRecord record(std::uint32_t rdt_sequence, std::uint64_t sample) const;

  void setFaults(const LinkFaults& faults);
  void setStatus(std::uint32_t status) { status_ = status; }
  void setStalled(bool stalled) { stalled_ = stalled; }  ///< one measurement again and again
  void setUnnumbered(bool unnumbered) { unnumbered_ = unnumbered; }  ///< ft_sequence is constant
  void setFrozen(bool frozen) { frozen_ = frozen; }  ///< old counts under new numbers
  void setDead(bool dead) { dead_ = dead; }          ///< no answer, as without power
  void ignoreStarts(int count) { ignored_starts_ = count; }
  void ignoreBiases(int count) { ignored_biases_ = count; }
  void setHttpResponse(const std::string& response);  ///< instead of the configuration
  void setConfiguration(
      const NetftConfiguration& configuration);  ///< of page and counts, from now on
  /// A slow page: parts of so many bytes, a pause before each. keep_open: afterwards the connection
  /// stays open for 20 pauses. 0 bytes: everything at once.
  void setHttpPace(std::size_t bytes, std::chrono::milliseconds pause, bool keep_open = false);
  /// As after power came back: counters from the start, no client.
  void restart();

  // what happened
  std::uint64_t sent() const { return sent_; }  ///< numbers used up since start of the object
  std::uint64_t lost() const { return lost_; }
  std::uint64_t duplicated() const { return duplicated_; }
  std::uint64_t reordered() const { return reordered_; }
  int starts() const { return starts_; }
  int stops() const { return stops_; }
  int biases() const { return biases_; }
  bool streaming() const;
  int clientPort() const;  ///< the latest client's; 0: none yet

 private:
  struct Sockets;

  std::array<std::int32_t, 6> counts(const std::array<double, 6>& values) const;
  void serveRequests();
  void serveHttp();
  bool sendPage(int connection);
  void send(const std::array<std::uint8_t, kRdtRecordSize>& data);
  bool emitLocked(std::size_t count);
  void flushLocked();

  Options options_;
  std::unique_ptr<Sockets> sockets_;
  int port_ = 0, http_port_ = 0;
  mutable std::mutex mutex_;  // of the stream
  std::mt19937_64 random_;
  bool streaming_ = false;
  std::uint32_t rdt_sequence_ = 0;  // of the next record
  std::uint32_t ft_sequence_ = 0;
  std::uint64_t sample_ = 0;
  std::array<std::int32_t, 6> bias_{};
  std::array<std::int32_t, 6> last_counts_{};
  std::string http_response_;
  std::size_t http_part_ = 0;
  std::chrono::milliseconds http_pause_{0};
  bool http_keep_open_ = false;
  /// A record under way, and how many others it lets pass.
  struct Held {
    std::array<std::uint8_t, kRdtRecordSize> data;
    int pass;
  };
  std::vector<Held> held_;
  std::atomic<std::uint32_t> status_{0};
  std::atomic<bool> unnumbered_{false}, frozen_{false};
  std::atomic<bool> stalled_{false}, dead_{false}, stopping_{false};
  std::atomic<int> ignored_starts_{0}, ignored_biases_{0};
  std::atomic<std::uint64_t> sent_{0}, lost_{0}, duplicated_{0}, reordered_{0};
  std::atomic<int> starts_{0}, stops_{0}, biases_{0};
  std::thread requests_, http_, streaming_thread_;
};

/// A serial sensor behind a pseudo-terminal; `path` is a link to it that stays when it's unplugged
/// and plugged in again.
class SerialEmulator {
 public:
  struct Options {
    bool robotiq = false;        ///< else Bota
    std::string link;            ///< path of the link; empty: in a folder of its own
    double rate = 0.0;           ///< [Hz]; 0: frames go out by emit() alone
    double device_rate = 400.0;  ///< of its time stamps [Hz]
    LinkFaults faults;           ///< loss alone
    std::uint64_t seed = 1;
  };

  /// Throws SourceError when there's no pseudo-terminal.
  explicit SerialEmulator(const Options& options);
  ~SerialEmulator();

  const std::string& path() const { return link_; }

  /// Sends the next frames. False: unplugged, or (Robotiq) the stream wasn't requested.
  bool emit(std::size_t count);
  /// The bytes of the frame of a sample; emit() sends these.
  std::vector<std::uint8_t> frame(std::uint64_t sample) const;
  /// Sends bytes as they are, and waits while the terminal is full.
  bool sendRaw(const std::vector<std::uint8_t>& bytes);
  /// Passes over samples: the device measured them but they got lost.
  void skip(std::uint64_t samples);
  std::uint64_t sample() const;  ///< number of the next frame

  void setStatus(std::uint32_t status) { status_ = status; }
  void setStalled(bool stalled);  ///< time stamps stand still
  void setDead(bool dead) { dead_ = dead; }
  void unplug();
  void plug();
  bool streaming() const { return streaming_; }
  int starts() const { return starts_; }
  int stops() const { return stops_; }

 private:
  void listen();
  bool sendLocked(const std::vector<std::uint8_t>& bytes);

  Options options_;
  std::string folder_, link_;
  mutable std::mutex mutex_;
  int terminal_ = -1;
  std::uint64_t sample_ = 0;
  std::mt19937_64 random_;
  std::vector<std::uint8_t> received_;
  std::atomic<std::uint32_t> status_{0};
  std::atomic<std::uint64_t> latest_stamp_;  // sample whose time stamp none goes beyond
  std::atomic<bool> dead_{false}, stopping_{false}, streaming_{false};
  std::atomic<int> starts_{0}, stops_{0};
  std::thread listener_, streaming_thread_;
};

/// A folder as sysfs shows a converter of six bridge channels.
class IioEmulator {
 public:
  struct Options {
    std::string root;  ///< empty: a folder of its own
    std::string name = "ad7124-8";
    double scale = 0.000298023;  ///< [mV] per code
    double offset = -8388608.0;  ///< codes
  };

  explicit IioEmulator(const Options& options);
  ~IioEmulator();

  const std::string& root() const { return root_; }
  std::string device() const { return "iio:device0"; }

  /// The channels' codes from now on.
  void set(const std::array<std::int64_t, 6>& codes);
  /// A channel's text from now on, whatever it is.
  void setText(std::size_t channel, const std::string& text);
  void unplug();
  void plug();

 private:
  void write(const std::string& name, const std::string& text) const;

  Options options_;
  std::string root_;
  bool own_ = false;
  std::array<std::string, 6> texts_;
};

/// A folder of one's own below the system's temporary one.
std::string makeTemporaryFolder();

}  // namespace assembly_cell
