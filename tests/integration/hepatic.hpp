// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

// A sanitizer makes everything some ten times slower: what takes long is then done for a shorter time.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define ANGIO_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer) || \
    __has_feature(undefined_behavior_sanitizer)
#define ANGIO_SANITIZED 1
#endif
#endif

namespace angio::test {

#ifdef ANGIO_SANITIZED
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

inline VesselTree hepaticTree() { return readVesselTree(exampleData("hepatic-tace/tree.csv")); }
inline CArmCalibration hepaticCalibration() { return readCArmCalibration(exampleData("hepatic-tace/carm.yaml")); }

}  // namespace angio::test
