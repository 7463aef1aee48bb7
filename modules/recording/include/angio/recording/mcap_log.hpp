// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "angio/geometry/carm.hpp"
#include "angio/mcap/records.hpp"
#include "angio/mcap/writer.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/log_sink.hpp"
#include "angio/recording/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::recording {

/// What was registered, and how machine and patient stand to each other by calibration: what a 3D view of a run needs
/// beside its messages.
struct RecordedScene {
  VesselTree tree;
  CArmGeometry carm;
  Pose T_dsa_cb = Pose::Identity();  ///< The tree's frame in the patient frame.
};

/// An MCAP file of a run of the bus. Each message stands in it as often as it is read:
///
/// - as LCM's bytes, on a topic that is the bus's channel, with the encoding `lcm`: a replay's;
/// - as JSON with the fields of its .lcm type, on `/angio/CHANNEL`, with a JSON schema, when it is one of AnyMessage;
/// - as Foxglove's well-known schemas in JSON, where a picture can be made of it: `/camera/image` (CompressedImage, 8
///   bit, JPEG, to look at), `/camera/calibration` (CameraCalibration), `/tf` (FrameTransforms), `/tree` and
///   `/tree/projected` (SceneUpdate), `/camera/annotations` (ImageAnnotations), `/registration/pose` and
///   `/catheter/tip` (PosesInFrame), `/log` (Log).
///
/// Times are those at which messages were written down; what is said of a frame has the frame's. Frames: `patient` is
/// the root, with `iso`, `camera` and `calibrated` under it and `model` under `camera`; lengths are metres.
///
/// Chunks are written as they fill: a recording that is cut holds all chunks before.
class McapLog final : public LogSink {
 public:
  /// Replaces a file. Without a scene there are no tree and no transforms. Throws InputError that names the file when
  /// it cannot be written, or is written by another program.
  McapLog(const std::string& path, std::optional<RecordedScene> scene, std::vector<mcap::Attachment> attachments,
          mcap::WriterSettings settings = {});
  McapLog(const McapLog&) = delete;
  McapLog& operator=(const McapLog&) = delete;
  ~McapLog() override;

  /// Images are packed by a thread of its own.
  void write(const std::string& channel, const std::uint8_t* data, std::size_t size) override;

  /// Appends a message of another log at once, with its number and time. Not together with the other. Throws InputError
  /// when MCAP cannot hold them: a time before 1970 or behind 2554, or a number of more than 32 bits.
  void write(const LogEvent& event);

  [[nodiscard]] std::optional<std::string> finish() override;
  const std::optional<std::string>& failure() const override;

 private:
  struct State;
  void record(const LogEvent& event);
  std::optional<std::string> tryRecord(const LogEvent& event);
  void recordWaiting();
  std::unique_ptr<State> state_;
};

}  // namespace angio::recording
