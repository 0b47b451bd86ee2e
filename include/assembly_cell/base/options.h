// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <iosfwd>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace assembly_cell {

struct Field;

/// The command line of a tool: options are bound to variables, parse() fills them. What it refuses
/// is an InputError "--name: value X: what to do".
class OptionParser {
 public:
  /// Puts the text of a value where it belongs; false refuses it.
  using Read = std::function<bool(const std::string&)>;

  explicit OptionParser(std::string help) : help_(std::move(help)) {}

  /// Sets `variable` to `value`; takes no value on the command line.
  void flag(const std::string& name, bool& variable, bool value = true);
  /// `remedy`: what to give instead of a value that `read` refuses. The last one given is used,
  /// unless `read` collects them.
  void value(const std::string& name, const std::string& remedy, Read read);
  void text(const std::string& name, std::string& variable);
  /// The value of a declared setting, see base/fields.h; its struct must live until parse().
  void field(const std::string& name, const Field& field);
  void texts(const std::string& name, std::vector<std::string>& variable);
  /// "a,b,c": as many finite numbers as `variable` has.
  void numbers(const std::string& name, double* variable, std::size_t count);
  template <typename Number>
  void number(const std::string& name, Number& variable, bool (*good)(double),
              const std::string& remedy) {
    value(name, remedy, [&variable, good](const std::string& text) {
      double number = 0.0;
      if (!readNumber(text, number) || !good(number)) return false;
      variable = static_cast<Number>(number);
      return true;
    });
  }
  template <typename Number>
  void number(const std::string& name, Number& variable, double low, double high) {
    value(name, range(low, high), [&variable, low, high](const std::string& text) {
      double number = 0.0;
      if (!readNumber(text, number) || number < low || number > high) return false;
      variable = number;
      return true;
    });
  }
  template <typename Integer>
  void integer(const std::string& name, Integer& variable, long low, long high) {
    value(name, range(low, high), [&variable, low, high](const std::string& text) {
      long number = 0;
      if (!readInteger(text, number) || number < low || number > high) return false;
      variable = static_cast<Integer>(number);
      return true;
    });
  }
  template <typename Choice>
  void choice(const std::string& name, Choice& variable,
              const std::vector<std::pair<std::string, Choice>>& choices) {
    std::string names;
    for (std::size_t i = 0; i < choices.size(); ++i) {
      names += (i == 0 ? "" : i + 1 < choices.size() ? ", " : " or ") + choices[i].first;
    }
    value(name, "give " + names, [&variable, choices](const std::string& text) {
      for (const auto& [word, choice] : choices) {
        if (word != text) continue;
        variable = choice;
        return true;
      }
      return false;
    });
  }
  /// The next argument without a name, such as "scenario file".
  void file(const std::string& what, std::string& variable, bool required = true);
  /// All arguments without a name that are left: one at least.
  void files(const std::string& what, std::vector<std::string>& variable);

  /// False after --help, which prints the help (without `out`: to standard output).
  bool parse(const std::vector<std::string>& arguments);
  bool parse(const std::vector<std::string>& arguments, std::ostream& out);

  /// After parse(): an option that would change nothing is refused. `serves`: the one that each of
  /// `names` does something for; `beside`: the one, or a mode, in which it does nothing.
  void onlyWith(const std::string& serves, const std::vector<std::string>& names) const;
  void notWith(const std::string& beside, const std::vector<std::string>& names) const;
  bool given(const std::string& name) const { return given_.count(name) > 0; }

 private:
  struct Option {
    std::string remedy;
    Read read;
    bool* flag;  ///< null: the option takes a value
    bool set;    ///< what the flag becomes
  };
  struct File {
    std::string what;
    std::string* variable;
    bool required;
    std::vector<std::string>* all = nullptr;  ///< instead of variable
  };

  static bool readNumber(const std::string& text, double& number);
  static bool readInteger(const std::string& text, long& number);
  static std::string range(double low, double high);
  static std::string range(long low, long high);
  void readOption(const std::string& name, const std::vector<std::string>& values);

  std::string help_;
  std::map<std::string, Option> options_;
  std::vector<File> files_;
  std::set<std::string> given_;
};

/// What was printed has arrived. Throws InputError otherwise: a full disk, a stream that is closed.
void checkStandardOutput();

/// main() of a tool: the code that `run` returns, or 2 and one line "tool: ..." on standard error
/// for what it throws.
int runTool(const std::string& tool, int argc, char** argv,
            int (*run)(const std::vector<std::string>& arguments));

/// What identifies the program: the package, its version and a digest of its sources, written by
/// the build (cmake/version.cmake).
std::string packageBuild();

}  // namespace assembly_cell
