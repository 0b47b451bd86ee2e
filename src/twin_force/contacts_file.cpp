// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/contacts_file.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <initializer_list>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {
namespace {

constexpr std::size_t kLargestFile = 8 << 20;
constexpr double kQuaternionNorm = 1e-2;  // rounding of a printed quaternion

// A node and where it stands.
class Item {
 public:
  Item(YAML::Node node, std::string path, const std::string& source)
      : node_(std::move(node)), path_(std::move(path)), source_(&source) {}

  [[noreturn]] void refuse(const std::string& value, const std::string& remedy) const {
    std::string line = *source_ + ": " + path_ + ": value " + value + ": " + remedy;
    for (char& c : line) {
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
    }
    throw InputError(line);
  }

  std::string shown() const {
    if (!node_.IsDefined()) return "missing";
    if (node_.IsNull()) return "empty";
    if (node_.IsMap()) return "a mapping";
    if (node_.IsSequence()) return "a list of " + std::to_string(node_.size());
    return node_.Scalar().substr(0, 60);
  }

  // a mapping with these keys only, each once
  void mapping(std::initializer_list<const char*> keys) const {
    if (!node_.IsDefined() || !node_.IsMap()) refuse(shown(), "give a mapping of keys");
    std::vector<std::string> seen;
    for (const auto& entry : node_) {
      if (!entry.first.IsScalar()) refuse("a list or mapping as key", "a key must be a plain word");
      const std::string key = entry.first.Scalar();
      const Item item(entry.second, join(key), *source_);
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
        item.refuse(item.shown(), "unknown key, remove it or see docs/twin_force.md");
      }
      if (std::find(seen.begin(), seen.end(), key) != seen.end()) {
        item.refuse(item.shown(), "duplicate key, keep one of them");
      }
      seen.push_back(key);
    }
  }

  bool has(const char* key) const { return static_cast<const YAML::Node&>(node_)[key].IsDefined(); }
  Item operator[](const char* key) const {
    return {static_cast<const YAML::Node&>(node_)[key], join(key), *source_};
  }
  Item element(std::size_t i) const {
    return {node_[i], path_ + "[" + std::to_string(i) + "]", *source_};
  }
  std::size_t size() const {
    if (!node_.IsDefined() || !node_.IsSequence()) refuse(shown(), "give a list");
    return node_.size();
  }
  const std::string& path() const { return path_; }
  const std::string& source() const { return *source_; }

  double number() const {
    double value = 0.0;
    if (!node_.IsDefined() || !node_.IsScalar() || node_.Tag() == "!" ||
        !parseNumber(node_.Scalar(), value)) {
      refuse(shown(), "give a finite number");
    }
    return value;
  }

  bool flag() const {
    bool value = false;
    if (!node_.IsDefined() || !node_.IsScalar() || !YAML::convert<bool>::decode(node_, value)) {
      refuse(shown(), "give true or false");
    }
    return value;
  }

  template <int N>
  Eigen::Matrix<double, N, 1> numbers(const char* what) const {
    if (!node_.IsDefined() || !node_.IsSequence() || node_.size() != static_cast<std::size_t>(N)) {
      refuse(shown(), "give a list of " + std::to_string(N) + " numbers (" + what + ")");
    }
    Eigen::Matrix<double, N, 1> out;
    for (int i = 0; i < N; ++i) out[i] = element(static_cast<std::size_t>(i)).number();
    return out;
  }

  Matrix6 covariance(bool semidefinite) const {
    const auto list = numbers<36>("6 x 6, row by row");
    const Matrix6 c = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(list.data());
    try {
      checkCovariance(c, path_, semidefinite);
    } catch (const InputError& error) {
      throw InputError(*source_ + ": " + error.what());
    }
    return 0.5 * (c + c.transpose());
  }

  Pose pose() const {
    Pose out;
    out.p = (*this)["position"].numbers<3>("x y z in m");
    const Item turn = (*this)["quaternion"];
    const Eigen::Vector4d q = turn.numbers<4>("x y z w");
    if (!(std::abs(q.norm() - 1.0) < kQuaternionNorm)) {
      turn.refuse("of norm " + yamlNumber(q.norm()), "give a unit quaternion x y z w");
    }
    out.R = Eigen::Quaterniond(q.normalized()).toRotationMatrix();
    return out;
  }

 private:
  std::string join(const std::string& key) const {
    return path_ == "file" ? key : path_ + "." + key;
  }

  YAML::Node node_;
  std::string path_;
  const std::string* source_;
};

TwinContact readContact(const Item& in) {
  in.mapping({"wrench_a", "wrench_b", "covariance_a", "covariance_b", "move", "move_covariance",
              "time_difference", "moving", "saturated", "tare_age"});
  TwinContact c;
  c.wrench_a = in["wrench_a"].numbers<6>("force in N, moment in N m");
  c.wrench_b = in["wrench_b"].numbers<6>("force in N, moment in N m");
  c.covariance_a = in["covariance_a"].covariance(false);
  c.covariance_b = in["covariance_b"].covariance(false);
  in["move"].mapping({"position", "quaternion"});
  c.move = in["move"].pose();
  if (in.has("move_covariance")) c.move_covariance = in["move_covariance"].covariance(true);
  if (in.has("time_difference")) c.time_difference = in["time_difference"].number();
  if (in.has("moving")) c.moving = in["moving"].flag();
  if (in.has("saturated")) c.saturated = in["saturated"].flag();
  if (in.has("tare_age")) c.tare_age = in["tare_age"].number();
  return c;
}

