// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/igtl/igtl_messages.hpp"

#include <igtlImageMessage.h>
#include <igtlPolyDataMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>
#include <igtl_util.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "igtl_bytes.hpp"

namespace angio::igtl {
namespace {

constexpr double kUnknownDistance_m = 1;
constexpr std::uint16_t kUsAscii = 3;  // IANA's number.

// What the library packed, without its header.
template <typename Message>
std::string contentOf(Message& message) {
  message.Pack();
  const char* packed = static_cast<const char*>(message.GetPackPointer());
  return {packed + IgtlHeader::kBytes, packed + message.GetPackSize()};
}

void copyTo(::igtl::Matrix4x4& to, const Eigen::Matrix4d& from) {
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) to[r][c] = static_cast<float>(from(r, c));
  }
}

// Behind the content of a message of header version 2, and what stands before it.
std::string extended(const IgtlMessage& message) {
  std::string index, values, head;
  putBig(index, static_cast<std::uint16_t>(message.metadata.size()));
  for (const auto& [key, value] : message.metadata) {
    putBig(index, static_cast<std::uint16_t>(key.size()));
    putBig(index, kUsAscii);
    putBig(index, static_cast<std::uint32_t>(value.size()));
    values += key + value;
  }
  putBig(head, kExtendedHead_bytes);
  putBig(head, static_cast<std::uint16_t>(index.size()));
  putBig(head, static_cast<std::uint32_t>(values.size()));
  putBig(head, std::uint32_t{0});  // Nobody asked for it by a number.
  return head + message.content + index + values;
}

std::string padded(const std::string& text, std::size_t bytes) {
  std::string field = text.substr(0, bytes);
  field.resize(bytes, '\0');
  return field;
}

}  // namespace

Eigen::Matrix4d rasMatrix(const Pose& T_lps) {
  const Eigen::Vector4d turn(-1, -1, 1, 1);
  Eigen::Matrix4d ras = turn.asDiagonal() * T_lps.matrix() * turn.asDiagonal();
  ras.topRightCorner<3, 1>() *= 1e3;
  return ras;
}

std::string bytesOf(const IgtlMessage& message, HeaderVersion version, std::int64_t time_us) {
  const std::string body = version == HeaderVersion::k2 ? extended(message) : message.content;
  std::string bytes;
  putBig(bytes, static_cast<std::uint16_t>(version));
  bytes += padded(message.type, kType_bytes) + padded(message.device, kDevice_bytes);
  putBig(bytes, static_cast<std::uint32_t>(time_us / 1'000'000));
  putBig(bytes, static_cast<std::uint32_t>(((time_us % 1'000'000) << 32) / 1'000'000));  // Of 2^-32 s.
  putBig(bytes, std::uint64_t{body.size()});
  putBig(bytes, crcOf(body));
  return bytes + body;
}

IgtlMessage transformMessage(const std::string& device, const Pose& T) {
  auto message = ::igtl::TransformMessage::New();
  ::igtl::Matrix4x4 matrix;
  copyTo(matrix, rasMatrix(T));
  message->SetMatrix(matrix);
  return {"TRANSFORM", device, contentOf(*message), {}};
}

