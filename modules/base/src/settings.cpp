// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/settings.hpp"

#include "angio/base/errors.hpp"

namespace angio::base {
namespace {

class RangeCheck final : public SettingsVisitor {
 public:
  explicit RangeCheck(std::string place) : place_(std::move(place)) {}

  void number(const char* key, double& value, double low, double high, const char*) override {
    requireBetween(place_, key, value, low, high);
  }
  void integer(const char* key, int& value, int low, int high, const char*) override {
    requireBetween(place_, key, value, low, high);
  }
  void flag(const char*, bool&, const char*) override {}
  void numbers(const char* key, double* values, int count, double low, double high, const char*) override {
    for (int i = 0; i < count; ++i) requireBetween(place_, key + ("[" + std::to_string(i) + "]"), values[i], low, high);
  }
  void choiceIndex(const char* key, int& index, const std::vector<std::string>& names, const char*) override {
    requireBetween(place_, key, index, 0, static_cast<double>(names.size()) - 1);
  }
  void fixed(const char* name, double value, double low, double high) override {
    requireBetween(place_, name, value, low, high);
  }
  void section(const char* key, const std::function<void(SettingsVisitor&)>& visit_fields, const char*) override {
    RangeCheck inner(place_ + "." + key);
    visit_fields(inner);
  }

 private:
  std::string place_;
};

}  // namespace

void checkSettings(const std::string& place, const std::function<void(SettingsVisitor&)>& visit_fields) {
  RangeCheck check(place);
  visit_fields(check);
}

}  // namespace angio::base
