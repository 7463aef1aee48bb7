// SPDX-License-Identifier: GPL-2.0-or-later
// angio-rehearse: many simulated runs of each task, and what became of them.
#include "angio/cli/program.hpp"
#include "rehearse.hpp"

int main(int argc, char** argv) {
  CLI::App app("Rehearses the tasks in a simulated room, many times, and says how they ended.", "angio-rehearse");
  angio::describeProgram(app, "angio-rehearse view --runs 100 --threads 2 --out views.json");
  app.require_subcommand(1);
  angio::Work work;
  angio::addRehearseView(app, work);
  angio::addRehearseNavigate(app, work);
  angio::addRehearseFaults(app, work);
  angio::addRehearseCentre(app, work);
  return angio::runProgram(app, argc, argv, [&] { return work(); });
}
