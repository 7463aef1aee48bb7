// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>

#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "angio/base/errors.hpp"
#include "angio/results/film_writer.hpp"
#include "angio/results/live_overlay.hpp"
#include "angio/results/overlay.hpp"
#include "angio/test/file_size_limit.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

const XrayCamera kCamera = XrayCamera::centered(256, 200, 1e-3, 1);

XrayFrame frameNumber(std::int64_t sequence) {
  return {1000 * sequence, sequence, cv::Mat(200, 256, CV_16UC1, cv::Scalar(30000)), kCamera};
}

RegistrationMessage registrationOf(std::int64_t sequence, const Pose& T_camera_model) {
  RegistrationMessage m;
  m.frame_sequence = sequence;
  m.time_us = 1000 * sequence;
  m.T_camera_model = T_camera_model;
  m.status_text = "converged";
  return m;
}

ServoStatus statusOf(std::int64_t sequence, ServoState state) {
  ServoStatus m;
  m.frame_sequence = sequence;
  m.time_us = 1000 * sequence;
  m.state = state;
  return m;
}

// Smoothed lines are of a colour only almost.
int pixelsOf(const cv::Mat& picture, const cv::Scalar& color, const cv::Rect& where) {
  const cv::Scalar tolerance(40, 40, 40);
  cv::Mat found;
  cv::inRange(picture(where), color - tolerance, color + tolerance, found);
  return cv::countNonZero(found);
}

TEST(LiveOverlay, ShowsTheTreeInTheColorOfTheLoopsState) {
  const VesselTree tree = test::branchingTree(3);
  Pose T = Pose::Identity();
  T.translation() = Eigen::Vector3d(0, 0, 0.8) - tree.centroid();
  LiveOverlay overlay(tree, 512);
  LiveScene scene{frameNumber(1), registrationOf(1, T), statusOf(1, ServoState::kServo), {}, {}, {}, ""};
  scene.registration->model_id = modelId(tree);
  const cv::Rect xray(0, 0, 512, 400);
  const cv::Mat moving = overlay.draw(scene);
  EXPECT_EQ(moving.cols, 512);
  EXPECT_EQ(moving.rows % 2, 0);
  EXPECT_GT(pixelsOf(moving, stateColor(ServoState::kServo), xray), 50);

  scene.status->state = ServoState::kHold;
  const cv::Mat held = overlay.draw(scene);
  EXPECT_EQ(held.size(), moving.size());
  EXPECT_GT(pixelsOf(held, stateColor(ServoState::kHold), xray), 50);
  EXPECT_EQ(pixelsOf(held, stateColor(ServoState::kServo), xray), 0);
  const cv::Rect bar(0, held.rows - 12, 512, 6);
  EXPECT_GT(pixelsOf(held, stateColor(ServoState::kServo), bar), 0) << "the bar remembers";

  scene.registration->model_id = modelId(test::branchingTree(4));
  EXPECT_EQ(pixelsOf(overlay.draw(scene), stateColor(ServoState::kHold), xray), 0) << "a pose of another tree";
  scene.registration->model_id = modelId(tree);
  EXPECT_GT(pixelsOf(overlay.draw(scene), stateColor(ServoState::kHold), xray), 50);
  scene.registration->status_text = "too_few_points";
  EXPECT_EQ(pixelsOf(overlay.draw(scene), stateColor(ServoState::kHold), xray), 0) << "a pose nobody believes";
}

TEST(LiveOverlay, TextsStandBelowTheXrayAndFitWhateverTheirLength) {
  const VesselTree tree = test::branchingTree(3);
  for (const int width_px : {320, 512, 1024}) {
    LiveOverlay overlay(tree, width_px);
    LiveScene scene{frameNumber(1), {}, {}, {}, {}, {}, ""};
    const cv::Mat plain = overlay.draw(scene);
    scene.title = "a title of a film that is about as long as titles of films are, and a little longer than that";
    scene.status = statusOf(1, ServoState::kHold);
    for (int k = 0; k < 40; ++k) scene.status->reason += " because of this";
    scene.registration = registrationOf(1, Pose::Identity());
    scene.registration->status_text = "ambiguous";
    scene.registration->mean_residual_px = 43.75;
    scene.state.emplace();
    const cv::Mat full = overlay.draw(scene);
    ASSERT_EQ(full.size(), plain.size()) << "a film has pictures of one size";
    // Nothing but the letters, which are in the edges' middles, is drawn on the X-ray.
    const int xray_px = width_px * 200 / 256, middle_px = xray_px / 2;
    for (const cv::Rect& corner :
         {cv::Rect(0, 0, width_px / 3, middle_px - 40), cv::Rect(width_px * 2 / 3, 0, width_px / 3, middle_px - 40),
          cv::Rect(0, middle_px + 40, width_px / 3, xray_px - middle_px - 40)}) {
      EXPECT_EQ(cv::norm(full(corner), plain(corner), cv::NORM_INF), 0) << corner;
    }
    EXPECT_GT(pixelsOf(full, stateColor(ServoState::kHold), {0, xray_px, width_px, full.rows - xray_px - 30}), 20);
    const cv::Rect right(width_px - 3, xray_px, 3, full.rows - xray_px - 40);
    EXPECT_EQ(cv::norm(full(right), plain(right), cv::NORM_INF), 0) << "texts end before the edge";
  }
}

