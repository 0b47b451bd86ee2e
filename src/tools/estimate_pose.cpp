// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Pose of component B in component A from recorded contacts that both measure.

#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/twin_force/contacts_file.h"
#include "assembly_cell/twin_force/next_contact.h"
#include "assembly_cell/twin_force/pose_estimate.h"

namespace {

using assembly_cell::ContactAdvice;
using assembly_cell::ContactCandidate;
using assembly_cell::ContactsFile;
using assembly_cell::InputError;
using assembly_cell::Matrix6;
using assembly_cell::TwinForceEstimate;
using assembly_cell::TwinForceMethod;
using assembly_cell::TwinForceOptions;
using assembly_cell::TwinForceStatus;
using assembly_cell::yamlNumber;
using assembly_cell::yamlQuoted;

constexpr const char* kHelp =
    R"(Usage: estimate_pose CONTACTS.yaml [options]

Estimates the pose of component B, at the reference contact, in component A from the wrenches that both measure,
and prints it as YAML. CONTACTS.yaml: key `contacts`, a list of {wrench_a: [6], wrench_b: [6], covariance_a: [36],
covariance_b: [36], move: {position, quaternion: [x, y, z, w]}, move_covariance: [36] optional}; optional `prior:
{position, quaternion, covariance: [36]}`, `tare_covariance: [144]` of an offset (w_A, w_b) common to all contacts,
`errors: {sensor_a, sensor_b}`, each {position, quaternion, gain, rotation, offset}: how far a sensor may be off, and
`candidates`, a list of {move, point, force} to choose the next contact from. SI; wrenches act on the part that
carries the sensor, force before moment; covariances row by row; move is the pose of B at the contact in the axes
of B at the reference.

  --method M            thesis (closed form), robust, or ml (maximum likelihood, default)
  --position S          accuracy that is needed per axis [m] (default 1e-3)
  --rotation S          the same of rotation [rad] (default 1e-2)
  --help                print this

status: OK, WEAK (see next_contact), DEGENERATE (null_directions have infinite variance), or no pose:
REFUSE, REFUSE_TOO_FEW, REFUSE_SINGULAR, REFUSE_INCONSISTENT. Without a pose its keys are null. A component that
a null direction moves has variance .inf in `covariance` and zeros beside it; `information` stays finite.
Exit code: 0 a pose, 1 refused, 2 bad input.

Example: estimate_pose config/contacts/peg_on_rim.yaml --method robust
)";

struct Options {
  std::string contacts;
  TwinForceOptions estimator;
};

// false after --help
bool parseOptions(const std::vector<std::string>& arguments, Options& o) {
  assembly_cell::OptionParser parser(kHelp);
  parser.file("file of contacts", o.contacts);
  parser.choice("--method", o.estimator.method,
                {{"thesis", TwinForceMethod::kThesis},
                 {"robust", TwinForceMethod::kRobust},
                 {"ml", TwinForceMethod::kMaximumLikelihood}});
  const auto positive = [](double value) { return value > 0.0; };
  parser.number("--position", o.estimator.required_position, positive, "give a number > 0");
  parser.number("--rotation", o.estimator.required_rotation, positive, "give a number > 0");
  return parser.parse(arguments);
}

std::string number(double value) {
  return std::isinf(value) ? (value > 0 ? ".inf" : "-.inf") : yamlNumber(value);
}

template <typename Numbers>
std::string list(const Numbers& numbers) {
  std::string out = "[";
  for (Eigen::Index i = 0; i < numbers.size(); ++i) {
    out += (i == 0 ? "" : ", ") + number(numbers[i]);
  }
  return out + "]";
}

std::string list(const std::vector<int>& numbers) {
  std::string out = "[";
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    out += (i == 0 ? "" : ", ") + std::to_string(numbers[i]);
  }
  return out + "]";
}

std::string rowByRow(const Matrix6& m) {
  const Matrix6 transposed = m.transpose();
  return list(Eigen::Map<const Eigen::Matrix<double, 36, 1>>(transposed.data()));
}

