// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <optional>

#include "assembly_cell/align/estimation/contact_formulas.h"
#include "assembly_cell/align/strategies/vibrated_search.h"

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
// at once tell the hole's direction, a wobble about it which of them stays, and where the plane is.
class DoubleContact : public VibratedSearch {
 public:
  DoubleContact(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                const Progress& progress)
      : VibratedSearch(plant, mechanism, parameters, progress) {}

 private:
  enum class State { kLevel, kSeek, kStepAhead, kStepBehind, kSolve, kEnter, kDone };
  // where a single contact was: on the rim before or after the hole's direction, or on the plane
  enum class Side { kPlane, kBehind, kAhead };
  struct Contact {
    Side side = Side::kPlane;
    double low = 0.0, direction = 0.0;  // hole axes [rad]
    double turn = 0.0;                  // of the wobble [rad]
    Complex point;                      // in the plane, hole axes about S [m]
  };

  bool attempt() override {
    int rounds = 0;
    State state = found_ ? State::kEnter : State::kLevel;
    while (state != State::kDone) {
      switch (state) {
        case State::kLevel:
          state = levelRound() ? State::kSeek : State::kEnter;
          break;
        case State::kSeek:
          state = seek() ? State::kStepAhead : State::kEnter;
          break;
        case State::kStepAhead:
          contacts_felt_.clear();
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
          if (enter(hole_.center)) {
            state = State::kDone;
          } else if (++rounds >= p_.rounds) {
            return false;
          } else {
            bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
            goAside();
            here_ = felt_.size();
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

  // one reading at a tilt q against the plane; nothing when the edge went in
  bool readAt(Complex q, const char* name, Felt& felt, bool press_both = true) {
    const Mat3 R = rotationToAxis(hole_.normal) * tiltRotation(tiltFromComplex(q));
    if (!read(R, name, felt, press_both)) {
      takeEntry();
      return false;
    }
    if (felt.usable) felt_.push_back(felt);
    return true;
  }

  bool levelRound() {
    here_ = felt_.size();
    double_low_.reset();
    for (int i = 0; i < kLevelReadings; ++i) {
      Felt felt;
      const double low = 2 * M_PI * i / kLevelReadings;
      if (!readAt(std::polar(tilt_, low), "level", felt, false)) return false;
      if (felt.straddles) double_low_ = low;
    }
    if (!level())
      throw AlignError(AlignFailure::kNoPlaneReading, "the contacts don't agree on a plane");
    return true;
  }

  // a usable reading against what is known of the plane
  Contact contactOf(Felt felt) const {
    const Mat3 R_HS = rotationToAxis(hole_.normal).transpose();
    const Pose& X_SP = felt.reading.X_SP;
    const double r = tipRadius(mechanism_.peg);
    invert(felt);
    const auto point = [&](double a) {
      return Vec3(X_SP.R * Vec3(r * std::cos(a), r * std::sin(a), 0.0) + X_SP.p);
    };
    // C or C*: the one at the plane's height
    const auto off = [&](double a) { return std::abs(hole_.normal.dot(point(a)) - hole_.height); };
    const double a = felt.reading.alpha;
    const Vec3 p = R_HS * point(!felt.reading.end_known && off(a + M_PI) < off(a) ? a + M_PI : a);
    const Vec3 from = p - R_HS * X_SP.p;
    Contact contact;
    contact.direction = std::atan2(from.y(), from.x());
    contact.point = {p.x(), p.y()};
    contact.low = std::arg(tiltAsComplex(axisTilt((R_HS * X_SP.R).col(2))));
    const double ahead = wrapPi(contact.direction - contact.low);
    if (std::abs(ahead) > std::max(kOnEdge, 4 * felt.reading.sd)) {
      contact.side = ahead < 0.0 ? Side::kBehind : Side::kAhead;
    }
    return contact;
  }

  // tilts toward the hole until both edges carry. With the low side before the hole's direction the
  // edge behind is felt, beyond it the edge ahead
  bool seek() {
    std::optional<Contact> behind, ahead;
    const auto keep = [&](const Contact& c) {
      if (c.side == Side::kBehind) behind = c;
      if (c.side == Side::kAhead) ahead = c;
    };
    for (std::size_t i = here_; i < felt_.size(); ++i) keep(contactOf(felt_[i]));
    if (!behind && !ahead && !double_low_ && !found_) {
      throw AlignError(AlignFailure::kNoHoleUnderEdge,
                       "no contact of the first round was on the rim");
    }
    bool halve = false;
    int bounced = 0;
    for (int i = 0; i < kSeekReadings; ++i) {
      double toward;
      if (behind && ahead) {
        // the middle of both edges, or of both low sides where the edges mislead
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
      Felt felt;
      if (!readAt(std::polar(kDoubleTilt, toward), "seek", felt)) return false;
      if (felt.seen.mode.mode == LocusMode::kSegment) {
        alpha_ = felt.seen.locus.orientation();
        if (std::cos(alpha_ - toward) < 0.0) alpha_ = wrapPi(alpha_ + M_PI);
        report("seek", text("double contact, the hole lies in direction %.2f deg or opposite",
                            alpha_ * 180 / M_PI));
        return true;
      }
      if (felt.usable) {
        const Contact c = contactOf(felt);
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

  // of a hole that was found, seen from here
  double towardHole() const {
    const Vec3 way = rotationToAxis(hole_.normal).transpose() * (hole_.center - bottom_);
    return std::atan2(way.y(), way.x());
  }

  // rotates about the hole's direction: one contact opens, the other stays, and far enough the
  // lowest point leaves the hole: the plane, which tells the tilt
  bool step(double sign, bool to_plane) {
    const Side side = sign > 0.0 ? Side::kBehind : Side::kAhead;
    double size = kStep, turn = 0.0;
    int plateau = 0, plane = 0, finer = 0;
    while (plateau < kPlateau || (to_plane && plane < kPlaneReadings)) {
      turn += size;
      if (turn > kMaxTurn) {
        report("step", "the plane is out of reach: position only");
        break;
      }
      Felt felt;
      const Complex q = Complex(kDoubleTilt, -sign * turn) * std::polar(1.0, alpha_);
      if (!readAt(q, "step", felt)) return false;
      if (felt.seen.mode.mode == LocusMode::kNone)
        throw AlignError(AlignFailure::kLostContact, "nothing moves any more");
      if (!felt.usable) continue;
      Contact c = contactOf(felt);
      c.turn = sign * turn;
      if (c.side == side) {
        contacts_felt_.push_back(c);
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
        contacts_felt_.push_back(c);
        ++plane;
      }
    }
    if (plateau == 0) {
      throw AlignError(AlignFailure::kEdgeNotResolved,
                       "no contact on the rim beside the double one");
    }
    return true;
  }

  // the formulas; then all readings together, which weighs them
  void solve() {
    std::optional<Contact> behind, ahead;
    std::vector<TurnReading> plane;
    for (const Contact& c : contacts_felt_) {
      if (c.side == Side::kPlane) plane.push_back({c.turn, c.direction});
      if (c.side == Side::kBehind && !behind) behind = c;
      if (c.side == Side::kAhead && !ahead) ahead = c;
    }
    if (!behind || !ahead)
      throw AlignError(AlignFailure::kEdgeNotResolved, "only one of both edges was felt");
    const Complex middle = 0.5 * (behind->point + ahead->point);
    const auto centre = centreThrough(mouthRadius(mechanism_.hole), behind->point, ahead->point,
                                      middle + std::polar(1.0, alpha_));
    if (!centre)
      throw AlignError(AlignFailure::kEdgeNotResolved,
                       "the edges are farther apart than the hole is wide");
    const std::optional<double> tilt = tiltFromDouble(alpha_, plane);
    const Mat3 R_SH = rotationToAxis(hole_.normal);
    hole_.center = R_SH * Vec3(centre->real(), centre->imag(), 0.0);
    hole_.center += hole_.normal * (hole_.height - hole_.normal.dot(hole_.center));
    report("solve",
           text("centre %.3f %.3f mm by both edges", offset().x() * 1e3, offset().y() * 1e3) +
               (tilt ? text(", tilt %.3f deg by the plane, %.3f commanded", *tilt * 180 / M_PI,
                            kDoubleTilt * 180 / M_PI)
                     : std::string(", position only")));
    found_ = true;
    const HoleEstimate formula = hole_;
    try {
      resolve();
    } catch (const AlignError& error) {
      hole_ = formula;
      report("resolve", std::string(error.what()) + "; the formula's centre stands");
    }
  }

  std::size_t here_ = 0;              // the first reading of this place: others show another hole
  std::optional<double> double_low_;  // low side of a double contact met by chance [rad]
  double alpha_ = 0.0;  // direction of the hole by the double contact, hole axes [rad]
  std::vector<Contact> contacts_felt_;
};

}  // namespace

AlignResult doubleContact(Plant& plant, const Mechanism& mechanism,
                          const AlignParameters& parameters,
                          const std::function<void(const AlignProgress&)>& progress) {
  return DoubleContact(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
