// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/scene/scenario.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>

#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {
namespace {

// a scenario is a page of text; more than this is another kind of file
constexpr std::size_t kLargestFile = 1 << 20;
// the Euler angles are singular at sin(theta) = 0: peg horizontal
constexpr double kSmallestSinTheta = 0.1;
// rounding of k² against the product of its diagonal entries
constexpr double kDefiniteRounding = 1e-12;

[[noreturn]] void refuse(const std::string& source, const std::string& path,
                         const std::string& value, const std::string& remedy) {
  // one line, whatever the file holds
  std::string line = source + ": " + path + ": value " + value + ": " + remedy;
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  }
  throw InputError(line);
}

std::string shown(double value) {
  std::ostringstream out;
  out.precision(12);
  out << value;
  return out.str();
}

// What stands in the file, shortened to fit a line.
std::string shown(const YAML::Node& node) {
  constexpr std::size_t kLongest = 60;
  if (!node.IsDefined()) return "missing";
  if (node.IsNull()) return "empty";
  if (node.IsMap()) return "a mapping";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  std::string text = node.Scalar();
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  return text.empty() ? "\"\"" : text;
}

// Number in YAML's notation without octal, hexadecimal, .inf, .nan or quotes.
bool readNumber(const YAML::Node& node, double& value) {
  if (!node.IsDefined() || !node.IsScalar()) return false;
  const std::string& tag = node.Tag();
  if (tag != "?" && tag != "tag:yaml.org,2002:float" && tag != "tag:yaml.org,2002:int") {
    return false;
  }
  const std::string& text = node.Scalar();
  const char* first = text.data();
  const char* last = first + text.size();
  if (first != last && *first == '+') ++first;
  // from_chars also knows "inf" and "nan", and a second sign after the plus
  const char* digits = first != last && *first == '-' && first == text.data() ? first + 1 : first;
  if (digits == last || !(std::isdigit(static_cast<unsigned char>(*digits)) || *digits == '.')) {
    return false;
  }
  const auto [end, error] = std::from_chars(first, last, value);
  return error == std::errc() && end == last && std::isfinite(value);
}

enum class Range { kAny, kNotNegative, kPositive };

const char* remedy(Range range) {
  switch (range) {
    case Range::kPositive:
      return "give a finite number > 0";
    case Range::kNotNegative:
      return "give a finite number >= 0";
    case Range::kAny:
      break;
  }
  return "give a finite number";
}

bool inRange(double value, Range range) {
  return range == Range::kAny || value > 0.0 || (range == Range::kNotNegative && value == 0.0);
}

// A mapping of the file that is read key by key; finish() refuses what nobody asked for.
class Section {
 public:
  Section(const YAML::Node& node, std::string path, const std::string& source)
      : path_(std::move(path)), source_(source) {
    if (!node.IsDefined() || !node.IsMap()) {
      refuse(at(""), shown(node), "give a mapping of keys, see docs/interfaces.md");
    }
    for (const auto& entry : node) {
      if (!entry.first.IsScalar()) {
        refuse(at(""), shown(entry.first), "a key must be a plain word");
      }
      const std::string& key = entry.first.Scalar();
      if (has(key)) refuse(at(key), shown(entry.second), "duplicate key, keep one of them");
      entries_.emplace_back(key, entry.second);
    }
  }

  /// Path of a key, or of the section itself for an empty one.
  std::string at(const std::string& key) const {
    if (key.empty()) return path_.empty() ? "file" : path_;
    return path_.empty() ? key : path_ + "." + key;
  }

  bool has(const std::string& key) const { return find(key) != nullptr; }

  [[noreturn]] void refuse(const std::string& path, const std::string& value,
                           const std::string& what_to_do) const {
    assembly_cell::refuse(source_, path, value, what_to_do);
  }
  [[noreturn]] void refuse(const std::string& path, double value,
                           const std::string& what_to_do) const {
    refuse(path, shown(value), what_to_do);
  }

  /// The node of a key that must be there.
  YAML::Node required(const std::string& key, const std::string& what_to_do) {
    known_.push_back(key);
    const YAML::Node* node = find(key);
    if (node == nullptr) refuse(at(key), "missing", what_to_do);
    return *node;
  }

