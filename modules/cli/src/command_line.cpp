// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/cli/command_line.hpp"

#include <CLI/CLI.hpp>
#include <deque>
#include <sstream>

namespace angio::cli {

Check::Check(const CLI::Validator& validator, bool transforms)
    : validator_(std::make_shared<CLI::Validator>(validator)), transforms_(transforms) {}

Check between(double low, double high) {
  std::ostringstream range;
  range << "FLOAT in [" << low << " - " << high << "]";
  // CLI::Range would let "nan" pass.
  const auto check = [low, high](const std::string& input) {
    double value = 0;
    const bool good = CLI::detail::lexical_cast(input, value) && value >= low && value <= high;
    return good ? std::string()
                : "Value " + input + " must lie between " + CLI::detail::to_string(low) + " and " +
                      CLI::detail::to_string(high);
  };
  return Check(CLI::Validator(check, range.str()));
}

Check wholeBetween(int low, int high) { return Check(CLI::Range(low, high)); }

Check oneOf(const std::vector<std::string>& words) { return Check(CLI::IsMember(words)); }

// CLI11's own text for --help has the numbers too.
Check numberOfName(const std::map<std::string, int>& numbers) {
  std::string names;
  for (const auto& [name, number] : numbers) names += (names.empty() ? "{" : ",") + name;
  return Check(CLI::CheckedTransformer(numbers, CLI::ignore_case).description(names + "}"), true);
}

Option* Option::check(const Check& check) {
  if (check.transforms()) {
    option_->transform(check.validator());
  } else {
    option_->check(check.validator());
  }
  return this;
}

Option* Option::required() {
  option_->required();
  return this;
}

Option* Option::needs(const Option* other) {
  option_->needs(other->option_);
  return this;
}

Option* Option::excludes(const Option* other) {
  option_->excludes(other->option_);
  return this;
}

Option* Option::excludes(const std::string& other) {
  option_->excludes<CLI::App>(other);
  return this;
}

Option* Option::group(const std::string& name) {
  option_->group(name);
  return this;
}

Option* Option::defaultText(const std::string& text) {
  option_->default_str(text);
  return this;
}

Option* Option::delimiter(char between_values) {
  option_->delimiter(between_values);
  return this;
}

Option* Option::expected(int values) {
  option_->expected(values);
  return this;
}

Option* Option::oneAtATime() {
  option_->allow_extra_args(false);
  return this;
}

Option* Option::takeAll() {
  option_->take_all();
  return this;
}

bool Option::given() const { return option_->count() > 0; }

struct Command::Parts {
  std::unique_ptr<CLI::App> own;  // Of a program.
  CLI::App* app;
  std::deque<Option> options;
  std::deque<std::unique_ptr<Command>> commands;
};

Command::Command(const std::string& description, const std::string& name) : parts_(std::make_unique<Parts>()) {
  parts_->own = std::make_unique<CLI::App>(description, name);
  parts_->app = parts_->own.get();
}

Command::Command(CLI::App& app) : parts_(std::make_unique<Parts>()) { parts_->app = &app; }

Command::~Command() = default;

CLI::App& Command::app() { return *parts_->app; }
const CLI::App& Command::app() const { return *parts_->app; }
std::string Command::name() const { return app().get_name(); }

Option* Command::keep(CLI::Option* option) { return &parts_->options.emplace_back(*option); }

Command* Command::keep(CLI::App* command) {
  return parts_->commands.emplace_back(std::unique_ptr<Command>(new Command(*command))).get();
}

Option* Command::addEnum(const std::string& name, const std::function<void(const int&)>& set, const std::string& help) {
  return keep(app().add_option_function<int>(name, set, help)->type_name("ENUM"));
}

#define ANGIO_ADD_VARIABLE(T)                                                                   \
  Option* Command::addVariable(const std::string& name, T& variable, const std::string& help) { \
    return keep(app().add_option(name, variable, help));                                        \
  }
ANGIO_ADD_VARIABLE(std::string)
ANGIO_ADD_VARIABLE(int)
ANGIO_ADD_VARIABLE(double)
ANGIO_ADD_VARIABLE(std::optional<int>)
ANGIO_ADD_VARIABLE(std::optional<double>)
ANGIO_ADD_VARIABLE(std::vector<std::string>)
ANGIO_ADD_VARIABLE(std::vector<int>)
ANGIO_ADD_VARIABLE(std::vector<double>)
#undef ANGIO_ADD_VARIABLE

template <typename T>
Option* Command::addCall(const std::string& name, const std::function<void(const T&)>& set, const std::string& help,
                         const T& usual) {
  return keep(app().add_option_function<T>(name, set, help)->default_str(CLI::detail::to_string(usual)));
}
template Option* Command::addCall(const std::string&, const std::function<void(const int&)>&, const std::string&,
                                  const int&);
template Option* Command::addCall(const std::string&, const std::function<void(const double&)>&, const std::string&,
                                  const double&);
template Option* Command::addCall(const std::string&, const std::function<void(const bool&)>&, const std::string&,
                                  const bool&);

Option* Command::addFlag(const std::string& name, bool& variable, const std::string& help) {
  return keep(app().add_flag(name, variable, help));
}

Option* Command::addFlag(const std::string& name, const std::function<void()>& act, const std::string& help) {
  return keep(app().add_flag_callback(name, act, help));
}

Command* Command::addSubcommand(const std::string& name, const std::string& description) {
  return keep(app().add_subcommand(name, description));
}

void Command::requireSubcommand() { app().require_subcommand(1); }

Command* Command::addGroup(const std::string& name, const std::string& description, std::optional<int> most) {
  CLI::App* group = app().add_option_group(name, description);
  if (most) group->require_option(1, static_cast<std::size_t>(*most));
  return keep(group);
}

void Command::footer(const std::string& text) { app().footer(text); }
void Command::onChosen(const std::function<void()>& act) { app().callback(act); }
void Command::onRead(const std::function<void()>& act) { app().parse_complete_callback(act); }

void refuseValue(const std::string& option, const std::string& rule) { throw CLI::ValidationError(option, rule); }
void refuseBoth(const std::string& option, const std::string& other) { throw CLI::ExcludesError(option, other); }
void refuseWithout(const std::string& option) { throw CLI::RequiredError(option); }

}  // namespace angio::cli
