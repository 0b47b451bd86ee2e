// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <cmath>
#include <cstdio>
#include <ctime>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "commands.h"

namespace assembly_cell {
namespace {

bool readTime(const std::string& text, double& time) {
  for (const char* format :
       {"%Y-%m-%d", "%Y-%m-%dT%H:%M", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M:%SZ"}) {
    std::tm utc{};
    const char* end = ::strptime(text.c_str(), format, &utc);
    if (end == nullptr || *end != '\0') continue;
    const std::tm given = utc;
    time = static_cast<double>(::timegm(&utc));
    return utc.tm_mday == given.tm_mday && utc.tm_sec == given.tm_sec;  // no 31st of February
  }
  return false;
}

}  // namespace

const std::string& StoreOption::path() {
  if (path_.empty()) path_ = defaultRunStore();
  return path_;
}

FilterOptions::FilterOptions(OptionParser& parser, std::int64_t limit) {
  filter_.limit = limit;
  parser.text("--serial", filter_.serial);
  parser.text("--program", filter_.program);
  parser.text("--station", filter_.station);
  parser.text("--result", filter_.result);
  parser.flag("--passed", passed_);
  parser.flag("--failed", failed_);
  parser.integer("--limit", filter_.limit, 0, 1L << 40);
  const auto time = [&parser](const std::string& name, double& value) {
    parser.value(name, "give a date, 2026-11-29, or a time, 2026-11-29T04:30:00 (UTC)",
                 [&value](const std::string& text) { return readTime(text, value); });
  };
  time("--from", filter_.from);
  time("--to", filter_.to);
}

RunFilter FilterOptions::filter() const {
  if (passed_ && failed_) throw InputError("--failed: value true: leave it or --passed out");
  RunFilter filter = filter_;
  if (passed_ || failed_) filter.passed = passed_;
  return filter;
}

std::int64_t runNumber(const std::string& text) {
  long number = 0;
  if (!parseInteger(text, number) || number < 1) {
    throw InputError("argument: value " + text + ": give the number of a run, see records list");
  }
  return number;
}

std::string timeText(double time) {
  const auto seconds = static_cast<std::time_t>(std::floor(time));
  std::tm utc{};
  char text[40] = "";
  if (gmtime_r(&seconds, &utc) == nullptr) return yamlNumber(time);
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

}  // namespace assembly_cell
