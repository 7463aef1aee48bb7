// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/io/namespace.hpp"

namespace angio::io {

/// A camera and its pose as the programs of XROMM exchange them: a pinhole that sees an undistorted image.
struct MayaCam {
  XrayCamera camera;
  Pose T_camera_world = Pose::Identity();  ///< World (the calibration cube) to camera [m].
};

/// A unit of length in metres. MayaCam files do not say theirs; XROMM's are in centimetres.
constexpr double kMayaCamUnit_m = 0.01;

/// Reads a MayaCam file. Its first line is the choice of the format:
///
/// - 2.0, as XMALab writes and Autoscoper reads it: blocks of lines headed `image size`, `camera matrix`, `rotation`
/// and
///   `translation`. Camera and pose are as this project has them: y down, z from the source to the detector.
/// - 1.0, of the MATLAB programs before: five lines of three numbers. The source's place; the angles about x, y and z
///   [deg] of axes that point right, up and back to the source (R = Rz Ry Rx); the film's place, which follows from
///   what comes after it; principal point, counted from 1 and from the image's lower edge, and the focal length,
///   negative; a scale, width and height, of which 0 means 1024.
///
/// Throws InputError that names file, line, field, value and rule: missing lines, other words, numbers that are none, a
/// skewed or impossible camera matrix, a matrix that is no rotation, a mirrored one.
///
/// Source: XMALab (src/core/Camera.cpp) and Autoscoper (libautoscoper/src/Camera.cpp, camera-calibration.md).
MayaCam readMayaCam(const std::string& path, double unit_m = kMayaCamUnit_m);

/// Writes what readMayaCam() reads: `.txt` is 2.0, `.csv` 1.0. Throws InputError when the file cannot be written, for
/// another extension, and for 1.0 when fx and fy differ by more than a hundredth: it has one focal length, their mean.
void writeMayaCam(const std::string& path, const MayaCam& camera, double unit_m = kMayaCamUnit_m);

}  // namespace angio::io
