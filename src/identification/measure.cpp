// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/measure.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "assembly_cell/align/estimation/vibration_point.h"
#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/align/search/press_controller.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/locus/contact_model.h"

namespace assembly_cell {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kStep = 2.0 * M_PI * 5.0;  // of frequencies, one period in a window [rad/s]
constexpr int kHangingSteps = 9, kPressedSteps = 4;
constexpr double kHangingLow = 0.9, kHangingHigh = 3.6;  // of the first resonance
constexpr double kPressedLow = 0.7, kPressedHigh = 1.6;  // of the operating frequency
constexpr int kHeldOut = 4;                              // every fourth step is left out of the fit
constexpr double kShake = 1.5;        // of the amplitude, while the contact settles
constexpr double kReserve = 0.8;      // of the friction that was found
constexpr double kPushStep = 1.5e-4;  // of the push sideways [m]
constexpr int kPushSteps = 24;
constexpr int kSlideStart = 4, kSlideBlocks = 12;  // of the push: before the mean, and in all
constexpr double kSlides =
    1.05;  // the ratio of three steps over that of three before: less is sliding
// travel of a press per force, ten times a coupling's [m/N]
constexpr double kPressCompliance = 2e-4;
constexpr double kFrictionSd = 0.004;         // the face's lean, to second order
constexpr double kFrictionRelativeSd = 0.03;  // of the coefficient: the sensor's matrix

bool isHum(int multiple) { return multiple == 10 || multiple == 12; }

std::vector<double> steps(double low, double high, int count) {
  std::vector<double> found;
  for (int k = 0; k < count; ++k) {
    const double wanted = low * std::pow(high / low, static_cast<double>(k) / (count - 1));
    int multiple = std::max(1, static_cast<int>(std::lround(wanted / kStep)));
    while (isHum(multiple)) ++multiple;
    const double frequency = multiple * kStep;
    if (found.empty() || frequency > found.back()) found.push_back(frequency);
  }
  return found;
}

// resonance of the peg in the coupling's sideways springs alone [rad/s]
double swayOf(const Mechanism& m) {
  return std::sqrt(0.5 * (m.coupling.stiffness.diagonal[1] + m.coupling.stiffness.diagonal[2]) /
                   m.peg.mass);
}

PressLimits limitsFor(const Mechanism& nominal, const IdentificationPlan& plan) {
  PressLimits limits = pressLimits(nominal);
  limits.force = plan.force_limit;
  limits.compliance = kPressCompliance;
  return limits;
}

class Campaign {
 public:
  Campaign(Plant& plant, const Mechanism& nominal, const IdentificationPlan& plan,
           const std::function<void(const IdentificationProgress&)>& progress)
      : nominal_(nominal),
        plan_(plan),
        progress_(progress),
        carrier_(plant, limitsFor(nominal, plan)),
        press_(carrier_) {
    begin_ = carrier_.last().time;
    carrier_.wait(1);
    block_ = carrier_.last().time - begin_;
  }

  IdentificationData run() {
    report("tare");
    tareFreePeg(carrier_, nominal_);
    X_start_ = poseFromRest(carrier_.sensor().tare().pose);
    hang();
    turn();
    try {
      for (int place = 0; place < plan_.places; ++place) pressAt(place);
    } catch (const AlignError& error) {
      data_.notes.push_back(std::string("pressed: ") + error.what());
      releasePeg(carrier_, nominal_);
    }
    goTo(X_start_);
    data_.time = now();
    return data_;
  }

 private:
  double now() const { return carrier_.last().time - begin_; }
  bool late() const { return now() > plan_.time_limit; }

  void report(const char* state) {
    const std::size_t readings = data_.vibrations.size() + data_.poses.size();
    if (progress_) progress_({state, now(), static_cast<int>(readings)});
  }

  void goTo(const Pose& X) { carrier_.moveTo(restFromPose(X)); }

  void hang() {
    report("hanging");
    int step = 0;
    for (const double frequency : plan_.hanging) {
      ++step;
      for (const int direction : {1, -1}) {
        if (late()) return skipped("hanging");
        VibrationReading reading = readVibration(
            carrier_, {plan_.hanging_force, frequency, 0.0, direction}, plan_.swing, plan_.window);
        reading.R_BS = X_start_.R;
        reading.held_out = (step + (direction > 0 ? 0 : 2)) % kHeldOut == 0;
        data_.vibrations.push_back(reading);
        report("hanging");
      }
    }
    exciterOff(carrier_);
  }

