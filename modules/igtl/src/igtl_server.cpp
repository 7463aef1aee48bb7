// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/igtl/igtl_server.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "angio/base/errors.hpp"

namespace angio::igtl {
namespace {

constexpr std::size_t kMaxClients = 8;

// What is heard is short; what is not heard is passed over up to this length, and then its sender is let go.
constexpr std::uint64_t kMaxHeard_bytes = 1 << 16, kMaxPassedOver_bytes = std::uint64_t{1} << 30;

constexpr std::size_t kReadAtOnce_bytes = 1 << 16;
// So that a client who sends without a pause does not keep the others waiting.
constexpr int kMaxReads = 16;

std::int64_t wallTime_us() {
  using namespace std::chrono;
  return duration_cast<microseconds>(system_clock::now().time_since_epoch()).count();
}

bool wouldBlock() { return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR; }

struct Packet {
  std::string bytes;
  bool image = false;
};

}  // namespace

struct IgtlServer::Client {
  explicit Client(int accepted, std::string of, HeaderVersion speaks)
      : socket(accepted), name(std::move(of)), version(speaks) {}
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client() { ::close(socket); }

  int socket;
  std::string name;
  HeaderVersion version;
  std::string in;
  std::uint64_t pass_over_bytes = 0;  // Of a message that is not heard.
  std::deque<Packet> out;
  std::size_t begun_bytes = 0;  // Of the first packet, written.
  std::size_t waiting_bytes = 0;
  bool gone = false;
};

IgtlServer::IgtlServer(const IgtlServerSettings& settings) : settings_(settings) {
  const std::string place = settings.address + ":" + std::to_string(settings.port);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(settings.port));
  if (::inet_pton(AF_INET, settings.address.c_str(), &address.sin_addr) != 1) {
    throw InputError(place, "address", settings.address, "must be an IPv4 address");
  }
  listening_ = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int yes = 1;
  ::setsockopt(listening_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  socklen_t length = sizeof address;
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  if (listening_ < 0 || ::bind(listening_, generic, length) != 0 || ::listen(listening_, 2 * kMaxClients) != 0 ||
      ::getsockname(listening_, generic, &length) != 0) {
    const std::string cause = std::generic_category().message(errno);
    if (listening_ >= 0) ::close(listening_);
    throw InputError(place, "", "", "cannot be listened on: " + cause);
  }
  port_ = ntohs(address.sin_port);
}

IgtlServer::~IgtlServer() { ::close(listening_); }

std::size_t IgtlServer::waiting_bytes() const {
  std::size_t bytes = 0;
  for (const auto& client : clients_) bytes += client->waiting_bytes;
  return bytes;
}

void IgtlServer::enqueue(Client& client, const IgtlMessage& message, std::int64_t time_us) {
  Packet packet{bytesOf(message, client.version, time_us), message.type == "IMAGE"};
  client.waiting_bytes += packet.bytes.size();
  client.out.push_back(std::move(packet));
  client.gone |= !shrink(client);
}

// Drops images that have not been begun until the rest is little enough; no when it is still too much.
bool IgtlServer::shrink(Client& client) {
  for (std::size_t i = client.begun_bytes > 0 ? 1 : 0;
       i < client.out.size() && client.waiting_bytes > settings_.max_waiting_bytes;) {
    if (!client.out[i].image) {
      ++i;
      continue;
    }
    client.waiting_bytes -= client.out[i].bytes.size();
    client.out.erase(client.out.begin() + static_cast<std::ptrdiff_t>(i));
    ++dropped_;
  }
  return client.waiting_bytes <= settings_.max_waiting_bytes;
}

void IgtlServer::send(const IgtlMessage& message) {
  const std::int64_t now_us = wallTime_us();
  if (message.type != "IMAGE") kept_[message.type + " " + message.device] = {message, now_us};
  for (const auto& client : clients_) enqueue(*client, message, now_us);
}

void IgtlServer::accept(const Problem& problem) {
  for (;;) {
    sockaddr_in from{};
    socklen_t length = sizeof from;
    const int accepted =
        ::accept4(listening_, reinterpret_cast<sockaddr*>(&from), &length, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (accepted < 0) return;
    char text[INET_ADDRSTRLEN] = "";
    ::inet_ntop(AF_INET, &from.sin_addr, text, sizeof text);
    const std::string name = std::string(text) + ":" + std::to_string(ntohs(from.sin_port));
    auto client = std::make_unique<Client>(accepted, name, settings_.version);
    if (clients_.size() >= kMaxClients) {
      problem(name + ": is one client too many");
      continue;
    }
    const int yes = 1;
    ::setsockopt(accepted, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    for (const auto& [device, kept] : kept_) enqueue(*client, kept.first, kept.second);
    clients_.push_back(std::move(client));
  }
}

// Whole messages of what has come; no when the client cannot be understood any more.
bool IgtlServer::take(Client& client, const Handler& handler, const Problem& problem) {
  for (;;) {
    const auto passed = static_cast<std::size_t>(std::min<std::uint64_t>(client.pass_over_bytes, client.in.size()));
    client.in.erase(0, passed);
    client.pass_over_bytes -= passed;
    if (client.in.size() < IgtlHeader::kBytes) return true;
    const auto header = readHeader(client.in);
    if (!header) {
      ++refused_;
      problem(client.name + ": its header is of a version that is not known");
      return false;
    }
    if (!isHeard(*header) || header->body_bytes > kMaxHeard_bytes) {
      if (isHeard(*header) || header->body_bytes > kMaxPassedOver_bytes) {
        ++refused_;
        problem(client.name + ": " + header->type + " of " + std::to_string(header->body_bytes) + " bytes is too long");
        return false;
      }
      client.pass_over_bytes = IgtlHeader::kBytes + header->body_bytes;
      continue;
    }
    const std::size_t whole = IgtlHeader::kBytes + static_cast<std::size_t>(header->body_bytes);
    if (client.in.size() < whole) return true;
    const auto read =
        readBody(*header, std::string_view(client.in).substr(IgtlHeader::kBytes, whole - IgtlHeader::kBytes));
    client.in.erase(0, whole);
    if (const auto* wrong = std::get_if<std::string>(&read)) {
      ++refused_;
      problem(client.name + ": " + *wrong);
      continue;
    }
    client.version = static_cast<HeaderVersion>(header->version);
    handler(std::get<Received>(read));
  }
}

bool IgtlServer::read(Client& client, const Handler& handler, const Problem& problem) {
  std::string block(kReadAtOnce_bytes, '\0');
  for (int i = 0; i < kMaxReads; ++i) {
    const ssize_t got = ::recv(client.socket, block.data(), block.size(), 0);
    if (got < 0) return wouldBlock();
    if (got == 0) return false;
    client.in.append(block, 0, static_cast<std::size_t>(got));
    if (!take(client, handler, problem)) return false;
  }
  return true;
}

bool IgtlServer::write(Client& client) {
  while (!client.out.empty()) {
    const std::string& bytes = client.out.front().bytes;
    const ssize_t written =
        ::send(client.socket, bytes.data() + client.begun_bytes, bytes.size() - client.begun_bytes, MSG_NOSIGNAL);
    if (written < 0) return wouldBlock();
    client.begun_bytes += static_cast<std::size_t>(written);
    client.waiting_bytes -= static_cast<std::size_t>(written);
    if (client.begun_bytes < bytes.size()) continue;
    client.out.pop_front();
    client.begun_bytes = 0;
  }
  return true;
}

void IgtlServer::handle(std::chrono::milliseconds timeout, const Handler& handler, const Problem& problem) {
  std::vector<pollfd> watched{{listening_, POLLIN, 0}};
  for (const auto& client : clients_) {
    watched.push_back({client->socket, static_cast<short>(client->out.empty() ? POLLIN : POLLIN | POLLOUT), 0});
  }
  if (::poll(watched.data(), watched.size(), static_cast<int>(timeout.count())) > 0) {
    for (std::size_t i = 1; i < watched.size(); ++i) {
      Client& client = *clients_[i - 1];
      if (watched[i].revents & POLLOUT) client.gone |= !write(client);
      if (watched[i].revents & (POLLIN | POLLHUP | POLLERR)) client.gone |= !read(client, handler, problem);
    }
    if (watched[0].revents & POLLIN) accept(problem);
  }
  clients_.erase(std::remove_if(clients_.begin(), clients_.end(), [](const auto& client) { return client->gone; }),
                 clients_.end());
}

}  // namespace angio::igtl
