// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/recording/namespace.hpp"

// Parts of Foxglove's schemas.
namespace angio::recording {

using Json = nlohmann::ordered_json;

/// A number to so many decimals: what is drawn needs no more, and a file of them is a third as long.
double rounded(double value, int decimals);

Json timeJson(std::int64_t time_us);

Json pointJson(const Eigen::Vector2d& pixel);
Json poseJson(const Pose& pose);
Json colorJson(double red, double green, double blue);
Json transformJson(std::int64_t time_us, const char* parent, const char* child, const Pose& T_parent_child);

/// A line through its points [m].
using Line = std::vector<Eigen::Vector3d>;

/// A figure of lines in a frame that may move, its points to so many decimals.
Json lineEntityJson(std::int64_t time_us, const char* frame, const char* id, const std::vector<Line>& lines,
                    int decimals, const Json& color);

/// An image as 8 bit, smoothed, as JPEG and base64, for people: of 16 bit the range that 99 % of the pixels are in.
std::string jpegBase64(const cv::Mat& image);

}  // namespace angio::recording
