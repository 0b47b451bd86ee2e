// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Boost.Odeint's controlled methods on the package's free equations: a plain right-hand side, no
// contact, no events.
#include "odeint_peer.h"

#include <cstdio>
#include <memory>

#include "peer.h"

namespace assembly_cell::peers {
namespace {

template <typename Stepper>
void add(const Scene& scene, const char* method, std::vector<Setting>& all) {
  for (const double tolerance : {1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13}) {
    char how[64];
    std::snprintf(how, sizeof how, "%s, tolerance %.0e", method, tolerance);
    all.push_back({"Boost.Odeint", how, [&scene, tolerance] {
                     const auto run = std::make_shared<OdeintRun>(scene.scenario, scene.start);
                     return [&scene, tolerance, run](long& steps) {
                       Path path;
                       for (int i = 0; i < kChecks; ++i) {
                         path[static_cast<std::size_t>(i)] =
                             run->template advance<Stepper>(scene.check(i), tolerance);
                       }
                       steps = static_cast<long>(run->steps);
                       return path;
                     };
                   }});
  }
}

}  // namespace

std::vector<Setting> odeintSettings(const Scene& scene) {
  std::vector<Setting> all;
  if (scene.touching) return all;
  namespace odeint = boost::numeric::odeint;
  add<odeint::runge_kutta_dopri5<OdeintState>>(scene, "dopri5", all);
  add<odeint::runge_kutta_fehlberg78<OdeintState>>(scene, "rkf78", all);
  add<odeint::runge_kutta_cash_karp54<OdeintState>>(scene, "cash_karp54", all);
  return all;
}

}  // namespace assembly_cell::peers
