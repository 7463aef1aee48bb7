// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/seeds.hpp"

#include <algorithm>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace angio::experiments {

void forEachInParallel(int count, int threads, const std::function<void(int k)>& one,
                       const std::function<void(int done)>& done) {
  std::mutex mutex;
  int next = 0, finished = 0;
  std::exception_ptr failure;
  const auto work = [&] {
    for (;;) {
      int k = 0;
      {
        const std::lock_guard<std::mutex> lock(mutex);
        if (next >= count || failure) return;
        k = next++;
      }
      try {
        one(k);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (!failure) failure = std::current_exception();
        return;
      }
      const std::lock_guard<std::mutex> lock(mutex);
      ++finished;
      if (done) done(finished);
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < std::min(threads, count); ++i) others.emplace_back(work);
  work();
  for (auto& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace angio::experiments
