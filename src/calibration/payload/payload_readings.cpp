// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>

#include "assembly_cell/base/text.h"
#include "assembly_cell/calibration/payload/payload_check.h"

namespace assembly_cell {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// An odd reading must fit better by this for each thing that it changes: of two that fit alike the
// simpler one counts
constexpr double kSimpler = 1.5;
// A reading whose forces fit worse than this times those of the reading given isn't looked at
constexpr double kHopeless = 3.0;
constexpr double kReadingRounding = 1e-6;  // of the readings: written digits
constexpr int kTurnPasses = 200;

using Rotations = std::vector<Matrix3d>;
using Vectors = std::vector<Vector3d>;

// y = bias + A shared, by least squares
struct ReadingFit {
  Vector3d bias = Vector3d::Zero(), shared = Vector3d::Zero();
  double squares = 0.0;
};

template <typename Load>
ReadingFit fit(const Vectors& y, const Load& load) {
  const auto n = static_cast<double>(y.size());
  Matrix3d mean = Matrix3d::Zero();
  Vector3d mean_y = Vector3d::Zero();
  for (std::size_t i = 0; i < y.size(); ++i) {
    mean += load(i) / n;
    mean_y += y[i] / n;
  }
  Matrix3d normal = Matrix3d::Zero();
  Vector3d moment = Vector3d::Zero();
  double squares = 0.0;
  for (std::size_t i = 0; i < y.size(); ++i) {
    const Matrix3d A = load(i) - mean;
    const Vector3d e = y[i] - mean_y;
    normal += A.transpose() * A;
    moment += A.transpose() * e;
    squares += e.squaredNorm();
  }
  ReadingFit out;
  out.shared = normal.ldlt().solve(moment);
  out.bias = mean_y - mean * out.shared;
  out.squares = std::max(squares - out.shared.dot(moment), 0.0);
  return out;
}

ReadingFit forceFit(const Rotations& R, const Vectors& force) {
  return fit(force, [&](std::size_t i) -> Matrix3d { return R[i].transpose(); });
}

ReadingFit torqueFit(const Rotations& R, const Vectors& torque, const Vector3d& gravity) {
  return fit(torque, [&](std::size_t i) -> Matrix3d { return -skew(R[i].transpose() * gravity); });
}

struct Data {
  Vectors force, torque;             // as recorded
  double force_floor, torque_floor;  // rms that is rounding
  double rows;
};

Data dataOf(const std::vector<Vector6>& wrenches) {
  Data out;
  double force = 0.0, torque = 0.0;
  for (const Vector6& w : wrenches) {
    out.force.push_back(w.head<3>());
    out.torque.push_back(w.tail<3>());
    force += w.head<3>().squaredNorm();
    torque += w.tail<3>().squaredNorm();
  }
  out.rows = 3.0 * static_cast<double>(wrenches.size());
  out.force_floor = std::max(kReadingRounding * std::sqrt(force / out.rows), 1e-12);
  out.torque_floor = std::max(kReadingRounding * std::sqrt(torque / out.rows), 1e-12);
  return out;
}

Vectors turned(const Vectors& values, const Matrix3d& P) {
  Vectors out = values;
  for (Vector3d& v : out) v = P * v;
  return out;
}

Vectors inSensor(const Rotations& R, const Vectors& values, WrenchAxes axes) {
  Vectors out = values;
  if (axes == WrenchAxes::kBase) {
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = R[i].transpose() * values[i];
  }
  return out;
}

struct Candidate {
  OtherReading reading;
  double force = 0.0, torque = 0.0;  // rms that is left
  double score = HUGE_VAL;           // their product and the price of what differs
  bool given = false;
};

std::vector<Matrix3d> rightHandedAxes() {
  std::vector<Matrix3d> out;
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Matrix3d P = Matrix3d::Zero();
      for (int k = 0; k < 3; ++k) {
        P(k, order[static_cast<std::size_t>(k)]) = signs >> k & 1 ? -1.0 : 1.0;
      }
      if (P.determinant() > 0.0) out.push_back(P);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return out;
}

// Looks through readings and keeps the best, and the best of those given.
class Search {
 public:
  Search(const Data& data, WrenchAxes axes) : data_(data), axes_(axes) {}

