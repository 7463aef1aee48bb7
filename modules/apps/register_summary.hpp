// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/perception/image_reading.hpp"
#include "angio/results/case_run.hpp"

namespace angio::apps {

/// How a registration was asked for, as far as another way could help.
struct RegistrationTry {
  std::size_t views = 1;
  bool from_image = false;  ///< Not from a centreline that somebody else found.
  std::string extractor;    ///< Of the image.
  bool nonrigid = false;
  StartSettings starts;
  std::optional<ImageReading> matching;  ///< In which other reading the image matches; nothing: in none, or not tried.
};

/// Returns an outcome's status, residuals and time, as a picture's caption.
std::string captionOf(const CaseOutcome& outcome);

/// Returns the caption, what the result is usable for, and, where it is not to be trusted, why not and what to try
/// next. One line, without a line's end.
std::string summaryOf(const CaseOutcome& outcome, const RegistrationTry& tried);

/// Returns the reading besides "as sent" in which the curves register; nothing where there is none. Takes as long as a
/// search for each of up to seven readings.
std::optional<ImageReading> matchingReading(Registration& registration, const XrayView& seen, const PosePrior& prior,
                                            const StartSettings& starts);

}  // namespace angio::apps
