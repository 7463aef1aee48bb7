# SPDX-License-Identifier: GPL-2.0-or-later
# Every library from outside, found once. ViSP's and LCM's are found by our own modules: ViSP's config rewrites
# CMAKE_CXX_FLAGS and the standard of whoever calls it, and LCM 1.3 has none.

# angio_know_package(package prefix [find_package() arguments...])
#
# Says which package brings the targets whose names start with `prefix`. The installed components find their own packages by it,
# in the order in which they are listed here. With COMPONENTS among the arguments, a package's component is named like its
# target, and an installed module asks for those that it links.
function(angio_know_package package prefix)
  set_property(GLOBAL APPEND PROPERTY ANGIO_PACKAGES ${package})
  set_property(GLOBAL PROPERTY ANGIO_PACKAGE_${package}_PREFIX ${prefix})
  set_property(GLOBAL PROPERTY ANGIO_PACKAGE_${package}_ARGUMENTS ${ARGN})
endfunction()

# The same, and finds the package. A macro, as what find_package() sets is for the caller.
macro(angio_find_package package prefix)
  angio_know_package(${package} ${prefix} ${ARGN})
  find_package(${package} ${ARGN} REQUIRED)
endmacro()

angio_find_package(Threads Threads::)
angio_find_package(Eigen3 Eigen3:: 3.4 NO_MODULE)
angio_find_package(OpenCV opencv_ 4.5 COMPONENTS core imgproc imgcodecs ximgproc calib3d dnn videoio)
angio_find_package(Ceres Ceres:: 2.1)
angio_find_package(nanoflann nanoflann::)
angio_find_package(hwy hwy:: CONFIG)
angio_find_package(yaml-cpp yaml-cpp)
angio_find_package(nlohmann_json nlohmann_json::)
angio_find_package(CLI11 CLI11::)
angio_find_package(ZLIB ZLIB::)
angio_find_package(zstd zstd:: CONFIG)
angio_find_package(OpenSSL OpenSSL::)
angio_find_package(PNG PNG::)
angio_find_package(TIFF TIFF::)
angio_find_package(JPEG JPEG::)
angio_find_package(DCMTK DCMTK:: 3.6.7 CONFIG)
angio_find_package(EXPAT EXPAT::)
angio_find_package(VispLibraries visp:: COMPONENTS core visual_features vs robot vision gui)
angio_find_package(LCM lcm::)
angio_find_package(OpenIGTLink openigtlink::)

# Of volumes, and of tests that read what VTK writes: half of all that has to be installed, so that who builds no more than the
# demo needs neither. Behind the others, which VTK finds for itself only.
set(_parts 9.1 COMPONENTS CommonCore CommonDataModel FiltersCore ImagingStencil IOXML)
find_package(VTK ${_parts} QUIET)
if(VTK_FOUND)
  angio_know_package(VTK VTK:: ${_parts})
endif()
