// SPDX-License-Identifier: GPL-2.0-or-later
// X-ray runs: real ones against what was worked out by hand and by other programs, and made ones for what those do not
// have. Paths of what may not be copied into the project come from ANGIO_SHARED_DATA.
#include "angio/io/xa_files.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <opencv2/core.hpp>

#include "angio/io/case_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/shared_data.hpp"
#include "angio/test/temporary_folder.hpp"
#include "dicom_bytes.hpp"

namespace angio::test {
namespace {

using test::DicomBytes;
using test::refusalOf;
using testing::Contains;
using testing::HasSubstr;

std::uint64_t checksum(const cv::Mat& image) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < image.total(); ++i) sum += image.data[i] * (i % 251 + 1);
  return sum;
}

double meanDifference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total());
}

// The pose files beside the runs were made without any of this from the same angles, with one T_dsa_cb for all of them:
// a wrong sign, axis or mirror is off by tens of degrees. They have nine digits and a tenth of a micrometre.
void expectNominalPose(const XaRun& run, const std::string& name) {
  const Pose T_dsa_cb = readViewPose(test::exampleData("static-phantom/dicom/t_dsa_cb.yaml"));
  const Pose nominal = readPose(test::exampleData("static-phantom/" + name + "_nominal.yaml")).T_camera_model;
  const XaGeometry geometry = run.geometry(0);
  ASSERT_TRUE(geometry.T_camera_patient);
  const Pose off = *geometry.T_camera_patient * T_dsa_cb * nominal.inverse();
  EXPECT_LT(rotationAngle(off.linear()), 1e-7);
  EXPECT_LT((*geometry.T_camera_patient * T_dsa_cb * Eigen::Vector3d::Zero() - nominal.translation()).norm(), 1e-6);
}

// The picture is a JPEG's of this frame, mirrored and rounded to multiples of 4: 3 to 5 grey levels away on average
// from the frame it was made of, and at least 1.5 times as much from any other and from its mirror.
void expectPictureIsFrame(const XaRun& run, const std::string& name, int frame) {
  const cv::Mat picture = readXrayImage(test::exampleData("static-phantom/frames/" + name + ".png"));
  const double right = meanDifference(run.image(frame), picture);
  EXPECT_LT(right, 5);
  EXPECT_GT(meanDifference(run.storedImage(frame), picture), 1.5 * right);
  for (int other = 0; other < run.frames(); ++other) {
    if (other == frame) continue;
    EXPECT_GT(meanDifference(run.image(other), picture), 1.5 * right) << other;
  }
}

TEST(XaRun, ARealRunSaysItsGeometry) {
  const XaRun run(test::exampleData("static-phantom/dicom/im5.dcm"));
  EXPECT_EQ(run.header().modality, "XA");
  EXPECT_EQ(run.header().manufacturer, "GE MEDICAL SYSTEMS");
  EXPECT_EQ(run.header().transfer_syntax, "JPEG lossless, first-order prediction");
  ASSERT_EQ(run.frames(), 3);
  EXPECT_NEAR(*run.header().frame_rate_hz, 2 / 0.8, 1e-5) << "frames 0, 8 and 12 at 15 Hz";
  EXPECT_TRUE(run.masks().empty());

  const XaGeometry g = run.geometry(2);
  EXPECT_EQ(g.camera.width_px(), 512);
  EXPECT_NEAR(g.camera.parameters().fx_px, 931 / 0.390625, 1e-9);
  EXPECT_EQ(g.camera.parameters().fx_px, g.camera.parameters().fy_px);
  EXPECT_EQ(g.camera.parameters().cx_px, 255.5);
  EXPECT_EQ(g.spacing_from, "(0018,1164) Imager Pixel Spacing");
  EXPECT_TRUE(g.stored_mirrored);
  EXPECT_NEAR(*g.source_isocenter_distance_m, 0.720, 1e-12);
  EXPECT_NEAR(radToDeg(g.patient_angles->primary_rad), -26.5, 1e-9);
  EXPECT_NEAR(radToDeg(g.patient_angles->secondary_rad), -32.7, 1e-9);
  EXPECT_NEAR(*g.time_s, 12 / 15.0, 1e-5);
  expectNominalPose(run, "im5");
}

