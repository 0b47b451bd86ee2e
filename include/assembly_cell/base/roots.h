// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

struct Bracket {
  double low, high;
};

/// Halves [low, high], at whose lower end `holds` is true and at whose upper end it is false, until
/// it is no longer than `width` or its ends are neighbours, at most `halvings` times. `holds` is
/// asked between the ends only.
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

}  // namespace assembly_cell
