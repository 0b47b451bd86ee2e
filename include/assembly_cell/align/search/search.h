// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <string>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/estimation/hole_fit.h"
#include "assembly_cell/align/search/press.h"
#include "assembly_cell/align/search/scale.h"

namespace assembly_cell {

/// What all strategies share: poses relative to S, the carrier at the start (origin: coupling
/// point) as its encoders say, and the way into the hole. Where the hole is in S is the
/// unknown, which find() has to supply.
class Search {
 public:
  virtual ~Search() = default;
  AlignResult run();

 protected:
  using Progress = std::function<void(const AlignProgress&)>;
  Search(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
         const Progress& progress);

  /// Finds the hole and puts the peg's edge into it. Throws AlignError or PlantError.
  virtual void find() = 0;
  /// Deflection of the coupling that frame `peg` includes: since the start, by default, where the
  /// zero may have been taken anew in another pose since.
  virtual Vector6 deflection() const;
  /// Whether entry ends between walls on all sides. An alignment does; where the way down follows
  /// at once, its end is as good a proof in a bore too narrow to feel its walls apart.
  virtual bool feelsWalls() const { return true; }
  /// What is known of the hole; only called if found_.
  virtual void summarise(AlignResult& result) const = 0;

  /// A light touch: what the resting force says of the contact before anything is pressed.
  struct Touch {
    double force = 0.0;     ///< along the peg [N]
    double sideways = 0.0;  ///< [N]
    double reach = 0.0;  ///< line of action's distance from the axis at the bottom over the radius
    Eigen::Vector2d point{0, 0};  ///< where the line of action crosses the bottom, peg axes [m]
    Eigen::Vector2d lean{0, 0};   ///< of that line, aside over up
    Pose X_SP;                    ///< of the peg then, by the commanded rest pose

    double least = 0.5;                   ///< less than this is no touch any more [N]
    static constexpr double kGone = 0.2;  ///< of that: the peg is free

    /// The force is still there.
    bool felt() const { return std::hypot(force, sideways) > least; }
    /// Nothing is left of it: the peg hangs free, and has swung.
    bool gone() const { return std::hypot(force, sideways) < kGone * least; }
    /// One point of the edge can't feel like this: two carry, or the wall does.
    bool straddles() const { return reach < 0.8; }
    /// Steeper than friction on any contact that may be pressed: the hole's rim nearly along the
    /// edge, a wall, a wedge.
    bool steep() const { return sideways > 0.75 * force; }
  };

  /// Down to a contact that stays, felt at rest; a peg that swings seems to touch. Nothing when the
  /// rest height `floor` [m] was reached without one.
  std::optional<Touch> lightTouch(double floor);
  /// What a peg at rest feels where it is.
  Touch feel();
  /// Throws AlignError `wedged` for a peg tilted by R at a steep contact or one that gave travel.
  void refuseWedge(const Touch& touch, const Eigen::Matrix3d& R);
  /// The hole lies on the low side of a peg tilted by R: later ways aside lead away from it.
  void holeOnLowSide(const Eigen::Matrix3d& R);
  /// Out of whatever the peg is in, by `travel` above [m]; the zero checked.
  void backOut(double travel);
  /// Way aside from where the peg was in vain, another direction each time. In S [m]
  Eigen::Vector3d wayAside(double tilt);
  /// Way aside to where neither edge is steep: beyond √(R² − r²) the rim crosses the edge ahead of
  /// the peg's middle, and the crossing's normal is within 20 degrees of upright at this tilt. [m]
  double trapWidth(double tilt) const;

  /// Carrier in S.
  Pose carrierPose() const { return inverse(X_BS_) * poseFromRest(press_.last().carrier); }
  /// Rest pose whose undeflected peg has its bottom centre at p and its axes along R.
  RestPose restFor(const Eigen::Vector3d& p, const Eigen::Matrix3d& R) const;
  /// Of the coupling under the weight of the peg hanging free.
  Vector6 sag(const RestPose& carrier) const;
  /// Frame `peg` in S from a carrier pose and a deflection.
  Pose pegPose(const RestPose& carrier, const Vector6& deflection) const;
  int blocks(double duration) const;
  /// So many blocks of the default cell, where a swing dies away as fast as the coupling lets it.
  int timed(int blocks) const;
  static constexpr int kWallBlocks = 2;  ///< beside walls, to come to rest
  void report(const char* state, const std::string& message);
  /// Hanging free at rest: S from here on. True when the peg is in the hole already: walls on all
  /// four sides; its centre is known then, its axis isn't.
  bool begin();

  /// Upright over the hole and down; around it where the estimate is not good enough, then to the
  /// middle between the walls. True when the edge went in without resistance and has walls on both
  /// sides of two axes.
  bool enter(const Eigen::Vector3d& center, int rings = kRings);
  /// Of places round the hole's estimate, the middle itself counted, where enter() looks.
  static constexpr int kRings = 3;
  /// More than this on the way in means not aligned. [N]
  double insertionForce() const;
  /// How far from the hole's estimate enter() looks. [m]
  double enterReach() const;
  /// How far below the face the edge has to be, for walls all round: under both chamfers [m].
  double entryDepth() const {
    return p_.insertion_depth + chamferDepth(mechanism_.hole) + chamferHeight(mechanism_.peg);
  }
  /// Whether the peg, as it is, has the hole round it: walls on all four sides, and nothing below.
  bool alreadyIn();
  /// Up along the bore and out of it, the walls leading. Throws AlignError `stuck`.
  void leaveBore();

