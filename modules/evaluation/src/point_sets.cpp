// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/point_sets.hpp"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <nlohmann/json.hpp>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/report_html.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/registration/starts.hpp"
#include "angio/results/statistics.hpp"
#include "simulation_image.hpp"

namespace angio::evaluation {
namespace {

constexpr int kMaxIterations3d = 100, kHalveEvery = 5;
// A step that moves no point by more than this on average is rest [m].
constexpr double kRest_m = 1e-7;
// A nearest point is known no better than the points' distance from each other.
constexpr double kLast_m = 1e-3;
constexpr double kNoise_m = 0.5e-3, kStrangers = 0.5, kPart = 0.5;

struct Spread {
  double rotation_std_deg, translation_std_mm;
};
constexpr Spread kSpreads[] = {{2, 5}, {5, 10}, {10, 20}};
constexpr const char* kWorlds[] = {"the same points", "0.5 mm of noise", "half as many strangers",
                                   "half of the points"};
constexpr std::pair<const char*, Kernel> kLosses[] = {
    {"kernel", Kernel::kGaussian}, {"Huber", Kernel::kHuber}, {"squares", Kernel::kL2}};

double lossWeight(Kernel loss, double distance_m, double scale_m, double last_m) {
  if (loss == Kernel::kGaussian) return std::exp(-0.5 * std::pow(distance_m / scale_m, 2));
  if (loss == Kernel::kHuber) return distance_m <= last_m ? 1.0 : last_m / distance_m;
  return 1;
}

// What the source is matched with in one world, in the source's own frame.
Eigen::Matrix3Xd targetOf(const Eigen::Matrix3Xd& points, std::size_t world, SimulationRandom random) {
  Eigen::Matrix3Xd target = points;
  if (world == 1) {
    for (Eigen::Index i = 0; i < target.cols(); ++i) target.col(i) += kNoise_m * random.normals<3>();
  }
  if (world == 2) {
    const Eigen::Vector3d low = points.rowwise().minCoeff(), size = points.rowwise().maxCoeff() - low;
    const auto more = static_cast<Eigen::Index>(kStrangers * static_cast<double>(points.cols()));
    target.conservativeResize(3, points.cols() + more);
    for (Eigen::Index i = points.cols(); i < target.cols(); ++i) {
      const double u = random.uniform(), v = random.uniform(), w = random.uniform();
      target.col(i) = low + size.cwiseProduct(Eigen::Vector3d(u, v, w));
    }
  }
  if (world == 3) {  // Those nearest to one of them.
    const auto at = static_cast<Eigen::Index>(random.uniform() * static_cast<double>(points.cols()));
    const Eigen::Vector3d middle = points.col(std::min(at, points.cols() - 1));
    std::vector<Eigen::Index> order(static_cast<std::size_t>(points.cols()));
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Eigen::Index>(i);
    std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
      return (points.col(a) - middle).squaredNorm() < (points.col(b) - middle).squaredNorm();
    });
    const auto kept = static_cast<std::size_t>(kPart * static_cast<double>(order.size()));
    target.resize(3, static_cast<Eigen::Index>(kept));
    for (std::size_t i = 0; i < kept; ++i) target.col(static_cast<Eigen::Index>(i)) = points.col(order[i]);
  }
  return target;
}

}  // namespace

Pose alignedPointSets(const Eigen::Matrix3Xd& source, const Eigen::Matrix3Xd& target, const Pose& start, Kernel loss,
                      double last_m) {
  const Eigen::MatrixX3d rows = target.transpose();
  const nanoflann::KDTreeEigenMatrixAdaptor<Eigen::MatrixX3d, 3> index(3, rows, 10);
  Pose T = start;
  double scale_m = 0;
  Eigen::Matrix3Xd matched(3, source.cols());
  Eigen::VectorXd weight(source.cols());
  for (int iteration = 0; iteration < kMaxIterations3d; ++iteration) {
    const Eigen::Matrix3Xd moved = T * source;
    for (Eigen::Index i = 0; i < source.cols(); ++i) {
      Eigen::Index nearest = 0;
      double distance2_m2 = 0;
      index.index->knnSearch(moved.col(i).data(), 1, &nearest, &distance2_m2);
      matched.col(i) = target.col(nearest);
      weight[i] = std::sqrt(distance2_m2);
    }
    if (iteration == 0) scale_m = std::max(last_m, weight.maxCoeff());
    if (iteration > 0 && iteration % kHalveEvery == 0) scale_m = std::max(last_m, scale_m / 2);
    for (double& w : weight) w = lossWeight(loss, w, scale_m, last_m);
    if (!(weight.sum() > 0)) break;
    const Eigen::Vector3d from = source * weight / weight.sum(), to = matched * weight / weight.sum();
    Pose next = Pose::Identity();
    next.linear() =
        nearestRotation((matched.colwise() - to) * weight.asDiagonal() * (source.colwise() - from).transpose());
    next.translation() = to - next.linear() * from;
    const double step_m = ((next * source) - moved).colwise().norm().mean();
    T = next;
    if (step_m < kRest_m && (loss != Kernel::kGaussian || scale_m <= last_m)) break;
  }
  return T;
}