  void look(const Rotations& R, const OtherReading& base) {
    static const std::vector<Matrix3d> all_axes = rightHandedAxes();
    const bool as_given = base.rotations.empty() && !base.inverse;
    for (const WrenchAxes axes : {WrenchAxes::kSensor, WrenchAxes::kBase}) {
      double lowest = HUGE_VAL;
      Matrix3d start = Matrix3d::Identity();
      for (const Matrix3d& P : all_axes) {
        OtherReading reading = base;
        reading.force = axes;
        reading.turn = P;
        const ReadingFit force = forceFit(R, inSensor(R, turned(data_.force, P), axes));
        if (force.squares < lowest) {
          lowest = force.squares;
          start = P;
        }
        const bool reference = as_given && P.isIdentity();
        if (!reference && given_force_ < HUGE_VAL &&
            rms(force.squares, 6.0) > kHopeless * given_force_) {
          continue;
        }
        for (const bool force_only : {false, true}) {
          if (force_only && P.isIdentity()) continue;
          reading.force_only = force_only;
          for (const WrenchAxes torque : {WrenchAxes::kSensor, WrenchAxes::kBase}) {
            reading.torque = torque;
            const Vectors t =
                inSensor(R, force_only ? data_.torque : turned(data_.torque, P), torque);
            evaluate(reading, force, torqueFit(R, t, force.shared), 6.0);
          }
        }
      }
      if (axes == WrenchAxes::kSensor) lookTurned(R, base, start);
    }
  }

  Candidate best, given;

 private:
  const Data& data_;
  WrenchAxes axes_;
  double given_force_ = HUGE_VAL;

  double rms(double squares, double unknowns) const {
    return std::sqrt(squares / std::max(data_.rows - unknowns, 1.0));
  }

  void evaluate(const OtherReading& reading, const ReadingFit& force, const ReadingFit& torque,
                double unknowns) {
    Candidate c;
    c.reading = reading;
    c.force = rms(force.squares, unknowns) + data_.force_floor;
    c.torque = rms(torque.squares, 6.0) + data_.torque_floor;
    c.reading.payload.gravity = force.shared;
    // of the sensor's own axes
    const bool own = reading.force == WrenchAxes::kSensor && !reading.force_only;
    c.reading.payload.center_of_mass =
        own ? Vector3d(reading.turn.transpose() * torque.shared) : torque.shared;
    c.given = reading.rotations.empty() && !reading.inverse && reading.turn.isIdentity() &&
              reading.force == reading.torque &&
              (axes_ == WrenchAxes::kAuto || reading.force == axes_);
    int odd = !reading.rotations.empty() + reading.inverse + !reading.turn.isIdentity() +
              reading.force_only + (reading.force != reading.torque);
    if (axes_ != WrenchAxes::kAuto && reading.force != axes_) ++odd;
    if (unknowns > 6.0) ++odd;
    c.score = c.force * c.torque * std::pow(kSimpler, odd);
    if (c.given && c.score < given.score) {
      given = c;
      given_force_ = c.force;
    }
    if (c.score < best.score) best = c;
  }

