// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/igtl/igtl_server.hpp"

#include <gmock/gmock.h>

#include "angio/base/errors.hpp"
#include "angio/test/namespace.hpp"
#include "igtl_client.hpp"

namespace angio::test {
namespace {

// A server on a free port, and what it hears.
struct Served {
  explicit Served(std::size_t max_waiting_bytes = std::size_t{64} << 20) : server(settings(max_waiting_bytes)) {}
  static IgtlServerSettings settings(std::size_t max_waiting_bytes) {
    IgtlServerSettings s;
    s.port = 0;
    s.max_waiting_bytes = max_waiting_bytes;
    return s;
  }
  void handle() {
    server.handle(
        std::chrono::milliseconds(1), [this](const Received& r) { received.push_back(r); },
        [this](const std::string& p) { problems.push_back(p); });
  }
  bool until(const std::function<bool()>& done) {
    return handleUntil([this] { handle(); }, done);
  }

  IgtlServer server;
  std::vector<Received> received;
  std::vector<std::string> problems;
};

IgtlMessage numberedImage(int number) {
  cv::Mat image(96, 128, CV_16UC1, cv::Scalar(number));
  return imageMessage("XrayFrame", image, XrayCamera::centered(128, 96, 1e-3, 1.1), Pose::Identity());
}

TEST(IgtlServer, SendsAThousandFramesWithoutLossToTheLibrarysClient) {
  Served served;
  LibraryClient client(served.server.port());
  ASSERT_TRUE(served.until([&] { return served.server.clients() == 1; }));
  constexpr int kFrames = 1000;
  for (int i = 0; i < kFrames; ++i) {
    served.server.send(numberedImage(i));
    served.handle();
  }
  EXPECT_TRUE(served.until([&] { return client.count("XrayFrame") == kFrames; }));
  EXPECT_EQ(served.server.droppedImages(), 0);
  EXPECT_EQ(client.badCrcs(), 0);
  const auto first_pixels = client.firstPixels();
  ASSERT_EQ(first_pixels.size(), std::size_t{kFrames});
  for (int i = 0; i < kFrames; ++i) EXPECT_EQ(first_pixels[static_cast<std::size_t>(i)], i);
}

TEST(IgtlServer, ASlowReaderLosesImagesAndNobodyElseDoes) {
  constexpr std::size_t kMaxWaiting_bytes = 400'000;  // Of 16 images.
  Served served(kMaxWaiting_bytes);
  const RawClient slow(served.server.port(), 4096);
  LibraryClient quick(served.server.port());
  ASSERT_TRUE(served.until([&] { return served.server.clients() == 2; }));
  constexpr int kFrames = 400;  // 10 MB: more than the system keeps for a socket.
  for (int i = 0; i < kFrames; ++i) {
    served.server.send(numberedImage(i));
    ASSERT_TRUE(served.until([&] { return quick.count("XrayFrame") == i + 1; }));
    EXPECT_LE(served.server.waiting_bytes(), 2 * kMaxWaiting_bytes);
  }
  EXPECT_EQ(quick.firstPixels().size(), std::size_t{kFrames});
  EXPECT_GT(served.server.droppedImages(), 0);
  EXPECT_EQ(served.server.clients(), 2u);
  // What the slow one reads in the end is whole messages, the newest last.
  std::string read;
  ASSERT_TRUE(served.until([&] {
    read += slow.read();
    return served.server.waiting_bytes() == 0;
  }));
  for (int i = 0; i < 50; ++i) {
    served.handle();
    read += slow.read();
  }
  std::size_t place = 0;
  int messages = 0, last = -1;
  while (place < read.size()) {
    const auto header = readHeader(std::string_view(read).substr(place));
    ASSERT_TRUE(header);
    EXPECT_EQ(header->type, "IMAGE");
    place += IgtlHeader::kBytes + static_cast<std::size_t>(header->body_bytes);
    ASSERT_LE(place, read.size());
    const int pixel = static_cast<std::uint8_t>(read[place - 2]) + 256 * static_cast<std::uint8_t>(read[place - 1]);
    EXPECT_GT(pixel, last);
    last = pixel;
    ++messages;
  }
  EXPECT_EQ(last, kFrames - 1);
  EXPECT_EQ(messages + served.server.droppedImages(), kFrames);
}

TEST(IgtlServer, TellsLatecomersWhatStands) {
  Served served;
  served.server.send(transformMessage("CameraToTree", Pose::Identity()));
  served.server.send(statusMessage("Servo", IgtlStatus::kOk, "servo", "first"));
  served.server.send(statusMessage("Servo", IgtlStatus::kManual, "idle", "second"));
  served.server.send(numberedImage(1));
  const LibraryClient client(served.server.port());
  ASSERT_TRUE(served.until([&] { return client.count("CameraToTree") == 1 && client.count("Servo") == 1; }));
  auto* status = static_cast<::igtl::StatusMessage*>(client.last("Servo").GetPointer());
  EXPECT_EQ(status->GetCode(), 14);
  EXPECT_STREQ(status->GetStatusString(), "second");
  EXPECT_EQ(client.count("XrayFrame"), 0);
}

TEST(IgtlServer, AnswersInTheHeaderVersionOfItsClient) {
  Served served;
  const RawClient client(served.server.port());
  IgtlMessage transform = transformMessage("CameraToTree", Pose::Identity());
  transform.metadata["key"] = "value";
  ASSERT_TRUE(served.until([&] { return served.server.clients() == 1; }));
  std::string read;
  const auto next = [&](std::size_t size) {
    read.clear();
    served.server.send(transform);
    return served.until([&] { return (read += client.read()).size() >= size; });
  };
  ASSERT_TRUE(next(58 + 48));
  EXPECT_EQ(read, bytesOf(transform, HeaderVersion::k1, 0).replace(34, 8, read.substr(34, 8)));
  client.send(bytesOf(stringMessage("Target", "hello"), HeaderVersion::k2, 0));
  ASSERT_TRUE(served.until([&] { return !served.received.empty(); }));
  ASSERT_TRUE(next(58 + 12 + 48 + 10 + 8));
  EXPECT_EQ(read, bytesOf(transform, HeaderVersion::k2, 0).replace(34, 8, read.substr(34, 8)));
}

TEST(IgtlServer, HostileClientsChangeNothing) {
  Served served;
  LibraryClient good(served.server.port());
  ASSERT_TRUE(served.until([&] { return served.server.clients() == 1; }));
  const std::string message = bytesOf(stringMessage("Target", "lao_deg 1 cra_deg 2"), HeaderVersion::k1, 0);
  const auto connects = [&](const std::string& bytes, std::size_t problems, std::size_t clients) {
    const RawClient client(served.server.port());
    client.send(bytes);
    const std::size_t before = served.problems.size();
    return served.until(
        [&] { return served.problems.size() >= before + problems && served.server.clients() == clients; });
  };
  std::string bad_crc = message, huge = message, unknown = message;
  bad_crc[55] = static_cast<char>(bad_crc[55] ^ 1);
  huge[42] = '\x10';
  EXPECT_TRUE(connects(bad_crc, 1, 2));
  EXPECT_THAT(served.problems.back(), testing::HasSubstr("its CRC is wrong"));
  EXPECT_TRUE(served.until([&] { return served.server.clients() == 1; }));
  EXPECT_TRUE(connects(huge, 1, 1));
  EXPECT_THAT(served.problems.back(), testing::HasSubstr("is too long"));
  EXPECT_TRUE(connects(std::string(200, '\xEE'), 1, 1));
  EXPECT_THAT(served.problems.back(), testing::HasSubstr("version"));
  EXPECT_TRUE(connects(message.substr(0, 60), 0, 2));  // And then it is gone.
  EXPECT_TRUE(served.until([&] { return served.server.clients() == 1; }));
  EXPECT_TRUE(served.received.empty());

  // A message of a type that is not heard is passed over, however it comes in pieces, and the one behind it is heard.
  std::string other = bytesOf({"POINT", "Target", std::string(300'000, 'x'), {}}, HeaderVersion::k1, 0) + message;
  const RawClient in_pieces(served.server.port());
  for (std::size_t place = 0; place < other.size(); place += 10'007) {
    in_pieces.send(other.substr(place, 10'007));
    served.handle();
  }
  EXPECT_TRUE(served.until([&] { return served.received.size() == 1; }));
  // At most eight at once; the others are sent away.
  std::vector<std::unique_ptr<RawClient>> many;
  for (int i = 0; i < 20; ++i) {
    many.push_back(std::make_unique<RawClient>(served.server.port()));
    served.handle();
  }
  EXPECT_TRUE(served.until(
      [&] { return !served.problems.empty() && served.problems.back().find("too many") != std::string::npos; }));
  EXPECT_LE(served.server.clients(), 8u);
  // The good one never noticed.
  served.server.send(transformMessage("CameraToTree", Pose::Identity()));
  EXPECT_TRUE(served.until([&] { return good.count("CameraToTree") == 1; }));
  EXPECT_EQ(good.badCrcs(), 0);
}

TEST(IgtlServer, NamesAPlaceWhereItCannotListen) {
  Served served;
  IgtlServerSettings taken;
  taken.port = served.server.port();
  EXPECT_THAT([&] { IgtlServer{taken}; },
              testing::ThrowsMessage<InputError>(testing::HasSubstr("cannot be listened on")));
  taken.address = "here";
  EXPECT_THAT([&] { IgtlServer{taken}; },
              testing::ThrowsMessage<InputError>(testing::HasSubstr("must be an IPv4 address")));
}

}  // namespace
}  // namespace angio::test
