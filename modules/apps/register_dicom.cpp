// SPDX-License-Identifier: GPL-2.0-or-later
#include "register_dicom.hpp"

#include "angio/base/formatted.hpp"
#include "angio/cli/command_line.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/io/dicom_registration.hpp"
#include "angio/vessel/model_id.hpp"

namespace angio::apps {

void DicomOutputs::addTo(cli::Command& app) {
  auto* pose = app.addOption("--dicom-registration", registration,
                             "The pose as a DICOM Spatial Registration (.dcm), of a result that converged");
  app.addOption("--frame-of-reference", frame_of_reference,
                "DICOM UID of the volume's frame that the tree's points lie in (L, P, S)")
      ->needs(pose)
      ->group(cli::kFurtherOptions);
  app.addOption("--dicom-overlay", overlay, "The picture as a DICOM Secondary Capture (.dcm)")
      ->group(cli::kFurtherOptions);
}

void DicomOutputs::write(const VesselTree& tree, const std::string& method, const CaseOutcome& outcome,
                         const std::string& run_path, const std::function<cv::Mat()>& picture) const {
  const RegistrationResult& result = outcome.result;
  // A rigid object cannot say how the tree is deformed.
  const std::string part = result.displacements_m.size() > 0 ? ", rigid part" : "";
  const std::string description =
      method + part + formatted(", image to tree %.2f px", result.alignment.image_residual_px);
  if (!registration.empty() && result.status == RegistrationStatus::kConverged) {
    writeDicomRegistration(registration, {result.T_camera_model, modelId(tree), frame_of_reference, description},
                           run_path);
  }
  if (!overlay.empty()) {
    writeSecondaryCapture(overlay, picture(), description + ", " + statusName(result.status), run_path);
  }
}

}  // namespace angio::apps
