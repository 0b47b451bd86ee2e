// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/description/cell_description.h"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/description/part_pairs.h"
#include "urdf_pose.h"

namespace assembly_cell {
namespace {

// Relative rounding of decimal numbers in text.
constexpr double kRounding = 1e-9;
// Maximum overlap of the block's shapes with the bore [m].
constexpr double kWallTolerance = 1e-5;

std::string shown(double value) {
  std::ostringstream out;
  out.precision(12);
  out << value;
  return out.str();
}

std::string shown(const Eigen::Vector3d& v) {
  return "(" + shown(v.x()) + ", " + shown(v.y()) + ", " + shown(v.z()) + ")";
}

bool same(double a, double b) {
  return std::abs(a - b) <= kRounding * std::max({std::abs(a), std::abs(b)});
}

[[noreturn]] void refuse(const std::string& source, const std::string& item,
                         const std::string& value, const std::string& remedy) {
  std::string line = source + ": " + item + ": value " + value + ": " + remedy;
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  }
  throw InputError(line);
}

// Collects the error messages of the URDF parser instead of printing them.
class Complaints : public console_bridge::OutputHandler {
 public:
  Complaints() { console_bridge::useOutputHandler(this); }
  ~Complaints() override { console_bridge::restorePreviousOutputHandler(); }
  Complaints(const Complaints&) = delete;
  Complaints& operator=(const Complaints&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level < console_bridge::CONSOLE_BRIDGE_LOG_ERROR) return;
    text_ += (text_.empty() ? "" : "; ") + text;
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

class Reader {
 public:
  Reader(const std::string& urdf, std::string source) : source_(std::move(source)) {
    Complaints complaints;
    model_ = urdf::parseURDF(urdf);
    // the parser keeps a link whose mass or shape is invalid without it: its messages are errors
    if (!model_ || !complaints.text().empty()) {
      refuse("file", "unreadable", "no valid URDF (" + complaints.text() + "), correct it");
    }
  }

  [[noreturn]] void refuse(const std::string& item, const std::string& value,
                           const std::string& remedy) const {
    assembly_cell::refuse(source_, item, value, remedy);
  }

  const urdf::Link& link(const std::string& name) const {
    const urdf::LinkConstSharedPtr found = model_->getLink(name);
    if (!found) refuse("link " + name, "missing", "add this link");
    return *found;
  }

  /// Pose of a link in its parent, which must be `parent`; the joint must be of the type and
  /// unrotated.
  Pose jointPose(const std::string& parent, const std::string& child, int type) const {
    const urdf::JointSharedPtr joint = link(child).parent_joint;
    if (!joint) refuse("joint " + parent + " -> " + child, "missing", "add this joint");
    const std::string item = "joint " + joint->name;
    if (joint->parent_link_name != parent) {
      refuse(item + ": parent", joint->parent_link_name,
             "the parent of " + child + " is " + parent);
    }
    if (joint->type != type) {
      refuse(item + ": type", std::to_string(joint->type),
             type == urdf::Joint::FIXED ? "make it fixed" : "make it floating");
    }
    const Pose X = poseOf(joint->parent_to_joint_origin_transform);
    // any rotation of the cell in the world
    checkPose(item, parent == "world" ? Pose{Eigen::Matrix3d::Identity(), X.p} : X);
    return X;
  }

  /// Inertial element with positive mass.
  const urdf::Inertial& inertial(const std::string& name) const {
    const urdf::InertialSharedPtr& found = link(name).inertial;
    const std::string item = "link " + name + ": inertial";
    if (!found) refuse(item, "missing", "add mass and inertia");
    if (!(std::isfinite(found->mass) && found->mass > 0.0)) {
      refuse(item + ": mass", shown(found->mass), "give a finite number > 0");
    }
    checkPose(item, poseOf(found->origin));
    return *found;
  }