  /// Marks a key as known; true when the file has it.
  bool optional(const std::string& key) {
    known_.push_back(key);
    return has(key);
  }

  Section section(const std::string& key) {
    return Section(required(key, "add this mapping, see docs/interfaces.md"), at(key), source_);
  }

  double number(const std::string& key, Range range) {
    const YAML::Node node = required(key, std::string(remedy(range)));
    double value = 0.0;
    if (!readNumber(node, value) || !inRange(value, range)) {
      refuse(at(key), shown(node), remedy(range));
    }
    return value;
  }

  double number(const std::string& key, Range range, double otherwise) {
    return optional(key) ? number(key, range) : otherwise;
  }

  template <int N>
  Eigen::Matrix<double, N, 1> numbers(const std::string& key, Range range) {
    const std::string size = "give a list of " + std::to_string(N) + " numbers";
    const YAML::Node node = required(key, size);
    if (!node.IsSequence() || node.size() != static_cast<std::size_t>(N)) {
      refuse(at(key), shown(node), size);
    }
    Eigen::Matrix<double, N, 1> values;
    for (int i = 0; i < N; ++i) {
      const YAML::Node entry = node[static_cast<std::size_t>(i)];
      if (!readNumber(entry, values[i]) || !inRange(values[i], range)) {
        refuse(at(key) + "[" + std::to_string(i) + "]", shown(entry), remedy(range));
      }
    }
    return values;
  }

  Eigen::Vector3d vector(const std::string& key) {
    return optional(key) ? numbers<3>(key, Range::kAny) : Eigen::Vector3d(Eigen::Vector3d::Zero());
  }

  std::string text(const std::string& key, const std::string& what_to_do) {
    const YAML::Node node = required(key, what_to_do);
    if (!node.IsScalar()) refuse(at(key), shown(node), what_to_do);
    return node.Scalar();
  }

  bool flag(const std::string& key, bool otherwise) {
    if (!optional(key)) return otherwise;
    const YAML::Node node = *find(key);
    const std::string value = node.IsScalar() && node.Tag() == "?" ? node.Scalar() : "";
    if (value != "true" && value != "false") refuse(at(key), shown(node), "give true or false");
    return value == "true";
  }

  void finish() const {
    for (const auto& [key, node] : entries_) {
      if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
      std::string names;
      for (const std::string& name : known_) {
        if (names.find(" " + name + ",") == std::string::npos) names += " " + name + ",";
      }
      names.pop_back();
      refuse(at(key), shown(node), "unknown key, known here:" + names);
    }
  }

 private:
  const YAML::Node* find(const std::string& key) const {
    for (const auto& entry : entries_) {
      if (entry.first == key) return &entry.second;
    }
    return nullptr;
  }

  std::string path_;
  const std::string& source_;
  std::vector<std::pair<std::string, YAML::Node>> entries_;
  std::vector<std::string> known_;
};

PegParameters readPeg(Section in) {
  PegParameters peg;
  peg.radius = in.number("radius", Range::kPositive);
  peg.half_height = in.number("half_height", Range::kPositive);
  peg.mass = in.number("mass", Range::kPositive);
  peg.inertia_transverse = in.number("inertia_transverse", Range::kPositive);
  peg.inertia_axial = in.number("inertia_axial", Range::kPositive);
  peg.coupling_height = in.number("coupling_height", Range::kAny);
  peg.exciter_height = in.number("exciter_height", Range::kAny);
  in.finish();
  // no body has more inertia about an axis than the sum about the two across
  if (peg.inertia_axial > 2.0 * peg.inertia_transverse) {
    in.refuse(in.at("inertia_axial"), peg.inertia_axial,
              "no body has more than twice inertia_transverse (" + shown(peg.inertia_transverse) +
                  "), correct one of them");
  }
  return peg;
}

HoleParameters readHole(Section in) {
  HoleParameters hole;
  hole.radius = in.number("radius", Range::kPositive);
  hole.depth = in.number("depth", Range::kPositive, hole.depth);
  in.finish();
  return hole;
}

