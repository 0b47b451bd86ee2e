// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <assembly_cell/base/text.h>
#include <assembly_cell/base/yaml_section.h>
#include <assembly_cell/shaker/shaker.h>

#include <pluginlib/class_list_macros.hpp>

namespace assembly_cell_example {

/// A shaker that follows its commands at once. Key: largest, amplitude [N].
class IdealShaker : public assembly_cell::Shaker {
 public:
  void open(const YAML::Node& parameters, double now) override {
    (void)now;
    assembly_cell::yaml::Section in(parameters, "", "shaker", assembly_cell::yaml::Wording::kIs);
    in.optional("type");
    largest_ = in.number("largest", assembly_cell::yaml::Range::kPositive);
    in.finish();
  }
  std::string cannot(const assembly_cell::ExciterCommand& command) const override {
    if (command.amplitude <= largest_) return {};
    return assembly_cell::text("amplitude is %g N: give at most %g (largest)", command.amplitude,
                               largest_);
  }
  void drive(const assembly_cell::ExciterCommand& command, double reference, double now) override {
    (void)now;
    state_.on = command.amplitude > 0.0;
    state_.force = command;
    state_.reference = reference;
  }
  void work(double now) override { (void)now; }
  assembly_cell::ShakerState state(double now) const override {
    (void)now;
    return state_;
  }

 private:
  double largest_ = 0.0;
  assembly_cell::ShakerState state_;
};

}  // namespace assembly_cell_example

PLUGINLIB_EXPORT_CLASS(assembly_cell_example::IdealShaker, assembly_cell::Shaker)
