// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/errors.hpp"
#include "angio/messaging/any_message.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/log_writer.hpp"
#include "bus.hpp"

namespace angio::python {
namespace {

py::bytes pythonBytes(const std::vector<std::uint8_t>& bytes) {
  return py::bytes(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

// A disk that is full is no wrong input.
void requireWritten(const std::optional<std::string>& failure) {
  if (!failure) return;
  PyErr_SetString(PyExc_OSError, failure->c_str());
  throw py::error_already_set();
}

void write(LogWriter& log, const std::string& channel, const py::object& message) {
  const std::vector<std::uint8_t> bytes = wireBytes(channel, message);
  log.write(channel, bytes.data(), bytes.size());
  requireWritten(log.failure());
}

}  // namespace

void bindLogs(py::module_& m) {
  py::class_<LogEvent>(m, "LogEvent", doc("LogEvent"))
      .def_readonly("time_us", &LogEvent::time_us, doc("LogEvent.time_us"))
      .def_readonly("position_bytes", &LogEvent::position_bytes, doc("LogEvent.position_bytes"))
      .def_readonly("channel", &LogEvent::channel, "On which it was.")
      .def_property_readonly(
          "bytes", [](const LogEvent& event) { return pythonBytes(event.bytes); }, "As they came.")
      .def(
          "message",
          [](const LogEvent& event) {
            auto decoded = decodeAny(event.bytes.data(), event.bytes.size());
            if (!decoded.value) throw InputError(event.channel, "", "", decoded.error);
            return std::move(*decoded.value);
          },
          "The message, of whatever type it is. Throws InputError that says why there is none.");
  py::class_<LogReader>(m, "LogReader", doc("LogReader"))
      .def(py::init<const std::string&>(), doc("LogReader.LogReader"), "path"_a)
      .def("__iter__", [](const py::object& self) { return self; })
      .def("__next__",
           [](LogReader& log) {
             auto event = log.next();
             if (!event) throw py::stop_iteration();
             return std::move(*event);
           })
      .def("seek", &LogReader::seek, doc("LogReader.seek"), "position_bytes"_a)
      .def_property_readonly("skipped_bytes", &LogReader::skipped_bytes, doc("LogReader.skipped_bytes"))
      .def_property_readonly("size_bytes", &LogReader::size_bytes, doc("LogReader.size_bytes"));
  py::class_<LogWriter>(m, "LogWriter", doc("LogWriter"))
      .def(py::init<const std::string&>(), doc("LogWriter.LogWriter"), "path"_a)
      .def("write", &write,
           "Appends a message, or its bytes, with the present time of the wall clock. Throws OSError when it cannot be "
           "written: the log then ends with its last whole message.",
           "channel"_a, "message"_a)
      .def(
          "finish", [](LogWriter& log) { requireWritten(log.finish()); },
          "Waits until the log is on its disk, and closes it. Throws OSError when messages are missing.")
      .def("__enter__", [](const py::object& self) { return self; })
      .def("__exit__", [](LogWriter& log, const py::args&) { requireWritten(log.finish()); });
}

}  // namespace angio::python
