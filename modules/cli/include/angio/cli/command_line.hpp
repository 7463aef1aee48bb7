// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "angio/cli/namespace.hpp"

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

// Programs describe their command lines by these few types. What they mean is CLI11's, whose templates are compiled
// once, in this module, and not in each program.
namespace angio::cli {

/// What a value on the command line must be, with its words for --help.
class Check {
 public:
  /// @param transforms  Whether the value is replaced by what the check makes of it.
  explicit Check(const CLI::Validator& validator, bool transforms = false);

  const CLI::Validator& validator() const { return *validator_; }
  bool transforms() const { return transforms_; }

 private:
  std::shared_ptr<const CLI::Validator> validator_;
  bool transforms_;
};

/// A number within [low, high], which "nan" is not.
Check between(double low, double high);

/// A whole number within [low, high].
Check wholeBetween(int low, int high);

/// One of these words.
Check oneOf(const std::vector<std::string>& words);

/// One of these names, in small letters or capitals, which becomes its number.
Check numberOfName(const std::map<std::string, int>& numbers);

/// One of the names of an enum's values, in small letters or capitals.
template <typename Enum>
Check choice(const std::map<std::string, Enum>& choices) {
  std::map<std::string, int> numbers;
  for (const auto& [name, value] : choices) numbers[name] = static_cast<int>(value);
  return numberOfName(numbers);
}

/// An option, a flag or a positional argument. Each function returns the option itself.
class Option {
 public:
  explicit Option(CLI::Option& option) : option_(&option) {}

  Option* check(const Check& check);
  Option* required();
  Option* needs(const Option* other);
  Option* excludes(const Option* other);
  Option* excludes(const std::string& other);  ///< By its name. Throws CLI11's error when it has not been added yet.
  Option* group(const std::string& name);      ///< Under which --help has it; without a name --help leaves it out.
  Option* defaultText(const std::string& text);
  Option* delimiter(char between_values);
  Option* expected(int values);
  Option* oneAtATime();  ///< Each time it is given it takes one value of its list.
  Option* takeAll();     ///< Given again, its values come behind those of before.

  bool given() const;  ///< On the command line; known once that has been read.

 private:
  CLI::Option* option_;
};

/// A program's command line, or one of its sub-commands or groups of options. What its functions return lives as long
/// as it does; variables are borrowed until the command line has been read, and their values are the defaults in
/// --help.
class Command {
 public:
  Command(const std::string& description, const std::string& name);
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  std::string name() const;

  /// An option that sets a variable: a number, a text, an enum (with choice()), or optional or many of them.
  /// @param name  "--out", "--out,-o" or, for an argument by its place, "file". Throws CLI11's error when it is taken.
  template <typename T>
  Option* addOption(const std::string& name, T& variable, const std::string& help) {
    if constexpr (std::is_enum_v<T>) {
      const auto set = [&variable](int value) { variable = static_cast<T>(value); };
      return addEnum(name, set, help)->defaultText(std::to_string(static_cast<int>(variable)));
    } else {
      return addVariable(name, variable, help);
    }
  }
  template <typename Enum, typename = std::enable_if_t<std::is_enum_v<Enum>>>
  Option* addOption(const std::string& name, std::optional<Enum>& variable, const std::string& help) {
    return addEnum(
        name, [&variable](int value) { variable = static_cast<Enum>(value); }, help);
  }

  /// An option whose value `set` is called with; `usual` is the default in --help. For int, double, bool and enums.
  template <typename T>
  Option* addSetter(const std::string& name, const std::function<void(const T&)>& set, const std::string& help,
                    const T& usual) {
    if constexpr (std::is_enum_v<T>) {
      const auto number = [set](int value) { set(static_cast<T>(value)); };
      return addEnum(name, number, help)->defaultText(std::to_string(static_cast<int>(usual)));
    } else {
      return addCall(name, set, help, usual);
    }
  }

  Option* addFlag(const std::string& name, bool& variable, const std::string& help);

  /// A flag for which `act` is called while the command line is read.
  Option* addFlag(const std::string& name, const std::function<void()>& act, const std::string& help);

  Command* addSubcommand(const std::string& name, const std::string& description);
  void requireSubcommand();

  /// Options under a heading of their own. Given `most`, at least one of them must be given, and no more than that.
  Command* addGroup(const std::string& name, const std::string& description, std::optional<int> most = std::nullopt);

  void footer(const std::string& text);

  /// Calls `act` when the command line chose this sub-command, and has been read.
  void onChosen(const std::function<void()>& act);

  /// Calls `act` once the command line has been read and nothing required is missing, before any work: for what its
  /// options must not say together.
  void onRead(const std::function<void()>& act);

  CLI::App& app();
  const CLI::App& app() const;

 private:
  struct Parts;
  explicit Command(CLI::App& app);

  Option* keep(CLI::Option* option);
  Command* keep(CLI::App* command);
  Option* addEnum(const std::string& name, const std::function<void(const int&)>& set, const std::string& help);
  template <typename T>
  Option* addCall(const std::string& name, const std::function<void(const T&)>& set, const std::string& help,
                  const T& usual);
  Option* addVariable(const std::string& name, std::string& variable, const std::string& help);
  Option* addVariable(const std::string& name, int& variable, const std::string& help);
  Option* addVariable(const std::string& name, double& variable, const std::string& help);
  Option* addVariable(const std::string& name, std::optional<int>& variable, const std::string& help);
  Option* addVariable(const std::string& name, std::optional<double>& variable, const std::string& help);
  Option* addVariable(const std::string& name, std::vector<std::string>& variable, const std::string& help);
  Option* addVariable(const std::string& name, std::vector<int>& variable, const std::string& help);
  Option* addVariable(const std::string& name, std::vector<double>& variable, const std::string& help);

  std::unique_ptr<Parts> parts_;
};

/// End the reading of a command line, and with it the program, with exit code 2 and one line: `option` has a wrong
/// value; two options exclude each other; `option` is missing. For Command::onRead().
[[noreturn]] void refuseValue(const std::string& option, const std::string& rule);
[[noreturn]] void refuseBoth(const std::string& option, const std::string& other);
[[noreturn]] void refuseWithout(const std::string& option);

}  // namespace angio::cli
