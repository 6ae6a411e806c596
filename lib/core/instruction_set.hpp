#pragma once

namespace tunica {

/// The instructions that this library was compiled for: "x86-64-v3" (AVX2, FMA), "x86-64" (every 64-bit PC), or
/// "other". A packaged library is there for both, and the system takes the one that its processor can run. They
/// round differently, so that the searches of decimation and fit may end at other triangles.
const char* instruction_set();

}  // namespace tunica
