// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/arm_response.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/align/search/press_controller.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/mechanism/compliance.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Periods of the chirp's sines in one of the chirp. Up to 2.4 Hz: at twice that a lag of 50 ms is
// no short one any more; at half the delay's sd doubles.
constexpr std::array<int, 5> kLines{1, 2, 3, 4, 6};
// Their phases [rad], by which the sum has the smallest peak.
constexpr std::array<double, 5> kPhases{0.0, 4.7, 1.21, 1.22, 0.27};
constexpr double kPeak = 2.43;
// Frequencies that it leaves out: forces there are distortion.
constexpr std::array<int, 3> kEmptyLines{5, 7, 8};
constexpr int kMinPerPeriod = 40;  // blocks

constexpr double kMeanForce = 2.5;      // in contact, of the amplitude: a stiffer mount stays there
constexpr double kForceShare = 0.45;    // of the force limit, at most
constexpr double kMinAmplitude = 5e-6;  // of a command that arms still resolve [m]
constexpr double kLeastHeld = 0.8, kMostHeld = 1.5;  // of it: arms end moves 30 um off
constexpr int kHolds = 20;                           // touches and corrections
constexpr double kVanished = 0.3;                    // of a touch: a swing that only seemed one
constexpr double kLongest = CarrierDelay::kMost * kStepTime;  // delay that strategies work with [s]
// Relative sd of a mount's compliance as drawn, which corrects for the tilt.
constexpr double kDrawnSd = 0.1;
// Speed of the chirp, root mean square, times its period over its amplitude.
constexpr double kRootMeanStep = 14.8;
// Square of a move's time at an acceleration of 1, over its length: quintic.
constexpr double kMoveOfStep = 5.7735;
// A response beyond these is none.
constexpr double kMaxRelativeSd = 0.1, kMaxDelaySd = 0.02;

double lightForce(const Mechanism& nominal) { return kTouchForce * scaleOf(nominal).force; }

// Amplitude of the force: a light touch, or less within the force limit.
double amplitudeWithin(double touch, double force_limit) {
  return std::min(touch, kForceShare * force_limit / (kMeanForce + 1.0));
}

// Contact wrench, a mean over the last steps of a wait.
Vector6 wrenchAfter(GuardedCarrier& carrier, double rest) {
  constexpr int kMean = 5;
  for (const double end = carrier.last().time + rest; carrier.last().time < end;) carrier.wait(1);
  Vector6 sum = Vector6::Zero();
  for (int i = 0; i < kMean; ++i) {
    carrier.wait(1);
    sum += carrier.sensor().wrench() / kMean;
  }
  return sum;
}

// Contact on the bottom's edge of a peg with axes R in the carrier's base.
struct EdgeContact {
  Vector3d path;            // of the carrier for a force along the normal, its z is 1; base axes
  double compliance = 0.0;  // along the normal [m/N]
};

EdgeContact edgeContact(const Mechanism& m, const Matrix3d& R, const Vector6& wrench) {
  // where the line of action meets the bottom, carrier axes
  const double z = -(m.peg.half_height + m.peg.coupling_height);
  const Vector3d f = wrench.head<3>(), t = wrench.tail<3>();
  Vector3d point((z * f.x() - t.y()) / f.z(), (t.x() + z * f.y()) / f.z(), z);
  const double reach = point.head<2>().norm();
  if (reach > 0.0) point.head<2>() *= tipRadius(m.peg) / reach;
  Eigen::Matrix<double, 3, 6> J;
  J << Matrix3d::Identity(), -skew(point);
  Matrix3d C = R * J * couplingCompliance(m.coupling) * J.transpose() * R.transpose();
  // the carrier's own springs, base axes
  const Vector3d lever = Vector3d::UnitZ().cross(R * point);
  for (int i = 0; i < 2; ++i) {
    if (m.carrier.stiffness[i] > 0.0) C(i, i) += 1.0 / m.carrier.stiffness[i];
  }
  if (m.carrier.stiffness[2] > 0.0) C += lever * lever.transpose() / m.carrier.stiffness[2];
  const Vector3d yields = C.col(2);
  return {yields / yields.z(), yields.z()};
}

// The carrier `travel` [m] towards the face from a pose.
RestPose moved(RestPose pose, const Vector3d& path, double travel) {
  pose.x -= travel * path.x();
  pose.y -= travel * path.y();
  pose.z -= travel * path.z();
  return pose;
}