CarrierParameters readCarrier(Section in, RestPose& rest) {
  CarrierParameters carrier;
  carrier.mass = in.number("mass", Range::kPositive);
  carrier.inertia = in.number("inertia", Range::kPositive);
  carrier.stiffness = in.numbers<3>("stiffness", Range::kNotNegative);
  carrier.damping = in.numbers<3>("damping", Range::kNotNegative);
  carrier.max_speed = in.number("max_speed", Range::kPositive, carrier.max_speed);
  carrier.max_acceleration =
      in.number("max_acceleration", Range::kPositive, carrier.max_acceleration);
  Section in_rest = in.section("rest");
  rest.x = in_rest.number("x", Range::kAny);
  rest.y = in_rest.number("y", Range::kAny);
  rest.yaw = in_rest.number("yaw", Range::kAny);
  in_rest.finish();
  in.finish();
  return carrier;
}

// Diagonal and the two cross terms, named with the letter k or c; positive semidefinite.
CouplingMatrix readCouplingMatrix(Section in, const std::string& letter) {
  CouplingMatrix matrix;
  matrix.diagonal = in.numbers<6>("diagonal", Range::kNotNegative);
  matrix.k26 = in.number(letter + "26", Range::kAny);
  matrix.k35 = in.number(letter + "35", Range::kAny);
  in.finish();
  const auto check = [&](const std::string& key, double cross, int i, int j) {
    const double limit = matrix.diagonal[i] * matrix.diagonal[j];
    if (cross * cross > limit * (1.0 + kDefiniteRounding)) {
      in.refuse(in.at(key), cross,
                "the matrix is not positive semidefinite, give at most sqrt(diagonal[" +
                    std::to_string(i) + "] * diagonal[" + std::to_string(j) +
                    "]) = " + shown(std::sqrt(limit)) + " in size");
    }
  };
  check(letter + "26", matrix.k26, 1, 5);
  check(letter + "35", matrix.k35, 2, 4);
  return matrix;
}

void checkTheta(const Section& in, const std::string& key, double theta) {
  // reversed axes (theta outside 0..pi) name the same poses a second time
  if (!(theta > 0.0 && theta < M_PI && std::sin(theta) >= kSmallestSinTheta)) {
    in.refuse(key, theta, "give an angle with sin(theta) >= 0.1 between 0 and pi, upright is pi/2");
  }
}

CouplingParameters readCoupling(Section in, RestPose& rest) {
  CouplingParameters coupling;
  coupling.stiffness = readCouplingMatrix(in.section("stiffness"), "k");
  coupling.damping = readCouplingMatrix(in.section("damping"), "c");
  Section in_rest = in.section("rest");
  rest.z = in_rest.number("z", Range::kAny);
  rest.theta = in_rest.number("theta", Range::kAny);
  rest.phi = in_rest.number("phi", Range::kAny);
  in_rest.finish();
  checkTheta(in_rest, in_rest.at("theta"), rest.theta);
  in.finish();
  return coupling;
}

ExciterParameters readExciter(Section in) {
  ExciterParameters exciter;
  exciter.amplitude = in.number("amplitude", Range::kNotNegative);
  exciter.frequency = in.number("frequency", Range::kNotNegative);
  exciter.phase = in.number("phase", Range::kAny, 0.0);
  const double direction = in.number("direction", Range::kAny, 1.0);
  in.finish();
  if (std::abs(direction) != 1.0) {
    in.refuse(in.at("direction"), direction, "give 1 (anticlockwise from above) or -1 (clockwise)");
  }
  exciter.direction = direction > 0.0 ? 1 : -1;
  return exciter;
}

FrictionParameters readFriction(Section in) {
  FrictionParameters friction;
  friction.static_coefficient = in.number("static", Range::kNotNegative);
  friction.sliding_coefficient = in.number("sliding", Range::kNotNegative);
  in.finish();
  if (friction.sliding_coefficient > friction.static_coefficient) {
    in.refuse(in.at("sliding"), friction.sliding_coefficient,
              "give at most friction.static (" + shown(friction.static_coefficient) + ")");
  }
  return friction;
}

