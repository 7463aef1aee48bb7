// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/certificate.hpp"

#include <nlohmann/json.hpp>

#include "angio/results/case_run.hpp"
#include "fields.hpp"
#include "seen.hpp"
#include "settings.hpp"
#include "unlocked.hpp"

namespace angio::python {
namespace {

PoseCertificate certified(const VesselTree& tree, const OwnedView& view, const Numbers& box_center,
                          const Numbers& found, const CertificateSettings& settings, const py::object& progress) {
  const Pose center = poseOf(box_center, "box_center"), pose = poseOf(found, "found");
  const PythonCallback report(progress);
  return unlocked([&] {
    return certify(tree, view.borrowed(), center, pose, settings,
                   [&](double share_closed, double bound) { report(share_closed, bound); });
  });
}

PoseError errorOf(const VesselTree& tree, const XrayCamera& camera, const Numbers& estimate, const Numbers& truth,
                  const std::optional<Numbers>& displacements, const std::optional<Numbers>& true_displacements) {
  const auto placed = [](const Numbers& T, const std::optional<Numbers>& moved, const std::string& field) {
    return PlacedTree{poseOf(T, field), moved ? pointsOf<3>(*moved, field + "_displacements") : Eigen::Matrix3Xd()};
  };
  const PlacedTree a = placed(estimate, displacements, "estimate"), b = placed(truth, true_displacements, "truth");
  for (const PlacedTree* one : {&a, &b}) {
    if (one->displacements_m.cols() == 0 || one->displacements_m.cols() == tree.size()) continue;
    throw InputError("", one == &a ? "displacements" : "true_displacements",
                     std::to_string(one->displacements_m.cols()) + " rows",
                     "must be as many as the tree has points, " + std::to_string(tree.size()));
  }
  return poseError(tree, camera, a, b);
}

}  // namespace

void bindCertificate(py::module_& m) {
  py::class_<PoseCertificate>(m, "PoseCertificate", doc("PoseCertificate"))
      .def_readonly("proven", &PoseCertificate::proven, doc("PoseCertificate.proven"))
      .def_readonly("score", &PoseCertificate::score, doc("PoseCertificate.score"))
      .def_readonly("bound", &PoseCertificate::bound, doc("PoseCertificate.bound"))
      .def_readonly("unexplained_cost", &PoseCertificate::unexplained_cost, doc("PoseCertificate.unexplained_cost"))
      .def_readonly("reason", &PoseCertificate::reason, doc("PoseCertificate.reason"))
      .def_readonly("seconds", &PoseCertificate::seconds, "How long it took.")
      .def_readonly("cells", &PoseCertificate::cells, doc("PoseCertificate.cells"))
      .def_property_readonly(
          "alternative",
          [](const PoseCertificate& c) {
            return c.alternative ? std::optional(arrayOf(c.alternative->T_camera_model)) : std::nullopt;
          },
          "T_camera_model of a different pose of the box that reaches the share, 4 x 4; None where none was found.")
      .def_property_readonly(
          "alternative_share",
          [](const PoseCertificate& c) { return c.alternative ? std::optional(c.alternative->share) : std::nullopt; },
          doc("PoseCertificate.Alternative.share"));
  m.def(
      "certify",
      [](const VesselTree& tree, const OwnedView& view, const Numbers& box_center, const Numbers& found,
         double box_rotation_deg, double box_translation_mm, double alternative_share, double distance_mm,
         double seconds, int threads, const py::object& progress) {
        return certified(tree, view, box_center, found,
                         {box_rotation_deg, box_translation_mm, alternative_share, distance_mm, seconds, threads},
                         progress);
      },
      doc("certify"), "tree"_a, "view"_a, "box_center"_a, "found"_a, py::kw_only(),
      "box_rotation_deg"_a = CertificateSettings{}.box_rotation_deg,
      "box_translation_mm"_a = CertificateSettings{}.box_translation_mm,
      "alternative_share"_a = CertificateSettings{}.alternative_share,
      "distance_mm"_a = CertificateSettings{}.distance_mm, "seconds"_a = CertificateSettings{}.seconds,
      "threads"_a = CertificateSettings{}.threads, "progress"_a = py::none());
  BoundStruct<PoseError>(m, "PoseError")
      .shows("mtre_m", &PoseError::mtre_m)
      .shows("depth_m", &PoseError::depth_m)
      .shows("in_plane_m", &PoseError::in_plane_m)
      .shows("across_beam_m", &PoseError::across_beam_m)
      .shows("mpd_px", &PoseError::mpd_px)
      .shows("mpd_isocenter_m", &PoseError::mpd_isocenter_m)
      .shows("rotation_rad", &PoseError::rotation_rad)
      .shows("centroid_m", &PoseError::centroid_m)
      .shows("source_m", &PoseError::source_m);
  m.def("pose_error", &errorOf,
        "How far an estimate of T_camera_model is from the truth, on the points of the tree. Displacements are N x 3 "
        "[m] in model axes.",
        "tree"_a, "camera"_a, "estimate"_a, "truth"_a, py::kw_only(), "displacements"_a = py::none(),
        "true_displacements"_a = py::none());
}

}  // namespace angio::python
