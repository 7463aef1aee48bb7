# SPDX-License-Identifier: GPL-2.0-or-later
# `cpack -G DEB` in the build folder writes three Debian packages: angio-tools has the programs and the example data, libangio-dev the
# modules, and python3-angio, where that is built, the Python module. Who links a module needs the development packages of what it links: libangio-dev depends on those of `registration`,
# the module that stands alone, and recommends those of the others. tests/package/deb.sh tries the packages on a bare Debian.
set(_source ${PROJECT_SOURCE_DIR}/modules/cmake/packages)
set(_folder ${PROJECT_BINARY_DIR}/packages)

# The Debian packages of what AngioDependencies.cmake and AngioItk.cmake know; empty for what each compiler brings.
set(_debian_Threads "")
set(_debian_Eigen3 libeigen3-dev)
set(_debian_OpenCV libopencv-dev)
set(_debian_Ceres libceres-dev)
set(_debian_nanoflann libnanoflann-dev)
set(_debian_hwy libhwy-dev)
set(_debian_yaml-cpp libyaml-cpp-dev)
set(_debian_nlohmann_json nlohmann-json3-dev)
set(_debian_CLI11 libcli11-dev)
set(_debian_ZLIB zlib1g-dev)
set(_debian_zstd libzstd-dev)
set(_debian_OpenSSL libssl-dev)
set(_debian_PNG libpng-dev)
set(_debian_TIFF libtiff-dev)
set(_debian_JPEG libjpeg62-turbo-dev)
set(_debian_DCMTK libdcmtk-dev)
set(_debian_EXPAT libexpat1-dev)
set(_debian_VTK libvtk9-dev)
set(_debian_LCM liblcm-dev)
set(_debian_OpenIGTLink libopenigtlink-dev)
set(_debian_ItkLibraries libinsighttoolkit5-dev)

# angio_debian_packages(out modules...): what the modules and those under them need, sorted.
function(angio_debian_packages out)
  set(_needed)
  foreach(_module ${ARGN})
    foreach(_under ${_under_${_module}} ${_module})
      foreach(_package ${_packages_of_${_under}})
        string(REGEX REPLACE "::.*" "" _whole "${_package}")
        if(_package MATCHES "^VispLibraries::(.+)$")
          string(REPLACE "_" "-" _part "${CMAKE_MATCH_1}")
          list(APPEND _needed libvisp-${_part}-dev)
        elseif(DEFINED _debian_${_whole})
          list(APPEND _needed ${_debian_${_whole}})
        else()
          message(FATAL_ERROR "AngioPackages.cmake does not know which Debian package brings ${_package}, of module '${_under}'")
        endif()
      endforeach()
    endforeach()
  endforeach()
  list(REMOVE_DUPLICATES _needed)
  list(SORT _needed)
  set(${out} ${_needed} PARENT_SCOPE)
endfunction()

get_property(_modules GLOBAL PROPERTY ANGIO_MODULES)
angio_debian_packages(_depends registration)
angio_debian_packages(_recommends ${_modules})
list(REMOVE_ITEM _recommends ${_depends})
list(JOIN _depends ", " _depends)
list(JOIN _recommends ", " _recommends)

# A packager's own: -DANGIO_PACKAGE_MAINTAINER="Name <address>".
set(ANGIO_PACKAGE_MAINTAINER "The AngioServo authors <maintainers@angio.invalid>" CACHE STRING "Maintainer of the Debian packages")
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)

