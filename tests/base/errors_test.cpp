// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/errors.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "angio/test/errors.hpp"

namespace angio::test {
namespace {

TEST(InputError, JoinsItsPartsInOneLine) {
  EXPECT_STREQ(InputError("camera.yaml:2", "fx_px", "-5", "must be positive").what(),
               "camera.yaml:2: fx_px = -5: must be positive");
}

TEST(InputError, LeavesOutEmptyParts) {
  EXPECT_STREQ(InputError("a.csv", "", "", "is empty").what(), "a.csv: is empty");
  EXPECT_STREQ(InputError("a.csv:3", "x_px", "", "is missing").what(), "a.csv:3: x_px: is missing");
  EXPECT_STREQ(InputError("a.csv:3", "", "abc", "must be a number").what(), "a.csv:3: 'abc': must be a number");
  EXPECT_STREQ(InputError("", "method", "x", "must be known").what(), "method = x: must be known");
  EXPECT_STREQ(InputError("", "", "", "no input").what(), "no input");
}

TEST(InputError, StaysOnePrintableLineWhateverTheInputHolds) {
  const std::string nasty = std::string("a\nb\r\tc\x1b[31m\x7f") + '\0' + "d";
  const InputError error(nasty, nasty, nasty, nasty);
  const std::string line = InputError(nasty, nasty, nasty, nasty).within(nasty).what();
  for (const std::string& shown_line : {std::string(error.what()), line}) {
    for (const char c : shown_line) EXPECT_TRUE(c >= 0x20 && c != 0x7f) << static_cast<int>(c);
    EXPECT_THAT(shown_line, testing::HasSubstr("a?b??c?[31m??d"));
  }
}

TEST(InputError, CutsALongValueButKeepsTheRule) {
  const std::string line = InputError("f.csv:1", "x_px", std::string(100000, 'x'), "must be a number").what();
  EXPECT_LT(line.size(), 400u);
  EXPECT_THAT(line, testing::EndsWith("...: must be a number"));
}

TEST(InputError, SeenFromFurtherOutNamesBothPlaces) {
  EXPECT_STREQ(InputError("tree.csv:17", "parent", "9", "must exist").within("cases.yaml:12").what(),
               "cases.yaml:12: tree.csv:17: parent = 9: must exist");
}

TEST(Requirements, RefuseWhatIsNoNumberAndReturnWhatIs) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const double bad : {0.0, -1.0, nan, inf}) EXPECT_THROW(requirePositive("p", "f", bad), InputError) << bad;
  for (const double bad : {nan, inf, -inf}) EXPECT_THROW(requireFinite("p", "f", bad), InputError) << bad;
  for (const double bad : {0.9, 2.1, nan, inf}) EXPECT_THROW(requireBetween("p", "f", bad, 1, 2), InputError) << bad;
  EXPECT_EQ(requirePositive("p", "f", 1e-300), 1e-300);
  EXPECT_EQ(requireBetween("p", "f", 1, 1, 2), 1);
  EXPECT_EQ(requireBetween("p", "f", 2, 1, 2), 2);
  EXPECT_EQ(test::refusalOf([&] { requireBetween("cam.yaml", "w", nan, 1, 2.5); }),
            "cam.yaml: w = nan: must lie between 1 and 2.5");
}

}  // namespace
}  // namespace angio::test
