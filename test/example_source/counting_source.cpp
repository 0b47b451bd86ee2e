// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <assembly_cell/sensor/source_parameters.h>
#include <assembly_cell/sensor/strain_source.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdint>
#include <pluginlib/class_list_macros.hpp>

namespace assembly_cell_example {

/// Wrenches that count, one a block: fx is the number of the sample. Keys: rate [Hz], first.
class CountingSource : public assembly_cell::StrainSource {
 public:
  CountingSource() {
    info_.type = "counting";
    info_.device = "a counter";
    info_.serial_number = "counter-1";
    info_.quantity = assembly_cell::SampleQuantity::kWrench;
  }
  ~CountingSource() override { close(); }

 protected:
  void doConfigure(const YAML::Node& map) override {
    assembly_cell::SourceParameters parameters(map, info_.type);
    info_.rate = parameters.number("rate", 1.0, 1e4, 100.0);
    first_ = parameters.integer("first", 0, 1000000, 0);
    parameters.refuseUnknown();
  }

  void doOpen() override {
    ++stream_;
    next_ = Clock::now();
  }

  assembly_cell::ReadResult doRead(assembly_cell::SourceBlock& block,
                                   Clock::time_point deadline) override {
    // the next sample has its time
    if (wait(-1, std::min(next_, deadline)) == Wait::kStopped) {
      return assembly_cell::ReadResult::kClosed;
    }
    if (Clock::now() < next_) return assembly_cell::ReadResult::kTimeout;
    block.count = 1;
    block.values[0] = first_ + static_cast<double>(sample_);
    block.sequence = sample_++;
    block.stream = stream_;
    block.period = 1.0 / info_.rate;
    block.received = {Clock::now(), std::chrono::system_clock::now()};
    ++counts_.samples;
    next_ += std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / info_.rate));
    return assembly_cell::ReadResult::kSamples;
  }

 private:
  int first_ = 0;
  std::uint64_t sample_ = 0;
  std::uint32_t stream_ = 0;
  Clock::time_point next_;
};

}  // namespace assembly_cell_example

PLUGINLIB_EXPORT_CLASS(assembly_cell_example::CountingSource, assembly_cell::StrainSource)
