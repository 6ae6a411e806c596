#include "volume/volume.hpp"
