// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <optional>

#include "assembly_cell/align/estimation/contact_formulas.h"
#include "assembly_cell/align/strategies/strategies.h"
#include "assembly_cell/align/strategies/vibrated_search.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr int kLevelReadings = 6;
constexpr double kDoubleTilt = 0.0175;  // toward the hole in double contact: 1 degree [rad]
constexpr double kStep = 0.0087;        // of the wobble about the radial axis [rad]
constexpr double kMaxTurn = 0.14;       // 8 degrees [rad]
constexpr double kOnEdge = 0.06;        // from the lowest point: more is on the rim [rad]
constexpr int kSeekReadings = 10;
constexpr double kNudge = 0.08;  // [rad]
constexpr int kPlateau = 2;      // readings on an edge
constexpr int kPlaneReadings = 2;
constexpr int kFinerSteps = 3;
using Complex = std::complex<double>;
using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

double wrapPi(double a) { return std::remainder(a, 2 * M_PI); }
// anticlockwise from a to b, 0 to 2 pi
double turnFrom(double a, double b) {
  const double turn = wrapPi(b - a);
  return turn < 0.0 ? turn + 2 * M_PI : turn;
}

// The strategy `double_contact` (thesis Fig 9.16; docs/reference/strategies.md): both edge contacts
// together determine the direction of the hole; a rotation about it determines which contact
// remains, and the plane.
class DoubleContact {
 public:
  DoubleContact(Search& search, VibratedSearch& vibrated)
      : search_(search), s_(search.state), vibrated_(vibrated) {}

  bool attempt() {
    int rounds = 0;
    State state = s_.found ? State::kEnter : State::kLevel;
    while (state != State::kDone) {
      switch (state) {
        case State::kLevel:
          state = levelRound() ? State::kSeek : State::kEnter;
          break;
        case State::kSeek:
          state = seek() ? State::kStepAhead : State::kEnter;
          break;
        case State::kStepAhead:
          single_.clear();
          state = step(1.0, true) ? State::kStepBehind : State::kEnter;
          break;
        case State::kStepBehind:
          state = step(-1.0, false) ? State::kSolve : State::kEnter;
          break;
        case State::kSolve:
          solve();
          state = State::kEnter;
          break;
        case State::kEnter:
          if (search_.entry.enter(s_.hole.center)) {
            state = State::kDone;
          } else if (++rounds >= s_.p.rounds) {
            return false;
          } else {
            vibrated_.bottom = s_.target().p;
            vibrated_.goAside();
            here_ = vibrated_.measured.size();
            double_low_.reset();
            state = State::kSeek;
          }
          break;
        case State::kDone:
          break;
      }
    }
    return true;
  }

 private:
  using Measurement = DirectionMeasurement;
  enum class State { kLevel, kSeek, kStepAhead, kStepBehind, kSolve, kEnter, kDone };
  // Of a single contact: on the rim before or after the hole's direction, or on the plane.
  enum class Side { kPlane, kBehind, kAhead };
  struct Contact {
    Side side = Side::kPlane;
    double low = 0.0, direction = 0.0;  // hole axes [rad]
    double turn = 0.0;                  // of the wobble [rad]
    Complex point;                      // in the plane, hole axes about S [m]
  };

  // One measurement at a tilt q against the plane. False when the edge went in.
  bool readAt(Complex q, const char* name, Measurement& measured, bool press_both = true) {
    const Mat3 R = rotationToAxis(s_.hole.normal) * tiltRotation(tiltFromComplex(q));
    if (!vibrated_.read(R, name, measured, press_both)) {
      vibrated_.takeEntry();
      return false;
    }
    if (measured.usable) vibrated_.measured.push_back(measured);
    return true;
  }

  bool levelRound() {
    here_ = vibrated_.measured.size();
    double_low_.reset();
    for (int i = 0; i < kLevelReadings; ++i) {
      Measurement measured;
      const double low = 2 * M_PI * i / kLevelReadings;
      if (!readAt(std::polar(vibrated_.tilt, low), "level", measured, false)) return false;
      if (measured.straddles) double_low_ = low;
    }
    if (!vibrated_.level())
      throw AlignError(AlignFailure::kNoPlaneReading, "the contacts don't agree on a plane");
    return true;
  }

