// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <igtlClientSocket.h>
#include <igtlImageMessage.h>
#include <igtlMessageHeader.h>
#include <igtlPolyDataMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "angio/igtl/igtl_server.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

/// A client by the library's own socket and messages, in a thread of its own; what it reads is checked by the library's
/// CRC.
class LibraryClient {
 public:
  explicit LibraryClient(int port) {
    socket_ = ::igtl::ClientSocket::New();
    if (socket_->ConnectToServer("127.0.0.1", port) != 0) throw std::runtime_error("cannot connect");
    socket_->SetReceiveTimeout(20'000);
    reader_ = std::thread([this] { read(); });
  }
  LibraryClient(const LibraryClient&) = delete;
  LibraryClient& operator=(const LibraryClient&) = delete;
  ~LibraryClient() {
    socket_->CloseSocket();
    reader_.join();
  }

  template <typename Message>
  void send(Message& message) {
    message->Pack();
    socket_->Send(message->GetPackPointer(), static_cast<int>(message->GetPackSize()));
  }

  /// How many messages of this device have come.
  int count(const std::string& device) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = counts_.find(device);
    return found == counts_.end() ? 0 : found->second;
  }
  int badCrcs() const { return bad_crcs_; }

  /// The last message of a device.
  ::igtl::MessageBase::Pointer last(const std::string& device) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return last_.at(device);
  }
  /// Bytes of the first pixel of each image, in their order.
  std::vector<int> firstPixels() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return first_pixels_;
  }

 private:
  template <typename Message>
  ::igtl::MessageBase::Pointer body(::igtl::MessageHeader::Pointer& header) {
    auto message = Message::New();
    message->SetMessageHeader(header);
    message->AllocatePack();
    const int size = static_cast<int>(message->GetPackBodySize());
    if (size > 0 && socket_->Receive(message->GetPackBodyPointer(), size) != size) return {};
    if (!(message->Unpack(1) & ::igtl::MessageHeader::UNPACK_BODY)) ++bad_crcs_;
    return message.GetPointer();
  }

  void read() {
    for (;;) {
      auto header = ::igtl::MessageHeader::New();
      header->InitPack();
      const int size = static_cast<int>(header->GetPackSize());
      if (socket_->Receive(header->GetPackPointer(), size) != size) return;
      header->Unpack();
      const std::string type = header->GetDeviceType();
      ::igtl::MessageBase::Pointer message;
      if (type == "IMAGE") message = body<::igtl::ImageMessage>(header);
      if (type == "TRANSFORM") message = body<::igtl::TransformMessage>(header);
      if (type == "POLYDATA") message = body<::igtl::PolyDataMessage>(header);
      if (type == "STATUS") message = body<::igtl::StatusMessage>(header);
      if (message.IsNull()) return;
      const std::lock_guard<std::mutex> lock(mutex_);
      ++counts_[header->GetDeviceName()];
      last_[header->GetDeviceName()] = message;
      if (type == "IMAGE") {
        auto* image = static_cast<::igtl::ImageMessage*>(message.GetPointer());
        first_pixels_.push_back(*static_cast<std::uint16_t*>(image->GetScalarPointer()));
      }
    }
  }

  ::igtl::ClientSocket::Pointer socket_;
  mutable std::mutex mutex_;
  std::map<std::string, int> counts_;
  std::map<std::string, ::igtl::MessageBase::Pointer> last_;
  std::vector<int> first_pixels_;
  std::atomic<int> bad_crcs_{0};
  std::thread reader_;
};

/// A client that sends whatever bytes, and reads when it is told to.
class RawClient {
 public:
  explicit RawClient(int port, int receive_buffer_bytes = 0) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    if (receive_buffer_bytes > 0) {
      ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("cannot connect");
    }
  }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;
  ~RawClient() { ::close(socket_); }

  void send(const std::string& bytes) const { (void)::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }

  /// What has come by now.
  std::string read() const {
    std::string all, block(1 << 16, '\0');
    for (;;) {
      const ssize_t got = ::recv(socket_, block.data(), block.size(), MSG_DONTWAIT);
      if (got <= 0) return all;
      all.append(block, 0, static_cast<std::size_t>(got));
    }
  }

 private:
  int socket_;
};

/// Handles the server until `done`, for a few seconds at most. Returns whether it is.
inline bool handleUntil(const std::function<void()>& handle, const std::function<bool()>& done) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    handle();
  }
  return true;
}

}  // namespace angio::test