IgtlMessage imageMessage(const std::string& device, const cv::Mat& image, const XrayCamera& camera,
                         const Pose& T_world_camera) {
  if (image.type() != CV_8UC1 && image.type() != CV_16UC1) throw std::invalid_argument("must be an X-ray frame");
  const auto& p = camera.parameters();
  const double depth_m = p.source_detector_distance_m.value_or(kUnknownDistance_m);
  const Eigen::Vector2d middle_px(0.5 * (image.cols - 1), 0.5 * (image.rows - 1));
  // The matrix has the image's axes and its middle.
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = Eigen::Vector3d(-1, -1, 1).asDiagonal() * T_world_camera.linear();
  matrix.topRightCorner<3, 1>() = 1e3 * (Eigen::Vector3d(-1, -1, 1).asDiagonal() *
                                         (T_world_camera * Eigen::Vector3d(depth_m * camera.ray(middle_px))));
  auto message = ::igtl::ImageMessage::New();
  message->SetDimensions(image.cols, image.rows, 1);
  message->SetSubVolume(image.cols, image.rows, 1, 0, 0, 0);
  message->SetSpacing(static_cast<float>(1e3 * depth_m / p.fx_px), static_cast<float>(1e3 * depth_m / p.fy_px), 1.0F);
  message->SetNumComponents(1);
  message->SetEndian(::igtl::ImageMessage::ENDIAN_LITTLE);
  message->SetCoordinateSystem(::igtl::ImageMessage::COORDINATE_RAS);
  image.depth() == CV_8U ? message->SetScalarTypeToUint8() : message->SetScalarTypeToUint16();
  ::igtl::Matrix4x4 axes;
  copyTo(axes, matrix);
  message->SetMatrix(axes);
  message->AllocateScalars();
  auto* pixels = static_cast<char*>(message->GetScalarPointer());
  const std::size_t row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
  for (int y = 0; y < image.rows; ++y)
    std::memcpy(pixels + row_bytes * static_cast<std::size_t>(y), image.ptr(y), row_bytes);
  return {"IMAGE", device, contentOf(*message), {}};
}

IgtlMessage treeMessage(const std::string& device, const VesselTree& tree, const Eigen::Matrix3Xd& displacements_m) {
  if (displacements_m.size() > 0 && displacements_m.cols() != tree.size()) {
    throw std::invalid_argument("a displacement for each point of the tree");
  }
  auto points = ::igtl::PolyDataPointArray::New();
  auto lines = ::igtl::PolyDataCellArray::New();
  auto radii = ::igtl::PolyDataAttribute::New();
  radii->SetType(::igtl::PolyDataAttribute::POINT_SCALAR);
  radii->SetName("Radius");
  radii->SetSize(static_cast<igtlUint32>(tree.size()));
  bool all_known = true;
  for (int i = 0; i < tree.size(); ++i) {
    Eigen::Vector3d p = tree.points().col(i);
    if (displacements_m.size() > 0) p += displacements_m.col(i);
    const Eigen::Vector3f ras_mm = (1e3 * Eigen::Vector3d(-p.x(), -p.y(), p.z())).cast<float>();
    points->AddPoint(ras_mm.x(), ras_mm.y(), ras_mm.z());
    const auto radius_m = tree.radii().empty() ? std::nullopt : tree.radii()[static_cast<std::size_t>(i)];
    all_known &= radius_m.has_value();
    igtlFloat32 radius_mm = static_cast<igtlFloat32>(1e3 * radius_m.value_or(0));
    radii->SetNthData(static_cast<unsigned>(i), &radius_mm);
  }
  for (const auto& branch : tree.branches()) {
    std::list<igtlUint32> line(branch.begin(), branch.end());
    lines->AddCell(line);
  }
  auto message = ::igtl::PolyDataMessage::New();
  message->SetPoints(points);
  message->SetLines(lines);
  if (all_known) message->AddAttribute(radii);
  return {"POLYDATA", device, contentOf(*message), {}};
}

IgtlMessage statusMessage(const std::string& device, IgtlStatus status, const std::string& name,
                          const std::string& text) {
  auto message = ::igtl::StatusMessage::New();
  message->SetCode(static_cast<int>(status));
  message->SetSubCode(0);
  message->SetErrorName(name.c_str());
  message->SetStatusString(text.c_str());
  return {"STATUS", device, contentOf(*message), {}};
}

IgtlMessage stringMessage(const std::string& device, const std::string& text) {
  auto message = ::igtl::StringMessage::New();
  message->SetString(text.c_str());
  return {"STRING", device, contentOf(*message), {}};
}

}  // namespace angio::igtl
