// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/contacts_file.h"

#include <Eigen/Geometry>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {
namespace {

constexpr std::size_t kLargestFile = 8 << 20;
constexpr double kQuaternionNorm = 1e-2;  // rounding of a printed quaternion

using yaml::Range;
using yaml::Section;

Matrix6 readCovariance(Section& in, const char* key, bool semidefinite = false) {
  const auto list = in.numbers<36>(key, Range::kAny);
  const Matrix6 c = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(list.data());
  try {
    checkCovariance(c, in.at(key), semidefinite);
  } catch (const InputError& error) {
    throw InputError(in.source() + ": " + error.what());
  }
  return 0.5 * (c + c.transpose());
}

Pose readPose(Section& in) {
  Pose out;
  out.p = in.numbers<3>("position", Range::kAny);
  const Eigen::Vector4d q = in.numbers<4>("quaternion", Range::kAny);
  if (!(std::abs(q.norm() - 1.0) < kQuaternionNorm)) {
    in.refuse(in.at("quaternion"), "of norm " + yamlNumber(q.norm()),
              "give a unit quaternion x y z w");
  }
  out.R = Eigen::Quaterniond(q.normalized()).toRotationMatrix();
  return out;
}

Pose readMove(Section& in) {
  Section move = in.section("move");
  move.only({"position", "quaternion"});
  return readPose(move);
}

TwinContact readContact(Section& in) {
  in.only({"wrench_a", "wrench_b", "covariance_a", "covariance_b", "move", "move_covariance",
           "time_difference", "moving", "saturated", "tare_age"});
  TwinContact c;
  c.wrench_a = in.numbers<6>("wrench_a", Range::kAny);
  c.wrench_b = in.numbers<6>("wrench_b", Range::kAny);
  c.covariance_a = readCovariance(in, "covariance_a");
  c.covariance_b = readCovariance(in, "covariance_b");
  c.move = readMove(in);
  if (in.has("move_covariance")) c.move_covariance = readCovariance(in, "move_covariance", true);
  c.time_difference = in.number("time_difference", Range::kAny, 0.0);
  c.moving = in.flag("moving", false);
  c.saturated = in.flag("saturated", false);
  c.tare_age = in.number("tare_age", Range::kAny, 0.0);
  return c;
}

ContactCandidate readCandidate(Section& in, const ContactCandidate& defaults) {
  in.only({"move", "point", "force", "covariance_a", "covariance_b", "move_covariance"});
  ContactCandidate c = defaults;
  c.move = readMove(in);
  c.point = in.numbers<3>("point", Range::kAny);
  c.force = in.numbers<3>("force", Range::kAny);
  if (!(c.force.norm() > 0.0)) {
    in.refuse(in.at("force"), "zero", "give the expected force on B");
  }
  if (in.has("covariance_a")) c.covariance_a = readCovariance(in, "covariance_a");
  if (in.has("covariance_b")) c.covariance_b = readCovariance(in, "covariance_b");
  if (in.has("move_covariance")) c.move_covariance = readCovariance(in, "move_covariance", true);
  return c;
}

template <int N>
std::string rowByRow(const Eigen::Matrix<double, N, N>& m) {
  const Eigen::Matrix<double, N, N> transposed = m.transpose();
  return yamlList(Eigen::Map<const Eigen::Matrix<double, N * N, 1>>(transposed.data()));
}

std::string poseText(const Pose& X) {
  const Eigen::Quaterniond q(X.R);
  return "position: " + yamlList(X.p) + ", quaternion: " + yamlList(q.coeffs());
}

SensorErrors readErrors(Section in) {
  in.only({"position", "quaternion", "gain", "arm", "rotation", "offset", "gain_covariance"});
  SensorErrors e;
  e.frame = readPose(in);
  e.gain = in.number("gain", Range::kNotNegative);
  e.arm = in.number("arm", Range::kPositive, e.arm);
  e.rotation = in.number("rotation", Range::kNotNegative);
  e.offset = in.number("offset", Range::kNotNegative);
  if (in.has("gain_covariance")) {
    constexpr std::size_t kEntries = 36;
    const std::vector<double> numbers = in.numbers("gain_covariance", kEntries * kEntries);
    e.gain_covariance = Eigen::Map<const Eigen::MatrixXd>(numbers.data(), kEntries, kEntries);
  }
  return e;
}

std::string errorsText(const SensorErrors& e) {
  std::string out = "{" + poseText(e.frame) + ", gain: " + yamlNumber(e.gain) +
                    ", arm: " + yamlNumber(e.arm) + ", rotation: " + yamlNumber(e.rotation) +
                    ", offset: " + yamlNumber(e.offset);
  // symmetric
  if (e.gain_covariance.size() > 0) {
    out += ", gain_covariance: " + yamlList(e.gain_covariance.reshaped());
  }
  return out + "}";
}

}  // namespace

