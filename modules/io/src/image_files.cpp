// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/image_files.hpp"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "angio/base/errors.hpp"
#include "angio/imaging/png.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xa_files.hpp"
#include "dicom_pixels.hpp"
#include "jpeg_format.hpp"
#include "tiff_format.hpp"

namespace angio::io {
namespace {

enum class Kind { kPng, kTiff, kJpeg, kDicom };

Kind kindOf(const std::string& path, const std::string& content) {
  using namespace std::string_view_literals;
  const auto starts = [&](std::string_view start) { return content.compare(0, start.size(), start) == 0; };
  if (starts("\x89PNG\r\n\x1a\n"sv)) return Kind::kPng;
  for (const auto start : {"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv}) {
    if (starts(start)) return Kind::kTiff;
  }
  if (starts("\xff\xd8\xff"sv)) return Kind::kJpeg;
  if (startsAsDicom(content)) return Kind::kDicom;
  throw InputError(path, "", "", "must be a PNG, TIFF, JPEG or DICOM image");
}

cv::Mat asGrey(const std::string& path, const cv::Mat& image) {
  if (image.channels() == 1) return image;
  cv::Mat grey, other;
  cv::extractChannel(image, grey, 0);
  for (int channel = 1; channel < image.channels(); ++channel) {
    cv::extractChannel(image, other, channel);
    if (cv::norm(grey, other, cv::NORM_INF) > 0) {
      throw InputError(path, "channels", std::to_string(image.channels()), "must be one, or all equal: no colours");
    }
  }
  return grey;
}

std::string writtenExtension(const std::string& path) {
  const std::string extension = extensionOf(path);
  for (const char* known : {".png", ".tif", ".tiff", ".jpg", ".jpeg"}) {
    if (extension == known) return extension;
  }
  throw InputError(path, "extension", extension, "must be .png, .tif, .tiff, .jpg or .jpeg");
}

}  // namespace

struct XrayFrames::Source {
  explicit Source(const std::string& file) : path(file), content(readWholeFile(file)), kind(kindOf(path, content)) {
    if (kind == Kind::kDicom) {
      run.emplace(path, std::move(content));
      count = run->frames();
    } else if (kind == Kind::kTiff) {
      count = countTiffPages(path, content);
    }
  }

  std::string path;
  std::string content;
  Kind kind;
  std::optional<XaRun> run;  // Instead of the content.
  int count = 1;
};

XrayFrames::XrayFrames(const std::string& path) : source_(std::make_unique<Source>(path)) {}
XrayFrames::XrayFrames(XrayFrames&&) noexcept = default;
XrayFrames& XrayFrames::operator=(XrayFrames&&) noexcept = default;
XrayFrames::~XrayFrames() = default;

int XrayFrames::count() const { return source_->count; }

cv::Mat XrayFrames::frame(int number) const {
  const Source& s = *source_;
  requireBetween(s.path, "frame", number, 0, s.count - 1);
  if (s.kind == Kind::kPng) return asGrey(s.path, decodePng(s.path, s.content));
  if (s.kind == Kind::kTiff) return asGrey(s.path, decodeTiff(s.path, s.content, number));
  if (s.kind == Kind::kJpeg) return decodeJpeg(s.path, s.content);
  // Image methods take a type's full range for granted where they turn bright vessels dark.
  const XaHeader& header = s.run->header();
  cv::Mat image = s.run->image(number);
  if (header.bits_stored < header.bits_allocated) {
    image *= static_cast<double>(1 << (header.bits_allocated - header.bits_stored));
  }
  return image;
}

cv::Mat readXrayImage(const std::string& path, int frame) { return XrayFrames(path).frame(frame); }

cv::Mat readXrayImage(const std::string& path, const XrayCamera& camera, int frame) {
  cv::Mat image = readXrayImage(path, frame);
  if (image.cols != camera.width_px() || image.rows != camera.height_px()) {
    throw InputError(path, "size", std::to_string(image.cols) + " x " + std::to_string(image.rows),
                     "must be the camera's image_size_px");
  }
  return image;
}

void requireImagePath(const std::string& path) {
  if (path.empty()) return;
  writtenExtension(path);
  requireFolderOf(path);
}

void writeImage(const std::string& path, const cv::Mat& image) {
  const std::string extension = writtenExtension(path);
  const bool jpeg = extension == ".jpg" || extension == ".jpeg";
  const bool deep = !image.empty() && image.type() == CV_16UC1;
  if (image.empty() || !(image.type() == CV_8UC1 || image.type() == CV_8UC3 || (deep && !jpeg))) {
    throw InputError(path, "image", image.empty() ? "empty" : cv::typeToString(image.type()),
                     jpeg ? "must be CV_8UC1 or CV_8UC3" : "must be CV_8UC1, CV_8UC3 or CV_16UC1");
  }
  std::vector<unsigned char> bytes;
  bool encoded = false;
  try {
    encoded = cv::imencode(extension, image, bytes);
  } catch (const cv::Exception&) {
    encoded = false;
  }
  if (!encoded) throw InputError(path, "", "", "the image cannot be encoded");
  writeWholeFile(path, std::string(bytes.begin(), bytes.end()));
}

void writeImageSequence(const std::string& path, const std::vector<cv::Mat>& frames) {
  const std::string extension = extensionOf(path);
  if (extension != ".tif" && extension != ".tiff") {
    throw InputError(path, "extension", extension, "must be .tif or .tiff");
  }
  if (frames.empty() || frames.size() > static_cast<std::size_t>(kMaxPages)) {
    throw InputError(path, "frames", std::to_string(frames.size()), "must be 1 to " + std::to_string(kMaxPages));
  }
  for (const cv::Mat& frame : frames) {
    const bool grey = !frame.empty() && (frame.type() == CV_8UC1 || frame.type() == CV_16UC1);
    if (!grey || frame.type() != frames.front().type() || frame.size() != frames.front().size()) {
      throw InputError(path, "frame", std::to_string(&frame - frames.data()),
                       "must be CV_8UC1 or CV_16UC1, and of the type and size of the first");
    }
  }
  writeWholeFile(path, encodeTiff(path, frames, kMaxFile));
}

}  // namespace angio::io