ContactFeatures readFeatures(const Section& in, const YAML::Node& node) {
  struct Name {
    const char* text;
    bool ContactFeatures::*admitted;
  };
  constexpr Name kNames[] = {{"edge_edge", &ContactFeatures::edge_edge},
                             {"edge_plane", &ContactFeatures::edge_plane},
                             {"edge_wall", &ContactFeatures::edge_wall},
                             {"rim_side", &ContactFeatures::rim_side},
                             {"rim_face", &ContactFeatures::rim_face}};
  const std::string path = in.at("features");
  const std::string available =
      "available are edge_edge, edge_plane, edge_wall, rim_side and rim_face";
  if (!node.IsSequence()) in.refuse(path, shown(node), "give a list of names, " + available);
  ContactFeatures features{false, false, false, false, false};
  for (std::size_t i = 0; i < node.size(); ++i) {
    const std::string entry = path + "[" + std::to_string(i) + "]";
    const std::string text = node[i].IsScalar() ? node[i].Scalar() : "";
    const auto* name = std::find_if(std::begin(kNames), std::end(kNames),
                                    [&](const Name& n) { return text == n.text; });
    if (name == std::end(kNames)) in.refuse(entry, shown(node[i]), "unknown contact, " + available);
    bool& admitted = features.*(name->admitted);
    if (admitted) in.refuse(entry, text, "named twice, keep one of them");
    admitted = true;
  }
  return features;
}

ThesisSwitches readThesis(Section& in) {
  ThesisSwitches thesis;
  thesis.moments = in.flag("thesis_moments", false);
  thesis.cross_stiffness = in.flag("thesis_cross_stiffness", false);
  thesis.creep = in.flag("thesis_creep", false);
  thesis.no_centripetal = in.flag("thesis_no_centripetal", false);
  thesis.sign_flip = in.flag("thesis_sign_flip", false);
  return thesis;
}

ContactParameters readContact(Section in) {
  ContactParameters contact;
  const std::string law = in.text("law", "give none, spring_dashpot, viscous or rigid");
  if (law == "none") {
    contact.law = ContactLaw::kNone;
  } else if (law == "spring_dashpot") {
    contact.law = ContactLaw::kSpringDashpot;
  } else if (law == "viscous") {
    contact.law = ContactLaw::kViscous;
  } else if (law == "rigid") {
    contact.law = ContactLaw::kRigid;
  } else {
    in.refuse(in.at("law"), law, "give none, spring_dashpot, viscous or rigid");
  }

  contact.regularisation_speed =
      in.number("regularisation_speed", Range::kPositive, contact.regularisation_speed);
  contact.stationary_rows = in.flag("stationary_rows", contact.stationary_rows);

  // what the law cannot do without must be there
  if (contact.law == ContactLaw::kSpringDashpot) {
    contact.stiffness = in.number("stiffness", Range::kPositive);
    contact.damping = in.number("damping", Range::kNotNegative);
  } else {
    contact.stiffness = in.number("stiffness", Range::kNotNegative, contact.stiffness);
    contact.damping = in.number("damping", Range::kNotNegative, contact.damping);
  }
  contact.rate = contact.law == ContactLaw::kViscous
                     ? in.number("rate", Range::kPositive)
                     : in.number("rate", Range::kNotNegative, contact.rate);
  contact.pull_back = in.number("pull_back", Range::kNotNegative, contact.pull_back);
  contact.restitution = in.number("restitution", Range::kNotNegative, contact.restitution);
  if (contact.restitution > 1.0) {
    in.refuse(in.at("restitution"), contact.restitution, "give a number from 0 to 1");
  }
  if (in.optional("features")) {
    contact.features = readFeatures(in, in.required("features", ""));
  }
  in.finish();
  return contact;
}

