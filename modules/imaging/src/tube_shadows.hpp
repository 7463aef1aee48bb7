// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/types.hpp>
#include <vector>

#include "tube_chord.hpp"

namespace angio::imaging {

/// What the vessels of an image cast beside the one that is looked at. The logarithm of an X-ray image is the sum of
/// all shadows, so that without the others' one vessel is seen alone. Lengths are in working pixels.
class TubeShadows {
 public:
  /// A pixel's length of a tube.
  struct Piece {
    cv::Point2f position, along;  ///< Of the axis, and its direction.
    float radius = 0;
    float contrast = 0;  ///< Absorption through the axis; 0 where nothing is known of it.
  };

  /// The profile of an image across a vessel.
  struct Profile {
    cv::Point2f middle, normal;
    float step = 1;  ///< Between samples; the middle one is number count / 2.
    float blur = 1;  ///< Standard deviation of the image's filter.
    int count = 0;
  };

  /// Takes the tubes of a new image, each piece after piece.
  void set(const cv::Size& image, std::vector<std::vector<Piece>> tubes);

  /// Puts a tube in the place of what is known of it: as many pieces, about where they were.
  void replace(int tube, std::vector<Piece> pieces) { tubes_[tube] = std::move(pieces); }

  /// Whether the shadow of a tube other than `own` may come within `reach` of a place.
  bool othersNear(int own, const cv::Point2f& place, float reach) const;

  /// Takes what all tubes but `own` cast from the profile's samples.
  void subtractOthers(int own, const Profile& profile, float* samples) const;

 private:
  // Pieces of one tube that are near a cell of the image.
  struct Run {
    int tube = 0, first = 0, last = 0;
  };

  void enter(int tube, int first, int last);
  int nearest(const Run& run, const Profile& profile) const;
  void subtract(const Piece& piece, bool first, bool last, const Profile& profile, float* samples) const;

  TubeChord chord_;
  int columns_ = 1, rows_ = 1;
  std::vector<std::vector<Piece>> tubes_;
  std::vector<std::vector<Run>> cells_;
};

}  // namespace angio::imaging