  const Mechanism& mechanism_;
  const Scale scale_;  // constants of strategies are those of the default cell, times its factors
  const AlignParameters& p_;
  const Progress& progress_;
  PressController press_;
  double length_;                                   // coupling to bottom edge [m]
  double start_time_ = 0.0, reference_time_ = 0.0;  // plant clock [s]
  double block_ = 0.0;                              // duration of a block [s]
  Pose X_BS_;
  RestPose start_;  // of the carrier
  int contacts_ = 0;
  double position_sd_ = 0.0, rotation_sd_ = 0.0;  // for the progress; 0: not known
  HoleEstimate hole_;
  double place_variance_ = 0.0;  // of where moves end, per axis, as far as it is known [m²]
  bool found_ = false, begun_ = false;

 private:
  /// Wrench of the contacts at the bottom edge's centre, peg axes, of a mean of press_.wrench() and
  /// deflection(); the weight has turned since the tare.
  Vector6 tipWrench(const Vector6& wrench, const Vector6& deflection) const;
  void rememberSag(const Eigen::Vector3d& bottom);
  // the way down, insert.cpp
  void insert();
  enum class BoreEnd { kDeep, kStuck, kResisted };
  BoreEnd lowerInBore();
  double against(double way) const;
  BoreReading moveInBore(double down);
  BoreReading feelInBore();
  int wallsFelt(const Vector6& wrench, double depth) const;
  void shakeInBore(double amplitude);
  bool onFloor();
  bool pressAgain(const BoreReading& pressed);
  void backOutOfBore(double travel);
  double wallTravel() const;
  /// A goal before has left the peg deeper in the hole than any alignment does.
  bool isFarIn() const;
  bool stillIn();
  void leanInBore();
  /// S is the carrier as it stands.
  void startHere();
  /// The peg is in the bore, as deep as the goal before has left it.
  void knowBore();
  AlignResult findAndLeave();
  void leave();
  bool lower(const Eigen::Vector3d& from, const Eigen::Matrix3d& R);
  bool centre(const Eigen::Matrix3d& R);
  bool clearOfWalls(Eigen::Vector3d& target, const Eigen::Matrix3d& R);
  bool findWall(const Eigen::Vector3d& direction, const Eigen::Matrix3d& R, Eigen::Vector3d& at);

  Eigen::Vector3d sag_;                // of the upright peg's bottom centre, in S [m]
  Vector6 hanging_ = Vector6::Zero();  // deflection() of the upright peg
  InsertResult inserted_;
  Pose in_bore_;  // of the undeflected peg on the way down, in S
  Eigen::Vector3d aside_ = Eigen::Vector3d::UnitX();  // away from the hole, as far as is known
  int asides_ = 0;                                    // in this direction and others since
};

/// Rotation that tilts z by a rotation vector (x, y).
Eigen::Matrix3d tiltRotation(const Eigen::Vector2d& tilt);
/// Smallest rotation that takes z to n.
Eigen::Matrix3d rotationToAxis(const Eigen::Vector3d& n);
/// Rotation vector (x, y) of the smallest rotation that takes z to the axis.
Eigen::Vector2d axisTilt(const Eigen::Vector3d& axis);
/// printf of two numbers.
std::string text(const char* format, double a, double b = 0.0);

// the strategies
AlignResult singleContact(Plant& plant, const Mechanism& mechanism,
                          const AlignParameters& parameters,
                          const std::function<void(const AlignProgress&)>& progress);
AlignResult doubleContact(Plant& plant, const Mechanism& mechanism,
                          const AlignParameters& parameters,
                          const std::function<void(const AlignProgress&)>& progress);
/// double_contact, and where that fails single_contact from the start again.
AlignResult vibratory(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                      const std::function<void(const AlignProgress&)>& progress);
/// By the places where the tilted peg touches face, rim and wall.
AlignResult touchSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                        const std::function<void(const AlignProgress&)>& progress);
AlignResult twinForce(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                      const std::function<void(const AlignProgress&)>& progress);
/// Level with the face, then along a spiral under constant force until the peg drops: a baseline.
AlignResult spiralSearch(Plant& plant, const Mechanism& mechanism,
                         const AlignParameters& parameters,
                         const std::function<void(const AlignProgress&)>& progress);
/// Shaken and lowered, nothing felt on the way: the other baseline.
AlignResult passiveAssembly(Plant& plant, const Mechanism& mechanism,
                            const AlignParameters& parameters,
                            const std::function<void(const AlignProgress&)>& progress);
/// touch, and where that fails twin_force, then vibratory, each from the start again.
AlignResult autoSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                       const std::function<void(const AlignProgress&)>& progress);

}  // namespace assembly_cell
