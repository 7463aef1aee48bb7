# SPDX-License-Identifier: GPL-2.0-or-later
# The API reference by Doxygen: target `docs`, not built by default, where Doxygen and Python are found. Always configured, so that
# a test can run Doxygen alone: reference/Doxyfile in the build folder, and the list of modules that pages.py reads.
set(_source ${PROJECT_SOURCE_DIR}/modules/cmake/reference)
set(_folder ${PROJECT_BINARY_DIR}/reference)
set(_inputs "\"${_folder}/pages.dox\"")
set(_includes)
set(_listed)
get_property(_modules GLOBAL PROPERTY ANGIO_MODULES)
foreach(_module ${_modules})
  get_target_property(_module_dir angio_${_module} SOURCE_DIR)
  string(APPEND _inputs " \"${_module_dir}/include\"")
  string(APPEND _includes " \"${_module_dir}/include\"")
  get_target_property(_used angio_${_module} INTERFACE_LINK_LIBRARIES)
  list(FILTER _used INCLUDE REGEX "^angio::")
  list(TRANSFORM _used REPLACE "^angio::" "")
  list(JOIN _used " " _used)
  file(RELATIVE_PATH _module_dir ${PROJECT_SOURCE_DIR} ${_module_dir})
  string(APPEND _listed "${_module} ${_module_dir} ${_used}\n")
endforeach()
configure_file(${_source}/Doxyfile.in ${_folder}/Doxyfile @ONLY)
file(CONFIGURE OUTPUT ${_folder}/modules.txt CONTENT "${_listed}" @ONLY)

find_package(Doxygen QUIET)
find_package(Python3 QUIET COMPONENTS Interpreter)
if(DOXYGEN_FOUND AND Python3_FOUND)
  add_custom_target(docs
    COMMAND ${Python3_EXECUTABLE} ${_source}/pages.py ${PROJECT_SOURCE_DIR} ${_folder}/modules.txt ${_folder}/pages.dox
    COMMAND ${DOXYGEN_EXECUTABLE} ${_folder}/Doxyfile
    COMMENT "API reference: ${_folder}/html/index.html"
    VERBATIM)
endif()
