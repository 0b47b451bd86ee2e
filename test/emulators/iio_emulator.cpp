// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/descriptor.h"
#include "assembly_cell/sensor/source_parameters.h"
#include "emulators.h"

namespace assembly_cell {

IioEmulator::IioEmulator(const Options& options) : options_(options), root_(options.root) {
  own_ = root_.empty();
  if (own_) root_ = makeTemporaryFolder();
  texts_.fill("8388608");
  plug();
}

IioEmulator::~IioEmulator() {
  std::error_code error;
  if (own_) {
    std::filesystem::remove_all(root_, error);
  } else {
    unplug();
  }
}

// One write of one length, so that a reader sees the old text or the new one.
void IioEmulator::write(const std::string& name, const std::string& text) const {
  constexpr std::size_t kLength = 32;
  const std::string path = root_ + "/" + device() + "/" + name;
  const Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644));
  std::string padded = text;
  if (text.size() < kLength) padded += '\n';
  padded.resize(std::max(kLength, padded.size()), ' ');
  [[maybe_unused]] const ssize_t n = pwrite(file.get(), padded.data(), padded.size(), 0);
  [[maybe_unused]] const int cut = ftruncate(file.get(), static_cast<off_t>(padded.size()));
}

void IioEmulator::set(const std::array<std::int64_t, 6>& codes) {
  for (std::size_t k = 0; k < 6; ++k) setText(k, std::to_string(codes[k]));
}

void IioEmulator::setText(std::size_t channel, const std::string& text) {
  texts_[channel] = text;
  write("in_voltage" + std::to_string(channel) + "_raw", text);
}

void IioEmulator::unplug() {
  std::error_code error;
  std::filesystem::remove_all(root_ + "/" + device(), error);
}

void IioEmulator::plug() {
  std::error_code error;
  std::filesystem::create_directories(root_ + "/" + device() + "/scan_elements", error);
  if (error) {
    throw SourceError("emulator: folder '" + printable(root_) + "': " + error.message() +
                      ": give another");
  }
  for (std::size_t k = 0; k < 6; ++k) {
    const std::string channel = "in_voltage" + std::to_string(k);
    setText(k, texts_[k]);
    write("scan_elements/" + channel + "_type", "le:u24/32>>0");
  }
  write("in_voltage_scale", yamlNumber(options_.scale));
  write("in_voltage_offset", yamlNumber(options_.offset));
  write("in_temp_raw", "25000");
  write("name", options_.name);
}

}  // namespace assembly_cell
