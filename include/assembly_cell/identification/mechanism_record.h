// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/identification/fit.h"

namespace assembly_cell {

/// A mechanism with what is not known of it: identified, or as drawn.
struct KnownMechanism {
  Mechanism mechanism;
  DriveErrors drive;
  bool identified = false;  ///< false: the drawing's numbers, with its spreads
  bool accepted = true;     ///< by the data left out of its identification
  std::string verdict;
  std::vector<Unknown> unknowns;  ///< about these numbers: z = 0 is `mechanism` and `drive`
  UnknownMatrix covariance = UnknownMatrix::Identity();  ///< of z
  std::vector<std::string> unseen;  ///< names of what the identification could not see
};

KnownMechanism knownAsDrawn(const Mechanism& nominal);
KnownMechanism knownFrom(const Identification& found);

/// mechanism.yaml: the mechanism's keys, which loadMechanism() reads, and what was found under the
/// key `identification`. origin: where the readings came from, one line; date: ISO.
std::string mechanismRecord(const Mechanism& nominal, const Identification& found,
                            const std::string& origin, const std::string& date);

/// The same into a file. Throws InputError when it cannot be written.
void saveMechanism(const Mechanism& nominal, const Identification& found, const std::string& origin,
                   const std::string& date, const std::string& path);

/// Reads a scenario or mechanism file. Without the key `identification` it is as drawn. Throws
/// InputError naming file, key path, value and remedy; so for names that are unknown or missing, a
/// covariance that is none, and values that contradict the mechanism's own keys.
KnownMechanism loadKnownMechanism(const std::string& path,
                                  const std::vector<std::string>& overrides = {});

/// The same of a file's text; `source` is what messages call it.
KnownMechanism parseKnownMechanism(const std::string& text, const std::string& source,
                                   const std::vector<std::string>& overrides = {});

/// The exciter as it is to be asked for, so that the force comes as wanted: amplitude over the
/// gain, phase ahead by the delay.
ExciterParameters compensated(const ExciterParameters& wanted, const DriveErrors& drive);

}  // namespace assembly_cell
