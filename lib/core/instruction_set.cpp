#include "tunica/core/instruction_set.hpp"

namespace tunica {

const char* instruction_set() {
#if defined(__AVX2__) && defined(__BMI2__)
  return "x86-64-v3";
#elif defined(__x86_64__)
  return "x86-64";
#else
  return "other";
#endif
}

}  // namespace tunica
