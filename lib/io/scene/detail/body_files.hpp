#pragma once

#include "tunica/io/scene/scene.hpp"

namespace tunica {

/// Read the mesh of a body and make the body. What the mesh's reader refuses is said with the place of the file's name.
ShellBody load_shell(const SceneShell& shell, std::vector<std::string>& notes);
SolidBody load_solid(const SceneSolid& solid, std::vector<std::string>& notes);
RigidBody load_rigid(const SceneRigid& rigid, std::vector<std::string>& notes);

}  // namespace tunica
