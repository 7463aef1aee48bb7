// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/authenticated_bus.hpp"

#include <fcntl.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <exception>
#include <random>
#include <set>
#include <stdexcept>
#include <utility>

#include "angio/base/big_endian.hpp"
#include "angio/base/errors.hpp"
#include "angio/types/channels.hpp"
#include "udpm_address.hpp"

namespace angio::messaging {
namespace {

constexpr std::size_t kMinKey_bytes = 32, kMaxKey_bytes = 4096;
constexpr std::array<std::uint8_t, 8> kMagic = {'A', 'N', 'G', 'I', 'O', 'H', 'M', 1};
constexpr std::size_t kHead_bytes = 24, kTag_bytes = 32, kEnvelope_bytes = kHead_bytes + kTag_bytes;

// Of one sender, and of senders.
constexpr std::size_t kMaxCounters = 256, kMaxSessions = 256;

void put(std::uint8_t* at, std::uint64_t number) {
  for (int i = 0; i < 8; ++i) at[i] = static_cast<std::uint8_t>(number >> (56 - 8 * i));
}

std::uint64_t randomNumber() {
  std::random_device device;
  return static_cast<std::uint64_t>(device()) << 32 | device();
}

// Which counters of which sessions were taken.
class TakenOnce {
 public:
  // Whether it is the first time.
  bool take(std::uint64_t session, std::int64_t counter, std::int64_t now_us) {
    if (sessions_.count(session) == 0 && sessions_.size() >= kMaxSessions) forgetOld(now_us);
    if (sessions_.count(session) == 0 && sessions_.size() >= kMaxSessions) return false;
    Session& known = sessions_[session];
    if (counter <= known.floor || !known.taken.insert(counter).second) return false;
    while (known.taken.size() > kMaxCounters) {
      known.floor = *known.taken.begin();
      known.taken.erase(known.taken.begin());
    }
    return true;
  }

 private:
  struct Session {
    std::set<std::int64_t> taken;
    std::int64_t floor = 0;  // All up to it are refused.
  };

  // Whose counters are too old by now to be taken.
  void forgetOld(std::int64_t now_us) {
    for (auto at = sessions_.begin(); at != sessions_.end();) {
      at = *at->second.taken.rbegin() < now_us - AuthenticatedBus::kMaxAge_us ? sessions_.erase(at) : std::next(at);
    }
  }

  std::map<std::uint64_t, Session> sessions_;
};

}  // namespace

// One subscription of the inner bus, with what it has taken so far. The inner bus ends with the authenticated one.
class AuthenticatedBus::Ear {
 public:
  // `others`: its own messages do not come here; one that does was recorded.
  explicit Ear(AuthenticatedBus& bus, bool others = false) : bus_(bus), others_(others) {}

  // Returns the message without its envelope; nothing when it is refused.
  const std::uint8_t* open(const std::string& channel, const std::uint8_t* data, std::size_t& size, bool counts) {
    if (!isAuthenticated(channel)) return data;
    const auto refuse = [&](const char* cause) {
      bus_.refuse(channel, cause, counts);
      return nullptr;
    };
    if (!isEnvelope(data, size)) return refuse("no envelope");
    const std::uint8_t* message = data + kEnvelope_bytes;
    const auto tag = bus_.tagOf(data, channel, message, size - kEnvelope_bytes);
    if (CRYPTO_memcmp(tag.data(), data + kHead_bytes, kTag_bytes) != 0) return refuse("another key");
    const auto counter = bigEndian<std::int64_t>(data + 16);
    const std::int64_t now_us = bus_.clock_();
    if (counter < bus_.began_us_) return refuse("from before this program began");
    if (counter < now_us - kMaxAge_us || counter > now_us + kMaxAge_us) return refuse("its clock is too far from ours");
    const std::uint64_t session = bigEndian<std::uint64_t>(data + 8);
    if ((others_ && session == bus_.session_) || !taken_.take(session, counter, now_us)) return refuse("replayed");
    size -= kEnvelope_bytes;
    return message;
  }

  std::vector<Handler> handlers;

