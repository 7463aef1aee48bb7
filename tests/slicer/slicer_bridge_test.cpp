// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/slicer/slicer_bridge.hpp"

#include <gmock/gmock.h>

#include "angio/messaging/mailbox.hpp"
#include "angio/test/namespace.hpp"
#include "angio/types/channels.hpp"
#include "angio/vessel/model_id.hpp"
#include "igtl_client.hpp"

namespace angio::test {
namespace {

SlicerScene slicerScene() {
  Eigen::Matrix3Xd points(3, 5), displacements = Eigen::Matrix3Xd::Constant(3, 5, 1e-3);
  points << 0, 0, 0, 0.02, -0.02, 0, 0.01, 0, 0, 0, -0.05, -0.02, 0, 0.04, 0.05;
  Pose T_dsa_cb = Pose::Identity();
  T_dsa_cb.translation() << 0.01, -0.02, 0.03;
  CArmGeometry carm;
  carm.image_width_px = 64;
  carm.image_height_px = 48;
  carm.pixel_spacing_m = 4e-3;
  return {VesselTree(points, {-1, 0, 1, 2, 2}, {1e-3, 1e-3, 1e-3, 5e-4, 5e-4}), displacements, carm, T_dsa_cb};
}

// Bus, bridge and the library's client.
struct Bridged {
  Bridged()
      : server([] {
          IgtlServerSettings s;
          s.port = 0;
          return s;
        }()),
        bridge(*bus, server, slicerScene(), [this](const std::string& p) { problems.push_back(p); }),
        client(server.port()) {
    if (!until([this] { return client.count("Tree") == 1; })) throw std::runtime_error("no client");
  }

  template <typename Message>
  void publish(const char* channel, const Message& message) {
    messaging::publish(*bus, channel, message);
    bus->handle(std::chrono::milliseconds(0));
  }
  bool until(const std::function<bool()>& done) {
    return handleUntil(
        [this] {
          now_us += 1000;
          bridge.serve(now_us, std::chrono::milliseconds(1));
          bus->handle(std::chrono::milliseconds(0));
        },
        done);
  }
  Eigen::Matrix4d transform(const std::string& device) const {
    ::igtl::Matrix4x4 matrix;
    static_cast<::igtl::TransformMessage*>(client.last(device).GetPointer())->GetMatrix(matrix);
    Eigen::Matrix4d T;
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) T(r, c) = static_cast<double>(matrix[r][c]);
    }
    return T;
  }

  std::vector<std::string> problems;
  std::unique_ptr<Bus> bus = openBus("memq://");
  IgtlServer server;
  SlicerBridge bridge;
  LibraryClient client;
  std::int64_t now_us = 1;
};

CArmState stateAt(std::int64_t time_us) {
  CArmState state{time_us, time_us, CArmJoints::Zero(), CArmJoints::Zero()};
  state.joints << 0.5, -0.2, 0.01, 0.02, -0.03;
  return state;
}

XrayFrame frameAt(std::int64_t time_us) {
  const XrayCamera camera = slicerScene().carm.camera();
  return {time_us, time_us, cv::Mat(48, 64, CV_16UC1, cv::Scalar(1000)), camera};
}

RegistrationMessage registrationAt(std::int64_t time_us, const Pose& T_camera_model) {
  RegistrationMessage seen;
  seen.time_us = seen.frame_sequence = time_us;
  seen.model_id = modelId(slicerScene().tree);
  seen.status_text = "converged";
  seen.T_camera_model = T_camera_model;
  return seen;
}

