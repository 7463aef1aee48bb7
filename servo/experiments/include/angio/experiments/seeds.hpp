// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>

#include "angio/experiments/namespace.hpp"

namespace angio::experiments {

/// Runs `one(k)` for k = 0 .. count - 1, up to `threads` at a time, and comes back when all are done. What they do must
/// not depend on each other; then the order does not matter. The first exception comes out here, and no more are begun.
/// `done` is called with how many are done, by one at a time.
void forEachInParallel(int count, int threads, const std::function<void(int k)>& one,
                       const std::function<void(int done)>& done = {});

}  // namespace angio::experiments
