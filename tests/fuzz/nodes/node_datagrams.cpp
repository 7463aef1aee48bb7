// SPDX-License-Identifier: GPL-2.0-or-later
#include "node_datagrams.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <limits>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/navigation/catheter_node.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/test/datagram_socket.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

constexpr std::int64_t kPeriod_us = 66'667;
constexpr std::int64_t kInputsOfALab = 200;         // Then its records are read, and it begins anew.
constexpr std::int64_t kMaxGrowth_bytes = 1 << 30;  // Of the process, beyond what it was with its first input.
constexpr int kSide_px = 32;
// Numbers and times up to here leave room for newer ones.
constexpr std::int64_t kNewest = std::numeric_limits<std::int64_t>::max() / 2;

void promised(bool holds, const char* what) {
  if (!holds) throw std::logic_error(std::string("promised, and not so: ") + what);
}

std::int64_t memory_bytes() {
  std::int64_t pages = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

bool standsStill(const CArmCommand& command) { return command.velocity.isZero(0); }
bool standsStill(const CatheterCommand& command) {
  return command.insertion_speed_m_per_s == 0 && command.roll_speed_rad_per_s == 0 && command.bend_speed_rad_per_s == 0;
}

// Newest number and time of a channel's messages, whoever sent them.
template <typename Message>
class Newest {
 public:
  Newest(Bus& bus, const char* channel) : heard_(bus, channel) {}

  void listen() {
    for (const Message& message : heard_.take()) {
      sequence_ = std::max(sequence_, message.sequence);
      time_us_ = std::max(time_us_, message.time_us);
    }
  }
  std::int64_t sequence() const { return sequence_; }
  std::int64_t time_us() const { return time_us_; }
  bool hasNewer() const { return sequence_ < kNewest && time_us_ < kNewest; }

 private:
  MessageQueue<Message> heard_;
  std::int64_t sequence_ = 0, time_us_ = 0;
};

// One machine's node with its bus and its record.
template <typename Loop>
class RecordedNode {
 public:
  template <typename... Setup>
  RecordedNode(const std::string& url, std::string log, const Setup&... setup)
      : log_(std::move(log)), bus_(openBus(url)), recorded_(*bus_, log_), node_(recorded_, setup...) {}

  // Returns the number of the frame that was answered.
  std::optional<std::int64_t> answer(std::int64_t now_us) {
    bus_->handle(std::chrono::milliseconds(1));
    const auto report = node_.answer(now_us);
    promised(!recorded_.failure(), "a record can be written whatever comes");
    const ServoState state = node_.states().state();
    promised(!report || isFinite(report->command), "a command is a number");
    promised(!report || state == ServoState::kServo || standsStill(report->command), "only SERVO moves a machine");
    return report ? std::optional(report->command.frame_sequence) : std::nullopt;
  }

  // The record, read again; how many of the frames that were said are in it.
  std::int64_t finish() {
    promised(!recorded_.finish(), "a record can be finished");
    LogReader log(log_);
    std::int64_t frames = 0;
    for (auto event = log.next(); event; event = log.next()) frames += event->channel == kXrayFrameChannel;
    promised(log.skipped_bytes() == 0, "a record holds messages only");
    return frames;
  }

 private:
  const std::string log_;
  std::unique_ptr<Bus> bus_;
  RecordingBus recorded_;
  SupervisedNode<Loop> node_;
};

}  // namespace

class NodesOnSocket::Lab {
 public:
  explicit Lab(int port)
      : url_(DatagramSocket::urlOf(port)),
        sockets_{DatagramSocket(port), DatagramSocket(port)},
        servo_(url_, folder_.path("servo.lcm"), ServoLoopSettings(), tree_),
        catheter_(url_, folder_.path("catheter.lcm"), CArmSetup(), tree_, TreeLocation{0, 10e-3},
                  TreeLocation{TreeTopology(tree_).children(0).front(), 5e-3}, CatheterControllerSettings()) {}

  void send(std::size_t from, const std::uint8_t* bytes, std::size_t size) const {
    sockets_[from % 2].send(bytes, size);
  }