  /// Collision shapes of a link in the axes that X_BL leads to; at least one.
  Part part(const std::string& name, const Pose& X_BL) const {
    Part part{name, {}};
    for (const urdf::CollisionSharedPtr& collision : link(name).collision_array) {
      const std::string item = "link " + name + ": collision " + collision->name;
      part.shapes.push_back(shape(item, collision->geometry, X_BL * poseOf(collision->origin)));
    }
    if (part.shapes.empty()) {
      refuse("link " + name + ": collision", "missing", "add a box or cylinder");
    }
    return part;
  }

  PartShape shape(const std::string& item, const urdf::GeometrySharedPtr& geometry,
                  const Pose& X) const {
    PartShape shape;
    if (geometry && geometry->type == urdf::Geometry::BOX) {
      const urdf::Vector3& dim = static_cast<const urdf::Box&>(*geometry).dim;
      shape.size = Eigen::Vector3d(dim.x, dim.y, dim.z);
    } else if (geometry && geometry->type == urdf::Geometry::CYLINDER) {
      const auto& cylinder = static_cast<const urdf::Cylinder&>(*geometry);
      shape.kind = PartShape::Kind::kCylinder;
      shape.size = Eigen::Vector3d(2.0 * cylinder.radius, 2.0 * cylinder.radius, cylinder.length);
    } else {
      refuse(item + ": geometry", "neither box nor cylinder", "use a box or a cylinder");
    }
    if (!shape.size.allFinite() || !(shape.size.minCoeff() > 0.0)) {
      refuse(item + ": size", shown(shape.size), "give finite numbers > 0");
    }
    if (!X.p.allFinite() || !X.R.allFinite()) {
      refuse(item + ": origin", shown(X.p), "give finite numbers");
    }
    shape.X_PS = X;
    return shape;
  }

  /// z of a point, which must be on the z axis.
  double onAxis(const std::string& item, const Eigen::Vector3d& p) const {
    if (p.x() != 0.0 || p.y() != 0.0) refuse(item, shown(p), "x and y must be 0");
    return p.z();
  }

  void checkPose(const std::string& item, const Pose& X) const {
    if (!X.p.allFinite() || !X.R.allFinite()) {
      refuse(item + ": origin", shown(X.p), "give finite numbers");
    }
    if (!X.R.isIdentity(kRounding)) refuse(item + ": origin rpy", "not zero", "must be 0 0 0");
  }

