// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Fields of messages: accepted and refused values, and the text of a refusal.

#include "assembly_cell/guard/message_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "allocations.h"

namespace assembly_cell {
namespace {

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(MessageCheck, RangesAreClosedAndNaNIsInNone) {
  for (const double good : {-12.0, 0.0, 12.0}) {
    EXPECT_TRUE(MessageCheck().number("volts", good, kVoltsField).good()) << good;
  }
  for (const double bad :
       {std::nextafter(12.0, 13.0), -1e300, kInfinity, -kInfinity, kNotANumber}) {
    EXPECT_FALSE(MessageCheck().number("volts", bad, kVoltsField).good()) << bad;
  }
  EXPECT_EQ(MessageCheck().number("volts", kNotANumber, kVoltsField).fault(),
            MessageFault::kNotFinite);
  EXPECT_EQ(MessageCheck().number("volts", 100.0, kVoltsField).text(),
            "volts is 100 V: give -12 to 12");
}

TEST(MessageCheck, FindsTheOneBadValueWhereverItIs) {
  for (const double bad : {kNotANumber, kInfinity, 12.5, -1e308}) {
    for (std::size_t at = 0; at < 120; ++at) {
      std::vector<double> volts(120, 1.0);
      volts[at] = bad;
      const auto check = MessageCheck().numbers("volts", volts.data(), volts.size(), kVoltsField);
      ASSERT_FALSE(check.good());
      const std::string start = "volts[" + std::to_string(at) + "] is ";
      EXPECT_EQ(check.text().compare(0, start.size(), start), 0) << check.text();
    }
  }
}

TEST(MessageCheck, SixesHaveTwoRanges) {
  std::vector<double> wrench(12, 0.0);
  wrench[2] = 9e4;
  const auto look = [&] {
    return MessageCheck().sixes("wrench", wrench.data(), wrench.size(), kForceField, kTorqueField);
  };
  EXPECT_TRUE(look().good()) << look().text();
  wrench[10] = 9e4;
  EXPECT_EQ(look().text(), "wrench[10] is 90000 N m: give -10000 to 10000");
  wrench[10] = 0.0;
  wrench[7] = kNotANumber;
  EXPECT_EQ(look().fault(), MessageFault::kNotFinite);
}

TEST(MessageCheck, BlocksHaveWholeSamples) {
  EXPECT_TRUE(MessageCheck().block("volts", 6, 6).good());
  EXPECT_TRUE(MessageCheck().block("volts", kMaxValues, 6).good());
  EXPECT_EQ(MessageCheck().block("volts", 0, 6).fault(), MessageFault::kSize);
  EXPECT_EQ(MessageCheck().block("volts", 7, 6).fault(), MessageFault::kSize);
  EXPECT_EQ(MessageCheck().block("volts", kMaxValues + 6, 6).fault(), MessageFault::kSize);
  EXPECT_EQ(MessageCheck().same("saturated", 3, 4).text(), "saturated has 3 entries: give 4");
  EXPECT_TRUE(MessageCheck().noneOr("wrench_products", 0, 126).good());
  EXPECT_FALSE(MessageCheck().noneOr("wrench_products", 125, 126).good());
}

TEST(MessageCheck, StampsEndBeforeTheirArithmeticDoes) {
  EXPECT_TRUE(MessageCheck().stamp("header.stamp", 0.0).good());
  EXPECT_TRUE(MessageCheck().stamp("header.stamp", 1.8e9).good());
  for (const double bad : {4294967295.0, 2.2e9, -1.0, kNotANumber, 1e300}) {
    EXPECT_EQ(MessageCheck().stamp("header.stamp", bad).fault(), MessageFault::kStamp) << bad;
  }
}

TEST(MessageCheck, PeriodsFromOneMegahertzToOneHertz) {
  for (const double good : {1e-6, 2e-4, 1.0}) {
    EXPECT_TRUE(MessageCheck().number("period", good, kPeriodField).good()) << good;
  }
  for (const double bad : {0.0, -2e-4, 5e-324, 9e-7, 1.1, 1e9, 1e300, kInfinity, kNotANumber}) {
    EXPECT_FALSE(MessageCheck().number("period", bad, kPeriodField).good()) << bad;
  }
}

TEST(MessageCheck, NamesDirectionsAndQuaternions) {
  EXPECT_TRUE(MessageCheck().name("id", std::string(200, 'a')).good());
  EXPECT_EQ(MessageCheck().name("id", std::string(20'000'000, 'a')).text(),
            "id has 20000000 characters: give at most 200");
  // a terminal escape, and a NUL, which ends the name of a file
  for (const char control : {'\x1b', '\0', '\n', '\x7f'}) {
    EXPECT_EQ(MessageCheck().name("file", std::string("a.b") + control + "c").text(),
              "file has a control character at position 4: give printable ones");
  }
  EXPECT_TRUE(MessageCheck().direction("direction", -1).good());
  EXPECT_FALSE(MessageCheck().direction("direction", 0).good());
  EXPECT_TRUE(MessageCheck().quaternion("orientation", 0.6, 0.0, 0.0, 0.8).good());
  EXPECT_FALSE(MessageCheck().quaternion("orientation", 0.0, 0.0, 0.0, 0.0).good());
  EXPECT_FALSE(MessageCheck().quaternion("orientation", kNotANumber, 0.0, 0.0, 1.0).good());
  EXPECT_FALSE(MessageCheck().quaternion("orientation", 1e300, 0.0, 0.0, 1.0).good());
}

TEST(MessageCheck, TheFirstFaultStays) {
  const auto check = MessageCheck()
                         .number("period", 1e9, kPeriodField)
                         .stamp("header.stamp", 1e300)
                         .name("frame_id", std::string(300, 'x'));
  EXPECT_EQ(check.text(), "period is 1e+09 s: give 1e-06 to 1");
}

TEST(MessageCheck, AllocatesNothingForAGoodBlock) {
  const std::vector<double> volts(120, 1.0), wrench(120, 1.0);
  const std::uint64_t before = test::allocationsOfThisThread();
  const auto check = MessageCheck()
                         .block("volts", volts.size(), 6)
                         .number("period", 2e-4, kPeriodField)
                         .numbers("volts", volts.data(), volts.size(), kVoltsField)
                         .sixes("wrench", wrench.data(), wrench.size(), kForceField, kTorqueField);
  EXPECT_EQ(test::allocationsOfThisThread(), before);
  EXPECT_TRUE(check.good());
}

TEST(StampWindow, ASingleOutlierIsRejected) {
  StampWindow window(10.0);
  EXPECT_TRUE(window.accept(100.0));
  EXPECT_FALSE(window.accept(2e9));
  for (double t = 100.0; t < 130.0; t += 0.5) EXPECT_TRUE(window.accept(t)) << t;
  EXPECT_FALSE(window.accept(1e9));
  EXPECT_TRUE(window.accept(130.0));
  EXPECT_TRUE(window.accept(0.0));
  EXPECT_EQ(window.last(), 130.0);
}

TEST(StampWindow, TheClockMayBeSetForwards) {
  StampWindow window(10.0);
  EXPECT_TRUE(window.accept(100.0));
  EXPECT_FALSE(window.accept(5000.0));
  EXPECT_TRUE(window.accept(5000.1));
  EXPECT_TRUE(window.accept(5000.2));
}

TEST(StampWindow, ARestartedSimulationIsAcceptedAtOnce) {
  StampWindow window(10.0);
  EXPECT_TRUE(window.accept(5000.0));
  EXPECT_TRUE(window.accept(1.0));
  EXPECT_TRUE(window.accept(1.004));
}

TEST(StampWindow, AStampFromThePastDoesNotBlockTheStream) {
  StampWindow window(10.0);
  for (double t = 5000.0; t < 5010.0; t += 1.0) {
    EXPECT_TRUE(window.accept(t)) << t;
    EXPECT_TRUE(window.accept(1.0));
  }
}

}  // namespace
}  // namespace assembly_cell
