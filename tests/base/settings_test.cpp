// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/settings.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "angio/test/errors.hpp"

namespace angio::test {
namespace {

enum class Color { kRed, kBlue };

struct Inner {
  double spacing_mm = 1;
  void visit(SettingsVisitor& v) { v.number("spacing_mm", spacing_mm, 0, 10, "Distance between points"); }
};

struct Outer {
  int iterations = 5;
  bool on = true;
  Color color = Color::kRed;
  Inner inner;
  double gate = 4;
  void visit(SettingsVisitor& v) {
    v.integer("iterations", iterations, 1, 100, "Most iterations");
    v.flag("on", on, "Whether anything happens");
    v.choice("colour", color, {"red", "blue"}, "Its colour");
    v.section("inner", [&](SettingsVisitor& fields) { inner.visit(fields); });
    v.fixed("gate", gate, 2, 100);
  }
};

TEST(CheckSettings, TakesTheDefaultsAndTheBorders) {
  Outer settings;
  EXPECT_NO_THROW(checkSettings("s.yaml", settings));
  settings.iterations = 100;
  settings.color = Color::kBlue;
  settings.inner.spacing_mm = 0;
  EXPECT_NO_THROW(checkSettings("s.yaml", settings));
}

TEST(CheckSettings, NamesPlaceKeyValueAndRule) {
  Outer settings;
  settings.iterations = 0;
  EXPECT_EQ(test::refusalOf([&] { checkSettings("s.yaml", settings); }),
            "s.yaml: iterations = 0: must lie between 1 and 100");
}

TEST(CheckSettings, RefusesWhatOnlyCodeSets) {
  Outer settings;
  settings.gate = 1;
  EXPECT_EQ(test::refusalOf([&] { checkSettings("s.yaml", settings); }),
            "s.yaml: gate = 1: must lie between 2 and 100");
}

TEST(CheckSettings, NamesTheSectionAndRefusesNaN) {
  Outer settings;
  settings.inner.spacing_mm = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(test::refusalOf([&] { checkSettings("s.yaml", settings); }),
            "s.yaml.inner: spacing_mm = nan: must lie between 0 and 10");
}

TEST(CheckSettings, RefusesAnEnumWithoutAName) {
  Outer settings;
  settings.color = static_cast<Color>(2);
  EXPECT_THAT(test::refusalOf([&] { checkSettings("s.yaml", settings); }), testing::HasSubstr("colour"));
}

}  // namespace
}  // namespace angio::test
