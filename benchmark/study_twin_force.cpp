// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Studies of docs/theory/twin_force.md as CSV files: study_twin_force FOLDER [RUNS]. About a
// minute.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include "../test/twin_force/ground_truth.h"
#include "../test/twin_force/thesis_forms.h"

namespace {

using namespace assembly_cell;
using namespace twin_truth;

TwinForceWorkspace& workspace() {
  static TwinForceWorkspace memory(32);
  return memory;
}

struct Errors {
  double position = 0, rotation = 0;  // rms over 3 axes [m], [rad]
  double median_position = 0;
  double nees = 0, chi2 = 0;
  int runs = 0, refused = 0;
};

// errors of a method; with a prior, a random one each run
Errors errors(const Scene& s, TwinForceMethod method, int runs, bool prior) {
  std::mt19937_64 random(11);
  TwinForceOptions options;
  options.method = method;
  Errors out;
  std::vector<double> sizes;
  for (int k = 0; k < runs; ++k) {
    const auto contacts = measure(s, &random);
    if (prior) {
      options.prior = defaultPrior({});
      const Vector6 d = gaussian(options.prior->covariance, random);
      options.prior->pose = {rotation(d.tail<3>()) * s.X_AB.R, s.X_AB.p + d.head<3>()};
    }
    const auto& e = estimatePose(contacts, options, workspace());
    if (!hasPose(e.status)) {
      ++out.refused;
      continue;
    }
    const Vector6 d = errorOf(s.X_AB, e.pose);
    out.position += d.head<3>().squaredNorm();
    out.rotation += d.tail<3>().squaredNorm();
    out.nees += normalisedDistance(e, s.X_AB);
    out.chi2 += e.chi2;
    sizes.push_back(d.head<3>().norm());
    ++out.runs;
  }
  const double n = std::max(1, out.runs);
  out.position = std::sqrt(out.position / n);
  out.rotation = std::sqrt(out.rotation / n);
  out.nees /= n;
  out.chi2 /= n;
  if (!sizes.empty()) {
    std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2),
                     sizes.end());
    out.median_position = sizes[sizes.size() / 2];
  }
  return out;
}

double positionOf(const Matrix6& P) { return std::sqrt(P.diagonal().head<3>().sum()); }
double rotationOf(const Matrix6& P) { return std::sqrt(P.diagonal().tail<3>().sum()); }

void geometryStudy(const std::string& folder, int runs) {
  std::ofstream csv(folder + "/twin_force_geometries.csv");
  csv << "geometry,method,bound_mm,bound_mrad,rms_mm,rms_mrad,ratio_position,ratio_rotation,nees,"
         "chi2,refused\n";
  const Matrix6 P0 = defaultPrior({}).covariance;
  for (const Scene& s : geometries()) {
    const bool parallel = s.name == "lines 0 deg";
    for (int m = parallel ? 3 : 0; m < 4; ++m) {
      const bool prior = m == 3;
      const Matrix6 P = prior ? bound(s, &P0) : bound(s);
      const char* names[] = {"thesis", "robust", "ml", "ml with prior"};
      const Errors e = errors(s,
                              m == 0   ? TwinForceMethod::kThesis
                              : m == 1 ? TwinForceMethod::kRobust
                                       : TwinForceMethod::kMaximumLikelihood,
                              runs, prior);
      csv << '"' << s.name << "\"," << names[m] << ',' << 1e3 * positionOf(P) << ','
          << 1e3 * rotationOf(P) << ',';
      if (e.runs > 0) {
        csv << 1e3 * e.position << ',' << 1e3 * e.rotation << ',' << e.position / positionOf(P)
            << ',' << e.rotation / rotationOf(P) << ',' << e.nees << ',' << e.chi2;
      } else {
        csv << ",,,,,";
      }
      csv << ',' << e.refused << '\n';
    }
  }
}

// Fig 10.5: angle between the lines, and how far from the origins they pass
void figureStudy(const std::string& folder) {
  std::ofstream angle(folder + "/twin_force_angle.csv");
  angle << "beta_deg,bound_mm,bound_mrad,rule_mm,rule_mrad\n";
  for (double beta = 2; beta <= 90; beta += 2) {
    const double b = beta * M_PI / 180;
    Scene s = begin("beta", rotation({0.08, 0.16, 0.24}), {0.08, -0.06, 0.1});
    press(s, {0, 0.03, 0.02}, {0, 0, -20});
    press(s, {0, -0.03, 0.02}, -20 * Vector3d(std::sin(b), 0, std::cos(b)));
    const Matrix6 P = bound(s);
    const PoseErrorRule rule = poseErrorRule(20, 0.05, 2e-3, b);
    angle << beta << ',' << 1e3 * positionOf(P) << ',' << 1e3 * rotationOf(P) << ','
          << 1e3 * rule.position << ',' << 1e3 * rule.rotation << '\n';
  }
  std::ofstream arms(folder + "/twin_force_arms.csv");
  arms << "arm_mm,two_lines_mrad,three_lines_mrad,two_lines_noisy_mrad,three_lines_noisy_mrad\n";
  for (int arm = 0; arm <= 80; arm += 4) {
    arms << arm;
    for (const double sigma : {0.05, 1.0}) {
      const double a = 1e-3 * arm;
      Scene s = begin("arms", rotation({0.2, 0.4, 0.5}), Vector3d::Zero());
      s.covariance_a = s.covariance_b = noise(sigma, 2e-3);
      press(s, {a, 0, 0}, {0, 0, -20});
      press(s, {0, -a, 0}, {-20, 0, 0});
      arms << ',' << 1e3 * rotationOf(bound(s));
      press(s, {0, 0, a}, {0, -20, 0});
      arms << ',' << 1e3 * rotationOf(bound(s));
    }
    arms << '\n';
  }
}

