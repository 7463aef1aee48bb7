// SPDX-License-Identifier: GPL-2.0-or-later
#include "dicom_pixels.hpp"

#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmjpeg/djdecode.h>

#include <opencv2/core.hpp>

namespace angio::io {
namespace {

constexpr DicomTag kSamples{0x0028, 0x0002, "Samples per Pixel"};
constexpr DicomTag kPhotometric{0x0028, 0x0004, "Photometric Interpretation"};
constexpr DicomTag kFrames{0x0028, 0x0008, "Number of Frames"};
constexpr DicomTag kRows{0x0028, 0x0010, "Rows"};
constexpr DicomTag kColumns{0x0028, 0x0011, "Columns"};
constexpr DicomTag kBitsAllocated{0x0028, 0x0100, "Bits Allocated"};
constexpr DicomTag kBitsStored{0x0028, 0x0101, "Bits Stored"};
constexpr DicomTag kHighBit{0x0028, 0x0102, "High Bit"};
constexpr DicomTag kSigned{0x0028, 0x0103, "Pixel Representation"};
constexpr DicomTag kPixelData{0x7FE0, 0x0010, "Pixel Data"};

// The processes of JPEG that are decoded; a progressive image can be made to take very long.
enum class JpegCoding { kSequential, kLossless, kOther };

// What the frame header of a JPEG image says.
struct JpegFrame {
  int width_px = 0;
  int height_px = 0;
  int bits = 0;
  int channels = 0;
  JpegCoding coding = JpegCoding::kOther;

