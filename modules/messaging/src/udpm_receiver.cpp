// SPDX-License-Identifier: GPL-2.0-or-later
#include "udpm_receiver.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <new>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace angio::messaging {

void ReceiveQueue::push(LcmMessage message, bool named) {
  Waiting added{named ? message.channel : "", std::move(message)};
  if (counts_[added.group] >= (named ? kMaxWaiting : kMaxWaitingUnnamed)) {
    erase(std::find_if(waiting_.begin(), waiting_.end(), [&](const Waiting& w) { return w.group == added.group; }));
  }
  const std::size_t size = added.message.bytes.size();
  while (!waiting_.empty() && bytes_ + size > kMaxWaiting_bytes) erase(waiting_.begin());
  ++counts_[added.group];
  bytes_ += size;
  waiting_.push_back(std::move(added));
}

std::optional<LcmMessage> ReceiveQueue::pop() {
  if (waiting_.empty()) return std::nullopt;
  const std::size_t size = waiting_.front().message.bytes.size();
  LcmMessage message = std::move(waiting_.front().message);
  bytes_ -= size;
  --counts_[waiting_.front().group];
  waiting_.pop_front();
  return message;
}

void ReceiveQueue::erase(std::deque<Waiting>::iterator oldest) {
  bytes_ -= oldest->message.bytes.size();
  --counts_[oldest->group];
  waiting_.erase(oldest);
}

namespace {

// More than UDP carries.
constexpr std::size_t kMaxDatagram_bytes = 65536;

// Datagrams between two looks at whether the thread is to end.
constexpr int kMaxDatagramsAtOnce = 1000;

std::runtime_error failed(const std::string& what, int error) {
  return std::runtime_error(what + ": " + std::generic_category().message(error));
}

void require(int result, const char* what) {
  if (result < 0) throw failed(what, errno);
}

void signalTo(const OpenDescriptor& event) { eventfd_write(event.get(), 1); }

// A thread that blocks all signals, so that they reach the one that waits for a message.
template <typename Function>
std::thread threadWithoutSignals(Function function) {
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  try {
    std::thread thread(std::move(function));
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    return thread;
  } catch (...) {
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    throw;
  }
}

}  // namespace

UdpmReceiver::UdpmReceiver(const UdpmAddress& address, const Say& say)
    : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)),
      ready_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      stop_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      datagrams_([this](const std::string& channel) { return wants(channel); }) {
  require(socket_.get(), "no socket");
  require(ready_.get(), "no event");
  require(stop_.get(), "no event");
  join(address);
  if (!hearsItself(say)) throw std::runtime_error("nothing comes back from the group");
  thread_ = threadWithoutSignals([this] { run(); });
}

UdpmReceiver::~UdpmReceiver() {
  signalTo(stop_);
  thread_.join();
}

void UdpmReceiver::join(const UdpmAddress& address) {
  // Other programs of this machine listen at the same port.
  const int on = 1;
  require(setsockopt(socket_.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on), "SO_REUSEADDR");
  const int buffer_bytes = address.receive_buffer_bytes;
  if (buffer_bytes > 0) {
    require(setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes), "SO_RCVBUF");
  }
  // To the group's own address: what is sent to another group, or to this machine alone, is not heard.
  require(bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address.group), sizeof address.group), "bind");
  ip_mreq membership{};
  membership.imr_multiaddr = address.group.sin_addr;
  membership.imr_interface.s_addr = htonl(INADDR_ANY);
  require(setsockopt(socket_.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership),
          "IP_ADD_MEMBERSHIP");
  const auto ttl = static_cast<unsigned char>(address.ttl);
  require(setsockopt(socket_.get(), IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl), "IP_MULTICAST_TTL");
}