TEST(XaRun, RealFramesAreThoseThatGdcmDecodes) {
  const XaRun run(test::exampleData("static-phantom/dicom/im5.dcm"));
  // Made once with GDCM 3.0.21, which has a JPEG decoder of its own; all 52 frames of the four whole runs agreed too.
  const std::uint64_t expected[] = {3228955581, 3224079744, 3227248888};
  for (const int frame : {2, 0, 1}) {  // In any order.
    const cv::Mat stored = run.storedImage(frame);
    ASSERT_EQ(stored.type(), CV_8UC1);
    EXPECT_EQ(checksum(stored), expected[frame]);
    cv::Mat mirrored;
    cv::flip(stored, mirrored, 1);
    EXPECT_EQ(cv::norm(run.image(frame), mirrored, cv::NORM_INF), 0);
  }
  expectPictureIsFrame(run, "im5", 2);
}

struct WholeRun {
  const char *name, *picture;
  int frames, contrast_frame;
  double source_detector_mm, primary_deg, secondary_deg;
  const char* spacing_from;
  std::uint64_t first_frame;  // By GDCM.
};

class WholeXaRun : public testing::TestWithParam<WholeRun> {};

TEST_P(WholeXaRun, HasTheGeometryWorkedOutByHand) {
  const WholeRun& expected = GetParam();
  const std::string name = std::string("static-phantom/dicom/") + expected.name + ".dcm";
  NEED_SHARED_DATA(name);
  const std::string path = test::sharedData(name);
  const XaRun run(path);
  EXPECT_EQ(run.frames(), expected.frames);
  EXPECT_NEAR(*run.header().frame_rate_hz, 15, 1e-4);
  const XaGeometry g = run.geometry(expected.contrast_frame);
  EXPECT_NEAR(g.camera.parameters().fx_px, expected.source_detector_mm * 512 / 200, 1e-9);
  EXPECT_NEAR(g.camera.parameters().fy_px, expected.source_detector_mm * 512 / 200, 1e-9);
  EXPECT_NEAR(g.source_detector_distance_m, expected.source_detector_mm * 1e-3, 1e-12);
  EXPECT_NEAR(*g.source_isocenter_distance_m, 0.720, 1e-12);
  EXPECT_NEAR(radToDeg(g.patient_angles->primary_rad), expected.primary_deg, 1e-9);
  EXPECT_NEAR(radToDeg(g.patient_angles->secondary_rad), expected.secondary_deg, 1e-9);
  EXPECT_THAT(g.spacing_from, HasSubstr(expected.spacing_from));
  EXPECT_NEAR(*g.time_s, expected.contrast_frame / 15.0, 1e-4);
  EXPECT_EQ(checksum(run.storedImage(0)), expected.first_frame);
  expectNominalPose(run, expected.picture);
  expectPictureIsFrame(run, expected.picture, expected.contrast_frame);
}

INSTANTIATE_TEST_SUITE_P(
    StaticPhantom, WholeXaRun,
    testing::Values(WholeRun{"IM1", "im1", 14, 10, 860, 31.3, 0.1, "Field of View Dimension(s)", 3702909824},
                    WholeRun{"IM2", "im2", 12, 9, 865, -27.3, -0.1, "Field of View Dimension(s)", 3645912163},
                    WholeRun{"IM4", "im4", 10, 7, 907, 0.1, 28.7, "Field of View Dimension(s)", 3717529536},
                    WholeRun{"IM5", "im5", 16, 12, 931, -26.5, -32.7, "Imager Pixel Spacing", 3228955581}),
    [](const auto& of) { return std::string(of.param.name); });

TEST(XaRun, FocalLengthsAreTheDistanceOverEachSpacing) {
  const XaGeometry g = made(DicomBytes().set(0x00181164, "DS", "0.5\\0.4")).geometry(0);  // Rows apart, columns apart.
  EXPECT_NEAR(g.camera.parameters().fx_px, 1000 / 0.4, 1e-9);
  EXPECT_NEAR(g.camera.parameters().fy_px, 1000 / 0.5, 1e-9);
  EXPECT_FALSE(g.camera.parameters().pixel_spacing_m);
}

