// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "assembly_cell/align/strategies/vibrated_search.h"

namespace assembly_cell {
namespace {

constexpr int kLevelReadings = 5;    // before the plane is first known
constexpr std::size_t kSomeUse = 3;  // of these readings, for another round of them
constexpr double kLevelTilt = 2e-3;  // sd of the plane that is enough for the sweep [rad]
constexpr int kGuessReadings = 2;    // on the rim, for where its edges may be
constexpr double kGolden = 0.6180339887498949;  // of a turn: once round, never the same place
constexpr double kKnown = 0.3;                  // sd of the centre that is enough, of the clearance
constexpr int kAlike = 6;  // on the rim from one place are enough if the model limits them
constexpr double kModelLimit = 5.0;  // times the sd that noise makes
constexpr double kFloor = 1e-3;      // of that sd [rad]
constexpr double kHalf = 1.4;        // from the hole's direction to its edges, mostly [rad]
constexpr double kWay = 0.4, kWayStep = 0.1;  // of it, for the low side of the next readings
constexpr double kAwayFromHole = 0.7;         // low side of readings for the plane [rad]
constexpr double kKnownTilt = 5e-4;           // sd of the plane that is enough [rad]

// The strategy `single_contact` (thesis Fig 9.14; docs/reference/strategies.md): the low side of
// the peg once round, at a constant tilt against the plane.
class SingleContact : public VibratedSearch {
 public:
  SingleContact(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                const Progress& progress)
      : VibratedSearch(plant, mechanism, parameters, progress) {}

 private:
  enum class State { kLevel, kSweep, kResolve, kEnter, kDone };

  bool attempt() override {
    State state = found_ ? State::kEnter : State::kLevel;
    straddled_.reset();
    int sweeps = 0;
    places_ = 0;
    while (state != State::kDone) {
      switch (state) {
        case State::kLevel:
          // a first round with few readings: the tilt that the peg began with adds to each
          state = lookAtPlane() ? State::kSweep : State::kEnter;
          break;
        case State::kSweep:
          ++sweeps;
          state = sweep(sweeps > 1 ? kRimReadings : 0) ? State::kResolve : State::kEnter;
          break;
        case State::kResolve:
          state = State::kEnter;
          try {
            resolve();
          } catch (const AlignError&) {
            // some of the rim was felt: a closer look will tell
            if (hole_.rim_readings == 0 || sweeps >= p_.rounds) throw;
            state = State::kSweep;
          }
          break;
        case State::kEnter:
          if (enter(hole_.center)) {
            state = State::kDone;
          } else if (sweeps >= p_.rounds) {
            return false;
          } else {
            bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
            goAside();
            state = State::kSweep;
          }
          break;
        case State::kDone:
          break;
      }
    }
    return true;
  }

  // false when the edge went into the hole on the way, in all three
  bool readAt(double low, const char* name) {
    Felt felt;
    if (!read(lowAt(low), name, felt)) {
      takeEntry();
      return false;
    }
    if (felt.usable) felt_.push_back(felt);
    if (felt.straddles) straddled_ = low;
    return true;
  }

  bool lookAtPlane() {
    for (int i = 0; i < 2 * kLevelReadings; ++i) {
      const bool again = i >= kLevelReadings;
      if (again && level() && hole_.normal_sd < kLevelTilt) return true;
      if (again && felt_.size() < kSomeUse) break;
      // the second round between the places of the first one
      if (!readAt(2 * M_PI * (i + (again ? 0.5 : 0.0)) / kLevelReadings, "level")) return false;
    }
    if (!level()) {  // worse than asked for will do
      throw AlignError(AlignFailure::kNoPlaneReading, "the contacts don't agree on a plane");
    }
    return true;
  }

