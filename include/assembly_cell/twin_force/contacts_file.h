// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/twin_force/next_contact.h"
#include "assembly_cell/twin_force/pose_estimate.h"

namespace assembly_cell {

/// A file of recorded contacts, see docs/theory/twin_force.md.
struct ContactsFile {
  std::vector<TwinContact> contacts;
  std::optional<PosePrior> prior;
  std::optional<Matrix12> tare_covariance;
  std::optional<TwinErrors> errors;
  std::vector<ContactCandidate> candidates;  ///< for adviseNextContact(); may be empty
};

/// Throws InputError with one line: file, key path (`contacts[2].covariance_b`), value, remedy.
ContactsFile loadContacts(const std::string& path);
ContactsFile parseContacts(const std::string& yaml, const std::string& source);

/// Text in this format; numbers are read to the same bits.
std::string contactsYaml(const ContactsFile& file);

}  // namespace assembly_cell
