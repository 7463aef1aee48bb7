// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/image_files.hpp"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "angio/base/errors.hpp"
#include "angio/io/whole_file.hpp"
#include "extension.hpp"
#include "image_formats.hpp"

namespace angio {
namespace {

bool startsWith(const std::string& content, std::string_view start) {
  return content.compare(0, start.size(), start) == 0;
}

cv::Mat decode(const std::string& path, const std::string& content) {
  using namespace std::string_view_literals;
  if (startsWith(content, "\x89PNG\r\n\x1a\n"sv)) return decodePng(path, content);
  for (const auto start : {"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv}) {
    if (startsWith(content, start)) return decodeTiff(path, content);
  }
  throw InputError(path, "", "", "must be a PNG or TIFF image");
}

}  // namespace

cv::Mat readXrayImage(const std::string& path) {
  cv::Mat image = decode(path, readWholeFile(path));
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

cv::Mat readXrayImage(const std::string& path, const XrayCamera& camera) {
  cv::Mat image = readXrayImage(path);
  if (image.cols != camera.width_px() || image.rows != camera.height_px()) {
    throw InputError(path, "size", std::to_string(image.cols) + " x " + std::to_string(image.rows),
                     "must be the camera's image_size_px");
  }
  return image;
}

void writeImage(const std::string& path, const cv::Mat& image) {
  const std::string extension = extensionOf(path);
  const bool jpeg = extension == ".jpg" || extension == ".jpeg";
  if (!jpeg && extension != ".png" && extension != ".tif" && extension != ".tiff") {
    throw InputError(path, "extension", extension, "must be .png, .tif, .tiff, .jpg or .jpeg");
  }
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

}  // namespace angio
