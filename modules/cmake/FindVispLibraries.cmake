# SPDX-License-Identifier: GPL-2.0-or-later
# Finds the few ViSP libraries that are named as components, as imported targets: visp::core, visp::visual_features, visp::vs,
# visp::robot, visp::vision, visp::gui. ViSP's own config is not used: it rewrites the caller's compiler flags and links hundreds of
# objects.
if(NOT OpenCV_INCLUDE_DIRS)
  find_package(OpenCV 4.5 QUIET COMPONENTS core)  # ViSP's headers include its.
endif()
find_path(Visp_INCLUDE_DIR visp3/core/vpConfig.h PATH_SUFFIXES ${CMAKE_LIBRARY_ARCHITECTURE})
set(_visp_required Visp_INCLUDE_DIR OpenCV_INCLUDE_DIRS)
foreach(_part ${VispLibraries_FIND_COMPONENTS})
  find_library(Visp_${_part}_LIBRARY visp_${_part})
  list(APPEND _visp_required Visp_${_part}_LIBRARY)
endforeach()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(VispLibraries REQUIRED_VARS ${_visp_required})
if(VispLibraries_FOUND)
  foreach(_part ${VispLibraries_FIND_COMPONENTS})
    if(NOT TARGET visp::${_part})
      add_library(visp::${_part} UNKNOWN IMPORTED)
      set_target_properties(visp::${_part} PROPERTIES
        IMPORTED_LOCATION ${Visp_${_part}_LIBRARY}
        INTERFACE_INCLUDE_DIRECTORIES "${Visp_INCLUDE_DIR};${OpenCV_INCLUDE_DIRS}")
    endif()
  endforeach()
endif()
