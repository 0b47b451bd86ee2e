// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <iterator>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/study/study.h"

namespace assembly_cell {

void fields(FieldList& f, StudyJob& j) {
  const Range place{-1, 1, "m"}, turn{-1, 1, "rad"};
  f.group("start", [&](FieldList& g) {
    g.number("x", j.start.x, place, "Position of the peg's bottom centre.");
    g.number("y", j.start.y, place, "Position of the peg's bottom centre.");
    g.number("offset", j.start.offset, place, "Distance added to x, y in the direction azimuth.");
    g.number("azimuth", j.start.azimuth, finite("rad"), "Direction of the offset.");
    g.number("tilt_x", j.start.tilt_x, turn, "Rotation vector of the peg's tilt.");
    g.number("tilt_y", j.start.tilt_y, turn, "Rotation vector of the peg's tilt.");
    g.number("tilt", j.start.tilt, turn, "Angle added to the tilt in the direction tilt_azimuth.");
    g.number("tilt_azimuth", j.start.tilt_azimuth, finite("rad"), "Direction of the tilt.");
    g.number("height", j.start.height, notNegative("m", 1),
             "Height of the edge's lowest point above the plane.");
  });
  f.group("move", [&](FieldList& g) {
    g.number("x", j.move.x, place, "Open-loop motion of the rest pose.");
    g.number("y", j.move.y, place, "Open-loop motion of the rest pose.");
    g.number("z", j.move.z, place, "Open-loop motion of the rest pose.");
    g.number("delay", j.move.delay, notNegative("s"), "Time from the start to the motion.");
  });
  f.number("look", j.look, {1e-6, Range::kMax, "s"}, "Period in which outcomes are evaluated.");
  f.group("assembled", [&](FieldList& g) {
    g.number("depth", j.assembled_depth, notNegative("m", 1),
             "Depth of the whole edge from which the peg counts as assembled.");
    g.number("offset", j.assembled_offset, notNegative("m", 1),
             "Distance of the bottom centre from the axis up to which it counts as assembled.");
  });
  f.group("stop", [&](FieldList& g) {
    g.flag("assembled", j.stop_assembled, "Ends the run when assembled.");
    g.number("force", j.stop_force, notNegative("N"), "Ends the run above this contact force.");
    g.number("evaluations", j.stop_evaluations, {1, Range::kMax},
             "Ends the run after this many evaluations of the right-hand side.");
  });
  f.group("cell", [&](FieldList& g) {
    g.integer("bits", j.cell.bits, 10, 24, "Resolution of the converters: 10, 16 or 24 bits.");
    g.number("noise", j.cell.noise, notNegative("V", 5), "Noise of a strain channel, rms.");
  });
  f.group("align", [&](FieldList& g) { alignFields(g, j.align); });
}

bool setStudyJob(StudyJob& job, const StudySetting& s) {
  const std::string section = s.key.substr(0, s.key.find('.'));
  const std::string sections[] = {"start", "move", "look", "assembled", "stop", "cell", "align"};
  if (std::find(std::begin(sections), std::end(sections), section) == std::end(sections)) {
    return false;
  }
  const auto refusal = [&](const std::string& remedy) {
    return s.key + ": value " + s.value + ": " + remedy;
  };
  const bool align = job.kind == StudyJob::Kind::kAlign;
  if (section != "start" && (section == "cell" || section == "align") != align) {
    throw KeyError(refusal(align ? "of no use with job: align, leave it out" : "needs job: align"));
  }
  if (section == "start") job.start.given = true;
  if (section == "move") job.move.given = true;

  setField(fieldsOf(job), s.key, s.value);
  if (s.key == "cell.bits") checkBits(job.cell.bits, s.key + ": value ");
  return true;
}

}  // namespace assembly_cell
