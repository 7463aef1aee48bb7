// SPDX-License-Identifier: GPL-2.0-or-later
#include <stdexcept>

#include "angio/base/errors.hpp"
#include "angio/base/interruption.hpp"
#include "binding.hpp"

namespace angio::python {

const char* fieldDoc(const std::string& key) {
  try {
    return doc(key);
  } catch (const std::logic_error&) {
    return "";
  }
}

namespace {

// Wrong input is a ValueError of the same one line.
void translateErrors(py::module_& m) {
  static const py::handle kInputError =
      PyErr_NewExceptionWithDoc("angio.InputError", doc("InputError"), PyExc_ValueError, nullptr);
  m.add_object("InputError", kInputError);
  py::register_local_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const InputError& error) {
      PyErr_SetString(kInputError.ptr(), error.what());
    } catch (const std::invalid_argument& error) {  // What must not go on the wire.
      PyErr_SetString(kInputError.ptr(), error.what());
    } catch (const base::Interrupted&) {
      PyErr_SetNone(PyExc_KeyboardInterrupt);
    }
  });
}

}  // namespace

PYBIND11_MODULE(_angio, m) {
  m.doc() = "Registration of vessel trees to X-ray images, and visual servoing of C-arms by them.";
  translateErrors(m);
  bindGeometry(m);
  bindVessel(m);
  bindFiles(m);
  bindImaging(m);
  bindRegistration(m);
  bindCertificate(m);
  bindMessages(m);
  bindBus(m);
  bindLogs(m);
  bindSimulation(m);
  bindServo(m);
  bindNavigation(m);
  bindEvaluation(m);
  bindCalibration(m);
}

}  // namespace angio::python