ContactsFile parseContacts(const std::string& yaml, const std::string& source) {
  Section file(yaml::loadYaml(yaml, source, yaml::FileKind::kContacts), "", source);
  file.only({"contacts", "prior", "tare_covariance", "errors", "candidates"});
  ContactsFile out;
  for (Section& contact : file.sections("contacts")) out.contacts.push_back(readContact(contact));
  if (file.has("prior")) {
    Section prior = file.section("prior");
    prior.only({"position", "quaternion", "covariance"});
    out.prior = PosePrior{readPose(prior), readCovariance(prior, "covariance")};
  }
  if (file.has("tare_covariance")) {
    const auto numbers = file.numbers<144>("tare_covariance", Range::kAny);
    out.tare_covariance =
        Eigen::Map<const Eigen::Matrix<double, 12, 12, Eigen::RowMajor>>(numbers.data());
  }
  if (file.has("errors")) {
    Section errors = file.section("errors");
    errors.only({"sensor_a", "sensor_b"});
    out.errors =
        TwinErrors{readErrors(errors.section("sensor_a")), readErrors(errors.section("sensor_b"))};
  }
  if (file.has("candidates")) {
    // noise as in the contacts
    ContactCandidate defaults;
    if (!out.contacts.empty()) {
      defaults.covariance_a = out.contacts.back().covariance_a;
      defaults.covariance_b = out.contacts.back().covariance_b;
    }
    for (Section& candidate : file.sections("candidates")) {
      out.candidates.push_back(readCandidate(candidate, defaults));
    }
  }
  return out;
}

ContactsFile loadContacts(const std::string& path) {
  return parseContacts(yaml::fileText(path, "contacts", kLargestFile), path);
}

std::string contactsYaml(const ContactsFile& file) {
  std::string out = file.contacts.empty() ? "contacts: []\n" : "contacts:\n";
  for (const TwinContact& c : file.contacts) {
    out += "  - wrench_a: " + yamlList(c.wrench_a) + "\n";
    out += "    wrench_b: " + yamlList(c.wrench_b) + "\n";
    out += "    covariance_a: " + rowByRow<6>(c.covariance_a) + "\n";
    out += "    covariance_b: " + rowByRow<6>(c.covariance_b) + "\n";
    out += "    move: {" + poseText(c.move) + "}\n";
    if (c.move_covariance) out += "    move_covariance: " + rowByRow<6>(*c.move_covariance) + "\n";
    if (c.time_difference != 0.0) {
      out += "    time_difference: " + yamlNumber(c.time_difference) + "\n";
    }
    if (c.moving) out += "    moving: true\n";
    if (c.saturated) out += "    saturated: true\n";
    if (c.tare_age != 0.0) out += "    tare_age: " + yamlNumber(c.tare_age) + "\n";
  }
  if (file.prior) {
    out += "prior: {" + poseText(file.prior->pose) +
           ", covariance: " + rowByRow<6>(file.prior->covariance) + "}\n";
  }
  if (file.tare_covariance) {
    out += "tare_covariance: " + rowByRow<12>(*file.tare_covariance) + "\n";
  }
  if (file.errors) {
    out += "errors:\n  sensor_a: " + errorsText(file.errors->a) +
           "\n  sensor_b: " + errorsText(file.errors->b) + "\n";
  }
  if (!file.candidates.empty()) out += "candidates:\n";
  for (const ContactCandidate& c : file.candidates) {
    out += "  - move: {" + poseText(c.move) + "}\n";
    out += "    point: " + yamlList(c.point) + "\n    force: " + yamlList(c.force) + "\n";
    out += "    covariance_a: " + rowByRow<6>(c.covariance_a) + "\n";
    out += "    covariance_b: " + rowByRow<6>(c.covariance_b) + "\n";
    if (c.move_covariance) out += "    move_covariance: " + rowByRow<6>(*c.move_covariance) + "\n";
  }
  return out;
}

}  // namespace assembly_cell
