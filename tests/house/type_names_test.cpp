// SPDX-License-Identifier: GPL-2.0-or-later
// Two types of one name are one type to the linker: it takes the functions of either for both, and which is which
// depends on the compiler.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>

namespace angio {
namespace {

std::string withoutCommentsAndTexts(const std::string& source) {
  static const std::regex kNoCode(R"re(//[^\n]*|/\*[^]*?\*/|"(\\.|[^"\\\n])*"|'(\\.|[^'\\\n])+')re");
  return std::regex_replace(source, kNoCode, " ");
}

// Types that a source defines in a namespace which has a name, with it.
std::set<std::string> typesIn(const std::string& source) {
  static const std::regex kBlock(
      R"re(namespace\s+([\w:]*)\s*\{|\b(?:struct|class|enum)\s+(?:class\s+)?([\w:]+)[^;{}()=<>]*\{|[{}])re");
  const std::string code = withoutCommentsAndTexts(source);
  std::set<std::string> types;
  std::vector<std::string> open;  // Names of the namespaces around a place; "{" stands for any other block.
  for (std::sregex_iterator i(code.begin(), code.end(), kBlock), end; i != end; ++i) {
    const std::smatch& found = *i;
    if (found.str() == "}") {
      if (!open.empty()) open.pop_back();
    } else if (found[1].matched) {
      open.push_back(found[1].length() > 0 ? found.str(1) : "{");
    } else {
      const bool inside = std::find(open.begin(), open.end(), "{") != open.end();
      if (found[2].matched && !open.empty() && !inside) types.insert(open.back() + "::" + found.str(2));
      open.emplace_back("{");
    }
  }
  return types;
}

TEST(TypeNames, AreFoundWhereTheyAreSharedAndOnlyThere) {
  const std::string source =
      "namespace angio { struct A { struct B {}; }; class C; class D final : public A {}; // struct E {\n"
      "enum class F { kOne }; namespace { struct G {}; } void h() { struct I {}; } struct A::J {}; }\n";
  EXPECT_EQ(typesIn(source), (std::set<std::string>{"angio::A", "angio::D", "angio::F", "angio::A::J"}));
}

TEST(TypeNames, BelongToOneFileEach) {
  std::map<std::string, std::set<std::string>> places;
  int files = 0;
  for (const char* part : {"modules", "servo", "calibration"}) {
    const std::filesystem::path root = std::filesystem::path(ANGIO_SOURCES) / part;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".hpp" && extension != ".cpp") continue;
      ++files;
      std::ostringstream text;
      text << std::ifstream(entry.path()).rdbuf();
      for (const std::string& type : typesIn(text.str())) places[type].insert(entry.path().string());
    }
  }
  EXPECT_GT(files, 500);
  EXPECT_GT(places.size(), 400u);
  for (const auto& [type, where] : places) {
    EXPECT_EQ(where.size(), 1u) << type << " is defined in " << *where.begin() << " and " << *where.rbegin();
  }
}

}  // namespace
}  // namespace angio