ContactCandidate readCandidate(const Item& in, const ContactCandidate& defaults) {
  in.mapping({"move", "point", "force", "covariance_a", "covariance_b", "move_covariance"});
  ContactCandidate c = defaults;
  in["move"].mapping({"position", "quaternion"});
  c.move = in["move"].pose();
  c.point = in["point"].numbers<3>("on the line, axes of B, in m");
  c.force = in["force"].numbers<3>("on B, axes of B, in N");
  if (!(c.force.norm() > 0.0)) in["force"].refuse("zero", "give the expected force on B");
  if (in.has("covariance_a")) c.covariance_a = in["covariance_a"].covariance(false);
  if (in.has("covariance_b")) c.covariance_b = in["covariance_b"].covariance(false);
  if (in.has("move_covariance")) c.move_covariance = in["move_covariance"].covariance(true);
  return c;
}

template <typename Numbers>
std::string list(const Numbers& numbers) {
  std::string out = "[";
  for (Eigen::Index i = 0; i < numbers.size(); ++i) {
    out += (i == 0 ? "" : ", ") + yamlNumber(numbers[i]);
  }
  return out + "]";
}

template <int N>
std::string rowByRow(const Eigen::Matrix<double, N, N>& m) {
  const Eigen::Matrix<double, N, N> transposed = m.transpose();
  return list(Eigen::Map<const Eigen::Matrix<double, N * N, 1>>(transposed.data()));
}

std::string poseText(const Pose& X) {
  const Eigen::Quaterniond q(X.R);
  return "position: " + list(X.p) + ", quaternion: " + list(q.coeffs());
}

}  // namespace

ContactsFile parseContacts(const std::string& yaml, const std::string& source) {
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    throw InputError(source + ":" + std::to_string(error.mark.line + 1) +
                     ": value not YAML: " + "give a mapping with the key contacts");
  }
  const Item file(root, "file", source);
  file.mapping({"contacts", "prior", "tare_covariance", "candidates"});
  ContactsFile out;
  const Item contacts = file["contacts"];
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    out.contacts.push_back(readContact(contacts.element(i)));
  }
  if (file.has("prior")) {
    const Item prior = file["prior"];
    prior.mapping({"position", "quaternion", "covariance"});
    out.prior = PosePrior{prior.pose(), prior["covariance"].covariance(false)};
  }
  if (file.has("tare_covariance")) {
    const Item tare = file["tare_covariance"];
    const auto numbers = tare.numbers<144>("12 x 12, row by row");
    out.tare_covariance =
        Eigen::Map<const Eigen::Matrix<double, 12, 12, Eigen::RowMajor>>(numbers.data());
  }
  if (file.has("candidates")) {
    const Item candidates = file["candidates"];
    // noise as in the contacts
    ContactCandidate defaults;
    if (!out.contacts.empty()) {
      defaults.covariance_a = out.contacts.back().covariance_a;
      defaults.covariance_b = out.contacts.back().covariance_b;
    }
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      out.candidates.push_back(readCandidate(candidates.element(i), defaults));
    }
  }
  return out;
}

ContactsFile loadContacts(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string yaml(kLargestFile + 1, '\0');
  // a folder opens, but can't be read
  file.read(&yaml[0], static_cast<std::streamsize>(yaml.size()));
  if (!file.is_open() || file.bad()) {
    throw InputError(path + ": file missing or unreadable: give a YAML file with contacts");
  }
  yaml.resize(static_cast<std::size_t>(file.gcount()));
  if (yaml.size() > kLargestFile) {
    throw InputError(path + ": file of more than " + std::to_string(kLargestFile) +
                     " bytes: give a YAML file with contacts");
  }
  return parseContacts(yaml, path);
}

std::string contactsYaml(const ContactsFile& file) {
  std::string out = file.contacts.empty() ? "contacts: []\n" : "contacts:\n";
  for (const TwinContact& c : file.contacts) {
    out += "  - wrench_a: " + list(c.wrench_a) + "\n";
    out += "    wrench_b: " + list(c.wrench_b) + "\n";
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
  if (!file.candidates.empty()) out += "candidates:\n";
  for (const ContactCandidate& c : file.candidates) {
    out += "  - move: {" + poseText(c.move) + "}\n";
    out += "    point: " + list(c.point) + "\n    force: " + list(c.force) + "\n";
    out += "    covariance_a: " + rowByRow<6>(c.covariance_a) + "\n";
    out += "    covariance_b: " + rowByRow<6>(c.covariance_b) + "\n";
    if (c.move_covariance) out += "    move_covariance: " + rowByRow<6>(*c.move_covariance) + "\n";
  }
  return out;
}

}  // namespace assembly_cell
