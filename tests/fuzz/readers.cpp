// SPDX-License-Identifier: GPL-2.0-or-later
#include "readers.hpp"

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "angio/base/errors.hpp"
#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/pose_set.hpp"
#include "angio/calibration/view_set.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/campaign/shard_file.hpp"
#include "angio/conventions/projection_files.hpp"
#include "angio/conventions/rtk_geometry_file.hpp"
#include "angio/conventions/tfm_file.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/dicom_registration.hpp"
#include "angio/io/dicom_slices.hpp"
#include "angio/io/displacement_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/measured_motion_file.hpp"
#include "angio/io/polygon_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/mcap/reader.hpp"
#include "angio/messaging/bus_monitor.hpp"
#include "angio/messaging/lcm_datagrams.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/results/case_row.hpp"
#include "angio/test/namespace.hpp"
#include "value_checks.hpp"

namespace angio::test {
namespace {

constexpr int kPoints = 4;  // Of the tree that the corpus's displacements are for.

void readTree(const std::string& path) { checkTree(readVesselTree(path)); }

void readLine(const std::string& path) { checkCenterline(readCenterline(path)); }

void readShifts(const std::string& path) {
  const Eigen::Matrix3Xd shifts = readDisplacements(path, kPoints);
  promised(shifts.cols() == kPoints && shifts.allFinite(), "each point is displaced");
}

void readMotion(const std::string& path) {
  const MeasuredMotion motion = readMeasuredMotion(path);
  promised(motion.points.cols() == motion.displacements_m.cols() && motion.points.allFinite() &&
               motion.displacements_m.allFinite(),
           "each point moves");
}

void readGeometry(const std::string& path) {
  for (const RtkProjection& p : readRtkGeometry(path)) promised(rtkMatrix(p).allFinite(), "a matrix has numbers");
}

void promiseRigid(const Pose& T) {
  promised(rotationDefect(T.linear()) < 1e-9 && T.translation().allFinite(), "a pose is rigid");
}

void readTransform(const std::string& path) { promiseRigid(poseOf(readTfm(path), path)); }

void readAProjection(const std::string& path) {
  promiseRigid(readProjection({path, "", 0, {}, {}}).projection.T_camera_model);
}

void readLog(const std::string& path) {
  LogReader log(path);
  BusMonitor monitor;
  std::int64_t messages = 0, now_us = 0;
  for (auto event = log.next(); event; event = log.next(), ++messages) {
    monitor.hear(event->channel, event->bytes.data(), event->bytes.size(), event->time_us);
    now_us = event->time_us;
  }
  promised(log.position_bytes() == log.size_bytes() && log.skipped_bytes() <= log.size_bytes(), "a log ends");
  std::int64_t counted = monitor.unlisted();
  for (const ChannelReport& channel : monitor.report(now_us)) counted += channel.messages;
  promised(counted == messages, "each message is counted");
}

void readMcap(const std::string& path) {
  mcap::Reader reader(path);
  for (auto m = reader.next(); m; m = reader.next()) {
    promised(m->channel && m->position_bytes < reader.position_bytes(), "a message has a channel and a place");
  }
  promised(reader.position_bytes() == reader.size_bytes(), "an MCAP file ends");
  (void)reader.attachments();
  LogReader log(path);
  while (log.next()) {
  }
}

void readDicomPose(const std::string& path) { checkPose(readDicomRegistration(path).T_camera_model); }

// Datagrams one after another: a byte for the sender, two for the size, and the datagram.
void readDatagrams(const std::string& path) {
  const std::string content = readWholeFile(path);
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(content.data());
  LcmDatagrams datagrams([](const std::string& channel) { return channel != "UNWANTED"; });
  for (std::size_t at = 0; at + 3 <= content.size();) {
    const UdpSender sender{1, bytes[at]};
    const std::size_t size = std::min<std::size_t>(bytes[at + 1] << 8 | bytes[at + 2], content.size() - at - 3);
    const auto message = datagrams.take(sender, bytes + at + 3, size);
    at += 3 + size;
    promised(datagrams.unfinished_bytes() <= LcmDatagrams::kMaxUnfinished_bytes, "unfinished messages are bounded");
    if (!message) continue;
    promised(!message->channel.empty() && message->channel.size() <= LcmDatagrams::kMaxChannel_bytes &&
                 message->channel.find('\0') == std::string::npos && message->channel != "UNWANTED",
             "a channel is a name that is wanted");
    promised(message->bytes.size() <= LcmDatagrams::kMaxMessage_bytes, "a message is bounded");
  }
}

void readImage(const std::string& path) {
  const XrayFrames frames(path);
  promised(frames.count() >= 1, "a file has a frame");
  for (int i = 0; i < std::min(frames.count(), 3); ++i) checkFrame(frames.frame(i));
}

void readRun(const std::string& path) {
  const XaRun run(path);
  promised(run.frames() >= 1, "a run has a frame");
  for (const XaMask& mask : run.masks()) {
    for (const int frame : mask.mask_frames) promised(frame >= 0 && frame < run.frames(), "masks are frames");
  }
  for (int frame = 0; frame < std::min(run.frames(), 3); ++frame) {
    const XaGeometry geometry = run.geometry(frame);
    checkCamera(geometry.camera);
    promised(geometry.table_shift_m.allFinite(), "the table stands somewhere");
    if (geometry.T_camera_patient) checkPose(*geometry.T_camera_patient);
    checkFrame(run.image(frame));
  }
}

void readSlice(const std::string& path) {
  const DicomSlice slice = readDicomSlice(path);
  promised(slice.first_pixel_mm.allFinite() && (slice.spacing_mm.array() > 0).all(), "a slice has its place");
  promised(slice.values.type() == CV_32FC1 && cv::checkRange(slice.values), "values are finite");
}

void readACamera(const std::string& path) { checkCamera(readCameraFile(path).camera); }

void readAPose(const std::string& path) {
  const PoseFile pose = readPose(path);
  checkPose(pose.T_camera_model);
  if (pose.covariance) promised(pose.covariance->allFinite(), "a covariance is finite");
}

void readSomeSettings(const std::string& path) {
  ExtractorSections settings = readSettings(path, ExtractorSections{});
  checkSettings("settings", settings);
  promised(!settingsAsJson(settings).dump().empty(), "settings can be written");
}

void readCases(const std::string& path) {
  const CaseSet set = readCaseSet(path);
  promised(!set.cases.empty(), "a set has a case");
  for (const Case& one : set.cases) {
    promised(!one.name.empty() && !one.tree_path.empty() && !one.views.empty(), "a case has a name, a tree, a view");
    checkPose(one.initial_pose);
    for (const View& view : one.views) {
      checkCamera(view.camera);
      checkPose(view.T_view_first);
      promised(view.centerline_path || view.image_path, "a view shows something");
    }
  }
}

void readPolygons(const std::string& path) {
  for (const AnnotatedImage& image : readCocoPolygons(path)) {
    promised(image.width_px > 0 && image.height_px > 0 && !image.polygons_px.empty(), "an image has polygons");
    for (const auto& polygon : image.polygons_px) {
      promised(polygon.size() >= 3, "a polygon has three corners");
      for (const auto& corner : polygon) promised(corner.allFinite(), "corners are finite");
    }
  }
}

// Its rows as those of angio-evaluate simulation, which they are in the corpus.
void readAShard(const std::string& path) {
  const ShardFile shard = readShard(path);
  promised(shard.shard.number >= 1 && shard.shard.number <= shard.shard.count, "a shard is one of its number");
  for (std::size_t i = 0; i < shard.rows.size(); ++i) {
    const std::string place = placeOfRow(shard, i);
    promised(shard.shard.has(shard.rows[i].part, shard.rows[i].run), "a shard has its runs");
    std::vector<CaseOutcome> outcomes;
    fromRow(rowOfText(shard.rows[i].text, place), {place, ""}, outcomes);
    for (const CaseOutcome& outcome : outcomes) promised(!caseAsJson(outcome).empty(), "an outcome can be reported");
  }
}

// With the fingerprint of its rows as it should be.
std::string withFingerprint(std::string shard) {
  const std::string key = "\"rows_fnv1a\":\"";
  const std::size_t end = shard.find('\n'), at = shard.find(key);
  if (end == std::string::npos || at == std::string::npos || at + key.size() + 16 > end) return shard;
  return shard.replace(at + key.size(), 16, campaign::fingerprintOf(shard.substr(end + 1)));
}

void readPhantom(const std::string& path) {
  const BeadPhantom phantom = readBeadPhantom(path);
  promised(phantom.beads.size() >= 4 && phantom.positions_m().allFinite(), "a phantom has beads that stand somewhere");
}

void readBeads(const std::string& path) {
  for (const BeadDetection& bead : readBeadTable(path)) {
    promised(bead.center_px.allFinite() && bead.std_px > 0, "a bead is somewhere");
  }
}

void readViews(const std::string& path) {
  for (const PhantomView& view : readViewSet(path).views) {
    promised(!view.name.empty() && !view.path.empty(), "a view has a name and a file");
    promised(!view.joints || view.joints->allFinite(), "joints are finite");
  }
}

void readSomeRecords(const std::string& path) {
  const YamlNode root = readYaml(path);
  for (const CalibrationRecord& record : readRecords({path, "calibration", &root})) {
    promised(record.covariance.rows() == record.values.size() && record.covariance.allFinite(), "a covariance fits");
    promised(!asYaml(recordAsJson(record)).empty(), "records can be written");
  }
}

void readCArm(const std::string& path) { readCArmCalibration(path).check(path); }

void readPoses(const std::string& path) {
  const CArmGeometry carm;
  for (const HandEyePose& pose : readPoseSet(path, &carm).poses) {
    checkPose(pose.T_base_hand);
    checkPose(pose.T_camera_object);
  }
}

void readSamples(const std::string& path) {
  for (const HandEyePose& pose : readMoveItSamples(path, HandEyeSetup::kEyeToHand).poses) checkPose(pose.T_base_hand);
}

void readAngles(const std::string& path) {
  for (const AnatomyAngles& view : readAnatomyAngles(path).views)
    promised(view.joints.allFinite(), "angles are finite");
}

std::uint32_t bigEndian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

// With the checksums of a PNG's chunks as they should be.
std::string withChecksums(std::string png) {
  for (std::size_t at = 8; at + 12 <= png.size();) {
    const std::size_t length = bigEndian(png, at);
    if (length > png.size() - at - 12) break;
    const auto sum = crc32(0, reinterpret_cast<const Bytef*>(&png[at + 4]), static_cast<uInt>(length + 4));
    for (std::size_t i = 0; i < 4; ++i) png[at + 8 + length + i] = static_cast<char>(sum >> (24 - 8 * i));
    at += length + 12;
  }
  return png;
}

std::vector<FileReader> listedReaders() {
  std::vector<FileReader> readers = {
      {"tree_csv", "input.csv", readTree},
      {"tree_swc", "input.swc", readTree},
      {"tree_vtp", "input.vtp", readTree},
      {"tree_vtk", "input.vtk", readTree},
      {"tree_mrk_json", "input.mrk.json", readTree},
      {"tree_tre", "input.tre", readTree},
      {"tree_hmm", "input.txt", readTree},
      {"centerline", "input.csv", readLine},
      {"displacements", "input.csv", readShifts},
      {"measured_motion", "input.csv", readMotion},
      {"image_png", "input.png", readImage, {}, withChecksums},
      {"image_tiff", "input.tif", readImage},
      {"image_jpeg", "input.jpg", readImage},
      {"image_dicom", "input.dcm", readImage},
      {"xa_run", "input.dcm", readRun},
      {"dicom_slice", "input.dcm", readSlice},
      {"camera_yaml", "input.yaml", readACamera},
      {"camera_xml", "input.xml", readACamera},
      {"pose", "input.yaml", readAPose},
      {"projection", "input.yaml", readAProjection},
      {"rtk_geometry", "input.xml", readGeometry},
      {"itk_transform", "input.tfm", readTransform},
      {"dicom_registration", "input.dcm", readDicomPose},
      {"settings", "input.yaml", readSomeSettings},
      {"case_set", "input.yaml", readCases, {"camera.yaml", "pose.yaml", "tree.csv", "line.csv"}},
      {"coco_polygons", "input.json", readPolygons},
      {"campaign_shard", "input.json", readAShard, {}, withFingerprint},
      {"carm_calibration", "input.yaml", readCArm},
      {"calibration_records", "input.yaml", readSomeRecords},
      {"view_set", "input.yaml", readViews},
      {"pose_set", "input.yaml", readPoses, {"camera.yaml", "points.csv"}},
      {"moveit_samples", "input.json", readSamples},
      {"anatomy_angles", "input.yaml", readAngles},
      {"bead_phantom", "input.yaml", readPhantom},
      {"bead_table", "input.csv", readBeads},
      {"bus_log", "input.lcm", readLog},
      {"mcap_log", "input.mcap", readMcap},
      {"lcm_datagrams", "input.bin", readDatagrams},
  };
#ifdef ANGIO_HAVE_VOLUMES
  for (FileReader& reader : volumeReaders()) readers.push_back(std::move(reader));
#endif
  return readers;
}

}  // namespace

const std::vector<FileReader>& fileReaders() {
  static const std::vector<FileReader> readers = listedReaders();
  return readers;
}

std::string corpusOf(const std::string& reader) { return std::string(ANGIO_FUZZ_CORPUS) + "/" + reader; }

std::string placeIn(const std::string& folder, const FileReader& reader) {
  for (const std::string& name : reader.beside) {
    std::filesystem::copy_file(corpusOf("beside") + "/" + name, folder + "/" + name,
                               std::filesystem::copy_options::overwrite_existing);
  }
  return folder + "/" + reader.file;
}

bool isRefused(const FileReader& reader, const std::string& path) {
  try {
    reader.read(path);
    return false;
  } catch (const InputError& error) {
    const std::string line = error.what();
    const std::string folder = std::filesystem::path(path).parent_path().string();
    promised(line.compare(0, folder.size(), folder) == 0, "a refusal begins with the place");
    promised(std::none_of(line.begin(), line.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }),
             "a refusal is one line of text");
    promised(line.size() < folder.size() + 2000, "a refusal is short enough to be read");
    return true;
  }
}

void promised(bool holds, const char* what) {
  if (!holds) throw std::logic_error(std::string("promised, and not so: ") + what);
}

}  // namespace angio::test