  void turn() {
    Pose up = X_start_;
    up.p.z() += plan_.lift;
    goTo(up);
    const double t = plan_.turn;
    for (const Vector2d& tilt : {Vector2d(0, 0), Vector2d(t, 0), Vector2d(-t, 0), Vector2d(0, -t),
                                 Vector2d(0, t), Vector2d(0, 0)}) {
      if (late()) return skipped("gravity");
      Pose turned = up;
      turned.R = X_start_.R * rotationFromVector({Vector3d(tilt.x(), tilt.y(), 0.0)});
      goTo(turned);
      const int blocks = blocksIn(plan_.window);
      carrier_.tare(blocks);
      PoseReading reading;
      reading.R_BS = turned.R;
      // the zero that was taken: of the last blocks
      reading.time = now() - 0.5 * block_ * blocks;
      reading.wrench = carrier_.last().wrench_b - carrier_.sensor().wrench();
      const double samples = std::max(1, carrier_.last().samples) * blocks;
      reading.covariance = carrier_.sensor().tare().scatter / samples + carrier_.last().rounding_b;
      data_.poses.push_back(reading);
      report("gravity");
    }
  }

  int blocksIn(double duration) const {
    return std::max(1, static_cast<int>(std::lround(duration / block_)));
  }

  void skipped(const char* what) {
    data_.notes.push_back(text("%s: cut short at %.0f s of cell time", what, plan_.time_limit));
  }

  // Tares the tilted peg beside the hole, its low side outward, then presses it on the face.
  void touch(const Vector2d& outward) {
    R_touch_ = tareBeside(carrier_, nominal_, X_start_,
                          {outward, plan_.beside, plan_.tilt, blocksIn(plan_.window)});
    zero_taken_ = now() - 0.5 * plan_.window;
    press_.approach(-1e9);
    press_.hold(plan_.press, 0.05);
  }

  void lift() {
    exciterOff(carrier_);
    RestPose up = carrier_.target();
    up.z = std::max(up.z, press_.touchZ()) + 5e-4;
    carrier_.moveTo(up);
  }

  void pressAt(int place) {
    if (late()) return skipped("pressed");
    report("pressed");
    const double azimuth = 2.0 * M_PI * place / plan_.places;
    const Vector2d outward(std::cos(azimuth), std::sin(azimuth));
    if (place == 0) {
      touch(outward);
      push(outward);
      lift();
    }
    touch(outward);
    const double friction = kReserve * (data_.friction ? data_.friction->coefficient
                                                       : nominal_.friction.static_coefficient);
    int step = place;
    for (const double frequency : plan_.pressed) {
      ++step;
      const double amplitude = amplitudeAt(frequency, friction);
      for (const int direction : {1, -1}) {
        if (late()) break;
        shake({kShake * amplitude, frequency, 0.0, direction});
        VibrationReading reading = readVibration(carrier_, {amplitude, frequency, 0.0, direction},
                                                 plan_.settle, plan_.window);
        reading.place = place;
        reading.since_zero = now() - 0.5 * plan_.window - zero_taken_;
        reading.R_BS = R_touch_;
        reading.held_out = (step + (direction > 0 ? 0 : 2)) % kHeldOut == 0;
        data_.vibrations.push_back(reading);
        report("pressed");
      }
    }
    lift();
  }

  // with a larger amplitude than the measurement, so that no preload near the friction limit is
  // left
  void shake(const ExciterParameters& exciter) {
    PlantCommand command;
    command.exciter = exciter;
    carrier_.step(command);
    carrier_.wait(blocksIn(0.5 * plan_.settle));
  }

  // amplitude that friction sustains [N]
  double amplitudeAt(double frequency, double friction) const {
    VibrationDemand demand;
    demand.given = {frequency, 0.0, plan_.press, 0.0};
    demand.tilt = plan_.tilt;
    demand.shake = kShake;
    demand.max_press = plan_.press;
    demand.friction = friction;
    demand.window = plan_.window;
    demand.samples = std::max(8.0, carrier_.last().samples * plan_.window / block_);
    demand.scatter = carrier_.sensor().tare().scatter;
    demand.rounding = carrier_.last().rounding_b;
    return chooseVibration(nominal_, demand).amplitude;
  }

  // friction force along −`along` over the normal force
  double ratio(const Vector3d& along) const {
    const Vector3d force = R_touch_ * carrier_.force();
    return -force.dot(along) / std::max(0.1, force.z());
  }

  // tangential over normal force
  double coefficient() const {
    const Vector3d force = R_touch_ * carrier_.force();
    return force.head<2>().norm() / std::max(0.1, force.z());
  }

  // one step sideways of the push
  static void advance(RestPose& at, const Vector3d& along) {
    at.x += kPushStep * along.x();
    at.y += kPushStep * along.y();
    at.z += kPushStep * along.z();
  }

  // Pushes sideways across the tilt until the ratio rises no more, so the peg slides; the ratio is
  // averaged over three steps, as the carrier ends its steps within tens of micrometres.
  std::optional<double> slide(const Vector3d& along) {
    RestPose at = carrier_.target();
    std::vector<double> ratios;
    for (int k = 0; k < kPushSteps; ++k) {
      advance(at, along);
      carrier_.moveTo(at);
      carrier_.wait(1);
      ratios.push_back(ratio(along));
      if (k < 7) continue;
      const auto sum = [&](int from) {
        return std::accumulate(ratios.end() - 1 - from, ratios.end() + 2 - from, 0.0);
      };
      const double late = sum(2), early = sum(5);
      if (late > 0.0 && late < kSlides * early) return sliding(at, along);
    }
    return {};
  }