  // Any rotation of the sensor: weight and rotation in turn, from the best of the axes.
  void lookTurned(const Rotations& R, const OtherReading& base, const Matrix3d& start) {
    Matrix3d P = start;
    Vector3d mean_f = Vector3d::Zero();
    Matrix3d mean_R = Matrix3d::Zero();
    const auto n = static_cast<double>(R.size());
    for (std::size_t i = 0; i < R.size(); ++i) {
      mean_f += data_.force[i] / n;
      mean_R += R[i].transpose() / n;
    }
    ReadingFit force;
    for (int pass = 0; pass < kTurnPasses; ++pass) {
      force = forceFit(R, turned(data_.force, P));
      Matrix3d H = Matrix3d::Zero();
      for (std::size_t i = 0; i < R.size(); ++i) {
        H += (R[i].transpose() - mean_R) * force.shared * (data_.force[i] - mean_f).transpose();
      }
      const Eigen::JacobiSVD<Matrix3d> svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
      Matrix3d sign = Matrix3d::Identity();
      sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
      const Matrix3d next = svd.matrixU() * sign * svd.matrixV().transpose();
      const double change = (next - P).norm();
      P = next;
      if (change < 1e-9) break;
    }
    OtherReading reading = base;
    reading.force = reading.torque = WrenchAxes::kSensor;
    reading.turn = P;
    force = forceFit(R, turned(data_.force, P));
    evaluate(reading, force, torqueFit(R, turned(data_.torque, P), force.shared), 9.0);
  }
};

std::string axesText(const Matrix3d& P) {
  std::string out = "(";
  for (int k = 0; k < 3; ++k) {
    Eigen::Index from = 0;
    P.row(k).cwiseAbs().maxCoeff(&from);
    out += std::string(k == 0 ? "" : ", ") + (P(k, from) < 0.0 ? "-" : "") + "xyz"[from];
  }
  return out + ")";
}

std::string turnText(const OtherReading& r, bool up) {
  const bool whole = (r.turn.cwiseAbs() - r.turn.cwiseAbs2()).cwiseAbs().maxCoeff() < 1e-9;
  const char* of = r.force_only ? "the force's axes " : "the axes ";
  // a weight upwards: as likely all signs are the other way
  if (whole && (r.force_only || up || r.force == WrenchAxes::kBase)) {
    return of + axesText(up ? Matrix3d(-r.turn) : r.turn);
  }
  const Eigen::AngleAxisd turn(r.turn);
  const Vector3d axis = (100.0 * turn.axis()).array().round() / 100.0 + 0.0;  // no -0
  return text("the sensor turned by %.1f deg about (%.2f, %.2f, %.2f) of the poses' axes",
              turn.angle() * 180.0 / M_PI, axis.x(), axis.y(), axis.z());
}

std::string describe(const Candidate& best, const Candidate& given, WrenchAxes axes,
                     double gravity) {
  const OtherReading& r = best.reading;
  std::vector<std::string> parts;
  if (!r.rotations.empty()) parts.push_back(r.rotations);
  if (r.inverse) parts.push_back("the inverse of the rotations");
  if (r.force != r.torque) {
    parts.push_back(
        text("forces in %s axes and torques in %s axes", toString(r.force), toString(r.torque)));
  } else if (axes != WrenchAxes::kAuto && r.force != axes) {
    parts.push_back(text("wrenches in %s axes", toString(r.force)));
  }
  const bool up = r.payload.gravity.z() > 0.5 * r.payload.gravity.norm();
  if (!r.turn.isIdentity()) parts.push_back(turnText(r, up));
  std::string all;
  for (const std::string& part : parts) all += (all.empty() ? "" : " and ") + part;
  // an upward weight of the force's axes alone: they are the other way
  const Vector3d c = (up && r.force_only ? -1e3 : 1e3) * r.payload.center_of_mass;
  return "with " + all +
         text(
             " %.3g N and %.3g N m are left, as read %.3g N and %.3g N m; then %.4g kg at (%.1f, "
             "%.1f, %.1f) mm",
             best.force, best.torque, given.force, given.torque, r.payload.gravity.norm() / gravity,
             c.x(), c.y(), c.z());
}

}  // namespace

OtherReading otherReading(const std::vector<StaticPose>& poses,
                          const std::vector<OtherRotations>& others,
                          const std::vector<Vector6>& wrenches, WrenchAxes axes, double gravity) {
  const Data data = dataOf(wrenches);
  Search search(data, axes);
  std::vector<OtherRotations> all = others;
  all.insert(all.begin(), OtherRotations());
  for (const StaticPose& pose : poses) all.front().R.push_back(pose.R);
  for (OtherRotations& one : all) {
    OtherReading base;
    base.rotations = one.name;
    for (const bool inverse : {false, true}) {
      base.inverse = inverse;
      search.look(one.R, base);
      for (Matrix3d& R : one.R) R.transposeInPlace();
    }
  }
  OtherReading out = search.best.reading;
  if (search.best.given) return out;
  out.better = search.given.force * search.given.torque / (search.best.force * search.best.torque);
  out.text = describe(search.best, search.given, axes, gravity);
  return out;
}

}  // namespace assembly_cell
