// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "angio/test/namespace.hpp"

namespace angio::test {

/// A multicast group that stays on this machine, by its port; and a plain socket that sends any bytes to it, as no LCM
/// program would.
class DatagramSocket {
 public:
  explicit DatagramSocket(int port) : port_(port), socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_port = htons(static_cast<std::uint16_t>(port));
    inet_pton(AF_INET, kGroup, &address_.sin_addr);
    const unsigned char ttl = 0;
    setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
  }
  DatagramSocket(const DatagramSocket&) = delete;
  DatagramSocket& operator=(const DatagramSocket&) = delete;
  ~DatagramSocket() { close(socket_); }

  /// A port of this process's own, so that test programs at the same time do not hear each other.
  static int ownPort() { return 20000 + getpid() % 20000; }

  static std::string urlOf(int port) { return std::string("udpm://") + kGroup + ":" + std::to_string(port) + "?ttl=0"; }
  std::string url() const { return urlOf(port_); }

  /// Sends one datagram to the group. Returns whether the system has taken it.
  bool send(const std::uint8_t* bytes, std::size_t size) const {
    return sendto(socket_, bytes, size, 0, reinterpret_cast<const sockaddr*>(&address_), sizeof address_) ==
           static_cast<ssize_t>(size);
  }

 private:
  static constexpr const char* kGroup = "239.255.76.67";
  const int port_, socket_;
  sockaddr_in address_{};
};

}  // namespace angio::test
