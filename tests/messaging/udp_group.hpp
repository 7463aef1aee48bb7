// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "angio/test/datagram_socket.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

/// A multicast group of this process's own, and what is sent to it.
class UdpGroup {
 public:
  std::string url() const { return socket_.url(); }

  /// Sends one datagram to the group.
  void send(const std::vector<std::uint8_t>& datagram) const {
    EXPECT_TRUE(socket_.send(datagram.data(), datagram.size()));
  }

 private:
  const DatagramSocket socket_{DatagramSocket::ownPort()};
};

/// The bytes of a text, without an end.
inline std::vector<std::uint8_t> bytesOf(const std::string& text) { return {text.begin(), text.end()}; }

/// Adds a number of some bytes, the highest first.
inline void append(std::vector<std::uint8_t>& datagram, std::uint32_t number, int count) {
  while (count-- > 0) datagram.push_back(static_cast<std::uint8_t>(number >> (8 * count)));
}

/// A short message of LCM as it goes over the wire. `channel_and_data` has the NUL between the two.
inline std::vector<std::uint8_t> shortDatagram(std::uint32_t sequence, const std::string& channel_and_data) {
  std::vector<std::uint8_t> datagram = bytesOf("LC02");
  append(datagram, sequence, 4);
  datagram.insert(datagram.end(), channel_and_data.begin(), channel_and_data.end());
  return datagram;
}

/// One fragment of a long message of LCM.
struct LongDatagram {
  std::uint32_t sequence = 0, message_bytes = 0, offset = 0;
  std::uint16_t number = 0, fragments = 0;
  std::string payload;  ///< Of number 0: channel, NUL, data.

  std::vector<std::uint8_t> bytes() const {
    std::vector<std::uint8_t> datagram = bytesOf("LC03");
    for (const std::uint32_t word : {sequence, message_bytes, offset}) append(datagram, word, 4);
    for (const std::uint16_t half : {number, fragments}) append(datagram, half, 2);
    datagram.insert(datagram.end(), payload.begin(), payload.end());
    return datagram;
  }
};

}  // namespace angio::test
