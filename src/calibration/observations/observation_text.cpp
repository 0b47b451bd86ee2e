// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Writes observation files.
#include "observation_text.h"

#include <cmath>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

namespace {

// row by row
std::string list(const Matrix6& m) {
  return yamlList(Eigen::Matrix<double, 6, 6, Eigen::RowMajor>(m));
}

std::string readingText(const Reading& r) {
  const Vector6 diagonal = r.covariance.diagonal();
  YamlMapping out;
  out.add("volts", yamlList(r.volts));
  if (r.covariance == Matrix6(diagonal.asDiagonal())) {
    out.add("variance", yamlList(diagonal));
  } else {
    out.add("covariance", list(r.covariance));
  }
  out.integer("samples", r.samples).integer("saturated", r.saturated);
  if (!r.noise.isZero(0.0)) out.add("noise", yamlList(r.noise));
  if (!r.spread.isZero(0.0)) out.add("spread", yamlList(r.spread));
  if (std::isfinite(r.temperature)) out.number("temperature", r.temperature);
  return out.text();
}

std::string layoutText(const GaugeLayout& layout) {
  std::string gauges, faces;
  for (const DialGauge& g : layout.gauges) {
    YamlMapping gauge;
    gauge.add("point", yamlList(g.point)).add("axis", yamlList(g.axis)).integer("face", g.face);
    gauges += (gauges.empty() ? "" : ", ") + gauge.text();
  }
  for (const CarrierFace& f : layout.faces) {
    YamlMapping face;
    face.add("normal", yamlList(f.normal)).number("offset", f.offset);
    faces += (faces.empty() ? "" : ", ") + face.text();
  }
  return YamlMapping().add("gauges", "[" + gauges + "]").add("faces", "[" + faces + "]").text();
}

}  // namespace

const std::set<std::string>& keysOf(ObservationKind kind) {
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
  const auto has = [&](const char* key) { return keysOf(o.kind).count(key) > 0; };
  YamlMapping out;
  out.add("kind", toString(o.kind));
  if (!o.id.empty()) out.quoted("id", o.id);
  out.number("stamp", o.stamp);
  if (has("sensor")) out.add("sensor", toString(o.side));
  if (has("position")) {
    Eigen::Quaterniond q(o.X_AB.R);
    q.normalize();
    if (q.w() < 0.0) q.coeffs() = -q.coeffs();
    out.add("position", yamlList(o.X_AB.p)).add("quaternion", yamlList(q.coeffs()));
    if (o.X_covariance) out.add("pose_covariance", list(*o.X_covariance));
  }
  if (has("mass")) out.number("mass", o.mass).add("direction", yamlList(o.direction));
  if (has("point")) out.add("point", yamlList(o.point));
  if (has("gauges")) {
    if (o.displacement) out.add("displacement", yamlList(*o.displacement));
    if (!o.gauges.empty()) out.add("gauges", yamlList(o.gauges));
  }
  if (has("load")) out.number("load", o.load).integer("channel", o.channel);
  if (o.point_at_rest) out.add("point_at_rest", "true");
  for (const Side side : kSides) {
    if (o.reading[side]) out.add(toString(side), readingText(*o.reading[side]));
  }
  return "- " + out.text();
}

std::string observationHeader(const ObservationSet& set) {
  std::string out = std::string("format: ") + kObservationFormat + "\n";
  for (const Side side : kSides) {
    const SensorDescription& s = set.sensor[side];
    YamlMapping sensor;
    sensor.quoted("serial_number", s.serial_number).integer("bits", s.bits);
    sensor.number("full_scale", s.full_scale).number("noise", s.noise);
    // the matrix is on a line of its own
    std::string text = sensor.text();
    text.back() = ',';
    out += sensorName(side) + ": " + text + "\n  nominal: " + list(s.nominal) + "}\n";
  }
  YamlMapping accuracy;
  ReferenceAccuracy values = set.accuracy;
  for (const Field& field : fieldsOf(values)) {
    accuracy.number(field.path, *field.numbers);
  }
  out += "gravity: " + yamlNumber(set.gravity) + "\naccuracy: " + accuracy.text() + "\n";
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