TEST(XaRun, MissingSpacingsAreReplacedInOrderAndSaid) {
  DicomBytes bytes;
  bytes.remove(0x00181164).set(0x00181162, "DS", "320").set(0x00181149, "IS", "240\\160").set(0x00280030, "DS", "0.3");
  const auto focal = [&] { return made(bytes).geometry(0).camera.parameters().fx_px; };
  const auto said = [&] { return made(bytes).geometry(0).assumed; };
  EXPECT_NEAR(focal(), 1000 / (0.3 * 1000 / 750), 1e-9) << "0.3 mm at the isocentre are 0.4 mm at the detector";
  EXPECT_THAT(said(), Contains(HasSubstr("(0018,1164) Imager Pixel Spacing is missing: 0.4 x 0.4 mm by (0028,0030)")));
  bytes.remove(0x00280030);
  EXPECT_NEAR(focal(), 1000 / (160 / 4.0), 1e-9) << "the field's second dimension lies along the rows' 4 pixels";
  EXPECT_THAT(said(), Contains(HasSubstr("80 x 40 mm by (0018,1149) Field of View Dimension(s)")));
  bytes.remove(0x00181149);
  EXPECT_NEAR(focal(), 1000 / (320 / 4.0), 1e-9);
  EXPECT_THAT(said(), Contains(HasSubstr("by (0018,1162) Intensifier Size")));
  bytes.remove(0x00181162);
  EXPECT_THAT(refusalOf([&] { made(bytes); }),
              HasSubstr("made.dcm: (0018,1164) Imager Pixel Spacing: is missing, and with it the camera"));
}

TEST(XaRun, MissingDistancesAreReplacedAndSaid) {
  DicomBytes bytes;
  bytes.set(0x00181114, "DS", "1.25").remove(0x00181110);
  XaGeometry g = made(bytes).geometry(0);
  EXPECT_NEAR(g.source_detector_distance_m, 0.750 * 1.25, 1e-12);
  EXPECT_THAT(g.assumed, Contains(HasSubstr("(0018,1110) Distance Source to Detector is missing: 937.5 mm")));
  bytes.set(0x00181110, "DS", "1000").remove(0x00181111);
  g = made(bytes).geometry(0);
  EXPECT_NEAR(*g.source_isocenter_distance_m, 0.8, 1e-12);
  bytes.remove(0x00181114);
  g = made(bytes).geometry(0);
  EXPECT_FALSE(g.source_isocenter_distance_m);
  EXPECT_FALSE(g.T_camera_patient) << "without a distance there is no pose";
  EXPECT_THAT(g.assumed, Contains(HasSubstr("(0018,1111) Distance Source to Patient is missing: no pose")));
  bytes.remove(0x00181110);
  EXPECT_THAT(refusalOf([&] { made(bytes); }),
              HasSubstr("made.dcm: (0018,1110) Distance Source to Detector: is missing"));
  bytes.set(0x00181110, "DS", "1000").set(0x00181111, "DS", "1100");
  EXPECT_THAT(refusalOf([&] { made(bytes); }),
              HasSubstr("(0018,1111) Distance Source to Patient = 1100: must not exceed"));
}

TEST(XaRun, IncrementsMoveThePositionerAndTheTable) {
  DicomBytes bytes;
  bytes.set(0x00181520, "DS", "0\\5").set(0x00181521, "DS", "-2");
  bytes.set(0x00181135, "DS", "10").set(0x00181136, "DS", "20").set(0x00181137, "DS", "30");
  const XaRun run = made(bytes);
  EXPECT_NEAR(radToDeg(run.geometry(1).patient_angles->primary_rad), 35, 1e-9) << "a list holds offsets";
  EXPECT_NEAR(radToDeg(run.geometry(1).patient_angles->secondary_rad), -22, 1e-9) << "one value is a step";
  EXPECT_LT(run.geometry(0).table_shift_m.norm(), 1e-15);
  // Longitudinal towards LAO, vertical down, lateral towards CRA; HFS.
  EXPECT_LT((run.geometry(1).table_shift_m - Eigen::Vector3d(0.030, 0.010, 0.020)).norm(), 1e-12);
  const Pose T = *run.geometry(1).T_camera_patient;
  EXPECT_LT((T * Eigen::Vector3d(-0.030, -0.010, -0.020) - Eigen::Vector3d(0, 0, 0.750)).norm(), 1e-12)
      << "what is at the isocentre now was up there before";
  bytes.set(0x00185100, "CS", "HFP");
  EXPECT_LT((made(bytes).geometry(1).table_shift_m - Eigen::Vector3d(0.030, -0.010, 0.020)).norm(), 1e-12)
      << "down is to the front of a patient who lies on the belly";
  bytes.set(0x00181520, "DS", "0\\5\\10");
  EXPECT_THAT(refusalOf([&] { made(bytes); }), HasSubstr("(0018,1520) Positioner Primary Angle Increment = 3 values"));
}

