// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/xa_files.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <opencv2/core.hpp>

#include "angio/io/whole_file.hpp"
#include "xa_geometry.hpp"
#include "xa_tags.hpp"

namespace angio::io {

struct XaRun::Contents {
  Contents(const std::string& path, std::string content)
      : file(path, std::move(content)),
        layout(readPixelLayout(file)),
        increments(readXaIncrements(file, layout.frames)) {}

  DicomFile file;
  DicomPixelLayout layout;
  XaIncrements increments;
};

namespace {

void checkKind(const DicomFile& file) {
  constexpr std::array<const char*, 3> kKinds = {"XA", "RF", "DX"};
  const auto modality = file.text(tag::kModality);
  if (!modality || std::find(kKinds.begin(), kKinds.end(), *modality) == kKinds.end()) {
    throw file.refusal(tag::kModality, modality.value_or(""), "must be XA, RF or DX: a projection of X-rays");
  }
}

std::optional<double> frameRate(const std::vector<double>& times_ms) {
  const auto first = times_ms.begin() + (times_ms.size() > 1 ? 1 : 0);  // A list begins with the first frame's zero.
  const double total_ms = std::accumulate(first, times_ms.end(), 0.0);
  if (!(total_ms > 0)) return std::nullopt;
  return 1e3 * static_cast<double>(times_ms.end() - first) / total_ms;
}

XaHeader readXaHeader(const DicomFile& file, const DicomPixelLayout& layout, const XaIncrements& increments) {
  XaHeader header;
  static_cast<DicomPixels&>(header) = layout;
  const auto text = [&](const DicomTag& tag) { return file.text(tag).value_or(""); };
  header.modality = text(tag::kModality);
  header.manufacturer = text(tag::kManufacturer);
  header.model = text(tag::kModel);
  header.transfer_syntax = file.syntax().name;
  header.intensity_relationship = text(tag::kIntensityRelationship);
  header.patient_position = text(tag::kPatientPosition);
  header.positioner_motion = text(tag::kPositionerMotion);
  header.table_motion = text(tag::kTableMotion);
  header.frame_rate_hz = frameRate(increments.frame_times_ms);
  header.magnification = file.number(tag::kMagnification);
  return header;
}

XaMask readMask(const DicomFile& file, DcmItem& item, int frames) {
  XaMask mask;
  mask.operation = file.text(tag::kMaskOperation, item).value_or("NONE");
  for (const double number : file.numbers(tag::kMaskFrames, item)) {
    requireBetween(file.path(), tag::kMaskFrames.label(), number, 1, frames);
    mask.mask_frames.push_back(static_cast<int>(number) - 1);  // They count from 1 in a file.
  }
  return mask;
}

}  // namespace

bool isDicom(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;
  std::string beginning(132, '\0');
  std::ifstream(path, std::ios::binary).read(beginning.data(), static_cast<std::streamsize>(beginning.size()));
  return startsAsDicom(beginning);
}

XaRun::XaRun(const std::string& path, XaAngleSigns signs) : XaRun(path, readWholeFile(path), signs) {}

XaRun::XaRun(const std::string& path, std::string content, XaAngleSigns signs)
    : contents_(std::make_unique<Contents>(path, std::move(content))), signs_(signs) {
  const DicomFile& file = contents_->file;
  checkKind(file);
  header_ = readXaHeader(file, contents_->layout, contents_->increments);
  constexpr DicomTag kMaskSequence{0x0028, 0x6100, "Mask Subtraction Sequence"};
  for (DcmItem* item : file.items(kMaskSequence)) masks_.push_back(readMask(file, *item, header_.frames));
  geometry(0);  // A run without a camera is refused here and not at its first frame.
}

XaRun::XaRun(XaRun&&) noexcept = default;
XaRun& XaRun::operator=(XaRun&&) noexcept = default;
XaRun::~XaRun() = default;

XaGeometry XaRun::geometry(int frame) const {
  requireBetween(contents_->file.path(), "frame", frame, 0, frames() - 1);
  return readXaGeometry(contents_->file, contents_->layout, contents_->increments, frame, signs_);
}

cv::Mat XaRun::storedImage(int frame) const { return decodeDicomFrame(contents_->file, contents_->layout, frame); }

cv::Mat XaRun::image(int frame) const {
  const bool mirrored = geometry(frame).stored_mirrored;
  cv::Mat stored = storedImage(frame);
  if (!mirrored) return stored;
  cv::Mat image;
  cv::flip(stored, image, 1);
  return image;
}

}  // namespace angio::io
