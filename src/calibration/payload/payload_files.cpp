// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/payload/payload_files.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/wrench_range.h"

namespace assembly_cell {

namespace {

constexpr double kNearRotation = 0.01;  // digits and rounding of what a file holds
constexpr double kLeastGravity = 9.7, kMostGravity = 9.9;  // on Earth, and an accelerometer's error

// angles times `unit`
std::vector<Eigen::Matrix3d> fromJoints(const Table& table, const JointAngles& joints,
                                        double unit = 1.0) {
  std::vector<std::size_t> column;
  for (std::size_t k = 0; k < joints.names.size(); ++k) {
    column.push_back(table.need({joints.names[k], "j" + std::to_string(k + 1)}));
  }
  std::vector<Eigen::Matrix3d> out;
  std::vector<double> angles(column.size());
  for (const std::vector<double>& row : table.rows) {
    for (std::size_t k = 0; k < column.size(); ++k) angles[k] = unit * row[column[k]];
    out.push_back(joints.rotation(angles));
  }
  return out;
}

std::vector<Eigen::Matrix3d> fromMatrices(const Table& table) {
  std::vector<std::size_t> column;
  for (const char* name : {"r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"}) {
    column.push_back(table.need({name}));
  }
  std::vector<Eigen::Matrix3d> out;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    Eigen::Matrix3d R;
    for (std::size_t k = 0; k < 9; ++k) {
      R(static_cast<Eigen::Index>(k / 3), static_cast<Eigen::Index>(k % 3)) =
          table.rows[i][column[k]];
    }
    // the nearest rotation
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(R, Eigen::ComputeThinU | Eigen::ComputeThinV);
    const double off = (svd.singularValues().array() - 1.0).abs().maxCoeff();
    if (!(off < kNearRotation && R.determinant() > 0.0)) {
      throw InputError(table.place(i) + "r11 to r33 are off a rotation by " + yamlNumber(off) +
                       ": give the matrix of the sensor's axes in the base, row by row");
    }
    out.push_back(svd.matrixU() * svd.matrixV().transpose());
  }
  return out;
}

std::vector<Eigen::Matrix3d> fromVectors(Table& table) {
  constexpr double kLongest = 2.0 * M_PI + 0.01;
  const auto column = table.needAll({{"rx"}, {"ry"}, {"rz"}}, Quantity::kAngle);
  std::vector<Eigen::Matrix3d> out;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<double>& row = table.rows[i];
    const Eigen::Vector3d r(row[column[0]], row[column[1]], row[column[2]]);
    const double angle = r.norm();
    if (angle > kLongest) {
      throw InputError(table.place(i) + "rotation vector rx ry rz has length " + yamlNumber(angle) +
                       ": give the axis times the angle in rad, or name the unit, rx [deg]");
    }
    const Eigen::Vector3d axis =
        angle > 0.0 ? Eigen::Vector3d(r / angle) : Eigen::Vector3d::UnitX();
    out.push_back(Eigen::AngleAxisd(angle, axis).toRotationMatrix());
  }
  return out;
}

bool hasQuaternion(const Table& table) {
  const auto is = [](const std::string& name) {
    return name == "qx" || name == "qy" || name == "qz" || name == "qw";
  };
  return std::any_of(table.names.begin(), table.names.end(), is);
}

// A quaternion's first number as its w.
Eigen::Matrix3d scalarFirst(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  return Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()).toRotationMatrix();
}

std::vector<OtherRotations> otherRotations(const Table& table,
                                           const std::vector<Eigen::Matrix3d>& R,
                                           const JointAngles* joints) {
  if (joints != nullptr) {
    return {{"the joints' angles in degrees", fromJoints(table, *joints, M_PI / 180.0)}};
  }
  if (!hasQuaternion(table)) return {};
  OtherRotations first{"the quaternions w first", {}};
  for (const Eigen::Matrix3d& one : R) first.R.push_back(scalarFirst(one));
  return {first};
}

double gravityOf(const Table& table) {
  const auto g = table.needAll({{"gx"}, {"gy"}, {"gz"}});
  double sum = 0.0;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<double>& row = table.rows[i];
    const double length = std::hypot(row[g[0]], row[g[1]], row[g[2]]);
    if (!(length >= kLeastGravity && length <= kMostGravity)) {
      throw InputError(table.place(i) + "gx, gy, gz have length " + yamlNumber(length) +
                       ": give gravity in m/s2, " + yamlNumber(kLeastGravity) + " to " +
                       yamlNumber(kMostGravity) + " (1 is g), or leave the columns out");
    }
    sum += length;
  }
  return sum / static_cast<double>(table.rows.size());
}

}  // namespace

std::vector<Eigen::Matrix3d> readRotations(Table& table) {
  if (table.find({"r11"})) return fromMatrices(table);
  if (!hasQuaternion(table)) {
    if (table.find({"rx"})) return fromVectors(table);
    throw InputError(table.path +
                     ":1: no rotations: add qx qy qz qw, r11 to r33, or rotation vectors rx ry rz");
  }
  const auto q = table.needAll({{"qx"}, {"qy"}, {"qz"}, {"qw"}});
  std::vector<Eigen::Matrix3d> out;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<double>& row = table.rows[i];
    Eigen::Quaterniond rotation(row[q[3]], row[q[0]], row[q[1]], row[q[2]]);
    const double norm = rotation.norm();
    if (!(std::abs(norm - 1.0) < kNearRotation)) {
      throw InputError(table.place(i) + "quaternion has length " + yamlNumber(norm) +
                       ": give a unit quaternion qx,qy,qz,qw");
    }
    out.push_back(rotation.normalized().toRotationMatrix());
  }
  return out;
}

Poses readPoses(const std::string& path, const JointAngles* joints) {
  std::vector<std::string> names = {"x", "y", "z", "qx", "qy", "qz", "qw"};
  if (joints != nullptr) names = joints->names;
  names.push_back("order");
  Table table = readTable(path, names);
  const std::vector<Eigen::Matrix3d> R =
      joints != nullptr ? fromJoints(table, *joints) : readRotations(table);
  const auto order = table.find({"order", "index", "time", "t"});
  const auto temperature = table.find({"temperature"});
  Poses out;
  out.ordered = order.has_value();
  out.others = otherRotations(table, R, joints);
  if (table.find({"gx"})) out.gravity = gravityOf(table);
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    StaticPose pose;
    pose.R = R[i];
    pose.order = order ? table.rows[i][*order] : static_cast<double>(i);
    if (temperature) pose.temperature = table.rows[i][*temperature];
    out.values.push_back(pose);
  }
  return out;
}

Wrenches readWrenches(const std::string& path) {
  const std::vector<std::string> names = {"fx", "fy", "fz", "tx", "ty", "tz"};
  Table table = readTable(path, names);
  const std::vector<std::size_t> column = wrenchColumns(table);
  Wrenches out;
  out.header = table.header;
  const auto temperature = table.find({"temperature"});
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<double>& row = table.rows[i];
    Vector6 w;
    for (std::size_t k = 0; k < 6; ++k) {
      const double value = w[static_cast<Eigen::Index>(k)] = row[column[k]];
      if (std::abs(value) > (k < 3 ? kLargestForce : kLargestTorque)) {
        throw InputError(table.place(i) + names[k] + " is " + yamlNumber(value) +
                         ": no sensor measures that: it is a code for a fault or an end of its "
                         "numbers (take the row and its pose out), or raw counts (give N, N m)");
      }
    }
    out.values.push_back(w);
    if (temperature) out.temperature.push_back(row[*temperature]);
  }
  return out;
}

}  // namespace assembly_cell
