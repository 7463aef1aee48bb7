// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/experiment.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/results/columns.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

std::string nameOf(int k) { return "seed " + std::to_string(k); }

struct Journey {
  int held = 0;
  std::optional<double> settled_s;
  std::vector<double> errors_mm;
};

const std::vector<Column<Journey>> kColumns = {
    {"held", "held", "sum", [](const Journey& r) { return r.held; }},
    {"times/settled_s", "settling_s", "p50 max", [](const Journey& r) { return orNull(r.settled_s); }},
    {"", "succeeded", "sum", [](const Journey& r) { return r.settled_s.has_value(); }},
    {"", "error_mm/worst", "max", [](const Journey& r) { return Json(r.errors_mm); }}};

TEST(Experiment, RowsAndSummaryFollowTheColumns) {
  const std::vector<Journey> runs = {{2, 1.0, {1, 5}}, {3, {}, {}}, {4, 3.0, {2}}};
  EXPECT_EQ(rowsOf(runs, kColumns).dump(),
            R"([{"held":2,"times":{"settled_s":1.0}},{"held":3},{"held":4,"times":{"settled_s":3.0}}])");
  Json summary;
  summarise(runs, kColumns, summary);
  EXPECT_EQ(summary.dump(), R"({"held":9,"settling_s":{"p50":2.0,"max":3.0},"succeeded":2,"error_mm":{"worst":5.0}})");
}

TEST(Experiment, ManyThreadsLeaveTheSameRecordsInTheSameOrder) {
  std::atomic<int> calls{0};
  int last = 0;
  const auto squares = recordsOf(
      50, 4, nameOf, [&](int k) { return ++calls, k * k; }, [&](int done) { last = done; });
  ASSERT_EQ(squares.size(), 50u);
  for (int k = 0; k < 50; ++k) EXPECT_EQ(squares[static_cast<std::size_t>(k)], k * k);
  EXPECT_EQ(calls, 50);
  EXPECT_EQ(last, 50);
}

TEST(Experiment, AFailedRunIsNamedAndEndsTheExperiment) {
  std::atomic<int> begun{0};
  const auto fail = [&](int k) {
    ++begun;
    if (k == 3) throw InputError("tree.csv", "points", "0", "must be at least one");
  };
  EXPECT_EQ(refusalOf([&] { forEachRun(10, 1, nameOf, fail); }), "seed 3: tree.csv: points = 0: must be at least one");
  EXPECT_EQ(begun, 4);
  try {
    forEachRun(2, 2, nameOf, [](int) { throw std::runtime_error("no answer"); });
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr(": no answer"));
  }
}

TEST(Figures, AreThoseThatAreNamed) {
  const Json values = {3, nullptr, {1, 8}};
  EXPECT_EQ(figuresOf(values, "sum").dump(), "12") << "whole numbers stay whole";
  EXPECT_EQ(figuresOf({1, {0.5, 1.0}}, "sum").dump(), "2.5");
  EXPECT_EQ(figuresOf({1, true, 2}, "sum").dump(), "4");
  EXPECT_EQ(figuresOf(values, "count"), 3);
  EXPECT_EQ(figuresOf(values, "mean median p50 p100 max").dump(),
            R"({"mean":4.0,"median":3.0,"p50":3.0,"p100":8.0,"max":8.0})");
  EXPECT_NEAR(figuresOf({3, 4}, "rms"), std::sqrt(12.5), 1e-12);
  EXPECT_EQ(figuresOf({true, false, false, false}, "percent"), 25);
  EXPECT_EQ(figuresOf(Json::array(), "percent"), 0);
}

TEST(Filled, PutsFiguresInTheirPlaces) {
  const Json values = {{"a", {{"b", 0.5}}}, {"n", 7}, {"name", "x"}, {"list", {1, 2}}};
  EXPECT_EQ(filled("{a/b:%.2f mm} of {n:%3d}, {100*a/b:%.0f %%}, {name:%-3s}|{list/1:%.1f}", values),
            "0.50 mm of   7, 50 %, x  |2.0");
  EXPECT_EQ(filled("{gone:%.1f} {name:%.1f} 100 %", values), "- - 100 %");
  EXPECT_EQ(figureTable({{"m", values}}, {{"method", ""}, {"half", "{a/b:%.1f}"}}),
            "| method | half |\n| --- | --- |\n| m | 0.5 |\n");
}

}  // namespace
}  // namespace angio::test
