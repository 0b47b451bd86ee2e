// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Finite numbers in, finite numbers or a refusal out: every closed form with any magnitudes.
#include "assembly_cell/math/validity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "assembly_cell/vibration/bounce.h"
#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/locus_model.h"
#include "assembly_cell/vibration/rig.h"
#include "assembly_cell/vibration/sliding.h"
#include "assembly_cell/vibration/steady_state.h"
#include "assembly_cell/vibration/walking.h"
#include "support/refusals.h"
#include "support/thesis_forms.h"

namespace assembly_cell {
namespace {

double finite(double x) { return std::isfinite(x) ? 0 : 1; }
double finite(const std::optional<double>& x) { return x ? finite(*x) : 0; }
double finite(const PlanarLocus& x) {
  return finite(x.P.real()) + finite(x.P.imag()) + finite(x.N.real()) + finite(x.N.imag()) +
         finite(x.a) + finite(x.b) + finite(x.psi);
}

TEST(Validity, NeverNaN) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(-1, 1);
  double reach = 0;  // decades
  const auto any = [&] {
    if (unit(random) > 0.95) return 0.0;
    return std::copysign(std::pow(10.0, reach * unit(random)), unit(random) + 0.8);
  };
  const auto body = [&] { return LocusCase{any(), any(), any(), any(), any(), any()}; };
  const std::function<double()> calls[] = {
      [&] {
        const ContactInertia i = contactInertia(any(), any(), any());
        return finite(i.Ix) + finite(i.Iy) + finite(i.Iz) + finite(i.beta);
      },
      [&] { return finite(chordInertia(any(), any(), any(), any())); },
      [&] { return finite(chordStiffness(any(), any(), any(), any(), any(), any())); },
      [&] {
        const ContactRotation x =
            singleContact({any(), any(), any(), any(), any(), any(), any()}, any());
        return finite(x.theta_x) + finite(x.theta_y) + finite(x.theta_z);
      },
      [&] { return finite(doubleContact(any(), any(), any(), any(), any(), any())); },
      [&] {
        const SingleContactForces f =
            singleContactForces({any(), any(), any(), any(), any(), any(), any()},
                                {any(), any(), any()}, any(), {any(), any(), any()});
        return finite(f.X) + finite(f.Y) + finite(f.Z) + finite(f.radial) + finite(f.normal);
      },
      [&] {
        const SlidingRatio x = slidingRatio({any(), any(), any(), any(), any(), any(), any(), any(),
                                             unit(random), std::abs(unit(random)), any()});
        return finite(x.D) + finite(x.w_lower) + finite(x.w_upper) + finite(x.p1) + finite(x.p2) +
               finite(x.p1_inertia) + finite(x.p2_inertia);
      },
      [&] {
        const DesignPoint x = designPoint({any(), any(), any(), any(), any(), any(), any(), any(),
                                           unit(random), any(), unit(random) > 0},
                                          any(), any());
        return finite(x.theta) + finite(x.p1) + finite(x.p2);
      },
      [&] {
        const WalkingLimit x = walkingLimit(any(), any(), any());
        return finite(x.alpha) + finite(x.overlap);
      },
      [&] {
        const FreeFlightState x =
            freeFlight({any(), any(), any(), any(), any(), any(), any(), any(), any()}, any());
        return finite(x.X) + finite(x.Z) + finite(x.theta) + finite(x.w_hi) + finite(x.w_lo);
      },
      [&] {
        const RigSlide x = rigSlide({any(), any(), any(), any(), any()}, any());
        return finite(x.time) + finite(x.x);
      },
      [&] { return finite(isotropicLocus(body(), any(), any())); },
      [&] { return finite(transverseLocus(body(), any(), any(), any())); },
      [&] { return finite(slidingLocus(any(), any(), any(), any(), any())); },
      [&] {
        SupportMatrix K6, C6;
        for (int i = 0; i < 36; ++i) {
          K6(i) = any();
          C6(i) = any();
        }
        return finite(generalLocus(body(), any(), any(), any(), K6, C6));
      }};
  for (const double decades : {0.5, 3.0, 40.0, 150.0, 300.0}) {
    reach = decades;
    for (const auto& call : calls) {
      for (int run = 0; run < 2000; ++run) {
        try {
          EXPECT_EQ(call(), 0) << (&call - calls) << " within " << decades << " decades";
        } catch (const InputError&) {
        }
      }
    }
  }
}

// simulations in phases: moderate magnitudes, an end in any case
TEST(Validity, PhasesNeverNaN) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto about = [&](double x) { return x * std::pow(10.0, 0.5 * unit(random)); };
  int walked = 0, tipped = 0;
  for (int run = 0; run < 300; ++run) {
    try {
      const Walk x = walk({about(.766), about(9806.6), about(25), about(25), about(1e7),
                           about(1500), about(60), std::abs(unit(random)), 5});
      EXPECT_EQ(finite(x.dx), 0);
      walked += !x.phases.empty();
    } catch (const InputError&) {
    }
    try {
      const TipResult x = tipBounce({about(.766), about(9806.6), about(25), about(25), about(12),
                                     about(300), about(1e7), about(1500), about(60),
                                     1.57 * std::abs(unit(random)), std::abs(unit(random))});
      EXPECT_EQ(finite(x.t_tip) + finite(x.t_impact) + finite(x.impulse) + finite(x.X_end), 0);
      tipped += x.t_impact.has_value();
    } catch (const InputError&) {
    }
  }
  EXPECT_GT(walked, 20);
  EXPECT_GT(tipped, 20);
}

TEST(Validity, OneLineWithNameValueAndRemedy) {
  EXPECT_EQ(refusalOf([] { requirePositive("m", -2); }), "m: value -2.0: give a positive number");
  EXPECT_EQ(refusalOf([] { requireFinite("m", INFINITY); }),
            "m: value not finite: give a finite number");
}

}  // namespace
}  // namespace assembly_cell
