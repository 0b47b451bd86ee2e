// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/models.h"

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/vibration/bounce.h"
#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/locus_model.h"
#include "assembly_cell/vibration/rig.h"
#include "assembly_cell/vibration/single_dof.h"
#include "assembly_cell/vibration/steady_state.h"

namespace assembly_cell {
namespace {

using P = const ModelParameters&;
using Values = std::vector<ModelValue>;

// Struct whose members are these parameters in order.
template <typename Struct, typename... Names>
Struct from(P p, const Names*... names) {
  return {p(names)...};
}

SupportMatrix matrix(P p, const char* name) {
  if (!p.has(name)) return SupportMatrix::Zero();
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(p.values.at(name).data());
}

LocusCase locusCase(P p) { return from<LocusCase>(p, "m", "r", "h", "F", "w", "alpha"); }

Values locusValues(const PlanarLocus& x) {
  const std::optional<double> psi = x.has_direction ? std::optional(x.psi) : std::nullopt;
  return {x.P, x.N, x.a, x.b, psi};
}

Values walkValues(P p) {
  const WalkCase c = walkCase(p);
  const Walk w = walk(c);
  std::vector<double> lists[4];
  for (const WalkPhase& phase : w.phases) {
    lists[0].push_back(phase.t_lift);
    lists[1].push_back(phase.duration);
    lists[2].push_back(phase.dZ);
    lists[3].push_back(phase.outward_step);
  }
  return {lists[0], lists[1], lists[2], lists[3], w.dx / c.cycles, w.tension};
}

Values rigValues(P p) {
  const RigResult x = rigAssembly(from<RigCase>(p, "x0", "M_over_L", "f_hz", "K", "g"));
  if (x.never) return {std::optional<double>(), std::optional<int>(), true};
  return {x.time, std::optional(x.cycles), false};
}

const ClosedForm kModels[] = {
    {"inertia", "m r h", "", "", "Ix Iy Iz beta",
     [](P p) -> Values {
       const ContactInertia i = contactInertia(p("m"), p("r"), p("h"));
       return {i.Ix, i.Iy, i.Iz, i.beta};
     }},
    {"chord_inertia", "m r h d", "", "", "I",
     [](P p) -> Values { return {chordInertia(p("m"), p("r"), p("h"), p("d"))}; }},
    {"chord_stiffness", "kx kz KY h l d", "", "", "K",
     [](P p) -> Values {
       return {chordStiffness(p("kx"), p("kz"), p("KY"), p("h"), p("l"), p("d"))};
     }},
    {"sdof", "I K t t1 th1 thd1 A B C w", "", "c", "theta theta_dot",
     [](P p) -> Values {
       const SingleDofState x = singleDof({p("I"), p("K"), p("c", 0.0), p("A"), p("B"), p("C"),
                                           p("w"), p("t1"), p("th1"), p("thd1")},
                                          p("t"));
       return {x.theta, x.theta_dot};
     }},
    {"single_contact", "m r h K F w alpha t", "", "", "theta_x theta_y theta_z",
     [](P p) -> Values {
       const ContactRotation x =
           singleContact(from<SingleContactCase>(p, "m", "r", "h", "K", "F", "w", "alpha"), p("t"));
       return {x.theta_x, x.theta_y, x.theta_z};
     }},
    {"sliding_ratio", "K I w h kx l m g phi theta d", "", "",
     "band w_lower w_upper D p1 p2 p1_inertia p2_inertia",
     [](P p) -> Values {
       const SlidingRatio x = slidingRatio(
           from<SlidingCase>(p, "K", "I", "w", "h", "kx", "l", "m", "g", "phi", "theta", "d"));
       return {toString(x.band), x.w_lower, x.w_upper, x.D, x.p1, x.p2, x.p1_inertia, x.p2_inertia};
     }},
    {"walking_limit", "mu r h", "", "", "alpha overlap",
     [](P p) -> Values {
       const WalkingLimit x = walkingLimit(p("mu"), p("r"), p("h"));
       return {x.alpha, x.overlap};
     }},
    {"walk", "m g r h K F w cos_alpha cycles", "", "",
     "t_lift duration dZ outward_step mean_step tension", walkValues},
    {"tip_bounce", "m g r h l kx K_chord F w alpha restitution", "", "",
     "t_tip t_impact omega_impact impulse t_flight X_end",
     [](P p) -> Values {
       const TipResult x = tipBounce(from<TipCase>(p, "m", "g", "r", "h", "l", "kx", "K_chord", "F",
                                                   "w", "alpha", "restitution"));
       return {x.t_tip, x.t_impact, x.omega_impact, x.impulse, x.t_flight, x.X_end};
     }},
    {"free_flight", "m I kx Krot h l r J t g", "", "", "w_hi w_lo X Z theta",
     [](P p) -> Values {
       const FreeFlightState x =
           freeFlight(from<FreeFlight>(p, "m", "I", "kx", "Krot", "h", "l", "r", "J", "g"), p("t"));
       return {x.w_hi, x.w_lo, x.X, x.Z, x.theta};
     }},
    {"rig", "x0 M_over_L f_hz K g", "", "", "time cycles never", rigValues},
    {"map", "m r h g K kx l d phi mu", "", "inertia", "", nullptr},
    {"locus", "model", "", "", "", nullptr}};

// Geometry that a model does not need is accepted in its file.
const ClosedForm kLocusModels[] = {
    {"locus isotropic", "model m r h F alpha w K", "l d", "c", "P N a b psi",
     [](P p) { return locusValues(isotropicLocus(locusCase(p), p("K"), p("c", 0.0))); }},
    {"locus vertical", "model m r h F alpha w K", "l d", "c", "P N a b psi",
     [](P p) { return locusValues(verticalLocus(locusCase(p), p("K"), p("c", 0.0))); }},
    {"locus transverse", "model m r h F alpha w Kx Ky", "l d", "cx cy", "P N a b psi",
     [](P p) {
       return locusValues(
           transverseLocus(locusCase(p), p("Kx"), p("Ky"), p("cx", 0.0), p("cy", 0.0)));
     }},
    {"locus double", "model m r h F alpha w d K", "l d", "c", "P N a b psi",
     [](P p) {
       return locusValues(doubleContactLocus(locusCase(p), p("d"), p("K"), p("c", 0.0)));
     }},
    {"locus sliding", "model m k F w mu_N", "l d r h alpha", "", "P N a b psi",
     [](P p) { return locusValues(slidingLocus(p("m"), p("k"), p("F"), p("mu_N"), p("w"))); }},
    {"locus general", "model m r h F alpha w l K6", "l d", "C6 hF g", "P N a b psi", [](P p) {
       const LocusCase s = locusCase(p);
       return locusValues(generalLocus(s, p("l"), p("hF", 2 * s.h), p("g", 0.0), matrix(p, "K6"),
                                       matrix(p, "C6")));
     }}};

}  // namespace

const ClosedForm* vibrationModel(const std::string& name) { return findForm(kModels, name); }
const ClosedForm* locusModel(const std::string& name) {
  return findForm(kLocusModels, "locus " + name);
}

DesignCase designCase(P p) {
  return {p("m"),
          p("r"),
          p("h"),
          p("g"),
          p("K"),
          p("kx"),
          p("l"),
          p("d"),
          p("phi"),
          p("mu"),
          p("inertia", 1.0) != 0.0};
}

WalkCase walkCase(P p) {
  return {p("m"), p("g"),         p("r"),
          p("h"), p("K"),         p("F"),
          p("w"), p("cos_alpha"), static_cast<int>(p("cycles"))};
}

}  // namespace assembly_cell
