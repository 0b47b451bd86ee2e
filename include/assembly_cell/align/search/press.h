// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

#include "assembly_cell/align/plant.h"
#include "assembly_cell/align/search/scale.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Limits of whatever moves the carrier.
struct PressLimits {
  double force = 40.0;          ///< abort above this contact force [N]
  double descent = 0.02;        ///< abort without contact after so much travel down [m]
  double approach_step = 1e-4;  ///< travel down in one block before contact [m]
  double compliance = 5e-4;     ///< travel per force while pressing: more is no contact [m/N]
  Scale scale;                  ///< of the mechanism
  /// Its weight turns with the carrier and is no contact. A mass of 0: as at the tare, always.
  PegParameters peg;
  double gravity = 0.0;  ///< [m/s²]
};

/// The limits for a mechanism: default ones, its steps, compliance, scale and weight.
PressLimits pressLimits(const Mechanism& mechanism);

/// A free peg of the default cell may differ by so much from its tare [N]
inline constexpr double kFreeForce = 1.0;

/// And by so much more for every second since: sensors that warm up drift by 3 N a minute and axis
/// [N/s]
inline constexpr double kZeroDrift = 0.09;

/// A carrier at rest reports its height to within this, amply [m]
inline constexpr double kHeightNoise = 2e-4;

/// How far the pose that a carrier at rest reports scatters from block to block.
struct ReportNoise {
  double position = 0.0;  ///< sd of an axis [m]
  double rotation = 0.0;  ///< [rad]
};

/// Measures it on blocks with the rest pose at rest, by what has no spring to swing in: height and
/// tilts. Less than a micrometre and a microradian is none: so much a swinging peg leaves.
class ReportNoiseMeter {
 public:
  void add(const RestPose& at);
  /// The next pose does not follow the last one at rest.
  void interrupt() { last_.reset(); }
  ReportNoise noise() const;

 private:
  std::optional<RestPose> last_;
  double height2_ = 0.0, tilt2_ = 0.0;  // sums of squared differences
  int pairs_ = 0;
};

/// The carrier is where it was sent. x, y and yaw give way; where the base isn't parallel to the
/// axes that give way, so does the rest a little: 2e-4 m and 4e-4 rad under 40 N, times a tilt of
/// 0.05 rad. There, arrived is near and not moving since the block before; a command given in the
/// last of a move, within 20 µm, ended alignments of twin_force with force_limit. A pose that
/// scatters is there within four deviations, and then some blocks are to be waited for, as it does
/// not show the end of the move.
bool arrived(const RestPose& before, const RestPose& at, const RestPose& target,
             const ReportNoise& noise);
/// Blocks until the end of a move, once arrived() says so by a pose that scatters; else 0.
int blocksToEnd(const ReportNoise& noise);

/// Moves the carrier of a plant and feels with sensor_b: guarded moves, tare, press control at
/// block rate. Every block passes through step(), which checks the limits.
class PressController {
 public:
  /// Waits for the first block. Throws PlantError.
  PressController(Plant& plant, const PressLimits& limits);

  /// One block with a command. Throws AlignError at a limit, PlantError when the plant fails.
  const PlantBlock& step(const PlantCommand& command);
  /// The exciter goes out with the next step, unless that says otherwise.
  void exciterNext(const ExciterParameters& exciter) { exciter_ = exciter; }
  const PlantBlock& wait(int blocks);
  const PlantBlock& last() const { return last_; }

  /// The first tare, with contact excluded: the force is the weight of this peg or doesn't change
  /// over a millimetre of travel up and 0.3 mm to two sides. A peg in contact is lifted until then,
  /// exciter off. Throws AlignError `in_contact` when it isn't free within 25 mm or holds twice the
  /// force limit.
  void begin(const Mechanism& mechanism);

  /// After a goal that failed: exciter off, a millimetre up whatever is felt, then begin(). hung:
  /// where the peg is known to have hung free. No lower than there it isn't lifted, and still there
  /// but for the steps of begin() it goes back: goals that fail don't hang it higher.
  void release(const Mechanism& mechanism, const std::optional<RestPose>& hung = std::nullopt);

  /// Hanging free: waits until still, then takes the mean of `blocks` blocks as zero of force and
  /// deflection.
  void tare(int blocks = 10);

  /// Of the carrier's pose, on the blocks of all tares so far.
  ReportNoise reportNoise() const { return meter_.noise(); }

  /// Scatter of one sample of sensor_b and rounding of its converter, as of the tare.
  const Matrix6& scatter() const { return scatter_; }
  const Matrix6& rounding() const { return last_.rounding_b; }