// A point of the tree, its pixel, and that pixel in space lie on one ray, whichever way they are computed.
TEST(SlicerBridge, AnImageLiesWhereItsRaysEnd) {
  Bridged b;
  b.publish(kCArmStateChannel, stateAt(1));
  b.publish(kXrayFrameChannel, frameAt(2));
  Twist off;
  off << 0.004, -0.003, 0.01, 0.02, 0.01, -0.03;
  const SlicerScene scene = slicerScene();
  const Pose T_camera_model = expSE3(off) * scene.carm.T_camera_patient(stateAt(1).joints) * scene.T_dsa_cb;
  b.publish(kRegistrationChannel, registrationAt(2, T_camera_model));
  b.publish(kXrayFrameChannel, frameAt(3));
  ASSERT_TRUE(b.until([&] { return b.client.count("XrayFrame") == 2; }));
  auto* image = static_cast<::igtl::ImageMessage*>(b.client.last("XrayFrame").GetPointer());
  ::igtl::Matrix4x4 m;
  float spacing[3], size_f[3];
  int size[3];
  image->GetMatrix(m);
  image->GetSpacing(spacing);
  image->GetDimensions(size);
  for (int i = 0; i < 3; ++i) size_f[i] = static_cast<float>(size[i]);
  EXPECT_EQ(size[0], 64);
  EXPECT_EQ(size[1], 48);
  EXPECT_EQ(image->GetScalarType(), ::igtl::ImageMessage::TYPE_UINT16);
  const Eigen::Vector3d flip(-1, -1, 1);
  const Eigen::Vector3d source_ras_mm = 1e3 * flip.asDiagonal() * T_camera_model.inverse().translation();
  for (int i = 0; i < scene.tree.size(); ++i) {
    const Eigen::Vector3d point_ras_mm = 1e3 * flip.asDiagonal() * Eigen::Vector3d(scene.tree.points().col(i));
    const auto pixel = scene.carm.camera().project(T_camera_model * Eigen::Vector3d(scene.tree.points().col(i)));
    Eigen::Vector3d place_ras_mm;
    for (int k = 0; k < 3; ++k) {
      place_ras_mm[k] = m[k][3] + m[k][0] * spacing[0] * (pixel->x() - (size_f[0] - 1) / 2) +
                        m[k][1] * spacing[1] * (pixel->y() - (size_f[1] - 1) / 2);
    }
    const Eigen::Vector3d ray = (place_ras_mm - source_ras_mm).normalized();
    // Floats of a metre in millimetres have 6e-5.
    EXPECT_LT(ray.cross(point_ras_mm - source_ras_mm).norm(), 1e-2);
    EXPECT_GT(ray.dot(point_ras_mm - source_ras_mm), 0);
  }
  const Eigen::Matrix4d camera = b.transform("CameraToTree");
  EXPECT_LT((Eigen::Vector3d(camera.topRightCorner<3, 1>()) - source_ras_mm).norm(), 1e-3);
  // TreeToPatient and the joints say the same of the camera.
  Pose T_patient_model = scene.carm.T_camera_patient(stateAt(1).joints).inverse() * T_camera_model;
  const Eigen::Vector3d tree_ras_mm = 1e3 * flip.asDiagonal() * T_patient_model.translation();
  ASSERT_TRUE(b.until([&] { return b.client.count("TreeToPatient") == 2; }));
  EXPECT_LT((Eigen::Vector3d(b.transform("TreeToPatient").topRightCorner<3, 1>()) - tree_ras_mm).norm(), 1e-3);
  EXPECT_LT(
      (Eigen::Vector3d(b.transform("TableToPatient").topRightCorner<3, 1>()) - Eigen::Vector3d(-10, -20, -30)).norm(),
      1e-4);
}

TEST(SlicerBridge, ShowsTreesTipAndStatus) {
  Bridged b;
  CatheterTip tip;
  tip.status = CatheterTipStatus::kLocated;
  tip.tip_model << 0.001, 0.002, 0.003;
  b.publish(kCatheterTipChannel, tip);
  ServoStatus status;
  status.state = ServoState::kFault;
  status.reason = "frames are gone";
  for (int i = 1; i < 4; ++i) {
    status.frame_sequence = status.time_us = i;
    b.publish(kServoStatusChannel, status);
  }
  ASSERT_TRUE(b.until([&] {
    return b.client.count("Tree") == 1 && b.client.count("DeformedTree") == 1 && b.client.count("TipToTree") == 1 &&
           b.client.count("Servo") == 1;
  }));
  auto* tree = static_cast<::igtl::PolyDataMessage*>(b.client.last("Tree").GetPointer());
  EXPECT_EQ(tree->GetPoints()->GetNumberOfPoints(), 5);
  EXPECT_EQ(tree->GetLines()->GetNumberOfCells(), slicerScene().tree.branches().size());
  igtlFloat32 point[3], moved[3];
  tree->GetPoints()->GetPoint(3, point);
  EXPECT_FLOAT_EQ(point[0], -20);
  EXPECT_FLOAT_EQ(point[2], 40);
  static_cast<::igtl::PolyDataMessage*>(b.client.last("DeformedTree").GetPointer())->GetPoints()->GetPoint(3, moved);
  EXPECT_NEAR(moved[0] - point[0], -1, 1e-5);
  EXPECT_NEAR(moved[2] - point[2], 1, 1e-5);
  ASSERT_EQ(tree->GetNumberOfAttributes(), 1);
  EXPECT_EQ(static_cast<::igtl::StatusMessage*>(b.client.last("Servo").GetPointer())->GetCode(), 18);
  EXPECT_LT((b.transform("TipToTree").topRightCorner<3, 1>() - Eigen::Vector3d(-1, -2, 3)).norm(), 1e-5);
}

