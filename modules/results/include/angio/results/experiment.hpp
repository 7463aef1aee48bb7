// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "angio/base/interruption.hpp"
#include "angio/results/statistics.hpp"

namespace angio::results {

// An experiment is a number of runs that do not depend on each other, each of which leaves one record; columns.hpp has
// what is reported of the records.

/// Called with how many runs are done, by one at a time.
using Progress = std::function<void(int done)>;

/// Runs `one(k)` for k = 0 .. count - 1, up to `threads` at a time, and comes back when all are done. The first failure
/// comes out here as InputError or std::runtime_error in which `nameOf(k)` names the run, and no more are begun. After
/// SIGINT or SIGTERM no more are begun either, and a run that throws Interrupted is given up. Returns which runs are
/// finished. Throws Interrupted when none is.
std::vector<bool> forEachRun(int count, int threads, const std::function<std::string(int k)>& nameOf,
                             const std::function<void(int k)>& one, const Progress& done = {});

/// The same with the record that each finished run leaves, in their order.
template <typename One>
auto recordsOf(int count, int threads, const std::function<std::string(int k)>& nameOf, const One& one,
               const Progress& done = {}) {
  std::vector<decltype(one(0))> records(static_cast<std::size_t>(count));
  const std::vector<bool> finished = forEachRun(
      count, threads, nameOf, [&](int k) { records[static_cast<std::size_t>(k)] = one(k); }, done);
  std::size_t kept = 0;
  for (std::size_t k = 0; k < records.size(); ++k) {
    if (finished[k]) std::swap(records[kept++], records[k]);
  }
  records.resize(kept);
  return records;
}

/// Does one part of an experiment of several, and returns whether to go on. After SIGINT or SIGTERM it returns false,
/// and a part of which nothing is finished is left out; `has_results` of parts before it, or Interrupted goes on its
/// way.
template <typename Part>
bool finishPart(bool has_results, const Part& part) {
  try {
    part();
  } catch (const Interrupted&) {
    if (!has_results) throw;
  }
  return !interrupted();
}

/// Processor, cores, compiler, versions: what a time depends on.
Json machineAsJson();

}  // namespace angio::results
