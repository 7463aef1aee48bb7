// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include "angio/vessel/vessel_tree.hpp"
#include "binding.hpp"

namespace angio::python {

/// Runs C++ that knows nothing of Python, while other threads of Python run.
template <typename Work>
auto unlocked(const Work& work) {
  const py::gil_scoped_release release;
  return work();
}

/// Taken by work that hears signals while it runs, as experiments do: of that there may be one at a time.
inline std::mutex signal_hearer;

/// unlocked() for such work.
template <typename Work>
auto alone(const Work& work) {
  return unlocked([&] {
    const std::lock_guard<std::mutex> lock(signal_hearer);
    return work();
  });
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

/// An object that works on a tree and borrows it: keeps both, and guards the object.
template <typename T>
class OnTree {
 public:
  /// @param make  Returns a new object, as std::unique_ptr<Guarded<T>>, for the tree that it is given. Called without
  ///              Python's lock.
  template <typename Make>
  OnTree(std::shared_ptr<const vessel::VesselTree> tree, const Make& make)
      : tree_(std::move(tree)), object_(unlocked([&] { return make(*tree_); })) {}

  /// work(object), as Guarded::use().
  template <typename Work>
  auto use(const Work& work) {
    return object_->use(work);
  }

  const std::shared_ptr<const vessel::VesselTree>& tree() const { return tree_; }

 private:
  std::shared_ptr<const vessel::VesselTree> tree_;
  std::unique_ptr<Guarded<T>> object_;
};

/// What such an object made of a frame, and the tree that it looked for.
template <typename Report>
struct TreeReport {
  Report report;
  std::shared_ptr<const vessel::VesselTree> tree;

  /// The getter of one of the report's fields.
  template <typename Value>
  static auto told(Value Report::*member) {
    return [member](const TreeReport& seen) { return seen.report.*member; };
  }
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
