// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "assembly_cell/shaker/drive_signal.h"
#include "assembly_cell/shaker/sample_clock.h"
#include "assembly_cell/shaker/shaker.h"
#include "audio_device.h"

namespace assembly_cell {

/// Two voice coils on two channels of a sound card with an amplifier.
class AudioShaker final : public Shaker {
 public:
  void open(const YAML::Node& parameters, double now) override;
  std::string cannot(const ExciterCommand& command) const override;
  void drive(const ExciterCommand& command, double reference, double now) override;
  void work(double now) override;
  ShakerState state(double now) const override;

 private:
  AudioDevice::Settings settings_;
  std::array<std::size_t, 2> channel_{0, 1};        // of the coils along x and y
  Eigen::Vector2d gain_ = Eigen::Vector2d::Zero();  // full scale per newton
  double delay_ = 0.0;                              // of amplifier and coil [s]
  double lead_ = 0.02;                              // written in advance [s]
  std::unique_ptr<AudioDevice> device_;
  DriveSignal signal_;
  SampleClock clock_;
  ShakerState state_;
  double begun_ = 0.0;    // start of an output without a sample rate [s]
  double written_ = 0.0;  // samples, all and since the last work()
  double since_ = 0.0;
  std::vector<std::int16_t> frames_;
};

}  // namespace assembly_cell
