// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <vector>

#include "angio/test/namespace.hpp"

namespace angio::test {

using Bytes = std::vector<std::uint8_t>;

/// A multicast group on this machine, with a port of this process's own, so that test programs at the same time do not
/// hear each other; and a plain socket that sends any bytes to it, as no LCM program would.
class UdpGroup {
 public:
  UdpGroup() : socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_port = htons(static_cast<std::uint16_t>(port_));
    inet_pton(AF_INET, "239.255.76.67", &address_.sin_addr);
    const unsigned char ttl = 0;
    setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
  }
  UdpGroup(const UdpGroup&) = delete;
  UdpGroup& operator=(const UdpGroup&) = delete;
  ~UdpGroup() { close(socket_); }

  std::string url() const { return "udpm://239.255.76.67:" + std::to_string(port_) + "?ttl=0"; }

  /// Sends one datagram to the group.
  void send(const Bytes& datagram) const {
    const auto sent = sendto(socket_, datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&address_),
                             sizeof address_);
    EXPECT_EQ(sent, static_cast<ssize_t>(datagram.size()));
  }

 private:
  const int port_ = 20000 + getpid() % 20000;
  const int socket_;
  sockaddr_in address_{};
};

/// The bytes of a text, without an end.
inline Bytes bytesOf(const std::string& text) { return {text.begin(), text.end()}; }

/// Adds a number of some bytes, the highest first.
inline void append(Bytes& datagram, std::uint32_t number, int count) {
  while (count-- > 0) datagram.push_back(static_cast<std::uint8_t>(number >> (8 * count)));
}

/// A short message of LCM as it goes over the wire. `channel_and_data` has the NUL between the two.
inline Bytes shortDatagram(std::uint32_t sequence, const std::string& channel_and_data) {
  Bytes datagram = bytesOf("LC02");
  append(datagram, sequence, 4);
  datagram.insert(datagram.end(), channel_and_data.begin(), channel_and_data.end());
  return datagram;
}

/// One fragment of a long message of LCM.
struct LongDatagram {
  std::uint32_t sequence = 0, message_bytes = 0, offset = 0;
  std::uint16_t number = 0, fragments = 0;
  std::string payload;  ///< Of number 0: channel, NUL, data.

  Bytes bytes() const {
    Bytes datagram = bytesOf("LC03");
    for (const std::uint32_t word : {sequence, message_bytes, offset}) append(datagram, word, 4);
    for (const std::uint16_t half : {number, fragments}) append(datagram, half, 2);
    datagram.insert(datagram.end(), payload.begin(), payload.end());
    return datagram;
  }
};

}  // namespace angio::test
