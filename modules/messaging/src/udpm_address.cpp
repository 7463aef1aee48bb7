// SPDX-License-Identifier: GPL-2.0-or-later
#include "udpm_address.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <regex>

#include "angio/base/errors.hpp"

namespace angio::messaging {
namespace {

// A whole number in C's notation, as LCM reads it.
int optionFrom(const std::string& url, const std::string& name, const std::string& text, long max) {
  char* end = nullptr;
  const long value = std::strtol(text.c_str(), &end, 0);
  if (text.empty() || *end != '\0' || value < 0 || value > max) {
    throw InputError("bus", "url", url, name + " must be a whole number from 0 to " + std::to_string(max));
  }
  return static_cast<int>(value);
}

void readOptions(const std::string& url, const std::string& options, UdpmAddress& address) {
  for (std::size_t begin = 0; begin < options.size();) {
    const std::size_t end = std::min(options.find('&', begin), options.size());
    const std::string option = options.substr(begin, end - begin);
    const std::size_t equals = std::min(option.find('='), option.size());
    const std::string name = option.substr(0, equals), value = option.substr(std::min(equals + 1, option.size()));
    if (name == "ttl") {
      address.ttl = optionFrom(url, name, value, 255);
    } else if (name == "recv_buf_size") {
      address.receive_buffer_bytes = optionFrom(url, name, value, 1L << 30);
    } else if (!option.empty()) {
      throw InputError("bus", "url", url, "has an unknown option: must be ttl or recv_buf_size");
    }
    begin = end + 1;
  }
}

}  // namespace

std::string UdpmAddress::groupAndPort() const {
  char text[INET_ADDRSTRLEN] = "";
  inet_ntop(AF_INET, &group.sin_addr, text, sizeof text);
  return std::string(text) + ":" + std::to_string(ntohs(group.sin_port));
}

UdpmAddress parseUdpmUrl(const std::string& url) {
  static const std::regex kUdpm(R"(udpm://([\d.]+:(\d{1,5}))?(\?(.*))?)");
  const InputError wrong("bus", "url", url, "must name a multicast group and port, such as udpm://239.255.76.67:7667");
  std::smatch parts;
  if (!std::regex_match(url, parts, kUdpm)) throw wrong;
  const std::string place = parts[1].matched ? parts.str(1) : "239.255.76.67:7667";
  const std::size_t colon = place.find(':');
  const long port = std::stol(place.substr(colon + 1));
  UdpmAddress address;
  address.group.sin_family = AF_INET;
  address.group.sin_port = htons(static_cast<std::uint16_t>(port));
  const bool an_address = inet_pton(AF_INET, place.substr(0, colon).c_str(), &address.group.sin_addr) == 1;
  if (!an_address || !IN_MULTICAST(ntohl(address.group.sin_addr.s_addr)) || port < 1 || port > 65535) throw wrong;
  readOptions(url, parts.str(4), address);
  return address;
}

void requireRoute(const std::string& url, const UdpmAddress& address) {
  const OpenDescriptor probe(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ip_mreq membership{};
  membership.imr_multiaddr = address.group.sin_addr;
  if (connect(probe.get(), reinterpret_cast<const sockaddr*>(&address.group), sizeof address.group) != 0 ||
      setsockopt(probe.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) != 0) {
    throw InputError("bus", "url", url, std::string("cannot be opened: ") + kMulticastRule);
  }
}

}  // namespace angio::messaging