TEST(PatientLetters, AreThoseOfDicomsPatientOrientation) {
  EXPECT_EQ(patientLetters(Eigen::Vector3d::UnitX()), "L");
  EXPECT_EQ(patientLetters(-Eigen::Vector3d::UnitX()), "R");
  EXPECT_EQ(patientLetters(-Eigen::Vector3d::UnitY()), "A");
  EXPECT_EQ(patientLetters(5 * Eigen::Vector3d::UnitY()), "P");
  EXPECT_EQ(patientLetters(Eigen::Vector3d::UnitZ()), "H");
  EXPECT_EQ(patientLetters(-Eigen::Vector3d::UnitZ()), "F");
  EXPECT_EQ(patientLetters({std::cos(degToRad(19)), -std::sin(degToRad(19)), 0}), "L");
  EXPECT_EQ(patientLetters({std::cos(degToRad(21)), -std::sin(degToRad(21)), 0}), "LA");
  EXPECT_EQ(patientLetters({-0.5, 0, -0.8}), "FR");
}

// The edges of an image as xray_frame_t has it.
TEST(PatientLetters, StandAtTheEdgesOfAnImageSeenFromTheSource) {
  const auto edges = [](double primary_deg, double secondary_deg) {
    CArmJoints joints = CArmJoints::Zero();
    joints[0] = degToRad(primary_deg);
    joints[1] = degToRad(secondary_deg);
    const Eigen::Matrix3d R = CArmGeometry().T_camera_patient(joints).linear();
    const Eigen::Vector3d right = R.row(0), down = R.row(1);
    return patientLetters(-right) + " " + patientLetters(right) + " " + patientLetters(-down) + " " +
           patientLetters(down);
  };
  EXPECT_EQ(edges(0, 0), "L R H F");
  EXPECT_EQ(edges(90, 0), "P A H F");
  EXPECT_EQ(edges(-90, 0), "A P H F");
  EXPECT_EQ(edges(30, 0), "LP RA H F");
  EXPECT_EQ(edges(0, 30), "L R HP FA") << "from below: up in the image is headwards and backwards";
}

TEST(PatientLetters, AreDrawnWhereJointsHaveBeenHeard) {
  const VesselTree tree = test::branchingTree(3);
  LiveOverlay overlay(tree, 512);
  LiveScene scene{frameNumber(1), {}, {}, {}, {}, {}, ""};
  scene.frame.image.setTo(cv::Scalar(20000));
  const cv::Scalar yellow(0, 225, 255);
  const cv::Rect edges[] = {{0, 180, 40, 40}, {472, 180, 40, 40}, {236, 0, 40, 40}, {236, 360, 40, 40}};
  const cv::Mat without = overlay.draw(scene);
  for (const cv::Rect& edge : edges) EXPECT_EQ(pixelsOf(without, yellow, edge), 0);
  scene.state.emplace();
  const cv::Mat with = overlay.draw(scene);
  for (const cv::Rect& edge : edges) EXPECT_GT(pixelsOf(with, yellow, edge), 20) << edge;
  EXPECT_EQ(pixelsOf(with, yellow, {60, 60, 380, 280}), 0) << "nothing in the middle";
}

TEST(LiveFeed, JoinsWhatBelongsToOneFrame) {
  LiveFeed feed;
  std::int64_t now_us = 0;
  const auto hear = [&](AnyMessage message) {
    return feed.hear(kServoStatusChannel, std::move(message), now_us += 20'000);
  };
  EXPECT_TRUE(hear(frameNumber(1))) << "nobody answers: frames as they are";
  EXPECT_FALSE(hear(statusOf(1, ServoState::kHold))) << "shown already";
  // The loop is busy: 3 comes while it works on 2, and is never answered.
  EXPECT_FALSE(hear(frameNumber(2)));
  EXPECT_FALSE(hear(frameNumber(3)));
  EXPECT_FALSE(hear(registrationOf(2, Pose::Identity())));
  const auto scene = hear(statusOf(2, ServoState::kServo));
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->frame.sequence, 2);
  EXPECT_TRUE(scene->registration && scene->status);
  // The loop falls silent: after a second, frames are shown with what there is.
  now_us += 2'000'000;
  EXPECT_TRUE(hear(frameNumber(4)));
  EXPECT_FALSE(hear(statusOf(9, ServoState::kServo))) << "of a frame that was never seen";
}

