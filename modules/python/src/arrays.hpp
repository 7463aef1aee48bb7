// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <pybind11/numpy.h>

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "binding.hpp"

namespace angio::python {

/// Whatever numpy makes an array of doubles of, row by row.
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// A pose as a 4 x 4 array.
Numbers arrayOf(const Pose& T);

/// The pose of a 4 x 4 array, of which a rotation that is off by rounding is made exact. Throws InputError that names
/// `field` for another shape, a rotation that is none, or a last row that is not 0, 0, 0, 1.
Pose poseOf(const Numbers& array, const std::string& field);

/// Points as rows, and back. Throws InputError that names `field` for another shape.
template <int Rows, typename Scalar>
py::array_t<Scalar> rowsOf(const Eigen::Matrix<Scalar, Rows, Eigen::Dynamic>& points) {
  py::array_t<Scalar> rows({static_cast<py::ssize_t>(points.cols()), static_cast<py::ssize_t>(Rows)});
  std::copy(points.data(), points.data() + points.size(), rows.mutable_data());
  return rows;
}
void requireRows(const py::array& array, int columns, const std::string& field);
template <int Rows, typename Scalar = double>
Eigen::Matrix<Scalar, Rows, Eigen::Dynamic> pointsOf(
    const py::array_t<Scalar, py::array::c_style | py::array::forcecast>& rows, const std::string& field) {
  requireRows(rows, Rows, field);
  return Eigen::Map<const Eigen::Matrix<Scalar, Rows, Eigen::Dynamic>>(rows.data(), Rows, rows.shape(0));
}
py::array_t<double> rowsOf(const std::vector<Eigen::Vector2d>& points);
std::vector<Eigen::Vector2d> cornersOf(const Numbers& rows, const std::string& field);

/// An image as an array that shares its pixels and cannot be written: height x width, and x 3 of a colour image, which
/// OpenCV has as blue, green, red. None of an empty one.
py::object arrayOf(const cv::Mat& image);

/// A copy of an array as an image. Throws InputError that names `field` unless it is height x width of uint8 or uint16.
cv::Mat imageOf(const py::array& array, const std::string& field);

}  // namespace angio::python
