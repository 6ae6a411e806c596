#include "surface/triangle_mesh.hpp"
