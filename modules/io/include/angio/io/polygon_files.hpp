// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// An image and the regions that people have drawn in it.
struct AnnotatedImage {
  std::string image_path;  ///< As good as the annotation file's own: its folder stands in front.
  int width_px = 0, height_px = 0;
  std::vector<std::vector<Eigen::Vector2d>> polygons_px;  ///< Corners in order, at least three each.
};

/// Reads polygons in the COCO format (JSON: `images` with id, file_name, width, height; `annotations` with image_id and
/// `segmentation`, lists of x1, y1, x2, y2, ...). Images without a polygon are left out. Image files are looked for
/// beside the annotation file and in its folder `images`; they are not opened.
///
/// Throws InputError that names file, field, value and rule: no JSON, missing fields, an annotation of an image that is
/// not there, fewer than three corners, numbers beyond any detector, no annotated image.
std::vector<AnnotatedImage> readCocoPolygons(const std::string& path);

}  // namespace angio::io
