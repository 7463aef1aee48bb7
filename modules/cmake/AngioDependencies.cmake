# SPDX-License-Identifier: GPL-2.0-or-later
# Every library from outside, found once. ViSP's and LCM's are found by our own modules: ViSP's config rewrites
# CMAKE_CXX_FLAGS and the standard of whoever calls it, and LCM 1.3 has none.
# The list is included by the installed package as well, so that a build and its users find the same things.
find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(OpenCV 4.5 REQUIRED COMPONENTS core imgproc imgcodecs ximgproc calib3d videoio)
find_package(Ceres 2.1 REQUIRED)
find_package(nanoflann REQUIRED)
find_package(hwy REQUIRED CONFIG)
find_package(yaml-cpp REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)
# Before VTK, which finds the same ones for itself only.
find_package(ZLIB REQUIRED)
find_package(OpenSSL REQUIRED)
find_package(PNG REQUIRED)
find_package(TIFF REQUIRED)
find_package(DCMTK 3.6.7 REQUIRED CONFIG)
find_package(VTK 9.1 REQUIRED COMPONENTS CommonCore IOXMLParser)
find_package(VispLibraries REQUIRED)
find_package(LCM REQUIRED)
