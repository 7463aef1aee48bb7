// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cstring>

#include "angio/base/big_endian.hpp"
#include "angio/base/formatted.hpp"
#include "angio/igtl/igtl_messages.hpp"
#include "igtl_bytes.hpp"

namespace angio::igtl {
namespace {

// Floats have 7 digits, and people turn transforms by hand.
constexpr double kMaxDefect = 1e-4;
constexpr double kFarthest_m = 10;
constexpr std::size_t kTransform_bytes = 48, kStringHead_bytes = 4;

std::string fieldText(std::string_view field) {
  std::string text(field.substr(0, field.find('\0')));
  for (char& c : text) {
    if (c < 0x20 || c > 0x7e) c = '?';
  }
  return text;
}

// What lies between the extended head and the metadata; nothing when their sizes lie.
std::optional<std::string_view> contentIn(std::uint16_t version, std::string_view body) {
  if (version == static_cast<std::uint16_t>(HeaderVersion::k1)) return body;
  if (body.size() < kExtendedHead_bytes) return std::nullopt;
  const std::uint64_t head = bigEndian<std::uint16_t>(body.data());
  const std::uint64_t behind =
      std::uint64_t{bigEndian<std::uint16_t>(body.data() + 2)} + bigEndian<std::uint32_t>(body.data() + 4);
  if (head < kExtendedHead_bytes || head + behind > body.size()) return std::nullopt;
  return body.substr(static_cast<std::size_t>(head), body.size() - static_cast<std::size_t>(head + behind));
}

std::variant<Received, std::string> readTransform(const IgtlHeader& header, std::string_view content) {
  if (content.size() != kTransform_bytes) return "TRANSFORM: must have 12 numbers";
  // Columns of the rotation, then the translation.
  Eigen::Matrix<double, 3, 4> ras;
  for (int i = 0; i < 12; ++i) ras(i % 3, i / 3) = bigEndian<float>(content.data() + 4 * i);
  const Eigen::Matrix3d R = ras.leftCols<3>();
  if (!ras.allFinite() || !(rotationDefect(R) < kMaxDefect)) return "TRANSFORM: must be a rotation and a shift";
  const Eigen::Vector3d t_m = 1e-3 * ras.col(3);
  if (!(t_m.norm() < kFarthest_m)) return "TRANSFORM: must be a shift of less than 10 m";
  const Eigen::DiagonalMatrix<double, 3> turn(-1, -1, 1);
  ReceivedTransform received{header.device, Pose::Identity()};
  received.T.linear() = nearestRotation(turn * R * turn);
  received.T.translation() = turn * t_m;
  return received;
}

std::variant<Received, std::string> readString(const IgtlHeader& header, std::string_view content) {
  if (content.size() < kStringHead_bytes ||
      bigEndian<std::uint16_t>(content.data() + 2) != content.size() - kStringHead_bytes) {
    return "STRING: its length is not the number of its characters";
  }
  const std::string_view text = content.substr(kStringHead_bytes);
  const bool printable = std::all_of(text.begin(), text.end(), [](char c) { return c >= 0x20 && c <= 0x7e; });
  if (!printable) return "STRING: must be printable ASCII";
  return ReceivedString{header.device, std::string(text)};
}

}  // namespace

std::optional<IgtlHeader> readHeader(std::string_view bytes) {
  if (bytes.size() < IgtlHeader::kBytes) return std::nullopt;
  IgtlHeader header;
  header.version = bigEndian<std::uint16_t>(bytes.data());
  if (header.version != static_cast<std::uint16_t>(HeaderVersion::k1) &&
      header.version != static_cast<std::uint16_t>(HeaderVersion::k2)) {
    return std::nullopt;
  }
  header.type = fieldText(bytes.substr(2, kType_bytes));
  header.device = fieldText(bytes.substr(2 + kType_bytes, kDevice_bytes));
  header.body_bytes = bigEndian<std::uint64_t>(bytes.data() + 42);
  header.crc = bigEndian<std::uint64_t>(bytes.data() + 50);
  return header;
}

bool isHeard(const IgtlHeader& header) { return header.type == "TRANSFORM" || header.type == "STRING"; }

std::variant<Received, std::string> readBody(const IgtlHeader& header, std::string_view body) {
  if (body.size() != header.body_bytes) return "its body is not as long as its header says";
  if (crcOf(body) != header.crc) return header.type + ": its CRC is wrong";
  const auto content = contentIn(header.version, body);
  if (!content) return header.type + ": the sizes of its extended header are wrong";
  if (header.type == "TRANSFORM") return readTransform(header, *content);
  if (header.type == "STRING") return readString(header, *content);
  return header.type + ": is not heard";
}

}  // namespace angio::igtl