 private:
  std::string source_;
  urdf::ModelInterfaceSharedPtr model_;
};

// Coaxial cylinder of the peg [m].
struct Disc {
  double radius, low, high;
};

std::vector<Disc> readDiscs(const Reader& in, const Part& part, const std::string& item) {
  std::vector<Disc> discs;
  for (const PartShape& shape : part.shapes) {
    if (shape.kind != PartShape::Kind::kCylinder) {
      in.refuse(item, "a box",
                "give exactly one cylinder, the peg's radius and length, or those of a chamfer "
                "below it, too");
    }
    in.checkPose(item, shape.X_PS);
    const double middle = in.onAxis(item + ": origin", shape.X_PS.p);
    const double half = 0.5 * shape.size.z();
    discs.push_back({0.5 * shape.size.x(), middle - half, middle + half});
  }
  return discs;
}

// Radii and chamfer of a chamfered peg, from a cylinder above the shoulder and narrower ones inside
// the cone, of which the lowest has the radius of the bottom edge.
void readChamfer(const Reader& in, const std::vector<Disc>& discs, const std::string& item,
                 PegParameters& peg) {
  const auto wider = [](const Disc& a, const Disc& b) { return a.radius < b.radius; };
  const Disc side = *std::max_element(discs.begin(), discs.end(), wider);
  const Disc tip = *std::min_element(discs.begin(), discs.end(), wider);
  peg.radius = side.radius;
  peg.half_height = 0.5 * side.high;
  peg.chamfer_width = side.radius - tip.radius;
  peg.chamfer_angle = std::atan2(peg.chamfer_width, side.low);
  // absolute rounding of differences of lengths
  const double rounding = kRounding * side.high;
  if (!(std::abs(tip.low) <= rounding)) {
    in.refuse(item + ": origin z", shown(tip.low),
              "the narrowest cylinder begins at 0, the bottom edge");
  }
  if (!(peg.chamfer_width > 0.0) || !(side.low > 0.0)) {
    in.refuse(item, std::to_string(discs.size()) + " cylinders of one radius or height",
              "give exactly one cylinder, or narrower ones below the widest");
  }
  for (const Disc& disc : discs) {
    const double widest = tip.radius + peg.chamfer_width * std::min(1.0, disc.low / side.low);
    if (disc.radius <= widest + rounding) continue;
    in.refuse(item + ": radius", shown(disc.radius),
              "wider than the chamfer where it begins, " + shown(widest) + " m");
  }
}

// Checks that cylinders, centre of mass and inertia of the peg are consistent: a body of revolution
// with its frame at the centre of the bottom edge.
PegParameters readPeg(const Reader& in) {
  PegParameters peg;
  const Part part = in.part("peg", Pose());
  const std::string collision = "link peg: collision";
  const std::vector<Disc> discs = readDiscs(in, part, collision);
  if (discs.size() == 1) {
    peg.radius = discs[0].radius;
    peg.half_height = 0.5 * part.shapes[0].size.z();
    const double middle = part.shapes[0].X_PS.p.z();
    if (!same(middle, peg.half_height)) {
      in.refuse(collision + ": origin z", shown(middle),
                "half the cylinder's length is " + shown(peg.half_height) +
                    ", make them equal: the frame lies at the bottom edge");
    }
  } else {
    readChamfer(in, discs, collision, peg);
  }

  const urdf::Inertial& inertial = in.inertial("peg");
  const double centre = in.onAxis("link peg: inertial: origin", poseOf(inertial.origin).p);
  if (!same(centre, peg.half_height)) {
    in.refuse("link peg: inertial: origin z", shown(centre),
              "half the cylinder's length is " + shown(peg.half_height) + ", make them equal");
  }
  if (inertial.ixy != 0.0 || inertial.ixz != 0.0 || inertial.iyz != 0.0) {
    in.refuse("link peg: inertia", shown({inertial.ixy, inertial.ixz, inertial.iyz}),
              "ixy, ixz, iyz must be 0");
  }
  if (!same(inertial.ixx, inertial.iyy) || !(inertial.ixx > 0.0)) {
    in.refuse("link peg: inertia ixx, iyy", shown(inertial.ixx) + ", " + shown(inertial.iyy),
              "give two equal numbers > 0");
  }
  if (!(inertial.izz > 0.0) || inertial.izz > 2.0 * inertial.ixx) {
    in.refuse("link peg: inertia izz", shown(inertial.izz),
              "give a number > 0 and at most twice ixx (" + shown(inertial.ixx) + ")");
  }
  peg.mass = inertial.mass;
  peg.inertia_transverse = inertial.ixx;
  peg.inertia_axial = inertial.izz;
  return peg;
}

// Visual of the link `hole` with this name, a cylinder from the face down [m]; empty if missing.
struct Hollow {
  double radius, depth;
};
std::optional<Hollow> readHollow(const Reader& in, const std::string& name) {
  const urdf::VisualSharedPtr* found = nullptr;
  for (const urdf::VisualSharedPtr& visual : in.link("hole").visual_array) {
    if (visual->name != name) continue;
    if (found != nullptr) in.refuse("link hole: visual " + name, "several", "keep one of them");
    found = &visual;
  }
  if (found == nullptr) return {};
  const std::string item = "link hole: visual " + name;
  const PartShape cylinder = in.shape(item, (*found)->geometry, poseOf((*found)->origin));
  if (cylinder.kind != PartShape::Kind::kCylinder) in.refuse(item, "a box", "give a cylinder");
  in.checkPose(item, cylinder.X_PS);
  const double depth = cylinder.size.z();
  const double middle = in.onAxis(item + ": origin", cylinder.X_PS.p);
  if (!same(middle, -0.5 * depth)) {
    in.refuse(
        item + ": origin z", shown(middle),
        "half the cylinder's length below the rim is " + shown(-0.5 * depth) + ", make them equal");
  }
  return Hollow{0.5 * cylinder.size.x(), depth};
}

// Refuses shapes of the block that overlap a cylinder around the hole's axis.
void checkFree(const Reader& in, const Part& block, const char* what, double radius, double top,
               double bottom) {
  PartShape cylinder;
  cylinder.kind = PartShape::Kind::kCylinder;
  cylinder.size = Eigen::Vector3d(2.0 * radius, 2.0 * radius, top - bottom);
  cylinder.size -= Eigen::Vector3d::Constant(2.0 * kWallTolerance);
  if (!(cylinder.size.minCoeff() > 0.0)) return;
  cylinder.X_PS.p.z() = 0.5 * (top + bottom);
  for (const PartShape& shape : block.shapes) {
    if (shapesMeet(cylinder, shape)) {
      in.refuse("link hole: collision at " + shown(shape.X_PS.p), shown(shape.size),
                std::string("reaches into the ") + what + " of radius " + shown(radius) +
                    ", move or shrink it");
    }
  }
}

// The visual `bore` has radius and depth of the hole; an optional visual `chamfer` has the radius
// of its mouth and the depth of the chamfer.
HoleParameters readBore(const Reader& in, const Part& block) {
  const std::optional<Hollow> bore = readHollow(in, "bore"), mouth = readHollow(in, "chamfer");
  if (!bore) {
    in.refuse("link hole: visual bore", "missing", "add a cylinder of the hole's radius and depth");
  }
  checkFree(in, block, "bore", bore->radius, 0.0, -bore->depth);
  HoleParameters hole;
  hole.radius = bore->radius;
  hole.depth = bore->depth;
  if (!mouth) return hole;
  const std::string item = "link hole: visual chamfer";
  hole.chamfer_width = mouth->radius - bore->radius;
  if (!(hole.chamfer_width > 0.0)) {
    in.refuse(item + ": radius", shown(mouth->radius),
              "give more than the bore's, " + shown(bore->radius));
  }
  if (!(mouth->depth < bore->depth)) {
    in.refuse(item + ": length", shown(mouth->depth),
              "give less than the bore's, " + shown(bore->depth));
  }
  hole.chamfer_angle = std::atan2(hole.chamfer_width, mouth->depth);
  // cylinders inside the cone
  constexpr int kSteps = 8;
  for (int i = 0; i < kSteps; ++i) {
    const double top = -mouth->depth * i / kSteps, bottom = -mouth->depth * (i + 1) / kSteps;
    const double radius = mouth->radius - hole.chamfer_width * (i + 1) / kSteps;
    checkFree(in, block, "chamfer", radius, top, bottom);
  }
  return hole;
}

}  // namespace

CellDescription loadCellDescription(const std::string& urdf, const std::string& source) {
  const Reader in(urdf, source);
  CellDescription cell;

  // the fixed side: world -> sensor_a -> hole
  in.link("world");
  cell.X_WA = in.jointPose("world", "sensor_a", urdf::Joint::FIXED);
  cell.X_AH = in.jointPose("sensor_a", "hole", urdf::Joint::FIXED);
  cell.fixed_parts = {in.part("sensor_a", inverse(cell.X_AH)), in.part("hole", Pose())};
  cell.hole = readBore(in, cell.fixed_parts[1]);
  const urdf::Inertial& block = in.inertial("hole");
  cell.hole_block_mass = block.mass;
  cell.hole_block_centre = poseOf(block.origin).p;

  // the moving side: world -> carrier -> sensor_b -> peg -> exciter
  in.jointPose("world", "carrier", urdf::Joint::FLOATING);
  const Pose X_CB = in.jointPose("carrier", "sensor_b", urdf::Joint::FIXED);
  if (X_CB.p != Eigen::Vector3d::Zero()) {
    in.refuse("joint of sensor_b: origin", shown(X_CB.p),
              "must be 0 0 0: sensor_b is the coupling at the carrier's frame");
  }
  cell.X_BP = in.jointPose("sensor_b", "peg", urdf::Joint::FIXED);
  const Pose X_PE = in.jointPose("peg", "exciter", urdf::Joint::FIXED);
  cell.moving_parts = {in.part("carrier", Pose()), in.part("sensor_b", Pose()),
                       in.part("peg", cell.X_BP)};
  const urdf::Inertial& carrier = in.inertial("carrier");
  cell.carrier_mass = carrier.mass;
  cell.carrier_inertia = carrier.izz;
  if (!(std::isfinite(carrier.izz) && carrier.izz > 0.0)) {
    in.refuse("link carrier: inertia izz", shown(carrier.izz), "give a finite number > 0");
  }

  // both joints of the peg are heights above its bottom edge
  cell.peg = readPeg(in);
  const double coupling = -in.onAxis("joint of peg: origin", cell.X_BP.p);
  if (!(coupling > cell.peg.half_height)) {
    in.refuse("joint of peg: origin z", shown(-coupling),
              "the coupling must lie above the peg's centre of mass, give less than " +
                  shown(-cell.peg.half_height));
  }
  cell.peg.coupling_height = coupling - cell.peg.half_height;
  cell.peg.exciter_height = in.onAxis("joint of exciter: origin", X_PE.p) - cell.peg.half_height;
  return cell;
}

void checkAgainst(const CellDescription& description, const Mechanism& mechanism,
                  const std::string& scenario) {
  const PegParameters& peg = description.peg;
  const struct {
    const char* key;
    double in_scenario;
    double in_urdf;
    const char* element;
  } values[] = {
      {"peg.radius", mechanism.peg.radius, peg.radius, "link peg, collision cylinder"},
      {"peg.half_height", mechanism.peg.half_height, peg.half_height,
       "link peg, half its collision cylinder"},
      {"peg.chamfer.width", mechanism.peg.chamfer_width, peg.chamfer_width,
       "link peg, widest collision cylinder less the narrowest"},
      {"peg.chamfer.angle", mechanism.peg.chamfer_angle,
       mechanism.peg.chamfer_width > 0.0 ? peg.chamfer_angle : mechanism.peg.chamfer_angle,
       "link peg, collision cylinders below the widest"},
      {"peg.mass", mechanism.peg.mass, peg.mass, "link peg, inertial"},
      {"peg.inertia_transverse", mechanism.peg.inertia_transverse, peg.inertia_transverse,
       "link peg, ixx"},
      {"peg.inertia_axial", mechanism.peg.inertia_axial, peg.inertia_axial, "link peg, izz"},
      {"peg.coupling_height", mechanism.peg.coupling_height, peg.coupling_height,
       "joint of peg, less half the peg"},
      {"peg.exciter_height", mechanism.peg.exciter_height, peg.exciter_height,
       "joint of exciter, less half the peg"},
      {"hole.radius", mechanism.hole.radius, description.hole.radius, "link hole, visual bore"},
      {"hole.depth",
       std::isinf(mechanism.hole.depth) ? description.hole.depth : mechanism.hole.depth,
       description.hole.depth, "link hole, visual bore"},
      {"hole.chamfer.width", mechanism.hole.chamfer_width, description.hole.chamfer_width,
       "link hole, visual chamfer less visual bore"},
      {"hole.chamfer.angle", mechanism.hole.chamfer_angle,
       mechanism.hole.chamfer_width > 0.0 ? description.hole.chamfer_angle
                                          : mechanism.hole.chamfer_angle,
       "link hole, visual chamfer"},
      {"carrier.mass", mechanism.carrier.mass, description.carrier_mass, "link carrier, inertial"},
      {"carrier.inertia", mechanism.carrier.inertia, description.carrier_inertia,
       "link carrier, izz"},
  };
  for (const auto& value : values) {
    if (same(value.in_scenario, value.in_urdf)) continue;
    refuse("scenario " + scenario, value.key, shown(value.in_scenario),
           "the URDF has " + shown(value.in_urdf) + " (" + value.element + "), make them equal");
  }
}

}  // namespace assembly_cell
