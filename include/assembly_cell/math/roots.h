// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

struct Bracket {
  double low, high;
};

/// Halves [low, high], at whose lower end `holds` is true and at whose upper end it is false, until
/// it is no longer than `width` or its ends are neighbours, at most `halvings` times. `holds` is
/// evaluated between the ends only.
Bracket bisect(double low, double high, bool (*holds)(const void* predicate, double x),
               const void* predicate, double width, int halvings);

template <typename Predicate>
Bracket bisect(double low, double high, const Predicate& holds, double width = 0.0,
               int halvings = 200) {
  const auto ask = [](const void* predicate, double x) -> bool {
    return (*static_cast<const Predicate*>(predicate))(x);
  };
  return bisect(low, high, ask, &holds, width, halvings);
}

/// Encloses a root of a function with values of unlike sign at the ends, in a few calls if smooth:
/// Alefeld, Potra & Shi, ACM TOMS 21 (1995), algorithm 748. Both ends where it is exactly zero.
/// Throws std::domain_error where the signs are alike.
Bracket rootIn(double low, double high, double (*value)(const void* function, double x),
               const void* function, double width);

template <typename Function>
Bracket rootIn(double low, double high, const Function& value, double width) {
  const auto ask = [](const void* function, double x) -> double {
    return (*static_cast<const Function*>(function))(x);
  };
  return rootIn(low, high, ask, &value, width);
}

/// Where a function with one least value in [low, high] has it: golden section, until what is left
/// is no longer than `width`, at most `steps` times. Kinks do no harm.
template <typename Function>
double leastIn(double low, double high, const Function& value, double width = 0.0, int steps = 48) {
  constexpr double golden = 0.6180339887498949;
  double a = high - golden * (high - low), b = low + golden * (high - low);
  double at_a = value(a), at_b = value(b);
  for (int i = 0; i < steps && high - low > width; ++i) {
    if (at_a < at_b) {
      high = b;
      b = a;
      at_b = at_a;
      a = high - golden * (high - low);
      at_a = value(a);
    } else {
      low = a;
      a = b;
      at_a = at_b;
      b = low + golden * (high - low);
      at_b = value(b);
    }
  }
  return 0.5 * (low + high);
}

}  // namespace assembly_cell
