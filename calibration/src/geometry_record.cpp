// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>

#include "angio/base/formatted.hpp"
#include "geometry_problem.hpp"
#include "information.hpp"

namespace angio::calibration {
namespace {

// The model's numbers as they stand in its fields; the phantom's place has none.
Eigen::VectorXd numbersOf(const CArmGeometry& carm) {
  const CArmDeviations& d = carm.deviations;
  Eigen::VectorXd numbers = Eigen::VectorXd::Zero(kModelNumbers);
  numbers.segment<kCArmPoseParameters>(kFirstArmNumber) = carm.poseParameters();
  numbers.segment<kCameraNumbers>(kFirstCameraNumber) << d.source_detector_offset_m, d.pixel_aspect,
      d.principal_point_px, d.principal_point_slope_px_per_m;
  for (int i = 0; i < d.flex.count; ++i) {
    numbers.segment<6>(kFirstFlexNumber + 6 * i) = d.flex.terms[i].twist;
  }
  return numbers;
}

void addViews(const GeometryProblem& problem, const GeometryModel& model, CalibrationRecord& record) {
  const auto& views = problem.views();
  const std::vector<GeometryViewFit> fits = geometryFits(problem, model);
  std::vector<bool> held_out(views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    held_out[i] = views[i].held_out;
    record.views.push_back({views[i].name, std::max(views[i].beads, 1), fits[i].residual, fits[i].left_out});
  }
  record.residual_unit = problem.registered() ? "mm" : "px";
  record.residual_rms = problem.residualRms(model, problem.used);
  if (std::count(held_out.begin(), held_out.end(), true) > 0) {
    record.held_out_rms = problem.residualRms(model, held_out);
  }
}

}  // namespace

CalibrationRecord geometryRecord(const GeometryProblem& problem, const GeometryModel& model) {
  CalibrationRecord record;
  record.kind = "geometry";
  const Eigen::MatrixXd covariance = covarianceOf(problem.information(model));
  // The phantom's place is nobody's concern afterwards.
  const std::vector<int> places = problem.freePlaces();
  const Eigen::VectorXd numbers = numbersOf(model.carm);
  const auto count = static_cast<Eigen::Index>(places.size()) - kPhantomNumbers;
  const int used = static_cast<int>(std::count(problem.used.begin(), problem.used.end(), true));
  record.values.resize(count + 2);
  record.covariance = Eigen::MatrixXd::Zero(count + 2, count + 2);
  Eigen::VectorXd per_unit(count);
  Eigen::Index rigid = 0;
  for (Eigen::Index i = 0; i < count; ++i) {
    const int place = places[i + kPhantomNumbers];
    const GeometryNumber number = geometryNumber(place);
    record.parameters.push_back(number.name);
    per_unit[i] = 1 / number.unit;
    record.values[i] = numbers[place] * per_unit[i];
    if (place < kFirstFlexNumber) rigid = i + 1;
  }
  const Eigen::MatrixXd block =
      per_unit.asDiagonal() * covariance.bottomRightCorner(count, count) * per_unit.asDiagonal();
  record.covariance.topLeftCorner(count, count) = 0.5 * (block + block.transpose());
  // Standard deviations of a normal scatter from three axes of each view.
  const double relative = 1 / std::sqrt(6.0 * std::max(used, 1));
  const double scatter[2] = {problem.scatter.translation_m * 1e3, radToDeg(problem.scatter.rotation_rad)};
  for (Eigen::Index i = 0; i < 2; ++i) {
    record.parameters.push_back(i == 0 ? "pose_scatter_mm" : "pose_scatter_deg");
    record.values[count + i] = scatter[i];
    record.covariance(count + i, count + i) = std::pow(relative * scatter[i], 2);
  }
  const Observability seen = observability({record.parameters.begin(), record.parameters.begin() + rigid},
                                           record.covariance.topLeftCorner(rigid, rigid));
  record.condition = seen.condition;
  record.weak_directions = seen.weak_directions;
  addViews(problem, model, record);
  return record;
}

std::vector<GeometryViewFit> geometryFits(const GeometryProblem& problem, const GeometryModel& model) {
  std::vector<GeometryViewFit> fits;
  for (std::size_t i = 0; i < problem.views().size(); ++i) {
    const ViewObservation& view = problem.views()[i];
    std::vector<bool> only(problem.views().size(), false);
    only[i] = true;
    fits.push_back({view.name, view.joints, problem.residualRms(model, only), problem.miss(view, model), view.held_out,
                    !view.held_out && !problem.used[i]});
  }
  return fits;
}

std::vector<std::string> geometryDoubts(const GeometryProblem& problem) {
  std::vector<std::string> doubts;
  for (std::size_t i = 0; i < problem.views().size(); ++i) {
    const ViewObservation& seen = problem.views()[i];
    if (!seen.held_out && !problem.used[i]) {
      doubts.push_back("view " + seen.name + " is left out: the others do not fit it");
    }
    if (!seen.far_beads.empty()) {
      const std::size_t far = seen.far_beads.size();
      doubts.push_back(formatted("view %s: %zu of %zu beads lie elsewhere and are left out", seen.name.c_str(), far,
                                 far + static_cast<std::size_t>(seen.beads)));
    }
  }
  return doubts;
}

}  // namespace angio::calibration