  // Whether both nodes answered a frame that is newer than all before it. Nothing where there can be none.
  std::optional<bool> answersAFrame() {
    using Clock = std::chrono::steady_clock;
    const auto end = Clock::now() + std::chrono::seconds(5);
    settle();
    if (!frames_.hasNewer() || !arms_.hasNewer() || !drives_.hasNewer()) return std::nullopt;
    const std::int64_t sequence = frames_.sequence() + 1, time_us = 1 + std::max(frames_.time_us(), arms_.time_us());
    cv::Mat image(kSide_px, kSide_px, CV_8UC1);
    cv::randu(image, 0, 255);
    publish(*machine_, kCArmStateChannel,
            CArmState{time_us, arms_.sequence() + 1, CArmJoints::Zero(), CArmJoints::Zero()});
    CatheterState drive;
    drive.time_us = 1 + drives_.time_us();
    drive.sequence = drives_.sequence() + 1;
    publish(*machine_, kCatheterStateChannel, drive);
    publish(*machine_, kXrayFrameChannel,
            XrayFrame{time_us, sequence, image, XrayCamera::centered(kSide_px, kSide_px, 5e-3, 1.2)});
    bool servo = false, catheter = false;
    while (!(servo && catheter) && Clock::now() < end) {
      servo = servo_.answer(now_us_ += kPeriod_us) == sequence || servo;
      catheter = catheter_.answer(now_us_) == sequence || catheter;
    }
    frames_said_ += servo && catheter;
    return servo && catheter;
  }

  void finish() {
    promised(servo_.finish() >= frames_said_ && catheter_.finish() >= frames_said_, "frames that come are recorded");
  }

 private:
  // Hears what was sent: until a message of this process' own, sent behind it, has come.
  void settle() {
    machine_->publish("END_OF_INPUT", {});
    for (int tries = 0; tries < 1000 && !std::exchange(settled_, false); ++tries) {
      machine_->handle(std::chrono::milliseconds(5));
      frames_.listen();
      arms_.listen();
      drives_.listen();
    }
  }

  const TemporaryFolder folder_;
  const std::string url_;
  const DatagramSocket sockets_[2];
  const VesselTree tree_ = branchingTree(6);
  std::unique_ptr<Bus> machine_ = [this] {
    auto bus = openBus(url_);
    bus->subscribe("END_OF_INPUT", [this](const std::uint8_t*, std::size_t) { settled_ = true; });
    return bus;
  }();
  Newest<XrayFrame> frames_{*machine_, kXrayFrameChannel};
  Newest<CArmState> arms_{*machine_, kCArmStateChannel};
  Newest<CatheterState> drives_{*machine_, kCatheterStateChannel};
  bool settled_ = false;
  RecordedNode<ServoLoop> servo_;
  RecordedNode<CatheterController> catheter_;
  std::int64_t now_us_ = 0, frames_said_ = 0;
};

NodesOnSocket::NodesOnSocket() : lab_(std::make_unique<Lab>(DatagramSocket::ownPort())) {}
NodesOnSocket::~NodesOnSocket() = default;

void NodesOnSocket::receive(const std::uint8_t* bytes, std::size_t size) {
  for (std::size_t at = 0; at + 3 <= size;) {
    const std::size_t length = std::min<std::size_t>(bytes[at + 1] << 8 | bytes[at + 2], size - at - 3);
    lab_->send(bytes[at], bytes + at + 3, length);
    at += 3 + length;
  }
  const auto answers = lab_->answersAFrame();
  promised(answers.value_or(true), "a node answers a good frame whatever came before it");
  answered_ += answers.value_or(false);
  if (!answers || ++inputs_ % kInputsOfALab == 0) {
    lab_->finish();
    lab_.reset();
    lab_ = std::make_unique<Lab>(DatagramSocket::ownPort());
  }
  if (first_bytes_ == 0) first_bytes_ = memory_bytes();
  promised(memory_bytes() - first_bytes_ < kMaxGrowth_bytes, "memory is bounded");
}

}  // namespace angio::test
