// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/settings_files.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <set>
#include <sstream>

#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::refusalOf;
using test::TemporaryFolder;

struct FormerInner {
  double spacing_mm = 2;
  int max_lines = 7;
  void visit(SettingsVisitor& v) {
    v.number("spacing_mm", spacing_mm, 0, 10, "Distance between points");
    v.integer("max_lines", max_lines, 1, 100, "Most lines");
  }
};

struct FormerOuter {
  int iterations = 20;
  double least_share = 0.5;  // Has a former prefix, and is what it is called.
  FormerInner inner;
  void visit(SettingsVisitor& v) {
    v.integer("iterations", iterations, 1, 100, "Most iterations");
    v.number("least_share", least_share, 0, 1, "A share");
    v.section("inner", [&](SettingsVisitor& w) { inner.visit(w); });
  }
};

const FormerKeys kTable = {{"inner.scale_px", "tolerance"},
                           {{"rounds", "iterations"}, {"inner.step_mm", "spacing_mm"}, {"within", "inner"}},
                           {{"most_", "max_"}, {"least_", "min_"}}};

struct Read {
  FormerOuter settings;
  std::string warnings;
};

Read read(const TemporaryFolder& folder, const std::string& content) {
  Read result;
  std::ostringstream warnings;
  readSettings(
      folder.write("s.yaml", content), [&](SettingsVisitor& v) { result.settings.visit(v); }, kTable, warnings);
  result.warnings = warnings.str();
  for (std::size_t at; (at = result.warnings.find(folder.path(""))) != std::string::npos;) {
    result.warnings.erase(at, folder.path("").size());
  }
  return result;
}

TEST(FormerKeys, ConstantsAreIgnoredWithAWarning) {
  const TemporaryFolder folder;
  const Read r = read(folder, "iterations: 3\ntolerance: 4\ninner:\n  scale_px: [1, 2]\n  spacing_mm: 5\n");
  EXPECT_EQ(r.settings.iterations, 3);
  EXPECT_EQ(r.settings.inner.spacing_mm, 5);
  EXPECT_EQ(r.warnings,
            "s.yaml:4: scale_px = (list of 2): is a constant now, ignored\n"
            "s.yaml:2: tolerance = 4: is a constant now, ignored\n");
}

TEST(FormerKeys, AKeyOfOneSectionIsUnknownInOthers) {
  const TemporaryFolder folder;
  const std::string path = folder.write("s.yaml", "scale_px: 1\n");
  std::ostringstream warnings;
  FormerOuter s;
  EXPECT_NE(refusalOf([&] {
              readSettings(
                  path, [&](SettingsVisitor& v) { s.visit(v); }, kTable, warnings);
            }).find("s.yaml:1: scale_px = 1: unknown key; there are: iterations, least_share, inner"),
            std::string::npos);
}

TEST(FormerKeys, RenamedKeysAndSectionsAreReadWithAWarning) {
  const TemporaryFolder folder;
  const Read r = read(folder, "rounds: 9\nwithin:\n  step_mm: 4\n  most_lines: 12\n");
  EXPECT_EQ(r.settings.iterations, 9);
  EXPECT_EQ(r.settings.inner.spacing_mm, 4);
  EXPECT_EQ(r.settings.inner.max_lines, 12);
  EXPECT_EQ(r.warnings,
            "s.yaml:2: within = (map): is called inner now\n"
            "s.yaml:1: rounds = 9: is called iterations now\n"
            "s.yaml:4: most_lines = 12: is called max_lines now\n"
            "s.yaml:3: step_mm = 4: is called spacing_mm now\n");
}

TEST(FormerKeys, ASettingWithAFormerPrefixIsReadAsItself) {
  const TemporaryFolder folder;
  const Read r = read(folder, "least_share: 0.25\n");
  EXPECT_EQ(r.settings.least_share, 0.25);
  EXPECT_EQ(r.warnings, "");
}

TEST(FormerKeys, WrongUseIsRefused) {
  const TemporaryFolder folder;
  const std::pair<const char*, const char*> cases[] = {
      {"inner:\n  max_lines: 3\n  most_lines: 4\n",
       "s.yaml:3: most_lines = 4: is called max_lines now, which is given too"},
      {"rounds: 3\niterations: 4\n", "s.yaml:1: rounds = 3: is called iterations now, which is given too"},
      {"within:\ninner:\n", "s.yaml:1: within = (nothing): is called inner now, which is given too"},
      {"rounds: 300\n", "s.yaml:1: iterations = 300: must lie between 1 and 100"},
      {"most_iterations: 3\n", "s.yaml:1: most_iterations = 3: unknown key"},
      {"inner:\n  least_lines: 3\n", "s.yaml:2: least_lines = 3: unknown key"},
  };
  for (const auto& [content, expected] : cases) {
    const std::string message = refusalOf([&, text = content] { read(folder, text); });
    EXPECT_NE(message.find(expected), std::string::npos) << message << "\nexpected: " << expected;
  }
}

TEST(FormerKeys, SmallestIsMinNow) {
  EXPECT_EQ(formerKeys().nameNow({}, "smallest_tree_mm", {"min_tree_mm"}), "min_tree_mm");
  EXPECT_EQ(formerKeys().nameNow({}, "smallest_tree_mm", {"max_tree_mm"}), std::nullopt);
}

// A key of two sections may have been renamed in one and become a constant in the other.
TEST(FormerKeys, TheTableNamesAKeyOnce) {
  std::set<std::string> names;
  for (const std::string& entry : formerKeys().constants) EXPECT_TRUE(names.insert(entry).second) << entry;
  names.clear();
  for (const auto& entry : formerKeys().renamed) EXPECT_TRUE(names.insert(entry.former).second) << entry.former;
}

}  // namespace
}  // namespace angio::test
