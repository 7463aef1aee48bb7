// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/namespace.hpp"
#include "angio/calibration_records/record.hpp"
#include "angio/geometry/carm.hpp"

namespace angio::calibration {

/// One X-ray view of a calibration phantom, with what the machine said when it was taken.
struct PhantomView {
  std::string name;
  std::string path;                                  ///< From where the program runs.
  bool is_table = false;                             ///< A table of beads (.csv); otherwise an X-ray image.
  std::optional<CArmJoints> joints;                  ///< By the encoders [rad, m].
  std::optional<double> source_detector_distance_m;  ///< By the encoder.
  bool held_out = false;                             ///< Takes no part in the estimate; its error is reported.
  std::string machine;                               ///< Empty when the view does not say.
};

/// A flat pattern whose photographs need no tables: OpenCV finds it.
struct FlatPattern {
  enum class Kind { kChessboard, kCircles, kShiftedCircles };  ///< Shifted: every other row, by half of its distance.
  Kind kind = Kind::kChessboard;
  int columns = 0, rows = 0;  ///< Of inner corners, or of circles.
  double spacing_m = 0;       ///< A square's side; the distance of rows of circles.
};

/// Views of one phantom by one machine.
struct ViewSet {
  std::string path;                             ///< The file itself, for messages.
  std::string machine;                          ///< Empty when the file does not say.
  std::string phantom_path;                     ///< Empty where there is a pattern.
  std::optional<FlatPattern> pattern;           ///< In place of a phantom.
  int image_width_px = 0, image_height_px = 0;  ///< Zero when images tell.
  std::optional<double> pixel_spacing_m;
  std::vector<PhantomView> views;
};

/// Reads a view set:
///
///     machine: lab-1                     # optional; a view may name its own
///     phantom: phantom.yaml              # or chessboard: {corners: [9, 6], square_mm: 23.6}
///                                        # or circle_grid: {circles: [4, 11], spacing_mm: 20, shifted: true}
///     image_size_px: [1024, 1024]        # needed where views are tables of beads
///     pixel_spacing_mm: 0.25             # optional
///     views:
///       - name: "0001"
///         image: v0001.png               # or beads: v0001.csv
///         primary_deg: 30                # optional, both angles together
///         secondary_deg: 15
///         table_mm: [0, 0, 0]            # optional
///         source_detector_distance_mm: 1113   # optional
///         held_out: true                 # optional
///
/// Paths count from the file's folder. Throws InputError that names file, line, key, value and rule: unknown or missing
/// keys, a name that stands twice, a path that stands twice, views of different machines (which are named).
ViewSet readViewSet(const std::string& path);

/// The set's phantom: its file's, or its pattern's marks, row by row. Throws InputError as readBeadPhantom does.
BeadPhantom phantomOf(const ViewSet& set);

/// The hashes of the views' files, in their order. Throws InputError that names both views when one file is a copy of
/// another: noise that is counted twice makes every covariance too small.
std::vector<CalibrationInput> hashedViews(const ViewSet& set);

/// A view set with its beads found, or read, and told apart.
struct SeenViewSet {
  DetectorOfViews detector;
  std::vector<BeadView> views;
  std::vector<CalibrationInput> inputs;  ///< Hashes of the views' files.
};

/// Reads tables and finds beads, or the set's pattern, in images, and tells them apart by their sizes and places where
/// no table says which they are. Throws InputError that names file, view and rule: an image of another size, images of
/// marks without sizes, a view whose beads cannot be told apart or are mirrored, a view that is a copy of another.
SeenViewSet seenViews(const ViewSet& set, const BeadPhantom& phantom, const BeadDetectionSettings& settings = {},
                      const std::function<void(int done)>& progress = {});

/// Reads beads seen in one view, a row each (CSV): `x_px`, `y_px`, and optionally `std_px` (1 when it is not there),
/// `radius_px`, `contrast` and `bead`, its number in the phantom. Throws InputError that names file, line, field, value
/// and rule; numbers are given for all beads or for none.
std::vector<BeadDetection> readBeadTable(const std::string& path);

}  // namespace angio::calibration
