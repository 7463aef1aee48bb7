// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/dicom_registration.hpp"

#include <gmock/gmock.h>

#include <cstdlib>

#include "angio/io/pose_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"
#include "dicom_bytes.hpp"

namespace angio::test {
namespace {

constexpr std::int64_t kTree = -8'123'456'789'012'345'678;

DicomRegistration registrationOf(Random& random) {
  DicomRegistration registration;
  Twist xi;
  for (int i = 0; i < 6; ++i) xi[i] = random.uniform(-1.5, 1.5);
  registration.T_camera_model = expSE3(xi);
  registration.model_id = ModelId{kTree};
  registration.model_frame_uid = "1.2.840.99999.1.4";
  registration.description = "oriented_kernel, mean residual 0.52 px";
  return registration;
}

std::string writtenRun(const TemporaryFolder& folder) {
  DicomBytes run;
  run.set(0x00080005, "CS", "ISO_IR 100").set(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.12.1");
  run.set(0x00080018, "UI", "1.2.3.4").set(0x00100010, "PN", "Phantom^Static").set(0x00100020, "LO", "P-7");
  run.set(0x0020000D, "UI", "1.2.3.40").set(0x0020000E, "UI", "1.2.3.41").set(0x00080020, "DA", "20240131");
  return folder.write("run.dcm", run.file());
}

TEST(DicomRegistration, GivesBackThePoseAndBelongsToTheRunsPatient) {
  const TemporaryFolder folder;
  const std::string run = writtenRun(folder), path = folder.path("registration.dcm");
  Random random(3);
  for (const std::string& of : {run, std::string()}) {
    const DicomRegistration written = registrationOf(random);
    writeDicomRegistration(path, written, of);
    const DicomRegistration read = readDicomRegistration(path);
    // Ten digits in decimal strings: 1e-10 of a rotation's entry, and of 3 m.
    const auto difference = (read.T_camera_model.matrix() - written.T_camera_model.matrix()).eval();
    EXPECT_LT((difference.cwiseAbs().maxCoeff()), 2e-9);
    EXPECT_EQ(read.model_id, written.model_id);
    EXPECT_EQ(read.model_frame_uid, written.model_frame_uid);
    EXPECT_EQ(read.description, written.description);
    // The pose of any program that takes a pose file.
    EXPECT_EQ(readPose(path).T_camera_model.matrix(), read.T_camera_model.matrix());
    EXPECT_EQ(readPose(path).model_id, ModelId{kTree});
    const std::string bytes = contentOf(path);
    for (const char* text : {"Phantom^Static", "P-7", "1.2.3.40", "20240131", "1.2.3.4"}) {
      EXPECT_EQ(bytes.find(text) != bytes.npos, !of.empty()) << text;
    }
  }
}

TEST(DicomRegistration, RefusesWhatIsNone) {
  const TemporaryFolder folder;
  const std::string path = folder.path("registration.dcm");
  Random random(4);
  DicomRegistration one = registrationOf(random);
  one.model_frame_uid = "1.02.3";
  EXPECT_THAT(refusalOf([&] { writeDicomRegistration(path, one, ""); }),
              testing::HasSubstr("1.02.3: must be a DICOM UID"));
  EXPECT_EQ(folder.files(), 0u);
  EXPECT_THAT(refusalOf([&] { readDicomRegistration(writtenRun(folder)); }),
              testing::HasSubstr("must be Spatial Registration Storage"));
  one.model_frame_uid.clear();
  one.T_camera_model = Pose::Identity();
  one.T_camera_model.translation().x() = 0.111222333;
  writeDicomRegistration(path, one, "");
  const std::string good = contentOf(path);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    bytes.replace(bytes.find(from), from.size(), to);
    return refusalOf([&] { readDicomRegistration(folder.write("changed.dcm", bytes)); });
  };
  EXPECT_THAT(changed("RIGID ", "AFFINE"), testing::HasSubstr("must be RIGID"));
  EXPECT_THAT(changed("1\\0\\0\\111.222333", "2\\0\\0\\111.222333"),
              testing::HasSubstr("must be a rotation and a shift"));
  EXPECT_THAT(changed("1\\0\\0\\111.222333", "1\\0\\0\\000.000000"),
              testing::HasSubstr("must have one item that is not the identity"));
  EXPECT_THAT(changed("1\\0\\0\\111.222333", "-\\0\\0\\111.222333"), testing::HasSubstr("changed.dcm"));
}

TEST(DicomRegistration, SecondaryCaptureHoldsThePicture) {
  const TemporaryFolder folder;
  cv::Mat picture(3, 5, CV_8UC3);
  for (int i = 0; i < 45; ++i) picture.data[i] = static_cast<std::uint8_t>(i);
  writeSecondaryCapture(folder.path("overlay.dcm"), picture, "a picture", writtenRun(folder));
  const std::string bytes = contentOf(folder.path("overlay.dcm"));
  // Red first, and one byte to an even number.
  const std::string pixels = bytes.substr(bytes.size() - 46);
  for (std::size_t i = 0; i < 15; ++i) {
    for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(static_cast<std::uint8_t>(pixels[3 * i + c]), 3 * i + 2 - c);
  }
  EXPECT_THROW(writeSecondaryCapture(folder.path("grey.dcm"), cv::Mat(3, 5, CV_8UC1), "", ""), std::invalid_argument);
}

// The objects by the standard's own rules, as dicom3tools has them.
TEST(DicomRegistration, PassesAValidatorOfDicom) {
  if (std::system("command -v dciodvfy > /dev/null && command -v dcmdump > /dev/null") != 0) {
    GTEST_SKIP() << "dciodvfy and dcmdump are not there: apt-get install dicom3tools dcmtk";
  }
  const TemporaryFolder folder;
  Random random(5);
  const std::string run = writtenRun(folder);
  writeDicomRegistration(folder.path("with.dcm"), registrationOf(random), run);
  writeDicomRegistration(folder.path("without.dcm"), registrationOf(random), "");
  writeSecondaryCapture(folder.path("overlay.dcm"), cv::Mat(40, 50, CV_8UC3, cv::Scalar(1, 2, 3)), "a picture", run);
  for (const char* name : {"with.dcm", "without.dcm", "overlay.dcm"}) {
    const std::string file = folder.path(name);
    EXPECT_EQ(std::system(("dcmdump -q " + file + " > /dev/null").c_str()), 0) << name;
    (void)std::system(("dciodvfy " + file + " 2>&1 | grep '^Error' > " + folder.path("errors")).c_str());
    EXPECT_EQ(contentOf(folder.path("errors")), "") << name;
  }
}

}  // namespace
}  // namespace angio::test
