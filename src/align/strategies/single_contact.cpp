// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "assembly_cell/align/strategies/strategies.h"
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
constexpr double kHalf = 1.4;        // from the hole's direction to its edges, typically [rad]
constexpr double kToEdge = 0.4, kToEdgeStep = 0.1;  // of it, for the low side of the next readings
constexpr double kAwayFromHole = 0.7;               // low side of readings for the plane [rad]
constexpr double kKnownTilt = 5e-4;                 // sd of the plane that is enough [rad]

// The strategy `single_contact` (thesis Fig 9.14; docs/reference/strategies.md): the low side of
// the peg once round, at a constant tilt against the plane.
class SingleContact {
 public:
  SingleContact(Search& search, VibratedSearch& vibrated)
      : search_(search), s_(search.state), vibrated_(vibrated) {}

  bool attempt() {
    State state = s_.found ? State::kEnter : State::kLevel;
    straddled_.reset();
    int sweeps = 0;
    places_ = 0;
    while (state != State::kDone) {
      switch (state) {
        case State::kLevel:
          // a first round with few readings: the tilt that the peg began with adds to each
          state = measurePlane() ? State::kSweep : State::kEnter;
          break;
        case State::kSweep:
          ++sweeps;
          state = sweep(sweeps > 1 ? kRimReadings : 0) ? State::kResolve : State::kEnter;
          break;
        case State::kResolve:
          state = State::kEnter;
          try {
            vibrated_.resolve();
          } catch (const AlignError&) {
            // some contacts are on the rim: another sweep adds more
            if (s_.hole.rim_readings == 0 || sweeps >= s_.p.rounds) throw;
            state = State::kSweep;
          }
          break;
        case State::kEnter:
          if (search_.entry.enter(s_.hole.center)) {
            state = State::kDone;
          } else if (sweeps >= s_.p.rounds) {
            return false;
          } else {
            vibrated_.bottom = s_.target().p;
            vibrated_.goAside();
            state = State::kSweep;
          }
          break;
        case State::kDone:
          break;
      }
    }
    return true;
  }

 private:
  enum class State { kLevel, kSweep, kResolve, kEnter, kDone };
  using Measurement = DirectionMeasurement;

  // False when the edge went into the hole on the path, in all three.
  bool readAt(double low, const char* name) {
    Measurement measured;
    if (!vibrated_.read(vibrated_.lowAt(low), name, measured)) {
      vibrated_.takeEntry();
      return false;
    }
    if (measured.usable) vibrated_.measured.push_back(measured);
    if (measured.straddles) straddled_ = low;
    return true;
  }

  bool measurePlane() {
    for (int i = 0; i < 2 * kLevelReadings; ++i) {
      const bool again = i >= kLevelReadings;
      if (again && vibrated_.level() && s_.hole.normal_sd < kLevelTilt) return true;
      if (again && vibrated_.measured.size() < kSomeUse) break;
      // the second round between the places of the first one
      if (!readAt(2 * M_PI * (i + (again ? 0.5 : 0.0)) / kLevelReadings, "level")) return false;
    }
    if (!vibrated_.level()) {  // a less certain plane will do
      throw AlignError(AlignFailure::kNoPlaneReading, "the contacts don't agree on a plane");
    }
    return true;
  }

  // Until the hole is known: where its edges should be, as long as that adds contacts on the rim,
  // else once round; off the hole where only the plane isn't known well. After a wrong centre
  // `min_rim` contacts on the rim, as many as determine one, are measured from here first: the
  // earlier ones agree with each other, and may all be wrong by the same.
  bool sweep(int min_rim) {
    const int max_readings = std::max(2, s_.p.sweep_readings - kLevelReadings);
    const std::size_t before_here = vibrated_.measured.size();
    int rim = -1;
    for (int i = 0; i < max_readings; ++i) {
      const HoleEstimate before = s_.hole;
      const FitStatus status = vibrated_.fit(kGuessReadings);
      const int here = rimSince(before_here);
      const bool centre = status.good() && isCentreKnown() && here >= min_rim;
      const bool known = centre && s_.hole.normal_sd < kKnownTilt;
      std::optional<double> low;
      if (centre) {
        low = lowForPlane();
      } else if (s_.hole.rim_readings > rim) {
        low = lowForEdge(status);
      }
      if (known) break;
      rim = s_.hole.rim_readings;
      s_.hole = before;
      if (status.good() && here >= kAlike && isModelLimited(vibrated_.measured.back())) break;
      if (!low) low = 2 * M_PI * kGolden * ++places_;
      if (!readAt(*low, "sweep")) return false;
    }
    return true;
  }

