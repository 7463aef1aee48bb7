// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <string>

#include "angio/python/namespace.hpp"

namespace angio::python {

namespace py = pybind11;
using py::literals::operator""_a;

/// The comment of the public headers on "Class.member" or "function". Throws std::logic_error when there is none, which
/// fails the module's import.
const char* doc(const std::string& key);

/// The same of a field, which need not have one.
const char* fieldDoc(const std::string& key);

// Each adds its part of the module; those that are named first are used by the later ones.
void bindGeometry(py::module_& m);
void bindVessel(py::module_& m);
void bindFiles(py::module_& m);
void bindImaging(py::module_& m);
void bindRegistration(py::module_& m);
void bindCertificate(py::module_& m);
void bindMessages(py::module_& m);
void bindBus(py::module_& m);
void bindLogs(py::module_& m);
void bindSimulation(py::module_& m);
void bindServo(py::module_& m);
void bindNavigation(py::module_& m);
void bindEvaluation(py::module_& m);
void bindCalibration(py::module_& m);

}  // namespace angio::python
