// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>

#include "angio/messaging/mailbox.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/program.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

// A log of three small frames with what a loop might have said of them, and rubbish between.
class BusPrograms : public testing::Test {
 protected:
  void SetUp() override {
    unsetenv("DISPLAY");
    const auto out = openBus("file://" + log_ + "?mode=w");
    for (const std::int64_t i : {1, 2, 4}) {
      const XrayFrame frame{i * 100'000, i, cv::Mat(64, 64, CV_16UC1, cv::Scalar(20000)),
                            XrayCamera::centered(64, 64, 1e-3, 1)};
      publish(*out, kXrayFrameChannel, frame);
      RegistrationMessage seen;
      seen.frame_sequence = i;
      seen.time_us = frame.time_us;
      seen.status_text = "converged";
      publish(*out, kRegistrationChannel, seen);
      out->publish("RUBBISH\033[2J", {1, 2, 3});
      out->publish(kCArmStateChannel, {1, 2, 3, 4, 5, 6, 7, 8, 9});
    }
  }

  static void expectOneLine(const test::Ended& ended, int code, const std::string& part) {
    EXPECT_EQ(ended.exit_code, code) << ended.out << ended.err;
    EXPECT_THAT(ended.err, HasSubstr(part));
    if (code == 1) {
      EXPECT_EQ(std::count(ended.err.begin(), ended.err.end(), '\n'), 1) << ended.err;
    }
  }

  test::TemporaryFolder folder_;
  std::string log_ = folder_.path("run.lcm"), url_ = "file://" + log_ + "?speed=0";
  std::string rubbish_ = folder_.write("rubbish.lcm", std::string(3000, 'x'));
};

TEST(HelpOfPrograms, IsPrintable) {
  for (const std::string line :
       {"angio-simulate", "angio-operator", "angio-servo", "angio-navigate", "angio-register", "angio-inspect",
        "angio-spy", "angio-view", "angio-replay", "angio-check-machine", "angio-best-view", "angio-evaluate",
        "angio-extract-centerline", "angio-evaluate simulation", "angio-simulate-loop", "angio-simulate-loop navigate",
        "angio-calibrate", "angio-calibrate simulate", "angio-calibrate geometry"}) {
    const auto space = line.find(' ');
    std::vector<std::string> words = {"--help"};
    if (space != std::string::npos) words.insert(words.begin(), line.substr(space + 1));
    const auto ended = test::run(line.substr(0, space), words);
    EXPECT_EQ(ended.exit_code, 0) << line;
    const auto odd = std::find_if(ended.out.begin(), ended.out.end(),
                                  [](unsigned char c) { return c != '\n' && (c < 0x20 || c >= 0x7f); });
    EXPECT_EQ(odd, ended.out.end()) << line << ": " << ended.out.substr(odd - ended.out.begin(), 40);
    EXPECT_EQ(ended.out.find("->"), std::string::npos) << line << " shows values behind names";
  }
}

TEST(HelpOfPrograms, SaysHowLargeTheReceiveBufferOfABusIs) {
  for (const char* program : {"angio-simulate", "angio-operator", "angio-servo", "angio-navigate", "angio-register",
                              "angio-inspect", "angio-spy", "angio-view", "angio-check-machine"}) {
    const auto ended = test::run(program, {"--help"});
    EXPECT_THAT(ended.out, HasSubstr("&recv_buf_size=BYTES")) << program;
    EXPECT_THAT(ended.out, HasSubstr("4194304")) << program;
  }
}

TEST_F(BusPrograms, SpyTellsWhatIsInALog) {
  const auto ended = test::run("angio-spy", {"--bus", url_, "--json", folder_.path("spy.json")});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_THAT(ended.out, HasSubstr("xray_frame_t"));
  EXPECT_THAT(ended.out, HasSubstr("64 x 64, 16 bit"));
  EXPECT_THAT(ended.out, HasSubstr("RUBBISH?[2J")) << "nothing that moves a terminal's cursor";
  EXPECT_THAT(test::contentOf(folder_.path("spy.json")), HasSubstr("\"missing\": 1"));
}

TEST_F(BusPrograms, ViewMakesAFilmOfALog) {
  const std::string film = folder_.path("film.mp4");
  const auto ended = test::run("angio-view", {"--bus", url_, "--out", film, "--width-px", "320", "--tree",
                                              test::exampleData("hepatic-tace/tree.csv")});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_THAT(ended.out, HasSubstr("3 of 3 frames drawn and written"));
  EXPECT_GT(std::filesystem::file_size(film), 100u);
}

TEST_F(BusPrograms, SayInOneLineWhatIsWrong) {
  const std::string nothing = "file:///no/such/run.lcm?speed=0";
  expectOneLine(test::run("angio-spy", {"--bus", nothing}), 1, "/no/such/run.lcm: does not exist");
  expectOneLine(test::run("angio-spy", {"--bus", "memq://"}), 1, "private");
  expectOneLine(test::run("angio-spy", {"--bus", "file://" + rubbish_ + "?speed=0"}), 1, "holds no message");
  expectOneLine(test::run("angio-spy", {"--bus", "carrier-pigeon"}), 1, "url = carrier-pigeon");
  const std::string tree = test::exampleData("hepatic-tace/tree.csv");
  expectOneLine(test::run("angio-view", {"--bus", url_, "--tree", tree}), 1, "there is no display");
  expectOneLine(test::run("angio-view", {"--bus", url_, "--tree", tree, "--out", "film.avi"}), 1, "film.avi");
  for (const std::string& log : {url_, "file://" + folder_.path("new.lcm") + "?mode=w"}) {
    expectOneLine(test::run("angio-simulate", {"--bus", log, "--duration-s", "1"}), 1, "must be live");
  }
  const std::vector<std::string> loop = {"--tree", tree, "--calibration", test::exampleData("hepatic-tace/carm.yaml")};
  const auto replayed = [&](const std::string& log) {
    auto words = loop;
    words.push_back(log);
    return test::run("angio-replay", words);
  };
  expectOneLine(replayed("/no/such/run.lcm"), 1, "/no/such/run.lcm: does not exist");
  const auto no_joints = replayed(log_);
  EXPECT_EQ(no_joints.exit_code, 1);
  EXPECT_THAT(no_joints.err, HasSubstr("run.lcm: holds no X-ray frame that can be answered"));
  expectOneLine(test::run("angio-replay", {}), 2, "log");
  expectOneLine(test::run("angio-replay", {log_, "--machine", "catheter"}), 1, "--to-branch");
  expectOneLine(test::run("angio-replay", {log_, "--to-branch", "13"}), 1, "needs --machine catheter");
  expectOneLine(test::run("angio-replay", {log_, "--machine", "catheter", "--to-branch", "13"}), 1, "CATHETER_INPUT");
  auto live = loop;
  live.insert(live.end(), {"--bus", "carrier-pigeon"});
  expectOneLine(test::run("angio-register", live), 1, "url = carrier-pigeon");
  live.insert(live.end(), {"--image", "frame.png"});
  expectOneLine(test::run("angio-register", live), 2, "--bus");
}

}  // namespace
}  // namespace angio::test