  int rimSince(std::size_t first) const {
    return static_cast<int>(std::count_if(
        vibrated_.measured.begin() + static_cast<std::ptrdiff_t>(first), vibrated_.measured.end(),
        [](const Measurement& f) { return f.reading.kind == HoleReading::kRim; }));
  }

  // The error of a direction comes from the model and not from noise: it is the same again at the
  // same place, so that only contacts from elsewhere would add information.
  static bool isModelLimited(const Measurement& measured) {
    return measured.reading.sd > kModelLimit * std::max(kFloor, measured.vibration.direction_sd);
  }

  bool isCentreKnown() const {
    const double clearance = s_.mechanism.hole.radius - s_.mechanism.peg.radius;
    return s_.hole.rim_readings >= kRimReadings &&
           std::sqrt(s_.hole.center_covariance.trace()) < kKnown * clearance;
  }

  // Low side away from the hole, to both sides in turn. [rad]
  double lowForPlane() const {
    const Eigen::Vector2d away =
        planeAxes(s_.hole.normal).transpose() * (vibrated_.bottom - s_.hole.center);
    const double side = vibrated_.measured.size() % 2 == 0 ? kAwayFromHole : -kAwayFromHole;
    return std::atan2(away.y(), away.x()) + side;
  }

  // Low side with which the peg rests on the edge that has fewer contacts, of two alike on the
  // nearer one. [rad]
  std::optional<double> lowForEdge(const FitStatus& status) const {
    const Eigen::Matrix<double, 3, 2> axes = planeAxes(s_.hole.normal);
    const auto azimuth = [&](const Eigen::Vector3d& v) {
      const Eigen::Vector2d d = axes.transpose() * v;
      return std::atan2(d.y(), d.x());
    };
    const auto wrapped = [](double a) { return std::remainder(a, 2 * M_PI); };
    std::vector<double> edges;
    std::optional<double> toward = straddled_;
    for (const Measurement& measured : vibrated_.measured) {
      const HoleReading& r = measured.reading;
      if (r.kind != HoleReading::kRim) continue;
      const Eigen::Vector3d at(std::cos(r.alpha), std::sin(r.alpha), 0.0);
      const double edge = azimuth(r.X_SP.R * at);
      edges.push_back(edge);
      if (!toward) toward = edge + std::copysign(kHalf, wrapped(azimuth(r.X_SP.R.col(2)) - edge));
    }
    double half = kHalf;
    if (status.good() || status.failure == AlignFailure::kOneEdgeOnly) {
      const Eigen::Vector3d d = s_.hole.center - vibrated_.bottom;
      toward = azimuth(d);
      half = std::acos(std::clamp(0.5 * d.norm() / tipRadius(s_.mechanism.peg), 0.0, 1.0));
    }
    if (!toward || vibrated_.measured.empty()) return {};
    int left = 0, right = 0;
    for (const double edge : edges) ++(wrapped(edge - *toward) > 0.0 ? left : right);
    const double last = azimuth(vibrated_.measured.back().reading.X_SP.R.col(2));
    const bool to_left = left == right ? wrapped(last - *toward) > 0.0 : left < right;
    const double fraction = kToEdge + kToEdgeStep * ((left + right) % 3);
    return *toward + (to_left ? fraction : -fraction) * half;
  }

  Search& search_;
  SearchState& s_;
  VibratedSearch& vibrated_;
  std::optional<double> straddled_;  // low side with which both edges carried
  int places_ = 0;                   // of the round, so far
};

}  // namespace

AlignResult singleContact(Plant& plant, const Mechanism& mechanism,
                          const AlignParameters& parameters, const ProgressCallback& progress) {
  Search search(plant, mechanism, parameters, progress);
  VibratedSearch vibrated(search);
  SingleContact strategy(search, vibrated);
  return search.run([&] { vibrated.run([&] { return strategy.attempt(); }); },
                    [&](AlignResult& result) { vibrated.summarise(result); });
}

}  // namespace assembly_cell