# Each package's own copyright and changelogs. Not part of a plain installation, which has LICENSE.
find_program(ANGIO_GZIP gzip)
mark_as_advanced(ANGIO_GZIP)
if(ANGIO_GZIP)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/CHANGELOG.md)
  string(TIMESTAMP _date "%a, %d %b %Y %H:%M:%S +0000" UTC)
  file(CONFIGURE OUTPUT ${_folder}/changelog.Debian @ONLY CONTENT
"angio (@PROJECT_VERSION@-@CPACK_DEBIAN_PACKAGE_RELEASE@) unstable; urgency=medium

  * Packages written by CPack. What changed for users is in changelog.gz.

 -- @ANGIO_PACKAGE_MAINTAINER@  @_date@
")
  execute_process(COMMAND ${ANGIO_GZIP} -9nc ${PROJECT_SOURCE_DIR}/CHANGELOG.md OUTPUT_FILE ${_folder}/changelog.gz)
  execute_process(COMMAND ${ANGIO_GZIP} -9nc ${_folder}/changelog.Debian OUTPUT_FILE ${_folder}/changelog.Debian.gz)
endif()
set(_packages angio-tools libangio-dev)
if(ANGIO_HAVE_PYTHON)
  list(APPEND _packages python3-angio)
endif()
foreach(_package ${_packages})
  install(FILES ${_source}/copyright DESTINATION share/doc/${_package} COMPONENT ${_package}-doc EXCLUDE_FROM_ALL)
  install(FILES ${_folder}/changelog.gz ${_folder}/changelog.Debian.gz DESTINATION share/doc/${_package}
          COMPONENT ${_package}-doc EXCLUDE_FROM_ALL OPTIONAL)
endforeach()

set(CPACK_PACKAGE_NAME angio)
set(CPACK_PACKAGE_VENDOR "The AngioServo authors")
set(CPACK_PACKAGE_CONTACT "${ANGIO_PACKAGE_MAINTAINER}")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "visual servoing of X-ray C-arms and catheters")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_OUTPUT_FILE_PREFIX ${_folder})
set(CPACK_STRIP_FILES ON)
if(ANGIO_HAVE_PYTHON)
  set(_python_components python python3-angio-doc)
endif()
set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL programs data angio-tools-doc package ${_modules} libangio-dev-doc ${_python_components})
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME angio-tools)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION science)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_TOOLS_DESCRIPTION "The programs of AngioServo, which registers a patient's pre-operative 3D
vessel tree to each live X-ray frame, and with it moves a C-arm, its table
and a catheter drive over LCM. They register (angio-register), compare
methods (angio-evaluate), calibrate (angio-calibrate), extract trees from
volumes (angio-extract-tree), and close the loops (angio-servo), on machines
or in simulation. The example data that they use by default come with them.
Research software, not a medical device.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libangio-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "${_depends}")
set(CPACK_DEBIAN_DEV_PACKAGE_RECOMMENDS "${_recommends}")
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS "liblcm-bin")
set(CPACK_DEBIAN_DEV_DESCRIPTION "Headers and static libraries of AngioServo's modules, the message types in
share/angio/lcm, and the CMake package: find_package(angio COMPONENTS ...)
finds a module and those under it. What the component registration links is
in this package's dependencies. What other components link (VTK, DCMTK, ITK,
LCM and others) is recommended, and only who asks for them needs it.")

if(ANGIO_HAVE_PYTHON)
  # The compiled part is of one version of Python.
  set(_python ${Python3_VERSION_MAJOR}.${Python3_VERSION_MINOR})
  math(EXPR _python_after "${Python3_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON3_PACKAGE_NAME python3-angio)
  set(CPACK_DEBIAN_PYTHON3_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON3_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_PYTHON3_PACKAGE_DEPENDS "python3 (>= ${_python}), python3 (<< 3.${_python_after}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON3_PACKAGE_SUGGESTS "angio-tools, python3-matplotlib")
  set(CPACK_DEBIAN_PYTHON3_DESCRIPTION "AngioServo for Python: trees, cameras and poses as numpy arrays, registration,
certificates, evaluation, calibration, the closed loop frame by frame, and
the messages, bus and logs by which programs and machines talk. Results are
those of the programs in angio-tools, bit for bit.")
endif()

include(CPack)
if(ANGIO_HAVE_PYTHON)
  cpack_add_component_group(python3)
  foreach(_component python python3-angio-doc)
    cpack_add_component(${_component} GROUP python3)
  endforeach()
endif()
cpack_add_component_group(tools)
cpack_add_component_group(dev)
foreach(_component programs data angio-tools-doc)
  cpack_add_component(${_component} GROUP tools)
endforeach()
foreach(_component package ${_modules} libangio-dev-doc)
  cpack_add_component(${_component} GROUP dev)
endforeach()
