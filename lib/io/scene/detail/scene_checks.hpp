#pragma once

#include "tunica/io/scene/scene.hpp"

namespace tunica {

/// Parts of check_scene(), with its errors.
void check_rigid(const SceneRigid& rigid);
void check_attachments(const Scene& scene);
void check_contacts(const Scene& scene);

}  // namespace tunica
