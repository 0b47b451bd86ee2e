// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/identification/fit.h"

namespace assembly_cell {

/// A mechanism with its uncertainty: identified, or as drawn.
struct KnownMechanism {
  Mechanism mechanism;
  DriveErrors drive;
  bool identified = false;  ///< false: nominal values with the drawing's tolerances
  bool accepted = true;     ///< by the data left out of the identification
  std::string verdict;
  std::vector<Unknown> unknowns;  ///< about these numbers: z = 0 is `mechanism` and `drive`
  UnknownMatrix covariance = UnknownMatrix::Identity();  ///< of z
  std::vector<std::string> unseen;                       ///< names of unobserved unknowns
};

KnownMechanism knownAsDrawn(const Mechanism& nominal);
KnownMechanism knownFrom(const Identification& found);

/// mechanism.yaml: the mechanism's keys, which loadMechanism() reads, and the result under the
/// key `identification`. origin: source of the readings, one line; date: ISO.
std::string mechanismRecord(const Mechanism& nominal, const Identification& found,
                            const std::string& origin, const std::string& date);

/// Writes mechanismRecord() to a file. Throws InputError when it cannot be written.
void saveMechanism(const Mechanism& nominal, const Identification& found, const std::string& origin,
                   const std::string& date, const std::string& path);

/// Reads a scenario or mechanism file. Without the key `identification` it is as drawn. Throws
/// InputError naming file, key path, value and remedy; also for unknown or missing names, an
/// invalid covariance, and values that contradict the mechanism's own keys.
KnownMechanism loadKnownMechanism(const std::string& path,
                                  const std::vector<std::string>& overrides = {});

/// Reads the text of such a file; `source`: its name in messages.
KnownMechanism parseKnownMechanism(const std::string& text, const std::string& source,
                                   const std::vector<std::string>& overrides = {});

/// Exciter command that gives the wanted force: amplitude over the gain, phase ahead by the delay.
ExciterParameters compensated(const ExciterParameters& wanted, const DriveErrors& drive);

}  // namespace assembly_cell
