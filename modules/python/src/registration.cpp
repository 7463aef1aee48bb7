// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/registration.hpp"

#include <nlohmann/json.hpp>

#include "angio/base/stopwatch.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/imaging/collimator_opening.hpp"
#include "angio/results/case_run.hpp"
#include "fields.hpp"
#include "program_settings.hpp"
#include "seen.hpp"
#include "settings.hpp"
#include "unlocked.hpp"

namespace angio::python {
namespace {

using apps::ProgramSettings;
using Views = std::variant<const OwnedView*, std::vector<const OwnedView*>>;

ProgramSettings programSettings(const py::object& settings) {
  return withFields(ProgramSettings{}, settings, "settings");
}

// One view, or a list; Python's None is no view.
std::vector<const OwnedView*> listed(const Views& views) {
  const auto* one = std::get_if<const OwnedView*>(&views);
  std::vector<const OwnedView*> all = one ? std::vector{*one} : std::get<1>(views);
  if (all.empty()) throw InputError("", "views", "", "must be at least one");
  for (const OwnedView* view : all) {
    if (!view) throw InputError("", "views", "None", "must be an XrayView");
  }
  return all;
}

XrayViews borrowed(const Views& views) {
  XrayViews all;
  for (const OwnedView* view : listed(views)) all.push_back(view->borrowed());
  return all;
}

// As a pose file's. Throws InputError for what is no covariance.
const std::optional<Matrix6d>& requireCovariance(const std::optional<Matrix6d>& covariance) {
  if (!covariance) return covariance;
  const Matrix6d& C = *covariance;
  if (!C.allFinite()) throw InputError("", "covariance", "", "must be finite");
  const double scale = C.cwiseAbs().maxCoeff();
  if ((C - C.transpose()).cwiseAbs().maxCoeff() > 1e-6 * scale)
    throw InputError("", "covariance", "", "must be symmetric");
  if (eigenvaluesOfSymmetric(C).minCoeff() < -1e-6 * scale) {
    throw InputError("", "covariance", "", "must be positive semidefinite");
  }
  return covariance;
}

double imageTime_s(const Views& views) {
  double sum = 0;
  for (const OwnedView* view : listed(views)) sum += view->image_s;
  return sum;
}

// One method on one tree, as angio-register sets it up.
class TreeRegistration {
 public:
  TreeRegistration(std::shared_ptr<const VesselTree> tree, const std::string& method, bool nonrigid,
                   const py::object& settings)
      : tree_(std::move(tree)) {
    const ProgramSettings program = programSettings(settings);
    const RegistrationSettings chosen =
        program.of(method, nonrigid ? std::optional(Deformation::kNonrigid) : std::nullopt);
    starts_ = program.starts;
    if (const int own = startsOfPreset(method); own > 0) starts_.count = own;
    method_ = unlocked(
        [&] { return std::make_unique<Guarded<std::unique_ptr<Registration>>>(makeRegistration(chosen, *tree_)); });
  }

  TreeResult align(const Views& views, const Numbers& start, const std::optional<Numbers>& prior,
                   const std::optional<Matrix6d>& covariance) {
    const Pose from = poseOf(start, "start");
    const PosePrior known{prior ? poseOf(*prior, "prior") : from, requireCovariance(covariance)};
    const XrayViews all = borrowed(views);
    return {method_->use([&](auto& method) { return method->align(all, known, from); }), tree_, imageTime_s(views)};
  }

  TreeResult search(const Views& views, const Numbers& start, const py::object& starts,
                    const std::optional<Matrix6d>& covariance, const py::object& progress) {
    const PosePrior prior{poseOf(start, "start"), requireCovariance(covariance)};
    const StartSettings chosen = withFields(starts_, starts, "starts");
    const XrayViews all = borrowed(views);
    const PythonCallback report(progress);
    return {method_->use([&](auto& method) {
              return method->search(all, prior, chosen, [&](double share_done) { report(share_done); });
            }),
            tree_, imageTime_s(views)};
  }

  std::shared_ptr<const VesselTree> tree() const { return tree_; }

