// SPDX-License-Identifier: GPL-2.0-or-later
// Pixels of made runs: what is stored against what comes out, however it is coded.
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpeg/djrplol.h>
#include <gmock/gmock.h>

#include <opencv2/core.hpp>

#include "angio/io/image_files.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "dicom_bytes.hpp"

namespace angio::test {
namespace {

using test::contentOf;
using test::DicomBytes;
using test::refusalOf;
using test::TemporaryFolder;
using testing::HasSubstr;

// Two frames of noise, `bits` deep, as a file and as what they are.
struct Noise {
  DicomBytes bytes;
  std::vector<cv::Mat> frames;
};

Noise noise(int bits, const cv::Size& size = {37, 23}) {
  Noise made;
  const int allocated = bits > 8 ? 16 : 8;
  std::string pixels;
  cv::RNG random(7);
  for (int f = 0; f < 2; ++f) {
    cv::Mat frame(size, allocated == 16 ? CV_16UC1 : CV_8UC1);
    random.fill(frame, cv::RNG::UNIFORM, 0, 1 << bits);
    pixels.append(frame.ptr<char>(), frame.total() * frame.elemSize());
    made.frames.push_back(frame);
  }
  made.bytes.set(0x00280010, "US", DicomBytes::word(size.height)).set(0x00280011, "US", DicomBytes::word(size.width));
  made.bytes.set(0x00280100, "US", DicomBytes::word(allocated)).set(0x00280101, "US", DicomBytes::word(bits));
  made.bytes.set(0x00280102, "US", DicomBytes::word(bits - 1)).set(0x7FE00010, allocated == 16 ? "OW" : "OB", pixels);
  return made;
}

// The same file coded otherwise, by DCMTK.
std::string recoded(const DicomBytes& bytes, E_TransferSyntax syntax, const DcmRepresentationParameter* parameter) {
  DJEncoderRegistration::registerCodecs();
  DcmRLEEncoderRegistration::registerCodecs();
  const TemporaryFolder folder;
  const std::string path = folder.write("plain.dcm", bytes.file());
  DcmFileFormat file;
  EXPECT_TRUE(file.loadFile(path.c_str()).good());
  EXPECT_TRUE(file.getDataset()->chooseRepresentation(syntax, parameter).good());
  EXPECT_TRUE(file.saveFile(path.c_str(), syntax).good());
  return contentOf(path);
}

void expectFrames(const XaRun& run, const std::vector<cv::Mat>& expected) {
  ASSERT_EQ(run.frames(), static_cast<int>(expected.size()));
  for (int f = run.frames() - 1; f >= 0; --f) {
    const cv::Mat image = run.storedImage(f);
    const cv::Mat& wanted = expected[static_cast<std::size_t>(f)];
    ASSERT_EQ(image.type(), wanted.type());
    ASSERT_EQ(image.size(), wanted.size());
    EXPECT_EQ(cv::norm(image, wanted, cv::NORM_INF), 0) << f;
  }
}

TEST(DicomPixels, EveryCodingOfEveryDepthGivesTheSameFrames) {
  const DJ_RPLossless first_order(1, 0), any_order(6, 0);
  for (const int bits : {8, 10, 12, 16}) {
    const Noise n = noise(bits);
    SCOPED_TRACE(bits);
    expectFrames(made(n.bytes), n.frames);
    expectFrames(XaRun("run.dcm", recoded(n.bytes, EXS_JPEGProcess14SV1, &first_order)), n.frames);
    expectFrames(XaRun("run.dcm", recoded(n.bytes, EXS_JPEGProcess14, &any_order)), n.frames);
    expectFrames(XaRun("run.dcm", recoded(n.bytes, EXS_RLELossless, nullptr)), n.frames);
    expectFrames(XaRun("run.dcm", recoded(n.bytes, EXS_BigEndianExplicit, nullptr)), n.frames);
    expectFrames(XaRun("run.dcm", recoded(n.bytes, EXS_LittleEndianImplicit, nullptr)), n.frames);
  }
}

TEST(DicomPixels, RunLengthsThatLeaveTheirBytesAreRefused) {
  const std::string good = recoded(noise(12).bytes, EXS_RLELossless, nullptr);
  const auto header =
      good.find(DicomBytes::longWord(2) + DicomBytes::longWord(64));  // Two segments, the first behind it.
  ASSERT_NE(header, std::string::npos);
  const auto refused = [&](std::size_t at, std::uint32_t value) {
    std::string bad = good;
    bad.replace(at, 4, DicomBytes::longWord(value));
    return refusalOf([&] { XaRun("a.dcm", bad).image(0); });
  };
  for (const std::uint32_t value : {0U, 1U, 63U, 0x7FFFFFFFU, 0xFFFFFFF0U}) {
    EXPECT_THAT(refused(header + 4, value), HasSubstr("frame 0: cannot be decoded: the run lengths are broken"));
    EXPECT_THAT(refused(header + 8, value), HasSubstr("the run lengths are broken"));
    EXPECT_THAT(refused(header, value), HasSubstr("the run lengths are broken"));
  }
}

TEST(DicomPixels, StoredBitsSignsAndPolarityAreUndone) {
  const auto first = [](const DicomBytes& bytes) { return made(bytes).storedImage(0).at<std::uint16_t>(0, 0); };
  EXPECT_EQ(first(DicomBytes()), 1000);
  EXPECT_EQ(first(DicomBytes().set(0x00280004, "CS", "MONOCHROME1")), 4095 - 1000) << "0 is white";
  EXPECT_EQ(first(DicomBytes().set(0x00280103, "US", DicomBytes::word(1))), 1000 + 2048)
      << "two's complement of 12 bits";
  std::string pixels;
  for (int i = 0; i < 24; ++i) pixels += DicomBytes::word(0xF000 | (i + 5) << 2 | 3);  // Other things around 10 bits.
  const DicomBytes high = DicomBytes().set(0x00280101, "US", DicomBytes::word(10)).set(0x7FE00010, "OW", pixels);
  EXPECT_EQ(first(high), 5) << "high bit 11, ten stored";
}

TEST(DicomPixels, FramesOfAFileUseTheirTypesWholeRange) {
  const TemporaryFolder folder;
  const XrayFrames frames(folder.write("a.dcm", DicomBytes().file()));
  EXPECT_EQ(frames.count(), 2);
  EXPECT_EQ(frames.frame(1).at<std::uint16_t>(0, 0), 1103 << 4) << "12 bits of 16, mirrored for the camera";
  EXPECT_THAT(refusalOf([&] { frames.frame(2); }), HasSubstr("a.dcm: frame = 2: must lie between 0 and 1"));
  EXPECT_THAT(refusalOf([&] { frames.frame(-1); }), HasSubstr("frame = -1"));
}

TEST(DicomPixels, WhatThePixelsDoNotHoldIsRefused) {
  const auto refused = [](std::uint32_t tag, const std::string& vr, const std::string& value) {
    return refusalOf([&] { made(DicomBytes().set(tag, vr, value)); });
  };
  const auto word = DicomBytes::word;
  EXPECT_THAT(refused(0x00280008, "IS", "3"),
              HasSubstr("(0028,0008) Number of Frames = 3: the pixel data hold only 2 of"));
  EXPECT_THAT(refused(0x00280008, "IS", "2147483647"), HasSubstr("Number of Frames = 2.147"));
  EXPECT_THAT(refused(0x00280008, "IS", "-1"), HasSubstr("Number of Frames = -1: must lie between"));
  EXPECT_THAT(refused(0x00280010, "US", word(0)), HasSubstr("(0028,0010) Rows = 0: must lie between 1 and 8192"));
  EXPECT_THAT(refused(0x00280011, "US", word(65535)), HasSubstr("(0028,0011) Columns = 65535: must lie between"));
  EXPECT_THAT(refused(0x00280010, "US", word(8000)), HasSubstr("the pixel data hold only 0"));
  EXPECT_THAT(refused(0x00280100, "US", word(32)), HasSubstr("(0028,0100) Bits Allocated = 32"));
  EXPECT_THAT(refused(0x00280101, "US", word(17)), HasSubstr("(0028,0101) Bits Stored = 17"));
  EXPECT_THAT(refused(0x00280102, "US", word(16)), HasSubstr("(0028,0102) High Bit = 16"));
  EXPECT_THAT(refused(0x00280002, "US", word(3)), HasSubstr("(0028,0002) Samples per Pixel = 3"));
  EXPECT_THAT(refused(0x00280004, "CS", "RGB"), HasSubstr("(0028,0004) Photometric Interpretation = RGB"));
  EXPECT_THAT(refused(0x00080060, "CS", "CT"), HasSubstr("(0008,0060) Modality = CT: must be XA"));
  EXPECT_THAT(refused(0x00181110, "DS", "nan"), HasSubstr("(0018,1110) Distance Source to Detector = nan"));
  EXPECT_THAT(refused(0x00181510, "DS", "LAO"),
              HasSubstr("(0018,1510) Positioner Primary Angle = LAO: must be a number"));
  EXPECT_THAT(refusalOf([&] { made(DicomBytes().remove(0x7FE00010)); }),
              HasSubstr("(7fe0,0010) Pixel Data: is missing"));
  EXPECT_THAT(refusalOf([&] { made(DicomBytes().remove(0x00280010)); }), HasSubstr("(0028,0010) Rows: is missing"));
}

}  // namespace
}  // namespace angio::test
