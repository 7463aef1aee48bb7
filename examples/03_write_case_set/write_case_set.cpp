// SPDX-License-Identifier: GPL-2.0-or-later
// How do I make a case set with known truth? Projects a tree at a C-arm view and starts away from the truth.
//
// The protocol of the paper's Table I: no noise, one 2D point per 3D point, starts off by 2 deg and 5 mm (standard
// deviation per axis, about the tree's centroid). With --image the frames are rendered instead, and the centreline is
// for the extractor.
#include <cstdio>

#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/claimed_folder.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/registration/starts.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/vessel/projection.hpp"
#include "angio/vessel/resample.hpp"

namespace {

struct Options {
  std::string tree = angio::cli::exampleDataFile("hepatic-tace/tree.csv"), out = "cases";
  int cases = 100, seed = 1;
  double rotation_std_deg = 2, translation_std_mm = 5, spacing_mm = 1, primary_deg = 30, secondary_deg = 15;
  bool image = false;
};

int write(const Options& o) {
  // The C-arm of the hepatic case; the model's y axis runs down the patient, its z axis to the back.
  const angio::geometry::CArmGeometry carm;
  Eigen::Matrix3d R_lps_model;
  R_lps_model << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const angio::vessel::VesselTree tree =
      angio::vessel::resampled(angio::io::readVesselTree(o.tree), o.spacing_mm * 1e-3, 15000).tree;
  angio::geometry::Pose truth = angio::geometry::Pose::Identity();
  truth.linear() = angio::geometry::viewRotation(
                       {angio::geometry::degToRad(o.primary_deg), angio::geometry::degToRad(o.secondary_deg)}) *
                   R_lps_model;
  truth.translation() = Eigen::Vector3d(0, 0, carm.source_isocenter_distance_m) - truth.linear() * tree.centroid();

  const angio::io::ClaimedFolder claimed(o.out);
  const std::string base = o.out + "/";
  angio::io::writeVesselTree(base + "tree.csv", tree);
  angio::io::writeCamera(base + "camera.yaml", carm.camera());
  angio::io::writePose(base + "truth.yaml", {truth, {}});
  if (!o.image)
    angio::io::writeCenterline(base + "centerline.csv", angio::vessel::projectedCenterline(tree, carm.camera(), truth));

  angio::simulation_settings::FluoroscopySettings look;
  look.seed = o.seed;
  angio::simulation::FluoroscopyRenderer renderer(
      angio::simulation::withPlausibleRadii(tree, look.end_radius_mm * 1e-3), look);
  std::string cases = "tree: tree.csv\ncamera: camera.yaml\ncases:\n";
  for (int i = 0; i < o.cases; ++i) {
    char name[16];
    std::snprintf(name, sizeof name, "%04d", i);
    angio::io::writePose(
        base + "start" + name + ".yaml",
        {angio::registration::drawnPose(truth, tree.centroid(), angio::geometry::degToRad(o.rotation_std_deg),
                                        o.translation_std_mm * 1e-3, o.seed, i),
         {}});
    std::string seen = "centerline: centerline.csv";
    if (o.image) {
      seen = std::string("image: frame") + name + ".png";
      angio::io::writeImage(base + "frame" + name + ".png",
                            renderer.render(carm.camera(), truth, static_cast<std::uint64_t>(i)));
    }
    cases += std::string("  - name: \"") + name + "\"\n    " + seen + "\n    initial_pose: start" + name +
             ".yaml\n    truth_pose: truth.yaml\n";
  }
  angio::io::writeWholeFile(base + "cases.yaml", cases);
  std::printf("%d cases, %d points, in %s\n", o.cases, tree.size(), o.out.c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  angio::cli::Command app("Writes a simulated case set with known truth for angio-evaluate.",
                          "example-03-write-case-set");
  angio::cli::describeProgram(
      app, "example-03-write-case-set --cases 100 --out cases && angio-evaluate cases cases/cases.yaml");
  Options o;
  app.addOption("--tree", o.tree, "Vessel tree");
  app.addOption("--out", o.out, "Folder");
  app.addOption("--cases", o.cases, "Number of starts")->check(angio::cli::wholeBetween(1, 100000));
  app.addOption("--seed", o.seed, "Seed of the starts")->check(angio::cli::wholeBetween(0, 2147483647));
  app.addOption("--rotation-std-deg", o.rotation_std_deg, "Spread of the starts per axis")
      ->check(angio::cli::between(0.0, 180.0));
  app.addOption("--translation-std-mm", o.translation_std_mm, "Spread of the starts per axis")
      ->check(angio::cli::between(0.0, 1000.0));
  app.addOption("--spacing-mm", o.spacing_mm, "Distance between points of the tree")
      ->check(angio::cli::between(0.05, 100.0));
  app.addOption("--primary-deg", o.primary_deg, "View: LAO positive")->check(angio::cli::between(-180.0, 180.0));
  app.addOption("--secondary-deg", o.secondary_deg, "View: CRA positive")->check(angio::cli::between(-90.0, 90.0));
  app.addFlag("--image", o.image, "Render X-ray images instead of projecting centrelines");
  return angio::cli::runProgram(app, argc, argv, [&] { return write(o); });
}