TEST(XaRun, FrameTimesAreListsStepsOrRates) {
  DicomBytes bytes;
  EXPECT_FALSE(made(bytes).geometry(1).time_s);
  bytes.set(0x00180040, "IS", "10");
  EXPECT_NEAR(*made(bytes).geometry(1).time_s, 0.1, 1e-12);
  bytes.set(0x00181063, "DS", "40");
  EXPECT_NEAR(*made(bytes).geometry(1).time_s, 0.040, 1e-12);
  bytes.set(0x00181065, "DS", "0\\50");
  EXPECT_NEAR(*made(bytes).geometry(1).time_s, 0.050, 1e-12);
  EXPECT_NEAR(*made(bytes).header().frame_rate_hz, 20, 1e-9);
}

TEST(XaRun, FlipsAndOrientationsDecideWhatIsMirrored) {
  DicomBytes bytes;
  EXPECT_TRUE(made(bytes).geometry(0).stored_mirrored);
  EXPECT_THAT(made(bytes).geometry(0).assumed,
              Contains(HasSubstr("(0018,7034) Field of View Horizontal Flip is missing")));
  EXPECT_EQ(made(bytes).image(0).at<std::uint16_t>(0, 0), 1003);
  bytes.set(0x00200020, "CS", "L\\F");  // LAO 30: the patient's left is on the right, seen from the detector.
  EXPECT_TRUE(made(bytes).geometry(0).stored_mirrored);
  bytes.set(0x00200020, "CS", "R\\F");
  EXPECT_FALSE(made(bytes).geometry(0).stored_mirrored);
  EXPECT_EQ(made(bytes).image(0).at<std::uint16_t>(0, 0), 1000);
  bytes.set(0x00187034, "CS", "NO");  // The detector's word counts more.
  EXPECT_TRUE(made(bytes).geometry(0).stored_mirrored);
  EXPECT_THAT(made(bytes).geometry(0).assumed, Contains(HasSubstr("contradicts the angles")));
  bytes.set(0x00187034, "CS", "YES");
  EXPECT_FALSE(made(bytes).geometry(0).stored_mirrored);
  bytes.set(0x00187034, "CS", "MAYBE");
  EXPECT_THAT(refusalOf([&] { made(bytes); }), HasSubstr("(0018,7034) Field of View Horizontal Flip = MAYBE"));
}

