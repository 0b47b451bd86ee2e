// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/align/search/bore_insertion.h"

namespace assembly_cell {

class Retreat;

/// Puts the upright peg's edge into the hole and proves that it is in: bore walls on both sides of
/// two axes, and no resistance below. Needs the hole's plane and centre (SearchState::hole), to
/// within reach().
class BoreEntry {
 public:
  BoreEntry(SearchState& state, BoreInsertion& insertion)
      : clearance_prior(state.known.clearance), s_(state), insertion_(insertion) {}

  /// Rings of places round the hole's estimate that enter() tries, the centre itself counted.
  static constexpr int kRings = 3;
  /// Over the hole and down; around it where the estimate is not good enough, then to the middle
  /// between the walls, which becomes the hole's centre. True when the edge went in.
  bool enter(const Eigen::Vector3d& center, int rings = kRings);
  /// Whether the peg, as it is, has the hole round it. Then its centre is known, its axis isn't,
  /// nor is its depth unless the goal before has measured it.
  bool isIn();
  /// The same of a peg that was left deep in the bore. Throws AlignError `in_contact` if it isn't.
  void requireStillIn();
  /// Moves a peg that has a wall beside it straight up until it has none, then beside the hole,
  /// where the next search has a face to touch. False: there was no wall, it stays where it is.
  /// Throws AlignError `stuck`.
  bool takeOut(Retreat& retreat);

  /// The goal before has left the peg deeper in the hole than any alignment does.
  bool startsDeep() const;
  /// Largest distance from the hole's estimate that enter() tries. [m]
  double reach() const;
  /// Depth of the edge below the face with walls all round: under both chamfers [m].
  double depth() const;
  /// Contact force on the path down that means not aligned. [N]
  double maxForce() const;

  /// Whether entry ends between walls on all sides. An alignment does; where the insertion follows
  /// at once, its end is as good a proof in a bore too narrow to tell its walls apart.
  bool needs_walls = true;
  /// Whether the hole's height is known: not where only its walls were found.
  bool height_known = true;
  /// Of where moves end, per axis, as far as it is known [m²]
  double place_variance = 0.0;
  /// By the drawing and between opposite walls: what touches are fitted with.
  Clearance clearance_prior;
  int refused = 0;  ///< entries that met resistance everywhere, or a rim that held the peg

 private:
  bool hasWallBeside(bool at_rest);
  bool lower(const Eigen::Vector3d& from, const Eigen::Matrix3d& R);
  void goBack(const Eigen::Vector3d& from, const Eigen::Matrix3d& R);
  bool centre(const Eigen::Matrix3d& R);
  bool clearOfWalls(Eigen::Vector3d& target, const Eigen::Matrix3d& R);
  bool findWall(const Eigen::Vector3d& direction, const Eigen::Matrix3d& R, Eigen::Vector3d& at);
  double wallTravel(double expected) const;
  void addLean();

  SearchState& s_;
  BoreInsertion& insertion_;
};

}  // namespace assembly_cell
