// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/Contact.h"
#include "assembly_cell/ContactArray.h"

namespace assembly_cell::test {

/// What the block lifts the peg with, closed contacts together [N].
inline double liftingForce(const ContactArray& contacts) {
  double sum = 0.0;
  for (const Contact& contact : contacts.contacts) {
    if (contact.state != Contact::OPEN) sum += contact.force.z;
  }
  return sum;
}

}  // namespace assembly_cell::test
