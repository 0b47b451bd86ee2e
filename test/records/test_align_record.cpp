// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/align_record.h"

#include <gtest/gtest.h>

namespace assembly_cell::align_record_test {
namespace {

TEST(AlignRecord, RetriesAreEventsAndOtherStepsAreNot) {
  assembly_cell::Run run;
  for (const char* state : {"lower", "jam", "touch", "recover", "twin_force", "insert"}) {
    AlignProgress progress;
    progress.state = state;
    progress.message = "why";
    progress.time = 2.5;
    addEvent(progress, run);
  }
  ASSERT_EQ(run.events.size(), 3U);
  EXPECT_EQ(run.events[0].kind, "retry");
  EXPECT_EQ(run.events[0].text, "jam: why");
  EXPECT_EQ(run.events[0].time, 2.5);
  EXPECT_EQ(run.events[1].text, "recover: why");
  EXPECT_EQ(run.events[2].text, "twin_force: why");
}

}  // namespace
}  // namespace assembly_cell::align_record_test
