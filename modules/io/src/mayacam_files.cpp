// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/mayacam_files.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::io {
namespace {

constexpr std::size_t kMaxMayaCam = std::size_t{1} << 16;
constexpr int kMaxMayaCamSide_px = 32768, kUsualSide_px = 1024;
constexpr double kMaxRotationDefect = 1e-3;  // As of pose files: rounding.
constexpr double kFarthest_m = 100;          // As of pose files: beyond it the unit is another.
constexpr double kMaxFocalSpread = 0.01;     // Between fx and fy of a file that has one focal length.
constexpr double kFilmScale = 0.1;           // The usual one of 1.0 files.

// Numbers between commas, just so many.
std::vector<double> numbersOfLine(const TextLines& lines, const std::string& field, std::size_t count) {
  std::vector<std::string_view> parts;
  splitAt(',', lines.text(), parts);
  if (parts.size() != count) {
    throw InputError(lines.place(), field, std::string(trimmed(lines.text())),
                     "must be " + std::to_string(count) + (count == 1 ? " number" : " numbers between commas"));
  }
  std::vector<double> numbers;
  for (const std::string_view part : parts) numbers.push_back(parseNumber(lines.place(), field, trimmed(part)));
  return numbers;
}

// The next line that is not blank.
void needLine(TextLines& lines, const std::string& what) {
  do lines.need(what);
  while (trimmed(lines.text()).empty());
}

void needHeading(TextLines& lines, const std::string& words) {
  needLine(lines, words);
  if (trimmed(lines.text()) == words) return;
  throw InputError(lines.place(), "heading", std::string(trimmed(lines.text())), "must be \"" + words + "\"");
}

int sideOf(const TextLines& lines, double side) {
  requireBetween(lines.place(), "image size", side, 1, kMaxMayaCamSide_px);
  if (side != std::floor(side)) {
    throw InputError(lines.place(), "image size", formatValue(side), "must be a whole number");
  }
  return static_cast<int>(side);
}

void requireNear(const TextLines& lines, const Eigen::Vector3d& translation_m) {
  if (translation_m.norm() <= kFarthest_m) return;
  throw InputError(lines.place(), "translation", formatted("%.6g m", translation_m.norm()),
                   "must be 100 m at most: is the unit of length right?");
}

XrayCamera cameraIn(const std::string& path, const XrayCamera::Parameters& p) {
  try {
    return XrayCamera(p);
  } catch (const InputError& error) {
    throw error.within(path);
  }
}

MayaCam readSecond(const std::string& path, TextLines& lines, double unit_m) {
  XrayCamera::Parameters p;
  needLine(lines, "image size");
  const std::vector<double> size = numbersOfLine(lines, "image size", 2);
  p.width_px = sideOf(lines, size[0]);
  p.height_px = sideOf(lines, size[1]);
  const auto matrix = [&](const std::string& name) {
    Eigen::Matrix3d M;
    for (int row = 0; row < 3; ++row) {
      needLine(lines, name);
      const std::vector<double> numbers = numbersOfLine(lines, name, 3);
      M.row(row) << numbers[0], numbers[1], numbers[2];
    }
    return M;
  };
  needHeading(lines, "camera matrix");
  const Eigen::Matrix3d K = matrix("camera matrix");
  if (K(0, 1) != 0 || K(1, 0) != 0 || K(2, 0) != 0 || K(2, 1) != 0 || K(2, 2) != 1) {
    throw InputError(lines.place(), "camera matrix", "", "must be fx, 0, cx / 0, fy, cy / 0, 0, 1");
  }
  p.fx_px = K(0, 0);
  p.fy_px = K(1, 1);
  p.cx_px = K(0, 2);
  p.cy_px = K(1, 2);
  MayaCam result{cameraIn(path, p), Pose::Identity()};
  needHeading(lines, "rotation");
  const Eigen::Matrix3d R = matrix("rotation");
  const double defect = rotationDefect(R);
  if (!(defect < kMaxRotationDefect)) {
    throw InputError(lines.place(), "rotation", "",
                     R.determinant() < 0 ? "must not be mirrored" : "must be a rotation matrix");
  }
  result.T_camera_world.linear() = nearestRotation(R);
  needHeading(lines, "translation");
  for (int k = 0; k < 3; ++k) {
    needLine(lines, "translation");
    result.T_camera_world.translation()[k] = unit_m * numbersOfLine(lines, "translation", 1)[0];
  }
  requireNear(lines, result.T_camera_world.translation());
  return result;
}

// From the axes of the first format, right, up and back to the source, to the camera's.
const Eigen::Vector3d kCameraOfFirst(1, -1, -1);

MayaCam readFirst(const std::string& path, TextLines& lines, double unit_m) {
  const auto row = [&](const char* name) {
    const std::vector<double> numbers = numbersOfLine(lines, name, 3);
    return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  };
  const auto nextRow = [&](const char* name) {
    needLine(lines, name);
    return row(name);
  };
  const Eigen::Vector3d source_m = unit_m * row("camera location");
  requireNear(lines, source_m);
  const Eigen::Vector3d turns_deg = nextRow("rotation angles");
  nextRow("film plane");
  const Eigen::Vector3d film = nextRow("u0, v0, focal length");
  if (film.z() == 0) throw InputError(lines.place(), "focal length", "0", "must not be zero");
  const Eigen::Vector3d size = nextRow("scale, width, height");
  XrayCamera::Parameters p;
  p.width_px = size[1] == 0 ? kUsualSide_px : sideOf(lines, size[1]);
  p.height_px = size[2] == 0 ? kUsualSide_px : sideOf(lines, size[2]);
  p.fx_px = p.fy_px = std::abs(film.z());
  p.cx_px = film.x() - 1;
  p.cy_px = (p.height_px - 1) - (film.y() - 1);
  const auto about = [&](int axis) {
    return Eigen::AngleAxisd(degToRad(turns_deg[axis]), Eigen::Vector3d::Unit(axis)).toRotationMatrix();
  };
  MayaCam result{cameraIn(path, p), Pose::Identity()};
  result.T_camera_world.linear() = kCameraOfFirst.asDiagonal() * (about(2) * about(1) * about(0)).transpose();
  result.T_camera_world.translation() = -(result.T_camera_world.linear() * source_m);
  return result;
}

std::string rowOf(const Eigen::Vector3d& v) { return exact(v[0]) + "," + exact(v[1]) + "," + exact(v[2]) + "\n"; }

std::string secondText(const MayaCam& c, double unit_m) {
  const XrayCamera::Parameters& p = c.camera.parameters();
  std::string text = "image size\n" + std::to_string(p.width_px) + "," + std::to_string(p.height_px) + "\n\n";
  text += "camera matrix\n" + rowOf({p.fx_px, 0, p.cx_px}) + rowOf({0, p.fy_px, p.cy_px}) + rowOf({0, 0, 1});
  text += "\nrotation\n";
  for (int row = 0; row < 3; ++row) text += rowOf(c.T_camera_world.linear().row(row).transpose());
  text += "\ntranslation\n";
  for (int k = 0; k < 3; ++k) text += exact(c.T_camera_world.translation()[k] / unit_m) + "\n";
  return text;
}

std::string firstText(const std::string& path, const MayaCam& c, double unit_m) {
  const XrayCamera::Parameters& p = c.camera.parameters();
  const double f_px = 0.5 * (p.fx_px + p.fy_px);
  if (std::abs(p.fx_px - p.fy_px) > kMaxFocalSpread * f_px) {
    throw InputError(path, "fx_px, fy_px", formatValue(p.fx_px) + ", " + formatValue(p.fy_px),
                     "must be within 1 % for MayaCam 1.0, which has one focal length: write 2.0 (.txt)");
  }
  const Pose T_world_camera = c.T_camera_world.inverse();
  const Eigen::Matrix3d F = T_world_camera.linear() * kCameraOfFirst.asDiagonal();
  const Eigen::Vector3d turns_rad(std::atan2(F(2, 1), F(2, 2)), std::atan2(-F(2, 0), std::hypot(F(2, 1), F(2, 2))),
                                  std::atan2(F(1, 0), F(0, 0)));
  const double u0 = p.cx_px + 1, v0 = p.height_px - p.cy_px;
  const Eigen::Vector3d film(0.5 * p.width_px - u0, 0.5 * p.height_px - v0, -f_px);
  return rowOf(T_world_camera.translation() / unit_m) + rowOf(radToDeg(1) * turns_rad) + rowOf(kFilmScale * film) +
         rowOf({u0, v0, -f_px}) + rowOf({kFilmScale, 1.0 * p.width_px, 1.0 * p.height_px});
}

}  // namespace

MayaCam readMayaCam(const std::string& path, double unit_m) {
  requirePositive(path, "unit of length", unit_m);
  const std::string content = readWholeFile(path, kMaxMayaCam);
  TextLines lines(path, content);
  needLine(lines, "image size or the source's place");
  return trimmed(lines.text()) == "image size" ? readSecond(path, lines, unit_m) : readFirst(path, lines, unit_m);
}

void writeMayaCam(const std::string& path, const MayaCam& camera, double unit_m) {
  requirePositive(path, "unit of length", unit_m);
  const std::string extension = extensionOf(path);
  if (extension != ".txt" && extension != ".csv") {
    throw InputError(path, "extension", extension, "must be .txt (MayaCam 2.0) or .csv (1.0)");
  }
  writeWholeFile(path, extension == ".txt" ? secondText(camera, unit_m) : firstText(path, camera, unit_m));
}

}  // namespace angio::io