 private:
  AuthenticatedBus& bus_;
  const bool others_;
  TakenOnce taken_;
};

std::vector<std::uint8_t> readKeyFile(const std::string& path) {
  const OpenDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat about {};
  if (file.get() < 0 || fstat(file.get(), &about) != 0 || !S_ISREG(about.st_mode)) {
    throw InputError(path, "", "", "cannot be read: must be a key file");
  }
  if ((about.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    throw InputError(path, "", "", "may be read by others than its owner: chmod 600");
  }
  std::vector<std::uint8_t> key(kMaxKey_bytes + 1);
  const ssize_t size = ::read(file.get(), key.data(), key.size());
  if (size < static_cast<ssize_t>(kMinKey_bytes) || size > static_cast<ssize_t>(kMaxKey_bytes)) {
    throw InputError(path, "size", std::to_string(size), "must be 32 to 4096 bytes: head -c 32 /dev/urandom > key");
  }
  key.resize(static_cast<std::size_t>(size));
  return key;
}

bool isEnvelope(const std::uint8_t* data, std::size_t size) {
  return size >= kEnvelope_bytes && std::equal(kMagic.begin(), kMagic.end(), data);
}

bool isAuthenticated(const std::string& channel) {
  static const std::set<std::string> kChannels = {
      kCArmCommandChannel, kCatheterCommandChannel, kServoRequestChannel, kCatheterRequestChannel,
      kServoStatusChannel, kCatheterStatusChannel,  kServoSessionChannel, kCatheterSessionChannel,
      kViewRequestChannel, kRegistrationChannel,    kCatheterTipChannel};
  return kChannels.count(channel) > 0;
}

std::optional<std::string> unprotectedWarning(const std::string& url, const std::string& key_path) {
  if (!key_path.empty() || url.compare(0, 7, "udpm://") != 0 || parseUdpmUrl(url).ttl == 0) return std::nullopt;
  return "bus " + url + " reaches other machines without a key: whoever is on that network can command (--key-file)";
}

AuthenticatedBus::AuthenticatedBus(std::unique_ptr<Bus> bus, std::vector<std::uint8_t> key, Tell tell, Clock clock)
    : bus_(std::move(bus)),
      key_(std::move(key)),
      tell_(std::move(tell)),
      clock_(std::move(clock)),
      began_us_(clock_()),
      session_(randomNumber()) {
  if (key_.size() < kMinKey_bytes) throw std::invalid_argument("a key must have at least 32 bytes");
}

AuthenticatedBus::~AuthenticatedBus() = default;

std::int64_t AuthenticatedBus::systemTime_us() {
  using namespace std::chrono;
  return duration_cast<microseconds>(system_clock::now().time_since_epoch()).count();
}

std::int64_t AuthenticatedBus::unauthenticated() const {
  std::int64_t sum = 0;
  for (const auto& [cause, count] : causes_) sum += count;
  return sum;
}

void AuthenticatedBus::refuse(const std::string& channel, const char* cause, bool counts) {
  if (!counts) return;
  if (causes_[cause]++ > 0 || !tell_) return;
  const std::string sender = bus_->sender();
  tell_("a message on " + channel + (sender.empty() ? "" : " from " + sender) + " is refused: " + cause +
        " (told once; all are counted)");
}

std::vector<std::uint8_t> AuthenticatedBus::tagOf(const std::uint8_t* head, const std::string& channel,
                                                  const std::uint8_t* data, std::size_t size) const {
  std::vector<std::uint8_t> signed_bytes(head, head + kHead_bytes);
  signed_bytes.insert(signed_bytes.end(), channel.c_str(), channel.c_str() + channel.size() + 1);
  signed_bytes.insert(signed_bytes.end(), data, data + size);
  std::vector<std::uint8_t> tag(kTag_bytes);
  unsigned length = 0;
  if (!HMAC(EVP_sha256(), key_.data(), static_cast<int>(key_.size()), signed_bytes.data(), signed_bytes.size(),
            tag.data(), &length) ||
      length != kTag_bytes) {
    throw std::runtime_error("HMAC-SHA256 failed");
  }
  return tag;
}

void AuthenticatedBus::publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) {
  if (!isAuthenticated(channel)) return bus_->publish(channel, bytes);
  counter_ = std::max(counter_ + 1, clock_());
  std::vector<std::uint8_t> sealed(kEnvelope_bytes + bytes.size());
  std::copy(kMagic.begin(), kMagic.end(), sealed.begin());
  put(sealed.data() + 8, session_);
  put(sealed.data() + 16, static_cast<std::uint64_t>(counter_));
  const auto tag = tagOf(sealed.data(), channel, bytes.data(), bytes.size());
  std::copy(tag.begin(), tag.end(), sealed.begin() + kHead_bytes);
  std::copy(bytes.begin(), bytes.end(), sealed.begin() + kEnvelope_bytes);
  bus_->publish(channel, sealed);
}

// One subscription of the inner bus for each channel: a message that two handlers hear is opened once.
void AuthenticatedBus::subscribe(const std::string& channel, Handler handler) {
  if (!isAuthenticated(channel)) return bus_->subscribe(channel, std::move(handler));
  std::shared_ptr<Ear>& ear = channels_[channel];
  if (ear) {
    ear->handlers.push_back(std::move(handler));
    return;
  }
  ear = std::make_shared<Ear>(*this);
  ear->handlers.push_back(std::move(handler));
  bus_->subscribe(channel, [ear = ear.get(), channel](const std::uint8_t* data, std::size_t size) {
    const std::uint8_t* message = ear->open(channel, data, size, true);
    if (!message) return;
    std::exception_ptr thrown;
    // Handlers may subscribe: only those that were there hear this message.
    for (std::size_t i = 0, count = ear->handlers.size(); i < count; ++i) {
      const Handler each = ear->handlers[i];
      try {
        each(message, size);
      } catch (...) {
        if (!thrown) thrown = std::current_exception();
      }
    }
    if (thrown) std::rethrow_exception(thrown);
  });
}

void AuthenticatedBus::subscribeAll(Listener listener) {
  others_.push_back(std::make_shared<Ear>(*this));
  const bool first = others_.size() == 1;
  bus_->subscribeAll([this, first, ear = others_.back().get(), listener = std::move(listener)](
                         const std::string& channel, const std::uint8_t* data, std::size_t size) {
    if (const auto* message = ear->open(channel, data, size, first && channels_.count(channel) == 0)) {
      listener(channel, message, size);
    }
  });
}

void AuthenticatedBus::overhear(const std::string& channel, Handler handler) {
  others_.push_back(std::make_shared<Ear>(*this, true));
  bus_->overhear(channel, [this, channel, ear = others_.back().get(), handler = std::move(handler)](
                              const std::uint8_t* data, std::size_t size) {
    const bool counts = channels_.count(channel) == 0;
    if (const auto* message = ear->open(channel, data, size, counts)) handler(message, size);
  });
}

std::unique_ptr<Bus> withKeyFile(std::unique_ptr<Bus> bus, const std::string& key_path, AuthenticatedBus::Tell tell) {
  if (key_path.empty()) return bus;
  return std::make_unique<AuthenticatedBus>(std::move(bus), readKeyFile(key_path), std::move(tell));
}

}  // namespace angio::messaging
