# SPDX-License-Identifier: GPL-2.0-or-later

# angio_give_namespace(space folder modules...)
#
# Writes angio/<space>/namespace.hpp in the folder: namespace angio::<space>, in which those modules need not be named. A name of
# any other module is an error of the compiler's, so the layers hold in the code as they do in the linker's lists.
function(angio_give_namespace space folder)
  set(_includes)
  set(_usings)
  foreach(_used ${ARGN})
    string(APPEND _includes "#include \"angio/${_used}/namespace.hpp\"\n")
    string(APPEND _usings "using namespace angio::${_used};\n")
  endforeach()
  file(CONFIGURE OUTPUT ${folder}/angio/${space}/namespace.hpp @ONLY CONTENT
"// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

@_includes@
/// The modules that this one uses may be named without their namespaces here.
namespace angio::@space@ {
@_usings@}  // namespace angio::@space@
")
endfunction()

# angio_add_module(module SOURCES ... USES modules... [LINKS outside, seen in headers] [HIDES outside, seen in sources only])
#
# Adds the library angio::<module> with the module's own include folder, which is a component of the installed package. USES accepts
# only modules that already stand. A module without SOURCES is its headers alone: who uses it links nothing of it.
function(angio_add_module module)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;LINKS;HIDES" ${ARGN})
  if(ARG_SOURCES)
    set(_public PUBLIC)
    add_library(angio_${module} STATIC ${ARG_SOURCES})
    target_link_libraries(angio_${module} PRIVATE ${ARG_HIDES})
    # Highway compiles a source once per vector target by including it again: no other may stand in it.
    foreach(_source ${ARG_SOURCES})
      get_filename_component(_source ${_source} ABSOLUTE)
      if(EXISTS ${_source})
        file(STRINGS ${_source} _again REGEX "hwy/foreach_target.h")
        if(_again)
          set_source_files_properties(${_source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
        endif()
      endif()
    endforeach()
    angio_set_unity_batches(angio_${module} 9)
    angio_set_warnings(angio_${module})
  else()
    set(_public INTERFACE)
    add_library(angio_${module} INTERFACE)
  endif()
  add_library(angio::${module} ALIAS angio_${module})
  set_target_properties(angio_${module} PROPERTIES EXPORT_NAME ${module})
  foreach(_used ${ARG_USES})
    if(NOT TARGET angio_${_used})
      message(FATAL_ERROR "module '${module}' uses '${_used}', which does not stand below it")
    endif()
    target_link_libraries(angio_${module} ${_public} angio::${_used})
  endforeach()
  target_include_directories(angio_${module} ${_public}
    $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include> $<BUILD_INTERFACE:${CMAKE_CURRENT_BINARY_DIR}/include>
    $<INSTALL_INTERFACE:include>)
  angio_give_namespace(${module} ${CMAKE_CURRENT_BINARY_DIR}/include ${ARG_USES})
  target_link_libraries(angio_${module} ${_public} ${ARG_LINKS})
  target_compile_features(angio_${module} ${_public} cxx_std_17)
  set_property(GLOBAL APPEND PROPERTY ANGIO_MODULES ${module})
  install(TARGETS angio_${module} EXPORT angio_${module} ARCHIVE DESTINATION lib COMPONENT ${module})
  install(DIRECTORY include/ ${CMAKE_CURRENT_BINARY_DIR}/include/ DESTINATION include COMPONENT ${module} OPTIONAL)
endfunction()

# angio_add_program_part(part SOURCES ... USES modules...): what several programs of a folder have in common, compiled once.
function(angio_add_program_part part)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES" ${ARGN})
  add_library(angio_${part} STATIC ${ARG_SOURCES})
  angio_give_namespace(apps ${CMAKE_CURRENT_BINARY_DIR}/${part}-include ${ARG_USES})
  target_include_directories(angio_${part} PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/${part}-include)
  list(TRANSFORM ARG_USES PREPEND angio::)
  target_link_libraries(angio_${part} PRIVATE ${ARG_USES})
  angio_set_warnings(angio_${part})
endfunction()

# angio_add_program(name SOURCES ... USES modules... [PARTS parts...] [LINKS ...]): a program in build/bin, installed to bin.
function(angio_add_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;PARTS;LINKS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  angio_give_namespace(apps ${CMAKE_CURRENT_BINARY_DIR}/${name}-include ${ARG_USES})
  target_include_directories(${name} PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/${name}-include)
  list(TRANSFORM ARG_USES PREPEND angio::)
  list(TRANSFORM ARG_PARTS PREPEND angio_)
  target_link_libraries(${name} PRIVATE ${ARG_PARTS} ${ARG_USES} ${ARG_LINKS})
  angio_set_warnings(${name})
  install(TARGETS ${name} RUNTIME DESTINATION bin COMPONENT programs)
endfunction()

# angio_add_alias(former program): a program under the name it had, for one minor version.
function(angio_add_alias former program)
  add_custom_command(TARGET ${program} POST_BUILD
    COMMAND ${CMAKE_COMMAND} -E create_symlink ${program} $<TARGET_FILE_DIR:${program}>/${former} VERBATIM)
  install(FILES $<TARGET_FILE_DIR:${program}>/${former} DESTINATION bin COMPONENT programs)
endfunction()

# angio_set_unity_batches(target usual): compiles the target's sources in equal parts of about `usual`, each as one source. Parts of
# exactly that many would leave a rest of a few, for which all headers are read once more.
function(angio_set_unity_batches target usual)
  get_target_property(_sources ${target} SOURCES)
  set(_count 0)
  foreach(_source ${_sources})
    get_source_file_property(_alone ${_source} SKIP_UNITY_BUILD_INCLUSION)
    if(_source MATCHES "\\.cpp$" AND NOT _alone)
      math(EXPR _count "${_count} + 1")
    endif()
  endforeach()
  math(EXPR _parts "(${_count} + ${usual} / 2) / ${usual}")
  if(_parts LESS 1)
    set(_parts 1)
  endif()
  math(EXPR _size "(${_count} + ${_parts} - 1) / ${_parts}")
  set_target_properties(${target} PROPERTIES UNITY_BUILD_BATCH_SIZE ${_size})
endfunction()

function(angio_set_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -fno-math-errno)
  # GCC takes sources that are compiled as one for headers.
  if(CMAKE_UNITY_BUILD)
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
endfunction()