  // A usable measurement against the known plane.
  Contact contactOf(Measurement measured) const {
    const Mat3 R_HS = rotationToAxis(s_.hole.normal).transpose();
    const Pose& X_SP = measured.reading.X_SP;
    const double r = tipRadius(s_.mechanism.peg);
    vibrated_.sensor.invert(measured);
    const auto point = [&](double a) {
      return Vec3(X_SP.R * Vec3(r * std::cos(a), r * std::sin(a), 0.0) + X_SP.p);
    };
    // C or C*: the one at the plane's height
    const auto off = [&](double a) {
      return std::abs(s_.hole.normal.dot(point(a)) - s_.hole.height);
    };
    const double a = measured.reading.alpha;
    const Vec3 p =
        R_HS * point(!measured.reading.end_known && off(a + M_PI) < off(a) ? a + M_PI : a);
    const Vec3 from = p - R_HS * X_SP.p;
    Contact contact;
    contact.direction = std::atan2(from.y(), from.x());
    contact.point = {p.x(), p.y()};
    contact.low = std::arg(tiltAsComplex(axisTilt((R_HS * X_SP.R).col(2))));
    const double ahead = wrapPi(contact.direction - contact.low);
    if (std::abs(ahead) > std::max(kOnEdge, 4 * measured.reading.sd)) {
      contact.side = ahead < 0.0 ? Side::kBehind : Side::kAhead;
    }
    return contact;
  }

  // Tilts toward the hole until both edges carry. With the low side before the hole's direction the
  // contact is on the edge behind it, beyond it on the edge ahead.
  bool seek() {
    std::optional<Contact> behind, ahead;
    const auto keep = [&](const Contact& c) {
      if (c.side == Side::kBehind) behind = c;
      if (c.side == Side::kAhead) ahead = c;
    };
    for (std::size_t i = here_; i < vibrated_.measured.size(); ++i)
      keep(contactOf(vibrated_.measured[i]));
    if (!behind && !ahead && !double_low_ && !s_.found) {
      throw AlignError(AlignFailure::kNoHoleUnderEdge,
                       "no contact of the first round was on the rim");
    }
    bool halve = false;
    int bounced = 0;
    for (int i = 0; i < kSeekReadings; ++i) {
      double toward;
      if (behind && ahead) {
        // the middle of both edges, or of both low sides where the edges are wrong
        const double a = halve ? behind->low : behind->direction;
        const double b = halve ? ahead->low : ahead->direction;
        toward = a + 0.5 * turnFrom(a, b);
      } else if (!behind && !ahead) {
        toward = double_low_ ? *double_low_ : towardHole();
      } else {
        toward = behind ? behind->low + 0.5 : ahead->low - 0.5;
      }
      // the second edge may bounce instead of carry: a little to the sides
      if (bounced > 0) toward += (bounced % 2 == 0 ? -kNudge : kNudge) * ((bounced + 1) / 2);
      Measurement measured;
      if (!readAt(std::polar(kDoubleTilt, toward), "seek", measured)) return false;
      if (measured.seen.mode.mode == LocusMode::kSegment) {
        alpha_ = measured.seen.locus.orientation();
        if (std::cos(alpha_ - toward) < 0.0) alpha_ = wrapPi(alpha_ + M_PI);
        s_.report("seek", text("double contact, the hole lies in direction %.2f deg or opposite",
                               alpha_ * 180 / M_PI));
        return true;
      }
      if (measured.usable) {
        const Contact c = contactOf(measured);
        keep(c);
        halve = behind && ahead && i > 0;
        bounced = 0;
      } else {
        ++bounced;
      }
    }
    throw AlignError(AlignFailure::kNotDouble,
                     "the peg doesn't rest on both edges in any direction");
  }

  // Direction of a hole that was found, from here. [rad]
  double towardHole() const {
    const Vec3 d = rotationToAxis(s_.hole.normal).transpose() * (s_.hole.center - vibrated_.bottom);
    return std::atan2(d.y(), d.x());
  }