  /// Exciter off, over `relaxed` (where the coupling isn't strained) and up by `travel` [m]
  /// whatever is felt, and waits until the peg hangs still. Throws AlignError `stuck` when it
  /// doesn't come free, `zero_shifted` when the free peg weighs something else than at the first
  /// tare.
  void retreat(const RestPose& relaxed, double travel);

  /// Up from `from` in small steps, `least` far [m], and on until the peg is free or the way is
  /// `most` [m]; what is held is turned about its axis. Where that ended; throws AlignError
  /// `stuck`.
  RestPose pull(const RestPose& from, double least, double most);

  /// Moves the rest pose and waits until it is there. A pose that scatters tells so a little early:
  /// where a zero follows, there is nothing more to wait for (`to_the_end` false). A move that
  /// follows waits for the end: a carrier that is told to go far while it still brakes first goes
  /// on, by 6 mm in a way of 20 mm.
  void moveTo(const RestPose& target, bool to_the_end = true);
  /// A step that a block has time for.
  void nudge(const RestPose& target);
  /// Waits until blocks in a row agree; false: they never do.
  bool settle();
  const RestPose& target() const { return target_; }

  /// Lowers until the first touch. False when the rest height `floor` [m] was reached without one.
  bool approach(double floor);
  /// What holdStill() can hold at least, as of the tare: less is within the scatter of a block, or
  /// lost in the steps of a press. [N]
  double leastForce(double tolerance) const;

  /// In contact: adjusts the height until the mean force along z is within tolerance·force. [N]
  /// `settled`: the force is, as after a light touch, and isn't waited for.
  void hold(double force, double tolerance, bool settled = false);
  /// The same, and the force is still within tolerance·force 0.2 s later and with the peg at rest:
  /// all that was commanded has had its effect, also of an arm beside a busy machine. Throws
  /// AlignError `press_not_held` where it goes on five times, `gave_way` as hold() over all.
  void holdStill(double force, double tolerance);

  /// Contact wrench, sensor_b axes about its origin; of the weight what it was at the tare, turned
  /// with the carrier since. [N], [N·m]
  Vector6 wrench() const { return last_.wrench_b - tare_ - weightSince(tare_pose_); }
  double forceZ() const { return wrench()(2); }  ///< contact force along z [N]
  /// Contact force, sensor_b axes [N]
  Eigen::Vector3d force() const { return wrench().head<3>(); }
  /// Deflection of the coupling since the tare, sensor_b axes. [m], [rad]
  Vector6 deflection() const { return last_.displacement_b - tare_displacement_; }
  /// Force of the latest tare against the first [N]: a free peg's weight, or it wasn't free.
  double tareShift() const;
  double freeForce() const { return kFreeForce * limits_.scale.force; }  ///< of this peg [N]
  /// What a free peg's zero may differ from the first by, with the drift since [N]
  double freeShift() const { return freeForce() + kZeroDrift * (last_.time - zero_time_); }
  const RestPose& tarePose() const { return tare_pose_; }  ///< of the carrier at the tare
  double touchZ() const { return touch_z_; }  ///< rest height at the last first touch [m]

 private:
  Vector6 weightSince(const RestPose& pose) const;
  void limitWay(double down, double force) const;
  double held() const;
  void goBack(const RestPose& hung, const Mechanism& mechanism);
  void twist(const RestPose& at);
  /// Of a contact force of `force`, `sideways` of it in x and y [N].
  ForceAlarm alarmAt(double force, double sideways) const;
  int timed(int blocks) const;
  double changeOfNoise() const;

  Plant& plant_;
  PressLimits limits_;
  std::optional<ExciterParameters> exciter_;  // of the next step
  PlantBlock last_;
  RestPose target_;
  Vector6 tare_ = Vector6::Zero(), zero_ = Vector6::Zero();  // latest, first
  Vector6 tare_displacement_ = Vector6::Zero();
  double zero_time_ = 0.0;  // of the first
  RestPose tare_pose_, zero_pose_;
  Matrix6 scatter_ = Matrix6::Zero();
  ReportNoiseMeter meter_;  // of the blocks of all tares
  int to_end_ = 0;          // blocks until the last move has surely ended
  bool tared_ = false, guarded_ = true;
  int saturated_ = 0;  // blocks in a row
  double touch_z_ = 0.0;
  double touch_ = 0.0;      // force that is a touch [N]
  double stiffness_ = 0.0;  // of the contact along z, from the last secant [N/m]
};

}  // namespace assembly_cell
