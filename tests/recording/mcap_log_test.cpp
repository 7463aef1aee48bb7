// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/recording/mcap_log.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/mcap/reader.hpp"
#include "angio/messaging/logged_frames.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/recording/log_conversion.hpp"
#include "angio/test/file_size_limit.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "recorded_messages.hpp"

namespace angio::test {
namespace {

using Json = nlohmann::json;

struct ReadTopic {
  std::string encoding;
  std::vector<Json> messages;
  std::vector<std::uint64_t> times_ns;
};

std::map<std::string, ReadTopic> topicsOf(const std::string& path) {
  mcap::Reader reader(path);
  std::map<std::string, ReadTopic> topics;
  for (auto m = reader.next(); m; m = reader.next()) {
    ReadTopic& topic = topics[m->channel->topic];
    topic.encoding = m->channel->message_encoding;
    topic.times_ns.push_back(m->message.log_time_ns);
    if (topic.encoding == "json") topic.messages.push_back(Json::parse(m->message.data));
  }
  return topics;
}

std::string convertedRun(const TemporaryFolder& folder) {
  writeRecordedLog(folder.path("run.lcm"));
  convertToMcap(folder.path("run.lcm"), folder.path("run.mcap"), recordedScene(), {{0, "tree.csv", "text/csv", "x"}});
  return folder.path("run.mcap");
}

double secondsOf(const Json& time) { return time["sec"].get<double>() + 1e-9 * time["nsec"].get<double>(); }

TEST(McapLog, GoesThereAndBackBitForBit) {
  const TemporaryFolder folder;
  const std::string mcap = convertedRun(folder);
  const Converted back = convertToLcm(mcap, folder.path("back.lcm"));
  EXPECT_EQ(back.messages, 6 * kRecordedFrames);
  EXPECT_TRUE(back.whole);
  EXPECT_EQ(contentOf(folder.path("back.lcm")), contentOf(folder.path("run.lcm")));
  // The reader of logs takes both, and finds its frames again.
  LogReader of_lcm(folder.path("run.lcm")), of_mcap(mcap);
  std::vector<std::int64_t> places;
  for (auto event = of_lcm.next(); event; event = of_lcm.next()) {
    const auto same = of_mcap.next();
    ASSERT_TRUE(same);
    EXPECT_EQ(same->channel, event->channel);
    EXPECT_EQ(same->bytes, event->bytes);
    EXPECT_EQ(same->time_us, event->time_us);
    if (same->channel == kXrayFrameChannel) places.push_back(same->position_bytes);
  }
  EXPECT_FALSE(of_mcap.next());
  EXPECT_EQ(LoggedFrames::readAt(of_mcap, places.at(7)).sequence, 8);
  EXPECT_EQ(LoggedFrames::readAt(of_mcap, places.at(2)).sequence, 3);
}

TEST(McapLog, SaysEachMessageAsJsonAndToFoxglove) {
  const TemporaryFolder folder;
  auto topics = topicsOf(convertedRun(folder));
  EXPECT_EQ(topics.at("SOMEBODY_ELSES").encoding, "lcm");
  EXPECT_EQ(topics.count("/angio/SOMEBODY_ELSES"), 0u);
  const std::size_t frames = kRecordedFrames;
  for (const char* topic : {"/angio/XRAY_FRAME", "/angio/CARM_STATE", "/angio/REGISTRATION", "/camera/image",
                            "/camera/calibration", "/camera/annotations", "/tree/projected", "/catheter/tip"}) {
    EXPECT_EQ(topics[topic].messages.size(), frames) << topic;
  }
  EXPECT_EQ(topics["/tree"].messages.size(), 1u);
  EXPECT_EQ(topics["/log"].messages.size(), 2u);  // Held, and then not any more.
  EXPECT_EQ(topics["/angio/CARM_STATE"].messages[4]["joint_position"][0], 0.5);
  EXPECT_EQ(topics["/angio/XRAY_FRAME"].messages[4]["sequence"], 5);
  EXPECT_EQ(topics["/angio/XRAY_FRAME"].messages[4].count("pixels"), 0u);
  // What is said of a frame lies on it.
  const double image_s = secondsOf(topics["/camera/image"].messages[4]["timestamp"]);
  EXPECT_DOUBLE_EQ(image_s, 1e-9 * static_cast<double>(topics[kXrayFrameChannel].times_ns[4]));
  EXPECT_DOUBLE_EQ(secondsOf(topics["/registration/pose"].messages[4]["timestamp"]), image_s);
  EXPECT_DOUBLE_EQ(secondsOf(topics["/camera/annotations"].messages[4]["points"][0]["timestamp"]), image_s);
}

// A chain of transforms puts the tree where its own projection is: patient to camera by the joints, and the calibrated
// tree in the patient; the registration of the test's run is the same place.
TEST(McapLog, TransformsAgreeWithTheProjection) {
  const TemporaryFolder folder;
  auto topics = topicsOf(convertedRun(folder));
  const auto pose = [](const Json& t) {
    const auto& p = t["translation"];
    const auto& q = t["rotation"];
    Pose T = Pose::Identity();
    T.linear() = Eigen::Quaterniond(q["w"], q["x"], q["y"], q["z"]).toRotationMatrix();
    T.translation() << p["x"].get<double>(), p["y"].get<double>(), p["z"].get<double>();
    return T;
  };
  std::map<std::string, Pose> T_parent_child;
  for (const Json& message : topics["/tf"].messages) {
    for (const Json& t : message["transforms"]) {
      T_parent_child[t["parent_frame_id"].get<std::string>() + " " + t["child_frame_id"].get<std::string>()] = pose(t);
    }
  }
  const Pose T_camera_calibrated =
      T_parent_child.at("patient camera").inverse() * T_parent_child.at("patient calibrated");
  // Numbers in the file have 8 decimals, at a lever of 1 m.
  EXPECT_LT((T_camera_calibrated.matrix() - T_parent_child.at("camera model").matrix()).cwiseAbs().maxCoeff(), 1e-7);
  const RecordedScene scene = recordedScene();
  EXPECT_NEAR(T_parent_child.at("patient iso").translation().x(), -1e-3 * kRecordedFrames, 1e-9);
  const auto pixel = scene.carm.camera().project(T_camera_calibrated * Eigen::Vector3d(scene.tree.points().col(0)));
  const Json& drawn = topics["/camera/annotations"].messages.back()["points"][0]["points"][0];
  EXPECT_NEAR(drawn["x"].get<double>(), pixel->x(), 0.051);  // Drawn to a tenth of a pixel.
  EXPECT_NEAR(drawn["y"].get<double>(), pixel->y(), 0.051);
  // On the detector, in metres.
  const Json& point = topics["/tree/projected"].messages.back()["entities"][0]["lines"][0]["points"][0];
  EXPECT_NEAR(point["z"].get<double>(), scene.carm.source_detector_distance_m, 1e-4);
  const auto again = scene.carm.camera().project(
      Eigen::Vector3d(point["x"].get<double>(), point["y"].get<double>(), point["z"].get<double>()));
  EXPECT_LT((*again - *pixel).norm(), 0.1);  // Drawn to a tenth of a millimetre, of pixels of 2 mm.
}

// Every object has the keys of its schema, all the way down, and those of the type that it says.
void expectMatches(const Json& value, const Json& schema, const std::string& where) {
  const std::string type = schema["type"];
  EXPECT_TRUE((type == "object" && value.is_object()) || (type == "array" && value.is_array()) ||
              (type == "string" && value.is_string()) || (type == "integer" && value.is_number_integer()) ||
              (type == "number" && value.is_number()) || (type == "boolean" && value.is_boolean()))
      << where << " is no " << type;
  if (type == "object" && value.is_object()) {
    EXPECT_EQ(value.size(), schema["properties"].size()) << where;
    for (const auto& [key, inner] : schema["properties"].items()) {
      ASSERT_TRUE(value.count(key)) << where << "." << key;
      expectMatches(value[key], inner, where + "." + key);
    }
  } else if (type == "array" && value.is_array()) {
    if (schema.count("minItems")) {
      EXPECT_EQ(value.size(), schema["minItems"].get<std::size_t>()) << where;
    }
    for (const Json& item : value) expectMatches(item, schema["items"], where + "[]");
  }
}

// Schemas are read from the file as any reader would: from the records before the messages.
std::map<std::uint16_t, Json> schemasIn(const std::string& content) {
  std::map<std::uint16_t, Json> schemas;
  const auto number = [&](std::size_t place, int bytes) {
    std::uint64_t value = 0;
    for (int i = bytes; i-- > 0;)
      value = value << 8 | static_cast<std::uint8_t>(content[place + static_cast<std::size_t>(i)]);
    return value;
  };
  std::size_t place = number(content.size() - 8 - 20, 8);  // The summary begins where the footer says.
  while (content[place] == 3) {
    const std::size_t end = place + 9 + number(place + 1, 8);
    std::size_t field = place + 11;
    for (int skipped = 0; skipped < 2; ++skipped) field += 4 + number(field, 4);
    schemas[static_cast<std::uint16_t>(number(place + 9, 2))] = Json::parse(content.substr(field + 4, end - field - 4));
    place = end;
  }
  return schemas;
}

TEST(McapLog, MessagesAreAsTheirSchemasSay) {
  const TemporaryFolder folder;
  const std::string path = convertedRun(folder);
  const auto schemas = schemasIn(contentOf(path));
  EXPECT_EQ(schemas.size(), std::variant_size_v<AnyMessage> + 7);
  mcap::Reader reader(path);
  int checked = 0;
  for (auto m = reader.next(); m; m = reader.next()) {
    if (m->channel->message_encoding != "json") continue;
    expectMatches(Json::parse(m->message.data), schemas.at(m->channel->schema_id), m->channel->topic);
    ++checked;
  }
  EXPECT_GT(checked, 10 * kRecordedFrames);
}

TEST(McapLog, RecordsABusAndSaysWhenTheDiskIsFull) {
  const TemporaryFolder folder;
  const std::string path = folder.path("run.mcap");
  const auto bus = openBus("memq://");
  mcap::WriterSettings settings;
  settings.chunk_bytes = 30'000;
  RecordingBus recorded(*bus,
                        std::make_unique<McapLog>(path, recordedScene(), std::vector<mcap::Attachment>{}, settings));
  const auto messages = recordedMessages();
  std::optional<std::string> failure;
  {
    const FileSizeLimit full(200'000);
    for (const auto& [channel, bytes] : messages) recorded.publish(channel, bytes);
    failure = recorded.finish();
  }
  ASSERT_TRUE(failure);
  EXPECT_THAT(*failure, testing::StartsWith(path + ": recording ended: File too large; it holds the first "));
  LogReader log(path);
  std::size_t read = 0;
  for (auto event = log.next(); event; event = log.next(), ++read) {
    EXPECT_EQ(event->channel, messages[read].first);
    EXPECT_EQ(event->bytes, messages[read].second);
  }
  EXPECT_FALSE(log.whole());
  EXPECT_EQ(log.skipped_bytes(), 0);
  EXPECT_GT(read, 0u);
  EXPECT_LT(read, messages.size());
  EXPECT_THAT(*failure, testing::HasSubstr("the first " + std::to_string(read) + " messages"));
}

TEST(McapLog, ADiskThatHoldsNotEvenTheAttachmentsIsRefused) {
  const TemporaryFolder folder;
  const FileSizeLimit full(10'000);
  EXPECT_THROW(McapLog(folder.path("run.mcap"), {}, {{0, "tree.csv", "text/csv", std::string(20'000, 'x')}}),
               InputError);
  EXPECT_EQ(folder.files(), 0u);
}

TEST(McapLog, AConversionReplacesFilesAlone) {
  const TemporaryFolder folder;
  writeRecordedLog(folder.path("run.lcm"));
  const auto convert = [&](const std::string& name) {
    convertToMcap(folder.path("run.lcm"), folder.path(name), {}, {});
  };
  std::filesystem::create_directory(folder.path("folder"));
  ASSERT_EQ(::mkfifo(folder.path("pipe").c_str(), 0600), 0);
  for (const char* name : {"folder", "pipe"}) {
    EXPECT_THAT(([&] { convert(name); }),
                testing::ThrowsMessage<InputError>(testing::HasSubstr("must be a regular file")));
  }
  EXPECT_TRUE(std::filesystem::is_fifo(folder.path("pipe")));
  std::filesystem::create_symlink(folder.write("run.mcap", "old"), folder.path("link"));
  convert("link");
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path("link")));
  EXPECT_TRUE(mcap::isMcap(folder.path("run.mcap")));
}

TEST(McapLog, AConversionThatFailsLeavesNoFile) {
  const TemporaryFolder folder;
  writeRecordedLog(folder.path("run.lcm"));
  {
    const FileSizeLimit full(100'000);
    EXPECT_THROW(convertToMcap(folder.path("run.lcm"), folder.path("run.mcap"), recordedScene(), {}), InputError);
  }
  {
    LogWriter log(folder.path("early.lcm"));
    LogEvent event;
    event.channel = "C";
    event.time_us = -1;
    log.write(event);
  }
  EXPECT_THAT(([&] { convertToMcap(folder.path("early.lcm"), folder.path("run.mcap"), {}, {}); }),
              testing::ThrowsMessage<InputError>(testing::HasSubstr("message 0: time_us = -1: must be from 1970")));
  EXPECT_EQ(folder.files(), 2u);
}

}  // namespace
}  // namespace angio::test