// Time after which even the latest arm has come to rest.
double restOf(const GuardedCarrier& carrier) {
  return kLongest + carrier.limits().scale.timed(1) * carrier.last().length;
}

// Presses lightly with a mean force on the edge of a peg with axes R; returns the contact.
EdgeContact holdMean(GuardedCarrier& carrier, PressController& press, const Mechanism& nominal,
                     const Matrix3d& R, double force) {
  double measured = 0.0;
  for (int i = 0; i < kHolds; ++i) {
    const Vector6 wrench = wrenchAfter(carrier, restOf(carrier));
    measured = wrench.head<3>().dot(R.row(2));
    if (!(wrench(2) > kVanished * carrier.sensor().touchForce())) {
      press.approach(-1e9);
      continue;
    }
    const EdgeContact contact = edgeContact(nominal, R, wrench);
    if (measured >= kLeastHeld * force && measured <= kMostHeld * force) return contact;
    carrier.nudge(moved(carrier.target(), contact.path, (force - measured) * contact.compliance));
  }
  throw AlignError(AlignFailure::kPressNotHeld, text("%.3g N instead of %.3g N", measured, force));
}

// Phasors of command and force at lines of one period, kLines and then kEmptyLines.
struct Phasors {
  std::vector<Complex> command, force;
};

Phasors phasorsOf(const std::vector<ArmSample>& samples, double begin, double period) {
  std::vector<const ArmSample*> own;
  for (const ArmSample& sample : samples) {
    if (sample.time >= begin - 1e-9 && sample.time < begin + period - 1e-9) own.push_back(&sample);
  }
  if (static_cast<int>(own.size()) < kMinPerPeriod) {
    throw AlignError(AlignFailure::kNoReading, text("%d blocks in a period of the chirp of %.3g s",
                                                    static_cast<int>(own.size()), period));
  }
  const auto n = static_cast<Eigen::Index>(own.size());
  constexpr Eigen::Index kColumns = 2 + 2 * (kLines.size() + kEmptyLines.size());
  MatrixXd basis(n, kColumns), values(n, 2);
  for (Eigen::Index i = 0; i < n; ++i) {
    const ArmSample& sample = *own[static_cast<std::size_t>(i)];
    const double t = (sample.time - begin) / period;
    basis.row(i).head<2>() << 1.0, t - 0.5;
    Eigen::Index column = 2;
    const auto add = [&](int line) {
      basis(i, column++) = std::cos(2.0 * M_PI * line * t);
      basis(i, column++) = std::sin(2.0 * M_PI * line * t);
    };
    for (const int line : kLines) add(line);
    for (const int line : kEmptyLines) add(line);
    values.row(i) << sample.command, sample.force;
  }
  const MatrixXd found = basis.colPivHouseholderQr().solve(values);
  Phasors phasors;
  for (Eigen::Index row = 2; row < kColumns; row += 2) {
    phasors.command.emplace_back(found(row, 0), -found(row + 1, 0));
    phasors.force.emplace_back(found(row, 1), -found(row + 1, 1));
  }
  return phasors;
}

// Limit at frequency 0, its variance by the values' sds, and its change by the last term.
struct Limit {
  double value = 0.0, sd = 0.0;
};

// `values` over x: polynomial of x², times x for odd ones, whose limit is the slope.
Limit limitOf(const VectorXd& x, const VectorXd& values, const VectorXd& sds, bool odd) {
  const auto solve = [&](Eigen::Index terms, double& variance) {
    MatrixXd basis(x.size(), terms);
    for (Eigen::Index k = 0; k < terms; ++k) {
      basis.col(k) = x.array().pow(static_cast<double>(2 * k + (odd ? 1 : 0))) / sds.array();
    }
    const MatrixXd information = basis.transpose() * basis;
    const MatrixXd covariance = information.inverse();
    variance = covariance(0, 0);
    const VectorXd weighted = values.cwiseQuotient(sds);
    return (covariance * (basis.transpose() * weighted))(0);
  };
  double variance = 0.0, unused = 0.0;
  const double found = solve(3, variance), shorter = solve(2, unused);
  return {found, std::hypot(std::sqrt(variance), found - shorter)};
}

}  // namespace

