// SPDX-License-Identifier: GPL-2.0-or-later
#include "inspect_bus.hpp"

#include <chrono>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/perception/frame_geometry.hpp"
#include "angio/perception/state_history.hpp"
#include "angio/results/overlay.hpp"
#include "angio/types/channels.hpp"
#include "angio/types/time_stamp.hpp"

namespace angio::apps {
namespace {

using Clock = std::chrono::steady_clock;

struct Heard {
  std::optional<XrayFrame> frame;
  std::optional<CArmState> newest;  // When the frame came.
  std::optional<CArmState> state;   // Of its exposure.
};

// Keeps the newest frame, and what joints had been heard when it came.
class Ear {
 public:
  explicit Ear(Bus& bus) : frames_(bus, kXrayFrameChannel), joints_(bus, kCArmStateChannel) {}

  void look() {
    if (auto frame = frames_.take()) {
      heard_.frame = std::move(frame);
      heard_.newest = joints_.newest();
    }
    if (heard_.frame) heard_.state = joints_.at(heard_.frame->time_us);
  }

  // Whether the frame can be read with the joints on both sides of its exposure.
  bool complete() const {
    return heard_.frame && joints_.newest() && joints_.newest()->time_us >= heard_.frame->time_us;
  }

  const Heard& heard() const { return heard_; }

 private:
  LatestMessage<XrayFrame> frames_;
  JointHistory joints_;
  Heard heard_;
};

Heard ofLog(const std::string& path) {
  const auto bus = openBus("memq://");
  Ear ear(*bus);
  LogReader log(path);
  for (auto event = log.next(); event; event = log.next()) {
    if (event->channel != kXrayFrameChannel && event->channel != kCArmStateChannel) continue;
    bus->publish(event->channel, event->bytes);
    bus->handle(std::chrono::milliseconds(0));
    ear.look();
  }
  return ear.heard();
}

Heard ofBus(const BusToInspect& o) {
  const auto bus = openSharedBus(o.bus);
  Ear ear(*bus);
  const auto end = Clock::now() + std::chrono::duration<double>(o.wait_s);
  while (!ear.complete() && !bus->ended() && Clock::now() < end) {
    bus->handle(std::chrono::milliseconds(20));
    ear.look();
  }
  return ear.heard();
}

void addCamera(const XrayFrame& frame, const CArmGeometry& carm, Findings& found) {
  const XrayCamera::Parameters& k = frame.camera.parameters();
  found.size(k.width_px, k.height_px);
  found.count("bits", "bits", 8 * static_cast<std::int64_t>(frame.image.elemSize()));
  found.add("focal length", inWords(k.fx_px, "px, ") + inWords(k.fy_px, "px"), "focal_length_px", {k.fx_px, k.fy_px});
  found.add("principal point", inWords(k.cx_px, "px, ") + inWords(k.cy_px, "px"), "principal_point_px",
            {k.cx_px, k.cy_px});
  found.length("pixel", "pixel_spacing_mm", k.pixel_spacing_m);
  found.length("source-detector", "source_detector_distance_mm", k.source_detector_distance_m);
  const auto wrong = contradiction(frame.camera, carm);
  found.add("geometry", wrong.value_or("agrees with itself and the calibration"), "geometry_contradiction",
            wrong ? Json(*wrong) : Json(nullptr));
}

// Ages are told by the machine's own clock, which both messages have.
void addJoints(const Heard& heard, Findings& found) {
  const auto age_ms = heard.newest
                          ? std::optional(1e-3 * static_cast<double>(heard.newest->time_us - heard.frame->time_us))
                          : std::nullopt;
  const auto far = heard.newest ? differentEpochs({kXrayFrameChannel, "", heard.frame->time_us},
                                                  {kCArmStateChannel, "", heard.newest->time_us})
                                : std::nullopt;
  const std::string age =
      age_ms ? far.value_or(inWords(*age_ms, "ms when it came, by the newest joints")) : "no joints had come before it";
  found.add("age", age, "age_ms", age_ms ? Json(*age_ms) : Json(nullptr));
  if (!heard.state) {
    found.add("joints", "none have come", "joints", nullptr);
    return;
  }
  const CArmJoints& q = heard.state->joints;
  found.add("joints",
            beamInWords(radToDeg(q[0]), radToDeg(q[1])) + ", table " + inWords(1e3 * q[2], "mm, ") +
                inWords(1e3 * q[3], "mm, ") + inWords(1e3 * q[4], "mm"),
            "joints", {q[0], q[1], q[2], q[3], q[4]});
}

void addEdges(const Eigen::Matrix3d& R_camera_lps, Findings& found) {
  const Eigen::Vector3d right = R_camera_lps.row(0), down = R_camera_lps.row(1);
  const std::string edges[] = {patientLetters(-right), patientLetters(right), patientLetters(-down),
                               patientLetters(down)};
  found.add("edges",
            "left " + edges[0] + ", right " + edges[1] + ", top " + edges[2] + ", bottom " + edges[3] +
                "; a frame that shows it otherwise is mirrored or turned",
            "edges", {{"left", edges[0]}, {"right", edges[1]}, {"top", edges[2]}, {"bottom", edges[3]}});
}

void addTree(const Pose& T_camera_model, const XrayCamera& camera, const VesselTree& tree, Findings& found) {
  int inside = 0;
  for (const auto& p : tree.points().colwise()) {
    const auto px = camera.project(T_camera_model * p);
    inside += px && camera.sees(*px);
  }
  const double share = static_cast<double>(inside) / tree.size();
  found.add("tree", inWords(std::round(100 * share), "% of its points in the image, by joints and calibration"),
            "tree_in_image", share);
}

}  // namespace

Findings inspectBus(const BusToInspect& o) {
  const VesselTree tree = readVesselTree(o.tree);
  const CArmCalibration calibration = readCArmCalibration(o.calibration, tree);
  const auto log = logFileOf(o.bus);
  const Heard heard = log ? ofLog(*log) : ofBus(o);
  if (!heard.frame) throw std::runtime_error(o.bus + ": no X-ray frame has come");
  const XrayFrame& frame = *heard.frame;

  Findings found;
  found.count("frame", "sequence", frame.sequence);
  addCamera(frame, calibration.carm, found);
  addJoints(heard, found);
  OverlayScene scene;
  scene.image = frame.image;
  if (heard.state) {
    const Pose T_camera_patient = calibration.carm.T_camera_patient(heard.state->joints);
    const Pose T_camera_model = T_camera_patient * calibration.T_dsa_cb;
    scene.R_camera_lps = T_camera_patient.linear() * calibration.R_patient_lps();
    addEdges(*scene.R_camera_lps, found);
    addTree(T_camera_model, frame.camera, tree, found);
    scene.trees.push_back({T_camera_model, {}, kStartColor, "tree by joints and calibration"});
  }
  if (o.picture.empty()) return found;
  writeImage(o.picture, drawOverlay(scene, tree, frame.camera));
  return found;
}

}  // namespace angio::apps
