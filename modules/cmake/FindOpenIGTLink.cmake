# SPDX-License-Identifier: GPL-2.0-or-later
# Finds OpenIGTLink 1.11: target openigtlink::OpenIGTLink. Its own package file on Debian names no target and stands where CMake does
# not look.
find_path(OPENIGTLINK_INCLUDE_DIR igtlMessageBase.h PATH_SUFFIXES openigtlink)
find_library(OPENIGTLINK_LIBRARY OpenIGTLink)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenIGTLink REQUIRED_VARS OPENIGTLINK_INCLUDE_DIR OPENIGTLINK_LIBRARY)
if(OpenIGTLink_FOUND AND NOT TARGET openigtlink::OpenIGTLink)
  add_library(openigtlink::OpenIGTLink UNKNOWN IMPORTED)
  set_target_properties(openigtlink::OpenIGTLink PROPERTIES
    IMPORTED_LOCATION ${OPENIGTLINK_LIBRARY} INTERFACE_INCLUDE_DIRECTORIES ${OPENIGTLINK_INCLUDE_DIR})
endif()
