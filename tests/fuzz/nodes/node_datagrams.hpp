// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "angio/test/namespace.hpp"

namespace angio::test {

/// The C-arm's and the catheter's node, each on a UDP bus of its own with recording on, on this machine's loopback and
/// a port of this process; and a socket that sends them any bytes.
class NodesOnSocket {
 public:
  /// Throws InputError where there is no multicast.
  NodesOnSocket();
  ~NodesOnSocket();
  NodesOnSocket(const NodesOnSocket&) = delete;
  NodesOnSocket& operator=(const NodesOnSocket&) = delete;

  /// Sends datagrams, one after another: a byte for the socket of two that it is sent from, two for its size, and its
  /// bytes. Then says a state of each machine and a frame, as their machines would. Throws std::logic_error when a node
  /// does not answer that frame, a record cannot be written or read, or memory grows without bound.
  void receive(const std::uint8_t* bytes, std::size_t size);

  /// Frames that both nodes have answered so far.
  std::int64_t answered() const { return answered_; }

 private:
  class Lab;
  std::unique_ptr<Lab> lab_;
  std::int64_t answered_ = 0, inputs_ = 0, first_bytes_ = 0;
};

}  // namespace angio::test