void checkArmPlan(const Mechanism& nominal, const ArmPlan& plan) {
  const double stiffness = 1.0 / pressCompliance(nominal), share = kForceShare * plan.force_limit;
  const double least = (kMeanForce + 1.0) * kMinAmplitude * stiffness;
  if (least <= share) return;
  throw InputError(
      text("coupling.stiffness: the mount yields %.3g um/N at the peg's edge: a chirp of %.2g um ",
           1e6 / stiffness, 1e6 * kMinAmplitude) +
      text("presses with up to %.3g N, beyond %g of force_limit, %g N; ", least, kForceShare,
           share) +
      text("give it %.3g um/N or more, or a higher force_limit",
           1.01e6 * (kMeanForce + 1.0) * kMinAmplitude / share));
}

double chirpAt(double time, double period) {
  double sum = 0.0;
  for (std::size_t i = 0; i < kLines.size(); ++i) {
    sum += std::sin(2.0 * M_PI * kLines[i] * time / period + kPhases[i]);
  }
  return sum / kPeak;
}

std::string armLine(const ArmResponse& arm) {
  return text("arm: {delay: %.5f, delay_sd: %.2g, ", arm.delay, arm.delay_sd) +
         text("stiffness: %.5g, stiffness_sd: %.2g}", arm.stiffness, arm.stiffness_sd);
}

ArmRecording recordArm(Plant& plant, const Mechanism& nominal, const ArmPlan& plan,
                       const std::function<double(double)>& travel, double duration,
                       const std::function<void(const IdentificationProgress&)>& progress) {
  checkArmPlan(nominal, plan);
  PressLimits limits = pressLimits(nominal);
  limits.force = plan.force_limit;
  GuardedCarrier carrier(plant, limits);
  PressController press(carrier);
  const double begin = carrier.last().time;
  ArmRecording recording;
  const auto report = [&](const char* state) {
    if (!progress) return;
    progress({state, carrier.last().time - begin, static_cast<int>(recording.samples.size())});
  };
  report("tare");
  tareFreePeg(carrier, nominal);
  const Pose X_start = poseFromRest(carrier.sensor().tare().pose);
  // onto the side that yields more, which a press of the edge counts with
  const Matrix6 C = couplingCompliance(nominal.coupling);
  const Vector2d outward = C(4, 4) >= C(3, 3) ? Vector2d(1.0, 0.0) : Vector2d(0.0, 1.0);
  const Matrix3d R = tareBeside(carrier, nominal, X_start, {outward, plan.beside, plan.tilt, 10});
  report("touch");
  const double amplitude = amplitudeWithin(
      std::max(lightForce(nominal), carrier.sensor().touchForce()), plan.force_limit);
  const EdgeContact contact = holdMean(carrier, press, nominal, R, kMeanForce * amplitude);
  recording.upright = pressCompliance(nominal) - contact.compliance;
  report("chirp");
  const RestPose middle = carrier.target();
  const double start = carrier.last().time;
  const double reach = recording.reach = std::max(kMinAmplitude, amplitude * contact.compliance);
  for (double t = 0.0; t < duration; t = carrier.last().time - start) {
    const double commanded = reach * travel(t);
    recording.samples.push_back({carrier.last().time, commanded, (R * carrier.force()).z()});
    carrier.nudge(moved(middle, contact.path, commanded));
  }
  report("lift");
  RestPose up = carrier.target();
  up.z = std::max(up.z, press.touchZ()) + kClearFace;
  carrier.moveTo(up);
  carrier.moveTo(restFromPose(X_start));
  recording.time = carrier.last().time - begin;
  return recording;
}