Scene randomContacts(int n, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const auto unit = [&] {
    return Vector3d(normal(random), normal(random), normal(random)).normalized();
  };
  Scene s = begin("random", rotation(0.7 * unit()), 0.14 * unit());
  for (int i = 0; i < n; ++i) {
    const Vector3d point = 0.06 * unit();
    press(s, point, 20 * unit());
  }
  return s;
}

void countStudy(const std::string& folder, int runs) {
  std::ofstream csv(folder + "/twin_force_count.csv");
  csv << "contacts,median_mm,median_mrad,p90_mm,p90_mrad\n";
  std::mt19937_64 random(3);
  for (const int n : {2, 3, 4, 6, 8, 12, 16, 20}) {
    std::vector<double> position, turn;
    for (int k = 0; k < std::min(runs, 400); ++k) {
      const Matrix6 P = bound(randomContacts(n, random));
      position.push_back(1e3 * positionOf(P));
      turn.push_back(1e3 * rotationOf(P));
    }
    std::sort(position.begin(), position.end());
    std::sort(turn.begin(), turn.end());
    const std::size_t half = position.size() / 2, ninety = position.size() * 9 / 10;
    csv << n << ',' << position[half] << ',' << turn[half] << ',' << position[ninety] << ','
        << turn[ninety] << '\n';
  }
}

// noise-free contacts with one systematic fault: error, and what χ² makes of it
void faultStudy(const std::string& folder) {
  std::ofstream csv(folder + "/twin_force_faults.csv");
  csv << "fault,contacts,error_mm,error_mrad,chi2,dof,status,seen\n";
  for (const int n : {2, 4}) {
    Scene s = begin("faults", rotation({0.2, 0.4, 0.5}), {0.08, -0.06, 0.1});
    const Pose turned{rotation({0.5, 0.1, 0}), {0.01, 0, 0.02}};
    press(s, {0.03, 0.05, 0.02}, {0, 0, -20}, turned);
    if (n == 4) {
      press(s, {0.01, -0.04, 0.03}, {4, 14, -14}, {rotation({0.1, -0.4, 0.2}), {0, 0.01, 0.02}});
      press(s, {-0.03, 0.02, 0.03}, {-14, 4, -14}, {rotation({0.3, 0.2, -0.3}), {0.01, 0.01, 0}});
    }
    press(s, {-0.02, -0.01, 0.05}, {-20, 0, 0});
    const auto report = [&](const char* name, auto fault) {
      auto contacts = measure(s);
      for (std::size_t i = 0; i < contacts.size(); ++i) fault(contacts[i], i);
      TwinForceOptions options;
      options.remove_outliers = false;
      const auto& e = estimatePose(contacts, options, workspace());
      const bool seen = e.p < 1e-3;
      const char* status = toString(e.status);
      const double chi2 = e.chi2;
      const int dof = e.dof;
      options.smallest_p = 0.0;
      const auto& pose = estimatePose(contacts, options, workspace());
      const Vector6 d = errorOf(s.X_AB, pose.pose);
      csv << '"' << name << "\"," << n << ',' << 1e3 * d.head<3>().norm() << ','
          << 1e3 * d.tail<3>().norm() << ',' << chi2 << ',' << dof << ',' << status << ','
          << (seen ? "yes" : "no") << '\n';
    };
    report("none", [](TwinContact&, std::size_t) {});
    report("tare of A 0.3 N, 6 mN m", [](TwinContact& c, std::size_t) {
      c.wrench_a += 0.173 * (Vector6() << 1, 1, 1, 0.02, 0.02, 0.02).finished();
    });
    report("gravity 2 N not removed, B turns 30 deg", [](TwinContact& c, std::size_t) {
      c.wrench_b += seenFrom(inverse(c.move), onLine({0.01, 0.02, 0.06}, {0, 0, -2})) -
                    onLine({0.01, 0.02, 0.06}, {0, 0, -2});
    });
    report("gain of A 0.5 %", [](TwinContact& c, std::size_t) { c.wrench_a *= 1.005; });
    report("frame of A turned 2 mrad", [](TwinContact& c, std::size_t) {
      c.wrench_a = seenFrom({rotation({0.002, 0, 0}), Vector3d::Zero()}, c.wrench_a);
    });
    report("frame of A shifted 0.1 mm", [](TwinContact& c, std::size_t) {
      c.wrench_a = seenFrom({Matrix3d::Identity(), {1e-4, 0, 0}}, c.wrench_a);
    });
    report("first move 0.1 mm, 1 mrad", [](TwinContact& c, std::size_t i) {
      if (i == 0)
        c.move = {rotation({6e-4, 6e-4, 6e-4}) * c.move.R, c.move.p + Vector3d(1e-4, 0, 0)};
    });
    report("second contact of 3 N on A", [](TwinContact& c, std::size_t i) {
      if (i == 0) c.wrench_a += onLine({0.02, -0.03, 0.01}, {2, -1, 2});
    });
    report("sign of B reversed", [](TwinContact& c, std::size_t) { c.wrench_b = -c.wrench_b; });
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 2 ? std::atoi(argv[2]) : 4000;
  if (argc < 2 || runs < 10) {
    std::cerr << "usage: study_twin_force FOLDER [RUNS >= 10]\n";
    return 2;
  }
  const std::string folder = argv[1];
  geometryStudy(folder, runs);
  figureStudy(folder);
  countStudy(folder, runs);
  faultStudy(folder);
  if (!std::ifstream(folder + "/twin_force_faults.csv")) {
    std::cerr << "study_twin_force: " << folder
              << ": can't write there: give a folder that exists\n";
    return 2;
  }
  return 0;
}