// Absent parts start at rest: the carrier at its rest pose, the peg hanging stress-free from it.
InitialState readInitial(const YAML::Node& node, const std::string& source, const RestPose& rest,
                         double coupling_height) {
  Section in(node, "initial", source);
  InitialState initial;
  initial.close = in.flag("close", initial.close);

  initial.carrier_x = rest.x;
  initial.carrier_y = rest.y;
  initial.carrier_yaw = rest.yaw;
  if (in.optional("carrier")) {
    Section carrier = in.section("carrier");
    initial.carrier_x = carrier.number("x", Range::kAny);
    initial.carrier_y = carrier.number("y", Range::kAny);
    initial.carrier_yaw = carrier.number("yaw", Range::kAny);
    initial.carrier_velocity = carrier.vector("velocity");
    carrier.finish();
  }

  initial.euler = {rest.phi, rest.theta, initial.carrier_yaw};
  const Eigen::Vector3d axis = rotationFromEuler(initial.euler).col(2);
  initial.position =
      Eigen::Vector3d(initial.carrier_x, initial.carrier_y, rest.z) - coupling_height * axis;
  if (in.optional("peg")) {
    Section peg = in.section("peg");
    initial.position = peg.numbers<3>("position", Range::kAny);
    const Eigen::Vector3d euler = peg.numbers<3>("euler", Range::kAny);
    initial.euler = {euler[0], euler[1], euler[2]};
    initial.velocity = peg.vector("velocity");
    initial.euler_rates = peg.vector("euler_rates");
    peg.finish();
    checkTheta(peg, peg.at("euler") + "[1]", initial.euler.theta);
  }
  in.finish();
  return initial;
}

SolverParameters readSolver(Section in) {
  SolverParameters solver;
  if (in.optional("integrator")) {
    solver.integrator = in.text("integrator", "give the name of an integrator, such as dopri5");
  }
  solver.tolerance = in.number("tolerance", Range::kPositive, solver.tolerance);
  solver.max_step = in.number("max_step", Range::kPositive, solver.max_step);
  solver.step = in.number("step", Range::kPositive, solver.step);
  in.finish();
  return solver;
}

Scenario readScenario(const YAML::Node& root, const std::string& source) {
  Section in(root, "", source);
  Scenario scenario;
  scenario.name = in.text("name", "give the scenario a name");
  scenario.duration = in.number("duration", Range::kNotNegative);
  scenario.gravity = in.number("gravity", Range::kNotNegative);
  scenario.peg = readPeg(in.section("peg"));
  scenario.hole = readHole(in.section("hole"));
  scenario.carrier = readCarrier(in.section("carrier"), scenario.rest);
  scenario.coupling = readCoupling(in.section("coupling"), scenario.rest);
  if (in.optional("exciter")) scenario.exciter = readExciter(in.section("exciter"));
  scenario.push = in.vector("push");
  scenario.friction = readFriction(in.section("friction"));
  scenario.contact = readContact(in.section("contact"));
  scenario.thesis = readThesis(in);
  const YAML::Node initial =
      in.optional("initial") ? in.required("initial", "") : YAML::Node(YAML::NodeType::Map);
  scenario.initial = readInitial(initial, source, scenario.rest, scenario.peg.coupling_height);
  if (in.optional("solver")) scenario.solver = readSolver(in.section("solver"));
  in.finish();
  return scenario;
}

// The first document of the text; syntax errors and further documents are refused.
YAML::Node loadYaml(const std::string& text, const std::string& source) {
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.size() > 1) {
      refuse(source, "file", std::to_string(documents.size()) + " documents", "keep one of them");
    }
    return documents.empty() ? YAML::Node() : documents.front();
  } catch (const YAML::Exception& e) {
    refuse(source, "line " + std::to_string(e.mark.line + 1),
           "column " + std::to_string(e.mark.column + 1),
           "not YAML (" + e.msg + "), correct the syntax");
  }
}

