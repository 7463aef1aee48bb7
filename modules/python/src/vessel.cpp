// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/errors.hpp"
#include "angio/vessel/model_id.hpp"
#include "angio/vessel/plausible_radii.hpp"
#include "angio/vessel/projection.hpp"
#include "angio/vessel/prune.hpp"
#include "angio/vessel/resample.hpp"
#include "angio/vessel/tree_topology.hpp"
#include "angio/vessel/undistort.hpp"
#include "fields.hpp"

namespace angio::python {
namespace {

using Radii = std::vector<std::optional<double>>;

// An array that shares the tree's own points and cannot be written.
py::array_t<double> pointsOfTree(const py::object& self) {
  const auto& points = self.cast<const VesselTree&>().points();
  py::array_t<double> rows({static_cast<py::ssize_t>(points.cols()), py::ssize_t{3}}, points.data(), self);
  rows.attr("setflags")("write"_a = false);
  return rows;
}

void bindTree(py::module_& m) {
  py::class_<VesselTree, std::shared_ptr<VesselTree>>(m, "VesselTree", doc("VesselTree"))
      .def(py::init([](const Numbers& points, std::vector<int> parents, const std::optional<Radii>& radii) {
             return std::make_shared<VesselTree>(pointsOf<3>(points, "points"), std::move(parents),
                                                 radii.value_or(Radii{}));
           }),
           doc("VesselTree.VesselTree"), "points"_a, "parents"_a, "radii"_a = py::none())
      .def("__len__", &VesselTree::size)
      .def_property_readonly("points", &pointsOfTree, doc("VesselTree.points"))
      .def_property_readonly("parents", &VesselTree::parents, doc("VesselTree.parents"))
      .def_property_readonly("radii", &VesselTree::radii, "N [m], None where it is not known.")
      .def_property_readonly("branches", &VesselTree::branches, doc("VesselTree.branches"))
      .def_property_readonly("centroid", &VesselTree::centroid, py::return_value_policy::copy,
                             doc("VesselTree.centroid"))
      .def_property_readonly("length", &VesselTree::length, doc("VesselTree.length"))
      .def(
          "tangents", [](const VesselTree& tree) { return rowsOf<3, double>(tree.tangents()); },
          doc("VesselTree.tangents"))
      .def_property_readonly(
          "model_id", [](const VesselTree& tree) { return static_cast<std::int64_t>(modelId(tree)); }, doc("modelId"))
      .def("__repr__", [](const VesselTree& tree) {
        return "<angio.VesselTree of " + std::to_string(tree.size()) + " points, " +
               std::to_string(tree.branches().size()) + " branches>";
      });
  m.def(
      "with_plausible_radii",
      [](const VesselTree& tree, double end_radius_m) {
        return std::make_shared<VesselTree>(withPlausibleRadii(tree, end_radius_m));
      },
      doc("withPlausibleRadii"), "tree"_a, "end_radius_m"_a);
  m.def(
      "beginning_at",
      [](const VesselTree& tree, const Eigen::Vector3d& place_m) {
        return std::make_shared<VesselTree>(beginningAt(tree, place_m));
      },
      doc("beginningAt"), "tree"_a, "place_m"_a);
  m.def(
      "without_long_edges",
      [](const VesselTree& tree, double max_m) { return std::make_shared<VesselTree>(withoutLongEdges(tree, max_m)); },
      doc("withoutLongEdges"), "tree"_a, "max_m"_a);
  m.def(
      "resampled",
      [](const VesselTree& tree, double spacing_m, int max_points) {
        if (!(spacing_m >= 0)) throw InputError("", "spacing_m", formatValue(spacing_m), "must not be negative");
        if (max_points < 2) throw InputError("", "max_points", std::to_string(max_points), "must be at least 2");
        return std::make_shared<VesselTree>(resampled(tree, spacing_m, max_points).tree);
      },
      doc("resampled"), "tree"_a, "spacing_m"_a, "max_points"_a = 1'000'000);
}

}  // namespace

void bindVessel(py::module_& m) {
  bindTree(m);
  BoundStruct<TreeLocation>(m, "TreeLocation")
      .field("branch", &TreeLocation::branch)
      .field("arc_m", &TreeLocation::arc_m)
      .takesFields();
  py::enum_<CurveKind>(m, "CurveKind", doc("CurveKind"))
      .value("vessel", CurveKind::kVessel)
      .value("device", CurveKind::kDevice);
  BoundStruct<Centerline2d> line(m, "Centerline2d");
  line.shows("points_px", &Centerline2d::points_px)
      .shows("tangent_rad", &Centerline2d::tangent_rad)
      .shows("branch", &Centerline2d::branch)
      .shows("radius_px", &Centerline2d::radius_px)
      .shows("std_px", &Centerline2d::std_px)
      .shows("contrast", &Centerline2d::contrast)
      .shows("kind", &Centerline2d::kind);
  line.get()
      .def(py::init([](const Numbers& points_px, std::vector<int> branch, Eigen::VectorXd radius_px) {
             return makeCenterline(pointsOf<2>(points_px, "points_px"), std::move(branch), std::move(radius_px));
           }),
           doc("makeCenterline"), "points_px"_a, "branch"_a = std::vector<int>{}, "radius_px"_a = Eigen::VectorXd())
      .def("__len__", &Centerline2d::size)
      .def("__repr__", [](const Centerline2d& c) {
        return "<angio.Centerline2d of " + std::to_string(c.size()) + " points" +
               (c.ordered() ? ", " + std::to_string(c.size() ? c.branch.back() + 1 : 0) + " branches>" : ">");
      });
  m.def(
      "projected_centerline",
      [](const VesselTree& tree, const XrayCamera& camera, const Numbers& T_camera_model) {
        return projectedCenterline(tree, camera, poseOf(T_camera_model, "T_camera_model"));
      },
      doc("projectedCenterline"), "tree"_a, "camera"_a, "T_camera_model"_a);
  m.def("of_kind", &ofKind, doc("ofKind"), "centerline"_a, "kind"_a);
  m.def("densified", &densified, "The centreline with points between its points, none further apart than `spacing_px`.",
        "centerline"_a, "spacing_px"_a);
}

}  // namespace angio::python