  // Until the hole is known: where its edges should be, as long as that adds contacts on the rim,
  // else once round; off the hole where only the plane isn't known well. After a centre that proved
  // wrong `least` contacts on the rim, as many as make one, are felt from here first: those felt
  // before agree with each other, and may all be wrong by the same.
  bool sweep(int least) {
    const int most = std::max(2, p_.sweep_readings - kLevelReadings);
    const std::size_t before_here = felt_.size();
    int rim = -1;
    for (int i = 0; i < most; ++i) {
      const HoleEstimate before = hole_;
      const FitStatus status = fit(kGuessReadings);
      const int here = rimSince(before_here);
      const bool centre = status.good() && isCentreKnown() && here >= least;
      const bool known = centre && hole_.normal_sd < kKnownTilt;
      std::optional<double> low;
      if (centre) {
        low = lowForPlane();
      } else if (hole_.rim_readings > rim) {
        low = lowForEdge(status);
      }
      if (known) break;
      rim = hole_.rim_readings;
      hole_ = before;
      if (status.good() && here >= kAlike && isModelLimited(felt_.back())) break;
      if (!low) low = 2 * M_PI * kGolden * ++places_;
      if (!readAt(*low, "sweep")) return false;
    }
    return true;
  }

  int rimSince(std::size_t first) const {
    return static_cast<int>(
        std::count_if(felt_.begin() + static_cast<std::ptrdiff_t>(first), felt_.end(),
                      [](const Felt& f) { return f.reading.kind == HoleReading::kRim; }));
  }

  // what a direction is off by comes from the model and not from noise: the same again where it was
  // felt before, so that only contacts from elsewhere would tell more
  static bool isModelLimited(const Felt& felt) {
    return felt.reading.sd > kModelLimit * std::max(kFloor, felt.vibration.direction_sd);
  }

  bool isCentreKnown() const {
    const double clearance = mechanism_.hole.radius - mechanism_.peg.radius;
    return hole_.rim_readings >= kRimReadings &&
           std::sqrt(hole_.center_covariance.trace()) < kKnown * clearance;
  }

  // low side that is away from the hole, to both sides in turn
  double lowForPlane() const {
    const Eigen::Vector2d away = planeAxes(hole_.normal).transpose() * (bottom_ - hole_.center);
    const double side = felt_.size() % 2 == 0 ? kAwayFromHole : -kAwayFromHole;
    return std::atan2(away.y(), away.x()) + side;
  }

  // low side with which the peg rests on the edge that fewer contacts were felt on, of two alike on
  // the nearer one
  std::optional<double> lowForEdge(const FitStatus& status) const {
    const Eigen::Matrix<double, 3, 2> axes = planeAxes(hole_.normal);
    const auto azimuth = [&](const Eigen::Vector3d& v) {
      const Eigen::Vector2d d = axes.transpose() * v;
      return std::atan2(d.y(), d.x());
    };
    const auto turn = [](double a) { return std::remainder(a, 2 * M_PI); };
    std::vector<double> edges;
    std::optional<double> toward = straddled_;
    for (const Felt& felt : felt_) {
      const HoleReading& r = felt.reading;
      if (r.kind != HoleReading::kRim) continue;
      const Eigen::Vector3d at(std::cos(r.alpha), std::sin(r.alpha), 0.0);
      const double edge = azimuth(r.X_SP.R * at);
      edges.push_back(edge);
      if (!toward) toward = edge + std::copysign(kHalf, turn(azimuth(r.X_SP.R.col(2)) - edge));
    }
    double half = kHalf;
    if (status.good() || status.failure == AlignFailure::kOneEdgeOnly) {
      const Eigen::Vector3d d = hole_.center - bottom_;
      toward = azimuth(d);
      half = std::acos(std::clamp(0.5 * d.norm() / tipRadius(mechanism_.peg), 0.0, 1.0));
    }
    if (!toward || felt_.empty()) return {};
    int left = 0, right = 0;
    for (const double edge : edges) ++(turn(edge - *toward) > 0.0 ? left : right);
    const double last = azimuth(felt_.back().reading.X_SP.R.col(2));
    const bool to_left = left == right ? turn(last - *toward) > 0.0 : left < right;
    const double way = kWay + kWayStep * ((left + right) % 3);
    return *toward + (to_left ? way : -way) * half;
  }

  std::optional<double> straddled_;  // low side with which both edges carried
  int places_ = 0;                   // of the way once round, so far
};

}  // namespace

AlignResult singleContact(Plant& plant, const Mechanism& mechanism,
                          const AlignParameters& parameters,
                          const std::function<void(const AlignProgress&)>& progress) {
  return SingleContact(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
