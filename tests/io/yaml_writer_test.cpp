// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "angio/io/yaml.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using Json = nlohmann::ordered_json;

YamlNode readBack(const test::TemporaryFolder& folder, const Json& document) {
  return readYaml(folder.write("document.yaml", asYaml(document)));
}

// Texts that YAML would take for something else, or that would end a line, a key or a list.
TEST(YamlWriter, EveryTextComesBack) {
  const test::TemporaryFolder folder;
  for (const std::string text : {"true", "1e3", "~", "- a", "a: b", "# c", "[1, 2]", "\"quoted\"", "it's", "two\nlines",
                                 "\ttab", "&x", "*x", "!t", "caf\xc3\xa9", " blank ", "%", "{}", "\\"}) {
    const YamlNode root = readBack(folder, {{text, text}, {"list", {text, text}}, {"maps", {{{"k", text}}}}});
    YamlMap map("document.yaml", root, "document");
    EXPECT_EQ(map.need(text).text(), text);
    EXPECT_EQ(map.need("list").item(1).text(), text);
    const YamlField first = map.need("maps").item(0);
    EXPECT_EQ(YamlMap("document.yaml", *first.node, "maps[0]").need("k").text(), text);
  }
}

TEST(YamlWriter, NumbersAreExactAndNested) {
  const test::TemporaryFolder folder;
  const double third = 1.0 / 3, tiny = std::numeric_limits<double>::denorm_min();
  const Json document = {{"a", third},
                         {"rows", {{third, -tiny}, {1e300, 0.0}}},
                         {"m", {{"n", {{"flag", true}, {"i", -7}}}}},
                         {"empty", Json::array()}};
  const YamlNode root = readBack(folder, document);
  YamlMap map("document.yaml", root, "document");
  EXPECT_EQ(map.need("a").number(), third);
  EXPECT_EQ(map.need("rows").item(0).numbers(2), (std::vector<double>{third, -tiny}));
  EXPECT_EQ(map.need("rows").item(1).numbers(2), (std::vector<double>{1e300, 0}));
  EXPECT_TRUE(map.need("empty").numbers(0).empty());
  YamlMap m("document.yaml", *map.need("m").node, "m");
  YamlMap n("document.yaml", *m.need("n").node, "n");
  EXPECT_TRUE(n.need("flag").flag());
  EXPECT_EQ(n.need("i").integer(), -7);
  EXPECT_NE(test::refusalOf([] { asYaml({{"x_px", std::nan("")}}); }).find("x_px: must be finite"), std::string::npos);
}

}  // namespace
}  // namespace angio::test
