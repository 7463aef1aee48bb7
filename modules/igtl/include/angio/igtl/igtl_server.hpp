// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "angio/igtl/igtl_messages.hpp"
#include "angio/igtl/namespace.hpp"

namespace angio::igtl {

/// Where and how a server speaks.
struct IgtlServerSettings {
  std::string address = "127.0.0.1";                      ///< Of the interface it listens on; 0.0.0.0: all of them.
  int port = 18944;                                       ///< OpenIGTLink's; 0: any that is free.
  HeaderVersion version = HeaderVersion::k1;              ///< Until a client speaks the other.
  std::size_t max_waiting_bytes = std::size_t{64} << 20;  ///< Of one client that reads slowly.
};

/// Serves OpenIGTLink over TCP, from one thread, and never waits for a client: one that reads slowly loses images, the
/// oldest first, and is let go when even the rest is too much for it. At most 8 clients. There is neither a password
/// nor a cipher: whoever reaches the port is a client.
class IgtlServer {
 public:
  /// Throws InputError that names address and port when it cannot listen there.
  explicit IgtlServer(const IgtlServerSettings& settings = {});
  IgtlServer(const IgtlServer&) = delete;
  IgtlServer& operator=(const IgtlServer&) = delete;
  ~IgtlServer();

  int port() const { return port_; }
  std::size_t clients() const { return clients_.size(); }

  /// For every client, and for those that come later the last one of each device, but images.
  void send(const IgtlMessage& message);

  /// What came and what was wrong with it, a line each.
  using Handler = std::function<void(const Received&)>;
  using Problem = std::function<void(const std::string&)>;

  /// Takes and lets go clients, reads and writes, for as long as there is something to do, and at most `timeout` to
  /// wait for it.
  void handle(std::chrono::milliseconds timeout, const Handler& handler, const Problem& problem);

  /// Bytes that wait to be written, of all clients.
  std::size_t waiting_bytes() const;

  std::int64_t droppedImages() const { return dropped_; }  ///< For clients that read slowly, so far.
  std::int64_t refused() const { return refused_; }        ///< Messages that nothing was done for, so far.

 private:
  struct Client;
  void accept(const Problem& problem);
  bool read(Client& client, const Handler& handler, const Problem& problem);
  bool take(Client& client, const Handler& handler, const Problem& problem);
  bool write(Client& client);
  void enqueue(Client& client, const IgtlMessage& message, std::int64_t time_us);
  bool shrink(Client& client);

  IgtlServerSettings settings_;
  int listening_ = -1, port_ = 0;
  std::vector<std::unique_ptr<Client>> clients_;
  std::map<std::string, std::pair<IgtlMessage, std::int64_t>> kept_;  // The last of each device, and when.
  std::int64_t dropped_ = 0, refused_ = 0;
};

}  // namespace angio::igtl
