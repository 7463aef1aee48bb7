// SPDX-License-Identifier: GPL-2.0-or-later
#include "arrays.hpp"

#include "angio/base/errors.hpp"

namespace angio::python {
namespace {

std::string shapeOf(const py::array& array) {
  std::string text;
  for (py::ssize_t i = 0; i < array.ndim(); ++i) text += (i ? " x " : "") + std::to_string(array.shape(i));
  return text.empty() ? "one number" : text;
}

}  // namespace

Numbers arrayOf(const Pose& T) {
  Numbers array({4, 4});
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.mutable_data()) = T.matrix();
  return array;
}

Pose poseOf(const Numbers& array, const std::string& field) {
  if (array.ndim() != 2 || array.shape(0) != 4 || array.shape(1) != 4) {
    throw InputError("", field, shapeOf(array), "must be a pose, 4 x 4");
  }
  const Eigen::Matrix4d M = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.data());
  if (M.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) throw InputError("", field + "[3]", "", "must be 0, 0, 0, 1");
  for (int i = 0; i < 3; ++i) requireFinite("", field + "[" + std::to_string(i) + ", 3]", M(i, 3));
  // As pose files are read.
  constexpr double kRounding = 1e-3, kExact = 1e-12;
  const Eigen::Matrix3d R = M.topLeftCorner<3, 3>();
  const double defect = rotationDefect(R);
  if (!(defect < kRounding)) {
    throw InputError("", field, "", "must hold a rotation: its inverse is its transpose, its determinant +1");
  }
  Pose T = Pose::Identity();
  T.linear() = defect < kExact ? R : nearestRotation(R);
  T.translation() = M.topRightCorner<3, 1>();
  return T;
}

void requireRows(const py::array& array, int columns, const std::string& field) {
  if (array.ndim() == 2 && array.shape(1) == columns) return;
  throw InputError("", field, shapeOf(array), "must be N x " + std::to_string(columns));
}

py::array_t<double> rowsOf(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Matrix2Xd columns(2, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) columns.col(static_cast<Eigen::Index>(i)) = points[i];
  return rowsOf<2, double>(columns);
}

std::vector<Eigen::Vector2d> cornersOf(const Numbers& rows, const std::string& field) {
  const Eigen::Matrix2Xd points = pointsOf<2>(rows, field);
  std::vector<Eigen::Vector2d> corners;
  for (const auto& corner : points.colwise()) corners.push_back(corner);
  return corners;
}

py::object arrayOf(const cv::Mat& image) {
  if (image.empty()) return py::none();
  // The array keeps the pixels by a header of its own.
  auto* kept = new cv::Mat(image);
  const py::capsule owner(kept, [](void* mat) { delete static_cast<cv::Mat*>(mat); });
  const auto bytes = static_cast<py::ssize_t>(image.elemSize1());
  std::vector<py::ssize_t> shape = {image.rows, image.cols};
  std::vector<py::ssize_t> strides = {static_cast<py::ssize_t>(image.step[0]),
                                      static_cast<py::ssize_t>(image.elemSize())};
  if (image.channels() > 1) {
    shape.push_back(image.channels());
    strides.push_back(bytes);
  }
  py::array array(image.depth() == CV_16U ? py::dtype::of<std::uint16_t>() : py::dtype::of<std::uint8_t>(), shape,
                  strides, image.data, owner);
  array.attr("setflags")("write"_a = false);
  return std::move(array);
}

cv::Mat imageOf(const py::array& array, const std::string& field) {
  const bool wide = array.dtype().kind() == 'u' && array.itemsize() == 2;
  const bool narrow = array.dtype().kind() == 'u' && array.itemsize() == 1;
  if (array.ndim() != 2 || !(wide || narrow)) {
    throw InputError("", field, shapeOf(array) + " of " + py::str(array.dtype()).cast<std::string>(),
                     "must be height x width of uint8 or uint16");
  }
  // Row by row, and in this machine's order of bytes.
  const py::array rows = wide ? py::array(py::array_t<std::uint16_t, py::array::c_style | py::array::forcecast>(array))
                              : py::array(py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast>(array));
  const auto height = static_cast<int>(rows.shape(0)), width = static_cast<int>(rows.shape(1));
  return cv::Mat(height, width, wide ? CV_16UC1 : CV_8UC1, const_cast<void*>(rows.data())).clone();
}

}  // namespace angio::python