TEST(SlicerBridge, ATargetIsAskedForUntilItIsReached) {
  Bridged b;
  std::vector<ViewRequest> asked;
  b.bus->subscribe(kViewRequestChannel, [&](const std::uint8_t* data, std::size_t size) {
    asked.push_back(*decode<ViewRequest>(data, size).value);
  });
  auto text = ::igtl::StringMessage::New();
  text->SetDeviceName("Target");
  text->SetString("lao_deg 30 cra_deg 15 r_mm 12 a_mm -3 s_mm 40");
  b.client.send(text);
  ASSERT_TRUE(b.until([&] { return b.problems.size() == 1; }));
  EXPECT_THAT(b.problems[0], testing::HasSubstr("before the first frame"));
  b.publish(kCArmStateChannel, stateAt(1));
  b.publish(kXrayFrameChannel, frameAt(77));
  b.client.send(text);
  ASSERT_TRUE(b.until([&] { return asked.size() == 3; }));
  for (const ViewRequest& request : asked) {
    EXPECT_EQ(request.time_us, 77);
    EXPECT_EQ(request.sequence, 1);
    EXPECT_EQ(request.model_id, modelId(slicerScene().tree));
    EXPECT_LT((request.beam_model - beamDirection({degToRad(30), degToRad(15)})).norm(), 1e-12);
    EXPECT_LT((request.target_model - Eigen::Vector3d(-0.012, 0.003, 0.040)).norm(), 1e-12);
  }
  ServoStatus reached;
  reached.view_reached_us = 77;
  b.publish(kServoStatusChannel, reached);
  const std::size_t before = asked.size();
  const std::int64_t later_us = b.now_us + 1'000'000;
  ASSERT_TRUE(b.until([&] { return b.now_us > later_us; }));
  EXPECT_EQ(asked.size(), before);

  // A point that nobody turned keeps the view; a turned one brings its own.
  auto place = ::igtl::TransformMessage::New();
  place->SetDeviceName("Target");
  ::igtl::Matrix4x4 matrix;
  ::igtl::IdentityMatrix(matrix);
  matrix[2][3] = 25;
  place->SetMatrix(matrix);
  b.client.send(place);
  ASSERT_TRUE(b.until([&] { return asked.size() > before; }));
  const SlicerScene scene = slicerScene();
  const Pose T_camera_model = scene.carm.T_camera_patient(stateAt(1).joints) * scene.T_dsa_cb;
  EXPECT_LT((asked.back().beam_model - T_camera_model.linear().row(2).transpose()).norm(), 1e-12);
  EXPECT_LT((asked.back().target_model - Eigen::Vector3d(0, 0, 0.025)).norm(), 1e-9);
  EXPECT_EQ(asked.back().sequence, 2);
  EXPECT_EQ(asked.back().time_us, 78);
  const float turned[3][3] = {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}};  // Its z axis is A: the beam goes to the front.
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) matrix[r][c] = turned[r][c];
  }
  place->SetMatrix(matrix);
  b.client.send(place);
  ASSERT_TRUE(b.until([&] { return asked.back().sequence == 3; }));
  EXPECT_LT((asked.back().beam_model - Eigen::Vector3d(0, -1, 0)).norm(), 1e-6);

  text->SetString("lao_deg 30");
  b.client.send(text);
  ASSERT_TRUE(b.until([&] { return b.problems.size() == 2; }));
  EXPECT_THAT(b.problems[1], testing::HasSubstr("must be both or none"));
  EXPECT_EQ(b.bridge.requests(), 3);
}

}  // namespace
}  // namespace angio::test
