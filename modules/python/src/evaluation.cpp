// SPDX-License-Identifier: GPL-2.0-or-later
#include <nlohmann/json.hpp>
#include <sstream>

#include "angio/io/case_files.hpp"
#include "angio/io/measured_motion_file.hpp"
#include "catheter_results.hpp"
#include "evaluate_results.hpp"
#include "fields.hpp"
#include "seen.hpp"
#include "settings.hpp"
#include "unlocked.hpp"

namespace angio::python {
namespace {

using apps::ProgramSettings;

ProgramSettings readProgramSettings(const py::object& settings) {
  return withFields(ProgramSettings{}, settings, "settings");
}

std::vector<Entrant> entrants(const std::vector<std::string>& methods, int starts, bool nonrigid,
                              const ProgramSettings& settings) {
  std::ostringstream warnings;
  auto all = apps::entrantsOf({methods, starts, nonrigid}, settings, warnings);
  if (!warnings.str().empty() && PyErr_WarnEx(PyExc_UserWarning, warnings.str().c_str(), 1) != 0) {
    throw py::error_already_set();
  }
  return all;
}

py::object evaluateCases(const std::string& cases, const std::vector<std::string>& methods, const py::object& settings,
                         const std::string& extractor, int starts, bool nonrigid, bool point_covariance,
                         const py::object& progress) {
  const ProgramSettings program = readProgramSettings(settings);
  const apps::CasesAsked asked{entrants(methods, starts, nonrigid, program), apps::chosenExtractor(program, extractor),
                               program.tracker, point_covariance, nonrigid};
  const PythonCallback report(progress);
  return pythonOf(alone([&] {
    return apps::casesResults(readCaseSet(cases), asked, [&](int done, const std::string&) { report(done); });
  }));
}

SimulationSettings simulationSettings(const py::object& simulation) {
  return withFields(SimulationSettings{}, simulation, "simulation");
}

py::object evaluateSimulation(const std::vector<std::shared_ptr<VesselTree>>& trees,
                              const std::vector<std::string>& methods, const py::object& simulation,
                              const py::object& settings, const std::optional<XrayCamera>& camera,
                              const std::vector<std::string>& motions, const std::string& extractor, int starts,
                              bool nonrigid, const py::object& progress) {
  const ProgramSettings program = readProgramSettings(settings);
  const SimulationSettings world = simulationSettings(simulation);
  SimulationSetup setup;
  for (const auto& tree : trees) {
    if (!tree) throw InputError("", "trees", "None", "must be a VesselTree");
    setup.trees.push_back(*tree);
  }
  if (setup.trees.empty()) throw InputError("", "trees", "", "must be at least one");
  setup.camera = camera;
  for (const std::string& path : motions) setup.motions.push_back(readMeasuredMotion(path));
  setup.entrants = entrants(methods, starts, nonrigid, program);
  setup.extractor = apps::chosenExtractor(program, extractor);
  const PythonCallback report(progress);
  return pythonOf(alone([&] {
    const auto runs = runSimulation(setup, world, [&](int done) { report(done); });
    const auto spacing_m = setup.camera.value_or(simulatedCamera()).parameters().pixel_spacing_m;
    return apps::simulationResults(setup, world, runs, simulationSummaries(runs, spacing_m));
  }));
}

py::object evaluateCatheter(const std::string& cases, const py::object& settings, double period_s, int learn_frames,
                            bool rigid, const py::object& progress) {
  const apps::CatheterSequenceAsked asked{withFields(apps::CatheterSequenceSettings{}, settings, "settings"), period_s,
                                          learn_frames, rigid, nullptr};
  const PythonCallback report(progress);
  return pythonOf(alone(
      [&] { return apps::catheterSequenceResults(readCaseSet(cases), asked, {}, [&](int done) { report(done); }); }));
}

py::object evaluateCatheterRuns(const std::vector<std::string>& trees, int runs, const CatheterRunSettings& run,
                                const py::object& progress) {
  const PythonCallback report(progress);
  return pythonOf(alone([&] {
    return apps::catheterRunsResults({trees, runs, run, nullptr}, [&](int done) { report(done); });
  }));
}

void bindCatheterEvaluations(py::module_& m) {
  const apps::CatheterSequenceAsked sequence;
  m.def("evaluate_catheter", &evaluateCatheter,
        "Locates a catheter's tip in the tree, in each frame of a case set (cases.yaml) whose centrelines are a "
        "catheter's, in the order of time: what `angio-evaluate catheter` writes, as a dict. Settings as a dict or a "
        "file, sections `sequence` and `catheter`; `learn_frames` come first, to learn the pose from, in the run frame "
        "by frame; `rigid`: the vessels are where the tree has them, but for one pose. Ctrl-C ends it with the ways of "
        "looking that are finished, of three.",
        "cases"_a, py::kw_only(), "settings"_a = py::none(), "period_s"_a = sequence.period_s,
        "learn_frames"_a = sequence.learn_frames, "rigid"_a = sequence.rigid, "progress"_a = py::none());
  const CatheterRunSettings usual;
  m.def(
      "evaluate_catheter_runs",
      [](const std::vector<std::string>& trees, int runs, int frames, int seed, double rotation_deg,
         double translation_mm, double deformation_mm, double breath_mm, double beside_mm, double noise_px,
         const py::object& progress) {
        const CatheterRunSettings run{seed,           frames,         rotation_deg,
                                      translation_mm, deformation_mm, breath_mm,
                                      beside_mm,      noise_px,       CatheterRunSettings().spacing_px};
        return evaluateCatheterRuns(trees, runs, run, progress);
      },
      "Registers trees by a simulated catheter that is pushed on in them: what `angio-evaluate catheter-runs` writes, "
      "as a dict. `trees` are files, which the runs take in turn; the other arguments are that program's options. "
      "Ctrl-C ends it with what is finished.",
      "trees"_a, "runs"_a = apps::CatheterRunsAsked().runs, py::kw_only(), "frames"_a = usual.frames,
      "seed"_a = usual.seed, "rotation_deg"_a = usual.rotation_std_deg, "translation_mm"_a = usual.translation_std_mm,
      "deformation_mm"_a = usual.deformation_rms_mm, "breath_mm"_a = usual.breath_mm, "beside_mm"_a = usual.beside_mm,
      "noise_px"_a = usual.noise_px, "progress"_a = py::none());
}

std::vector<OwnedView> viewsOf(const SimulatedTrial& trial) {
  std::vector<OwnedView> views;
  for (std::size_t i = 0; i < trial.cameras.size(); ++i) {
    views.push_back({trial.centerlines[i], trial.cameras[i], trial.T_view_first[i], {}, {}});
  }
  return views;
}

void bindTrial(py::module_& m) {
  BoundStruct<SimulatedTrial>(m, "SimulatedTrial")
      .shows("truth", &SimulatedTrial::truth)
      .shows("start", &SimulatedTrial::start)
      .shows("displacements_m", &SimulatedTrial::displacements_m)
      .shows("filled", &SimulatedTrial::filled)
      .shows("times_s", &SimulatedTrial::times_s)
      .get()
      .def_property_readonly("views", &viewsOf, "What a method is given, calibration errors included.");
  m.def(
      "simulated_trial",
      [](const VesselTree& tree, int index, const py::object& simulation, const std::optional<XrayCamera>& camera) {
        if (index < 0) throw InputError("", "index", std::to_string(index), "must not be negative");
        const SimulationSettings world = simulationSettings(simulation);
        checkSettings("simulation", world);
        return unlocked([&] { return simulatedTrial(tree, camera, world, index); });
      },
      doc("simulatedTrial"), "tree"_a, "index"_a, "simulation"_a = py::none(), py::kw_only(), "camera"_a = py::none());
  m.def(
      "simulated_camera", [] { return simulatedCamera(); }, doc("simulatedCamera"));
}

}  // namespace

void bindEvaluation(py::module_& m) {
  bindTrial(m);
  const std::vector<std::string> usual = {OrientedKernelSettings::kName};
  m.def("evaluate_cases", &evaluateCases,
        "Runs every case of a case set (cases.yaml) with every method: what `angio-evaluate cases` writes, as a dict. "
        "Settings as a dict or a file. Ctrl-C ends it with what is finished.",
        "cases"_a, "methods"_a = usual, py::kw_only(), "settings"_a = py::none(), "extractor"_a = "", "starts"_a = 0,
        "nonrigid"_a = false, "point_covariance"_a = false, "progress"_a = py::none());
  m.def("evaluate_simulation", &evaluateSimulation,
        "Runs simulated trials with known truth: what `angio-evaluate simulation` writes, as a dict. `simulation` is a "
        "dict or a file of its section's keys, `motions` are files of measured motions.",
        "trees"_a, "methods"_a = usual, "simulation"_a = py::none(), py::kw_only(), "settings"_a = py::none(),
        "camera"_a = py::none(), "motions"_a = std::vector<std::string>{}, "extractor"_a = "", "starts"_a = 0,
        "nonrigid"_a = false, "progress"_a = py::none());
  bindCatheterEvaluations(m);
}

}  // namespace angio::python