  // "JPEG 512 x 512, 8 bit, 1 channel".
  std::string formatValue() const {
    return "JPEG " + std::to_string(width_px) + " x " + std::to_string(height_px) + ", " + std::to_string(bits) +
           " bit, " + std::to_string(channels) + (channels == 1 ? " channel" : " channels");
  }
};

// ISO 10918-1, table B.1: C0 to CF are frame headers but for the tables C4 and CC and the reserved C8.
bool isFrameHeader(unsigned marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

JpegCoding codingOf(unsigned marker) {
  if (marker == 0xC0 || marker == 0xC1) return JpegCoding::kSequential;
  return marker == 0xC3 ? JpegCoding::kLossless : JpegCoding::kOther;
}

// The first frame header behind a start of image; nothing when the bytes do not begin an image. A header that is not
// there before the bytes end gives an image of no size.
std::optional<JpegFrame> readJpegFrame(const unsigned char* bytes, std::size_t size) {
  if (size < 4 || bytes[0] != 0xFF || bytes[1] != 0xD8) return std::nullopt;
  const auto word = [&](std::size_t at) { return bytes[at] << 8 | bytes[at + 1]; };
  std::size_t at = 2;
  while (at + 4 <= size && bytes[at] == 0xFF) {
    const unsigned marker = bytes[at + 1];
    if (marker == 0xFF) {  // Filling.
      ++at;
      continue;
    }
    if (isFrameHeader(marker) && at + 10 <= size) {
      return JpegFrame{word(at + 7), word(at + 5), bytes[at + 4], bytes[at + 9], codingOf(marker)};
    }
    at += 2 + static_cast<std::size_t>(word(at + 2));
  }
  return JpegFrame{};
}

constexpr std::size_t kRunHeaderBytes = 64;

std::size_t headerWord(const std::uint8_t* packed, std::size_t index) {
  const std::uint8_t* b = packed + 4 * index;
  return b[0] | static_cast<std::size_t>(b[1]) << 8 | static_cast<std::size_t>(b[2]) << 16 |
         static_cast<std::size_t>(b[3]) << 24;
}

// One byte of every sample, from `at` up to `end`; written every `stride` bytes.
bool unpackSegment(const std::uint8_t* packed, std::size_t at, std::size_t end, std::size_t samples, std::size_t stride,
                   std::uint8_t* to) {
  std::size_t done = 0;
  while (done < samples) {
    if (at >= end) return false;
    const unsigned code = packed[at++];
    if (code == 128) continue;  // No operation.
    const bool literal = code < 128;
    const std::size_t count = literal ? code + 1 : 257 - code;
    if (count > samples - done || (literal ? count : 1) > end - at) return false;
    for (std::size_t i = 0; i < count; ++i) to[stride * (done + i)] = packed[literal ? at + i : at];
    at += literal ? count : 1;
    done += count;
  }
  return true;
}

// Unpacks one frame of DICOM's run lengths (PS3.5 annex G) into `samples` samples of `bytes_per_sample` bytes, 1 or 2,
// little endian. False when the packed bytes are no such frame. DCMTK's own decoder trusts the offsets it reads, and
// leaves its buffer when they are wrong.
bool unpackRunLengths(const std::uint8_t* packed, std::size_t size, std::size_t samples, int bytes_per_sample,
                      std::uint8_t* frame) {
  const auto segments = static_cast<std::size_t>(bytes_per_sample);
  if (size < kRunHeaderBytes || headerWord(packed, 0) != segments) return false;
  for (std::size_t s = 0; s < segments; ++s) {
    const std::size_t begin = headerWord(packed, 1 + s), end = s + 1 < segments ? headerWord(packed, 2 + s) : size;
    if (begin < kRunHeaderBytes || begin > end || end > size) return false;
    // The first segment holds the highest bytes.
    if (!unpackSegment(packed, begin, end, samples, segments, frame + (segments - 1 - s))) return false;
  }
  return true;
}

void registerJpeg() {
  static const bool registered = [] {
    DJDecoderRegistration::registerCodecs();
    return true;
  }();
  (void)registered;
}

DcmPixelData& pixelData(const DicomFile& file) {
  DcmElement* element = nullptr;
  auto* pixels =
      file.dataset().findAndGetElement(DCM_PixelData, element).good() ? dynamic_cast<DcmPixelData*>(element) : nullptr;
  if (!pixels) throw file.refusal(kPixelData, "", "is missing");
  return *pixels;
}

std::size_t frameBytes(const DicomPixelLayout& layout) {
  return static_cast<std::size_t>(layout.width_px) * static_cast<std::size_t>(layout.height_px) *
         static_cast<std::size_t>(layout.bits_allocated / 8);
}

DcmPixelSequence& fragmentsOf(const DicomFile& file) {
  DcmPixelSequence* fragments = nullptr;
  E_TransferSyntax syntax = EXS_Unknown;
  const DcmRepresentationParameter* parameter = nullptr;
  DcmPixelData& pixels = pixelData(file);
  pixels.getOriginalRepresentationKey(syntax, parameter);
  if (pixels.getEncapsulatedRepresentation(syntax, parameter, fragments).bad() || !fragments) {
    throw file.refusal(kPixelData, "", "must be compressed, as the transfer syntax says");
  }
  return *fragments;
}

struct Fragment {
  const Uint8* bytes = nullptr;
  std::size_t size = 0;
};

Fragment fragmentAt(const DicomFile& file, DcmPixelSequence& fragments, unsigned index) {
  DcmPixelItem* item = nullptr;
  Uint8* bytes = nullptr;
  if (fragments.getItem(item, index).bad() || item->getUint8Array(bytes).bad()) {
    throw file.refusal(kPixelData, "", "has a fragment that cannot be read");
  }
  return {bytes, bytes ? item->getLength() : 0};
}

// A JPEG frame may be cut into fragments, and begins where a JPEG image does; one by run lengths is whole.
std::vector<unsigned> firstFragments(const DicomFile& file, const DicomPixelLayout& layout) {
  DcmPixelSequence& fragments = fragmentsOf(file);
  std::vector<unsigned> first;
  for (unsigned i = 1; i < fragments.card(); ++i) {  // The first item is a table of offsets.
    if (file.syntax().compression == DicomCompression::kJpeg) {
      const Fragment fragment = fragmentAt(file, fragments, i);
      const auto jpeg = readJpegFrame(fragment.bytes, fragment.size);
      if (!jpeg) continue;
      if (jpeg->width_px != layout.width_px || jpeg->height_px != layout.height_px || jpeg->channels != 1 ||
          jpeg->coding == JpegCoding::kOther || (jpeg->bits > 8) != (layout.bits_allocated > 8)) {
        throw file.refusal(kPixelData, jpeg->formatValue(), "must be a grey JPEG image as the attributes say it");
      }
    }
    first.push_back(i);
  }
  return first;
}

void checkAmount(const DicomFile& file, DicomPixelLayout& layout) {
  std::size_t held = 0;
  if (file.syntax().compression == DicomCompression::kNone) {
    const std::size_t bytes = pixelData(file).getLength();
    if (bytes == DCM_UndefinedLength) throw file.refusal(kPixelData, "", "must not be compressed");
    held = bytes / frameBytes(layout);
  } else {
    layout.first_fragments = firstFragments(file, layout);
    held = layout.first_fragments.size();
    // Without an image's start DCMTK would guess where a frame begins.
    if (held > static_cast<std::size_t>(layout.frames)) {
      throw file.refusal(kFrames, std::to_string(layout.frames), "must be as many as the pixel data hold");
    }
  }
  if (held < static_cast<std::size_t>(layout.frames)) {
    throw file.refusal(kFrames, std::to_string(layout.frames),
                       "the pixel data hold only " + std::to_string(held) + " of " + std::to_string(layout.width_px) +
                           " x " + std::to_string(layout.height_px) + " px");
  }
}

// What is wrong, or nothing.
std::string decode(const DicomFile& file, const DicomPixelLayout& layout, unsigned frame, std::vector<Uint8>& buffer) {
  Uint32 first = layout.first_fragments.empty() ? 0 : layout.first_fragments[frame];
  if (file.syntax().compression == DicomCompression::kRunLength) {
    const Fragment fragment = fragmentAt(file, fragmentsOf(file), first);
    const auto samples = static_cast<std::size_t>(layout.width_px) * static_cast<std::size_t>(layout.height_px);
    const bool good =
        unpackRunLengths(fragment.bytes, fragment.size, samples, layout.bits_allocated / 8, buffer.data());
    return good ? "" : "the run lengths are broken";
  }
  registerJpeg();
  OFString colors;
  const OFCondition decoded = pixelData(file).getUncompressedFrame(&file.dataset(), frame, first, buffer.data(),
                                                                   static_cast<Uint32>(buffer.size()), colors);
  return decoded.good() ? "" : decoded.text();
}

// Stored bits at the bottom of the word, from zero, more is brighter.
cv::Mat greyFrame(const DicomPixelLayout& layout, cv::Mat frame) {
  const int largest = (1 << layout.bits_stored) - 1, shift = layout.high_bit + 1 - layout.bits_stored;
  const int sign = layout.is_signed ? 1 << (layout.bits_stored - 1) : 0;
  const bool turned = layout.photometric == "MONOCHROME1";
  const bool whole = layout.bits_stored == layout.bits_allocated;
  if (whole && !layout.is_signed && !turned) return frame;
  const auto convert = [&](auto* row) {
    for (int c = 0; c < frame.cols; ++c) {
      // Flipping the sign bit of a two's complement adds half the range.
      const int value = ((row[c] >> shift) & largest) ^ sign;
      row[c] = static_cast<std::decay_t<decltype(*row)>>(turned ? largest - value : value);
    }
  };
  for (int r = 0; r < frame.rows; ++r) {
    if (layout.bits_allocated == 8) {
      convert(frame.ptr<std::uint8_t>(r));
    } else {
      convert(frame.ptr<std::uint16_t>(r));
    }
  }
  return frame;
}

}  // namespace

DicomPixelLayout readPixelLayout(const DicomFile& file) {
  DicomPixelLayout layout;
  layout.photometric = file.text(kPhotometric).value_or("");
  if (layout.photometric != "MONOCHROME1" && layout.photometric != "MONOCHROME2") {
    throw file.refusal(kPhotometric, layout.photometric, "must be MONOCHROME1 or MONOCHROME2");
  }
  file.integer(kSamples, 1, 1, 1);
  constexpr int kMaxSide_px = static_cast<int>(kMaxSide);
  layout.height_px = file.integer(kRows, 1, kMaxSide_px);
  layout.width_px = file.integer(kColumns, 1, kMaxSide_px);
  layout.frames = file.integer(kFrames, 1, 1'000'000, 1);
  layout.bits_allocated = file.integer(kBitsAllocated, 8, 16);
  if (layout.bits_allocated % 8 != 0) {
    throw file.refusal(kBitsAllocated, std::to_string(layout.bits_allocated), "must be 8 or 16");
  }
  layout.bits_stored = file.integer(kBitsStored, 1, layout.bits_allocated, layout.bits_allocated);
  layout.high_bit = file.integer(kHighBit, layout.bits_stored - 1, layout.bits_allocated - 1, layout.bits_stored - 1);
  layout.is_signed = file.integer(kSigned, 0, 1, 0) == 1;
  checkAmount(file, layout);
  return layout;
}

cv::Mat decodeDicomFrame(const DicomFile& file, const DicomPixelLayout& layout, int frame) {
  requireBetween(file.path(), "frame", frame, 0, layout.frames - 1);
  std::vector<Uint8> buffer(frameBytes(layout) + frameBytes(layout) % 2);  // DCMTK wants an even number.
  const std::string problem = decode(file, layout, static_cast<unsigned>(frame), buffer);
  if (!problem.empty()) {
    throw file.refusal(kPixelData, "frame " + std::to_string(frame), "cannot be decoded: " + problem);
  }
  const int type = layout.bits_allocated == 8 ? CV_8UC1 : CV_16UC1;
  return greyFrame(layout, cv::Mat(layout.height_px, layout.width_px, type, buffer.data()).clone());
}

}  // namespace angio::io
