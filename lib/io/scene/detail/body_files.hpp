#pragma once

#include "tunica/io/scene/scene.hpp"

namespace tunica {

/// What the meshes of a scene say beside the bodies they hold.
struct BodyFindings {
  std::vector<Warning> warnings;
  std::optional<std::string> space;  ///< world axes: of the first mesh that says them
  std::filesystem::path space_of;    ///< that mesh
};

/// Read the mesh of a body and make the body. What the mesh's reader refuses is said with the place of the file's name,
/// and so is a mesh in another space than those before.
ShellBody load_shell(const SceneShell& shell, BodyFindings& found);
SolidBody load_solid(const SceneSolid& solid, BodyFindings& found);
RigidBody load_rigid(const SceneRigid& rigid, BodyFindings& found);

}  // namespace tunica
