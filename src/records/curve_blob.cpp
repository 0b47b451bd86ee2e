// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "curve_blob.h"

#include <zlib.h>

#include <cstring>
#include <new>

namespace assembly_cell {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "numbers are stored as in memory");

constexpr std::size_t kBytes = sizeof(double);

std::size_t rawSize(std::size_t samples) { return kCurveChannels.size() * samples * kBytes; }

}  // namespace

std::string packCurve(const Curve& curve) {
  const std::size_t n = curve.size(), all = kCurveChannels.size() * n;
  std::string raw(rawSize(n), '\0');
  std::size_t at = 0;
  for (const CurveChannel& channel : kCurveChannels) {
    for (const double value : curve.*channel.values) {
      char bytes[kBytes];
      std::memcpy(bytes, &value, kBytes);
      for (std::size_t k = 0; k < kBytes; ++k) raw[k * all + at] = bytes[k];
      ++at;
    }
  }
  uLongf size = compressBound(raw.size());
  std::string packed(size, '\0');
  if (compress(reinterpret_cast<Bytef*>(packed.data()), &size,
               reinterpret_cast<const Bytef*>(raw.data()), raw.size()) != Z_OK) {
    throw std::bad_alloc();
  }
  packed.resize(size);
  return packed;
}

std::optional<Curve> unpackCurve(const std::string& bytes, std::size_t samples) {
  constexpr std::size_t kMaxRatio = 1100;  // of zlib's format: more is damage, not memory to take
  if (rawSize(samples) / kMaxRatio > bytes.size()) return {};
  std::string raw(rawSize(samples), '\0');
  uLongf size = raw.size();
  if (uncompress(reinterpret_cast<Bytef*>(raw.data()), &size,
                 reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()) != Z_OK ||
      size != raw.size()) {
    return {};
  }
  Curve curve;
  const std::size_t all = kCurveChannels.size() * samples;
  std::size_t at = 0;
  for (const CurveChannel& channel : kCurveChannels) {
    std::vector<double>& values = curve.*channel.values;
    values.resize(samples);
    for (double& value : values) {
      char number[kBytes];
      for (std::size_t k = 0; k < kBytes; ++k) number[k] = raw[k * all + at];
      std::memcpy(&value, number, kBytes);
      ++at;
    }
  }
  return curve;
}

}  // namespace assembly_cell