int pointSetStudySize(int trials) {
  return trials * static_cast<int>(std::size(kWorlds) * std::size(kSpreads) * std::size(kLosses));
}

Json pointSetStudy(const VesselTree& tree, int trials, int seed, const Progress& progress, Campaign* campaign) {
  Json study = Json::array();
  int done = 0;
  for (std::size_t world = 0; world < std::size(kWorlds); ++world) {
    for (const Spread& spread : kSpreads) {
      // By loss.
      const auto trial = [&](int i) {
        // The tree stays, and its copy is where the draw puts it.
        const Pose truth = drawnPose(Pose::Identity(), tree.centroid(), degToRad(spread.rotation_std_deg),
                                     1e-3 * spread.translation_std_mm, seed, i);
        const Eigen::Matrix3Xd target =
            truth * targetOf(tree.points(), world, SimulationRandom(seed, i, DrawFor::kStart, static_cast<int>(world)));
        std::vector<double> off_mm;
        for (const auto& loss : kLosses) {
          const Pose found = alignedPointSets(tree.points(), target, Pose::Identity(), loss.second, kLast_m);
          off_mm.push_back(1e3 * ((found * tree.points()) - (truth * tree.points())).colwise().norm().mean());
          if (progress) progress(++done);
        }
        return off_mm;
      };
      constexpr int kThreads = 1;
      const auto rows = recordsOf(
          campaign, trials, kThreads, [](int i) { return "trial " + std::to_string(i); }, trial);
      Json row = {{"world", kWorlds[world]},
                  {"rotation_std_deg", spread.rotation_std_deg},
                  {"translation_std_mm", spread.translation_std_mm}};
      for (std::size_t l = 0; l < std::size(kLosses); ++l) {
        std::vector<double> off_mm;
        for (const auto& of_trial : rows) off_mm.push_back(of_trial.at(l));
        const auto good =
            std::count_if(off_mm.begin(), off_mm.end(), [](double mm) { return mm < 1e3 * kSuccessMtre_m; });
        row["losses"][kLosses[l].first] = {{"success_percent", 100.0 * static_cast<double>(good) / trials},
                                           {"median_mm", percentile(off_mm, 0.5)}};
      }
      study.push_back(row);
    }
  }
  return study;
}

std::string pointSetTable(const Json& study) {
  std::string table =
      "3D to 3D: a tree's points to their moved copy, success (mean distance below 2 mm) and its median\n\n"
      "| target | start, std per axis |";
  for (const auto& loss : kLosses) table += std::string(" ") + loss.first + " |";
  table += "\n| --- | --- |" + std::string(" --- | --- | --- |\n");
  for (const Json& row : study) {
    table += "| " + row["world"].get<std::string>() +
             filled(" | {rotation_std_deg:%g deg}, {translation_std_mm:%g mm} |", row);
    for (const auto& loss : kLosses) {
      table += filled(" {success_percent:%.0f %%}, {median_mm:%.2f mm} |", row["losses"][loss.first]);
    }
    table += "\n";
  }
  return table;
}

std::string pointSetFigure(const Json& study) {
  std::vector<std::string> figures;
  for (const char* world : kWorlds) {
    Plot plot{"", {"spread of the starts per axis [mm]"}, {"success [%]", false, std::pair(0, 103)}};
    int color = 0;
    for (const auto& loss : kLosses) {
      PlotSeries series{loss.first, {}, {}, color++};
      for (const Json& row : study) {
        if (row["world"] != world) continue;
        series.x.push_back(row["translation_std_mm"]);
        series.y.push_back(row["losses"][loss.first]["success_percent"]);
      }
      plot.series.push_back(series);
    }
    figures.push_back(html::figure("3D to 3D: " + std::string(world), plot));
  }
  return html::grid(figures);
}

}  // namespace angio::evaluation
