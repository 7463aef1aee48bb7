// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/polygon_files.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include "angio/base/errors.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::TemporaryFolder;

const std::string kImage = R"({"id": 7, "file_name": "a.png", "width": 512, "height": 400})";

std::string file(const std::string& images, const std::string& annotations) {
  return "{\"images\": [" + images + "], \"annotations\": [" + annotations + "]}";
}

TEST(CocoPolygons, AreReadByTheirImages) {
  const TemporaryFolder folder;
  const auto images = readCocoPolygons(folder.write(
      "c.json", file(kImage + R"(, {"id": 8, "file_name": "b.png", "width": 5, "height": 5})",
                     R"({"image_id": 7, "segmentation": [[1, 2, 3, 4, 5.5, 6]]}, {"image_id": 7, "segmentation":
                        [[0, 0, 9, 0, 9, 9, 0, 9], [1, 1, 2, 1, 2, 2]], "category_id": 3})")));
  ASSERT_EQ(images.size(), 1u) << "an image without a polygon is left out";
  EXPECT_EQ(images[0].width_px, 512);
  EXPECT_EQ(images[0].height_px, 400);
  ASSERT_EQ(images[0].polygons_px.size(), 3u);
  EXPECT_EQ(images[0].polygons_px[0][2], Eigen::Vector2d(5.5, 6));
  EXPECT_EQ(images[0].polygons_px[1].size(), 4u);
}

TEST(CocoPolygons, WhatIsWrongIsNamed) {
  const TemporaryFolder folder;
  const std::pair<std::string, std::string> cases[] = {
      {"{", "c.json: is not JSON"},
      {"[]", "images: is missing"},
      {R"({"images": 3})", "images = 3: must be a list"},
      {R"({"images": []})", "annotations: is missing"},
      {file(kImage, ""), "annotations = 0: must be at least one polygon"},
      {file(kImage + "," + kImage, ""), "id = 7: must not stand twice"},
      {file(R"({"id": 1, "file_name": "a", "width": -4, "height": 4})", ""), "width = -4: must be pixels"},
      {file(kImage, R"({"image_id": 9, "segmentation": []})"), "image_id = 9: must be the id of one of the images"},
      {file(kImage, R"({"image_id": 7, "segmentation": [[1, 2, 3, 4]]})"), "must be lists x1, y1"},
      {file(kImage, R"({"image_id": 7, "segmentation": [[1, 2, 3, 4, 5, 1e300]]})"), "1e+300: must be pixels"},
      {file(kImage, R"({"image_id": 7, "segmentation": [[1, 2, 3, 4, 5, "x"]]})"), "\"x\": must be pixels"},
  };
  for (const auto& [content, expected] : cases) {
    const std::string path = folder.write("c.json", content);
    try {
      readCocoPolygons(path);
      ADD_FAILURE() << content;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(expected)) << content;
    }
  }
}

}  // namespace
}  // namespace angio::test
