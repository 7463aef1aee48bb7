// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/igtl/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::igtl {

/// Layouts of a message's header: 1 is every receiver's; 2, of protocol version 3, has metadata behind the content.
enum class HeaderVersion : std::uint16_t { k1 = 1, k2 = 2 };

/// A message for receivers, its content as the protocol lays it out.
struct IgtlMessage {
  std::string type, device;  ///< "IMAGE", "XrayFrame": up to 12 and 20 characters.
  std::string content;
  std::map<std::string, std::string> metadata;  ///< Told with header version 2 only.
};

/// The bytes of a message as they are sent, with its CRC. @param time_us  Wall clock [us since 1970].
std::string bytesOf(const IgtlMessage& message, HeaderVersion version, std::int64_t time_us);

// Frames outside are R, A, S and millimetres; here they are L, P, S and metres, and what follows turns one into the
// other.

/// Where a frame stands: T_to_from of the frames that the device's name says.
IgtlMessage transformMessage(const std::string& device, const Pose& T);

/// An X-ray frame (CV_8UC1 or CV_16UC1) on its detector: pixels in space, as far from the source as the camera's
/// source-detector distance, or 1 m when that is not known. @param T_world_camera  Of the camera that saw it.
IgtlMessage imageMessage(const std::string& device, const cv::Mat& image, const XrayCamera& camera,
                         const Pose& T_world_camera);

/// A tree as lines, a line for each branch, with its radii [mm] as point data `Radius` where all are known.
/// @param displacements_m  3 x N, or empty.
IgtlMessage treeMessage(const std::string& device, const VesselTree& tree,
                        const Eigen::Matrix3Xd& displacements_m = {});

/// How a device does: OpenIGTLink's codes.
enum class IgtlStatus : std::uint16_t { kOk = 1, kEmergency = 3, kNotReady = 13, kManual = 14, kHardwareFailure = 18 };
IgtlMessage statusMessage(const std::string& device, IgtlStatus status, const std::string& name,
                          const std::string& text);

IgtlMessage stringMessage(const std::string& device, const std::string& text);

/// What comes from a client, read of bytes that may come from anywhere.
struct ReceivedTransform {
  std::string device;
  Pose T = Pose::Identity();  ///< L, P, S, metres.
};
/// Text that comes from a client.
struct ReceivedString {
  std::string device, text;
};
using Received = std::variant<ReceivedTransform, ReceivedString>;

/// The head of a message.
struct IgtlHeader {
  static constexpr std::size_t kBytes = 58;
  std::uint16_t version = 0;
  std::string type, device;
  std::uint64_t body_bytes = 0, crc = 0;
};

/// Reads the first IgtlHeader::kBytes bytes; nothing unless the version is one of HeaderVersion's.
std::optional<IgtlHeader> readHeader(std::string_view bytes);

/// Whether a message of this type is read at all; others are passed over.
bool isHeard(const IgtlHeader& header);

/// A message's body, or one line that says what is wrong with it: CRC, size, a transform that is not rigid, text that
/// is not printable ASCII. Never throws on what it holds.
std::variant<Received, std::string> readBody(const IgtlHeader& header, std::string_view body);

}  // namespace angio::igtl
