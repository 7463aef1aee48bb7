// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include "binding.hpp"

namespace angio::python {

/// Runs C++ that knows nothing of Python, while other threads of Python run.
template <typename Work>
auto unlocked(const Work& work) {
  const py::gil_scoped_release release;
  return work();
}

/// An object of C++ that serves one thread at a time: of Python's threads one waits for the other.
template <typename T>
class Guarded {
 public:
  template <typename... Arguments>
  explicit Guarded(Arguments&&... arguments) : object_(std::forward<Arguments>(arguments)...) {}

  /// work(object), without Python's lock. The object's own lock is taken after that is gone: who has it may be waiting
  /// for Python. The same thread may come in again, from a handler.
  template <typename Work>
  auto use(const Work& work) {
    const py::gil_scoped_release release;
    return useUnlocked(work);
  }

  /// The same for C++ that does not hold Python's lock.
  template <typename Work>
  auto useUnlocked(const Work& work) {
    const std::lock_guard<std::recursive_mutex> lock(mutex_);
    return work(object_);
  }

 private:
  std::recursive_mutex mutex_;
  T object_;
};

/// Lets Ctrl-C end long work, which calls this now and then: throws KeyboardInterrupt.
inline void letInterrupt() {
  const py::gil_scoped_acquire acquire;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

/// A function of Python that C++ keeps and calls on whichever thread.
class PythonCallback {
 public:
  explicit PythonCallback(py::object function)
      : function_(function.is_none() ? nullptr : new py::object(std::move(function)), [](py::object* kept) {
          const py::gil_scoped_acquire acquire;
          delete kept;
        }) {}

  /// Calls it, if there is one; what it throws comes out.
  template <typename... Arguments>
  void operator()(Arguments&&... arguments) const {
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (function_) (*function_)(std::forward<Arguments>(arguments)...);
  }

 private:
  std::shared_ptr<py::object> function_;
};

}  // namespace angio::python
