// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/arm_joints.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr double kMaxPosition = 1e3;    // of a joint: some turns [rad]
constexpr std::size_t kMaxListed = 12;  // names in a line

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// Letters and digits only, lower case.
std::string plain(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0) out += static_cast<char>(std::tolower(byte));
  }
  return out;
}

// Whether two names differ only by a prefix or suffix, by case or by separators.
bool isSimilar(const std::string& one, const std::string& other) {
  const std::string a = plain(one), b = plain(other);
  if (a.empty() || b.empty()) return false;
  return a.find(b) != std::string::npos || b.find(a) != std::string::npos;
}

std::string list(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < names.size() && i < kMaxListed; ++i) {
    out += (i == 0 ? "" : ", ") + printable(names[i]);
  }
  if (names.size() > kMaxListed) out += text(" and %zu more", names.size() - kMaxListed);
  return out;
}

}  // namespace

ArmJoints::Share ArmJoints::shareOf(const std::vector<std::string>& names) const {
  const std::vector<std::string>& joints = kinematics_->names();
  const auto found = std::count_if(joints.begin(), joints.end(), [&](const std::string& joint) {
    return contains(names, joint);
  });
  if (found == 0) return Share::kNone;
  return found == static_cast<std::ptrdiff_t>(joints.size()) ? Share::kAll : Share::kSome;
}

std::size_t ArmJoints::similar(const std::vector<std::string>& names) const {
  const std::vector<std::string>& joints = kinematics_->names();
  return static_cast<std::size_t>(
      std::count_if(names.begin(), names.end(), [&](const std::string& name) {
        return std::any_of(joints.begin(), joints.end(),
                           [&](const std::string& joint) { return isSimilar(name, joint); });
      }));
}

std::string ArmJoints::missing(const std::vector<std::string>& names) const {
  std::vector<std::string> absent, like;
  for (const std::string& joint : kinematics_->names()) {
    if (contains(names, joint)) continue;
    absent.push_back(joint);
    for (const std::string& name : names) {
      if (isSimilar(name, joint) && !contains(like, name)) like.push_back(name);
    }
  }
  const std::string lack = "the joints " + list(absent) + " of the URDF are missing";
  if (!like.empty()) {
    return lack + ", similar are " + list(like) + ": give the URDF and the driver the same names";
  }
  return lack + ", it has " + (names.empty() ? "no names" : list(names)) +
         ": all joints of the arm have to be in one message";
}

std::string ArmJoints::update(const std::vector<std::string>& names,
                              const std::vector<double>& positions) {
  const std::vector<std::string>& joints = kinematics_->names();
  next_.resize(kinematics_->joints());
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const auto found = std::find(names.begin(), names.end(), joints[k]);
    const auto index = static_cast<std::size_t>(found - names.begin());
    if (index >= positions.size()) return "joint " + joints[k] + " has no position";
    if (std::find(found + 1, names.end(), joints[k]) != names.end()) {
      return "joint " + joints[k] + " is named twice";
    }
    const double q = positions[index];
    if (!(std::abs(q) <= kMaxPosition)) {
      return text("position of joint %s is %g: give %g to %g", joints[k].c_str(), q, -kMaxPosition,
                  kMaxPosition);
    }
    next_(static_cast<Eigen::Index>(k)) = q;
  }
  // an arm at rest reports the same again
  if (next_.size() == q_.size() && next_ == q_) return {};
  q_ = next_;
  X_base_flange_ = kinematics_->forward(q_);
  beyond_limit_ = kinematics_->beyondLimit(q_);
  return {};
}

}  // namespace assembly_cell