// "a.b[1]" or "a.b.1" as a, b, 1; empty when it is no such path.
std::vector<std::string> splitPath(const std::string& path) {
  std::vector<std::string> keys(1);
  bool in_index = false;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const char c = path[i];
    // an index is closed and followed by the next key, the next index or nothing
    const bool last_of_index = i + 1 == path.size() || path[i + 1] == '.' || path[i + 1] == '[';
    if ((c == ']') != in_index && (c == ']' || c == '[' || c == '.')) return {};
    if (c == ']' && !last_of_index) return {};
    if (c == '.' || c == '[') keys.emplace_back();
    if (c == '[' || c == ']') in_index = c == '[';
    if (c != '.' && c != '[' && c != ']') keys.back() += c;
  }
  const bool gap = std::any_of(keys.begin(), keys.end(), [](const auto& k) { return k.empty(); });
  return gap || in_index ? std::vector<std::string>{} : keys;
}

// The tree with the value at keys[depth...] replaced or added. Copies what lies on the way, so that
// a node shared through a YAML alias changes in one place only.
YAML::Node withValue(const YAML::Node& node, const std::vector<std::string>& keys,
                     std::size_t depth, const YAML::Node& value, const std::string& override_text) {
  if (depth == keys.size()) return value;
  const std::string& key = keys[depth];
  const std::string source = "--set " + override_text;
  if (node.IsDefined() && node.IsSequence()) {
    std::size_t index = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), index);
    if (error != std::errc() || end != key.data() + key.size() || index >= node.size()) {
      refuse(source, "index", key,
             "give an index from 0 to " + std::to_string(node.size()) + " - 1");
    }
    YAML::Node list(YAML::NodeType::Sequence);
    for (std::size_t i = 0; i < node.size(); ++i) {
      list.push_back(i == index ? withValue(node[i], keys, depth + 1, value, override_text)
                                : YAML::Node(node[i]));
    }
    return list;
  }
  if (node.IsDefined() && node.IsScalar()) {
    refuse(source, "key", key, "there is nothing below " + shown(node) + ", correct the path");
  }
  const bool is_map = node.IsDefined() && node.IsMap();
  if (!is_map && std::isdigit(static_cast<unsigned char>(key[0]))) {
    refuse(source, "index", key, "there is no list here, give the whole list");
  }
  YAML::Node map(YAML::NodeType::Map);
  bool found = false;
  if (is_map) {
    for (const auto& entry : node) {
      const bool here = !found && entry.first.IsScalar() && entry.first.Scalar() == key;
      found = found || here;
      map.force_insert(entry.first,
                       here ? withValue(entry.second, keys, depth + 1, value, override_text)
                            : YAML::Node(entry.second));
    }
  }
  if (!found) {
    const YAML::Node nothing(YAML::NodeType::Null);
    map.force_insert(key, withValue(nothing, keys, depth + 1, value, override_text));
  }
  return map;
}

YAML::Node withOverride(const YAML::Node& root, const std::string& text) {
  const std::size_t equals = text.find('=');
  const std::vector<std::string> keys =
      equals == std::string::npos ? std::vector<std::string>{} : splitPath(text.substr(0, equals));
  if (keys.empty()) {
    refuse("--set", "override", text, "write key.path=value, such as peg.radius=0.025");
  }
  const YAML::Node value = loadYaml(text.substr(equals + 1), "--set " + text);
  return withValue(root, keys, 0, value, text);
}

}  // namespace

Scenario parseScenario(const std::string& yaml, const std::string& source,
                       const std::vector<std::string>& overrides) {
  YAML::Node root = loadYaml(yaml, source);
  if (!root.IsMap()) {
    refuse(source, "file", shown(root), "give a mapping of keys, see docs/interfaces.md");
  }
  for (const std::string& text : overrides) root.reset(withOverride(root, text));
  return readScenario(root, source);
}

Scenario loadScenario(const std::string& path, const std::vector<std::string>& overrides) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::string text(kLargestFile + 1, '\0');
  if (file) file.read(&text[0], static_cast<std::streamsize>(text.size()));
  if (!file.is_open() || file.bad()) {
    const std::string reason = errno != 0 ? std::strerror(errno) : "read error";
    refuse(path, "file", "unreadable", reason + ", check the path and its permissions");
  }
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > kLargestFile) {
    refuse(path, "file", "more than 1 MiB", "this is no scenario, check the path");
  }
  return parseScenario(text, path, overrides);
}

}  // namespace assembly_cell
