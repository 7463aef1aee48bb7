// SPDX-License-Identifier: GPL-2.0-or-later
// Broken and hostile DICOM files: a run or one InputError of one line, nothing printed, no memory by what a file says.
#include <gmock/gmock.h>

#include <algorithm>

#include "angio/io/image_files.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/test/text.hpp"
#include "dicom_bytes.hpp"

namespace angio::test {
namespace {

using test::contentOf;
using test::DicomBytes;
using test::refusalOf;
using testing::HasSubstr;
using testing::Not;

std::string realRun() { return contentOf(test::exampleData("static-phantom/dicom/im5.dcm")); }

// Reads all that can be read; how many are refused.
class Attempts {
 public:
  Attempts() {
    testing::internal::CaptureStderr();
    testing::internal::CaptureStdout();
  }
  ~Attempts() {
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  }

  void operator()(const std::string& content) {
    try {
      const XaRun run("hostile.dcm", content);
      for (int frame = 0; frame < std::min(run.frames(), 3); ++frame) run.image(frame);
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("hostile.dcm"), Not(HasSubstr("\n"))));
      ++refused_;
    }
  }

  int refused() const { return refused_; }

 private:
  int refused_ = 0;
};

TEST(HostileDicom, FilesThatEndTooEarlyAreRefused) {
  const std::string small = DicomBytes().file(), real = realRun();
  Attempts attempt;
  for (std::size_t length = 0; length < small.size(); ++length) attempt(small.substr(0, length));
  EXPECT_EQ(attempt.refused(), static_cast<int>(small.size())) << "nothing behind is left out unseen";
  int cuts = 0;
  for (std::size_t length = 0; length < 3000; length += 7, ++cuts) attempt(real.substr(0, length));
  for (std::size_t length = 3000; length < real.size(); length += 9973, ++cuts) attempt(real.substr(0, length));
  EXPECT_EQ(attempt.refused(), static_cast<int>(small.size()) + cuts);
}

TEST(HostileDicom, ChangedBytesAreReadOrRefusedInSilence) {
  const std::string small = DicomBytes().file(), real = realRun();
  Attempts attempt;
  unsigned random = 1;
  const auto changed = [&](const std::string& good, std::size_t from, std::size_t to) {
    std::string bad = good;
    random = random * 1664525U + 1013904223U;
    bad[from + (random >> 8) % (to - from)] ^= static_cast<char>(1U << (random >> 5) % 8);
    return bad;
  };
  for (int trial = 0; trial < 4000; ++trial) attempt(changed(small, 128, small.size()));
  for (int trial = 0; trial < 200; ++trial) attempt(changed(real, 128, 3000));
  for (int trial = 0; trial < 100; ++trial) attempt(changed(real, 3000, real.size()));
  for (int trial = 0; trial < 100; ++trial)
    attempt(changed(real, real.size() - 213000, real.size() - 212300));  // JPEG heads.
  EXPECT_GT(attempt.refused(), 500);
}

// The file with one place of it changed.
std::string refused(const std::string& content) {
  return refusalOf([&] { XaRun("a.dcm", content); });
}

TEST(HostileDicom, LengthsAreCheckedBeforeMemoryIsTaken) {
  const std::string good = DicomBytes().file();
  const std::string pixels = DicomBytes::word(0x7FE0) + DicomBytes::word(0x0010) + "OW" + DicomBytes::word(0);
  EXPECT_THAT(refused(with(good, pixels + DicomBytes::longWord(48), pixels + DicomBytes::longWord(0xFFFFFFF0))),
              HasSubstr("a length is wrong"));
  EXPECT_THAT(refused(with(good, pixels + DicomBytes::longWord(48), pixels + DicomBytes::longWord(0xFFFFFFFF))),
              HasSubstr("a.dcm: byte = "));
  EXPECT_THAT(refused(DicomBytes().set(0x00081199, "UN", "x").file() + DicomBytes::word(8)), HasSubstr("too early"));
  // The data set said to begin elsewhere than behind the meta group.
  const std::string meta = DicomBytes::word(2) + DicomBytes::word(0) + "UL" + DicomBytes::word(4);
  std::string moved = good;
  moved[good.find(meta) + meta.size()] ^= 2;
  EXPECT_THAT(refused(moved), HasSubstr("the meta group's length is wrong"));
}

TEST(HostileDicom, DeepAndWideFilesAreRefused) {
  const std::string open_sequence = DicomBytes::word(0x0008) + DicomBytes::word(0x1111) + "SQ" + DicomBytes::word(0) +
                                    DicomBytes::longWord(0xFFFFFFFF) + DicomBytes::word(0xFFFE) +
                                    DicomBytes::word(0xE000) + DicomBytes::longWord(0xFFFFFFFF);
  std::string head = DicomBytes().file();
  head.resize(head.size() - DicomBytes().elements().size());
  std::string deep = head, wide = head;
  for (int i = 0; i < 100000; ++i) deep += open_sequence;
  EXPECT_THAT(refused(deep), HasSubstr("must not be nested so deeply"));
  for (int i = 0; i < 100000; ++i) wide += DicomBytes::encoded(0x00181110, "DS", "", true);
  EXPECT_THAT(refused(wide), HasSubstr("must not have so many elements in one item"));
}

TEST(HostileDicom, OtherSyntaxesAndFilesAreNamed) {
  EXPECT_THAT(refused(""), HasSubstr("must be a DICOM file"));
  EXPECT_THAT(refused(std::string(1000, 'x')), HasSubstr("must be a DICOM file"));
  EXPECT_THAT(refused(DicomBytes().syntax("1.2.840.10008.1.2.1.99").file()),
              HasSubstr("(0002,0010) Transfer Syntax UID = 1.2.840.10008.1.2.1.99: must be"));
  EXPECT_THAT(refused(DicomBytes().syntax("1.2.840.10008.1.2.4.90").file()), HasSubstr("1.2.840.10008.1.2.4.90"));
  EXPECT_THAT(refused(DicomBytes().syntax("1.2.840.10008.1.2.4.70").file()),
              HasSubstr("a.dcm: is not a readable DICOM file: Pixel data"));
  EXPECT_THAT(refused(DicomBytes().syntax("1.2.840.10008.1.2.2").file()), HasSubstr("a.dcm: byte = "));
}

TEST(HostileDicom, AJpegThatIsNotWhatTheFileSaysIsRefused) {
  const std::string real = realRun();
  const std::string size = {'\0', '\x0b', '\x08', '\x02',
                            '\0', '\x02', '\0',   '\x01'};  // 8 bits, 512 x 512, one channel.
  ASSERT_NE(real.find(size), std::string::npos);
  for (const auto& [at, byte] : std::vector<std::pair<std::size_t, char>>{{2, 12}, {3, 127}, {5, 127}, {7, 3}}) {
    std::string other = size;
    other[at] = byte;
    EXPECT_THAT(refused(with(real, size, other)), HasSubstr("must be a grey JPEG image as the attributes say it"));
  }
  EXPECT_THAT(refused(with(real, '\xff' + std::string("\xc3") + size, '\xff' + std::string("\xc2") + size)),
              HasSubstr("must be a grey JPEG image"))
      << "progressive";
}

}  // namespace
}  // namespace angio::test