void line(const char* key, const std::string& value) { std::cout << key << ": " << value << "\n"; }

void printAdvice(const TwinForceEstimate& e, const ContactsFile& file,
                 const TwinForceOptions& options) {
  const std::vector<ContactCandidate> candidates =
      file.candidates.empty() ? assembly_cell::defaultCandidates(file.contacts) : file.candidates;
  const ContactAdvice advice = assembly_cell::adviseNextContact(e, candidates, options);
  if (advice.candidate < 0) {
    line("next_contact", "null");
    return;
  }
  const ContactCandidate& c = candidates[static_cast<std::size_t>(advice.candidate)];
  const Eigen::Quaterniond q(c.move.R);
  std::cout << "next_contact:\n";
  line("  candidate", file.candidates.empty() ? "null" : std::to_string(advice.candidate));
  line("  move",
       "{position: " + list(c.move.p) + ", quaternion: " + list(Eigen::Vector4d(q.coeffs())) + "}");
  line("  point", list(c.point));
  line("  direction", list(Eigen::Vector3d(c.force.normalized())));
  line("  force", number(c.force.norm()));
  line("  smallest_eigenvalue", number(advice.smallest_eigenvalue));
  line("  log_determinant", number(advice.log_determinant));
  line("  position_sd", number(advice.position_sd));
  line("  rotation_sd", number(advice.rotation_sd));
}

void print(const TwinForceEstimate& e, const ContactsFile& file, const TwinForceOptions& options) {
  const bool tested = hasPose(e.status) || e.status == TwinForceStatus::kRefuseInconsistent;
  const bool pose = hasPose(e.status);
  const auto orNull = [](bool there, const std::string& text) { return there ? text : "null"; };
  line("status", assembly_cell::toString(e.status));
  line("reason", yamlQuoted(e.reason));
  line("culprit", orNull(e.culprit >= 0, std::to_string(e.culprit)));
  line("position", orNull(pose, list(e.pose.p)));
  line("quaternion", orNull(pose, list(Eigen::Vector4d(e.rotation.coeffs()))));
  line("covariance", orNull(pose, rowByRow(coordinateCovariance(e))));
  line("chi2", orNull(tested, number(e.chi2)));
  line("dof", orNull(tested, std::to_string(e.dof)));
  line("p", orNull(tested, number(e.p)));
  line("information_eigenvalues", orNull(pose, list(e.eigenvalues)));
  line("weak_direction", orNull(pose, list(e.weak_direction)));
  std::string null_directions = "[";
  for (int k = 0; k < e.null_count; ++k) {
    null_directions +=
        (k == 0 ? "" : ", ") + list(assembly_cell::Vector6(e.null_directions.col(k)));
  }
  line("null_directions", orNull(pose, null_directions + "]"));
  line("information", orNull(pose, rowByRow(e.information)));
  line("rejected", list(e.rejected));
  line("too_light", list(e.too_light));
  line("unconfirmed", e.unconfirmed ? "true" : "false");
  line("opposed_signs", e.opposed_signs ? "true" : "false");
  line("tare", orNull(pose && options.tare_covariance.has_value(), list(e.tare)));
  if (pose) {
    printAdvice(e, file, options);
  } else {
    line("next_contact", "null");
  }
}

int run(const std::vector<std::string>& arguments) {
  Options options;
  if (!parseOptions(arguments, options)) return 0;
  const ContactsFile file = assembly_cell::loadContacts(options.contacts);
  options.estimator.prior = file.prior;
  options.estimator.tare_covariance = file.tare_covariance;
  options.estimator.errors = file.errors;
  assembly_cell::TwinForceWorkspace workspace(std::max<std::size_t>(1, file.contacts.size()));
  const TwinForceEstimate* e = nullptr;
  try {
    e = &assembly_cell::estimatePose(file.contacts, options.estimator, workspace);
  } catch (const InputError& error) {
    throw InputError(options.contacts + ": " + error.what());
  }
  print(*e, file, options.estimator);
  return hasPose(e->status) ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) { return assembly_cell::runTool("estimate_pose", argc, argv, run); }
