// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "audio.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"

namespace assembly_cell {

void AudioShaker::open(const YAML::Node& parameters, double now) {
  yaml::Section in(parameters, "", "shaker", yaml::Wording::kIs);
  in.optional("type");
  settings_.device = in.text("device", "give an ALSA name, as default or hw:1");
  settings_.rate = static_cast<unsigned>(in.integer("rate", 8000, 192000, 48000));
  settings_.channels = static_cast<unsigned>(in.integer("channels", 2, 32, 2));
  const auto last = static_cast<std::int64_t>(settings_.channels) - 1;
  channel_[0] = static_cast<std::size_t>(in.integer("channel_x", 0, last, 0));
  channel_[1] = static_cast<std::size_t>(in.integer("channel_y", 0, last, 1));
  if (channel_[0] == channel_[1]) {
    in.refuse("channel_y", static_cast<double>(channel_[1]), "give another one than channel_x");
  }
  gain_(0) = in.number("gain_x", -1e3, 1e3);
  gain_(1) = in.number("gain_y", -1e3, 1e3);
  for (int i = 0; i < 2; ++i) {
    if (gain_(i) != 0.0) continue;
    in.refuse(i == 0 ? "gain_x" : "gain_y", 0.0, "give the part of full scale that makes 1 N");
  }
  delay_ = in.number("delay", 0.0, 0.1, 0.0);
  lead_ = in.number("lead", 0.005, 0.2, lead_);
  signal_.ramp = in.number("ramp", 0.0, 1.0, signal_.ramp);
  in.finish();
  settings_.buffer = std::max(0.05, 2.0 * lead_);
  device_ = std::make_unique<AudioDevice>(settings_);
  clock_.nominal = clock_.period = 1.0 / settings_.rate;
  begun_ = now;
}

std::string AudioShaker::cannot(const ExciterCommand& command) const {
  const double full_scale = 1.0 / gain_.cwiseAbs().maxCoeff();
  if (command.amplitude > full_scale) {
    return text("amplitude is %g N, full scale is %g N: give less, or another gain_x and gain_y",
                command.amplitude, full_scale);
  }
  const double highest = M_PI * settings_.rate;
  if (command.frequency < highest) return {};
  return text("frequency is %g rad/s: give less than %g, half the rate", command.frequency,
              highest);
}

void AudioShaker::drive(const ExciterCommand& command, double reference, double now) {
  // queued samples can't be changed
  const double from = clock_.known ? std::max(clock_.next, now) : now;
  assembly_cell::drive(signal_, command, reference, from + delay_);
  state_.on = command.amplitude > 0.0;
  state_.force = command;
  state_.reference = reference;
  state_.latency = from + delay_ - now;
}

void AudioShaker::work(double now) {
  const double rate = settings_.rate;
  const double queued = device_->hasRate() ? device_->queued() : written_ - rate * (now - begun_);
  observe(clock_, now + std::max(0.0, queued) * clock_.period, since_);
  since_ = 0.0;
  double wanted = std::ceil(rate * lead_ - queued);
  // an output without a sample rate skips what it has missed
  if (!device_->hasRate() && queued < 0.0) begun_ = now - written_ / rate;
  wanted = std::min({wanted, rate * lead_, static_cast<double>(device_->available())});
  if (wanted < 1.0) return;
  const auto n = static_cast<std::size_t>(wanted);
  frames_.assign(n * settings_.channels, 0);
  removeFaded(signal_, clock_.next + delay_);
  if (signal_.count > 0) {
    for (std::size_t i = 0; i < n; ++i) {
      // during a change the sum of both commands may exceed full scale
      const Eigen::Vector2d volts = gain_.cwiseProduct(
          forceAt(signal_, clock_.next + delay_ + static_cast<double>(i) * clock_.period));
      for (std::size_t k = 0; k < 2; ++k) {
        const double level = std::clamp(volts(static_cast<Eigen::Index>(k)), -1.0, 1.0);
        frames_[i * settings_.channels + channel_[k]] =
            static_cast<std::int16_t>(std::lround(32767.0 * level));
      }
    }
  }
  device_->write(frames_);
  clock_.next += static_cast<double>(n) * clock_.period;
  written_ += static_cast<double>(n);
  since_ = static_cast<double>(n);
}

ShakerState AudioShaker::state(double now) const {
  (void)now;
  ShakerState state = state_;
  state.gaps = device_->gaps() + clock_.jumps;
  return state;
}

}  // namespace assembly_cell