 private:
  std::shared_ptr<const VesselTree> tree_;
  StartSettings starts_;
  std::unique_ptr<Guarded<std::unique_ptr<Registration>>> method_;
};

CaseOutcome outcomeOf(const TreeResult& seen, bool of_each_point) {
  CaseOutcome outcome;
  outcome.result = seen.result;
  outcome.image_s = seen.image_s;
  addClaims(*seen.tree, of_each_point, outcome);
  return outcome;
}

OwnedView viewOfImage(const py::array& image, const XrayCamera& camera, const std::string& extractor,
                      const std::optional<Numbers>& T_view_first, const py::object& settings) {
  OwnedView view{{}, camera, Pose::Identity(), {}, imageOf(image, "image")};
  if (T_view_first) view.T_view_first = poseOf(*T_view_first, "T_view_first");
  const auto& size = camera.parameters();
  if (view.image.cols != size.width_px || view.image.rows != size.height_px) {
    throw InputError("", "image", std::to_string(view.image.rows) + " x " + std::to_string(view.image.cols),
                     "must be of the camera's " + std::to_string(size.height_px) + " x " +
                         std::to_string(size.width_px) + " pixels");
  }
  const ExtractorSettings chosen = apps::chosenExtractor(programSettings(settings), extractor);
  const py::gil_scoped_release release;
  const auto extract = makeExtractor(chosen);
  const Stopwatch stage;
  view.centerline = vesselsToMatch(extract->extract(view.image));
  view.collimator_px = findOpenField(view.image).polygon_px;
  view.image_s = stage.seconds();
  return view;
}

void bindView(py::module_& m) {
  py::class_<OwnedView>(m, "XrayView",
                        "What one X-ray view shows: a centreline, the camera that saw it, where the camera stands "
                        "against the first view's, and the corners of the collimated field.")
      .def(py::init([](const Centerline2d& centerline, const XrayCamera& camera,
                       const std::optional<Numbers>& T_view_first, const std::optional<Numbers>& collimator_px,
                       const std::optional<py::array>& image) {
             OwnedView view{centerline, camera, Pose::Identity(), {}, {}};
             if (T_view_first) view.T_view_first = poseOf(*T_view_first, "T_view_first");
             if (collimator_px) view.collimator_px = cornersOf(*collimator_px, "collimator_px");
             if (image) view.image = imageOf(*image, "image");
             return view;
           }),
           "centerline"_a, "camera"_a, py::kw_only(), "T_view_first"_a = py::none(), "collimator_px"_a = py::none(),
           "image"_a = py::none())
      .def_static("of_image", &viewOfImage,
                  "The view that an image shows: its vessels by the extractor, and its open field. Settings as a dict "
                  "or a file of angio-register.",
                  "image"_a, "camera"_a, py::kw_only(), "extractor"_a = "", "T_view_first"_a = py::none(),
                  "settings"_a = py::none())
      .def_readonly("centerline", &OwnedView::centerline, "What was seen.")
      .def_readonly("camera", &OwnedView::camera, "That saw it.")
      .def_property_readonly(
          "T_view_first", [](const OwnedView& v) { return arrayOf(v.T_view_first); },
          "The first view's camera frame in this one's, 4 x 4.")
      .def_property_readonly(
          "collimator_px", [](const OwnedView& v) { return rowsOf(v.collimator_px); },
          "Corners of the open field, N x 2 [px]; without any all is open.")
      .def_property_readonly(
          "image", [](const OwnedView& v) { return arrayOf(v.image); }, "None where it is not at hand.");
}

template <typename Value>
auto shown(Value RegistrationResult::*member) {
  return [member](const TreeResult& seen) { return AsPython<Value>::toPython(seen.result.*member); };
}

void bindResult(py::module_& m) {
  py::enum_<RegistrationStatus>(m, "RegistrationStatus", doc("RegistrationStatus"))
      .value("converged", RegistrationStatus::kConverged, doc("RegistrationStatus.kConverged"))
      .value("ambiguous", RegistrationStatus::kAmbiguous, doc("RegistrationStatus.kAmbiguous"))
      .value("diverged", RegistrationStatus::kDiverged, doc("RegistrationStatus.kDiverged"))
      .value("too_few_points", RegistrationStatus::kTooFewPoints, doc("RegistrationStatus.kTooFewPoints"));
  BoundStruct<AlignmentScore>(m, "AlignmentScore")
      .shows("model_explained", &AlignmentScore::model_explained)
      .shows("image_explained", &AlignmentScore::image_explained)
      .shows("model_residual_px", &AlignmentScore::model_residual_px)
      .shows("image_residual_px", &AlignmentScore::image_residual_px)
      .shows("model_rms_px", &AlignmentScore::model_rms_px)
      .shows("model_points", &AlignmentScore::model_points)
      .get()
      .def_property_readonly("score", &AlignmentScore::score, doc("AlignmentScore.score"));
  using R = RegistrationResult;
  const auto said = [](const char* field) { return doc(std::string("RegistrationResult.") + field); };
  py::class_<TreeResult>(m, "RegistrationResult", doc("RegistrationResult"))
      .def_property_readonly("status", shown(&R::status), "How far it can be believed.")
      .def_property_readonly(
          "converged", [](const TreeResult& s) { return s.result.status == RegistrationStatus::kConverged; },
          "Whether the status is `converged`.")
      .def_property_readonly("reason", shown(&R::reason), said("reason"))
      .def_property_readonly("T_camera_model", shown(&R::T_camera_model),
                             "The model in the first view's camera, 4 x 4.")
      .def_property_readonly("displacements_m", shown(&R::displacements_m), said("displacements_m"))
      .def_property_readonly("covariance", shown(&R::covariance), said("covariance"))
      .def_property_readonly("noise_covariance", shown(&R::noise_covariance), said("noise_covariance"))
      .def_property_readonly("deformation_std_m", shown(&R::deformation_std_m), said("deformation_std_m"))
      .def_property_readonly("ambiguity", shown(&R::ambiguity), said("ambiguity"))
      .def_property_readonly("alignment", shown(&R::alignment), "How well model and image explain each other.")
      .def_property_readonly("points_3d", shown(&R::points_3d), said("points_3d"))
      .def_property_readonly("points_2d", shown(&R::points_2d), said("points_2d"))
      .def_property_readonly(
          "usable_for", [](const TreeResult& s) { return outcomeOf(s, false).usable_for; },
          "Tasks whose needs the claimed covariance of a converged result meets: of `centre`, `view` and `navigate`.")
      .def_property_readonly(
          "point_covariances_m2", [](const TreeResult& s) { return outcomeOf(s, true).point_covariances_m2; },
          "Of each point of the tree, 3 x 3 in camera axes [m^2]; empty without a covariance.")
      .def_property_readonly(
          "point_central_covariances_m2",
          [](const TreeResult& s) { return outcomeOf(s, true).point_central_covariances_m2; },
          "The same of normal errors that have the 90 % intervals: 1.645 of their standard deviations hold 90 %.")
      .def_property_readonly(
          "tree", [](const TreeResult& s) { return std::const_pointer_cast<VesselTree>(s.tree); },
          "The tree that was registered.")
      .def(
          "as_dict",
          [](const TreeResult& s, bool point_covariance) {
            return pythonOf(caseAsJson(outcomeOf(s, point_covariance)));
          },
          "The result with the keys that angio-register writes: lengths in millimetres.", py::kw_only(),
          "point_covariance"_a = false)
      .def("__repr__", [](const TreeResult& s) {
        return "<angio.RegistrationResult: " + statusName(s.result.status) +
               (s.result.reason.empty() ? "" : ", " + s.result.reason) + ">";
      });
}

}  // namespace

void bindRegistration(py::module_& m) {
  bindView(m);
  bindResult(m);
  py::class_<TreeRegistration>(m, "Registration", doc("Registration"))
      .def(py::init<std::shared_ptr<VesselTree>, const std::string&, bool, const py::object&>(),
           "A method by its name or preset (\"oriented_kernel\", \"iterative_pnp:best\"), with settings as a dict or a "
           "file of angio-register: sections by method, and `starts`.",
           py::arg("tree").none(false), py::kw_only(), "method"_a = OrientedKernelSettings::kName, "nonrigid"_a = false,
           "settings"_a = py::none())
      .def("align", &TreeRegistration::align, doc("Registration.align"), "views"_a, "start"_a, py::kw_only(),
           "prior"_a = py::none(), "covariance"_a = py::none())
      .def(
          "search", &TreeRegistration::search,
          (std::string(doc("Registration.search")) +
           "\n\nviews: one XrayView, or a list. start: T_camera_model, 4 x 4. starts: a dict beside the settings' own: "
           "`count`, `seed`, `box_rotation_deg`, `box_translation_mm`. covariance: of the start, 6 x 6 [m, rad]. "
           "progress: called with the share that is done.")
              .c_str(),
          "views"_a, "start"_a, py::kw_only(), "starts"_a = py::none(), "covariance"_a = py::none(),
          "progress"_a = py::none())
      .def_property_readonly(
          "tree", [](const TreeRegistration& r) { return std::const_pointer_cast<VesselTree>(r.tree()); },
          doc("Registration.tree"));
}

}  // namespace angio::python
