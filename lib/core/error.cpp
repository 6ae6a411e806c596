#include "tunica/core/error.hpp"

#include <cstring>

namespace tunica {

void assertion_failed(const char* condition, const char* file, int line) {
  const char* name = std::strrchr(file, '/');
  throw InternalError(std::string("internal error, please report it: ") + condition + " does not hold (" +
                      (name != nullptr ? name + 1 : file) + ":" + std::to_string(line) + ")");
}

}  // namespace tunica
