// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/bus.hpp"

#include <cmath>
#include <map>

#include "angio/base/errors.hpp"
#include "angio/messaging/any_message.hpp"
#include "angio/messaging/authenticated_bus.hpp"
#include "angio/types/channels.hpp"
#include "angio/types/command_gate.hpp"
#include "bus.hpp"

namespace angio::python {
namespace {

// The type that belongs on each channel.
const std::map<std::string, std::string>& channelTypes() {
  static const std::map<std::string, std::string> kTypes = {{kXrayFrameChannel, "XrayFrame"},
                                                            {kCArmStateChannel, "CArmState"},
                                                            {kCArmCommandChannel, "CArmCommand"},
                                                            {kRegistrationChannel, "RegistrationMessage"},
                                                            {kRegistrationPointsChannel, "RegistrationPoints"},
                                                            {kServoStatusChannel, "ServoStatus"},
                                                            {kServoInputChannel, "ServoInput"},
                                                            {kServoRequestChannel, "ServoRequest"},
                                                            {kCatheterStateChannel, "CatheterState"},
                                                            {kCatheterCommandChannel, "CatheterCommand"},
                                                            {kViewRequestChannel, "ViewRequest"},
                                                            {kCatheterTipChannel, "CatheterTip"},
                                                            {kCatheterInputChannel, "CatheterInput"},
                                                            {kCatheterStatusChannel, "ServoStatus"},
                                                            {kCatheterRequestChannel, "ServoRequest"},
                                                            {kServoSessionChannel, "ServoSession"},
                                                            {kCatheterSessionChannel, "ServoSession"}};
  return kTypes;
}

std::chrono::milliseconds milliseconds(double timeout_s) {
  requireBetween("", "timeout_s", timeout_s, 0, 86400);
  return std::chrono::milliseconds(static_cast<std::int64_t>(std::ceil(1e3 * timeout_s)));
}

// A mailbox of C++, whatever the type of its messages.
class Mailbox {
 public:
  virtual ~Mailbox() = default;
  virtual py::object take() = 0;
  virtual py::object peek() const = 0;
  virtual std::int64_t received() const = 0;
  virtual std::int64_t dropped() const = 0;
  virtual std::int64_t refused() const = 0;
  virtual std::string lastError() const = 0;
  virtual std::string sender() const = 0;
};

template <typename Message>
class MailboxOf final : public Mailbox {
 public:
  MailboxOf(std::shared_ptr<PythonBus> bus, const std::string& channel)
      : bus_(std::move(bus)),
        box_(bus_->use([&](Bus& b) { return std::make_unique<LatestMessage<Message>>(b, channel); })) {}

  py::object take() override {
    return py::cast(bus_->use([&](Bus&) { return box_->take(); }));
  }
  py::object peek() const override {
    return py::cast(bus_->use([&](Bus&) { return box_->peek(); }));
  }
  std::int64_t received() const override { return locked(&LatestMessage<Message>::received); }
  std::int64_t dropped() const override { return locked(&LatestMessage<Message>::dropped); }
  std::int64_t refused() const override { return locked(&LatestMessage<Message>::refused); }
  std::string lastError() const override { return locked(&LatestMessage<Message>::lastError); }
  std::string sender() const override { return locked(&LatestMessage<Message>::record).sender; }

 private:
  // Another thread may be filling the box.
  template <typename Value>
  std::decay_t<Value> locked(Value (LatestMessage<Message>::*told)() const) const {
    return bus_->use([&](Bus&) { return ((*box_).*told)(); });
  }