ArmIdentification fitArm(const std::vector<ArmSample>& samples, double begin, const ArmPlan& plan) {
  constexpr auto kCount = static_cast<Eigen::Index>(kLines.size());
  const int periods = plan.periods - 1;
  std::vector<Phasors> each;
  for (int i = 1; i <= periods; ++i) {
    each.push_back(phasorsOf(samples, begin + i * plan.period, plan.period));
  }
  // noise of a phasor's real or imaginary part, in one period
  double noise = 0.0, distortion = 0.0;
  std::vector<Complex> response(kLines.size()), force(kLines.size());
  for (std::size_t k = 0; k < kLines.size(); ++k) {
    Complex sum = 0.0, commanded = 0.0;
    for (const Phasors& one : each) {
      sum += one.force[k];
      commanded += one.command[k];
    }
    response[k] = sum / commanded;
    force[k] = sum / static_cast<double>(periods);
    for (const Phasors& one : each) noise += std::norm(one.force[k] - response[k] * one.command[k]);
  }
  noise /= 2.0 * static_cast<double>(kCount) * std::max(1, periods - 1);
  for (std::size_t k = 0; k < kEmptyLines.size(); ++k) {
    Complex sum = 0.0;
    for (const Phasors& one : each) sum += one.force[kLines.size() + k];
    distortion += 0.5 * std::norm(sum / static_cast<double>(periods)) / kEmptyLines.size();
  }
  const double variance = std::max(noise / periods, distortion);

  ArmIdentification found;
  VectorXd x(kCount), gains(kCount), phases(kCount), sds(kCount);
  double turned = 0.0;
  for (Eigen::Index i = 0; i < kCount; ++i) {
    const auto k = static_cast<std::size_t>(i);
    ArmResponsePoint point;
    point.frequency = 2.0 * M_PI * kLines[k] / plan.period;
    point.gain = std::abs(response[k]);
    // the phase goes on from that of the line before, at the same delay
    const double expected = i == 0 ? 0.0 : turned * point.frequency / found.points.back().frequency;
    // a delay is no lead: the first line's phase is in (-2 pi, 0] but for a little
    const double raw = std::arg(response[k]);
    point.phase = i == 0 ? (raw > 0.5 ? raw - 2.0 * M_PI : raw)
                         : expected + std::remainder(raw - expected, 2.0 * M_PI);
    turned = point.phase;
    point.sd = std::sqrt(variance) / std::max(1e-12, std::abs(force[k]));
    found.points.push_back(point);
    x(i) = point.frequency;
    gains(i) = std::log(std::max(1e-12, point.gain));
    phases(i) = point.phase;
    sds(i) = std::max(1e-9, point.sd);
  }
  const Limit gain = limitOf(x, gains, sds, false), slope = limitOf(x, phases, sds, true);
  found.arm.stiffness = std::exp(gain.value);
  found.arm.stiffness_sd = found.arm.stiffness * gain.sd;
  found.arm.delay = -slope.value;
  found.arm.delay_sd = slope.sd;
  for (const ArmSample& sample : samples) found.force = std::max(found.force, sample.force);
  if (!(gain.sd < kMaxRelativeSd) || !(slope.sd < kMaxDelaySd)) {
    throw AlignError(
        AlignFailure::kNoReading,
        text("the force doesn't follow the command: stiffness %.3g +- %.2g N/m, delay %.3f +- ",
             found.arm.stiffness, found.arm.stiffness_sd, found.arm.delay) +
            text("%.3f s; look for backlash and loose parts", found.arm.delay_sd));
  }
  return found;
}

ArmIdentification identifyArm(Plant& plant, const Mechanism& nominal, const ArmPlan& plan,
                              const std::function<void(const IdentificationProgress&)>& progress) {
  const ArmRecording recording = recordArm(
      plant, nominal, plan, [&](double t) { return chirpAt(t, plan.period); },
      plan.periods * plan.period, progress);
  ArmIdentification found = fitArm(recording.samples, recording.samples.front().time, plan);
  const double tilted = found.arm.stiffness;
  found.arm.stiffness = 1.0 / (1.0 / tilted + recording.upright);
  found.arm.stiffness_sd *= std::pow(found.arm.stiffness / tilted, 2);
  const double corrected = recording.upright * found.arm.stiffness;
  found.arm.stiffness_sd =
      std::hypot(found.arm.stiffness_sd, kDrawnSd * corrected * found.arm.stiffness);
  // between two commands a carrier moves as long as their distance takes, half of it on the mean
  const double step = kRootMeanStep * recording.reach * kStepTime / plan.period;
  const double move = std::sqrt(kMoveOfStep * step / nominal.carrier.max_acceleration);
  found.arm.delay_sd = std::hypot(found.arm.delay_sd, 0.25 * std::min(move, kStepTime));
  found.drawn_stiffness = 1.0 / pressCompliance(nominal);
  found.time = recording.time;
  if (found.arm.delay > kLongest) {
    throw AlignError(AlignFailure::kNoReading,
                     text("the arm answers after %.3f s: strategies work with up to %g s",
                          found.arm.delay, kLongest));
  }
  return found;
}

}  // namespace assembly_cell
