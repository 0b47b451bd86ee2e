// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "assembly_cell/sensor/devices/netft_configuration.h"
#include "assembly_cell/sensor/devices/rdt.h"
#include "assembly_cell/sensor/statistics.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// A Net F/T box, or anything else that streams RDT records over UDP. Keys: address (IPv4), port,
/// bind_address (this computer's, loopback by default), configuration [http, parameters]; http:
/// http_port, configuration_period [s] (the box's configuration is read again so often; 0: never);
/// parameters: counts_per_force, counts_per_torque, force_unit, torque_unit; rate [Hz] (of the
/// records, if the box doesn't report it), block_period [s], receive_timeout [s], start_retries,
/// publish_on_error, drop_stale.
class NetftSource : public StrainSource {
 public:
  NetftSource();
  ~NetftSource() override;
  std::string faultText(std::uint32_t fault) const override;

 protected:
  void doConfigure(const YAML::Node& parameters) override;
  void doOpen() override;
  ReadResult doRead(SourceBlock& block, Clock::time_point deadline) override;
  void doClose() noexcept override;
  bool hasDeviceBias() const override { return true; }

 private:
  struct Socket;  // and the buffers of its datagrams

  NetftConfiguration readConfiguration() const;
  void watchConfiguration(const NetftConfiguration& opened);
  void noteRestart(Clock::time_point now);
  void send(RdtCommand command) const;
  void receive();
  std::chrono::nanoseconds idle() const;
  Clock::time_point napUntil() const;
  void watchBias(const SourceBlock& block);

  // parameters
  std::string address_, bind_address_;
  int port_ = 0, http_port_ = 0;
  bool over_http_ = true;
  NetftConfiguration given_;
  double given_rate_ = 0.0;  // [Hz], 0: the box's
  std::chrono::nanoseconds block_period_{}, receive_timeout_{}, configuration_period_{};
  int start_retries_ = 0;
  RdtPolicy policy_;

  std::unique_ptr<Socket> socket_;
  std::unique_ptr<RdtStream> stream_;
  std::size_t block_samples_ = 0;  // that make a block; 0: by time
  Clock::time_point last_record_, last_start_;
  Clock::time_point drained_;                    // when the socket was last found empty
  int starts_ = 0;                               // sent since the last record
  std::array<Clock::time_point, 3> restarts_{};  // the latest, oldest first
  std::uint64_t unnumbered_ = 0;                 // total at the latest sample

  // bias in the device
  Clock::time_point bias_sent_;
  int bias_attempts_ = 0;  // 0: none under way
  std::array<Moments, 2> bias_halves_;

  // reads the configuration again while the source is open
  std::thread watch_;
  std::mutex watch_mutex_;
  std::string change_;  // of the configuration, if changed_
  std::atomic<bool> changed_{false};
  std::atomic<std::uint64_t> unread_{0};
};

}  // namespace assembly_cell
