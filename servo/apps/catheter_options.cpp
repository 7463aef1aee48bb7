// SPDX-License-Identifier: GPL-2.0-or-later
#include "catheter_options.hpp"

#include <map>
#include <string>
#include <tuple>

#include "angio/base/errors.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"

namespace angio::apps {

void CatheterOptions::addTo(cli::Command& command) {
  const std::map<std::string, CatheterModel> models{{"kinematic", CatheterModel::kKinematic},
                                                    {"elastic", CatheterModel::kElastic}};
  command
      .addOption("--catheter", model,
                 "kinematic: follows the vessels, fast; elastic: a rod between their walls, with forces in newtons")
      ->check(cli::choice(models))
      ->defaultText("kinematic");
  const auto ofElastic = [&](const char* name, std::optional<double>& value, const char* help, double low,
                             double high) {
    command.addOption(name, value, help)->check(cli::between(low, high))->group(cli::kFurtherOptions);
  };
  ofElastic("--shaft-bending-n-mm2", shaft_bending_n_mm2,
            "Bending stiffness E I of an elastic catheter's shaft; 5 French: some 200", 0.1, 1e4);
  ofElastic("--tip-bending-n-mm2", tip_bending_n_mm2, "The same of its tip", 0.1, 1e4);
  ofElastic("--soft-length-mm", soft_length_mm,
            "Length behind the tip over which the stiffness grows from the tip's to the shaft's", 1, 1000);
  ofElastic("--wall-friction", wall_friction, "Coulomb's coefficient between an elastic catheter and the wall", 0, 0.5);
}

void CatheterOptions::applyTo(CatheterSettings& settings) const {
  ElasticCatheterSettings elastic;
  for (const auto& [name, given, value] :
       {std::tuple{"--shaft-bending-n-mm2", shaft_bending_n_mm2, &elastic.shaft_bending_n_mm2},
        {"--tip-bending-n-mm2", tip_bending_n_mm2, &elastic.tip_bending_n_mm2},
        {"--soft-length-mm", soft_length_mm, &elastic.soft_length_mm},
        {"--wall-friction", wall_friction, &elastic.wall_friction}}) {
    if (!given) continue;
    if (model != CatheterModel::kElastic) throw InputError("command line", name, "", "is of --catheter elastic");
    *value = *given;
  }
  if (model == CatheterModel::kElastic) settings.elastic = elastic;
}

}  // namespace angio::apps
