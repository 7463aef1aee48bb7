// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/visp.hpp"

#include <visp3/core/vpEigenConversion.h>

#include "angio/base/errors.hpp"

namespace angio::geometry {

vpHomogeneousMatrix toVisp(const Pose& T) {
  vpHomogeneousMatrix M;
  vp::eigen2visp(T.matrix(), M);
  return M;
}

Pose fromVisp(const vpHomogeneousMatrix& M) {
  Pose T = Pose::Identity();
  T.affine() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(M.data).topRows<3>();
  const double defect = rotationDefect(T.linear());
  if (!(defect < 1e-4))
    throw InputError("vpHomogeneousMatrix", "R^T R - I", formatValue(defect), "must be a rotation matrix");
  requireFinite("vpHomogeneousMatrix", "t", T.translation().sum());
  T.linear() = nearestRotation(T.linear());
  return T;
}

vpMatrix toVisp(const Eigen::Ref<const Eigen::MatrixXd>& M) {
  vpMatrix result;
  vp::eigen2visp(M, result);
  return result;
}

vpCameraParameters toVisp(const XrayCamera& camera) {
  const auto& p = camera.parameters();
  return vpCameraParameters(p.fx_px, p.fy_px, p.cx_px, p.cy_px);
}

XrayCamera fromVisp(const vpCameraParameters& parameters, int width_px, int height_px) {
  if (parameters.get_projModel() != vpCameraParameters::perspectiveProjWithoutDistortion) {
    throw InputError("vpCameraParameters", "distortion", "present", "must be corrected in the image first");
  }
  XrayCamera::Parameters p;
  p.width_px = width_px;
  p.height_px = height_px;
  p.fx_px = parameters.get_px();
  p.fy_px = parameters.get_py();
  p.cx_px = parameters.get_u0();
  p.cy_px = parameters.get_v0();
  return XrayCamera(p);
}

}  // namespace angio::geometry
