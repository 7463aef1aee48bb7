// SPDX-License-Identifier: GPL-2.0-or-later
// Simulated pairs of pictures and the motion between them, for train_pairwise_dnn.py.
#include <filesystem>
#include <fstream>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "image_gradient.hpp"
#include "image_pair.hpp"

namespace angio::apps {
namespace {

// Starts that are further off are no task for a network that sees the tree's surroundings only [px of the pair].
constexpr double kMostMotion_px = 15;

struct Options {
  std::string out;
  int trees = 800, views = 6, starts = 5, seed = 1;
};

// One engine's draws.
class Draws {
 public:
  explicit Draws(int seed, int tree) {
    std::seed_seq sequence{seed, tree};
    engine_.seed(sequence);
  }
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  Eigen::Vector3d normals() {
    std::normal_distribution<double> normal;
    const double x = normal(engine_), y = normal(engine_), z = normal(engine_);
    return {x, y, z};
  }
  Eigen::Matrix3d rotation() {
    return Eigen::Quaterniond(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1))
        .normalized()
        .toRotationMatrix();
  }

 private:
  std::mt19937_64 engine_;
};

// A tree of 60 to 220 mm whose vessels bend and part by Murray's law; no two are alike.
VesselTree grownTree(Draws& draws) {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  const int generations = draws.whole(3, 6);
  const double shorter = draws.uniform(0.7, 0.9), spread = draws.uniform(0.4, 1.1), bend = draws.uniform(0.01, 0.05);
  const std::function<void(int, Eigen::Vector3d, Eigen::Vector3d, double, double, int)> grow =
      [&](int parent, Eigen::Vector3d at, Eigen::Vector3d direction, double radius_m, double length_m, int generation) {
        Eigen::Vector3d turn = bend * draws.normals();
        const int steps = std::max(4, static_cast<int>(length_m * draws.uniform(0.6, 1.4) / 1e-3));
        for (int i = 0; i < steps; ++i) {
          turn += 0.2 * bend * draws.normals();
          turn *= 0.97;
          direction = (direction + turn).normalized();
          at += 1e-3 * direction;
          points.push_back(at);
          parents.push_back(parent);
          radii.emplace_back(radius_m);
          parent = static_cast<int>(points.size()) - 1;
        }
        if (generation == generations) return;
        const Eigen::Vector3d side = direction.cross(draws.normals()).normalized();
        const double share = draws.uniform(0.2, 0.8);  // Of the blood, into one of the two.
        for (const double sign : {-1.0, 1.0}) {
          const double part = sign > 0 ? share : 1 - share;
          grow(parent, at, (direction + sign * spread * (1.2 - part) * side).normalized(), radius_m * std::cbrt(part),
               shorter * length_m, generation + 1);
        }
      };
  points.push_back(Eigen::Vector3d::Zero());
  parents.push_back(-1);
  const double radius_m = draws.uniform(1.5e-3, 4e-3);
  radii.emplace_back(radius_m);
  grow(0, points.front(), draws.normals().normalized(), radius_m, draws.uniform(0.02, 0.05), 0);
  Eigen::Matrix3Xd matrix(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
  const Eigen::AlignedBox3d box(matrix.rowwise().minCoeff(), matrix.rowwise().maxCoeff());
  matrix *= draws.uniform(0.06, 0.22) / box.sizes().maxCoeff();
  return VesselTree(matrix, parents, radii);
}

FluoroscopySettings drawnLook(Draws& draws, int seed) {
  FluoroscopySettings look;
  look.contrast_attenuation_per_mm = draws.uniform(0.03, 0.12);
  look.photons_per_pixel = std::exp(draws.uniform(std::log(300), std::log(10000)));
  look.background_strength = draws.uniform(0, 0.15);
  look.anatomy.region = static_cast<Region>(draws.whole(0, 2));
  look.anatomy.contrast = draws.uniform(0.05, 0.25);
  look.seed = seed;
  return look;
}

XrayCamera drawnCamera(Draws& draws) {
  const int width_px = draws.whole(480, 960);
  return XrayCamera::centered(width_px, width_px, draws.uniform(0.22, 0.36) / width_px, draws.uniform(1, 1.3));
}

// Eight bits: (value + 4) * 32, so that a step is a thirtieth of the picture's standard deviation.
void append(const cv::Mat& picture, std::string& record) {
  cv::Mat bytes;
  picture.convertTo(bytes, CV_8U, 32, 128);
  record.append(reinterpret_cast<const char*>(bytes.data), bytes.total());
}

// Of one tree: each view's ideal and clinical picture with draws of starts.
void writePairs(const Options& o, int index, std::ofstream& file) {
  Draws draws(o.seed, index);
  const VesselTree tree = grownTree(draws);
  Surroundings around;
  around.R_lps_model = draws.rotation();
  FluoroscopyRenderer clinic(tree, drawnLook(draws, o.seed + 7919 * index), around);
  PairDrawing drawing(tree, 0.6e-3);
  const Centerline2d none;
  for (int v = 0; v < o.views; ++v) {
    const XrayCamera camera = drawnCamera(draws);
    Pose truth = Pose::Identity();  // Of the centred tree.
    truth.linear() = draws.rotation();
    truth.translation() =
        Eigen::Vector3d(0.025, 0.025, 0.06).cwiseProduct(draws.normals()) + 0.75 * Eigen::Vector3d::UnitZ();
    const Pose T_camera_model = truth * Eigen::Translation3d(-tree.centroid());
    const cv::Mat clinical = vesselAttenuation(clinic.render(camera, T_camera_model, static_cast<std::uint64_t>(v)));
    cv::Mat ideal = clinic.pathLength(camera, T_camera_model), wide;
    cv::GaussianBlur(ideal, wide, {}, kAnatomy_px);
    ideal -= wide;
    const XrayView view{none, camera};
    for (int s = 0; s < o.starts; ++s) {
      // Sizes that do not hang together: a search ends its shifts long before its turns.
      const auto size = [&] { return std::exp(draws.uniform(std::log(0.03), std::log(1.3))); };
      Pose start = truth;
      start.translation() += size() * 0.010 * draws.normals();
      start.linear() = expSO3(size() * degToRad(5) * draws.normals()) * truth.linear();
      const auto window = PairWindow::about(drawing.pointsCentered(), view, start);
      if (!window) continue;
      const PairMotion motion = pairMotion(*window, start, truth);
      if (motion.cwiseAbs().maxCoeff() > kMostMotion_px) continue;
      const ImagePair seen = drawing.pair(clinical, view, *window, start);
      const Eigen::Matrix<float, 6, 1> single = motion.cast<float>();
      std::string record(reinterpret_cast<const char*>(single.data()), sizeof(float) * 6);
      append(seen.seen, record);
      append(drawing.pair(ideal, view, *window, start).seen, record);
      append(seen.drawn, record);
      append(seen.depth, record);
      file.write(record.data(), static_cast<std::streamsize>(record.size()));
    }
  }
}

int writeAll(const Options& o) {
  requireFolderOf(o.out);
  // Gigabytes, which grow beside the name that they get once they are whole.
  const std::string growing = o.out + ".part";
  std::ofstream file(growing, std::ios::binary);
  ProgressBar bar("simulating", o.trees);
  for (int i = 0; i < o.trees; ++i) {
    writePairs(o, i, file);
    if (!file) break;
    bar.show(i + 1);
  }
  file.close();
  std::error_code failed;
  if (file) std::filesystem::rename(growing, o.out, failed);
  if (file && !failed) return 0;
  std::filesystem::remove(growing, failed);
  throw InputError(o.out, "", "", "cannot be written whole");
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  using angio::cli::wholeBetween;
  angio::cli::Command app("Simulates pairs of pictures that the network of pairwise_dnn learns from.",
                          "angio-training-pairs");
  angio::apps::describeProgram(app, "angio-training-pairs --out pairs.bin");
  angio::apps::Options o;
  app.addOption("--out", o.out, "File of records: six motions (float, px), then four pictures (8 bits)")->required();
  app.addOption("--trees", o.trees, "Grown trees, each another one")->check(wholeBetween(1, 1000000));
  app.addOption("--views", o.views, "Views of each tree")->check(wholeBetween(1, 1000));
  app.addOption("--starts", o.starts, "Starts of each view")->check(wholeBetween(1, 1000));
  app.addOption("--seed", o.seed, "Seed of all draws")->check(wholeBetween(0, 2147483647));
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::writeAll(o); });
}
