// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/insertion/forms.h"

#include <cmath>

#include "assembly_cell/base/text.h"
#include "assembly_cell/insertion/compliance.h"
#include "assembly_cell/insertion/jamming.h"
#include "assembly_cell/insertion/two_point.h"
#include "assembly_cell/math/validity.h"

namespace assembly_cell {

namespace {

using P = const ModelParameters&;
using Values = std::vector<ModelValue>;

// Limits of scripts/make_peg and align [m].
constexpr double kMaxPegRadius = 0.06, kMaxHoleRadius = 1.6 * kMaxPegRadius, kMaxDepth = 2.0;

// Length [m]; the upper limit detects millimetres.
double length(P p, const char* key, double max) {
  const double value = p(key);
  if (std::abs(value) > max) refuse(key, value, text("give metres, at most %g m", max).c_str());
  return value;
}

double pegRadius(P p) { return length(p, "peg_radius", kMaxPegRadius); }
double depth(P p) { return length(p, "depth", kMaxDepth); }
PegInHole fitOf(P p) { return {pegRadius(p), length(p, "hole_radius", kMaxHoleRadius)}; }
TipLoad loadOf(P p) { return {p("F_x"), p("F_z"), p("M")}; }
JammingDiagram diagramOf(P p) { return jammingDiagram(pegRadius(p), depth(p), p("friction")); }

const ClosedForm kForms[] = {
    {"two_point", "peg_radius hole_radius tilt", "depth friction", "", "depth lowest wall_contact",
     [](P p) -> Values {
       const TwoPointContact x = twoPointContact(fitOf(p), p("tilt"));
       return {x.depth, x.lowest, x.wall_contact};
     }},
    {"tilt", "peg_radius hole_radius depth", "tilt friction", "", "tilt",
     [](P p) -> Values { return {twoPointTilt(fitOf(p), depth(p))}; }},
    {"wedging", "peg_radius hole_radius friction", "tilt depth", "", "depth tilt",
     [](P p) -> Values {
       return {wedgingDepth(fitOf(p), p("friction")), wedgingTilt(fitOf(p), p("friction"))};
     }},
    {"jamming", "peg_radius depth friction F_x F_z M", "hole_radius tilt", "",
     "lambda lateral moment slides margin",
     [](P p) -> Values {
       const JammingDiagram diagram = diagramOf(p);
       const JammingPoint x = jammingPoint(diagram, loadOf(p));
       return {diagram.lambda, x.lateral, x.moment, x.margin > 0.0, x.margin};
     }},
    {"diagram", "peg_radius depth friction", "hole_radius tilt", "", "lambda lateral moment",
     [](P p) -> Values {
       const JammingDiagram diagram = diagramOf(p);
       std::vector<double> lateral, moment;
       for (const auto& corner : corners(diagram)) {
         lateral.push_back(corner[0]);
         moment.push_back(corner[1]);
       }
       return {diagram.lambda, lateral, moment};
     }},
    {"rest", "peg_radius hole_radius tilt friction F_x F_z M", "depth", "", "rests margin",
     [](P p) -> Values {
       const double margin = restMargin(fitOf(p), p("tilt"), p("friction"), loadOf(p));
       return {margin > 0.0, margin};
     }},
    {"chamfer", "peg_radius hole_radius hole_chamfer peg_chamfer slope friction", "", "",
     "capture slides force_ratio",
     [](P p) -> Values {
       const Chamfers chamfers{length(p, "hole_chamfer", kMaxPegRadius),
                               length(p, "peg_chamfer", kMaxPegRadius), p("slope")};
       const std::optional<double> ratio = chamferForceRatio(chamfers.slope, p("friction"));
       return {captureRange(fitOf(p), chamfers), ratio.has_value(), ratio};
     }},
    {"holder", "K_x K_theta L_g x turn", "", "", "F_x M", [](P p) -> Values {
       const TipLoad load = mountLoad({p("K_x"), p("K_theta"), length(p, "L_g", kMaxDepth)},
                                      length(p, "x", kMaxHoleRadius), p("turn"));
       return {load.F_x, load.M};
     }}};

}  // namespace

const ClosedForm* insertionForm(const std::string& name) { return findForm(kForms, name); }

}  // namespace assembly_cell
