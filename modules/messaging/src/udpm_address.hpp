// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <netinet/in.h>
#include <unistd.h>

#include <string>

#include "angio/messaging/namespace.hpp"

namespace angio::messaging {

/// What programs on UDP multicast need besides a group; the end of a message to the user.
constexpr const char* kMulticastRule =
    "needs a multicast route, on one machine: ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo";

/// The receive buffer unless a URL says so itself. With LCM's default buffer, nearly every frame of 2 MiB is lost; with
/// 4 MiB none is.
constexpr int kReceiveBuffer_bytes = 4194304;

/// A multicast group, and how to send to it and hear it.
struct UdpmAddress {
  sockaddr_in group{};
  int ttl = 0;                                      ///< 0: this machine only; 1: the local network.
  int receive_buffer_bytes = kReceiveBuffer_bytes;  ///< 0: the system's own.

  /// "239.255.76.67:7667".
  std::string groupAndPort() const;
};

/// Reads "udpm://group:port?ttl=0&recv_buf_size=4194304"; "udpm://" alone is LCM's own group, 239.255.76.67:7667.
/// Throws InputError that names the URL and the rule.
UdpmAddress parseUdpmUrl(const std::string& url);

/// Throws InputError when this machine has no route to the group or cannot join it.
void requireRoute(const std::string& url, const UdpmAddress& address);

/// A file descriptor that is closed with this object; none when it is negative.
class OpenDescriptor {
 public:
  explicit OpenDescriptor(int descriptor) : descriptor_(descriptor) {}
  OpenDescriptor(const OpenDescriptor&) = delete;
  OpenDescriptor& operator=(const OpenDescriptor&) = delete;
  ~OpenDescriptor() {
    if (descriptor_ >= 0) close(descriptor_);
  }

  int get() const { return descriptor_; }

 private:
  const int descriptor_;
};

}  // namespace angio::messaging
