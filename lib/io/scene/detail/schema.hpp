#pragma once

#include "tunica/io/scene/detail/scene_key.hpp"

namespace tunica {

/// A fix says which components it holds: neither "all" nor "none" may be meant by silence.
inline constexpr std::string_view axes_are_said = R"( ("xyz" holds all axes, "" none))";

/// The keys of the sections of a scene, a row each, in the order in which they are written. From a row come the reader,
/// the writer, the check of the range, the flag's help and the key's line in docs/scene.md.
struct SceneSchema {
  SceneKeys<Scene> run;
  SceneKeys<SceneShell> shell;
  SceneKeys<SceneSolid> solid;
  SceneKeys<SceneRigid> rigid;
  SceneKeys<SceneFix> fix;
  SceneKeys<SceneSupport> support;
  SceneKeys<SceneLoad> load;
  SceneKeys<SceneAttach> attach;
  SceneKeys<SceneContact> contact;
  SceneKeys<SceneProbe> probe;
  SceneKeys<SceneAccuracy> accuracy;
};
const SceneSchema& scene_schema();

/// Calls visit(section, keys, items) for all that a scene may hold several of, in the order of a scene file.
template <typename SceneLike, typename Visit>
void for_each_section(SceneLike& scene, const Visit& visit) {
  const SceneSchema& schema = scene_schema();
  visit("shell", schema.shell, scene.shells);
  visit("solid", schema.solid, scene.solids);
  visit("rigid", schema.rigid, scene.rigids);
  visit("fix", schema.fix, scene.fixes);
  visit("support", schema.support, scene.supports);
  visit("load", schema.load, scene.loads);
  visit("attach", schema.attach, scene.attachments);
  visit("contact", schema.contact, scene.contacts);
  visit("probe", schema.probe, scene.probes);
}

/// Calls visit(section, whether it may stand several times, WrittenKeys) for each table of a scene file, in its order.
/// @param folder  to which names of files are relative; empty: as they are
template <typename Visit>
void for_each_written_table(const Scene& scene, const std::filesystem::path& folder, const Visit& visit) {
  const Writing to{&scene, folder};
  visit("run", false, written_keys(scene_schema().run, scene, to));
  for_each_section(scene, [&](std::string_view section, const auto& keys, const auto& items) {
    for (const auto& item : items) {
      visit(section, true, written_keys(keys, item, to));
    }
  });
  if (scene.accuracy) {
    visit("accuracy", false, written_keys(scene_schema().accuracy, *scene.accuracy, to));
  }
}

}  // namespace tunica
