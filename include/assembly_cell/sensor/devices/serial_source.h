// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "assembly_cell/sensor/descriptor.h"
#include "assembly_cell/sensor/devices/serial_frame.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// A sensor that sends frames over a serial line. Keys: port (a tty), protocol [bota, robotiq],
/// baud, rate [Hz] (nominal, of the frames), block_period [s], receive_timeout [s], start_retries,
/// publish_on_error.
///
/// bota counts losses from the frames' time stamps and the rate. robotiq frames carry no number:
/// losses are estimated from the bytes that were no frame; duplicates can't be detected.
class SerialSource : public StrainSource {
 public:
  SerialSource();
  ~SerialSource() override;
  std::string faultText(std::uint32_t fault) const override;

 protected:
  void doConfigure(const YAML::Node& parameters) override;
  void doOpen() override;
  ReadResult doRead(SourceBlock& block, Clock::time_point deadline) override;
  void doClose() noexcept override;

 private:
  /// A frame that waits to be taken.
  struct Entry {
    std::uint64_t sequence;
    std::uint32_t stream;
    SerialFrame frame;
    Reception received;
  };

  void openPort();
  bool receive();
  void accept(const SerialFrame& frame, const Reception& received);
  bool number(const SerialFrame& frame);
  void startStream() const;
  void stopStream() const;
  ReadResult take(SourceBlock& block);
  void refuseOpen(const std::string& why);

  // parameters
  std::string path_;
  const FrameFormat* format_ = &kBotaFormat;
  int baud_ = 0;
  double rate_ = 0.0;  // [Hz]
  std::chrono::nanoseconds block_period_{}, receive_timeout_{};
  int start_retries_ = 0;
  bool deliver_faulty_ = false;

  Descriptor port_;
  FrameDecoder decoder_{kBotaFormat};
  std::array<Entry, kBlockCapacity> waiting_;  // a ring
  std::size_t first_ = 0, count_ = 0;
  bool faulty_ = false;  // a frame was dropped for its status since the last read
  std::string hangup_;   // why the port is gone

  // numbering
  std::uint64_t sequence_ = 0;  // of the newest frame
  std::uint32_t stream_ = 0;
  bool numbered_ = false;                 // a frame came since the stream began
  std::array<std::uint32_t, 64> seen_{};  // time stamps of the latest frames, a ring
  std::size_t seen_count_ = 0;

  Clock::time_point last_frame_, last_start_;
  int starts_ = 0;  // since the last frame
};

}  // namespace assembly_cell
