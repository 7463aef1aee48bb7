# SPDX-License-Identifier: GPL-2.0-or-later
# Finds LCM 1.3's library and its code generator: target lcm::lcm and program LCM_GEN.
find_path(LCM_INCLUDE_DIR lcm/lcm-cpp.hpp)
find_library(LCM_LIBRARY lcm)
find_program(LCM_GEN lcm-gen)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(LCM REQUIRED_VARS LCM_INCLUDE_DIR LCM_LIBRARY)
if(LCM_FOUND AND NOT TARGET lcm::lcm)
  add_library(lcm::lcm UNKNOWN IMPORTED)
  set_target_properties(lcm::lcm PROPERTIES
    IMPORTED_LOCATION ${LCM_LIBRARY} INTERFACE_INCLUDE_DIRECTORIES ${LCM_INCLUDE_DIR})
endif()
