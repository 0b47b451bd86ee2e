// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/options.h"

#include <boost/program_options/cmdline.hpp>
#include <boost/program_options/errors.hpp>
#include <boost/program_options/parsers.hpp>
#include <cstdio>
#include <iostream>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

namespace po = boost::program_options;

void OptionParser::flag(const std::string& name, bool& variable, bool value) {
  options_[name] = {{}, {}, &variable, value};
}

void OptionParser::value(const std::string& name, const std::string& remedy, Read read) {
  options_[name] = {remedy, std::move(read), nullptr, false};
}

void OptionParser::field(const std::string& name, const Field& field) {
  value(name, field.remedy(), [field](const std::string& text) { return field.parse(text); });
}

void OptionParser::text(const std::string& name, std::string& variable) {
  value(name, "give a text", [&variable](const std::string& text) {
    variable = text;
    return true;
  });
}

void OptionParser::texts(const std::string& name, std::vector<std::string>& variable) {
  value(name, "give a text", [&variable](const std::string& text) {
    variable.push_back(text);
    return true;
  });
}

void OptionParser::numbers(const std::string& name, double* variable, std::size_t count) {
  value(name, "give " + std::to_string(count) + " numbers separated by commas",
        [variable, count](const std::string& text) {
          const std::vector<std::string_view> cells = csvCells(text);
          bool good = cells.size() == count;
          for (std::size_t i = 0; good && i < count; ++i) {
            good = parseNumber(std::string(cells[i]), variable[i]);
          }
          return good;
        });
}

void OptionParser::file(const std::string& what, std::string& variable, bool required) {
  files_.push_back({what, &variable, required});
}

void OptionParser::files(const std::string& what, std::vector<std::string>& variable) {
  files_.push_back({what, nullptr, true, &variable});
}

bool OptionParser::readNumber(const std::string& text, double& number) {
  return parseNumber(text, number);
}

bool OptionParser::readInteger(const std::string& text, long& number) {
  return parseInteger(text, number);
}

std::string OptionParser::range(double low, double high) {
  return "give a number from " + yamlNumber(low) + " to " + yamlNumber(high);
}

std::string OptionParser::range(long low, long high) {
  return "give a whole number from " + std::to_string(low) + " to " + std::to_string(high);
}

void OptionParser::readOption(const std::string& name, const std::vector<std::string>& values) {
  const Option& option = options_.at(name);
  given_.insert(name);
  if (option.flag != nullptr) {
    *option.flag = option.set;
    return;
  }
  const std::string& value = values.front();
  if (value.empty()) throw InputError(name + ": value empty: see --help");
  if (!option.read(value)) throw InputError(name + ": value " + value + ": " + option.remedy);
}

void OptionParser::onlyWith(const std::string& serves,
                            const std::vector<std::string>& names) const {
  if (given(serves)) return;
  for (const std::string& name : names) {
    if (given(name))
      throw InputError(name + ": serves " + serves + ": give that too, or leave it out");
  }
}

void OptionParser::notWith(const std::string& beside, const std::vector<std::string>& names) const {
  for (const std::string& name : names) {
    if (given(name))
      throw InputError(name + ": of no use with " + beside + ": leave one of them out");
  }
}

bool OptionParser::parse(const std::vector<std::string>& arguments) {
  return parse(arguments, std::cout);
}

bool OptionParser::parse(const std::vector<std::string>& arguments, std::ostream& out) {
  po::options_description known;
  known.add_options()("help", new po::untyped_value(true));
  for (const auto& [name, option] : options_) {
    known.add_options()(name.c_str() + 2, new po::untyped_value(option.flag != nullptr));
  }
  std::vector<po::option> given;
  try {
    namespace style = po::command_line_style;
    given = po::command_line_parser(arguments)
                .options(known)
                .style(style::allow_long | style::long_allow_next | style::long_allow_adjacent)
                .allow_unregistered()
                .run()
                .options;
  } catch (const po::invalid_command_line_syntax& error) {
    const bool extra = error.kind() == po::invalid_syntax::extra_parameter;
    throw InputError(error.get_option_name() +
                     (extra ? ": value given: it takes none" : ": value missing: see --help"));
  }
  std::size_t files = 0;
  for (const po::option& one : given) {
    const std::string& argument = one.original_tokens.front();
    if (one.string_key == "help" || argument == "-h") {
      out << help_;
      return false;
    }
    if (one.unregistered || (argument[0] == '-' && one.string_key.empty())) {
      throw InputError("argument: value " + argument + ": unknown option, see --help");
    }
    if (!one.string_key.empty()) {
      // another option in place of the value
      if (one.original_tokens.size() > 1 && options_.count(one.original_tokens[1]) > 0) {
        throw InputError("--" + one.string_key + ": value missing: see --help");
      }
      readOption("--" + one.string_key, one.value);
    } else if (files == files_.size()) {
      throw InputError("argument: value " + argument + ": " +
                       (files == 1 ? "give one " + files_[0].what : "too many") + ", see --help");
    } else if (files_[files].all != nullptr) {
      files_[files].all->push_back(argument);
    } else {
      *files_[files++].variable = argument;
    }
  }
  for (const File& file : files_) {
    if (!file.required || (file.all != nullptr ? !file.all->empty() : !file.variable->empty())) {
      continue;
    }
    throw InputError("argument: value missing: give a " + file.what + ", see --help");
  }
  return true;
}

void checkStandardOutput() {
  std::cout.flush();
  if (std::cout && std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return;
  throw InputError("standard output: can't be written: free space, or write to a file");
}

int runTool(const std::string& tool, int argc, char** argv,
            int (*run)(const std::vector<std::string>& arguments)) {
  try {
    const int code = run({argv + 1, argv + argc});
    checkStandardOutput();
    return code;
  } catch (const std::exception& error) {
    std::cerr << tool << ": " << error.what() << std::endl;
  }
  return 2;
}

}  // namespace assembly_cell
