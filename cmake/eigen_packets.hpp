// Included before all else (cmake/Compiler.cmake). Eigen adds up the numbers of a vector as many at a time as a
// register holds: with AVX four, else two, and in another order. With two everywhere sums have the same bits on every
// processor.
#pragma once

#pragma push_macro("__AVX__")
#pragma push_macro("__AVX2__")
#undef __AVX__
#undef __AVX2__
#include <Eigen/Core>
#pragma pop_macro("__AVX2__")
#pragma pop_macro("__AVX__")