// By hand: a field of 4 x 3 pixels of 0.4 mm on a detector of 8 x 6 mm with elements of 0.2 mm. It begins 10 elements
// from the left and 5 from the top, so its middle is at (2.8, 1.6) mm and the detector's, where the beam's axis is, at
// (4, 3): 3 px to the right and 3.5 px down, and as seen from the source to the left.
TEST(XaRun, AFieldBesideTheDetectorsMiddleMovesThePrincipalPoint) {
  DicomBytes bytes;
  bytes.set(0x00187022, "DS", "0.2\\0.2").set(0x00187026, "DS", "6\\8").set(0x00187030, "IS", "5\\10");
  const auto principalPoint = [&] {
    const auto p = made(bytes).geometry(0).camera.parameters();
    return Eigen::Vector2d(p.cx_px, p.cy_px);
  };
  EXPECT_LT((principalPoint() - Eigen::Vector2d(1.5 - 3, 1 + 3.5)).norm(), 1e-9);
  EXPECT_THAT(made(bytes).geometry(0).assumed, Contains(HasSubstr("by (0018,7030) Field of View Origin")));
  bytes.set(0x00187034, "CS", "YES");  // Then the file's picture is the one as seen from the source.
  EXPECT_LT((principalPoint() - Eigen::Vector2d(1.5 - 3, 1 + 3.5)).norm(), 1e-9);
  bytes.set(0x00187028, "IS", "2\\1");  // The active area begins 0.4 mm further down and 0.2 mm further right.
  EXPECT_LT((principalPoint() - Eigen::Vector2d(1.5 - 3.5, 1 + 4.5)).norm(), 1e-9);
  bytes.remove(0x00187028);
  // Turned clockwise by a quarter: on the detector the field is 1.2 mm wide and 1.6 mm high, its middle at (2.6, 1.8)
  // mm, and the axis 1.4 mm to the right and 1.2 mm down. What is right is down then, and what is down is left.
  bytes.set(0x00187032, "DS", "90");
  EXPECT_LT((principalPoint() - Eigen::Vector2d(1.5 + 3, 1 + 3.5)).norm(), 1e-9);
  bytes.remove(0x00187032).set(0x00187030, "IS", "12\\16");
  EXPECT_LT((principalPoint() - Eigen::Vector2d(1.5, 1)).norm(), 1e-9) << "a field in the middle";
  bytes.set(0x00187030, "IS", "5000\\16");
  EXPECT_THAT(refusalOf([&] { made(bytes); }), HasSubstr("(0018,7030) Field of View Origin = 5000: must lie on"));
  bytes.set(0x00187030, "IS", "5\\10").remove(0x00187026);
  EXPECT_LT((principalPoint() - Eigen::Vector2d(1.5, 1)).norm(), 1e-9);
  EXPECT_THAT(made(bytes).geometry(0).assumed, Contains(HasSubstr("does not say it without (0018,7022)")));
}

// The patient's directions at the picture's edges follow the signs: what is on the overlay.
TEST(XaRun, SignsOfAnglesAreAskedFor) {
  const auto beam = [](XaAngleSigns signs) {
    const XaGeometry g = XaRun("made.dcm", DicomBytes().file(), signs).geometry(0);  // 30, -20.
    return Eigen::Vector2d(radToDeg(g.patient_angles->primary_rad), radToDeg(g.patient_angles->secondary_rad));
  };
  EXPECT_LT((beam(XaAngleSigns::kLaoCra) - Eigen::Vector2d(30, -20)).norm(), 1e-9);
  EXPECT_LT((beam(XaAngleSigns::kRaoCra) - Eigen::Vector2d(-30, -20)).norm(), 1e-9);
  EXPECT_LT((beam(XaAngleSigns::kLaoCau) - Eigen::Vector2d(30, 20)).norm(), 1e-9);
  EXPECT_LT((beam(XaAngleSigns::kRaoCau) - Eigen::Vector2d(-30, 20)).norm(), 1e-9);
  const XaGeometry g = XaRun("made.dcm", DicomBytes().file(), XaAngleSigns::kRaoCra).geometry(0);
  EXPECT_LT((g.T_camera_patient->linear() - viewRotation({degToRad(-30), degToRad(-20)})).norm(), 1e-9);
  EXPECT_THAT(g.assumed, Contains(HasSubstr("+ is taken as RAO and CRA, as is asked for")));
}

std::string floatBytes(float value) {
  std::string bytes(4, '\0');
  std::memcpy(bytes.data(), &value, 4);
  return bytes;
}

DicomBytes isocenterGroup(float primary_deg, float secondary_deg, float detector_deg, float table_x_mm) {
  DicomBytes angles = DicomBytes::item();
  angles.set(0x00189463, "FL", floatBytes(primary_deg)).set(0x00189464, "FL", floatBytes(secondary_deg));
  angles.set(0x00189465, "FL", floatBytes(detector_deg)).set(0x00189466, "FL", floatBytes(table_x_mm));
  angles.set(0x00189467, "FL", floatBytes(0)).set(0x00189468, "FL", floatBytes(0));
  DicomBytes group = DicomBytes::item();
  return group.set(0x00189462, "SQ", DicomBytes::sequence({angles}));
}

