# SPDX-License-Identifier: GPL-2.0-or-later
# Finds the few ITK 5 libraries that read volumes: Itk_INCLUDE_DIR and Itk_LIBRARIES. ITK's own config is not used: on
# Debian it stops at things that its development package does not bring along (HDF5 for C, GDCM's programs). Paths and
# no targets, so that the installed package can name them without finding ITK again.
set(_itk_versions 5.4 5.3 5.2 5.1)
list(TRANSFORM _itk_versions PREPEND ITK- OUTPUT_VARIABLE _itk_folders)
find_path(Itk_INCLUDE_DIR itkImageIOBase.h PATH_SUFFIXES ${_itk_folders})
set(_itk_required Itk_INCLUDE_DIR)
set(Itk_LIBRARIES)
foreach(_part ITKIOMeta ITKIONIFTI ITKIONRRD ITKIOImageBase ITKCommon itkvnl itksys)
  list(TRANSFORM _itk_versions PREPEND ${_part}- OUTPUT_VARIABLE _itk_names)
  find_library(Itk_${_part}_LIBRARY NAMES ${_itk_names} ${_part})
  mark_as_advanced(Itk_${_part}_LIBRARY)
  list(APPEND _itk_required Itk_${_part}_LIBRARY)
  list(APPEND Itk_LIBRARIES ${Itk_${_part}_LIBRARY})
endforeach()
mark_as_advanced(Itk_INCLUDE_DIR)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(ItkLibraries REQUIRED_VARS ${_itk_required})
