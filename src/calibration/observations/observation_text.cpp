// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Observation files as text out.
#include "observation_text.h"

#include <cmath>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

namespace {

template <typename Derived>
std::string list(const Eigen::MatrixBase<Derived>& m) {
  std::string out = "[";
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      out += (i + j > 0 ? ", " : "") + yamlNumber(m(i, j));
    }
  }
  return out + "]";
}

std::string readingText(const Reading& r) {
  const Vector6 diagonal = r.covariance.diagonal();
  const bool independent = r.covariance == Matrix6(diagonal.asDiagonal());
  std::string out =
      "{volts: " + list(r.volts) +
      (independent ? ", variance: " + list(diagonal) : ", covariance: " + list(r.covariance)) +
      ", samples: " + std::to_string(r.samples) + ", saturated: " + std::to_string(r.saturated);
  if (!r.noise.isZero(0.0)) out += ", noise: " + list(r.noise);
  if (!r.spread.isZero(0.0)) out += ", spread: " + list(r.spread);
  if (std::isfinite(r.temperature)) out += ", temperature: " + yamlNumber(r.temperature);
  return out + "}";
}

std::string layoutText(const GaugeLayout& layout) {
  std::string out = "{gauges: [";
  for (std::size_t k = 0; k < layout.gauges.size(); ++k) {
    const DialGauge& g = layout.gauges[k];
    out += std::string(k > 0 ? ", " : "") + "{point: " + list(g.point.transpose()) +
           ", axis: " + list(g.axis.transpose()) + ", face: " + std::to_string(g.face) + "}";
  }
  out += "], faces: [";
  for (std::size_t k = 0; k < 3; ++k) {
    out += std::string(k > 0 ? ", " : "") + "{normal: " + list(layout.faces[k].normal.transpose()) +
           ", offset: " + yamlNumber(layout.faces[k].offset) + "}";
  }
  return out + "]}";
}

}  // namespace

const std::set<std::string>& fieldsOf(ObservationKind kind) {
  static const std::set<std::string> fields[] = {
      {},
      {"position", "quaternion", "pose_covariance"},
      {"sensor", "mass", "direction", "point", "point_at_rest"},
      {"sensor", "point", "point_at_rest"},
      {"sensor", "gauges", "displacement"},
      {"sensor", "load", "channel"},
  };
  return fields[static_cast<std::size_t>(kind)];
}

std::string observationLine(const Observation& o) {
  const auto has = [&](const char* key) { return fieldsOf(o.kind).count(key) > 0; };
  std::string out = std::string("- {kind: ") + toString(o.kind);
  if (!o.id.empty()) out += ", id: " + yamlQuoted(o.id);
  out += ", stamp: " + yamlNumber(o.stamp);
  if (has("sensor")) out += std::string(", sensor: ") + toString(o.side);
  if (has("position")) {
    Eigen::Quaterniond q(o.X_AB.R);
    q.normalize();
    if (q.w() < 0.0) q.coeffs() = -q.coeffs();
    out += ", position: " + list(o.X_AB.p.transpose()) +
           ", quaternion: " + list(q.coeffs().transpose());
    if (o.X_covariance) out += ", pose_covariance: " + list(*o.X_covariance);
  }
  if (has("mass")) {
    out += ", mass: " + yamlNumber(o.mass) + ", direction: " + list(o.direction.transpose());
  }
  if (has("point")) out += ", point: " + list(o.point.transpose());
  if (has("gauges")) {
    if (o.displacement) out += ", displacement: " + list(o.displacement->transpose());
    if (!o.gauges.empty()) {
      out += ", gauges: " + list(Eigen::Map<const Eigen::RowVectorXd>(
                                o.gauges.data(), static_cast<Eigen::Index>(o.gauges.size())));
    }
  }
  if (has("load")) {
    out += ", load: " + yamlNumber(o.load) + ", channel: " + std::to_string(o.channel);
  }
  if (o.point_at_rest) out += ", point_at_rest: true";
  for (const Side side : kSides) {
    if (o.reading[side])
      out += std::string(", ") + toString(side) + ": " + readingText(*o.reading[side]);
  }
  return out + "}";
}

std::string observationHeader(const ObservationSet& set) {
  std::string out = std::string("format: ") + kObservationFormat + "\n";
  for (const Side side : kSides) {
    const SensorDescription& s = set.sensor[side];
    out += sensorName(side) + ": {serial_number: " + yamlQuoted(s.serial_number) +
           ", bits: " + std::to_string(s.bits) + ", full_scale: " + yamlNumber(s.full_scale) +
           ", noise: " + yamlNumber(s.noise) + ",\n  nominal: " + list(s.nominal) + "}\n";
  }
  const ReferenceAccuracy& r = set.accuracy;
  out += "gravity: " + yamlNumber(set.gravity) +
         "\naccuracy: {direction: " + yamlNumber(r.direction) + ", mass: " + yamlNumber(r.mass) +
         ", point: " + yamlNumber(r.point) + ", position: " + yamlNumber(r.position) +
         ", rotation: " + yamlNumber(r.rotation) + ", gauge: " + yamlNumber(r.gauge) + "}\n";
  for (const Side side : kSides) {
    if (set.gauges[side].gauges.empty()) continue;
    out += std::string("gauges_") + toString(side) + ": " + layoutText(set.gauges[side]) + "\n";
  }
  return out + "observations:\n";
}

std::string observationsText(const ObservationSet& set) {
  std::string content = observationHeader(set);
  for (const Observation& o : set.observations) content += observationLine(o) + "\n";
  return content;
}

void writeObservations(const ObservationSet& set, const std::string& path) {
  writeFileAtomically(path, observationsText(set), "observation file '" + path + "'");
}

std::string observationsDigest(const ObservationSet& set) { return crcText(observationsText(set)); }

}  // namespace assembly_cell
