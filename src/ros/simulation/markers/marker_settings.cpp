// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/markers/marker_settings.h"

#include "assembly_cell/base/fields.h"
#include "assembly_cell/description/cell_description.h"

namespace assembly_cell::ros_bridge {

void fields(FieldList& f, MarkerSettings& s) {
  f.text("wrench", s.wrench,
         "Topic of a live wrench whose line of action is shown, such as sensor_b/wrench; empty: "
         "none.");
  f.number("rate", s.rate, {0.1, 30.0, "Hz"}, "Rate of the markers, wall clock.").live();
  f.number("lifetime", s.lifetime, {1e-3, 1e6, "s"},
           "Lifetime of a marker that isn't renewed, ROS time.")
      .live();
  f.number("size", s.size, {0.01, 100.0}, "Multiplies the width of lines, points and arrows.")
      .live();
  f.number("force_scale", s.force_scale, {1e-9, 1e3, "m/N"}, "Length of the arrow of a force.")
      .live();
  f.number("force_threshold", s.force_threshold, {1e-9, 1e6, "N"}, "Weaker forces get no arrow.")
      .live();
  f.number("locus_scale", s.locus_scale, {1e-3, 1e9}, "Enlargement of the locus.").live();
  f.number("locus_height", s.locus_height, {-100.0, 100.0, "m"},
           "Height of the drawn locus above the edge of the peg.")
      .live();
  f.number("ellipsoid_scale", s.ellipsoid_scale, {1e-3, 1e9},
           "Enlargement of the covariance ellipsoid, 3 sd.")
      .live();
  f.number("tip_height", s.tip_height, {-100.0, 100.0, "m"},
           "Plane of the tip along z of the frame of the wrench: lever of the tool contacts.")
      .live();
  f.number("one_pitch", s.one_pitch, {1e-9, 1e3, "m"}, "Largest couple over force of one contact.")
      .live();
  f.flag("words", s.words, "Names, legend and state are shown.").live();
}

PartShapes partShapes(const CellDescription& description) {
  PartShapes shapes;
  shapes.peg_radius = description.peg.radius;
  shapes.tip_radius = tipRadius(description.peg);
  shapes.shoulder = chamferHeight(description.peg);
  shapes.peg_length = description.peg.half_height + description.peg.coupling_height;
  shapes.hole_radius = description.hole.radius;
  shapes.mouth_radius = mouthRadius(description.hole);
  shapes.chamfer_depth = chamferDepth(description.hole);
  return shapes;
}

}  // namespace assembly_cell::ros_bridge