// As LCM does. A message tells its process and receiver, so that another program's is not taken for it.
bool UdpmReceiver::hearsItself(const Say& say) {
  const std::string text =
      "angio self test " + std::to_string(getpid()) + " " + std::to_string(reinterpret_cast<std::uintptr_t>(this));
  // Behind LCM's magic word and number.
  constexpr std::size_t kHeader_bytes = 8;
  const std::string said = std::string(kLcmSelfTestChannel) + '\0' + text;
  std::string heard(kMaxDatagram_bytes, '\0');
  pollfd waited{socket_.get(), POLLIN, 0};
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::seconds(3);
  while (Clock::now() < end) {
    say(text);
    const auto next_try = Clock::now() + std::chrono::milliseconds(100);
    while (Clock::now() < next_try) {
      poll(&waited, 1, 10);
      sockaddr_in from{};
      socklen_t length = sizeof from;
      const ssize_t size =
          recvfrom(socket_.get(), heard.data(), heard.size(), 0, reinterpret_cast<sockaddr*>(&from), &length);
      if (size < static_cast<ssize_t>(kHeader_bytes)) continue;
      if (heard.compare(kHeader_bytes, static_cast<std::size_t>(size) - kHeader_bytes, said) != 0) continue;
      self_ = {ntohl(from.sin_addr.s_addr), ntohs(from.sin_port)};
      return true;
    }
  }
  return false;
}

void UdpmReceiver::want(const std::string& channel) {
  const std::lock_guard lock(mutex_);
  channels_.insert(channel);
}

void UdpmReceiver::wantAll() {
  const std::lock_guard lock(mutex_);
  all_ = true;
}

bool UdpmReceiver::wants(const std::string& channel) const {
  if (channel == kLcmSelfTestChannel) return false;
  const std::lock_guard lock(mutex_);
  return all_ || channels_.count(channel) > 0;
}

std::optional<LcmMessage> UdpmReceiver::next(int wait_ms) {
  if (auto message = pop()) return message;
  pollfd waited{ready_.get(), POLLIN, 0};
  if (wait_ms == 0 || poll(&waited, 1, wait_ms) <= 0) return std::nullopt;
  return pop();
}

std::optional<LcmMessage> UdpmReceiver::pop() {
  const std::lock_guard lock(mutex_);
  auto message = queue_.pop();
  if (!message && failure_) throw failed("receiving failed", *failure_);
  if (message && queue_.empty() && !failure_) {
    eventfd_t count = 0;
    eventfd_read(ready_.get(), &count);
  }
  return message;
}

void UdpmReceiver::run() {
  std::vector<std::uint8_t> datagram(kMaxDatagram_bytes);
  pollfd waited[] = {{socket_.get(), POLLIN, 0}, {stop_.get(), POLLIN, 0}};
  for (;;) {
    if (poll(waited, 2, -1) < 0) {
      if (errno == EINTR) continue;
      return fail(errno);
    }
    if (waited[1].revents != 0 || !drain(datagram)) return;
  }
}

// Takes what waits in the socket. Returns false when receiving has failed.
bool UdpmReceiver::drain(std::vector<std::uint8_t>& datagram) {
  for (int i = 0; i < kMaxDatagramsAtOnce; ++i) {
    sockaddr_in from{};
    socklen_t length = sizeof from;
    const ssize_t size =
        recvfrom(socket_.get(), datagram.data(), datagram.size(), 0, reinterpret_cast<sockaddr*>(&from), &length);
    if (size < 0) {
      if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) return true;
      if (errno == ENOMEM || errno == ENOBUFS || errno == ENETDOWN) continue;
      fail(errno);
      return false;
    }
    try {
      auto message = datagrams_.take({ntohl(from.sin_addr.s_addr), ntohs(from.sin_port)}, datagram.data(),
                                     static_cast<std::size_t>(size));
      refused_ = datagrams_.refused();
      if (message) deliver(std::move(*message));
    } catch (const std::bad_alloc&) {  // The message is lost, as on a full network.
    }
  }
  return true;
}

void UdpmReceiver::deliver(LcmMessage message) {
  const std::lock_guard lock(mutex_);
  const bool was_empty = queue_.empty();
  const bool named = channels_.count(message.channel) > 0;
  queue_.push(std::move(message), named);
  if (was_empty) signalTo(ready_);
}

void UdpmReceiver::fail(int error) {
  const std::lock_guard lock(mutex_);
  failure_ = error;
  signalTo(ready_);
}

}  // namespace angio::messaging