  // Rotates about the hole's direction: one contact opens, the other stays, and far enough the
  // lowest point leaves the hole and rests on the plane, which determines the tilt.
  bool step(double sign, bool to_plane) {
    const Side side = sign > 0.0 ? Side::kBehind : Side::kAhead;
    double size = kStep, turn = 0.0;
    int plateau = 0, plane = 0, finer = 0;
    while (plateau < kPlateau || (to_plane && plane < kPlaneReadings)) {
      turn += size;
      if (turn > kMaxTurn) {
        s_.report("step", "the plane is out of reach: position only");
        break;
      }
      Measurement measured;
      const Complex q = Complex(kDoubleTilt, -sign * turn) * std::polar(1.0, alpha_);
      if (!readAt(q, "step", measured)) return false;
      if (measured.seen.mode.mode == LocusMode::kNone)
        throw AlignError(AlignFailure::kLostContact, "nothing moves any more");
      if (!measured.usable) continue;
      Contact c = contactOf(measured);
      c.turn = sign * turn;
      if (c.side == side) {
        single_.push_back(c);
        if (++plateau == kPlateau && to_plane) {
          // to where the lowest point is expected to leave the hole
          const double half = std::abs(wrapPi(c.direction - alpha_));
          if (half >= 0.5 * M_PI) {
            turn = kMaxTurn;
          } else {
            turn = std::max(turn, kDoubleTilt * std::tan(half));
          }
        }
      } else if (c.side == Side::kPlane && plateau < kPlateau) {
        // too far at once: back, with a quarter of the step
        if (++finer > kFinerSteps) {
          throw AlignError(AlignFailure::kEdgeNotResolved,
                           "the hole's arc is narrower than a step");
        }
        turn -= size;
        size *= 0.25;
      } else if (c.side == Side::kPlane) {
        single_.push_back(c);
        ++plane;
      }
    }
    if (plateau == 0) {
      throw AlignError(AlignFailure::kEdgeNotResolved,
                       "no contact on the rim beside the double one");
    }
    return true;
  }

  // The formulas; then all measurements together, weighted.
  void solve() {
    std::optional<Contact> behind, ahead;
    std::vector<TurnReading> plane;
    for (const Contact& c : single_) {
      if (c.side == Side::kPlane) plane.push_back({c.turn, c.direction});
      if (c.side == Side::kBehind && !behind) behind = c;
      if (c.side == Side::kAhead && !ahead) ahead = c;
    }
    if (!behind || !ahead)
      throw AlignError(AlignFailure::kEdgeNotResolved, "only one of both edges was measured");
    const Complex middle = 0.5 * (behind->point + ahead->point);
    const auto centre = centreThrough(mouthRadius(s_.mechanism.hole), behind->point, ahead->point,
                                      middle + std::polar(1.0, alpha_));
    if (!centre)
      throw AlignError(AlignFailure::kEdgeNotResolved,
                       "the edges are farther apart than the hole is wide");
    const std::optional<double> tilt = tiltFromDouble(alpha_, plane);
    const Mat3 R_SH = rotationToAxis(s_.hole.normal);
    s_.hole.center = R_SH * Vec3(centre->real(), centre->imag(), 0.0);
    s_.hole.center += s_.hole.normal * (s_.hole.height - s_.hole.normal.dot(s_.hole.center));
    s_.report("solve", text("centre %.3f %.3f mm by both edges", holeOffset(s_).x() * 1e3,
                            holeOffset(s_).y() * 1e3) +
                           (tilt ? text(", tilt %.3f deg by the plane, %.3f commanded",
                                        *tilt * 180 / M_PI, kDoubleTilt * 180 / M_PI)
                                 : std::string(", position only")));
    s_.found = true;
    const HoleEstimate formula = s_.hole;
    try {
      vibrated_.resolve();
    } catch (const AlignError& error) {
      s_.hole = formula;
      s_.report("resolve", std::string(error.what()) + "; the formula's centre stands");
    }
  }

  Search& search_;
  SearchState& s_;
  VibratedSearch& vibrated_;
  std::size_t here_ = 0;              // the first reading of this place: others show another hole
  std::optional<double> double_low_;  // low side of a double contact met by chance [rad]
  double alpha_ = 0.0;  // direction of the hole by the double contact, hole axes [rad]
  std::vector<Contact> single_;
};

}  // namespace

AlignResult doubleContact(Plant& plant, const Mechanism& mechanism,
                          const AlignParameters& parameters, const ProgressCallback& progress) {
  Search search(plant, mechanism, parameters, progress);
  VibratedSearch vibrated(search);
  DoubleContact strategy(search, vibrated);
  return search.run([&] { vibrated.run([&] { return strategy.attempt(); }); },
                    [&](AlignResult& result) { vibrated.summarise(result); });
}

}  // namespace assembly_cell
