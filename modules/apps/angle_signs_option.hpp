// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/apps/namespace.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/xa_files.hpp"

namespace angio::apps {

/// Adds --angle-signs: what a DICOM run's angles count from.
inline cli::Option* addAngleSignsOption(cli::Command& app, XaAngleSigns& signs) {
  return app
      .addOption("--angle-signs", signs,
                 "What + means in a DICOM run's primary and secondary angle: DICOM says LAO and CRA; of a run that "
                 "counts otherwise the letters at the picture's edges are wrong")
      ->check(cli::choice<XaAngleSigns>({{"lao-cra", XaAngleSigns::kLaoCra},
                                         {"rao-cra", XaAngleSigns::kRaoCra},
                                         {"lao-cau", XaAngleSigns::kLaoCau},
                                         {"rao-cau", XaAngleSigns::kRaoCau}}))
      ->defaultText("lao-cra");
}

}  // namespace angio::apps
