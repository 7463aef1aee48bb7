// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/geometry/carm.hpp"
#include "angio/io/namespace.hpp"

namespace angio::io {

/// How the pixels of a DICOM file are stored.
struct DicomPixels {
  int frames = 0;
  int width_px = 0;
  int height_px = 0;
  int bits_allocated = 0;  ///< 8 or 16.
  int bits_stored = 0;
  int high_bit = 0;
  bool is_signed = false;
  std::string photometric;  ///< MONOCHROME1 (0 is white) or MONOCHROME2.
};

/// What an X-ray run's file says of the whole run; no name or number of a patient is among it.
struct XaHeader : DicomPixels {
  std::string modality, manufacturer, model;
  std::string transfer_syntax;          ///< By name: "JPEG lossless, first-order prediction".
  std::string intensity_relationship;   ///< (0028,1040): LIN, LOG, DISP, ...; empty when it is not said.
  std::string patient_position;         ///< (0018,5100): HFS, FFS, ...; empty when it is not said.
  std::string positioner_motion;        ///< (0018,1500): STATIC or DYNAMIC; empty when it is not said.
  std::string table_motion;             ///< (0018,1134): the same.
  std::optional<double> frame_rate_hz;  ///< Of acquisition.
  std::optional<double> magnification;  ///< (0018,1114) Estimated Radiographic Magnification Factor.
};

/// One item of the Mask Subtraction Sequence (0028,6100).
struct XaMask {
  std::string operation;         ///< NONE, AVG_SUB, TID or REV_TID.
  std::vector<int> mask_frames;  ///< From 0.
};

/// What a positive primary and a positive secondary angle mean in a file. DICOM says LAO and CRA; machines and reports
/// that count the other way are read by saying so.
enum class XaAngleSigns { kLaoCra, kRaoCra, kLaoCau, kRaoCau };

/// The geometry of one frame as XaRun::image gives it: as seen from the source, u to the right, v down.
struct XaGeometry {
  explicit XaGeometry(const XrayCamera& seen_by) : camera(seen_by) {}

  XrayCamera camera;
  double source_detector_distance_m = 0;
  std::optional<double> source_isocenter_distance_m;
  std::string spacing_from;                         ///< The attribute that the pixel spacing was taken from.
  bool stored_mirrored = true;                      ///< Whether XaRun::image mirrors what is stored, left for right.
  std::optional<ViewAngles> patient_angles;         ///< (0018,1510), (0018,1511) with their increments.
  std::optional<IsocenterAngles> isocenter_angles;  ///< (0018,9463), (0018,9464), (0018,9465).
  TableAngles table_angles;
  Eigen::Vector3d table_shift_m = Eigen::Vector3d::Zero();  ///< Since the first frame, in the patient's axes L, P, S.
  std::optional<double> time_s;                             ///< Since the first frame.

  /// Pose by the angles: the patient's axes L, P, S with the isocentre of the first frame as their origin. Nothing
  /// without angles or without a distance from source to isocentre.
  std::optional<Pose> T_camera_patient;

  /// What was not in the file and so was assumed or computed, one sentence each: which attribute, and what instead.
  std::vector<std::string> assumed;
};

/// Whether there is a file and it begins as DICOM files do: runs, slices, and all others.
bool isDicom(const std::string& path);

/// A run of X-ray frames from a DICOM file: XA or RF, of the multi-frame or the enhanced kind.
///
/// Stored frames show what one sees who looks from the detector to the source, with the patient's head up; a camera at
/// the source sees that mirrored, so frames are mirrored left for right unless the file says that it was done. The file
/// is kept in memory as it is, compressed or not, and frames are decoded when they are asked for.
class XaRun {
 public:
  /// Throws InputError that names file, attribute, value and rule: no DICOM file or a broken one, pixels that are no
  /// grey frames of 8 to 16 bits or coded otherwise than without loss, by run length or JPEG, and no way to a camera.
  /// @param signs  Of the patient-based angles; those against the equipment are DICOM's.
  explicit XaRun(const std::string& path, XaAngleSigns signs = XaAngleSigns::kLaoCra);

  /// The same of a file's bytes that are in memory already; `path` is for messages only.
  XaRun(const std::string& path, std::string content, XaAngleSigns signs = XaAngleSigns::kLaoCra);
  XaRun(XaRun&&) noexcept;
  XaRun& operator=(XaRun&&) noexcept;
  ~XaRun();

  const XaHeader& header() const { return header_; }
  const std::vector<XaMask>& masks() const { return masks_; }
  int frames() const { return header_.frames; }

  /// Frames count from 0 here and everywhere; throws InputError when there is none of this number, or when an
  /// attribute of this frame is wrong.
  XaGeometry geometry(int frame) const;

  /// The frame as the camera of geometry(frame) sees it: CV_8UC1 or CV_16UC1, dark vessels on bright as they are
  /// acquired (MONOCHROME1 is turned); neither rescaling nor window is applied. Throws InputError when it cannot be
  /// decoded.
  cv::Mat image(int frame) const;

  /// The same without mirroring.
  cv::Mat storedImage(int frame) const;

 private:
  struct Contents;
  std::unique_ptr<Contents> contents_;
  XaHeader header_;
  std::vector<XaMask> masks_;
  XaAngleSigns signs_;
};

}  // namespace angio::io
