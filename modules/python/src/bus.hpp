// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <stdexcept>

#include "angio/messaging/bus.hpp"
#include "message_types.hpp"
#include "unlocked.hpp"

namespace angio::python {

/// A bus for threads of Python: one at a time has it.
class PythonBus {
 public:
  explicit PythonBus(std::unique_ptr<Bus> bus) : bus_(std::move(bus)) {}

  /// work(bus), as Guarded::use(). Throws std::runtime_error when the bus has been closed.
  template <typename Work>
  auto use(const Work& work) {
    return bus_.use([&](std::unique_ptr<Bus>& bus) {
      if (!bus) throw std::runtime_error("the bus has been closed");
      return work(*bus);
    });
  }

  void close() {
    bus_.use([](std::unique_ptr<Bus>& bus) { bus.reset(); });
  }

 private:
  Guarded<std::unique_ptr<Bus>> bus_;
};

/// The bytes of a message, or bytes as they are, for a channel. Throws InputError when the message breaks a rule of its
/// type or is of another type than the channel's, TypeError when it is no message.
std::vector<std::uint8_t> wireBytes(const std::string& channel, const py::object& message);

}  // namespace angio::python