  // Coefficient during sliding, step after step without a stop: after a stop friction has braked
  // the peg, and the force no longer shows sliding friction.
  double sliding(RestPose at, const Vector3d& along) {
    double sum = 0.0;
    for (int k = 0; k < kSlideBlocks; ++k) {
      advance(at, along);
      PlantCommand command;
      command.rest = at;
      carrier_.step(command);
      if (k >= kSlideStart) sum += coefficient() / (kSlideBlocks - kSlideStart);
    }
    carrier_.moveTo(at);
    return sum;
  }

  void push(const Vector2d& outward) {
    report("push");
    const Vector3d along = X_start_.R * Vector3d(-outward.y(), outward.x(), 0.0);
    // the first push removes the strain left by pressing; the mean of both senses removes the
    // face's tilt
    slide(along);
    const std::optional<double> fro = slide(-along);
    const std::optional<double> to = fro ? slide(along) : std::nullopt;
    if (to && fro) {
      const double coefficient = 0.5 * (*to + *fro);
      data_.friction =
          FrictionReading{coefficient, std::hypot(kFrictionSd, kFrictionRelativeSd * coefficient)};
    } else {
      data_.notes.push_back("push: the peg did not slide");
    }
  }

  const Mechanism& nominal_;
  const IdentificationPlan& plan_;
  const std::function<void(const IdentificationProgress&)>& progress_;
  GuardedCarrier carrier_;
  PressController press_;
  double begin_ = 0.0, block_ = 0.02;
  Pose X_start_;
  Matrix3d R_touch_ = Matrix3d::Identity();
  double zero_taken_ = 0.0;  // of the last touch [s]
  IdentificationData data_;
};

}  // namespace

IdentificationPlan planFor(const Mechanism& nominal) {
  IdentificationPlan plan;
  const double sway = swayOf(nominal);
  plan.hanging = steps(kHangingLow * sway, kHangingHigh * sway, kHangingSteps);
  const double contact = operatingFrequency(nominal, plan.press);
  plan.pressed = steps(kPressedLow * contact, kPressedHigh * contact, kPressedSteps);
  return plan;
}

Matrix3d tareBeside(GuardedCarrier& carrier, const Mechanism& mechanism, const Pose& start,
                    const PlaceBeside& place) {
  const Vector2d& to = place.outward;
  const Matrix3d R = start.R * rotationFromVector({place.tilt * Vector3d(-to.y(), to.x(), 0.0)});
  const double length = mechanism.peg.half_height + mechanism.peg.coupling_height;
  Pose above{R, start.p};
  // the bottom swings inward when the peg leans outward
  const Vector3d axis = start.R.transpose() * R.col(2);
  above.p += start.R * (place.beside * Vector3d(to.x(), to.y(), 0.0) +
                        length * Vector3d(axis.x(), axis.y(), 0.0));
  above.p.z() = std::max(above.p.z(), carrier.target().z) + kClearFace;
  RestPose up = carrier.target();
  up.z = above.p.z();
  carrier.moveTo(up);
  carrier.moveTo(restFromPose(above));
  carrier.tare(place.blocks);
  return R;
}

VibrationReading readVibration(GuardedCarrier& carrier, const ExciterParameters& exciter,
                               double settle, double window) {
  constexpr double kSpare = 0.5;  // beyond the window [s]
  PlantCommand command;
  command.exciter = exciter;
  carrier.step(command);
  for (const double end = carrier.last().time + settle; carrier.last().time < end;) carrier.wait(1);
  command = {};
  const double start = carrier.last().time;
  command.vibration = LocusRequest{start, window};
  carrier.step(command);
  while (!carrier.last().vibration) {
    const double begun = std::max(start, carrier.last().reading_start);
    if (carrier.last().time > begun + window + kSpare) {
      throw AlignError(AlignFailure::kNoReading, "the plant gave no reading of sensor_b's wrench");
    }
    carrier.wait(1);
  }
  const HarmonicFit& fit = *carrier.last().vibration;
  VibrationReading reading;
  reading.exciter = exciter;
  reading.phasor = fit.phasor;
  reading.covariance = 0.5 * fit.scatter.trace() * fit.noise;
  reading.contact = fit.offset - (carrier.last().wrench_b - carrier.sensor().wrench());
  return reading;
}

IdentificationData measure(Plant& plant, const Mechanism& nominal, const IdentificationPlan& plan,
                           const std::function<void(const IdentificationProgress&)>& progress) {
  return Campaign(plant, nominal, plan, progress).run();
}

}  // namespace assembly_cell
