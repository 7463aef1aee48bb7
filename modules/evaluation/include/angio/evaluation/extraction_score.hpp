// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "angio/evaluation/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::evaluation {

/// How well extracted centrelines are the true ones, over one image or many. Shares are of length: lines are counted
/// every pixel.
class ExtractionScore {
 public:
  /// Within `tolerance_px` of each other a true and an extracted line are the same.
  explicit ExtractionScore(double tolerance_px) : tolerance_px_(tolerance_px) {}

  /// Adds an image. What must be found may be less than what may be: `required` is what the image shows, `allowed` all
  /// that is there. `own_line` (a flag for each allowed point, or empty) says which of that has a line of its own
  /// (haveOwnLine): it is counted apart as well.
  void add(const Centerline2d& found, const Centerline2d& required, const Centerline2d& allowed,
           const std::vector<bool>& own_line = {});
  void add(const Centerline2d& found, const Centerline2d& truth) { add(found, truth, truth); }

  /// Adds an image whose truth is a mask (CV_8UC1, zero is background): what lies within the tolerance of it is right,
  /// and its regions' thinned lines are to be found.
  void addMask(const Centerline2d& found, const cv::Mat& mask);

  double covered() const { return share(covered_, required_); }  ///< Of what must be found, how much is.
  double correct() const { return share(correct_, found_); }     ///< Of what was found, how much may be.

  /// The same without what two vessels that run as one line cast: required points without a line of their own, and
  /// found ones that lie nearest to such a truth and within its vessel. Of images whose own lines are known.
  double ownLineCovered() const { return share(own_covered_, own_required_); }
  double ownLineCorrect() const { return share(own_correct_, own_found_); }

  /// Of what must be found, how much has a line of its own.
  double ownLinePart() const { return share(own_required_, judged_required_); }

  /// Of the extracted points within the tolerance: distance to the true line, and angle between the two.
  double medianError_px() const;
  double medianTangentError_deg() const;

  /// Distance to the true line of all extracted points, right or wrong.
  double medianDistance_px() const;

  /// Root mean square of error over the uncertainty that the point claims, within the tolerance; 1 when it is right,
  /// nothing when no point claimed any.
  std::optional<double> errorOverSigma() const;

  nlohmann::ordered_json asJson() const;

 private:
  static double share(double part, double whole) { return whole > 0 ? part / whole : 0; }

  double tolerance_px_;
  double covered_ = 0, required_ = 0, correct_ = 0, found_ = 0;
  double own_covered_ = 0, own_required_ = 0, own_correct_ = 0, own_found_ = 0, judged_required_ = 0;
  std::vector<double> errors_px_, tangent_errors_rad_, distances_px_;
  double squared_ratios_ = 0;
  int ratios_ = 0;
};

/// The part of a projected centreline that an image shows: where it is darker than both of its sides by at least
/// `contrast` (natural logarithm) over some pixels of its length. Looks at the image only, so that it is the same for
/// every extractor. `radius_px` is that of the vessels; the projection may be off by as much.
Centerline2d shownIn(const cv::Mat& image, const Centerline2d& projected, double radius_px, double contrast);

}  // namespace angio::evaluation
