// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "angio/results/experiment.hpp"
#include "angio/results/record_row.hpp"

namespace angio::results {

/// Where the records of an experiment come from whose runs are not all made here and now: a part of them, on one of
/// several machines, or rows of those parts. An experiment asks for the rows of its parts in the same order each time.
class Campaign {
 public:
  /// What one run left.
  struct Row {
    int run = 0;
    Json value;
    std::string place;  ///< Of a row that was read: the file and line.
  };

  virtual ~Campaign() = default;

  /// The rows of the experiment's next part, which has `count` runs, in their order: those that are made here, or
  /// that were read. `one(k)` makes run k; otherwise as forEachRun().
  virtual std::vector<Row> rows(int count, int threads, const std::function<std::string(int k)>& nameOf,
                                const std::function<Json(int k)>& one, const Progress& done) = 0;

  /// Called when an experiment has asked for all of its parts.
  virtual void finish() {}
};

/// The records of a campaign's next part, each of its runs as toRow() has it; without a campaign those of all runs.
template <typename One>
auto recordsOf(Campaign* campaign, int count, int threads, const std::function<std::string(int k)>& nameOf,
               const One& one, const Progress& done = {}) {
  if (!campaign) return recordsOf(count, threads, nameOf, one, done);
  std::vector<decltype(one(0))> records;
  for (const Campaign::Row& row : campaign->rows(
           count, threads, nameOf, [&](int k) { return toRow(one(k)); }, done)) {
    fromRow(row.value, {row.place, ""}, records.emplace_back());
  }
  return records;
}

}  // namespace angio::results