  std::shared_ptr<PythonBus> bus_;
  std::unique_ptr<LatestMessage<Message>> box_;
};

std::unique_ptr<Mailbox> latestOn(std::shared_ptr<PythonBus> bus, const std::string& channel) {
  const auto type = channelTypes().find(channel);
  if (type == channelTypes().end()) throw InputError("", "channel", channel, "must be one of angio.CHANNELS");
  std::unique_ptr<Mailbox> box;
  forEachMessage([&](auto tag) {
    using Message = typename decltype(tag)::Message;
    if (nameOfMessage<Message>() == type->second) box = std::make_unique<MailboxOf<Message>>(std::move(bus), channel);
  });
  return box;
}

// Whether a message belongs on a channel; on those that are not ours all do.
std::optional<std::string> misplaced(const std::string& channel, const AnyMessage& message) {
  const auto type = channelTypes().find(channel);
  if (type == channelTypes().end()) return std::nullopt;
  const auto name = std::visit([](const auto& m) { return nameOfMessage<std::decay_t<decltype(m)>>(); }, message);
  if (name == type->second) return std::nullopt;
  return channel + ": " + name + ": must be a " + type->second;
}

void subscribe(PythonBus& bus, const std::string& channel, const py::function& handler, const py::object& on_refused) {
  const PythonCallback call(handler), refused(on_refused);
  bus.use([&](Bus& b) {
    b.subscribe(channel, [channel, call, refused](const std::uint8_t* data, std::size_t size) {
      Decoded<AnyMessage> decoded = decodeAny(data, size);
      if (decoded.value) {
        if (const auto wrong = misplaced(channel, *decoded.value)) decoded = {std::nullopt, *wrong};
      }
      const py::gil_scoped_acquire acquire;
      if (decoded.value) {
        call(py::cast(std::move(*decoded.value)));
      } else {
        refused(py::str(decoded.error));
      }
    });
  });
}

void publishOn(PythonBus& bus, const std::string& channel, const py::object& message) {
  const std::vector<std::uint8_t> bytes = wireBytes(channel, message);
  bus.use([&](Bus& b) { b.publish(channel, bytes); });
}

int handle(PythonBus& bus, double timeout_s) {
  const auto timeout = milliseconds(timeout_s);
  const int count = bus.use([&](Bus& b) { return b.handle(timeout); });
  letInterrupt();
  return count;
}

std::shared_ptr<PythonBus> opened(const std::string& url, const std::string& key_file) {
  return std::make_shared<PythonBus>(withKeyFile(openBus(url), key_file, [](const std::string&) {}));
}

void bindGate(py::module_& m) {
  using Refusal = CommandGate::Refusal;
  py::class_<CommandGate> gate(m, "CommandGate", doc("CommandGate"));
  py::enum_<Refusal>(gate, "Refusal", "Why a command must not be obeyed.")
      .value("late", Refusal::kLate)
      .value("jumped", Refusal::kJumped)
      .value("other_sender", Refusal::kOtherSender);
  const auto counts = [](const py::object& command) {
    const bool catheter = py::isinstance<CatheterCommand>(command);
    if (!catheter && !py::isinstance<CArmCommand>(command)) {
      throw py::type_error("a command must be a CArmCommand or a CatheterCommand");
    }
    if (catheter) {
      const auto& c = command.cast<const CatheterCommand&>();
      const bool rests = c.insertion_speed_m_per_s == 0 && c.roll_speed_rad_per_s == 0 && c.bend_speed_rad_per_s == 0;
      return CommandGate::Command{c.sequence, c.time_us, rests};
    }
    const auto& c = command.cast<const CArmCommand&>();
    return CommandGate::Command{c.sequence, c.time_us, c.velocity.isZero(0)};
  };
  gate.def(py::init<>())
      .def(
          "refusal",
          [counts](const CommandGate& g, const py::object& command, const std::string& sender, std::int64_t now_us) {
            return g.refusal(counts(command), sender, now_us);
          },
          doc("CommandGate.refusal"), "command"_a, "sender"_a, "now_us"_a)
      .def(
          "obeyed",
          [counts](CommandGate& g, const py::object& command, const std::string& sender, std::int64_t now_us) {
            g.obeyed(counts(command), sender, now_us);
          },
          doc("CommandGate.obeyed"), "command"_a, "sender"_a, "now_us"_a)
      .def("begin", &CommandGate::begin, doc("CommandGate.begin"), "session"_a, "sender"_a, "now_us"_a)
      .def("sender", &CommandGate::sender, doc("CommandGate.sender"), "now_us"_a);
}

}  // namespace

std::vector<std::uint8_t> wireBytes(const std::string& channel, const py::object& message) {
  if (py::isinstance<py::bytes>(message)) {
    const std::string_view view = message.cast<std::string_view>();
    return {view.begin(), view.end()};
  }
  std::optional<std::vector<std::uint8_t>> bytes;
  forEachMessage([&](auto tag) {
    using Message = typename decltype(tag)::Message;
    if (bytes || !py::isinstance<Message>(message)) return;
    const auto type = channelTypes().find(channel);
    if (type != channelTypes().end() && type->second != nameOfMessage<Message>()) {
      throw InputError("", channel, nameOfMessage<Message>(), "must be a " + type->second);
    }
    bytes = encode(message.cast<const Message&>());
  });
  if (!bytes) throw py::type_error("a message must be one of angio.MESSAGES, or bytes");
  return std::move(*bytes);
}

void bindBus(py::module_& m) {
  py::class_<PythonBus, std::shared_ptr<PythonBus>>(m, "Bus", "Carries messages between programs by named channels.")
      .def(py::init(&opened), doc("openBus"), "url"_a, py::kw_only(), "key_file"_a = "")
      .def("publish", &publishOn,
           "Sends a message, or bytes, to every subscriber of the channel. Throws InputError, and sends nothing, when "
           "the message breaks a rule of its type or is of another type than the channel's; RuntimeError when it "
           "cannot be sent.",
           "channel"_a, "message"_a)
      .def("subscribe", &subscribe,
           "Calls `handler(message)` for each message on the channel that can be decoded and is of its type, and "
           "`on_refused(why)` for each other one, for as long as the bus lives.",
           "channel"_a, "handler"_a, "on_refused"_a = py::none())
      .def("handle", &handle,
           "Waits up to so long for a message, hands out all that wait, and returns how many there were. Other threads "
           "run meanwhile. What a handler throws comes out here. A log (file://) gives one message a call.",
           "timeout_s"_a = 0.0)
      .def_property_readonly(
          "sender", [](PythonBus& bus) { return bus.use([](Bus& b) { return b.sender(); }); }, doc("Bus.sender"))
      .def_property_readonly(
          "ended", [](PythonBus& bus) { return bus.use([](Bus& b) { return b.ended(); }); }, doc("Bus.ended"))
      .def_property_readonly(
          "refused", [](PythonBus& bus) { return bus.use([](Bus& b) { return b.refused(); }); }, doc("Bus.refused"))
      .def("close", &PythonBus::close, "Ends the bus with its subscriptions; using it then is an error.")
      .def("__enter__", [](const std::shared_ptr<PythonBus>& bus) { return bus; })
      .def("__exit__", [](PythonBus& bus, const py::args&) { bus.close(); });
  py::class_<Mailbox>(m, "LatestMessage", doc("LatestMessage"))
      .def(py::init(&latestOn), doc("LatestMessage.LatestMessage"), py::arg("bus").none(false), "channel"_a)
      .def("take", &Mailbox::take, doc("LatestMessage.take"))
      .def("peek", &Mailbox::peek, doc("LatestMessage.peek"))
      .def_property_readonly("received", &Mailbox::received, doc("LatestMessage.received"))
      .def_property_readonly("dropped", &Mailbox::dropped, doc("LatestMessage.dropped"))
      .def_property_readonly("refused", &Mailbox::refused, doc("LatestMessage.refused"))
      .def_property_readonly("last_error", &Mailbox::lastError, doc("LatestMessage.lastError"))
      .def_property_readonly("sender", &Mailbox::sender, doc("ChannelRecord.sender"));
  bindGate(m);
  py::dict channels;
  for (const auto& [channel, type] : channelTypes()) channels[py::str(channel)] = m.attr(type.c_str());
  m.attr("CHANNELS") = channels;
}

}  // namespace angio::python