TEST(XaRun, EnhancedFilesHaveGroupsOfEachFrame) {
  DicomBytes shared = DicomBytes::item();
  shared.set(0x00181110, "DS", "1100");
  DicomBytes bytes;
  bytes.set(0x52009229, "SQ", DicomBytes::sequence({shared}));
  bytes.set(0x52009230, "SQ", DicomBytes::sequence({isocenterGroup(30, -20, 0, 0), isocenterGroup(40, -20, 90, 50)}));
  const XaRun run = made(bytes);
  EXPECT_NEAR(run.geometry(0).source_detector_distance_m, 1.1, 1e-12) << "before the one at the top";
  const Pose first = *run.geometry(0).T_camera_patient;
  EXPECT_LT((first.linear() - viewRotation({degToRad(30), degToRad(-20)})).norm(), 1e-12) << "HFS: both are the same";
  const XaGeometry g = run.geometry(1);
  EXPECT_NEAR(radToDeg(g.isocenter_angles->primary_rad), 40, 1e-5);
  EXPECT_LT((g.table_shift_m - Eigen::Vector3d(0.050, 0, 0)).norm(), 1e-9);
  // The detector is turned clockwise, so that what was at its top is now at its left, and at the camera's right.
  const Eigen::Matrix3d upright = viewRotation({degToRad(40), degToRad(-20)});
  EXPECT_LT((g.T_camera_patient->linear().row(0) + upright.row(1)).norm(), 1e-9);
  EXPECT_THAT(g.assumed, Contains(HasSubstr("the patient-based and the isocentre-based angles differ")));
}

TEST(XaRun, AFieldTurnedAgainstItsDetectorUndoesTheDetectorsTurn) {
  DicomBytes bytes;  // The detector is clockwise by 90 deg; to show the head up the picture is turned clockwise too.
  bytes.set(0x52009230, "SQ", DicomBytes::sequence({isocenterGroup(30, -20, 90, 0), isocenterGroup(30, -20, 90, 0)}));
  bytes.set(0x00187032, "DS", "90").set(0x00187034, "CS", "NO");
  const XaGeometry g = made(bytes).geometry(0);
  EXPECT_LT((g.T_camera_patient->linear() - viewRotation({degToRad(30), degToRad(-20)})).norm(), 1e-9);
}

TEST(XaRun, UnknownPositionsKeepTheFilesOwnConvention) {
  DicomBytes bytes;
  bytes.set(0x00185100, "CS", "SITTING");
  XaGeometry g = made(bytes).geometry(0);
  EXPECT_TRUE(g.T_camera_patient);
  EXPECT_FALSE(g.isocenter_angles);
  bytes.remove(0x00181510).remove(0x00181511);
  bytes.set(0x52009230, "SQ", DicomBytes::sequence({isocenterGroup(30, 0, 0, 0), isocenterGroup(30, 0, 0, 0)}));
  g = made(bytes).geometry(0);
  EXPECT_FALSE(g.T_camera_patient);
  EXPECT_THAT(g.assumed, Contains(HasSubstr("(0018,5100) Patient Position = SITTING is not one of HFS")));
}

TEST(XaRun, MasksAreCountedFromZero) {
  DicomBytes mask = DicomBytes::item();
  mask.set(0x00286101, "CS", "AVG_SUB").set(0x00286110, "US", DicomBytes::word(1));
  mask.set(0x00286102, "US", DicomBytes::word(1) + DicomBytes::word(2)).set(0x00286112, "US", DicomBytes::word(2));
  const XaRun run = made(DicomBytes().set(0x00286100, "SQ", DicomBytes::sequence({mask})));
  ASSERT_EQ(run.masks().size(), 1U);
  EXPECT_EQ(run.masks()[0].operation, "AVG_SUB");
  EXPECT_EQ(run.masks()[0].mask_frames, std::vector<int>{0});
  mask.set(0x00286110, "US", DicomBytes::word(3));
  EXPECT_THAT(refusalOf([&] { made(DicomBytes().set(0x00286100, "SQ", DicomBytes::sequence({mask}))); }),
              HasSubstr("(0028,6110) Mask Frame Numbers = 3: must lie between 1 and 2"));
}

}  // namespace
}  // namespace angio::test