// With both loops on one bus, the picture's colour is that of the machine that the picture comes from.
TEST(LiveFeed, ShowsTheCathetersStateOnlyWhereNoCArmsLoopReports) {
  LiveFeed feed;
  std::int64_t now_us = 0;
  const auto hear = [&](const char* channel, AnyMessage message) {
    return feed.hear(channel, std::move(message), now_us += 20'000);
  };
  EXPECT_FALSE(hear(kCatheterStatusChannel, statusOf(0, ServoState::kServo)));
  EXPECT_FALSE(hear(kXrayFrameChannel, frameNumber(1)));
  EXPECT_TRUE(hear(kCatheterStatusChannel, statusOf(1, ServoState::kServo)));
  EXPECT_FALSE(hear(kServoStatusChannel, statusOf(1, ServoState::kHold)));
  EXPECT_FALSE(hear(kXrayFrameChannel, frameNumber(2)));
  EXPECT_FALSE(hear(kCatheterStatusChannel, statusOf(2, ServoState::kServo)));
  const auto scene = hear(kServoStatusChannel, statusOf(2, ServoState::kHold));
  ASSERT_TRUE(scene && scene->status);
  EXPECT_EQ(scene->status->state, ServoState::kHold);
  // The C-arm's loop falls silent, the catheter's goes on.
  now_us += 2'000'000;
  EXPECT_FALSE(hear(kCatheterStatusChannel, statusOf(2, ServoState::kServo)));
  EXPECT_FALSE(hear(kXrayFrameChannel, frameNumber(3)));
  EXPECT_TRUE(hear(kCatheterStatusChannel, statusOf(3, ServoState::kServo)));
}

TEST(FilmWriter, AFilmHasItsPicturesAndAppearsWhole) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("film.mp4");
  {
    FilmWriter film(path, 15);
    for (int i = 0; i < 12; ++i) film.write(cv::Mat(120, 160, CV_8UC3, cv::Scalar(20 * i, 100, 50)));
    EXPECT_FALSE(std::filesystem::exists(path));
    EXPECT_THROW(film.write(cv::Mat(100, 160, CV_8UC3)), InputError);
    film.finish();
  }
  cv::VideoCapture reader(path);
  cv::Mat picture;
  int pictures = 0;
  while (reader.read(picture)) ++pictures;
  EXPECT_EQ(pictures, 12);
  { FilmWriter(folder.path("other.mp4"), 15).write(picture.empty() ? cv::Mat(120, 160, CV_8UC3) : picture); }
  EXPECT_EQ(folder.files(), 1u) << "a film that was not finished leaves nothing";
}

TEST(FilmWriter, AFilmThatIsNotWholeIsNamedAndTakenAway) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("film.mp4");
  cv::Mat picture(240, 320, CV_8UC3);
  const auto write = [&](int pictures) {
    FilmWriter film(path, 15);
    cv::RNG noise(1);
    for (int i = 0; i < pictures; ++i) {
      noise.fill(picture, cv::RNG::UNIFORM, 0, 256);  // Does not compress.
      film.write(picture);
    }
    film.finish();
  };
  write(30);
  const std::uintmax_t whole_bytes = std::filesystem::file_size(path);
  std::filesystem::remove(path);
  // Full at the beginning, half way, and in the index at the end.
  for (const std::uintmax_t limit : {std::uintmax_t{10}, whole_bytes / 2, whole_bytes - 100, whole_bytes - 1}) {
    testing::internal::CaptureStderr();
    std::string said;
    {
      const test::FileSizeLimit full(limit);
      try {
        write(30);
      } catch (const InputError& error) {
        said = error.what();
      }
    }
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << limit;
    const std::string how = limit > 10 ? " whole: is the disk full?" : " as a film";  // Its first bytes are missing.
    EXPECT_EQ(said, path + ": cannot be written" + how) << limit;
    EXPECT_EQ(folder.files(), 0u) << limit;
  }
}

TEST(FilmWriter, NumbersPictures) {
  const test::TemporaryFolder folder;
  FilmWriter film(folder.path("p%03d.png"), 15);
  for (int i = 0; i < 2; ++i) film.write(cv::Mat(8, 8, CV_8UC3, cv::Scalar(0, 0, 0)));
  film.finish();
  EXPECT_TRUE(std::filesystem::exists(folder.path("p001.png")));
  EXPECT_EQ(folder.files(), 2u);
}

TEST(FilmWriter, RefusesOtherNames) {
  for (const std::string path :
       {"film.avi", "p%s.png", "p%d%d.png", "p.png", "%n.mp4", "/no/such/folder/film.mp4", ""}) {
    EXPECT_THROW(FilmWriter(path, 15), InputError) << path;
  }
}

}  // namespace
}  // namespace angio::test
