// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <map>
#include <nlopt.hpp>

#include "assembly_cell/study/ledger.h"

namespace assembly_cell {
namespace {

nlopt::algorithm algorithmOf(const std::string& name) {
  static const std::map<std::string, nlopt::algorithm> known = {
      {"direct", nlopt::GN_DIRECT_L}, {"crs2", nlopt::GN_CRS2_LM},
      {"isres", nlopt::GN_ISRES},     {"esch", nlopt::GN_ESCH},
      {"sbplx", nlopt::LN_SBPLX},     {"cobyla", nlopt::LN_COBYLA},
      {"bobyqa", nlopt::LN_BOBYQA},   {"nelder_mead", nlopt::LN_NELDERMEAD}};
  return known.at(name);
}

}  // namespace

// The optimiser is deterministic and requests the same points again after a kill: those in the
// journal cost nothing.
StudyOptimum searchOptimum(const Study& study, StudyLedger& ledger,
                           const std::function<void()>& execute, const std::atomic<bool>& stop) {
  std::vector<const StudyAxis*> axes;
  for (const StudyAxis& a : study.axes) {
    if (a.kind == StudyAxis::Kind::kSearch) axes.push_back(&a);
  }
  StudyOptimum optimum;
  optimum.number = -1;
  std::vector<double> best(axes.size(), 0.5);
  double best_value = 0.0;
  const double sign = study.search.maximise ? -1.0 : 1.0;

  int left = 0;  // evaluations of this step
  bool interrupted = false;
  const auto evaluate = [&](const std::vector<double>& point) {
    if (left-- <= 0) throw nlopt::forced_stop();
    const std::int64_t number = ledger.offer(point);
    execute();
    if (stop) {
      interrupted = true;
      throw nlopt::forced_stop();
    }
    const double value = ledger.objective(number);
    // a point without the outcome in any run guides the search, but is no optimum
    const bool first = optimum.number < 0;
    if (ledger.valued(number) && (first || sign * value < sign * best_value)) {
      best = point;
      best_value = value;
      optimum.number = number;
    }
    ++optimum.evaluations;
    return value;
  };
  using Evaluate = decltype(evaluate);
  const nlopt::vfunc call = [](const std::vector<double>& point, std::vector<double>&, void* data) {
    return (*static_cast<const Evaluate*>(data))(point);
  };

  for (const StudySearch::Step& step : study.search.steps) {
    nlopt::srand(static_cast<unsigned long>(study.seed));
    nlopt::opt optimiser(algorithmOf(step.algorithm), static_cast<unsigned>(axes.size()));
    optimiser.set_lower_bounds(0.0);
    optimiser.set_upper_bounds(1.0);
    optimiser.set_xtol_abs(study.search.tolerance);
    optimiser.set_initial_step(0.1);
    void* data = const_cast<void*>(static_cast<const void*>(&evaluate));
    if (study.search.maximise) {
      optimiser.set_max_objective(call, data);
    } else {
      optimiser.set_min_objective(call, data);
    }
    left = step.evaluations;
    std::vector<double> point = best;
    double value = 0.0;
    try {
      optimiser.optimize(point, value);
    } catch (const nlopt::forced_stop&) {
      if (interrupted) break;
    } catch (const nlopt::roundoff_limited&) {
      // the tolerance is below rounding
    }
  }
  optimum.complete = !interrupted;
  if (optimum.complete) ledger.close();
  if (optimum.number >= 0) {
    optimum.value = best_value;
    for (std::size_t i = 0; i < axes.size(); ++i) {
      optimum.point.push_back(searchValue(*axes[i], best[i]));
    }
  }
  return optimum;
}

}  // namespace assembly_cell
