// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/experiment.hpp"

#include <algorithm>
#include <exception>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "angio/base/errors.hpp"
#include "angio/base/interruption.hpp"

namespace angio::results {
namespace {

// What a run threw, with its name in front.
std::exception_ptr failureOf(const std::string& name) {
  try {
    throw;
  } catch (const InputError& error) {
    return std::make_exception_ptr(error.within(name));
  } catch (const std::exception& error) {
    return std::make_exception_ptr(std::runtime_error(name + ": " + error.what()));
  } catch (...) {
    return std::current_exception();
  }
}

}  // namespace

std::vector<bool> forEachRun(int count, int threads, const std::function<std::string(int k)>& nameOf,
                             const std::function<void(int k)>& one, const Progress& done) {
  std::mutex mutex;
  int next = 0, finished_count = 0;
  std::vector<bool> finished(static_cast<std::size_t>(std::max(count, 0)));
  std::exception_ptr failure;
  const InterruptionGuard guard;
  const auto work = [&] {
    for (;;) {
      std::unique_lock<std::mutex> lock(mutex);
      if (next >= count || failure || interrupted()) return;
      const int k = next++;
      lock.unlock();
      try {
        one(k);
      } catch (const Interrupted&) {
        return;
      } catch (...) {
        lock.lock();
        if (!failure) failure = failureOf(nameOf(k));
        return;
      }
      lock.lock();
      finished[static_cast<std::size_t>(k)] = true;
      ++finished_count;
      if (done) done(finished_count);
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < std::min(threads, count); ++i) others.emplace_back(work);
  work();
  for (auto& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
  if (interrupted() && finished_count == 0) throw Interrupted();
  return finished;
}

Json machineAsJson() {
  Json machine;
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    if (line.rfind("model name", 0) == 0) {
      machine["processor"] = line.substr(line.find(':') + 2);
      break;
    }
  }
  machine["cores"] = std::thread::hardware_concurrency();
  machine["compiler"] = __VERSION__;
  return machine;
}

}  // namespace angio::results
